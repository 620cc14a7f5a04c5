"""Scores of outages against plain formulas and a peer package, and what they say together
against closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pymap3d
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.experiments.outages.protocols import protocol
from strapdown.experiments.outages.result import Comparison
from strapdown.experiments.outages.scores import ErrorTrack, outages_of, score_outage
from strapdown.experiments.outages.summaries import blocks, overlap_factor, ratio
from strapdown.geometry.geodesy import displace_lla

pytestmark = pytest.mark.short
RATE, ORIGIN = 10, np.array([0.8, 0.1, 200.0])
T = np.arange(1, 1001) / RATE
START = SimpleNamespace(t=0.0)


def truth(t=T):
    """A way of 20 m/s north and 5 m/s east, climbing, with an attitude that turns."""
    v = np.tile([20.0, 5.0, -0.5], (len(t), 1))
    q = Rotation.from_euler("ZYX", np.c_[0.02 * t, 0.1 + 0 * t, -0.2 + 0 * t]).as_quat()[
        :, [3, 0, 1, 2]
    ]
    return Trajectory(t, displace_lla(np.tile(ORIGIN, (len(t), 1)), v * t[:, None]), v, q)


def recording(fixes=np.arange(0.5, 100.0), reference=None):
    imu = Imu(T, np.full(len(T), 1 / RATE), np.zeros((len(T), 3)), np.zeros((len(T), 3)))
    position = Source("position", fixes, np.zeros((len(fixes), 3)), np.ones((len(fixes), 3)))
    return Recording(imu, (position,), truth() if reference is None else reference)


def outage(text, **changed):
    made = recording(**changed)
    (found, *_), notes = outages_of(
        protocol(text, made.span, 100.0, None), made, made.reference, ("position",), START
    )
    return found, notes


# ---- one outage


def test_scores_are_those_of_plain_formulas():
    rng, window = np.random.default_rng(5), outage("20:50")[0]
    rows = slice(window.first, window.last)
    true = Trajectory(T[rows], *(part[rows] for part in (truth().lla, truth().v_n, truth().q_nb)))
    n, off = len(true.t), rng.normal(0, [3.0, 5.0, 2.0], (len(true.t), 3)).cumsum(axis=0) / 5
    dv, turn = rng.normal(0, [0.2, 0.3, 0.1], (n, 3)), rng.normal(0, 0.01, (n, 3))
    rph = true.rph - turn
    q = Rotation.from_euler("ZYX", rph[:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    std = np.hstack([np.tile([3.0, 4.0, 2.0], (n, 1)), np.ones((n, 12))])
    estimate = Trajectory(true.t, displace_lla(true.lla, -off), true.v_n - dv, q, std)
    row, track = score_outage(SimpleNamespace(trajectory=estimate), window)

    degrees = lambda lla: (np.degrees(lla[:, 0]), np.degrees(lla[:, 1]), lla[:, 2])
    # a peer's, in the frame of the estimate
    e = np.column_stack(pymap3d.geodetic2ned(*degrees(true.lla), *degrees(estimate.lla)))
    rms = lambda x: np.sqrt(np.mean(x**2))
    expected = {f"{axis}_rmse_m": rms(e[:, i]) for i, axis in enumerate(("north", "east", "down"))}
    expected |= {
        "north_end_m": e[-1, 0],
        "east_end_m": e[-1, 1],
        "down_end_m": e[-1, 2],
        "horizontal_end_m": np.hypot(*e[-1, :2]),
        "horizontal_rmse_m": rms(np.hypot(e[:, 0], e[:, 1])),
        "horizontal_max_m": np.hypot(e[:, 0], e[:, 1]).max(),
    }
    for name, value in expected.items():
        assert row[name] == pytest.approx(value, rel=2e-4, abs=2e-4), name
    assert [
        row[f"velocity_{axis}_rmse_m_s"] for axis in ("north", "east", "down")
    ] == pytest.approx([rms(c) for c in dv.T])
    assert row["velocity_rmse_m_s"] == pytest.approx(rms(np.linalg.norm(dv, axis=1)))
    assert row["velocity_end_m_s"] == pytest.approx(np.linalg.norm(dv[-1]))
    assert [row[f"{name}_rmse_deg"] for name in ("roll", "pitch", "heading")] == pytest.approx(
        [np.degrees(rms(c)) for c in turn.T]
    )
    within = [(np.abs(e) <= k * std[:, :3]).mean(axis=0) for k in (1, 2, 3)]
    assert [row[f"coverage_{k}"] for k in (1, 2, 3)] == pytest.approx(
        [share[:2].mean() for share in within], abs=1e-9
    )
    assert [row[f"down_coverage_{k}"] for k in (1, 2, 3)] == pytest.approx(
        [share[2] for share in within], abs=1e-9
    )
    assert window.distance == pytest.approx(30 * np.hypot(20, 5), rel=1e-3)
    assert row["drift_percent"] == pytest.approx(100 * row["horizontal_end_m"] / window.distance)
    assert (
        track.since[0] == pytest.approx(0.0, abs=1e-6)
        and track.since[-1] == pytest.approx(30.0)
        and np.allclose(track.error, e, atol=5e-3)
    )


def test_an_outage_ends_before_the_next_fix_is_used():
    assert T[outage("20:50")[0].last - 1] == pytest.approx(50.0)  # fixes at .5
    # the fix at 50.0 is used by the row at 50.0
    assert T[outage("20:50", fixes=np.arange(0.0, 100.0))[0].last - 1] == pytest.approx(49.9)
    assert T[outage("20:50", fixes=np.arange(0.05, 100.0))[0].last - 1] == pytest.approx(50.0)


def test_an_outage_branches_off_before_its_first_withheld_fix():
    found = outage("20:50", fixes=np.arange(0.25, 100.0))[0]
    assert T[found.first] == pytest.approx(20.0) and found.branch == found.first
    # fix at 20.08 inside the sample to 20.1, the first row in the window
    found = outage("20.05:50", fixes=np.arange(0.08, 100.0))[0]
    assert T[found.first] == pytest.approx(20.1) and found.branch == found.first


def test_a_filter_without_deviations_has_no_coverage_and_one_without_attitude_no_heading():
    window = outage("20:50")[0]
    rows = slice(window.first, window.last)
    estimate = Trajectory(T[rows], truth().lla[rows])
    row, track = score_outage(SimpleNamespace(trajectory=estimate), window)
    assert (
        np.isnan(
            [
                row["coverage_1"],
                row["down_coverage_3"],
                row["heading_rmse_deg"],
                row["velocity_rmse_m_s"],
            ]
        ).all()
        and track.std is None
    )
    assert row["horizontal_rmse_m"] == pytest.approx(0.0, abs=1e-5)
    sixth = np.arange(len(estimate))[:, None] == 5
    estimate = replace(estimate, lla=np.where(sixth, np.nan, estimate.lla))
    with pytest.raises(DataError, match="diverged"):
        score_outage(SimpleNamespace(trajectory=estimate), window)


def test_where_it_hardly_moves_the_drift_is_no_percentage():
    still = Trajectory(T, np.tile(ORIGIN, (len(T), 1)), np.zeros((len(T), 3)))
    window = outage("20:50", reference=still)[0]
    rows = slice(window.first, window.last)
    estimate = Trajectory(
        T[rows],
        displace_lla(still.lla[rows], np.tile([3.0, 4.0, 0.0], (window.last - window.first, 1))),
    )
    row, _ = score_outage(SimpleNamespace(trajectory=estimate), window)
    assert (
        window.distance == 0.0
        and row["horizontal_end_m"] == pytest.approx(5.0, rel=1e-5)
        and np.isnan(row["drift_percent"])
    )


def test_a_reference_that_ends_within_an_outage_gives_no_error_at_its_end():
    short = truth(T[:400])
    window, notes = outage("20:50", reference=short)
    assert not window.reaches_end and window.known == pytest.approx(201 / 301)
    assert (
        "95 % of the rows of outage 1" in notes[0]
        and "not known to the end of outage 1:" in notes[1]
    )
    rows = slice(window.first, window.last)
    row, track = score_outage(
        SimpleNamespace(trajectory=Trajectory(T[rows], truth().lla[rows])), window
    )
    assert np.isnan(
        [row["north_end_m"], row["horizontal_end_m"], row["drift_percent"]]
    ).all() and np.isfinite(row["north_rmse_m"])
    assert track.since[-1] == pytest.approx(20.0)


@pytest.mark.parametrize(
    "text, last, reached",
    [("48:50", 49.5, False), ("48:50", 49.9, True), ("20:50", 49.5, True), ("20:50", 49.3, False)],
)
def test_an_error_at_the_end_is_one_of_the_last_fiftieth_or_sample(text, last, reached):
    window, notes = outage(text, reference=truth(T[: round(RATE * last)]))
    assert (
        window.reaches_end == reached == (not any("no errors at the end" in note for note in notes))
    )


@pytest.mark.parametrize(
    "text, every, coarse",
    [("20:50", 20, True), ("20:50", 10, False), ("20:22", 5, True), ("20:22", 4, False)],
)
def test_a_reference_of_few_rows_is_noted(text, every, coarse):
    """Steps over 1 s, or fewer than five in the outage."""
    notes = outage(text, reference=truth(T[::every]))[1]
    assert (
        any(
            note.startswith(
                f"the reference has a row every {every / RATE:.3g} s, which is coarse for outage 1:"
            )
            for note in notes
        )
        == coarse
    )


def test_many_outages_are_not_all_named():
    made = recording(reference=truth(T[::20]))
    notes = outages_of(
        protocol("10@0:60/1", made.span, 100.0, None), made, made.reference, ("position",), START
    )[1]
    assert "outages 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 41 more:" in notes[-1]


def test_an_outage_of_less_than_two_samples_is_refused():
    assert outage("20.4:20.6")[0].length == pytest.approx(0.2)
    with pytest.raises(
        DataError,
        match="outage 20.45 to 20.6 s: it is shorter than two IMU samples of 0.1 s; give a longer",
    ):
        outage("20.45:20.6")
    gap = recording()
    gap = Recording(
        Imu(*(part[(T < 20) | (T > 25)] for part in gap.imu)), gap.sources, gap.reference
    )
    with pytest.raises(DataError, match="fewer than two IMU samples in it"):
        outages_of(
            protocol("21:23", gap.span, 100.0, None), gap, gap.reference, ("position",), START
        )


def test_windows_of_a_sweep_without_fixes_or_reference_are_left_out_and_said():
    made = recording(fixes=np.arange(0.5, 60.0), reference=truth(T[200:]))
    found, notes = outages_of(
        protocol("10@0:100/10", made.span, 100.0, None), made, made.reference, ("position",), START
    )
    assert [each.start for each in found] == [20.0, 30.0, 40.0, 50.0]
    assert notes[0].startswith(
        "2 of 10 windows left out, such as 0 to 10 s: the reference covers no time"
    )
    assert notes[1].startswith(
        "4 of 10 windows left out, such as 60 to 70 s: there is no fix of position"
    )
    with pytest.raises(DataError, match="no fix of position"):
        outages_of(
            protocol("70:80,30:40", made.span, 100.0, None),
            made,
            made.reference,
            ("position",),
            START,
        )
    with pytest.raises(DataError, match="50 to 50.3 s and 50.3 to 51 s have no fix"):
        few = recording(fixes=np.array([50.2, 50.4]))
        outages_of(
            protocol([(50, 50.3), (50.3, 51.0)], made.span, 100.0, None),
            few,
            truth(),
            ("position",),
            START,
        )


# ---- all together


def test_blocks_begin_where_the_last_one_is_left():
    assert list(blocks([0, 5, 10, 25, 30, 35, 60, 89, 90], [30] * 9)) == [0, 0, 0, 0, 1, 1, 2, 2, 3]
    assert list(blocks([0, 30, 60], [10, 10, 10])) == [0, 1, 2]
    assert list(blocks([0.1, 0.3, 0.5], [0.2, 0.2, 0.2])) == [0, 1, 2]  # to rounding
    # of one run, where none overlap: the length of the first counts
    assert list(blocks([0, 20, 120, 300], [10, 90, 150, 20])) == [
        0,
        1,
        2,
        3,
    ]
    assert list(blocks([0, 20, 50], [100, 10, 10])) == [0, 0, 0]


def test_the_ratio_is_the_t_interval_of_the_blocks():
    rng = np.random.default_rng(2)
    a, b = np.exp(rng.normal(0.2, 0.5, 12)), np.exp(rng.normal(0, 0.5, 12))
    # blocks that share nothing
    windows = (
        np.repeat([0.0, 100.0, 200.0, 300.0], [4, 3, 4, 1]) + np.r_[0:4, 0:3, 0:4, 0] * 5,
        np.full(12, 30.0),
    )
    logs = np.log(a / b)
    means = [logs[:4].mean(), logs[4:7].mean(), logs[7:11].mean(), logs[11]]
    interval = stats.ttest_1samp(means, 0.0).confidence_interval(0.95)
    found = ratio(a, b, *windows)
    assert [found["ratio"], found["low"], found["high"]] == pytest.approx(
        np.exp([np.mean(means), interval.low, interval.high])
    )
    assert (found["wins_a"], found["wins_b"], found["n"], found["blocks"]) == (
        int((a < b).sum()),
        int((a > b).sum()),
        12,
        4,
    )
    other = ratio(b, a, *windows)
    assert [other["ratio"], other["low"], other["high"]] == pytest.approx(
        [1 / found["ratio"], 1 / found["high"], 1 / found["low"]]
    )


def test_what_is_not_known_of_both_is_left_out_and_one_block_has_no_interval():
    found = ratio(
        np.array([1.0, 2.0, np.nan, 4.0]),
        np.array([2.0, 4.0, 1.0, np.nan]),
        np.array([0.0, 5.0, 40.0, 80.0]),
        np.full(4, 30.0),
    )
    assert (
        found["ratio"] == pytest.approx(0.5)
        and np.isnan([found["low"], found["high"]]).all()
        and found["n"] == 2
        and found["blocks"] == 1
    )
    assert ratio(np.full(2, np.nan), np.ones(2), np.arange(2.0), np.ones(2))["n"] == 0


def test_the_interval_of_a_sweep_holds_the_truth_as_often_as_it_says():
    """Windows that average one white noise, as densely as in the sweep of thor75; without the
    widening it would be 90 %."""
    starts, lengths, rng = np.arange(0.0, 306.0, 5.0), np.full(62, 30.0), np.random.default_rng(8)
    block, held, runs = blocks(starts, lengths), 0, 1000
    shared = np.sqrt((1 + 5 / 11) / (1 - 0.5 / 11))  # neighbours share a quarter
    assert block[-1] + 1 == 11 and overlap_factor(starts, lengths, block) == pytest.approx(
        shared, rel=0.02
    )
    assert overlap_factor(
        np.array([0.0, 20, 120]), np.array([10.0, 90, 150]), np.arange(3)
    ) == pytest.approx(1.0)
    assert (
        overlap_factor(np.arange(5) * 30.0, np.full(5, 30.0), np.arange(5))
        == pytest.approx(1.0)
        == overlap_factor(np.zeros(1), np.ones(1), np.zeros(1))
    )
    for noise in rng.standard_normal((runs, 340)):
        logs = np.convolve(noise, np.ones(30) / 30, "valid")[starts.astype(int)]
        found = ratio(np.exp(logs), np.ones(62), starts, lengths)
        held += found["low"] < 1 < found["high"]
    assert 0.93 < held / runs < 0.97  # three standard deviations sqrt(0.95 0.05 / 1000)


def comparison(
    sweep=False,
    windows=((0.0, 10.0), (20.0, 30.0), (40.0, 50.0)),
    filters=("one", "two"),
    missing=(),
    known=lambda since: since >= 0,
):
    """A Comparison whose horizontal errors grow as (outage + 1) t and (outage + 1) 2 t; `known`:
    at which times of the first outage."""
    rows, tracks = [], {}
    for factor, name in enumerate(filters, 1):
        tracks[name] = []
        for k, (start, stop) in enumerate(windows):
            since = np.linspace(0, stop - start, 21)
            error = np.outer((k + 1) * factor * since, [0.6, -0.8, 0.5])
            gone, rows_of = (name, k) in missing, known(since) if k == 0 else slice(None)
            tracks[name].append(None if gone else ErrorTrack(since[rows_of], error[rows_of], None))
            values = {
                f"{axis}_rmse_m": (k + 1.0) * factor
                for axis in ("north", "east", "down", "horizontal")
            }
            values |= {f"{part}_rmse_deg": 1.0 for part in ("roll", "pitch", "heading")}
            values |= {f"{pre}coverage_{j}": 0.5 for pre in ("", "down_") for j in (1, 2, 3)}
            values |= {
                "horizontal_end_m": 10.0 * (k + 1),
                "down_end_m": -(k + 1.0),
                "horizontal_max_m": 1.0,
                "drift_percent": 1.0,
            }
            values |= {"velocity_rmse_m_s": 1.0, "velocity_end_m_s": 1.0}
            rows.append(
                {
                    "filter": name,
                    "outage": k + 1,
                    "start_s": start,
                    "stop_s": stop,
                    "length_s": stop - start,
                    **({key: np.nan for key in values} if gone else values),
                    "said": "stopped at 3 s" if gone else "",
                }
            )
    scores = pd.DataFrame(rows)
    return Comparison(
        "made up",
        "10/20",
        "words",
        sweep,
        tuple(filters),
        tuple(windows),
        ("position",),
        scores,
        tracks,
        None,
        (0.0, 50.0),
    )


def test_growth_is_the_quantiles_over_the_outages():
    growth = comparison().growth
    two = growth[growth["filter"] == "two"].set_index("since_s")
    assert (
        len(two) == 61
        and (two["n"] == 3).all()
        and two.loc[5.0, "horizontal_median_m"] == pytest.approx(2 * 2 * 5.0)
    )
    assert two.loc[10.0, "horizontal_p90_m"] == pytest.approx(np.quantile([20, 40, 60], 0.9))
    assert two.loc[10.0, "horizontal_p10_m"] == pytest.approx(24.0)
    assert two.loc[10.0, "vertical_median_m"] == pytest.approx(20.0)
    left = comparison(missing={("two", 1), ("two", 2)}).growth
    assert (left[left["filter"] == "two"]["n"] == 1).all() and left[left["filter"] == "two"][
        "horizontal_median_m"
    ].iloc[-1] == pytest.approx(20.0)
    assert (
        comparison(missing={("two", k) for k in range(3)})
        .growth.query("filter == 'two'")["horizontal_median_m"]
        .isna()
        .all()
    )


@pytest.mark.parametrize(
    "known, left_out",
    [
        (lambda since: since <= 5, lambda grid: grid > 6.25),
        (lambda since: since >= 5, lambda grid: grid < 3.75),
        (lambda since: (since <= 2) | (since >= 8), lambda grid: (grid > 2) & (grid < 8)),
    ],
    ids=["ends early", "begins late", "gap"],
)
def test_growth_leaves_out_what_a_track_does_not_know(known, left_out):
    """A step of the tracks is 0.5 s; up to 1.25 s are bridged."""
    one = comparison(known=known).growth.query("filter == 'one'")
    grid = one["since_s"].to_numpy()
    assert list(one["n"]) == list(np.where(left_out(grid), 2, 3)) and left_out(grid).any()
    # of 2 t and 3 t
    assert one["horizontal_median_m"][left_out(grid)].to_numpy() == pytest.approx(
        2.5 * grid[left_out(grid)]
    )


def test_lengths_are_pooled_in_one_run_and_apart_in_a_sweep():
    windows = ((0.0, 10.0), (20.0, 35.0))
    pooled, apart = comparison(windows=windows), comparison(sweep=True, windows=windows)
    assert pooled.lengths == (15.0,) and apart.lengths == (10.0, 15.0)
    assert list(pooled.summary["n"]) == [2, 2] and list(apart.summary["n"]) == [1, 1, 1, 1]
    one = pooled.growth[pooled.growth["filter"] == "one"]
    assert one["n"].iloc[0] == 2 and one["n"].iloc[-1] == 1 and (apart.growth["n"] == 1).all()


def test_the_summary_counts_failures_and_says_them():
    made = comparison(missing={("two", 2)})
    one, two = (made.summary.iloc[i] for i in (0, 1))
    assert (one["n"], one["failures"], one["said"]) == (3, 0, "") and (
        two["n"],
        two["failures"],
        two["said"],
    ) == (2, 1, "stopped at 3 s")
    assert (
        one["north_rmse_mean_m"] == pytest.approx(2.0)
        and two["east_rmse_median_m"] == pytest.approx(3.0)
        and one["horizontal_end_max_m"] == 30.0
    )
    assert one["horizontal_end_p90_m"] == pytest.approx(28.0) and one[
        "down_end_median_m"
    ] == pytest.approx(2.0)
    pair = made.paired.set_index("axis").loc["north"]
    assert pair["ratio"] == pytest.approx(0.5) and pair["n"] == 2 and pair["wins_a"] == 2


def test_the_table_is_shaped_as_that_of_the_paper():
    table = comparison(filters=("b", "a")).table()
    assert list(table.columns) == [
        (axis, name) for axis in ("North", "East", "Down") for name in ("b", "a")
    ] and list(table.index) == [1, 2, 3]
    assert table.loc[3, ("Down", "a")] == 6.0
