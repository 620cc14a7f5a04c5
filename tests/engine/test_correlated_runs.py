"""Runs over recordings whose sources have correlated errors: live as in batch, from a start that is
made of their fixes, by filters without such states; too many of them."""

from dataclasses import replace

import numpy as np
import pytest
from lasting import EXACT, POSITION, TIME, VELOCITY, straight, told
from test_stream import equal, events_of, play, shuffled

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import MAX_STATES
from strapdown.data.solution import Correlated
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.engine.stream import Stream

pytestmark = pytest.mark.short


def fused(recording, start, **more):
    return sd.fuse(recording, start=start, noise=EXACT, covariance=True, **more)


def test_a_filter_without_these_states_says_so_in_batch_and_live():
    name = "pkf"
    recording, start = straight(6.0)
    said = f"{name} does not estimate the correlated errors of position: "
    solution = fused(recording, start, filter=name)
    assert sum(note.startswith(said) for note in solution.meta["notes"]) == 1
    assert solution.counts()["position"][0] > 0
    stream = Stream(name, start=start, noise=EXACT, sources=recording.sources)
    assert sum(note.startswith(said) for note in stream.notes) == 1
    play(stream, events_of(recording))
    assert equal(stream.finish(), solution)


def test_a_stream_is_the_batch_bit_for_bit_with_late_fixes_too():
    recording, start = straight()
    solution = fused(recording, start)
    stream = Stream("closed-loop", start=start, noise=EXACT, sources=recording.sources, lag=0.4)
    play(stream, shuffled(events_of(recording), 0.39))
    assert equal(stream.finish(), solution)
    for name, values in solution.columns.items():
        assert np.array_equal(stream.solution.columns[name], values)
    again = fused(stream.solution.recording, start)
    assert np.array_equal(again.trajectory.lla, solution.trajectory.lla)


def test_a_start_made_of_fixes_has_their_correlated_errors():
    recording, _ = straight()
    made = replace(recording, meta={"grade": "tactical"})
    start = sd.align(made, sd.imu("tactical"))
    P = begin(made, "closed-loop", run_options(start=start)).belief.P
    variance = np.square(start.std)
    for row, deviation, state in ((0, 1.5, 15), (2, 2.5, 16), (3, 0.3, 17), (4, 0.2, 18)):
        assert P[row, row] == pytest.approx(variance[row] + deviation**2)
        assert P[row, state] == P[state, row] == pytest.approx(-(deviation**2))
    assert P[1, 1] == pytest.approx(variance[1])
    widened = told(told(made, POSITION, TIME, False), VELOCITY, TIME, False, "velocity")
    diagonal = begin(widened, "closed-loop", run_options(start=start)).belief.P
    np.testing.assert_allclose(np.diag(diagonal), np.diag(P)[:15])
    given = begin(made, "closed-loop", run_options(start=start._replace(motion=()))).belief.P
    np.testing.assert_array_equal(given[:15, :15], np.diag(variance))


def test_more_states_than_there_is_room_for_are_refused():
    recording, start = straight()
    many = tuple(
        replace(recording.sources[0], name=f"receiver {k}", correlated=Correlated((1.0,) * 3, 30.0))
        for k in range((MAX_STATES - 15) // 3 + 1)
    )
    with pytest.raises(DataError, match="at most 30 can be estimated: leave"):
        fused(replace(recording, sources=many), start)


@pytest.mark.parametrize(
    "bad, said",
    [
        (
            Correlated((1.0,) * 4, 30.0),
            "position: std of its correlated errors is (1.0, 1.0, 1.0, 1.0);",
        ),
        (Correlated((1.0, 1.0, -1.0), 30.0), "position: std of its correlated errors is"),
        (Correlated((0.0,) * 3, 30.0), "one must be above 0"),
        (Correlated((1.0,) * 3, 0.0), "position: time of its correlated errors is 0.0 s"),
        (Correlated((1.0,) * 3, 30.0, "no"), "position: states of its correlated errors is 'no'"),
        ({"std": 1.0, "time": 30.0}, "it must be a Correlated, std and time"),
    ],
)
def test_correlated_errors_that_cannot_be_are_refused(bad, said):
    recording, start = straight(2.0)
    sources = (replace(recording.sources[0], correlated=bad), recording.sources[1])
    with pytest.raises(DataError) as batch:
        fused(replace(recording, sources=sources), start)
    with pytest.raises(DataError) as live:
        Stream("closed-loop", start=start, noise=EXACT, sources=sources)
    assert said in str(batch.value) and str(batch.value) == str(live.value)
