"""The sensors of a robot's log: the IMU and the attitude in its messages, receivers, wheels,
barometers and magnetometers."""

import re
from typing import Any

import numpy as np

from ....geometry.rotations import Rotation
from ....preprocessing.axes import rotate_rows
from ....typing import Array
from ...reader import Section
from .robot_parts import Made, Robot, deviations, median, not_measured, vector
from .robot_streams import TopicStream
from .ros_messages import Columns
from .ros_transforms import Pose

RECEIVER = re.compile(r"gps|gnss|navsat|(^|[/_])fix|ublox|novatel|septentrio|rtk", re.IGNORECASE)
COMMAND = re.compile(r"cmd|command|setpoint|desired|target|joy|teleop", re.IGNORECASE)
POSITION_STD = [3.0, 3.0, 6.0]
VELOCITY_STD = [0.2, 0.2, 0.4]
SPEED_STD = 0.1
PRESSURE_STD = 1.0
FIELD_STD = 2.5
"""Standard deviations where a log states none: m, m/s, m/s, m, uT."""


def fix(stream: TopicStream, robot: Robot) -> Made:
    """Return the positions of sensor_msgs/NavSatFix; rows without a fix are missing."""
    columns = stream.columns
    lla = np.stack([columns[name] for name in ("latitude", "longitude", "altitude")], axis=1)
    lla = lla.astype(float)
    lla[(columns["status.status"] < 0) | ((lla[:, 0] == 0) & (lla[:, 1] == 0))] = np.nan
    known = columns["position_covariance_type"] > 0
    variances = np.where(known[:, None], columns["position_covariance"][:, [4, 0, 8]], np.nan)
    std, more, why = deviations("position", variances, "m", POSITION_STD)
    arm, assumed = robot.arm(stream)
    keys = {
        "kind": "position",
        "columns": ["latitude", "longitude", "altitude"],
        "unit": ["deg", "deg", "m"],
        "std": std,
        **arm,
    }
    fixed = int(np.isfinite(lla[:, 0]).sum())
    left = not_measured(stream) or ("" if fixed else "it never has a fix")
    title = f", {fixed} of {len(lla)} with a fix{robot.title_text(stream, robot.place(stream))}"
    section = Section("source", "gnss", keys, title=title, assumed={**why, **assumed}, left=left)
    return [section], {**vector("latitude longitude altitude", lla), **more}


def twist(stream: TopicStream, robot: Robot) -> Made:
    """Return the section of a receiver's velocity, or else of the vehicle's speed."""
    linear = _linear(stream.columns)
    if stream.type != "geometry_msgs/Twist" and RECEIVER.search(f"{stream.topic} {stream.frame}"):
        return _velocity(stream, robot, linear)
    return _speed(stream, robot, stream.frame, robot.not_of_vehicle(stream.frame))


def _linear(columns: Columns) -> Array:
    found: Array = next(each for name, each in columns.items() if name.endswith("linear"))
    return found.astype(float)


def _variances(columns: Columns) -> Array:
    """(n, 3) of a velocity."""
    if "twist.covariance" not in columns:
        return np.zeros((len(_linear(columns)), 3))
    found: Array = columns["twist.covariance"][:, [0, 7, 14]]
    return found


def _velocity(stream: TopicStream, robot: Robot, linear: Array) -> Made:
    velocity = linear
    axes = "NED" if re.search(r"(^|[/_])ned($|[/_])", stream.topic) else "ENU"
    flat = not velocity[:, 2].any()
    if flat:
        velocity[:, 2] = np.nan
    std, more, why = deviations("velocity", _variances(stream.columns), "m/s", VELOCITY_STD)
    arm, assumed = robot.arm(stream)
    keys = {
        "kind": "velocity",
        "columns": ["v1", "v2", "v3"],
        "unit": "m/s",
        "axes": axes,
        "std": std,
        **arm,
    }
    assumed = {**why, **assumed, "axes": "as receiver drivers publish it"}
    title = ", vertical always 0: treated as missing" if flat else ""
    left = not_measured(stream)
    section = Section("source", "gnss", keys, title=title, assumed=assumed, left=left)
    return [section], {**vector("v1 v2 v3", velocity), **more}


def odometry(stream: TopicStream, robot: Robot) -> Made:
    """Return the speeds of nav_msgs/Odometry, whose twist refers to its child frame."""
    return _speed(stream, robot, stream.text("child_frame_id").lstrip("/"))


def _speed(stream: TopicStream, robot: Robot, frame: str, doubt: str = "") -> Made:
    """Return the forward speed of the frame of a twist, left out where there is a `doubt`."""
    place = robot.frames.pose(frame, robot.base)
    velocity = _linear(stream.columns)
    if place is not None:
        velocity = rotate_rows(velocity, place.C)
    std, more, why = deviations("speed", _variances(stream.columns)[:, :1], "m/s", [SPEED_STD])
    arm = {"lever_arm": place.lever_arm} if place is not None and place.t.any() else {}
    keys = {"kind": "speed", "columns": ["speed"], "unit": "m/s", "std": std, **arm}
    if COMMAND.search(stream.topic):
        left = "by its name it is a command, not a measurement"
    else:
        left = not_measured(stream) or doubt
        left = left or ("" if velocity[:, 0].any() else "it is always 0")
    title = f", speed along x of {frame or 'its frame'}"
    if "Odometry" in stream.type:
        title += "; its pose is left out: it is in metres from the start, not a position on Earth"
    section = Section("source", "speed", keys, title=title, assumed=why, left=left)
    return [section], {"speed": velocity[:, 0], **more}


def magnetometer(stream: TopicStream, robot: Robot) -> Made:
    """Return the fields of sensor_msgs/MagneticField in the vehicle's axes; the magnitude decides
    the unit."""
    field = stream.columns["magnetic_field"].astype(float)
    place = robot.place(stream)
    if place is not None:
        field = rotate_rows(field, place.C)
    strength = median(np.linalg.norm(field, axis=1))
    # the Earth's is 22 to 67 uT
    unit = "uT" if strength >= 5 else "gauss" if strength >= 5e-4 else "T"
    scale = {"T": 1e-6, "gauss": 1e-2, "uT": 1.0}[unit]
    assumed = {"std": "magnetometer covariances are not reliable"}
    if unit != "T":
        assumed["unit"] = f"its median is {strength:.3g}, which is not the Earth's field in T"
    keys = {
        "kind": "magnetic-field",
        "columns": ["mx", "my", "mz"],
        "unit": unit,
        "axes": "FLU",
        "std": float(f"{FIELD_STD * scale:.6g}"),
    }
    left = "it may not be calibrated; see `strapdown calibrate`"
    section = Section("source", "magnetometer", keys, assumed=assumed, left=left)
    return [section], vector("mx my mz", field)


def barometer(stream: TopicStream, robot: Robot) -> Made:
    """Return the pressures of sensor_msgs/FluidPressure; the magnitude decides the unit."""
    pressure = stream.columns["fluid_pressure"].astype(float)
    usual = median(pressure)
    unit = "hPa" if 300 < usual < 1200 else "kPa" if 30 < usual < 120 else "Pa"
    keys = {"kind": "pressure", "columns": ["pressure"], "unit": unit, "std": PRESSURE_STD}
    assumed = {"std": "the log's variance covers the sensor, not the weather"}
    if unit != "Pa":
        assumed["unit"] = f"its median is {usual:.4g}, which is not an air pressure in Pa"
    left = not_measured(stream)
    return [Section("source", "barometer", keys, assumed=assumed, left=left)], {
        "pressure": pressure
    }


# ---- the IMU

MIN_FORCE = 3.0
"""m/s^2: smallest median of a specific force that contains gravity."""
DIRECTIONS = ("forward", "backward"), ("left", "right"), ("up", "down")
ATTITUDE_STD = [0.02, 0.02, 0.1]
"""rad: std of roll, pitch and heading where a log states none."""


def imu(stream: TopicStream, robot: Robot) -> Made:
    """Return sections and columns of sensor_msgs/Imu: the IMU, and its attitude, which is left
    out."""
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
        left += f" in the output of `strapdown inspect {robot.path} --imu N --write recording.toml`"
    assumed = {"axes": f"REP 103{agrees}", "grade": "the log states none"}
    columns = {**vector("wx wy wz", gyro), **vector("fx fy fz", accel)}
    title = robot.title_text(stream, place)
    sections = [Section("imu", "imu", keys, title=title, assumed=assumed, left=left)]
    attitude, more = _attitude(stream, place)
    return [*sections, *attitude], {**columns, **more}


def _doubt(stream: TopicStream, force: Array) -> tuple[str, str]:
    """Return the reason why an IMU is left out, or "", and the evidence of gravity on its axes.
    `force` is its median in the vehicle's axes, forward, left, up."""
    for name, sensor in (("angular_velocity", "gyro"), ("linear_acceleration", "accelerometer")):
        covariance = stream.columns[f"{name}_covariance"]
        if (covariance[:, 0] == -1).all() or not stream.columns[name].any():
            return f"it has no {sensor}; gyro and accelerometer of one topic are needed", ""
    norm = median(np.linalg.norm(stream.columns["linear_acceleration"], axis=1))
    if 0.8 < norm < 1.2:
        return (
            f"its median specific force is {norm:.2f} m/s^2, but about 9.8 is expected: it is probably "
            f'in g; set unit = "g" of accel',
            "",
        )
    if not norm >= MIN_FORCE:
        return (
            f"its acceleration is without gravity: its median is {norm:.2f} m/s^2, but about 9.8 is "
            f"necessary; record the topic with gravity",
            "",
        )
    whole = float(np.linalg.norm(force))
    if not whole > norm / 2:
        return "", "; gravity does not confirm the axes, because it turns over"
    if force[2] > whole / 2:
        return "", "; gravity agrees"
    most = int(np.argmax(np.abs(force)))
    where = DIRECTIONS[most][int(force[most] < 0)]
    hint = "perhaps forward, right, down" if force[2] < -whole / 2 else "it is rotated"
    frame = f"{stream.frame} " if stream.frame else ""
    return (
        f"its frame {frame}is not forward, left, up: at {abs(force[most]):.1f} m/s^2 its median "
        f"specific force points {where}, not up ({hint}); set axes or mounting",
        "",
    )


def _attitude(stream: TopicStream, place: Pose | None) -> Made:
    """Return the section of the attitude in an IMU's messages; empty where it is missing or
    constant."""
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
        turned = Rotation.from_wxyz(q[:, [3, 0, 1, 2]]) * Rotation.from_matrix(place.C).inv()
        q = turned.as_wxyz()[:, [1, 2, 3, 0]]
    q[~there] = np.nan
    std, columns, why = deviations("attitude", covariance[:, [0, 4, 8]], "rad", ATTITUDE_STD)
    keys = {
        "kind": "attitude",
        "columns": ["qx", "qy", "qz", "qw"],
        "quaternion": "xyzw",
        "axes": "FLU to ENU",
        "unit": "rad",
        "std": std,
    }
    left = "computed from the same IMU, so it would count twice"
    return (
        [Section("source", "attitude", keys, assumed=why, left=left)],
        {**vector("qx qy qz qw", q), **columns},
    )
