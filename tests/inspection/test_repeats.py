"""Held values: repeated fixes, a source that is stuck, an IMU that is written twice."""

from dataclasses import replace

import bent
import numpy as np
import pytest

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
