"""fuse: chunks, threads, decimation, starts, ends, refusals, and parts of a recording."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from recordings import ahrs, alike, flight, rows, said, same, split, start, without_samples
from scipy.spatial.transform import Rotation
from scripted_filter import SCRIPTED, scripted

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.compile.jit import Kernel
from strapdown.data.solution import BRIDGED, INVALID, Source
from strapdown.data.vehicle import Vehicle
from strapdown.engine import prepare as preparation
from strapdown.sensor_models.imu import imus
from strapdown.sim.trajectory import DEG

short = pytest.mark.short


def fused(recording, **more):
    return sd.fuse(recording, **{"start": start(recording), **more})


# ---- chunks, threads, decimation


@short
@pytest.mark.parametrize("chunk", [1, 37, 399])
def test_chunks_change_nothing(monkeypatch, chunk):
    recording = without_samples(flight(), (7.0, 7.5), (11.0, 14.0))
    whole = fused(recording)
    monkeypatch.setattr(preparation, "ROWS_AT_ONCE", chunk)
    assert same(fused(recording), whole)
    assert [text.split(":")[0] for _, text in whole.events] == [
        "IMU gap of 0.5 s",
        "IMU gap of 3 s",
    ]


@short
@pytest.mark.parametrize("lost", [1, 5, 40])
def test_many_lost_samples_are_one_event(lost):
    """Each within 10 s of the one before."""
    whole = flight()
    imu = whole.imu
    keep = np.ones(len(imu.t), bool)
    keep[20 : 20 + 8 * lost : 8] = False
    left = replace(whole, imu=imu._replace(**{k: c[keep] for k, c in imu._asdict().items()}))
    step, last = imu.dt[20], imu.t[19 + 8 * (lost - 1)]
    text = f"{lost} IMU gaps of up to {step:.3g} s from here to {last:.1f} s: bridged"
    if lost == 1:
        text = f"IMU gap of {step:.3g} s: bridged"
    assert fused(left).events == ((pytest.approx(imu.t[19]), text),)


@short
def test_progress_rises_to_one(monkeypatch):
    monkeypatch.setattr(preparation, "ROWS_AT_ONCE", 64)
    told = []
    fused(flight(), progress=told.append)
    assert len(told) == 7 and told == sorted(told) and told[-1] == 1.0


def test_ctrl_c_ends_a_run_between_chunks(monkeypatch):
    monkeypatch.setattr(preparation, "ROWS_AT_ONCE", 64)

    def stop(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fused(flight(), progress=stop)


def test_two_threads_at_once_give_what_one_gives():
    recordings = [flight(seconds=60.0, seed=seed) for seed in range(6)]
    alone = [
        fused(recording, filter=name)
        for recording in recordings
        for name in ("closed-loop", "open-loop")
    ]
    with ThreadPoolExecutor(2) as pool:
        together = list(
            pool.map(
                lambda job: fused(job[0], filter=job[1]),
                [(r, name) for r in recordings for name in ("closed-loop", "open-loop")],
            )
        )
    assert all(same(a, b) for a, b in zip(alone, together))


def test_two_threads_may_prepare_at_once():
    """In a new process: the second thread must find the result of the first, not compilation
    switched off."""
    import subprocess
    import sys

    code = (
        "from concurrent.futures import ThreadPoolExecutor\nfrom strapdown.engine.prepare import prepare\n"
        "with ThreadPoolExecutor(4) as pool:\n    list(pool.map(lambda _: prepare('closed-loop', ['position', 'velocity']), range(8)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@short
@pytest.mark.parametrize("every", [7, 400, 1000])
def test_every_nth_row_and_the_last(every):
    all_rows = rows(fused(flight()))
    kept = rows(fused(flight(), every=every))
    np.testing.assert_array_equal(
        kept,
        all_rows[(len(all_rows) - 1) % every :: every] if every < len(all_rows) else all_rows[-1:],
    )


@short
def test_covariance_belongs_to_the_rows():
    solution = fused(flight(), every=10, covariance=True)
    assert solution.covariance.shape == (40, 15, 15)
    np.testing.assert_allclose(
        np.sqrt(np.diagonal(solution.covariance, axis1=1, axis2=2)),
        solution.trajectory.std,
        rtol=1e-14,
    )
    np.testing.assert_array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    assert fused(flight()).covariance is None


# ---- starts and ends


@short
def test_a_start_in_the_middle_uses_what_comes_after():
    recording = flight()
    solution = fused(recording, start=start(recording, 10.0))
    assert solution.t[0] == pytest.approx(10.05) and len(solution.t) == 200
    # the fix at the start's own time is the start's
    assert solution.innovations.t.min() == pytest.approx(11.0)
    assert solution.meta["fixes_outside"] == 20
    assert sd.rms(sd.errors(solution, recording.reference)).position.max() < 2


@short
@pytest.mark.parametrize("share", [0.2, 0.6, 0.999])
def test_a_start_inside_a_sample_uses_the_rest_of_it(share):
    recording, begin = alike()
    inside = recording.imu.t[20] - (1 - share) * recording.imu.dt[20]
    begin = begin._replace(t=float(inside))
    solution, by_hand = (
        sd.fuse(recording, start=begin),
        sd.fuse(split(recording, 20, share), start=begin),
    )
    assert solution.t[0] == recording.imu.t[20]
    np.testing.assert_allclose(rows(solution), rows(by_hand), rtol=1e-11, atol=1e-13)


@short
def test_a_start_before_the_first_sample_is_a_gap():
    recording, begin = alike()
    for early, status, text in (
        (0.8, BRIDGED, "IMU gap of 0.8 s: bridged"),
        (3.0, INVALID, "IMU gap of 3 s: velocity"),
    ):
        solution = sd.fuse(recording, start=begin._replace(t=-early))
        assert (
            solution.status[0] == status
            and solution.events[0][0] == -early
            and text in solution.events[0][1]
        )


@short
def test_the_latitude_limit_ends_a_run_with_its_reason():
    recording, begin = alike()
    begin = begin._replace(
        lla=(np.radians(89) - 50 / 6.4e6, 0.2, 300.0), v_n=(10.0, 0.0, 0.0), rph=(0.0, 0.0, 0.0)
    )
    solution = sd.fuse(recording, start=begin)
    t, text = solution.events[-1]
    assert solution.meta["stopped"] == text and "latitude" in text and 3 < t < 7
    assert (
        solution.t[-1] == pytest.approx(t - 0.05)
        and (np.abs(solution.trajectory.lla[:, 0]) <= np.radians(89)).all()
    )


def test_a_run_that_diverges_ends_with_its_reason():
    recording, begin = alike()
    dv = recording.imu.dv.copy()
    dv[100] = 1e300
    # a bound that lets it through
    let = Vehicle(acceleration=1e303)
    solution = sd.fuse(
        replace(recording, imu=recording.imu._replace(dv=dv)), start=begin, vehicle=let
    )
    assert len(solution.t) in (100, 101) and "diverged" in solution.meta["stopped"]
    # the state stays finite here, the covariance does not
    with pytest.raises(DataError, match="diverged"):
        sd.fuse(recording, start=begin, noise=sd.Noise(1e200, 1e200, 0.0, 0.0, 0.0, 0.0))
    dv[0] = 1e300
    with pytest.raises(DataError, match="closed-loop stopped at 0.05 s: .*diverged"):
        sd.fuse(replace(recording, imu=recording.imu._replace(dv=dv)), start=begin, vehicle=let)


@short
@pytest.mark.parametrize("name", ["closed-loop", "open-loop"])
def test_the_antimeridian_is_crossed(name):
    recording = flight(lla=(DEG * -20, np.pi - 100 / 6.4e6, 100.0))
    solution = fused(recording, filter=name)
    lon = solution.trajectory.lla[:, 1]
    assert np.abs(lon).max() <= np.pi and (lon > 3).any() and (lon < -3).any()
    assert solution.counts() == {"GNSS position": (20, 0), "GNSS velocity": (20, 0)}
    assert sd.rms(sd.errors(solution, recording.reference)).position.max() < 2


# ---- refusals


@short
@pytest.mark.parametrize(
    "wrong, words",
    [
        (dict(filter="closed-lop"), "no filter is called 'closed-lop' (did you mean 'closed-loop'"),
        (
            dict(options={"interval": 3.0}),
            "filter 'closed-loop' has no option 'interval'; it has error_model",
        ),
        (
            dict(options={"error_model": "exact"}),
            "error_model is 'exact'; it must be one of corrected, literal, printed-signs, no-gradient, latitude-gravity",
        ),
        (
            dict(filter="periodic-reset", options={"interval": "x"}),
            "filter 'periodic-reset': interval is 'x'; it must be a number",
        ),
        (
            dict(filter="periodic-reset", options={"interval": None}),
            "interval is None; it must be a number",
        ),
        (
            dict(filter="periodic-reset", options={"interval": True}),
            "interval is True; it must be a number",
        ),
        (
            dict(filter="fixed-gain", options={"k1": [1, 2]}),
            "filter 'fixed-gain': k1 is [1, 2]; it must be a number",
        ),
        (dict(filter="fixed-gain", options={"k1": 1j}), "k1 is 1j; it must be a number"),
        (dict(filter="fixed-gain", options={"k1": np.ones(3)}), "it must be a number"),
        (
            dict(filter="direct-ahrs", options={"correlation": None}),
            "correlation is None; it must be a number",
        ),
        (
            dict(filter="direct-ahrs", options={"bias": ["decaying"]}),
            "bias is ['decaying']; it must be text, such as 'random-walk'",
        ),
        (
            dict(options={"error_model": 3.0}),
            "filter 'closed-loop': error_model is 3.0; it must be text, such as 'corrected'",
        ),
        (dict(every=0), "every is 0; it must be a whole number, 1 or more"),
        (dict(every=2.5), "every is 2.5"),
        (dict(every="5"), "every is '5'; it must be a whole number"),
        (dict(covariance="no"), "covariance is 'no'; it must be True or False"),
        (dict(imu={}), "imu is {}; a dict must have the fields of an ImuSpec"),
        (dict(t="20"), "start: t is '20'; it must be 1 finite number"),
        (dict(imu="tacticle"), "did you mean 'tactical'"),
        (
            dict(noise=(1e-4, float("nan"), 0, 0, 0, 0)),
            "noise: accel is nan; it must be a finite number, 0 or more",
        ),
        (dict(noise=(1e-4, 1e-3, -1, 0, 0, 0)), "noise: gyro_bias is -1"),
        (dict(t=30.0), "the start at 30 s is not before the last IMU sample at 20 s"),
        (dict(t=-1e9), "the start at -1e+09 s is 1000000000 s before the first IMU sample"),
        (dict(t=float("nan")), "start: t is nan"),
        (dict(lla=(1.56, 0.0, 0.0)), "start: latitude is 89.3814 deg; results hold up to 89 deg"),
        (dict(v_n=(1.0, 2.0)), "start: v_n is (1.0, 2.0); it must be 3 finite numbers"),
        (dict(std=(-1.0,) * 15), "start: std has -1; standard deviations must be 0 or more"),
        (dict(std=(1.0,) * 9), "it must be 15 finite numbers"),
        (dict(rph=(0.0, 0.0, 180.0)), "start: rph is (0.0, 0.0, 180.0), in rad; is it in degrees?"),
        (dict(rph="north"), "start: rph is 'north'; it must be 3 finite numbers"),
    ],
)
def test_refused_in_one_line(wrong, words):
    recording = flight()
    parts = {key: wrong.pop(key) for key in ("t", "lla", "v_n", "std", "rph") if key in wrong}
    if "noise" in wrong:
        wrong["noise"] = sd.Noise(*wrong["noise"])
    if wrong.get("filter") in ("fixed-gain", "direct-ahrs"):
        recording = replace(recording, sources=(*recording.sources, ahrs(recording.reference)))
    with pytest.raises(DataError) as error:
        fused(recording, start=start(recording)._replace(**parts), **wrong)
    assert words in str(error.value) and "\n" not in str(error.value)


@short
@pytest.mark.parametrize("wrong", [None, "a.toml"])
def test_what_is_no_recording_is_to_be_read_first(wrong):
    with pytest.raises(DataError) as error:
        sd.fuse(wrong)
    text = "it must be a Recording: read it first with sd.read"
    assert str(error.value) == f"recording is {wrong!r}; {text}"


@short
def test_options_may_be_any_real_number():
    recording = flight()
    whole = [
        fused(recording, filter="periodic-reset", options={"interval": value})
        for value in (5, 5.0, np.float32(5), np.int64(5))
    ]
    assert all(same(whole[0], other) for other in whole[1:])


@short
def test_a_start_that_is_none():
    for wrong in ((0.0, 0.0, 0.0), {"rph": (0.0, 0.0, 0.0)}):
        with pytest.raises(DataError, match="it must be an InitialState, such as `align` gives"):
            sd.fuse(flight(), start=wrong)


@short
def test_a_noise_that_is_none():
    good = sd.imu("tactical").noise()
    for wrong in (
        good._asdict(),
        tuple(good),
        0,
        5,
        good._replace(gyro="small"),
        good._replace(accel=None),
    ):
        with pytest.raises(
            DataError, match="it must be a Noise of numbers, such as an ImuSpec gives"
        ):
            sd.fuse(flight(), noise=wrong)


def test_an_imu_that_nobody_named():
    recording = replace(flight(), meta={})
    with pytest.raises(DataError) as error:
        fused(recording)
    assert all(name in str(error.value) for name in imus())
    noise = sd.Noise(1e-4, 1e-3, 1e-6, 1e-5, 0.0, 0.0)
    assert fused(recording, noise=noise).meta["noise"] == noise._asdict()
    with pytest.raises(DataError, match="give imu="):
        sd.fuse(recording, noise=noise)  # the alignment needs it


@short
@pytest.mark.short
def test_a_start_takes_a_unit_quaternion_and_no_other():
    turn = Rotation.from_euler("ZYX", [200.0, -30.0, 120.0], degrees=True)
    x, y, z, w = turn.as_quat()
    for sign in (1, -1):
        begin = start(flight()).towards(sign * np.array([w, x, y, z]))
        assert Rotation.from_euler("ZYX", begin.rph[::-1]).approx_equal(turn, 1e-12)
    for wrong in (
        (1.0, 0.0, 0.1, 0.0),
        (1.0, 0.0, 0.0),
        (np.nan, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0),
    ):
        with pytest.raises(ValueError, match="q_nb is .* it must be four numbers, scalar first"):
            start(flight()).towards(wrong)


@pytest.mark.short
@pytest.mark.parametrize(
    "name, words",
    [
        ("attitude-mekf", "not observed and drift"),
        ("mahony", "not observed and drift"),
        ("vru", "no source of height"),
        ("closed-loop", ""),
    ],
)
def test_what_nothing_observes_is_said(name, words):
    bare = replace(flight(), sources=())
    notes = sd.fuse(bare, name, start=start(flight())).meta["notes"]
    assert (
        words == ""
        and not notes
        or len(notes) == 1
        and words in notes[0]
        and notes[0].startswith(name)
    )


def test_an_unknown_aiding_is_refused():
    recording = flight()
    with pytest.raises(DataError, match="no aiding is of kind 'positon' .did you mean 'position'"):
        fused(replace(recording, sources=(replace(recording.sources[0], kind="positon"),)))


@short
def test_slow_compilation_is_announced_at_most_once():
    said = []
    fused(flight(), notify=said.append)
    assert sum("for the first time" in text for text in said) <= 1
    said.clear()
    fused(flight(), notify=said.append)
    assert said == []


@short
@pytest.mark.parametrize(
    "kind, fixes, lifted, in_vain",
    [
        # "." passes its gate, "x" does not, "?" measures nothing; once a second
        ("altitude", "xxxxxx.xxxxx", [6], []),  # one lift helped
        ("altitude", "xxxxxxxxxxx.", [6], []),  # and the second: one event until it holds again
        ("altitude", "x" * 12 + "xxxx", [6], []),  # three did not, but the record ends
        ("altitude", "x" * 12 + "xxxxx", [6], [12]),
        ("altitude", "xxxxxxx?xxxx" + "xxxxx", [6], [12]),
        ("altitude", "x" * 12 + "xxxx." + "x" * 17, [6, 23], [29]),  # passes after four
        ("altitude", "x" * 6 + "." + "x" * 6 + ".", [6], []),  # within 10 s: one event
        ("position", "x" * 30 + ".", [6], []),  # lifted as often as it takes
    ],
)
def test_a_source_is_left_out_where_lifting_did_not_help(kind, fixes, lifted, in_vain):
    recording, begin = alike(40.0, 5.0)
    nis = [{".": 1.0, "x": 100.0, "?": np.nan}[each] for each in fixes]
    solution = sd.fuse(replace(recording, sources=(scripted(nis, kind),)), SCRIPTED, start=begin)
    text = "script: gate opened after 5 or more rejections in a row over 3 s"
    assert said(solution, "gate opened") == [(t, text) for t in lifted]
    assert [t for t, _ in said(solution, "did not help")] == in_vain


# ---- parts of a recording


@short
def test_between_keeps_what_lies_within():
    part = flight().between(5.0, 10.0)
    assert part.imu.t[0] == pytest.approx(5.05) and part.imu.t[-1] == pytest.approx(10.0)
    assert part.span == (pytest.approx(5.0), pytest.approx(10.0))
    assert all(a.t.tolist() == pytest.approx([5, 6, 7, 8, 9, 10]) for a in part.sources)
    with pytest.raises(
        DataError,
        match="no IMU samples between 30 and 40 s; the recording covers 0.000 to 20.000 s",
    ):
        flight().between(30, 40)


@short
def test_hidden_withholds_recorded_fixes_and_keeps_constraints():
    t = np.arange(0.5, 20.0, 0.5)
    lateral = Source("zero-lateral-velocity", t, np.zeros((len(t), 1)), np.ones((len(t), 1)))
    recording = replace(flight(), sources=(*flight().sources, lateral))
    hidden = recording.hidden([(5.0, 8.0), (10.0, 12.0)])
    assert (
        hidden.sources[0].t.tolist() == pytest.approx([1, 2, 3, 4, 8, 9, *range(12, 21)])
        and len(hidden.sources[1].t) == 15
    )
    assert hidden.sources[2] is lateral
    assert [
        len(a.t)
        for a in recording.hidden([(5.0, 8.0)], kinds=["velocity", "zero-lateral-velocity"]).sources
    ] == [20, 17, 33]
    solution = fused(recording.hidden([(5.0, 8.0)]))
    used = solution.innovations.t[solution.innovations.source == 0]
    assert not ((used >= 5) & (used < 8)).any() and solution.meta["fixes_outside"] == 0


@short
def test_no_fixes_at_all():
    recording, begin = alike()
    solution = sd.fuse(recording, start=begin)
    assert (
        solution.counts() == {}
        and len(solution.t) == 200
        and (np.diff(solution.trajectory.std[:, 0]) > 0).all()
    )
    with pytest.raises(DataError, match="no position fix to start from"):
        sd.fuse(recording)


@pytest.mark.short
def test_compiling_tells_which_filter_it_is_for(monkeypatch):
    said = []
    monkeypatch.setattr(Kernel, "at_hand", False)
    # without the compiler nothing is kept, and nothing is said either
    monkeypatch.setattr(Kernel, "why_not_kept", "")
    preparation.prepare("mahony", ["magnetic-field"], said.append)
    assert said[0].startswith("compiling mahony for the first time on this machine")
