"""The IMU of a robot's log, and the attitude that its messages bring."""

from typing import Any

import numpy as np

from ....typing import Array
from ...contract import Section
from .robot_parts import Made, Robot, deviations, median, vector
from .robot_streams import Stream
from .ros_transforms import Pose

LEAST_FORCE = 3.0
"""m/s^2, least median of the specific force where gravity is in it."""
DIRECTIONS = ("forward", "backward"), ("left", "right"), ("up", "down")
ATTITUDE_SD = [0.02, 0.02, 0.1]
"""rad, of roll, pitch and heading where a log states none."""


def imu(stream: Stream, robot: Robot) -> Made:
    """Sections and columns of sensor_msgs/Imu: the IMU, and its attitude, which is left."""
    gyro, accel = stream.columns["angular_velocity"], stream.columns["linear_acceleration"]
    place = robot.place(stream)
    keys: dict[str, Any] = {
        "axes": "FLU",
        "gyro": {"columns": ["wx", "wy", "wz"], "unit": "rad/s"},
        "accel": {"columns": ["fx", "fy", "fz"], "unit": "m/s^2"},
        "grade": "consumer",
    }
    if place is not None and stream.frame != robot.base:
        keys |= {"mounting": place.mounting} if place.is_turned else {}
        keys |= {"lever_arm": place.lever_arm}
    C = np.eye(3) if place is None else place.C
    left, agrees = _doubt(stream, C @ [median(each) for each in accel.T])
    if "set " in left:
        left += f" in what `strapdown inspect {robot.path} --imu N --write recording.toml` writes"
    assumed = {"axes": f"REP 103{agrees}", "grade": "the log states none"}
    columns = {**vector("wx wy wz", gyro), **vector("fx fy fz", accel)}
    title = robot.said(stream, place)
    sections = [Section("imu", "imu", keys, title=title, assumed=assumed, left=left)]
    attitude, more = _attitude(stream, place)
    return [*sections, *attitude], {**columns, **more}


def _doubt(stream: Stream, force: Array) -> tuple[str, str]:
    """Why an IMU is not taken, or "", and what gravity says of its axes; `force` is its median
    in the vehicle's axes, forward, left, up."""
    for name, sensor in (("angular_velocity", "gyro"), ("linear_acceleration", "accelerometer")):
        covariance = stream.columns[f"{name}_covariance"]
        if (covariance[:, 0] == -1).all() or not stream.columns[name].any():
            return f"it has no {sensor}; gyro and accelerometer of one topic are needed", ""
    norm = median(np.linalg.norm(stream.columns["linear_acceleration"], axis=1))
    if 0.8 < norm < 1.2:
        return (
            f"its median specific force is {norm:.2f} m/s^2, about 9.8 is expected: in g perhaps; "
            f'set unit = "g" of accel',
            "",
        )
    if not norm >= LEAST_FORCE:
        return (
            f"its accelerometer is free of gravity: its median is {norm:.2f} m/s^2, about 9.8 is "
            f"needed; record the topic with gravity",
            "",
        )
    whole = float(np.linalg.norm(force))
    if not whole > norm / 2:
        return "", "; gravity does not tell, it turns over"
    if force[2] > whole / 2:
        return "", "; gravity agrees"
    most = int(np.argmax(np.abs(force)))
    where = DIRECTIONS[most][int(force[most] < 0)]
    hint = "perhaps forward, right, down" if force[2] < -whole / 2 else "it is turned"
    frame = f"{stream.frame} " if stream.frame else ""
    return (
        f"its frame {frame}is not forward, left, up: at {abs(force[most]):.1f} m/s^2 its median "
        f"specific force points {where}, not up ({hint}); set axes or mounting",
        "",
    )


def _attitude(stream: Stream, place: Pose | None) -> Made:
    """What an IMU's message has of its attitude."""
    q, covariance = (
        stream.columns["orientation"].astype(float),
        stream.columns["orientation_covariance"],
    )
    norm = np.linalg.norm(q, axis=1)
    there = (norm > 0.5) & (norm < 2.0) & (covariance[:, 0] != -1)
    if not there.any() or (q == q[0]).all():
        return [], {}
    q = np.where(there[:, None], q, [0.0, 0.0, 0.0, 1.0])
    if place is not None and place.is_turned:
        from scipy.spatial.transform import Rotation

        q = (Rotation.from_quat(q) * Rotation.from_matrix(place.C).inv()).as_quat()
    q[~there] = np.nan
    sd, columns, why = deviations("attitude", covariance[:, [0, 4, 8]], "rad", ATTITUDE_SD)
    keys = {
        "kind": "attitude",
        "columns": ["qx", "qy", "qz", "qw"],
        "quaternion": "xyzw",
        "axes": "FLU to ENU",
        "unit": "rad",
        "sd": sd,
    }
    left = "made of the same IMU, so it would count twice"
    return (
        [Section("aiding", "attitude", keys, assumed=why, left=left)],
        {**vector("qx qy qz qw", q), **columns},
    )
