"""`Stream.tested_after`: the measurements that the filter was given last, with the results of their tests."""

import numpy as np
import pytest
from recordings import events_of, flight

import strapdown as sd
from strapdown.engine.stream import HISTORY

pytestmark = pytest.mark.short


@pytest.mark.parametrize("history", [HISTORY, 100])
def test_they_are_the_innovations_of_the_solution(history):
    stream = sd.Stream(
        "closed-loop",
        imu="tactical",
        sources=flight().sources,
        align_within=5.0,
        history=history,
    )
    assert stream.tested_after(-np.inf) == []
    for event in events_of(flight()):
        stream.step(event)
    found, wanted = stream.tested_after(-np.inf, 1000), stream.solution.innovations
    t, source, y, innovation, nis, gate, accepted = zip(*found)
    assert np.array_equal(t, wanted.t) and np.array_equal(source, wanted.source)
    assert np.array_equal(nis, wanted.nis) and np.array_equal(accepted, wanted.accepted)
    assert np.array_equal(innovation, wanted.innovation, equal_nan=True)
    assert np.array_equal(gate, np.array(wanted.gates)[wanted.source])
    assert [*y[-1]] == [*flight().sources[source[-1]].y[-1]]
    newest = stream.tested_after(-np.inf, 3)
    assert [each.t for each in newest] == [*t[-3:]]
    assert [each.t for each in stream.tested_after(18.5)] == [each for each in t if each > 18.5]
    assert stream.tested_after(t[-1]) == []


def test_sources_have_the_places_that_they_were_given():
    position, heading = (
        flight().sources[0],
        sd.Source("heading", np.empty(0), np.empty((0, 1)), np.empty((0, 1))),
    )
    stream = sd.Stream(
        "mahony", imu="tactical", sources=(position, heading), align_within=5.0, lag=0.0
    )
    truth = flight().reference
    for event in events_of(flight()):
        if isinstance(event, sd.Sample):
            stream.step(event)
        elif event.source == 0:
            yaw = float(np.interp(event.t, truth.t, truth.rph[:, 2]))
            stream.step(sd.Measurement(event.t, 1, (yaw,), (0.02,)))
    assert [a.kind for a in stream.used] == ["heading"]
    found = stream.tested_after(-np.inf)
    assert len(found) > 10 and {each.source for each in found} == {1}
