"""Protection levels: closed forms, what they cover, and how often they mislead."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import DOUBTFUL
from strapdown.data.verdict import SetUpBound, Untested, Verdict
from strapdown.evaluation.metrics import errors
from strapdown.evaluation.protection import protection_levels


@pytest.fixture(scope="module")
def drive():
    return sd.fuse(sd.simulate("car", 200.0, "industrial", seed=3), every=20, covariance=True)


def judged(solution, verdict):
    return replace(solution, meta=solution.meta | {"verdict": verdict.as_dict()})


def test_levels_without_bounds_are_quantiles(drive):
    levels = protection_levels(judged(drive, Verdict.of([])), risk=0.01)
    largest = np.linalg.eigvalsh(drive.covariance[:, :2, :2])[:, 1]
    assert np.allclose(levels.horizontal, np.sqrt(-2 * np.log(0.01) * largest), rtol=1e-6)
    assert np.allclose(levels.vertical, 2.5758293 * drive.std[:, 2])
    assert np.allclose(levels.heading, 2.5758293 * drive.std[:, 8])
    assert levels.uncovered == ()


def test_an_error_that_would_not_have_shown_is_added(drive):
    plain = protection_levels(judged(drive, Verdict.of([])))
    clock = SetUpBound("clock", "clock of GNSS position", 0.1, "s")
    arm = SetUpBound("lever arm", "lever arm of gnss", 0.4, "m", "down")
    with_both = protection_levels(judged(drive, Verdict.of([], bounds=[clock, arm])))
    speed = np.hypot(*drive.v_n[:, :2].T)
    assert np.allclose(with_both.horizontal - plain.horizontal, 0.1 * speed)
    assert np.allclose(
        with_both.vertical - plain.vertical, np.maximum(0.4, 0.1 * np.abs(drive.v_n[:, 2]))
    )


def test_no_level_where_the_solution_or_the_row_is_doubted(drive):
    status = drive.status.copy()
    status[5] = DOUBTFUL
    levels = protection_levels(judged(replace(drive, status=status), Verdict.of([])))
    assert np.isnan(levels.horizontal[5]) and np.isfinite(levels.horizontal[6:]).all()
    wrong = Verdict.of([sd.fuse(drive.recording.between(stop=40.0)).verdict.reasons][0] or [])
    doubted = judged(drive, replace(wrong, word="doubtful"))
    assert np.isnan(protection_levels(doubted).vertical).all()


def test_what_rests_on_something_untested_is_named(drive):
    geoid = Untested("height", "one source", rests=("height",))
    levels = protection_levels(judged(drive, Verdict.of([], [geoid])))
    assert levels.uncovered == ("height",) and "height only if" in str(levels)


@pytest.mark.parametrize("risk", [0.0, 1.0, -0.1])
def test_a_risk_that_is_none_is_refused(drive, risk):
    with pytest.raises(DataError, match="risk"):
        drive.protection(risk)


def test_levels_mislead_no_more_often_than_stated():
    """20 flights at a risk of 5 %, seeds fixed. Epochs of a flight hang together: with some 10
    independent ones of each, a share of 8.5 % has a false-alarm rate below 2 %."""
    beyond = []
    for seed in range(20):
        recording = sd.simulate("demo", 200.0, "tactical", seed=seed)
        solution = sd.fuse(recording, every=20)
        levels, e = solution.protection(0.05), errors(solution, recording.reference)
        rows = slice(100, None)
        radius = np.hypot(e.position[:, 0], e.position[:, 1])
        beyond.append(
            [
                np.mean((radius > levels.horizontal)[rows]),
                np.mean((np.abs(e.position[:, 2]) > levels.vertical)[rows]),
            ]
        )
    assert (np.mean(beyond, axis=0) < 0.085).all()
