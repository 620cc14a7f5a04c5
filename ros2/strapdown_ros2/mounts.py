"""The mounting of a sensor: its axes, and its place from the base frame of the vehicle."""

from typing import Any, NamedTuple

import numpy as np

from strapdown.io.decoding.robots.ros_transforms import Pose, pose_of
from strapdown.preprocessing.axes import BODY_AXES, axes_matrix, rotation_matrix
from strapdown.typing import Array
from strapdown.units.conversion import factor

FLU = axes_matrix("FLU", BODY_AXES)
"""From forward, left, up, as in ROS (REP 103), to forward, right, down."""


class Mount(NamedTuple):
    """Axes and place of a sensor."""

    matrix: Array  # (3, 3) from the axes of its messages to those of the body, forward, right, down
    arm: Array  # (3,) m from the base frame, body

    @classmethod
    def none(cls) -> "Mount":
        """Return that of a sensor at the base frame with its axes."""
        return cls(FLU, np.zeros(3))


def pose_of_transform(transform: Any) -> Pose | None:
    """Return the Pose of a geometry_msgs/Transform; None where its numbers are none."""
    a, q = transform.translation, transform.rotation
    return pose_of((a.x, a.y, a.z, q.x, q.y, q.z, q.w))


def mount_at(pose: Pose) -> Mount:
    """Return the Mount of a sensor beside the IMU with a pose in the base frame."""
    return Mount(FLU @ pose.C, np.array(pose.lever_arm))


def imu_mount_at(pose: Pose) -> Mount:
    """Return the Mount of an IMU with a pose in the base frame: by the angles and the lever arm with
    which the reader of bags describes it, so that both turn a sample by the same matrix."""
    matrix = FLU
    if pose.is_turned:
        angles = [float(pose.mounting[name]) for name in ("roll", "pitch", "heading")]
        matrix = rotation_matrix(*(factor("deg", "angle") * each for each in angles)) @ FLU
    return Mount(matrix, np.array(pose.lever_arm))
