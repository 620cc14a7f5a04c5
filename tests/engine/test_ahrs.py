"""Attitude from an AHRS that runs first: its rate, its deviations, what it takes over, what is
refused."""

from dataclasses import replace

import numpy as np
import pytest
from around import beside, only, recorded, recording
from recordings import rows, same, without_samples
from scipy.spatial.transform import Rotation
from synthetic import flight as circling, solution as made_up

import strapdown as sd
from strapdown.checks import DataError
from strapdown.engine import with_ahrs
from strapdown.engine.options import run_options
from strapdown.engine.with_ahrs import ASSUMED, REMEDY, deviations
from strapdown.filters import find, names
from strapdown.filters.ins.closed_loop import CLOSED_LOOP
from strapdown.sensor_models.magnetometer import Magnetometer

FED = CLOSED_LOOP._replace(name="fed", needs=("attitude",))


def source(recording, ahrs, **asked):
    return with_ahrs.source(recording, ahrs, run_options(**asked))


def same_innovations(first, second):
    return np.array_equal(
        first.innovations.innovation, second.innovations.innovation, equal_nan=True
    )


def notes(solution):
    return "\n".join(solution.meta["notes"])


# ---- what the AHRS gives


@pytest.mark.short
def test_deviations_are_those_of_the_turned_covariance():
    solution = made_up(circling(60.0))
    path = solution.trajectory
    path = replace(path, std=path.std * np.r_[np.ones(6), 3, np.ones(8)])
    solution = replace(solution, trajectory=path)
    north, east, down = solution.trajectory.std[:, 6:9].T
    forward = Rotation.from_rotvec(
        solution.trajectory.rph[:, 2:] * [0, 0, 1]
    ).as_matrix()  # its columns: forward, right, down in n
    for row, found in enumerate(deviations(solution.trajectory)):
        P = np.diag([north[row] ** 2, east[row] ** 2, down[row] ** 2])
        assert found == pytest.approx(
            np.sqrt(np.diag(forward[row].T @ P @ forward[row])), rel=1e-12
        )
    ahead = replace(
        solution,
        trajectory=replace(
            solution.trajectory,
            q_nb=np.tile([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], (len(solution.t), 1)),
        ),
    )
    # heading east: forward is east
    assert deviations(ahead.trajectory) == pytest.approx(np.c_[east, north, down])


@pytest.mark.short
@pytest.mark.parametrize("rate, every", [(20.0, 1), (10.0, 2), (10, 2), (3.0, 7), (0.4, 50)])
def test_it_is_the_solution_at_every_nth_sample(rate, every):
    alone = sd.fuse(recording(), "attitude-mekf", every=every)
    made, said = source(recording(), find("attitude-mekf"), ahrs_rate=rate)
    assert (
        made.kind == "attitude"
        and made.name == "attitude-mekf"
        and said[0] == f"attitude from attitude-mekf at {20 / every:.4g} Hz"
    )
    assert (
        np.array_equal(made.t, alone.t)
        and np.array_equal(made.y, alone.trajectory.rph)
        and np.array_equal(made.std, deviations(alone.trajectory))
    )
    assert np.isin(made.t, recording().imu.t).all() and np.diff(made.t) == pytest.approx(every / 20)
    truth = recording().reference
    error = (made.y - truth.rph[np.searchsorted(truth.t, made.t - 1e-6)] + np.pi) % (
        2 * np.pi
    ) - np.pi
    assert np.abs(error / made.std).max() < 4


@pytest.mark.short
def test_nothing_in_a_gap_and_nothing_of_its_invalid_row():
    gaps = without_samples(recording(), (5.0, 5.5), (10.0, 13.0))
    alone, (made, _) = (
        sd.fuse(gaps, "attitude-mekf"),
        source(gaps, find("attitude-mekf"), ahrs_rate=20.0),
    )
    assert (alone.status != 0).sum() == len(alone.t) - len(made.t) > 0
    assert not ((made.t > 5.01) & (made.t < 5.49) | (made.t > 10.01) & (made.t < 12.99)).any()


@pytest.mark.short
def test_without_claimed_deviations_stated_ones_are_assumed():
    silent = find("mahony")._replace(states=())
    solution = sd.fuse(recording(), FED, ahrs=silent, every=50)
    assert "mahony claims no standard deviations: 1.5, 1.5, 5 deg" in notes(solution)
    made, _ = source(recording(), silent)
    assert (made.std == ASSUMED).all() and np.isfinite(made.y).all()


@pytest.mark.short
@pytest.mark.parametrize("name, kinds", [("vru", ("magnetic-field",))])
def test_a_heading_that_is_not_known_is_not_measured(name, kinds):
    made, said = source(only(*kinds), find(name))
    assert (
        np.isfinite(made.y[:, :2]).all()
        and np.isnan(made.y[:, 2]).all()
        and np.isnan(made.std[:, 2]).all()
    )
    assert f"{name} gives roll and pitch and no heading" in said
    solution = sd.fuse(only("position", "velocity", *kinds), "closed-loop", ahrs=name)
    used = solution.innovations.innovation[
        solution.innovations.source == len(solution.innovations.names) - 1
    ]
    assert (
        np.isfinite(used[:, :2]).all()
        and np.isnan(used[:, 2]).all()
        and np.isfinite(rows(solution)).all()
    )


@pytest.mark.short
def test_what_the_ahrs_has_to_say_is_said():
    imu, ahrs = recording().imu, find("attitude-mekf")
    heavy = replace(recording(), imu=imu._replace(dv=imu.dv * 1.4))
    told = ahrs._replace(diagnose=lambda t, lla, columns: [(0.0, "leans")])
    assert "attitude-mekf: leans" in source(heavy, told)[1]
    assert "attitude-mekf: leans" not in source(heavy, ahrs)[1]


@pytest.mark.short
def test_one_that_begins_in_motion_says_so():
    text = "attitude-mekf began in motion, at 0.0 s: its attitude may be off by tens of degrees"
    assert text in notes(sd.fuse(recording(), FED, every=100))
    still = sd.simulate(
        "static", 40.0, "tactical", 1, 20.0, magnetometer=Magnetometer(rate=2.0), date="2024-05-01"
    )
    assert "began in motion" not in notes(sd.fuse(still.between(0.0, 20.0), FED, every=100))
    # 1 m/s^2: an engine that runs, and no motion
    shaken = 0.05 * np.random.default_rng(1).normal(size=still.imu.dv.shape)
    shaken = replace(still, imu=still.imu._replace(dv=still.imu.dv + shaken))
    assert source(shaken, find("attitude-mekf"))[1] == ["attitude from attitude-mekf at 10 Hz"]


# ---- when it runs


@pytest.mark.short
def test_it_runs_where_attitude_is_needed_and_missing():
    solution = sd.fuse(recording(), FED)
    assert "attitude from attitude-mekf at 10 Hz, which alone uses magnetometer" in notes(solution)
    assert (
        solution.innovations.names == ("GNSS position", "GNSS velocity", "attitude-mekf")
        and solution.meta["kinds"]["attitude-mekf"] == "attitude"
    )
    times = solution.innovations.t[solution.innovations.source == 2]
    assert (
        solution.meta["start"]["t"] < times[0]
        and np.diff(times) == pytest.approx(0.1)
        and solution.meta["fixes_outside"] <= 2
    )
    error = sd.errors(solution, recording().reference).rph[100:]
    assert np.degrees(np.sqrt(np.mean(error**2, axis=0))).max() < 2
    assert same(solution, sd.fuse(recording(), FED, ahrs="attitude-mekf"))  # by name: the same
    plain = sd.fuse(recording(), "closed-loop")
    assert "attitude" not in plain.meta["kinds"].values() and "attitude from" not in notes(plain)


@pytest.mark.short
def test_recorded_attitude_needs_no_ahrs():
    solution = sd.fuse(beside(recorded(), kinds=("position", "velocity", "magnetic-field")), FED)
    assert (
        "attitude from" not in notes(solution)
        and "box" in solution.innovations.names
        and "magnetometer" in solution.innovations.names
    )


@pytest.mark.short
def test_one_that_is_named_takes_the_place_of_recorded_attitude():
    with_box = beside(
        recorded(off=(0.3, 0.3, 1.0)), kinds=("position", "velocity", "magnetic-field")
    )
    solution = sd.fuse(with_box, FED, ahrs="attitude-mekf")
    assert (
        "in place of the recorded box" in notes(solution)
        and "box" not in solution.innovations.names
    )
    # neither the AHRS nor the start has seen the box
    assert same(solution, sd.fuse(recording(), FED))


@pytest.mark.short
def test_without_anything_that_measures_the_heading():
    bare = only("position", "velocity")
    with pytest.raises(
        DataError,
        match="^fed needs attitude aiding, and the recording has none: add an attitude record or a magnetometer .* --ahrs attitude-mekf",
    ):
        sd.fuse(bare, FED)
    drifting = sd.fuse(bare, FED, ahrs="attitude-mekf")
    assert "attitude-mekf: no magnetic field and no heading" in notes(drifting)
    hidden = recording().hidden([(-1.0, 100.0)], ("magnetic-field",))
    with pytest.raises(DataError, match="fed needs attitude aiding"):
        sd.fuse(hidden, FED)


@pytest.mark.short
def test_the_ahrs_begins_with_a_heading_that_is_known():
    bare, imu = only("position", "velocity"), sd.imu("tactical")
    known = sd.align(bare, imu, heading=2.2)
    for at in (known, known._replace(t=known.t - 1000)):  # the other one is outside of the record
        made, _ = source(bare, find("attitude-mekf"), start=at)
        truth = recording().reference
        error = (made.y[:, 2] - truth.rph[np.searchsorted(truth.t, made.t - 1e-6), 2] + np.pi) % (
            2 * np.pi
        ) - np.pi
        assert (
            (np.degrees(made.std[:, 2]).max() < 3)
            == (np.degrees(np.abs(error)).max() < 3)
            == (at is known)
        )
    rough, _ = source(
        recording(),
        find("attitude-mekf"),
        start=known._replace(std=known.std[:8] + (2.0,) + known.std[9:]),
    )
    # the field knows better
    assert np.array_equal(rough.y, source(recording(), find("attitude-mekf"))[0].y)


@pytest.mark.short
def test_hidden_fixes_are_hidden_from_the_ahrs_too():
    hidden = recording().hidden([(8.0, 14.0)])
    solution = sd.fuse(hidden, FED)
    t = solution.innovations.t[solution.innovations.source == 2]
    # it goes on by gyros and specific force,
    assert ((t > 8) & (t < 14)).sum() == pytest.approx(60, abs=1)
    made, whole = (
        source(hidden, find("attitude-mekf"))[0],
        source(recording(), find("attitude-mekf"))[0],
    )
    later = np.searchsorted(made.t, 13.9)
    assert made.std[later, 2] > whole.std[later, 2]  # and knows the heading less


@pytest.mark.short
def test_smoothing_runs_it_as_well():
    fed = find("attitude-mekf")._replace(name="smoothable", needs=("attitude",), uses=("attitude",))
    filtered, smoothed = (run(recording(), fed, every=20) for run in (sd.fuse, sd.smooth))
    assert notes(filtered) == notes(smoothed) and same_innovations(filtered, smoothed)
    assert (smoothed.trajectory.std[:, 8] <= filtered.trajectory.std[:, 8] * (1 + 1e-9)).all()
    assert (
        sd.smooth(recording(), fed, ahrs_rate=5, every=20).counts()["attitude-mekf"][0]
        < smoothed.counts()["attitude-mekf"][0]
    )


@pytest.mark.short
@pytest.mark.parametrize("name", [name for name in names() if "attitude" in find(name).needs])
def test_every_filter_that_needs_attitude_is_fed(command, file, tmp_path, name):
    solution = sd.fuse(recording(), name)
    assert (
        "attitude from attitude-mekf at 10 Hz" in notes(solution)
        and solution.counts()["attitude-mekf"][0] > 150
    )
    assert np.degrees(np.abs(sd.errors(solution, recording().reference).rph[200:])).max() < 6
    sd.write_recording(only("position", "velocity"), tmp_path / "bare.nc")
    code, _, err = command(
        "fuse", tmp_path / "bare.nc", "--filter", name, "--out", tmp_path / "out"
    )
    assert code == 2 and err == [
        f"strapdown: {name} needs attitude aiding, and the recording has none: {REMEDY}"
    ]


# ---- what is refused


@pytest.mark.short
@pytest.mark.parametrize(
    "rate, text",
    [
        (0, "is 0 Hz; it must be a number above 0"),
        (-1.0, "-1.0 Hz"),
        (np.nan, "nan Hz"),
        (np.inf, "inf Hz"),
        ("10", "'10' Hz"),
        (None, "None Hz"),
        (True, "True Hz"),
        (21.0, "is 21 Hz; it must be at most the IMU's 20 Hz"),
    ],
)
def test_rates(rate, text):
    with pytest.raises(DataError, match=text):
        sd.fuse(recording(), FED, ahrs_rate=rate)


@pytest.mark.short
def test_a_rate_without_an_ahrs_is_refused():
    with pytest.raises(
        DataError,
        match="^ahrs_rate is 5 Hz, but no AHRS runs: closed-loop runs without one; leave it out, or name an AHRS",
    ):
        sd.fuse(recording(), "closed-loop", ahrs_rate=5)
    with pytest.raises(
        DataError, match="but no AHRS runs: the recording has its attitude; leave it out"
    ):
        sd.fuse(beside(recorded()), FED, ahrs_rate=5.0)


@pytest.mark.short
@pytest.mark.parametrize(
    "filter, ahrs, text",
    [
        (
            "closed-loop",
            "mahonny",
            "^no AHRS is called 'mahonny'; did you mean 'mahony'\\? there are: attitude-mekf, mahony, vru$",
        ),
        ("closed-loop", "attitude-mek", "did you mean 'attitude-mekf'"),
        ("closed-loop", "open-loop", "open-loop is not an AHRS, .* attitude-mekf, mahony, vru"),
        ("mahony", "attitude-mekf", "mahony does not use the attitude of an AHRS"),
    ],
)
def test_names(filter, ahrs, text):
    with pytest.raises(DataError, match=text):
        sd.fuse(recording(), filter, ahrs=ahrs)


@pytest.mark.short
@pytest.mark.parametrize(
    "wrong, text",
    [
        ("foo", "start is 'foo'; it must be an InitialState"),
        ({"std": (1.0,) * 3}, "start: std is .* it must be 15 finite numbers"),
        ({"t": None}, "start: t is None"),
        ({"rph": None}, "start: rph is None"),
    ],
)
def test_a_wrong_start_is_refused_before_the_ahrs_has_it(wrong, text):
    start = (
        wrong
        if isinstance(wrong, str)
        else sd.align(recording(), sd.imu("tactical"))._replace(**wrong)
    )
    for filter, more in (("direct-ahrs", {}), ("closed-loop", {"ahrs": "attitude-mekf"})):
        with pytest.raises(DataError, match=f"^{text}"):
            sd.fuse(recording(), filter, start=start, **more)


@pytest.mark.short
def test_other_needs_are_told_by_name():
    needy = CLOSED_LOOP._replace(name="needy", needs=("pressure", "position", "heading"))
    with pytest.raises(
        DataError,
        match="^needy needs pressure and heading aiding, and the recording has none: add a source of that kind$",
    ):
        sd.fuse(recording(), needy)
    assert sd.fuse(recording(), CLOSED_LOOP._replace(needs=("position",)), every=100).counts()


@pytest.mark.short
def test_the_imu_must_be_known_even_beside_a_start():
    nameless = replace(
        recording(), meta={key: value for key, value in recording().meta.items() if key != "grade"}
    )
    imu = sd.imu("tactical")
    with pytest.raises(DataError, match="does not name its IMU"):
        sd.fuse(nameless, FED, start=sd.align(nameless, imu), noise=imu.noise())
    assert sd.fuse(nameless, FED, imu=imu, start=sd.align(nameless, imu), every=100).counts()


def in_order(sources):
    return sorted(
        sd.Measurement(t, s, y, e)
        for s, a in enumerate(sources)
        for t, y, e in zip(a.t, a.y, a.std)
    )


@pytest.mark.short
def test_a_stream_is_given_attitude():
    start = sd.align(recording(), sd.imu("tactical"))
    with pytest.raises(
        DataError, match="^fed needs attitude aiding, and the recording has none: add an"
    ):
        sd.Stream(FED, start=start, imu="tactical", sources=recording().sources[:2])
    sources = beside(recorded())
    stream, imu = sd.Stream(FED, start=start, imu="tactical", sources=sources.sources), sources.imu
    fixes = in_order(sources.sources)
    for k, t in enumerate(imu.t):
        while fixes and fixes[0].t <= t:
            stream.step(fixes.pop(0))
        stream.step(sd.Sample(t, imu.dt[k], tuple(imu.dtheta[k]), tuple(imu.dv[k])))
    solution = sd.fuse(sources, FED, start=start)
    assert np.array_equal(stream.finish().lla, solution.trajectory.lla[-1])
    assert dict(zip(solution.innovations.names, stream.counts())) == solution.counts()


def test_one_that_gives_no_attitude_for_long_says_so():
    """A wild sample at 10 s: its roll and pitch are doubtful until they are levelled again. Then
    they come again, in the batch and live."""
    whole = recording(60.0)
    dv = whole.imu.dv.copy()
    dv[199, 0] = 1e6
    fixes = tuple(a for a in whole.sources if a.kind in ("position", "velocity"))
    wild = replace(whole, sources=fixes, imu=whole.imu._replace(dv=dv))
    start = sd.align(whole, sd.imu("tactical"))
    solution = sd.fuse(wild, FED, start=start, ahrs="vru")
    assert "vru gave no attitude from 9.9 to 40.1 s: its samples" in notes(solution)
    stream = sd.Stream(FED, start=start, imu="tactical", sources=fixes, ahrs="vru")
    pending, imu = in_order(fixes), wild.imu
    for k, t in enumerate(imu.t):
        while pending and pending[0].t <= t:
            stream.step(pending.pop(0))
        stream.step(sd.Sample(t, imu.dt[k], tuple(imu.dtheta[k]), tuple(imu.dv[k])))
    stream.finish()
    ((t, text),) = [event for event in stream.events if "no attitude" in event[1]]
    assert t == pytest.approx(15.0, abs=0.1) and "for 30 s, until 40 s" in text
    assert "gave no attitude" not in notes(sd.fuse(whole, FED, start=start, ahrs="vru"))


# ---- the command line, and a recorded flight


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("around") / "around.nc"
    sd.write_recording(recording(), path)
    return path


@pytest.mark.short
def test_command(command, file, tmp_path):
    code, out, err = command(
        "fuse", file, "--ahrs", "attitude-mekf", "--ahrs-rate", 4, "--out", tmp_path / "out"
    )
    assert (code, err) == (
        0,
        [],
    ) and "note: attitude from attitude-mekf at 4 Hz, which alone uses magnetometer" in out
    assert (
        "attitude-mekf: " in out
        and "magnetometer: " not in out
        and "heading from attitude-mekf, roll and pitch from attitude-mekf" in out
    )
    code, out, err = command("fuse", file, "--ahrs", "vru", "--out", tmp_path / "vru")
    assert (code, err) == (0, []) and "vru gives roll and pitch and no heading" in out


@pytest.mark.short
@pytest.mark.parametrize(
    "words, text",
    [
        (("--ahrs", "closed-loop"), "closed-loop is not an AHRS"),
        (("--ahrs", "x"), "no AHRS is called 'x'"),
        (("--ahrs", "mahony", "--ahrs-rate", "0"), "ahrs_rate is 0.0 Hz"),
        (("--ahrs-rate", "nan"), "ahrs_rate is nan Hz"),
        (("--ahrs", "vru", "--ahrs-rate", "21"), "at most the IMU's 20 Hz"),
        (("--ahrs-rate", "-1"), "-1.0 Hz"),
        (("--ahrs", "vru", "--filter", "vru"), "vru does not use the attitude"),
        (("--ahrs-rate", "x"), "--ahrs-rate"),
    ],
)
def test_command_refuses_in_one_line(command, file, tmp_path, words, text):
    code, _, err = command("fuse", file, "--out", tmp_path / "out", *words)
    assert code == 2 and len(err) == 1 and text in err[0] and not (tmp_path / "out").exists()


@pytest.mark.short
def test_filters_say_what_they_need(command):
    _, out, _ = command("filters")
    header, *lines = out.splitlines()
    place = slice(header.index("needs"), None)
    needs = {line.split()[0]: line[place].strip() for line in lines if line.split()}
    assert header.split() == ["filter", "good", "for", "needs"]
    assert needs["closed-loop"] == "position" and needs["mahony"] == ""


def test_a_flight_with_a_magnetometer(data_folder, monkeypatch):
    from pathlib import Path

    monkeypatch.setenv("STRAPDOWN_DATA", str(data_folder))
    flight = sd.read(Path(__file__).parents[2] / "examples" / "recordings" / "thor75-attitude.toml")
    solution = sd.fuse(flight, FED, every=10)
    assert "attitude from attitude-mekf at 10 Hz, which alone uses magnetic-field" in notes(
        solution
    )
    # the first position fix, standing
    assert solution.meta["start"]["t"] == pytest.approx(22.04, abs=0.01)
    good, bad = solution.counts()["attitude-mekf"]
    # of 6743 rows; while the AHRS doubts its attitude, none is handed on
    assert 0.97 * 6743 < good + bad < 6748 and bad < 0.2 * good
    assert np.degrees(sd.rms(sd.errors(solution, flight.reference), (240.0, 575.0)).rph).max() < 8
