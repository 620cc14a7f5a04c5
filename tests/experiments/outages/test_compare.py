"""Filters through the same outages: bit for bit the runs of `fuse`, with one start for all;
failures stay in the result; bad input is one line."""

import re
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from recordings import flight, rows, turning

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.solution import Trajectory
from strapdown.data.vehicle import Vehicle
from strapdown.evaluation.metrics import moving_windows
from strapdown.experiments.outages import runs
from strapdown.experiments.outages.compare import _events
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer

SCORES = [
    "north_rmse_m",
    "east_rmse_m",
    "down_rmse_m",
    "horizontal_end_m",
    "velocity_end_m_s",
    "heading_rmse_deg",
]
FIXES = ("position", "velocity")


@cache
def sensed(seconds=60.0, shift=0.013, interval=1.0):
    """A turning flight with GNSS every `interval` s, a `shift` (s) off the samples, a magnetometer
    and a barometer, whose offset the filters estimate."""
    magnetometer, barometer = (
        Magnetometer(rate=10.0, field=(21e-6, 1.6e-6, 43.9e-6)),
        Barometer(rate=2.0, drift=50.0),
    )
    made = sd.simulate(
        turning(),
        seconds,
        "industrial",
        4,
        20.0,
        Gnss(interval, lever_arm=(0.3, -0.2, -0.5)),
        magnetometer=magnetometer,
        barometer=barometer,
    )
    late = lambda a: replace(a, t=a.t + shift, y=a.y[: len(a.t)])
    return replace(made, sources=tuple(late(a) if a.kind in FIXES else a for a in made.sources))


@pytest.fixture
def solutions(monkeypatch):
    """{(filter, start of the outage): Solution of its rows} of the comparisons of a test."""
    kept = {}

    def keep(solution, outage, scored=runs.score_outage):
        kept[solution.meta["filter"], outage.start] = solution
        return scored(solution, outage)

    monkeypatch.setattr(runs, "score_outage", keep)
    return kept


def same_rows(part, whole):
    """Assert that the rows of a Solution are those of another one at the same times, bit for
    bit."""
    first = int(np.searchsorted(whole.t, part.t[0]))
    assert len(part.t) > 10 and np.array_equal(
        rows(part), rows(whole)[first : first + len(part.t)], equal_nan=True
    )


# ---- the runs


@pytest.mark.parametrize("outages", ["7@20:58/4.321", "22:30,40.02:49"])
def test_an_outage_is_bit_for_bit_a_run_without_its_fixes(solutions, outages):
    recording, labels = (
        sensed(),
        [
            "closed-loop",
            "periodic-reset:interval=5",
            "direct-ahrs",
            "fixed-gain:k1=0.6",
            "mekf",
            "open-loop",
        ],
    )
    found = sd.compare(recording, labels, outages=outages)
    start = sd.InitialState(**found.settings["start"])
    for label in labels:
        name, options = label.partition(":")[0], found.settings["options"][label]
        for window in found.windows:
            hidden = recording.hidden([window] if found.sweep else found.windows, FIXES)
            same_rows(
                solutions[name, window[0]], sd.fuse(hidden, name, start=start, options=options)
            )
    assert any(
        "GNSS velocity" in names and "barometer" in names
        for names in found.settings["sources"].values()
    )
    assert found.sweep == ("@" in outages) and not found.summary["failures"].any()


@pytest.mark.parametrize("outages", ["7@20:58/4.321", "22:30,40.02:49"])
def test_a_filter_that_estimates_the_installation_goes_through_the_outages_of_fuse(
    solutions, outages
):
    # fixes wait for 0.3 s: some that are stamped before a window are used in it
    recording, label = sensed(interval=0.2), "closed-loop:estimate=clock+lever-arm"
    found = sd.compare(recording, [label], outages=outages, threads=3)
    start = sd.InitialState(**found.settings["start"])
    for window in found.windows:
        hidden = recording.hidden([window] if found.sweep else found.windows, FIXES)
        whole = sd.fuse(hidden, start=start, estimate=["clock", "lever-arm"])
        same_rows(solutions["closed-loop", window[0]], whole)
    assert found.settings["options"][label]["estimate"] == "clock+lever-arm"


def test_with_and_without_estimates_stand_side_by_side():
    labels = ["closed-loop", "closed-loop:estimate=none", "closed-loop:estimate=clock"]
    found = sd.compare(sensed(), labels, outages="22:30,40.02:49", estimate="clock,lever-arm")
    rmse = found.scores.set_index(["filter", "outage"])["north_rmse_m"].unstack(0)
    assert len(found.paired) == 12 and (rmse.diff(axis=1).iloc[:, 1:].abs() > 0).all().all()
    alone = sd.compare(sensed(), "closed-loop", outages="22:30,40.02:49").scores["north_rmse_m"]
    np.testing.assert_array_equal(rmse["closed-loop:estimate=none"], alone)


@pytest.mark.parametrize("filter", ["closed-loop", "mekf"])
@pytest.mark.short
def test_a_few_samples_of_it(solutions, filter):
    recording = flight(20.0)
    found = sd.compare(recording, [filter], outages="5@8:18/5", threads=1)
    for window in found.windows:
        same_rows(
            solutions[filter, window[0]],
            sd.fuse(
                recording.hidden([window], FIXES),
                filter,
                start=sd.InitialState(**found.settings["start"]),
            ),
        )


def test_an_ahrs_that_uses_what_is_withheld_runs_anew_for_each_outage(solutions):
    """Its output of the whole recording knows the magnetic field of the outage."""
    recording, kinds = sensed(), (*FIXES, "magnetic-field")
    found = sd.compare(recording, ["direct-ahrs", "closed-loop"], outages="8@20:50/11", kinds=kinds)
    start = sd.InitialState(**found.settings["start"])
    for window in found.windows:
        for name in found.filters:
            same_rows(
                solutions[name, window[0]],
                sd.fuse(recording.hidden([window], kinds), name, start=start),
            )
    whole = sd.fuse(recording, "direct-ahrs", start=start)  # the comparison can tell
    with pytest.raises(AssertionError):
        same_rows(solutions["direct-ahrs", found.windows[0][0]], whole)


def test_an_ahrs_that_all_outages_together_leave_nothing_runs_for_each(solutions):
    recording, kinds = sensed(), (*FIXES, "magnetic-field")
    late = replace(
        recording,
        sources=tuple(
            a.between(22.0, 99.0) if a.kind == "magnetic-field" else a for a in recording.sources
        ),
    )
    found = sd.compare(late, ["closed-loop", "direct-ahrs"], outages="19@22:60/19", kinds=kinds)
    assert not found.summary["failures"].any() and {name for name, _ in solutions} == {
        "closed-loop",
        "direct-ahrs",
    }
    hidden = late.hidden([found.windows[0]], kinds)
    whole = sd.fuse(hidden, "direct-ahrs", start=sd.InitialState(**found.settings["start"]))
    part = solutions["direct-ahrs", 22.0]
    # a failure soon after the outage makes the rows up to it doubtful, and the part has none
    first = int(np.searchsorted(whole.t, part.t[0]))
    status = whole.status.copy()
    status[first : first + len(part.t)] = part.status
    same_rows(part, replace(whole, status=status))


def test_the_scores_are_those_of_std_outages():
    recording = sensed()
    found = sd.compare(recording, ["closed-loop", "open-loop"], outages="22:30,40:49")
    for name in found.filters:
        solution = sd.fuse(
            recording.hidden(found.windows, FIXES),
            name,
            start=sd.InitialState(**found.settings["start"]),
        )
        own = found.scores[found.scores["filter"] == name]
        for outage, (_, row) in zip(
            sd.outages(solution, recording.reference, found.windows), own.iterrows()
        ):
            assert outage.rms == pytest.approx(
                [row["north_rmse_m"], row["east_rmse_m"], row["down_rmse_m"]], rel=1e-9
            )
            assert (outage.horizontal_max, outage.horizontal_end) == pytest.approx(
                (row["horizontal_max_m"], row["horizontal_end_m"]), rel=1e-9
            )
            e = sd.rms(sd.errors(solution, recording.reference), (outage.start, outage.stop))
            assert row["heading_rmse_deg"] == pytest.approx(np.degrees(e.rph[2]), rel=1e-9)
            assert row["velocity_rmse_m_s"] == pytest.approx(np.linalg.norm(e.velocity), rel=1e-9)


# ---- fairness


@pytest.mark.short
def test_all_filters_have_the_same_start_noise_and_fixes_withheld(monkeypatch):
    given = []

    def begin(recording, filter, asked, begin=runs.begin):
        run = begin(recording, filter, asked)
        given.append(
            (asked["start"], run.start, run.noise, [tuple(a.t) for a in run.recording.sources])
        )
        return run

    monkeypatch.setattr(runs, "begin", begin)
    recording = flight(20.0)
    found = sd.compare(recording, ["closed-loop", "open-loop", "mekf"], outages="8:12,14:18")
    assert (
        len(given) == 3 and all(each == given[0] for each in given) and given[0][0] == given[0][1]
    )
    hidden = recording.hidden(found.windows)
    assert given[0][0] == sd.align(hidden, sd.imu("tactical")) and given[0][3] == [
        tuple(a.t) for a in hidden.sources
    ]
    assert (
        found.settings["withheld"] == {a.name: 8 for a in recording.sources}
        and found.settings["noise"] == sd.imu("tactical").noise()._asdict()
    )
    assert found.settings["start"]["note"].startswith("position and velocity at")


@pytest.mark.short
def test_the_start_knows_nothing_of_what_is_withheld():
    recording = flight(20.0)
    spoil = lambda a: replace(a, y=np.where(((a.t >= 8) & (a.t < 12))[:, None], np.nan, a.y))
    spoilt = replace(recording, sources=tuple(map(spoil, recording.sources)))
    first, second = (
        sd.compare(each, ["closed-loop"], outages="8:12") for each in (recording, spoilt)
    )
    pd.testing.assert_frame_equal(first.scores, second.scores)


@pytest.mark.short
def test_the_order_of_filters_and_the_number_of_threads_change_nothing():
    names = ["closed-loop", "mekf", "open-loop"]
    one, other = (
        sd.compare(flight(20.0), names, outages="4@8:18/3", threads=1),
        sd.compare(flight(20.0), names[::-1], outages="4@8:18/3", threads=3),
    )
    for name in names:
        a, b = (
            each.scores[each.scores["filter"] == name].reset_index(drop=True)
            for each in (one, other)
        )
        pd.testing.assert_frame_equal(a, b)
    pair = lambda made, a, b: made.paired.query(
        f"a == '{a}' and b == '{b}' and axis == 'horizontal'"
    ).iloc[0]
    assert pair(one, "closed-loop", "open-loop")["ratio"] == pytest.approx(
        1 / pair(other, "open-loop", "closed-loop")["ratio"], rel=1e-12
    )
    assert list(one.scores["filter"].unique()) == names and list(other.filters) == names[::-1]


def test_a_given_start_and_noise_are_used():
    noise, start = (
        sd.imu("consumer").noise(),
        sd.align(sensed(), sd.imu("industrial"))._replace(b_a=(0.1, 0.0, 0.0)),
    )
    found = sd.compare(
        sensed(),
        [("closed-loop", {"error_model": "corrected"})],
        outages="22:30",
        start=start,
        noise=noise,
    )
    solution = sd.fuse(sensed().hidden([(22.0, 30.0)], FIXES), start=start, noise=noise)
    assert found.scores["north_rmse_m"][0] == pytest.approx(
        sd.outages(solution, sensed().reference, [(22.0, 30.0)])[0].rms[0], rel=1e-9
    )


def test_default_filters_are_all_that_estimate_a_position_but_the_slow_ones():
    found = sd.compare(sensed(40.0), outages="25:35")
    assert {"closed-loop", "direct-ahrs", "fixed-gain"} <= set(found.filters) and not {
        "attitude-mekf",
        "mahony",
        "vru",
        "pkf",
    } & set(found.filters)
    named = sd.compare(flight(20.0), "pkf:components=2", outages="8:12")
    assert (
        set(named.filters) == {"pkf:components=2"}
        and np.isfinite(named.scores["north_rmse_m"]).all()
    )


# ---- what does not work


def test_a_filter_that_cannot_run_stays_with_what_it_said():
    found = sd.compare(flight(20.0), ["closed-loop", "fixed-gain"], outages="8:12,14:18")
    own = found.scores[found.scores["filter"] == "fixed-gain"]
    assert (
        len(own) == 2
        and own["north_rmse_m"].isna().all()
        and own["said"].str.contains("needs attitude aiding").all()
    )
    assert (
        found.tracks["fixed-gain"] == [None, None]
        and np.isfinite(found.scores["north_rmse_m"][:2]).all()
    )
    assert (
        list(found.summary["failures"]) == [0, 2]
        and found.paired["ratio"].isna().all()
        and found.table()[("North", "fixed-gain")].isna().all()
    )
    with pytest.raises(
        DataError, match="no filter completed any outage; fixed-gain: .*needs attitude"
    ):
        sd.compare(flight(20.0), ["fixed-gain"], outages="8:12")


@pytest.mark.parametrize(
    "outages, scored",
    [("4:6,8:12,14:18", [True, False, False]), ("2@4:18/4", [True, False, False, False])],
)
@pytest.mark.short
def test_a_filter_that_stops_keeps_the_outages_before(outages, scored):
    """A force that throws it beyond 89 deg of latitude at 9 s: in the second outage, and before
    the others."""
    recording = flight(20.0)
    dv = recording.imu.dv.copy()
    dv[np.searchsorted(recording.imu.t, 9.0)] = 1e9
    thrown = replace(recording, imu=recording.imu._replace(dv=dv))
    # a bound that lets it through
    let = Vehicle(acceleration=1e12)
    found = sd.compare(thrown, ["closed-loop"], outages=outages, vehicle=let)
    assert (
        list(np.isfinite(found.scores["horizontal_rmse_m"])) == scored
        and [track is not None for track in found.tracks["closed-loop"]] == scored
    )
    assert all(
        bool(said) != good and (good or "stopped at 9" in said)
        for said, good in zip(found.scores["said"], scored)
    )


REFUSED = [
    (dict(outages="8:12,10:14"), "overlap"),
    (dict(outages="300/600"), "longer than the recording"),
    (dict(outages="15:25"), "outside the recording"),
    (dict(outages="0:5"), "before the end of the alignment"),
    (dict(outages="1:5"), "before the end of the alignment"),
    (dict(outages="8.1:8.4"), "no fix of position or velocity"),
    (dict(outages="5@8:18/0"), "step is 0.0 s"),
    (dict(outages="ten"), "'ten' is not a window"),
    (dict(filters=["kalman"]), "no filter is called 'kalman'"),
    (dict(filters=["closed-loop:gain=2"]), "no option 'gain'"),
    (dict(filters=["mahony"]), "mahony estimates no position"),
    (dict(filters=[]), "no filter"),
    (dict(filters=["mekf", "mekf"]), "'mekf' is given twice"),
    (dict(filters=["mekf:estimate=clok"]), "estimate is 'clok' (did you mean 'clock'?)"),
    (dict(filters=["fixed-gain:estimate=clock"]), "fixed-gain cannot estimate clock; these can"),
    (dict(estimate="scale"), "no source of the recording has a scale"),
    (dict(filters=[5]), "5 is not a filter"),
    (dict(filters=[("mekf", 5)]), "is not a filter"),
    (dict(kinds=()), "kinds is empty"),
    (dict(kinds=("gnss",)), "'gnss'"),
    (dict(kinds="heading"), "no fix of heading"),
    (dict(threads=0), "threads is 0"),
    (dict(start=5.0), "must be an InitialState"),
    (dict(imu="best"), "best"),
    (dict(filters=["fixed-gain"], ahrs="mekf"), "not an AHRS"),
    (dict(ahrs="nope"), "'nope', which is not an AHRS; there are: attitude-mekf"),
    (dict(ahrs=5), "not an AHRS"),
    (dict(filters=[("periodic-reset", {"interval": None})]), "interval is None"),
    (dict(filters=[("periodic-reset", {"interval": [1]})]), "interval is [1]"),
    (dict(filters=5), "filters is 5"),
    (dict(kinds=None), "kinds is None"),
    (dict(kinds=5), "kinds is 5"),
    (dict(kinds=[["position"]]), "kinds is [['position']]"),
    (dict(noise=5), "noise is 5"),
    (dict(noise=0), "noise is 0"),
    (dict(recording="flight.nc"), "recording is 'flight.nc'; it must be a Recording"),
    (dict(recording=None), "recording is None"),
    (dict(outages="1e-8/2e-8"), "more than 5000 windows"),
    (dict(outages="8:8.06"), "shorter than two IMU samples"),
    (dict(filters=["mekf", "mekf:"]), "'mekf' is given twice"),
    (
        dict(filters=["periodic-reset:interval=5", ("periodic-reset", {"interval": 5})]),
        "'periodic-reset:interval=5' is given twice",
    ),
    (
        dict(filters=["fixed-gain:k1=0.6,k2=0.5", "fixed-gain: k2=0.50, k1=.6"]),
        "'fixed-gain:k1=0.6,k2=0.5' is given twice",
    ),
]


@pytest.mark.parametrize("given, said", REFUSED, ids=[said for _, said in REFUSED])
@pytest.mark.short
def test_bad_input_is_refused_in_a_line(given, said):
    with pytest.raises(DataError) as error:
        sd.compare(
            **{"recording": flight(20.0), "filters": ["closed-loop"], "outages": "8:12", **given}
        )
    assert said in str(error.value) and "\n" not in str(error.value)


def test_without_a_reference_the_withheld_fixes_are_it():
    """They are known to decimetres, outages of 20 s drift by metres: the scores are those by the
    truth to a few tenths."""
    drive = sd.simulate("car", duration=150.0, imu="industrial", seed=5)
    by_truth, by_fixes = (
        sd.compare(each, ["closed-loop"], outages="70:90,110:130")
        for each in (drive, replace(drive, reference=None))
    )
    assert any("no reference: errors are against the withheld fixes" in n for n in by_fixes.notes)
    assert not any("no reference" in note for note in by_truth.notes)
    for column, within in (("horizontal_rmse_m", 0.6), ("velocity_rmse_m_s", 0.1)):
        off = by_fixes.scores[column] - by_truth.scores[column]
        assert off.abs().max() < within
    assert by_fixes.scores["heading_rmse_deg"].isna().all()
    assert by_truth.scores["heading_rmse_deg"].notna().all()
    assert by_fixes.reference.std is not None and (by_fixes.scores["coverage_3"] > 0.9).all()


@pytest.mark.short
def test_with_neither_a_reference_nor_positions_it_is_refused():
    velocity = tuple(a for a in flight(20.0).sources if a.kind == "velocity")
    alone = replace(flight(20.0), reference=None, sources=velocity)
    with pytest.raises(DataError, match="no reference to score against, and no fixes of position"):
        sd.compare(alone, ["closed-loop"], outages="8:12", start=sd.align(flight(20.0)))


@pytest.mark.parametrize(
    "change, said",
    [
        (
            lambda reference: replace(reference, lla=np.full_like(reference.lla, np.nan)),
            "has no position",
        ),
        (
            lambda reference: replace(reference, t=reference.t + 1000),
            r"the reference covers 10\d\d\S* to 1020 s, but the recording 0 to 20 s; check its clock",
        ),
        (lambda reference: replace(reference, t=reference.t - 18), "reference"),
    ],
)
@pytest.mark.short
def test_a_reference_that_cannot_score_is_refused(change, said):
    with pytest.raises(DataError, match=said) as error:
        sd.compare(
            replace(flight(20.0), reference=change(flight(20.0).reference)),
            ["closed-loop"],
            outages="8:12",
        )
    assert "\n" not in str(error.value)


@pytest.mark.short
def test_a_recording_without_an_imu_grade_or_positions_is_refused():
    bare = replace(flight(20.0), meta={})
    with pytest.raises(DataError, match="does not name its IMU"):
        sd.compare(bare, ["closed-loop"], outages="8:12")
    with pytest.raises(DataError, match="no position fix to start from"):
        sd.compare(replace(flight(20.0), sources=()), ["closed-loop"], outages="8:12")


@pytest.mark.parametrize("outages", ["3:", "3:19,19.5:20", "2@3:20/2", "3/4", [(0.0, 20.0)]])
@pytest.mark.short
def test_an_outage_before_the_alignment_of_all_fixes_is_refused(outages):
    """A flight whose fixes begin late: without those of the outage it could start later, or not
    at all."""
    made = flight(20.0)
    late = replace(made, sources=tuple(a.between(5.0, 99.0) for a in made.sources))
    with pytest.raises(
        DataError,
        match=r"begins before the end of the alignment, at 5 s; give later outages \(or, in Python",
    ):
        sd.compare(late, ["closed-loop"], outages=outages)


def test_events_are_noted_by_kind_with_the_range_of_their_numbers():
    """Times are of the run, so "here" has no meaning in a note."""
    held = lambda seconds: (9.0, f"held for {seconds} s in all, first here")
    gnss = (9.0, "GNSS2: left out from here until 1 passes")
    results = [
        [({}, None, [held(21.9), held(3)]), ({}, None, [held("1e-05"), gnss]), "stopped"],
        ["stopped", ({}, None, [held(3)]), "stopped"],
    ]
    assert _events(["a", "b"], results) == [
        "in the runs with outages: held for 1e-05 to 21.9 s in all (runs: a 2, b 1)",
        "in the runs with outages: GNSS2: left out until 1 passes (runs: a 1)",
    ]


# ---- around it


@pytest.mark.short
def test_a_fix_of_several_windows_is_withheld_once_and_an_idle_ahrs_is_noted():
    found = sd.compare(flight(20.0), ["closed-loop:"], outages="4@8:18/1", ahrs="mahony")
    assert (
        found.settings["withheld"] == {a.name: 10 for a in flight(20.0).sources}
        and len(found.windows) == 7
    )
    assert (
        "mahony was not used, because none of these filters needs an attitude" in found.notes
        and found.filters == ("closed-loop",)
    )


def test_a_sweep_without_a_range_begins_a_minute_after_the_start():
    found = sd.compare(sensed(90.0), ["closed-loop"], outages="10@/5")
    assert (
        found.windows[0][0] == pytest.approx(found.settings["start"]["t"] + 60.0)
        and found.windows[-1][1] <= 90.0
    )


@pytest.mark.short
def test_progress_comes_to_one_and_files_are_written(tmp_path, monkeypatch):
    seen = []
    found = sd.compare(
        flight(20.0), ["closed-loop", "mekf"], outages="3@8:18/3", progress=seen.append
    )
    assert seen[-1] == pytest.approx(1.0) and seen == sorted(seen)
    found.write(tmp_path / "out")
    for name in ("scores", "summary", "paired", "growth"):
        read = pd.read_csv(tmp_path / "out" / f"{name}.csv", keep_default_na=False, na_values=[""])
        assert list(read.columns) == list(getattr(found, name).columns) and len(read) == len(
            getattr(found, name)
        )
    table = pd.read_csv(tmp_path / "out" / "table.csv", index_col="outage")
    assert table["North closed-loop, m"].to_numpy() == pytest.approx(
        found.table()[("North", "closed-loop")].to_numpy(), rel=1e-6
    )
    assert re.search(
        "compar|outage", (tmp_path / "out" / "index.html").read_text(), re.I
    ) and "2 filters, 3 outages" in repr(found)


def test_an_imu_gap_is_noted():
    recording = flight(20.0)
    keep = (recording.imu.t <= 9.0) | (recording.imu.t > 9.4)
    found = sd.compare(
        replace(recording, imu=Imu(*(column[keep] for column in recording.imu))),
        ["closed-loop", "mekf"],
        outages="8:12",
    )
    assert any("IMU gap of 0.4 s" in note for note in found.notes)


def test_drive_is_scored_as_fuse_scores_it(data_folder, solutions, monkeypatch):
    """The reference point of the car is not its IMU, and the reference is the withheld RTK
    itself."""
    monkeypatch.setenv("STRAPDOWN_DATA", str(data_folder))
    recording = sd.read("examples/recordings/drive0708-vehicle.toml")
    windows = moving_windows(
        recording.reference, count=2, length=15.0, every=50.0, after=60.0, speed=4.0
    )
    found = sd.compare(recording, ["closed-loop"], outages=windows)
    whole = sd.fuse(
        recording.hidden(windows, FIXES), start=sd.InitialState(**found.settings["start"])
    )
    for window in windows:
        same_rows(solutions["closed-loop", window[0]], whole)
    assert found.scores["heading_rmse_deg"].isna().all() and isinstance(found.reference, Trajectory)


def test_what_was_said_before_an_outage_is_not_of_the_outage():
    """A gap of the samples and a jump of the position long before it."""
    from recordings import without_samples

    from strapdown.geometry.geodesy import displace_lla

    recording = flight(seconds=60.0)
    fix, *others = recording.sources
    y = fix.y.copy()
    late = fix.t > 20
    y[late] = displace_lla(y[late], np.tile([0.0, 50.0, 0.0], (late.sum(), 1)))
    spoilt = replace(recording, sources=(replace(fix, y=y), *others))
    found = sd.compare(
        without_samples(spoilt, (10.0, 10.5)), ["closed-loop"], outages=[(45.0, 50.0)]
    )
    assert not [note for note in found.notes if "IMU gap" in note or "gate opened" in note]
    (doubtful,) = [note for note in found.notes if note.startswith("doubtful in the run")]
    assert doubtful.startswith("doubtful in the run through all outages: closed-loop ")
    assert 10 < float(doubtful.split()[-2]) < 41 and doubtful.endswith(" s")


def test_standard_deviations_of_the_fixes_count_in_the_coverage(monkeypatch):
    """With a reference that is known to 100 m, all errors are within one standard deviation."""
    module = sys.modules["strapdown.experiments.outages.compare"]
    drive = replace(sd.simulate("car", duration=100.0, imu="industrial", seed=5), reference=None)
    right = module.smoothed_fixes

    def coarse(*given):
        found = right(*given)
        return replace(found, std=np.full_like(found.std, 100.0))

    monkeypatch.setattr(module, "smoothed_fixes", coarse)
    found = sd.compare(drive, ["closed-loop"], outages="70:90")
    assert (found.scores["coverage_1"] == 1.0).all() and (
        found.scores["down_coverage_1"] == 1
    ).all()


def test_an_outage_takes_the_vector_between_two_antennas_too():
    """It is of GNSS; where kinds are named, only those are withheld."""
    sensor = Simulated("baseline", 0.005, 2.0, (1.2, 0.0, 0.0))
    recording = sd.simulate("car", duration=60.0, seed=3, sensors=[sensor])
    found = sd.compare(recording, ["closed-loop"], outages="10@30:55/11")
    assert found.kinds == ("position", "velocity", "baseline")
    named = sd.compare(recording, ["closed-loop"], outages="10@30:55/11", kinds="position")
    assert named.kinds == ("position",)
