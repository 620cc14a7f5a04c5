"""Sensors beside GNSS that contradict it: left out, also in an outage afterwards, and used again."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.sensor_models.any_sensor import Simulated

pytestmark = pytest.mark.short
SENSORS = [Simulated("body-velocity", 0.05, 5.0)]


@pytest.fixture(scope="module")
def drive():
    return sd.simulate("car", 200.0, "tactical", seed=3, sensors=SENSORS)


def with_log(recording, change):
    """The recording with readings of its Doppler log changed: (t, y) -> y."""
    sources = tuple(
        replace(a, y=change(a.t[:, None], a.y)) if a.kind == "body-velocity" else a
        for a in recording.sources
    )
    return replace(recording, sources=sources)


def without_log(recording):
    return replace(recording, sources=recording.sources[:2])


def worst(solution, recording, begin):
    """m, largest horizontal error from then on."""
    e = sd.errors(solution, recording.reference)
    return np.linalg.norm(e.position[e.t > begin, :2], axis=1).max()


def said(solution):
    return [text for _, text in solution.events if "body-velocity" in text]


def test_a_right_sensor_is_used(drive):
    solution = sd.fuse(drive)
    assert not any("contradicts" in text for text in said(solution))
    assert solution.counts()["body-velocity"][1] < 10


@pytest.mark.parametrize("factor", [-1.0, 1.1, 3600 / 1852])
def test_a_wrong_sensor_does_no_harm_and_is_said(drive, factor):
    solution, alone = (
        sd.fuse(each) for each in (with_log(drive, lambda t, y: factor * y), without_log(drive))
    )
    assert any("contradicts position and velocity" in text for text in said(solution))
    assert worst(solution, drive, 60.0) < 1.5 * worst(alone, drive, 60.0)


def test_it_stays_out_while_gnss_is_lost(drive):
    lost = with_log(drive, lambda t, y: -y).hidden([(120.0, 150.0)], ("position", "velocity"))
    solution, alone = sd.fuse(lost), sd.fuse(without_log(lost))
    assert worst(solution, drive, 100.0) < 1.5 * worst(alone, drive, 100.0)
    inside = (solution.innovations.t > 120) & (solution.innovations.t < 150)
    assert inside.any() and not solution.innovations.accepted[inside].any()


def test_it_is_used_again_once_it_is_right(drive):
    solution = sd.fuse(with_log(drive, lambda t, y: np.where((t > 60) & (t < 80), -y, y)))
    assert any("agrees with position and velocity again" in text for text in said(solution))
    late = (solution.innovations.t > 180) & (solution.innovations.source == 2)
    assert solution.innovations.accepted[late].mean() > 0.9


def test_it_is_not_used_in_an_outage_soon_after(drive):
    """Wrong from 60 to 80 s it is used again from about 125 s on, and without GNSS from 185 s on."""
    wrong = with_log(drive, lambda t, y: np.where((t > 60) & (t < 80), -y, y))
    solution = sd.fuse(wrong.hidden([(145.0, 175.0)], ("position", "velocity")))
    assert any("nothing checks it without position and velocity" in text for text in said(solution))
    at, log = solution.innovations.t, solution.innovations.source == 2
    used = solution.innovations.accepted
    assert used[log & (at > 135) & (at < 145)].mean() > 0.9
    assert not used[log & (at > 156) & (at < 175)].any()


def test_a_stream_leaves_it_out_too(drive):
    from recordings import events_of, start as near

    wrong = with_log(drive, lambda t, y: -y).between(stop=60.0)
    solution = sd.fuse(wrong, start=near(wrong), covariance=True)
    stream = sd.Stream("closed-loop", imu="tactical", sources=wrong.sources, start=near(wrong))
    for event in events_of(wrong):
        stream.step(event)
    assert np.array_equal(stream.finish().P, solution.covariance[-1])


def test_a_sensor_without_a_gate_is_used_all_the_same(drive):
    """As a published filter does; `inf` switches gating off, and no stage may leave it out instead."""
    wrong = with_log(drive, lambda t, y: 1.1 * y)
    free = [replace(a, gate=np.inf) if a.kind == "body-velocity" else a for a in wrong.sources]
    solution = sd.fuse(replace(wrong, sources=tuple(free)))
    assert not any("contradicts" in text and "left out" in text for text in said(solution))
    assert solution.counts()["body-velocity"][1] == 0
