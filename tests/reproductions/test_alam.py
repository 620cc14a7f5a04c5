"""The study of Alam et al.: Table 1 as printed, scores and ratios against closed forms, starts
170 deg off, and a small study end to end."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES
from strapdown.data.solution import Solution, Trajectory
from strapdown.evaluation.metrics import Errors
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator
from strapdown_reproductions.alam import (
    convergence,
    main as alam,
    on_recordings,
    runs as alam_runs,
    table1,
)
from strapdown_reproductions.alam.convergence import ConvergenceCase
from strapdown_reproductions.alam.readings import EKF, NLO, XKF, Variant
from strapdown_reproductions.alam.runs import ASTRAY, CLOSED, MEASURES
from strapdown_reproductions.common import paired_ratios
from strapdown_reproductions.common.pages import COLOURS

STAND_INS = {EKF: Variant("closed-loop-error-bias"), CLOSED: Variant("closed-loop")}
WINDOW = (10.0, 40.0)
TIMED = ("filter", "repetition", "seconds")


@pytest.mark.short
def test_the_published_table_says_what_was_counted_in_it():
    """In the north the XKF is better in 2 outages, in the east in 5, down in 3; and it is within
    2 m of the NLO everywhere."""
    assert [table1.published_wins(axis) for axis in alam_runs.AXES] == [
        "2 of 5",
        "5 of 5",
        "3 of 5",
    ]
    apart = [
        abs(a - b)
        for axis in alam_runs.AXES
        for a, b in zip(table1.PUBLISHED[axis, XKF], table1.PUBLISHED[axis, NLO])
    ]
    assert len(apart) == 15 and max(apart) == pytest.approx(2.0)
    assert len(table1.PUBLISHED) == 9 and {len(row) for row in table1.PUBLISHED.values()} == {5}


@pytest.mark.short
def test_the_windows_are_those_of_the_paper():
    assert alam_runs.windows() == ((570, 600), (870, 900), (1170, 1200), (1470, 1500), (1770, 1800))


def made_errors(position, velocity, t=None):
    t = np.arange(0.0, 60.0, 0.1) if t is None else t
    rows = np.ones((len(t), 1))
    unknown = np.full((len(t), 3), np.nan)
    return Errors(t, position * rows, velocity * rows, unknown, unknown, None, slice(0, len(t)))


@pytest.mark.short
def test_an_outage_is_scored_up_to_the_fix_that_ends_it():
    e = made_errors(np.array([3.0, -4.0, 2.0]), np.array([0.0, 0.0, 2.0]))
    outside = (e.t >= WINDOW[1] - 1e-9) | (e.t < WINDOW[0] - 1e-9)  # as a fix at the end makes it
    e = replace(e, position=np.where(outside[:, None], 0.0, e.position))
    found = alam_runs.score_outage(e, WINDOW, "")
    assert found == pytest.approx(
        {
            "north_rmse_m": 3,
            "east_rmse_m": 4,
            "down_rmse_m": 2,
            "horizontal_rmse_m": 5,
            "horizontal_end_m": 5,
            "velocity_end_m_s": 2,
            "said": "",
        }
    )
    ramp = np.linspace(0, 1, len(e.t))[:, None] * [1, 0, 0] + [0, 1, 1]
    e = replace(e, position=e.position * ramp)
    inside = (e.t >= WINDOW[0] - 1e-9) & (e.t < WINDOW[1] - 1e-9)
    assert alam_runs.score_outage(e, WINDOW, "")["north_rmse_m"] == pytest.approx(
        np.sqrt(np.mean(e.position[inside, 0] ** 2))
    )
    curve = alam_runs.curve(e, WINDOW)
    assert (
        curve.shape == (2, 31)
        and curve[0, -1] == pytest.approx(np.hypot(e.position[399, 0], 4))
        and np.all(curve[1] == 2)
    )


@pytest.mark.short
def test_a_run_that_goes_astray_counts_and_is_named():
    far = alam_runs.score_outage(made_errors(np.array([3e5, 1.0, 1.0]), np.zeros(3)), WINDOW, "")
    assert (
        far["north_rmse_m"] == far["horizontal_end_m"] == 1e4
        and far["east_rmse_m"] == 1
        and far["said"] == "diverged"
    )
    for e in (
        made_errors(np.ones(3), np.ones(3), np.arange(0.0, 30.0, 0.1)),
        made_errors(np.array([np.nan, 1, 1]), np.ones(3)),
    ):
        lost = alam_runs.score_outage(e, WINDOW, "stopped at 30 s")
        assert lost == {**MEASURES, "said": "stopped at 30 s"} and np.isinf(
            alam_runs.curve(e, WINDOW)[0, -1]
        )
    through = alam_runs.score_outage(
        made_errors(np.ones(3), np.ones(3), np.arange(0.0, 50.0, 0.1)), WINDOW, "stopped at 50 s"
    )
    assert through["said"] == "" and through["north_rmse_m"] == 1  # it stopped after this outage


def made_scores(values, blocks=None, case="outage 1"):
    """Rows of {filter: horizontal RMSE of each outage}."""
    rows = [
        {
            "case": case,
            "block": (blocks or range(len(column)))[k],
            "filter": name,
            "outage": k + 1,
            "horizontal_rmse_m": value,
        }
        for name, column in values.items()
        for k, value in enumerate(column)
    ]
    return pd.DataFrame(rows)


def ratio_of(scores):
    (table,) = table1.wide(scores).values()
    return paired_ratios.ratio(table, "horizontal_rmse_m", XKF, EKF)


@pytest.mark.short
def test_a_ratio_is_that_of_students_t_over_blocks():
    a, b = np.array([1.0, 2.0, 3.0, 4.0, 6.0]), np.array([2.0, 2.5, 2.9, 9.0, 6.5])
    found = ratio_of(made_scores({XKF: a, EKF: b}))
    low, high = stats.t.interval(0.95, 4, np.mean(np.log(a / b)), stats.sem(np.log(a / b)))
    assert found == pytest.approx((np.exp(np.mean(np.log(a / b))), np.exp(low), np.exp(high), 4, 5))
    assert found.side == 0
    twos = ratio_of(made_scores({XKF: a, EKF: b}, [0, 0, 0, 1, 1]))
    means = np.array([np.log(a / b)[:3].mean(), np.log(a / b)[3:].mean()])
    assert twos[:3] == pytest.approx(
        np.exp([means.mean(), *stats.t.interval(0.95, 1, means.mean(), stats.sem(means))])
    )
    assert ratio_of(made_scores({XKF: a})).count == 0
    one = ratio_of(made_scores({XKF: a[:1], EKF: b[:1]}))
    assert one.value == 0.5 and np.isnan(one.low) and one.side == 0
    (table,) = table1.wide(made_scores({XKF: a, EKF: b}, [0, 0, 0, 1, 1])).values()
    means = np.array([(a - b)[:3].mean(), (a - b)[3:].mean()])
    wider = ratio_of(made_scores({XKF: a, EKF: b}).assign(widening=1.5))
    assert (
        np.log(wider.high / wider.low) == pytest.approx(1.5 * np.log(found.high / found.low))
        and wider.value == found.value
    )
    apart = paired_ratios.difference(table, "horizontal_rmse_m", XKF, EKF)
    assert apart[:3] == pytest.approx(
        [means.mean(), *stats.t.interval(0.95, 1, means.mean(), stats.sem(means))]
    )


@pytest.mark.short
@pytest.mark.parametrize(("factor", "side"), [(0.5, 1), (2.0, -1), (1.0, -1), (0.995, -1)])
def test_sides_of_ratios(factor, side):
    b = np.exp(np.random.default_rng(1).normal(size=30))
    assert ratio_of(made_scores({XKF: factor * b, EKF: b})).side == side


@pytest.mark.short
def test_a_start_is_170_deg_off_with_a_wrong_gyro_bias():
    from scipy.spatial.transform import Rotation

    axes = []
    for seed in range(3):
        recording, start = convergence.run(seed)
        off = recording.reference.rotation[0] * Rotation.from_euler("ZYX", start.rph[::-1]).inv()
        assert np.degrees(off.magnitude()) == pytest.approx(170) and np.linalg.norm(
            start.b_g - recording.meta["b_g"][0]
        ) == pytest.approx(0.05)
        assert (
            len(start.std) == STATES
            and recording.span[1] == 60
            and start.lla == tuple(recording.reference.lla[0])
        )
        axes.append(off.as_rotvec())
    assert np.linalg.matrix_rank(axes) == 3
    assert "magnetic-field" in {a.kind for a in convergence.run(0, True)[0].sources}


@pytest.mark.short
def test_what_converged_means():
    t = np.arange(1.0, 7.0)
    assert convergence.settling_time(t, np.array([90, 30, 9, 8, 9.9, 9])) == 3
    assert convergence.settling_time(t, np.array([90, 9, 30, 8, 9.9, 9])) == 4
    assert (
        convergence.settling_time(t, np.full(6, 5.0)) == 1
        and convergence.settling_time(t, np.array([9, 9, 9, 9, 9, 10.0])) == np.inf
        and convergence.late_share(28 + t, np.array([9, 9, 9, 9, 11.0, 9])) == 0.75
        and convergence.late_share(t, np.full(6, 5.0)) == 0
    )


@pytest.mark.short
def test_a_run_that_stops_has_not_converged(monkeypatch):
    """Its last row, right before it stopped, is as good as the truth."""
    recording, start = convergence.run(0)
    truth = recording.reference
    rows = slice(0, 3000, convergence.ROWS)
    one = Trajectory(truth.t[rows], truth.lla[rows], truth.v_n[rows], truth.q_nb[rows])
    none = np.full((len(one.t), 3), np.nan)
    solution = lambda said: Solution(
        one, none, none, None, None, meta={"stopped": said} if said else {}
    )
    monkeypatch.setattr(convergence, "run", lambda *_: (recording, start))
    monkeypatch.setattr(convergence, "fuse", lambda *_, **__: solution(""))
    assert (
        convergence.outcome(ConvergenceCase("nlo"), 0)[3] == ""
        and convergence.outcome(ConvergenceCase("nlo"), 0)[0] == 0
    )
    monkeypatch.setattr(convergence, "fuse", lambda *_, **__: solution("stopped at 30 s"))
    assert convergence.outcome(ConvergenceCase("nlo"), 0) == (
        np.inf,
        np.inf,
        np.inf,
        "stopped at 30 s",
        0.0,
    )


def test_one_start_that_cannot_run_leaves_the_others(monkeypatch):
    begun = convergence.run
    monkeypatch.setattr(
        convergence, "run", lambda seed, *rest: (seed, None) if seed == 1 else begun(seed, *rest)
    )
    fused = convergence.fuse

    def fuse(recording, *rest, **options):
        if recording == 1:
            raise DataError("no start")
        return fused(recording, *rest, **options)

    monkeypatch.setattr(convergence, "fuse", fuse)
    table = convergence.study({"closed": ConvergenceCase("closed-loop")}, range(3), 1)
    assert (
        list(table["said"]) == ["", "no start", ""]
        and np.isinf(table["since_s"][1])
        and np.isfinite(table["last_deg"][[0, 2]]).all()
    )


def test_shares_count_the_starts_that_converged(monkeypatch):
    cases = {"closed": ConvergenceCase("closed-loop"), "unknown": ConvergenceCase("no-such-filter")}
    table = convergence.study(cases, range(3))
    assert (
        list(table["case"]) == ["closed"] * 3 + ["unknown"] * 3
        and "no filter is called" in table["said"].iloc[-1]
    )
    assert not table["said"][:3].any() and np.all(
        (table["since_s"][:3] <= 60) == (table["last_deg"][:3] < 10)
    )
    assert convergence.shares(cases, range(3)) == {
        "closed": int(np.isfinite(table["since_s"][:3]).sum()),
        "unknown": 0,
    }
    monkeypatch.setattr(convergence, "OFF", np.radians(2.0))
    monkeypatch.setattr(convergence, "GYRO_BIAS", 1e-4)
    assert convergence.shares({"closed": ("closed-loop", {})}, range(3)) == {"closed": 3}


@pytest.fixture(scope="module")
def slow():
    """The flight at 20 Hz."""
    return Simulator(scenario("alam").replace(rate=20.0))


@pytest.fixture
def short_flight(monkeypatch, slow):
    monkeypatch.setattr(alam_runs, "simulator", lambda: slow)
    monkeypatch.setattr(alam_runs, "ROWS", 2)


def test_runs_are_scored_by_seed_filter_and_outage(short_flight):
    variants = STAND_INS | {NLO: Variant("no-such-filter")}
    done = []
    found = alam_runs.run_all([5, 6], variants, done.append)
    assert done == [0.5, 1.0] and len(found.scores) == 2 * 3 * 5
    assert set(found.scores["case"]) == {f"outage {k}" for k in range(1, 6)} and set(
        found.scores["block"]
    ) == {5, 6}
    known = found.scores[found.scores["filter"] != NLO]
    assert (
        (known[list(MEASURES)] > 0).all(axis=None)
        and known["horizontal_end_m"].max() < 100
        and not known["said"].any()
    )
    lost = found.scores[found.scores["filter"] == NLO]
    assert (lost["north_rmse_m"] == 1e4).all() and lost["said"].str.contains(
        "no filter is called"
    ).all()
    assert found.growth[CLOSED].shape == (2, 10, 31) and np.isinf(found.growth[NLO]).all()
    assert len(found.biases) == 2 * 3  # also of the one that cannot run
    gone = found.biases[found.biases["filter"] == NLO]
    assert (gone["accel_wander"] == alam_runs.ASTRAY["accel"]).all() and gone["said"].str.contains(
        "no filter is called"
    ).all()
    assert set(found.sample) == set(STAND_INS) and len(found.sample[CLOSED].t) > 19000
    own = found.biases[found.biases["filter"] == CLOSED]
    assert (own["accel_wander"] > own["accel_true"]).all() and (
        own["gyro_wander"] < np.radians(0.1)
    ).all()
    recording = alam_runs.recording(5)
    withheld = [a.t for a in recording.sources if a.kind == "position"][0]
    assert not any(
        ((withheld >= start) & (withheld < stop)).any() for start, stop in alam_runs.windows()
    )
    # one row of the table from first principles
    from strapdown.alignment.initial import align
    from strapdown.engine.batch import fuse
    from strapdown.geometry.geodesy import displacement
    from strapdown.sensor_models.imu import imu as imu_spec

    begin = align(recording, imu_spec("dmu10"))
    solution = fuse(recording, "closed-loop", start=begin, estimate=[])
    inside = (solution.t > 569.99) & (solution.t < 599.99) & (np.round(solution.t * 20) % 2 == 0)
    truth = recording.reference
    off = displacement(
        truth.lla[np.round(solution.t[inside] * 20).astype(int)], solution.trajectory.lla[inside]
    )
    row = known[(known["filter"] == CLOSED) & (known["block"] == 5) & (known["outage"] == 1)].iloc[
        0
    ]
    assert [row[f"{axis}_rmse_m"] for axis in alam_runs.AXES] == pytest.approx(
        np.sqrt((off**2).mean(axis=0)), rel=1e-6
    )


def test_a_small_study_writes_its_page(short_flight, monkeypatch, tmp_path, goes_into_its_page):
    monkeypatch.setattr(alam, "FILTERS", STAND_INS)
    monkeypatch.setattr(alam, "ABLATIONS", {})
    monkeypatch.setattr(
        convergence,
        "CASES",
        {
            NLO: ConvergenceCase("closed-loop"),
            EKF: ConvergenceCase("closed-loop"),
        },
    )
    monkeypatch.setattr(alam, "QUICK_STARTS", 2)
    monkeypatch.setattr(alam.costs, "measure_costs", lambda: pd.DataFrame(columns=list(TIMED)))
    noted = on_recordings.NONE._replace(
        notes=[("thor75", "2 fixes late"), ("thor75", "2 fixes late"), ("drive0708", "no rest")]
    )
    monkeypatch.setattr(on_recordings, "run", lambda *_: noted)
    done = []
    claims = alam.reproduce(tmp_path, quick=True, runs=2, progress=done.append)
    assert done == sorted(done) and done[-1] == 1.0
    assert json.loads((tmp_path / "claims.json").read_text()) == claims and {
        claim["verdict"] for claim in claims
    } <= set(COLOURS)
    page = (tmp_path / "index.html").read_text()
    assert (
        "Figure 4e of the paper: accelerometer biases" in page
        and "2 seeds of the simulated flight" in page
        and "NaN ±" not in page
        and "A quick run, 2 of each" in page
    )
    assert (
        "2 seeds of IMU and receiver errors" in page
        and page.count("0.02 deg/s at 10 deg/s") == page.count("each 0.02 m/s²") == 1
    )
    assert (
        page.count("<td>thor75</td><td>2 fixes late</td>") == 1
        and "<td>drive0708</td><td>no rest</td>" in page
    )
    assert {path.name for path in tmp_path.glob("*.csv")} >= {
        "redrawn.csv",
        "filters.csv",
        "outages.csv",
        "biases.csv",
        "convergence.csv",
    }
    text = (tmp_path / "findings.md").read_text()
    goes_into_its_page("alam", text)
    assert "| 1 | During the outage" in text
    assert "readings.csv" not in {path.name for path in tmp_path.glob("*.csv")}
    assert "xkf_as_printed.py" in (tmp_path / "concordance.md").read_text()


@pytest.mark.short
def test_bad_input_is_refused(tmp_path):
    for change in ({"runs": 0}, {"seed": -1}):
        with pytest.raises(DataError, match="it must be a whole number, [01] or more"):
            alam.reproduce(tmp_path, **change)
    with pytest.raises(DataError, match="thor75.toml"):
        alam.reproduce(tmp_path, recordings=tmp_path)


class Compared:
    """Of strapdown.experiments.outages.result.Comparison, what is read here."""

    scores = pd.DataFrame(
        [
            {
                "filter": name,
                "outage": k + 1,
                "start_s": 5.0 * k,
                "stop_s": 5.0 * k + 10.0,
                **dict.fromkeys(MEASURES, value),
                "said": said,
            }
            for name, value, said in (("a", 2.0, ""), ("b", 3e4, ""), ("c", np.nan, "stopped"))
            for k in range(5)
        ]
    )


@pytest.mark.short
def test_scores_of_recordings_come_in_blocks_and_keep_what_failed():
    table = on_recordings.scores(Compared(), "thor75", {"a": EKF, "b": NLO, "c": XKF})
    assert (
        list(table["block"][:5]) == [0, 0, 1, 1, 2]
        and table["widening"].nunique() == 1
        and table["widening"][0] > 1
        and set(table["case"]) == {"thor75"}
    )
    by = table.groupby("filter")
    assert (
        by["north_rmse_m"].first().to_dict() == {EKF: 2.0, NLO: 1e4, XKF: 1e4}
        and by["velocity_end_m_s"].first()[XKF] == 1e3
    )
    assert by["said"].first().to_dict() == {EKF: "", NLO: "diverged", XKF: "stopped"}


@pytest.mark.short
def test_wander_is_the_standard_deviation_over_time():
    class Solution:
        t = np.arange(0.0, 2000.0, 1.0)
        meta = {}
        b_a = np.c_[np.sin(2 * np.pi * t / 50), 0 * t, 0 * t] * 3.0
        b_g = np.c_[0 * t, t, 0 * t] * 1e-4

    class Hidden:
        imu = Trajectory(Solution.t, np.zeros((2000, 3)))
        meta = {"b_a": np.zeros((2000, 3)), "b_g": np.zeros((2000, 3))}

    found = alam_runs.wander(Solution, Hidden)
    assert (
        found["accel_wander"] == pytest.approx(3 / np.sqrt(2), rel=0.01)
        and found["accel_true"] == 0
    )
    assert found["gyro_wander"] == pytest.approx(0.125 / np.sqrt(12), rel=0.01) and found[
        "gyro_wander_late"
    ] == pytest.approx(0.06 / np.sqrt(12), rel=0.01)
    assert found["accel_rms"] == pytest.approx(3 / np.sqrt(2), rel=0.01) and found["said"] == ""
    Solution.b_a[600:1250, 1] += 2.0  # the rms error is that of the whole flight, not of its end
    assert alam_runs.wander(Solution, Hidden)["accel_rms"] == pytest.approx(
        np.sqrt(4.5 + 4 * 650 / 1251), rel=0.01
    )
    Solution.b_a[700] += 400.0
    Solution.b_g[:] *= 1e2
    large = alam_runs.wander(Solution, Hidden)
    assert (
        large["accel_rms"] == large["accel_wander"] == ASTRAY["accel"]
        and large["accel_wander_late"] == found["accel_wander_late"]
    )
    assert large["gyro_wander"] == ASTRAY["gyro"] and large["said"] == "diverged"
    Solution.b_a[1000, 0] = np.nan
    assert alam_runs.wander(Solution, Hidden)["accel_wander"] == ASTRAY["accel"]


@pytest.mark.short
def test_a_run_that_stops_keeps_its_place_among_the_biases():
    class Solution:
        t = np.arange(0.0, 1700.0, 1.0)
        b_a = b_g = np.zeros((1700, 3))
        meta = {"stopped": "stopped at 1700 s"}

    class Hidden:
        imu = Trajectory(Solution.t, np.zeros((1700, 3)))
        meta = {"b_a": np.zeros((1700, 3)), "b_g": np.zeros((1700, 3))}

    found = alam_runs.wander(Solution, Hidden)
    assert (
        found["said"] == "stopped at 1700 s"
        and found["gyro_wander"] == ASTRAY["gyro"]
        and set(found) == set(alam_runs.without_biases(""))
    )


@pytest.mark.short
def test_the_command_passes_its_options_on(monkeypatch, tmp_path, capsys):
    from strapdown.cli import app

    given = {}

    def reproduce(out, quick=False, runs=None, seed=2, recordings=None, notify=None, progress=None):
        given.update(quick=quick, runs=runs, seed=seed, recordings=recordings)
        return [{"verdict": "partly", "claim": "a claim"}]

    monkeypatch.setattr(alam, "reproduce", reproduce)
    command = ["strapdown", "reproduce", "alam", "--out", str(tmp_path / "page")]
    monkeypatch.setattr(
        "sys.argv", [*command, "--quick", "--runs", "4", "--recordings", str(tmp_path)]
    )
    app.main()
    assert given == {"quick": True, "runs": 4, "seed": 2, "recordings": tmp_path}
    assert "a claim" in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", [*command, "--ablations"])
    with pytest.raises(SystemExit) as ended:
        app.main()
    assert (
        ended.value.code == 2
        and "reproduce alam has no option --ablations" in capsys.readouterr().err
    )
