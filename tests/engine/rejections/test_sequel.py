"""How long a jump or a drift leaves rows doubtful."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.core.loop.contract import DOUBTFUL
from strapdown.engine.rejections.causes import CLOCK, DRIFT, JUMP, CauseFound
from strapdown.engine.rejections.contradictions import RejectedRun
from strapdown.engine.rejections.sequel import SOON, repeated_spans, unresolved_spans

NORTH = np.array([10.0, 0.0, 0.0])


def run(shape, since, size=NORTH, until=np.inf, source=0, silent=1.0):
    found = CauseFound(shape, size, since, until, 1.0, 50.0)
    return RejectedRun(source, since, since + 4.0, 5, 5, 9.0, found, silent=silent)


def test_a_jump_is_doubtful_to_the_end_or_until_it_returns():
    away, back = run(JUMP, 20.0), run(JUMP, 50.0, -1.1 * NORTH)
    assert unresolved_spans([away], [0]) == [(20.0, np.inf)]
    assert unresolved_spans([away, back], [0]) == [(20.0, 50.0)]
    further = run(JUMP, 50.0, [5.0, 0.0, 0.0])
    assert unresolved_spans([away, further], [0]) == [(20.0, np.inf)]
    home = run(JUMP, 80.0, [-15.0, 0.5, 0.0])
    assert unresolved_spans([away, further, home], [0]) == [(20.0, 80.0)]
    assert unresolved_spans([away, back, run(JUMP, 90.0)], [0]) == [(20.0, 50.0), (90.0, np.inf)]


def test_steps_of_one_run_count_together():
    there_and_back = run(JUMP, 20.0, np.r_[NORTH, -NORTH, NORTH])
    assert unresolved_spans([there_and_back], [0]) == [(20.0, np.inf)]


def test_a_drift_is_doubtful_from_its_beginning():
    assert unresolved_spans([run(DRIFT, 30.0)], [0]) == [(30.0, np.inf)]


@pytest.mark.parametrize(
    "other",
    [
        run(JUMP, 20.0, until=25.0),  # it returned by itself
        run(JUMP, 20.0, silent=30.0),  # the filter was alone before
        run(CLOCK, 20.0),
        run(JUMP, 20.0, source=3),
    ],
)
def test_others_leave_nothing(other):
    assert unresolved_spans([other], [0]) == []


def test_a_source_that_contradicts_again_was_wrong_meanwhile():
    soon, late = 50.0 + 0.9 * SOON, 50.0 + 1.1 * SOON
    assert repeated_spans([(0, 40.0, 50.0), (0, soon, soon + 5)]) == [(40.0, soon + 5)]
    assert repeated_spans([(0, 40.0, 50.0), (0, late, late)]) == [(40.0, 50.0), (late, late)]
    assert repeated_spans([(1, soon, soon), (0, 40.0, 50.0)]) == [(40.0, 50.0), (soon, soon)]
    assert repeated_spans([(0, 40.0, 90.0), (0, 45.0, 50.0)]) == [(40.0, 90.0)]


def test_rows_after_a_jump_for_good_are_doubtful_and_those_before_are_not():
    recording = sd.simulate("demo", 200.0, seed=4)
    position = recording.sources[0]
    assert position.kind == "position"
    y = position.y.copy()
    y[position.t > 100.0, 0] += 30.0 / 6.37e6
    jumped = replace(recording, sources=(replace(position, y=y), *recording.sources[1:]))
    solution = sd.fuse(jumped)
    after = solution.t > 102.0
    assert (solution.status[after] == DOUBTFUL).all()
    assert not (solution.status[(solution.t > 60.0) & (solution.t < 99.0)] == DOUBTFUL).any()
