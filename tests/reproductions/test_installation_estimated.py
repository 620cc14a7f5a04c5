"""The installation, estimated: what is drawn and undone, how the tables count, and the files of a
run."""

import json

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.experiments.monte_carlo.wrong_installation import parameters_of
from strapdown_reproductions.common import motions
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.installation import (
    cases,
    commands,
    drive,
    main,
    methods,
    simulated,
    summary,
)
from strapdown_reproductions.installation.cases import ALIGNED, KNOWN, case
from strapdown_reproductions.installation.methods import set_up

ODOMETER = "car with odometer"


@pytest.fixture(scope="module")
def driven():
    """A minute and a half of the car with an odometer, wrongly installed."""
    whole = cases.MOTIONS[ODOMETER]
    cases.MOTIONS[ODOMETER] = whole._replace(motion=whole.motion._replace(stop=90.0))
    yield case(ODOMETER, 1001, KNOWN)
    cases.MOTIONS[ODOMETER] = whole


@pytest.mark.short
def test_a_case_is_right_where_the_truth_is_applied(driven):
    parameters = parameters_of(driven.recording, driven.priors)
    change = np.array([driven.true[p.name] / p.of.factor for p in parameters])
    assert [p.of.name for p in parameters].count("clock") == 2 and np.abs(change).min() > 0
    right = set_up(driven.recording, parameters, change)
    for a, b in zip(driven.right.sources, right.sources):
        first = np.searchsorted(a.t, b.t[0] - 1e-6)
        np.testing.assert_allclose(a.t[first : first + len(b.t)], b.t)
        np.testing.assert_allclose(a.parameters, b.parameters, atol=1e-12)
    np.testing.assert_allclose(right.imu.dtheta, driven.right.imu.dtheta, atol=1e-12)
    np.testing.assert_allclose(
        right.reference.rotation[0].as_matrix(),
        driven.right.reference.rotation[0].as_matrix(),
        atol=1e-12,
    )


@pytest.mark.short
def test_constraints_err_by_what_they_state(driven):
    slips = [a for a in driven.right.sources if a.kind in motions.CONSTRAINTS]
    assert len(slips) == 2
    for a in slips:
        assert np.std(a.y) == pytest.approx(motions.CONSTRAINT_STD, rel=0.1)


def test_methods_find_a_clock_and_an_arm(driven):
    wanted = {"GNSS position clock": None, "lever-arm": None}
    parameters = parameters_of(driven.right, wanted)
    done = np.array([0.05, -0.4, 0.0, 0.0])
    wrong = set_up(driven.right, parameters, -done)
    plain, again = (
        methods.METHODS[name](wrong, wanted) for name in ("states", "states, three passes")
    )
    np.testing.assert_array_equal(plain.change, plain.estimate)
    for found in (plain, again):
        assert np.abs(found.change[:2] - done[:2]).max() < 6 * found.std[:2].max()
        assert (found.std[:2] < 0.5 * np.array([p.std for p in parameters[:2]])).all()
    assert np.abs(again.change - plain.change).max() > 0


def rows(motion, parameter, inside, found=None, start=KNOWN):
    """Rows of the table of parameters."""
    n = len(inside)
    return pd.DataFrame(
        {
            "motion": motion,
            "filter": "closed-loop",
            "start": start,
            "seed": range(n),
            "parameter": parameter,
            "true": 0.0,
            "error": np.tile([1.0, -2.0], n)[:n],
            "std": 1.0,
            "prior": 4.0,
            "found": [True] * n if found is None else found,
            "inside": inside,
            "stopped": False,
        }
    )


def evidence(**tables):
    """Evidence with these tables and no other."""
    empty = {
        "runs": rows("car", "clock", []),
        "epochs": pd.DataFrame(columns=["motion", "filter", "start", "seed", "t", "nees", "dof"]),
        "scales": pd.DataFrame(columns=["motion", "filter", "start", "t", "error", "std"]),
    }
    return StudyTables(**{**empty, **tables})


@pytest.mark.short
def test_intervals_count_where_called_found_alone():
    good, few, all_of_many = [True] * 95 + [False] * 5, [True] * 8 + [False] * 2, [True] * 100
    parameters = pd.concat(
        [
            rows("car", "clock error of a [s]", good),
            rows("flight", "clock error of a [s]", all_of_many),
            rows("ship", "clock error of a [s]", few, [False, False] + [True] * 8),
            rows("car", "lever arm right error of a [m]", few, [True] * 10),
        ]
    )
    table = summary.intervals(parameters).set_index(["motion", "parameter"])
    assert table.loc[("ship", "clock error of a [s]"), "inside"] == pytest.approx(6 / 8)
    assert table.loc[("ship", "clock error of a [s]"), "found"] == 8
    assert table.loc[("car", "lever arm right error of a [m]"), "bias"] == pytest.approx(-0.5)
    assert table["rmse"].to_numpy() == pytest.approx(np.sqrt(2.5))
    found = summary.figures(evidence(runs=parameters))
    assert found[f"intervals, {KNOWN}"] == 3  # all of many, 6 of 8, 8 of 10
    assert np.isnan(found[f"intervals, {ALIGNED}"])


@pytest.mark.short
def test_what_a_motion_does_not_show_is_not_to_be_found():
    seen, hidden = "scale error of speed", "mounting roll error of imu [deg]"
    motion = "car, roll of the mounting"
    parameters = pd.concat(
        [
            rows(motion, seen, [True] * 4, start=ALIGNED),
            rows(motion, hidden, [True] * 4, [True, False, False, False], ALIGNED),
        ]
    )
    found = summary.figures(evidence(runs=parameters))
    assert found["unseen"] == 25.0 and np.isnan(found[f"intervals, {ALIGNED}"])


@pytest.mark.short
def test_epochs_count_from_30_s_after_the_start_by_their_band():
    t, seeds = np.arange(5.0, 105.0), range(50)
    rng = np.random.default_rng(1)
    frames = [
        pd.DataFrame(
            {
                "motion": "car",
                "filter": "closed-loop",
                "start": KNOWN,
                "seed": seed,
                "t": t,
                "nees": rng.chisquare(19, len(t)) + 100 * (t < 35) + 5 * (t >= 85),
                "nees_right": rng.chisquare(15, len(t)),
                "dof": 19,
            }
        )
        for seed in seeds
    ]
    row = summary.consistency(pd.concat(frames)).iloc[0]
    assert row["runs"] == 50 and 60 <= row["nees_in_band_%"] <= 5 / 7 * 100
    assert row["nees_right_in_band_%"] > 85


@pytest.mark.short
def test_the_drive_is_judged_by_what_is_estimated_from_the_file_as_given():
    def of(wrong, done, estimated, alone, method="calibrate installation"):
        return {
            "wrong": wrong,
            "method": method,
            "parameter": "clock",
            "unit": "s",
            "done": done,
            "estimated": estimated,
            "std": 0.001,
            "applied": estimated,
            "alone_m": alone,
            "constrained_m": 2.0,
        }

    table = pd.DataFrame(
        [
            of(drive.RIGHT, 0.0, 0.0, 4.0, drive.NOTHING),
            of(drive.RIGHT, 0.0, -0.006, 3.9),
            of("clock, 0.2 s", 0.2, 0.0, 8.0, drive.NOTHING),
            of("clock, 0.2 s", 0.2, 0.197, 4.2),
        ]
    )
    found = summary.figures(evidence(drive=table))
    assert found["drive clock"] == pytest.approx(0.003)
    assert found["drive alone"] == pytest.approx(4.2 / 4.0)
    assert found["drive constrained"] == 1.0


@pytest.mark.short
def test_what_is_wrong_with_the_drive_names_its_parameters():
    recording = sd.simulate("car", 20.0)
    parameters = parameters_of(recording, {"clock": None, "lever-arm": None, "mounting": None})
    named = {drive.parameter_name(p) for p in parameters}
    assert set(drive.WRONG[drive.EVERYTHING]) <= named
    assert len(drive.WRONG[drive.EVERYTHING]) == 3


@pytest.mark.short
def test_tasks_hold_every_seed_once(tmp_path):
    tasks = main.all_tasks(tmp_path, range(1, 13))
    seeds = [
        seed for _, _, (*of, own) in tasks for seed in own if of == ["car", "closed-loop", KNOWN]
    ]
    assert seeds == list(range(1, 13)) and {task.make for task in tasks} == {
        simulated.runs,
        commands.rows,
    }


def test_a_run_writes_its_files(tmp_path):
    claims = main.reproduce(tmp_path, quick=True, runs=2, seed=1001, workers=1)
    assert {c["claim"] for c in claims} <= {t.text for t in summary.TARGETS.values()}
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    runs = pd.read_csv(tmp_path / "runs.csv")
    assert set(runs["start"]) == {KNOWN, ALIGNED} and len(runs) == 2 * 2 * 8
    assert not runs["stopped"].any() and runs["found"].mean() > 0.5
    text = (tmp_path / "table.md").read_text()
    assert "### Figures" in text and "scale error of speed" in text
    assert (tmp_path / "index.html").stat().st_size > 5000
