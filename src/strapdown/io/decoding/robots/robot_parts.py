"""Common parts of the sections of a robot's log: mounting of a sensor, std from covariances, and
the meaning of topic names."""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....typing import Array
from ...reader import Section
from .robot_streams import TopicStream
from .ros_messages import Columns
from .ros_transforms import WORLD, Pose, RosFrames

FUSED = re.compile(
    r"filter|fused|fusion|ekf|ukf|kalman|combined|vins|vio|slam|lio|visual|locali[sz]ation|rtab",
    re.IGNORECASE,
)
AUTOPILOT = re.compile(
    r"(^|/)(global_position/(global|local|gp_vel)|local_position/\w+|mavros/odometry/in)$"
)
"""Topics of MAVROS that repeat GLOBAL_POSITION_INT, LOCAL_POSITION_NED and ODOMETRY of MAVLink
(https://mavlink.io/en/messages/common.html), estimates of the autopilot's filter; the measurements
of its receiver are below `global_position/raw`."""
BASE = re.compile(r"(^|/)base_(link|footprint)$")
TRUTH = re.compile(r"truth|(^|[/_])gt($|[/_])|p3d", re.IGNORECASE)


class Robot(NamedTuple):
    """The frames of a log, and that of its vehicle."""

    path: Path
    frames: RosFrames
    base: str  # the vehicle's frame

    def place(self, stream: TopicStream) -> Pose | None:
        """Return the pose of the sensor in the vehicle; None where the log does not state it."""
        return self.frames.pose(stream.frame, self.base)

    def not_of_vehicle(self, frame: str) -> str:
        """Return the reason why a forward speed in a frame is not that of the vehicle; "" where it
        is, or where this is unknown."""
        if WORLD.search(frame):
            return f"its frame {frame} is fixed to the ground, so that its x axis is not forward"
        if not frame or BASE.search(frame) or self.frames.pose(frame, self.base) is not None:
            return ""
        return f"the log has no transform from {self.base} to its frame {frame}"

    def title_text(self, stream: TopicStream, place: Pose | None) -> str:
        """Words on it for a title."""
        if stream.frame == self.base or place is None:
            return ""
        return f", mounted as in the transforms ({self.base} to {stream.frame})"

    def arm(self, stream: TopicStream) -> tuple[dict[str, Any], dict[str, str]]:
        """`lever_arm`, and the reason for an assumed one."""
        place = self.place(stream)
        if place is not None:
            return {"lever_arm": place.lever_arm}, {}
        why = f"the log has no transform from {self.base} to {stream.frame or 'its frame'}"
        return {"lever_arm": [0.0, 0.0, 0.0]}, {"lever_arm": why}


Made = tuple[list[Section], Columns]
"""Sections without their table and instance, and the columns of the table."""


def deviations(
    name: str, variances: Array, unit: str, assumed: list[float]
) -> tuple[list[Any], Columns, dict[str, str]]:
    """`std` of the components from variances (n, k), columns for it, and the reason for an assumed
    one."""
    known = np.where(variances > 0, variances, np.nan)
    if np.isnan(known).all(axis=0).any():
        return assumed, {}, {"std": "the log states none"}
    std = np.sqrt(known)
    if (std == std[0]).all():
        return (
            std[0].tolist(),
            {},
            {"std": "constant in the log, from the settings of the driver"},
        )
    columns = {f"std_{name}_{k}": std[:, k] for k in range(std.shape[1])}
    return [{"column": column, "unit": unit} for column in columns], columns, {}


def vector(names: str, values: Array) -> Columns:
    """Return columns of values (n, k) under these names, separated by blanks."""
    return dict(zip(names.split(), np.ascontiguousarray(values.T, dtype=float)))


def not_measured(stream: TopicStream) -> str:
    """Why a topic is not taken for a measurement, by its name; "": it is."""
    if FUSED.search(stream.topic):
        return "by its name it is an estimate, probably from the same IMU"
    if AUTOPILOT.search(stream.topic):
        return "it is the estimate of the autopilot's filter from its IMU and its receiver"
    return "by its name it is ground truth" if TRUTH.search(stream.topic) else ""


def median(values: Array) -> float:
    """Return the median of the finite values; NaN where there is none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")
