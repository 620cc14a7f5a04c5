"""The mounting in the plane: any angle is found, and what the remedy says puts it right."""

import re
from dataclasses import replace

import bent
import numpy as np
import pytest
from walking import RTK, robot

import strapdown as sd
from strapdown.inspection.motion import InspectedRecording
from strapdown.inspection.plane import check
from strapdown.preprocessing.axes import BODY_AXES, axes_matrix


def reason_of(recording):
    (reason,) = check(InspectedRecording(recording)).reasons
    return reason


@pytest.mark.parametrize("name", ["drive", "flight"])
def test_right_axes_are_a_fact(request, name):
    found = check(InspectedRecording(request.getfixturevalue(name)))
    assert found.reasons == [] and "mounting of the IMU" in found.facts[0]


@pytest.mark.parametrize("name", ["drive", "flight"])
@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_right_angles_are_named_and_the_remedy_cures(request, name, degrees):
    wrong = bent.imu(request.getfixturevalue(name), bent.turned(degrees))
    reason = reason_of(wrong)
    assert reason.cause == "axes" and f"rotated by {degrees} deg" in reason.seen
    axes = re.search(r'"(.*)"', reason.remedy)[1]
    cured = bent.imu(wrong, axes_matrix(axes, BODY_AXES))
    assert check(InspectedRecording(cured)).reasons == []


@pytest.mark.parametrize("degrees", [-50, 35, 130])
def test_any_other_angle(drive, degrees):
    wrong = bent.imu(drive, bent.turned(degrees))
    reason = reason_of(wrong)
    assert reason.cause == "mounting" and "`heading` of `mounting`" in reason.remedy
    heading = float(re.search(r"add ([+-]\d+) deg", reason.remedy)[1])
    assert abs(heading + degrees) < 6
    assert check(InspectedRecording(bent.imu(wrong, bent.turned(heading)))).reasons == []


@pytest.mark.parametrize("name", ["drive", "flight"])
@pytest.mark.parametrize(
    "matrix, words",
    [
        (np.diag([1, -1, 1]), "y has the wrong sign"),
        (np.diag([-1, 1, 1]), "x has the wrong sign"),
        ([[0, 1, 0], [1, 0, 0], [0, 0, 1]], "x and y are exchanged"),
        ([[0, -1, 0], [-1, 0, 0], [0, 0, 1]], "x and y are exchanged and have the wrong sign"),
    ],
)
def test_mirrored_axes_are_named(request, name, matrix, words):
    reason = reason_of(bent.imu(request.getfixturevalue(name), matrix))
    assert "left-handed" in reason.seen and reason.seen.endswith(words), reason


def test_without_motion_it_is_inconclusive(drive):
    found = check(InspectedRecording(drive.between(0.0, 19.0)))
    assert found.reasons == [] and "too few fixes" in found.inconclusive[0]


WALKING = {
    "positions of 5 cm": RTK,
    "positions of 5 cm once a second": RTK._replace(interval=1.0),
    "velocities of 10 cm/s": RTK._replace(position_std=1.5, velocity_std=0.1),
}


@pytest.mark.parametrize("seed", [4001, 4002])
@pytest.mark.parametrize("name", WALKING)
def test_walking_speed_tells_the_axes(seed, name):
    """A robot that is never faster than 1.5 m/s."""
    right = robot(seed, WALKING[name], 1.5)
    assert np.hypot(*right.reference.v_n[:, :2].T).max() < 1.6
    found = check(InspectedRecording(right))
    assert found.reasons == [] and found.facts
    for degrees in (90, 180, 270):
        reason = reason_of(bent.imu(right, bent.turned(degrees)))
        assert reason.cause == "axes" and f"rotated by {degrees} deg" in reason.seen
    assert reason_of(bent.imu(right, np.diag([1, -1, 1]))).cause == "axes"


@pytest.mark.parametrize("seed", range(4003, 4007))
def test_a_hand_at_walking_speed_has_no_axes(seed):
    """What is carried turns as it likes; a person may also hold it askew."""
    held = sd.simulate("hand-held", 60.0, seed=seed, gnss=RTK)
    assert check(InspectedRecording(held)).reasons == []
    walk = bent.imu(robot(seed), bent.turned(90))
    walk = replace(walk, meta={**walk.meta, "vehicle": "pedestrian"})
    assert check(InspectedRecording(walk)).reasons == []
