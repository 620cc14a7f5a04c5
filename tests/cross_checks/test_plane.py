"""The mounting in the plane: any angle is found, and what the remedy says puts it right."""

import re

import bent
import numpy as np
import pytest

from strapdown.cross_checks.motion import Subject
from strapdown.cross_checks.plane import check
from strapdown.preprocessing.axes import BODY_AXES, axes_matrix


def reason_of(recording):
    (reason,) = check(Subject(recording)).reasons
    return reason


@pytest.mark.parametrize("name", ["drive", "flight"])
def test_right_axes_are_a_fact(request, name):
    found = check(Subject(request.getfixturevalue(name)))
    assert found.reasons == [] and "mounting of the IMU" in found.facts[0]


@pytest.mark.parametrize("name", ["drive", "flight"])
@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_right_angles_are_named_and_the_remedy_cures(request, name, degrees):
    wrong = bent.imu(request.getfixturevalue(name), bent.turned(degrees))
    reason = reason_of(wrong)
    assert reason.cause == "axes" and f"turned by {degrees} deg" in reason.seen
    axes = re.search(r'"(.*)"', reason.remedy)[1]
    cured = bent.imu(wrong, axes_matrix(axes, BODY_AXES))
    assert check(Subject(cured)).reasons == []


@pytest.mark.parametrize("degrees", [-50, 35, 130])
def test_any_other_angle(drive, degrees):
    wrong = bent.imu(drive, bent.turned(degrees))
    reason = reason_of(wrong)
    assert reason.cause == "mounting" and "`heading` of `mounting`" in reason.remedy
    heading = float(re.search(r"add ([+-]\d+) deg", reason.remedy)[1])
    assert abs(heading + degrees) < 6
    assert check(Subject(bent.imu(wrong, bent.turned(heading)))).reasons == []


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
    found = check(Subject(drive.between(0.0, 19.0)))
    assert found.reasons == [] and "too few fixes" in found.inconclusive[0]
