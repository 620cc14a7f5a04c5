"""Turns of the gyro against those of the course: sign and unit."""

import bent
import numpy as np
import pytest

from strapdown.inspection.motion import InspectedRecording
from strapdown.inspection.turns import check


@pytest.mark.parametrize("name", ["drive", "flight"])
def test_a_right_gyro_is_a_fact(request, name):
    found = check(InspectedRecording(request.getfixturevalue(name)))
    assert found.reasons == [] and "gyro / course" in found.facts[0]


@pytest.mark.parametrize(
    "gyro, words",
    [
        (np.diag([1, 1, -1]), "turns left where the course"),
        (np.eye(3) * 57.3, "deg/s read as rad/s"),
        (np.eye(3) / 57.3, "rad/s read as deg/s"),
        (np.eye(3) * 3, "a wrong unit or scale"),
    ],
)
def test_a_wrong_gyro_is_named(drive, gyro, words):
    (reason,) = check(InspectedRecording(bent.imu(drive, np.eye(3), gyro))).reasons
    assert words in reason.seen


def test_a_clock_that_is_off_by_seconds_does_not_matter(drive):
    assert check(InspectedRecording(bent.later(drive, 2.0))).reasons == []


def test_a_mounting_does_not_matter(drive):
    lying = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
    assert check(InspectedRecording(bent.imu(drive, lying))).reasons == []
