"""`Stream.tested_after`: the measurements that the filter was given last, with the results of their tests."""

import numpy as np
import pytest
from recordings import events_of, flight

import strapdown as sd
from strapdown.engine.stream import HISTORY

pytestmark = pytest.mark.short


def stream_of(recording, history=HISTORY):
    """A stream that has used the recording, with a source first that its filter cannot use."""
    gravity = sd.Source("attitude", np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    sources = (gravity, *recording.sources)
    stream = sd.Stream(
        "closed-loop", imu="tactical", sources=sources, align_within=5.0, history=history
    )
    assert stream.tested_after(-np.inf) == []
    for event in events_of(recording):
        if isinstance(event, sd.Measurement):
            event = event._replace(source=event.source + 1)
        stream.step(event)
    return stream


@pytest.mark.parametrize("history", [HISTORY, 100])
def test_they_are_the_innovations_of_the_solution(history):
    stream = stream_of(flight(), history)
    found, wanted = stream.tested_after(-np.inf, 1000), stream.solution.innovations
    t, source, y, innovation, nis, gate, accepted = zip(*found)
    shift = len(stream.used) == 2  # the filter leaves the first source out
    assert np.array_equal(t, wanted.t) and np.array_equal(source, wanted.source + shift)
    assert np.array_equal(nis, wanted.nis) and np.array_equal(accepted, wanted.accepted)
    assert np.array_equal(innovation, wanted.innovation, equal_nan=True)
    assert np.array_equal(gate, np.array(wanted.gates)[wanted.source])
    assert [*y[-1]] == [*flight().sources[source[-1] - 1].y[-1]]
    newest = stream.tested_after(-np.inf, 3)
    assert [each.t for each in newest] == [*t[-3:]]
    assert [each.t for each in stream.tested_after(18.5)] == [each for each in t if each > 18.5]
    assert stream.tested_after(t[-1]) == []
