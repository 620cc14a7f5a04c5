"""The corpus of bets: what counts as wrong, what was said apart, halves, rules that combine evidence."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.data.verdict import SetUpBound, Untested, Verdict
from strapdown_reproductions.verdict_corpus import bets, combination, subjects, summary
from strapdown_reproductions.wrong_setups.mistakes import MISTAKES

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}


@pytest.fixture(scope="module")
def robot():
    return subjects.simulated_subjects()["robot"]


def test_no_motion_and_no_recording_is_in_both_halves():
    halves = {}
    for vehicle, half, motion in subjects.SIMULATED.values():
        halves.setdefault(motion.scenario, set()).add(half)
        halves.setdefault(f"{vehicle}", set())
    assert all(len(half) <= 1 for half in halves.values())
    assert {half for _, half, _ in subjects.SIMULATED.values()} == {
        subjects.CHOSEN,
        subjects.COUNTED,
    }


def test_wrong_is_beyond_three_standard_deviations_for_a_twentieth_of_the_time(robot):
    case = robot.make(5)
    solution = sd.fuse(case.recording)
    assert max(bets.shares_beyond(case, solution, None).values()) < 0.05
    moved = solution.trajectory.lla + [0.0, 0.0, 20.0]
    off = replace(solution, trajectory=replace(solution.trajectory, lla=moved))
    shares = bets.shares_beyond(case, off, None)
    assert shares["height"] == 1.0 and shares["heading"] < 0.05
    smoothed = sd.smooth(case.recording)
    by_smoother = bets.shares_beyond(case, off, smoothed)
    assert by_smoother["height"] == 1.0 and "heading" not in by_smoother


def judged(robot, verdict):
    solution = sd.fuse(robot.make(5).recording, every=100)
    return replace(solution, meta=solution.meta | {"verdict": verdict.as_dict()})


def test_what_the_verdict_named_as_untested_is_said_apart(robot):
    mounting = Untested("mounting", "none", rests=("heading",), cause="mounting")
    solution = judged(robot, Verdict.of([], [mounting]))
    off = BY_NAME["mounting 5 deg off in heading"]
    assert bets.said_apart(off, ["heading"], solution)
    assert not bets.said_apart(off, ["heading", "height"], solution)
    assert not bets.said_apart(BY_NAME["gyros 2 % off"], ["heading"], solution)
    assert not bets.said_apart(None, ["heading"], solution)
    natural = Untested("accelerations", "no GNSS", rests=("heading",), cause="accelerometer")
    assert bets.said_apart(None, ["heading"], judged(robot, Verdict.of([], [natural])))


def test_a_mistake_below_its_bound_is_said_apart(robot):
    bound = SetUpBound("lever arm", "lever arm of gnss", 1.5, "m", "forward")
    solution = judged(robot, Verdict.of([], bounds=[bound]))
    small, large = (BY_NAME[f"antenna arm {size} m off, forward"] for size in (1, 3))
    assert bets.said_apart(small, ["horizontal position"], solution)
    assert not bets.said_apart(large, ["horizontal position"], solution)
    assert not bets.said_apart(BY_NAME["antenna arm 1 m off, up"], ["height"], solution)


@pytest.mark.parametrize("name", list(subjects.VARIANTS))
def test_each_variant_makes_a_recording_that_its_filter_takes(robot, name):
    variant = subjects.VARIANTS[name]
    case = subjects.with_variant(robot, variant, 3)
    assert len(sd.fuse(case.recording, variant.filter, every=100)) > 100


def test_filtered_fixes_have_the_stated_size_and_time(robot):
    """The errors of 10 recordings: a standard deviation within 15 %, and a correlation over 1 s of
    exp(-1/3) within 0.1, of a receiver that filters over 3 s."""
    off = []
    for seed in range(10):
        case = subjects.with_variant(robot, subjects.VARIANTS["fixes filtered over 3 s"], seed)
        velocity = case.recording.sources[1]
        truth = case.recording.reference
        down = np.interp(velocity.t, truth.t, truth.v_n[:, 2])
        off.append(velocity.y[:, 2] - down)
    assert np.std(off) == pytest.approx(0.08, rel=0.15)
    lag = [np.corrcoef(each[5:], each[:-5])[0, 1] for each in off]
    assert np.mean(lag) == pytest.approx(np.exp(-1 / 3), abs=0.1)


def made_up(evidence, wrong, mistake="right set-up", half=subjects.COUNTED):
    return {
        "half": half,
        "judged": True,
        "wrong": wrong,
        "said_apart": False,
        "trusted": not evidence,
        "doubted": bool(evidence),
        "untested_axes": False,
        "mistake": mistake,
        "evidence": json.dumps(evidence),
    }


def test_likelihood_ratios_find_what_weights_hide():
    """A remark below 1 that only wrong results have."""
    rows = [made_up({}, False)] * 60 + [made_up({"clock": 0.4}, True, "late")] * 30
    both = [summary.of_half(pd.DataFrame(rows), subjects.COUNTED)] * 2
    table = combination.compare_rules(*both).set_index("rule")
    assert table.loc["sum of weights, 1 or more", "trusted and wrong"] == "30 of 30"
    assert table.loc["likelihood ratios, threshold learned", "trusted and wrong"] == "0 of 30"
    assert table.loc["likelihood ratios, threshold learned", "correct set-up doubted"] == "0 of 60"


def test_spoilt_are_wrong_results_that_the_advice_has_made_trusted():
    row = {"applied": True, "before": "doubtful", "after": "trusted", "wrong_after": True}
    rows = pd.DataFrame([row, row | {"wrong_after": False}, row | {"before": "trusted"}])
    assert len(summary.spoilt(rows.assign(said_apart=False))) == 1
    assert len(summary.spoilt(rows.assign(said_apart=True))) == 0


@pytest.mark.deep
def test_a_quick_run_makes_a_page(tmp_path):
    from strapdown_reproductions.verdict_corpus.main import reproduce

    claims = reproduce(tmp_path, quick=True)
    assert {claim["claim"] for claim in claims} >= {"results in the corpus"}
    assert (tmp_path / "bets.csv").exists() and "Both halves" in (tmp_path / "table.md").read_text()
