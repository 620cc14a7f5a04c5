"""Held values: repeated fixes, a source that is stuck, an IMU that is written twice."""

from dataclasses import replace

import bent
import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import Source
from strapdown.inspection.motion import InspectedRecording
from strapdown.inspection.repeats import check


def repeated(source, times):
    """Each fix `times` times, evenly over the interval to the next."""
    step = np.median(np.diff(source.t)) / times
    return replace(
        source,
        t=(source.t[:, None] + step * np.arange(times)).ravel(),
        y=np.repeat(source.y, times, axis=0),
        std=np.repeat(source.std, times, axis=0),
    )


@pytest.mark.parametrize("times, words", [(2, "50 %"), (5, "80 %"), (10, "90 %"), (40, "98 %")])
def test_repeated_fixes(drive, times, words):
    held = bent.with_sources(drive, lambda a: repeated(a, times))
    reasons = check(InspectedRecording(held)).reasons
    assert {reason.source for reason in reasons} == {"GNSS position", "GNSS velocity"}
    assert all(words in reason.seen and reason.cause == "repeated" for reason in reasons)


def test_a_right_recording_and_a_standing_one_are_not_accused(drive):
    assert check(InspectedRecording(drive)).reasons == []

    def rounded(a):
        return replace(a, y=np.round(a.y, 7 if a.kind == "position" else 1))

    standing = bent.with_sources(drive.between(0, 20.0), rounded)
    assert check(InspectedRecording(standing)).reasons == []


def test_a_stuck_source(drive):
    def stuck(a):
        y = a.y.copy()
        y[(a.t > 35) & (a.t < 47)] = y[np.searchsorted(a.t, 35)]
        return replace(a, y=y)

    (reason,) = check(InspectedRecording(bent.with_sources(drive, stuck, ("position",)))).reasons
    assert "stuck" in reason.seen and "to 46." in reason.seen and reason.source == "GNSS position"


def test_an_imu_written_twice(drive):
    imu = drive.imu
    twice = [np.repeat(column[::2], 2, axis=0) for column in (imu.dtheta, imu.dv)]
    held = replace(drive, imu=imu._replace(dtheta=twice[0], dv=twice[1]))
    (reason,) = check(InspectedRecording(held)).reasons
    assert "50 % of the IMU samples" in reason.seen and reason.source == ""


def test_a_height_that_is_stuck_to_the_end():
    t = np.arange(120.0)
    noise = np.random.default_rng(5).normal(size=(120, 1))
    ship = sd.simulate("ship-heave", 120.0, seed=1)
    with_height = lambda y: InspectedRecording(
        replace(ship, sources=(Source("altitude", t, y, np.ones_like(y), name="barometer"),))
    )
    assert check(with_height(noise)).reasons == []
    assert check(with_height(np.where(t[:, None] > 80.0, 0.0, np.round(noise)))).reasons == []
    (reason,) = check(with_height(np.where(t[:, None] > 80.0, noise[80], noise))).reasons
    assert reason.source == "barometer" and "from 80.0 s to its end" in reason.seen
