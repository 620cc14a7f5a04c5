"""Mounting of the sensors of a robot: the fixed ones among its transforms between frames."""

import math
import re
import struct
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ....typing import Array
from .ros_messages import RosTopic

STATIC = "tf_static"
MIN_EQUAL = 3
"""Number of equal transforms on a topic of variable transforms after which one counts as fixed."""

WORLD = re.compile(
    r"((^|[/_])(map|odom|world|earth|ecef|utm)|(^|/)(enu|ned|local_origin))"
    r"(_(frame|enu|ned|combined|origin))*$",
    re.IGNORECASE,
)
"""Names of ground-fixed frames (REP 105, https://ros.org/reps/rep-0105.html, and names that drivers
use)."""


class Pose(NamedTuple):
    """Pose of a frame in another one: v_other = C v + t, axes as in ROS (forward, left, up)."""

    C: Array
    t: Array

    def of(self, inner: "Pose") -> "Pose":
        """Return the pose in the other frame of an object with the pose `inner` in this frame."""
        return Pose(self.C @ inner.C, self.C @ inner.t + self.t)

    @property
    def inverse(self) -> "Pose":
        """The pose of the other frame in this one."""
        return Pose(self.C.T, -self.C.T @ self.t)

    @property
    def lever_arm(self) -> list[float]:
        """The position, m forward, right, down."""
        return [round(float(each), 6) + 0.0 for each in self.t * (1, -1, -1)]

    @property
    def mounting(self) -> dict[str, float | str]:
        """roll, pitch and heading of the frame's axes forward, right, down, deg."""
        turn = np.diag([1.0, -1.0, -1.0])
        C = turn @ self.C @ turn
        angles = {
            "roll": math.atan2(C[2, 1], C[2, 2]),
            "pitch": -math.asin(min(max(C[2, 0], -1.0), 1.0)),
            "heading": math.atan2(C[1, 0], C[0, 0]),
        }
        degrees = {key: round(math.degrees(each), 6) + 0.0 for key, each in angles.items()}
        return {**degrees, "unit": "deg"}

    @property
    def is_turned(self) -> bool:
        """True where the axes differ from those of the other frame."""
        return not np.allclose(self.C, np.eye(3), atol=1e-8)


HERE = Pose(np.eye(3), np.zeros(3))


def plain(frame: str) -> str:
    """Return the name of a frame in the form of ROS 2, without a leading slash."""
    return frame.strip().lstrip("/")


class RosFrames:
    """The fixed transforms of a log by frame.

    A vehicle moves against the ground sooner or later, so that /tf gives no fixed transform to a
    frame of WORLD.
    """

    def __init__(self, messages: Iterable[tuple[RosTopic, bytes]] = ()) -> None:
        seen: dict[tuple[str, str], list[tuple[bool, tuple[float, ...]]]] = {}
        for topic, payload in messages:
            static = topic.name.endswith(STATIC)
            try:
                for parent, child, numbers in _parse(payload, topic.encoding):
                    seen.setdefault((child, parent), []).append((static, numbers))
            except (struct.error, ValueError):
                continue
        self._parents: dict[str, tuple[str, Pose]] = {}
        for (child, parent), found in seen.items():
            static, numbers = found[-1]
            ground = WORLD.search(parent) or WORLD.search(child)
            still = len(found) >= MIN_EQUAL and all(each == numbers for _, each in found)
            fixed = static or (still and not ground)
            pose = pose_of(numbers)
            if fixed and pose is not None and child != parent:
                self._parents[child] = parent, pose

    def _up(self, frame: str) -> dict[str, Pose]:
        """{ancestor: pose of the frame in it}, itself first."""
        found, pose = {frame: HERE}, HERE
        while frame in self._parents:
            frame, step = self._parents[frame]
            if frame in found:
                break
            pose = step.of(pose)
            found[frame] = pose
        return found

    def pose(self, frame: str, base: str) -> Pose | None:
        """Return the pose of a frame in `base`; None where the log does not state it."""
        mine, of_base = self._up(frame), self._up(base)
        for ancestor, pose in mine.items():
            if ancestor in of_base:
                return of_base[ancestor].inverse.of(pose)
        return None

    def frame_names(self) -> list[str]:
        """Names of all frames."""
        return list(
            dict.fromkeys(each for child, (up, _) in self._parents.items() for each in (up, child))
        )


def pose_of(numbers: tuple[float, ...]) -> Pose | None:
    """Return the Pose of a transform (x, y, z, qx, qy, qz, qw); None where it is none."""
    x, y, z, w = numbers[3:]
    norm = math.sqrt(x * x + y * y + z * z + w * w) if np.isfinite(numbers).all() else 0.0
    if not 0.9 < norm < 1.1 or max(map(abs, numbers[:3])) > 1000:
        return None
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    C = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return Pose(np.array(C), np.array(numbers[:3]))


def _parse(payload: bytes, encoding: str) -> list[tuple[str, str, tuple[float, ...]]]:
    """(parent, child, (x, y, z, qx, qy, qz, qw)) of each geometry_msgs/TransformStamped of a
    tf2_msgs/TFMessage."""
    cdr = encoding == "cdr"
    begin = 4 if cdr else 0
    order = ">" if cdr and payload[1:2] == b"\0" else "<"
    at, found = begin, []

    def number(code: str, size: int) -> tuple[float, ...]:
        nonlocal at
        at += -(at - begin) % size if cdr else 0
        values = struct.unpack_from(order + code, payload, at)
        at += struct.calcsize(order + code)
        return values

    def text() -> str:
        nonlocal at
        length = int(number("I", 4)[0])
        if length > len(payload) - at:
            raise ValueError("a text ends beyond its message")
        at += length
        return payload[at - length : at].rstrip(b"\0").decode("utf-8", "replace")

    for _ in range(int(number("I", 4)[0])):
        number("II" if cdr else "III", 4)
        parent, child = plain(text()), plain(text())
        found.append((parent, child, number("7d", 8)))
    return found
