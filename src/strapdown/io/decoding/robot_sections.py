"""What of a recording the messages of a robot's log are.

Axes and units are those of REP 103 and REP 145 (https://ros.org/reps): forward, left, up; SI; an
accelerometer at rest reads +9.8 m/s^2 upwards; fixes in east, north, up.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...typing import Array
from ..contract import Log, Section
from ..table_file import Table
from .robot_streams import Stream, streams_of, unread
from .ros_messages import Columns, Messages
from .ros_transforms import Frames, Pose

RECEIVER = re.compile(r"gps|gnss|navsat|(^|[/_])fix|ublox|novatel|septentrio|rtk", re.IGNORECASE)
COMMAND = re.compile(r"cmd|command|setpoint|desired|target|joy|teleop", re.IGNORECASE)
FUSED = re.compile(
    r"filter|fused|fusion|ekf|ukf|kalman|combined|vins|vio|slam|lio|visual|locali[sz]ation|rtab",
    re.IGNORECASE,
)
TRUTH = re.compile(r"truth|(^|[/_])gt($|[/_])|p3d", re.IGNORECASE)
BASE = re.compile(r"(^|/)base_(link|footprint)$")
LEAST_FORCE = 3.0
"""m/s^2, least median of the specific force where gravity is in it."""
POSITION_SD = [3.0, 3.0, 6.0]
VELOCITY_SD = [0.2, 0.2, 0.4]
SPEED_SD = 0.1
ATTITUDE_SD = [0.02, 0.02, 0.1]
PRESSURE_SD = 1.0
FIELD_SD = 0.05
"""Assumed where a log states none: m, m/s, rad, m, of the field."""


class Robot(NamedTuple):
    """What a section needs to know of the log."""

    path: Path
    frames: Frames
    base: str  # the frame that is taken for the vehicle's

    def place(self, stream: Stream) -> Pose | None:
        """Of the sensor in the vehicle; None: the log does not say it."""
        return self.frames.pose(stream.frame, self.base)

    def said(self, stream: Stream, place: Pose | None) -> str:
        """Words on it for a title."""
        if stream.frame == self.base or place is None:
            return ""
        return f", mounted as the transforms say ({self.base} to {stream.frame})"

    def arm(self, stream: Stream) -> tuple[dict[str, Any], dict[str, str]]:
        """`lever_arm`, and why it was assumed."""
        place = self.place(stream)
        if place is not None:
            return {"lever_arm": place.lever_arm}, {}
        why = f"the log has no transform from {self.base} to {stream.frame or 'its frame'}"
        return {"lever_arm": [0.0, 0.0, 0.0]}, {"lever_arm": why}


Made = tuple[list[Section], Columns]
"""Sections, which lack their table and instance, and the columns of the table."""


def log_of(path: Path, what: str, messages: Messages) -> Log:
    """The Log of a robot's messages; `what` they were found in. Raises DataError where there is
    nothing that is read."""
    streams, left = streams_of(messages)
    robot = Robot(path, frames := Frames(messages.transforms), _base(streams, frames))
    tables: dict[str, Table] = {}
    sections: list[Section] = []
    counts: dict[str, int] = {}
    for stream in streams:
        made, columns = MAKERS[stream.type](stream, robot)
        tables[stream.topic] = Table.of(
            f"{path} [{stream.topic}]", {"stamp": stream.stamp, **columns}, word="message"
        )
        for section in made:
            number = counts.get(section.role, 0)
            counts[section.role] = number + 1
            keys = {**section.keys, "table": stream.topic, "time": stream.time}
            title = f"{stream.topic}, {stream.rate:.4g} Hz{section.title}"
            assumed = {**section.assumed, **({"time": stream.remark} if stream.remark else {})}
            sections.append(
                section._replace(keys=keys, instance=number, title=title, assumed=assumed)
            )
    facts = [
        f"{what}, {'UTC' if streams[0].absolute else 'a clock without date, such as a simulator has'}"
    ]
    return Log(
        tables,
        tuple(_with_receivers(sections, streams)),
        (*facts, *(each.fact for each in streams)),
        (*left, *_counted(messages.left), *unread(messages.topics.values())),
        tuple(_asked(sections)),
    )


def _counted(lines: list[str]) -> list[str]:
    """Each line once, with how often."""
    unique = dict.fromkeys(lines)
    return [
        f"{line} ({lines.count(line)} times)" if lines.count(line) > 1 else line for line in unique
    ]


def _asked(sections: list[Section]) -> list[str]:
    """What must be known before an IMU can be taken, where there are only such."""
    of_imus = [each for each in sections if each.role == "imu"]
    if not of_imus or any(not each.left for each in of_imus):
        return []
    return [f"{each.keys['table']}: {each.left}" for each in of_imus[:1]]


def _base(streams: list[Stream], frames: Frames) -> str:
    """The frame that is taken for the vehicle's: base_link, that of the odometry, or the IMU's."""
    imus = [each.frame for each in streams if each.type == "sensor_msgs/Imu"]
    if not imus:
        return "base_link"
    children = [
        each.text("child_frame_id").lstrip("/") for each in streams if "Odometry" in each.type
    ]
    usual = [each for each in [*frames.known(), *children] if BASE.search(each)]
    for candidate in [*usual, *children]:
        if frames.pose(imus[0], candidate) is not None:
            return candidate
    return imus[0]


def _with_receivers(sections: list[Section], streams: list[Stream]) -> list[Section]:
    """The same with velocities of a receiver numbered as its positions: those that may be taken, of
    the topic whose name begins alike, or of the same frame."""
    frames = {each.topic: each.frame for each in streams}
    fixes = [each for each in sections if each.keys.get("kind") == "position"]
    fixes = [each._replace(instance=number) for number, each in enumerate(fixes)]
    numbers = {each.keys["table"]: each.instance for each in fixes}

    def instance(topic: str) -> int:
        if topic in numbers or not fixes:
            return numbers.get(topic, 0)
        return max(
            fixes,
            key=lambda fix: (
                not fix.left,
                _alike(topic, fix.keys["table"]),
                frames[fix.keys["table"]] == frames[topic],
                -fix.instance,
            ),
        ).instance

    return [
        each._replace(instance=instance(each.keys["table"])) if each.role == "gnss" else each
        for each in sections
    ]


def _alike(one: str, other: str) -> int:
    """Parts of the names of two topics that are the same."""
    pairs = zip(one.split("/"), other.split("/"))
    return next((k for k, (a, b) in enumerate(pairs) if a != b), 99)


def _deviations(
    name: str, variances: Array, unit: str, assumed: list[float]
) -> tuple[list[Any], Columns, dict[str, str]]:
    """`sd` of the components of variances (n, k), columns for it, and why it was assumed."""
    known = np.where(variances > 0, variances, np.nan)
    if np.isnan(known).all(axis=0).any():
        return assumed, {}, {"sd": "the log states none"}
    sd = np.sqrt(known)
    if (sd == sd[0]).all():
        return (
            [float(f"{each:.6g}") for each in sd[0]],
            {},
            {"sd": "constant in the log, as its driver was set"},
        )
    columns = {f"sd_{name}_{k}": sd[:, k] for k in range(sd.shape[1])}
    return [{"column": column, "unit": unit} for column in columns], columns, {}


def _vector(names: str, values: Array) -> Columns:
    return dict(zip(names.split(), np.ascontiguousarray(values.T, dtype=float)))


def _imu(stream: Stream, robot: Robot) -> Made:
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
    left, agrees = _doubt(stream, C @ np.median(accel, axis=0))
    if left and "axes" in left:
        left += (
            f"; `strapdown inspect {robot.path} --imu N --write recording.toml` writes what to "
            f"correct, N counting the IMUs from 0"
        )
    assumed = {"axes": f"REP 103{agrees}", "grade": "the log states none"}
    columns = {**_vector("wx wy wz", gyro), **_vector("fx fy fz", accel)}
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
            return f"it has no {sensor}; an IMU needs both", ""
    norm = float(np.median(np.linalg.norm(stream.columns["linear_acceleration"], axis=1)))
    if 0.8 < norm < 1.2:
        return f"its median specific force is {norm:.2f} m/s^2: in g perhaps, ROS has m/s^2", ""
    if norm < LEAST_FORCE:
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
    name = ["forward", "left", "up"][int(np.argmax(np.abs(force)))]
    where = f"{force[int(np.argmax(np.abs(force)))]:+.1f} m/s^2 on {name}"
    hint = "perhaps forward, right, down" if force[2] < -whole / 2 else "it is turned"
    frame = f"{stream.frame} " if stream.frame else ""
    return (
        f"its frame {frame}is not forward, left, up: its median specific force is {where}, where "
        f"+9.8 on up is expected ({hint}); set axes or mounting",
        "",
    )


def _attitude(stream: Stream, place: Pose | None) -> Made:
    """What an IMU's message has of its attitude."""
    q, covariance = (
        stream.columns["orientation"].astype(float),
        stream.columns["orientation_covariance"],
    )
    norm = np.linalg.norm(q, axis=1)
    there = (norm > 0.5) & (covariance[:, 0] != -1) & np.isfinite(norm)
    if not there.any() or (q == q[0]).all():
        return [], {}
    q = np.where(there[:, None], q, [0.0, 0.0, 0.0, 1.0])
    if place is not None and place.is_turned:
        from scipy.spatial.transform import Rotation

        q = (Rotation.from_quat(q) * Rotation.from_matrix(place.C).inv()).as_quat()
    q[~there] = np.nan
    sd, columns, why = _deviations("attitude", covariance[:, [0, 4, 8]], "rad", ATTITUDE_SD)
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
        {**_vector("qx qy qz qw", q), **columns},
    )


def _fix(stream: Stream, robot: Robot) -> Made:
    columns = stream.columns
    lla = np.stack([columns[name] for name in ("latitude", "longitude", "altitude")], axis=1)
    lla = lla.astype(float)
    lla[(columns["status.status"] < 0) | ((lla[:, 0] == 0) & (lla[:, 1] == 0))] = np.nan
    known = columns["position_covariance_type"] > 0
    variances = np.where(known[:, None], columns["position_covariance"][:, [4, 0, 8]], np.nan)
    sd, more, why = _deviations("position", variances, "m", POSITION_SD)
    arm, assumed = robot.arm(stream)
    keys = {
        "kind": "position",
        "columns": ["latitude", "longitude", "altitude"],
        "unit": ["deg", "deg", "m"],
        "sd": sd,
        **arm,
    }
    fixed = int(np.isfinite(lla[:, 0]).sum())
    left = _not_measured(stream) or ("" if fixed else "it never has a fix")
    title = f", {fixed} of {len(lla)} with a fix{robot.said(stream, robot.place(stream))}"
    section = Section("aiding", "gnss", keys, title=title, assumed={**why, **assumed}, left=left)
    return [section], {**_vector("latitude longitude altitude", lla), **more}


def _not_measured(stream: Stream) -> str:
    if FUSED.search(stream.topic):
        return "its name says that it is estimated, probably of the same IMU"
    return "its name says that it is a truth" if TRUTH.search(stream.topic) else ""


def _twist(stream: Stream, robot: Robot) -> Made:
    """Of a receiver a velocity, of a vehicle its speed."""
    linear = _linear(stream.columns)
    if stream.type != "geometry_msgs/Twist" and RECEIVER.search(f"{stream.topic} {stream.frame}"):
        return _velocity(stream, robot, linear)
    return _speed(stream, robot, stream.frame)


def _linear(columns: Columns) -> Array:
    found: Array = next(each for name, each in columns.items() if name.endswith("linear"))
    return found.astype(float)


def _variances(columns: Columns) -> Array:
    """(n, 3) of a velocity."""
    if "twist.covariance" not in columns:
        return np.zeros((len(_linear(columns)), 3))
    found: Array = columns["twist.covariance"][:, [0, 7, 14]]
    return found


def _velocity(stream: Stream, robot: Robot, linear: Array) -> Made:
    velocity = linear
    axes = "NED" if re.search(r"(^|[/_])ned($|[/_])", stream.topic) else "ENU"
    flat = not velocity[:, 2].any()
    if flat:
        velocity[:, 2] = np.nan
    sd, more, why = _deviations("velocity", _variances(stream.columns), "m/s", VELOCITY_SD)
    arm, assumed = robot.arm(stream)
    keys = {
        "kind": "velocity",
        "columns": ["v1", "v2", "v3"],
        "unit": "m/s",
        "axes": axes,
        "sd": sd,
        **arm,
    }
    assumed = {**why, **assumed, "axes": "as drivers of receivers publish it"}
    title = ", vertical always 0: taken as missing" if flat else ""
    left = _not_measured(stream)
    section = Section("aiding", "gnss", keys, title=title, assumed=assumed, left=left)
    return [section], {**_vector("v1 v2 v3", velocity), **more}


def _odometry(stream: Stream, robot: Robot) -> Made:
    return _speed(stream, robot, stream.text("child_frame_id").lstrip("/"))


def _speed(stream: Stream, robot: Robot, frame: str) -> Made:
    """The speed forward of the frame that a twist is of."""
    place = robot.frames.pose(frame, robot.base)
    velocity = _linear(stream.columns)
    if place is not None:
        velocity = velocity @ place.C.T
    sd, more, why = _deviations("speed", _variances(stream.columns)[:, :1], "m/s", [SPEED_SD])
    arm = {"lever_arm": place.lever_arm} if place is not None and place.t.any() else {}
    keys = {"kind": "speed", "columns": ["speed"], "unit": "m/s", "sd": sd, **arm}
    if COMMAND.search(stream.topic):
        left = "its name says that it is a command, not a measurement"
    else:
        left = _not_measured(stream) or ("" if velocity[:, 0].any() else "it is always 0")
    title = f", speed along x of {frame or 'its frame'}"
    if "Odometry" in stream.type:
        title += "; its pose is left: metres from where it began, no position on Earth"
    section = Section("aiding", "speed", keys, title=title, assumed=why, left=left)
    return [section], {"speed": velocity[:, 0], **more}


def _magnetometer(stream: Stream, robot: Robot) -> Made:
    field = stream.columns["magnetic_field"].astype(float)
    place = robot.place(stream)
    if place is not None:
        field = field @ place.C.T
    strength = float(np.nanmedian(np.linalg.norm(field, axis=1)))
    units = {"T": 1e-6 * 500, "gauss": 5.0, "uT": np.inf}
    unit = next((each for each, most in units.items() if strength < most), "T")
    scale = {"T": 1e-6, "gauss": 1e-2, "uT": 1.0}[unit]
    assumed = {"sd": "covariances of magnetometers say little"}
    if unit != "T":
        assumed["unit"] = f"its median is {strength:.3g}, which is no field of the Earth in T"
    keys = {
        "kind": "magnetic-field",
        "columns": ["mx", "my", "mz"],
        "unit": unit,
        "axes": "FLU",
        "sd": float(f"{50 * FIELD_SD * scale:.6g}"),
    }
    left = "nothing says that it is calibrated; see `strapdown calibrate`"
    section = Section("aiding", "magnetometer", keys, assumed=assumed, left=left)
    return [section], _vector("mx my mz", field)


def _barometer(stream: Stream, robot: Robot) -> Made:
    pressure = stream.columns["fluid_pressure"].astype(float)
    median = float(np.nanmedian(pressure))
    unit = "Pa" if median > 5e3 else "hPa" if median > 50 else "kPa"
    keys = {"kind": "pressure", "columns": ["pressure"], "unit": unit, "sd": PRESSURE_SD}
    assumed = {"sd": "the log's variance is of the pressure, not of the weather"}
    if unit != "Pa":
        assumed["unit"] = f"its median is {median:.4g}, which is no pressure of air in Pa"
    left = _not_measured(stream)
    return [Section("aiding", "barometer", keys, assumed=assumed, left=left)], {
        "pressure": pressure
    }


MAKERS: Mapping[str, Callable[[Stream, Robot], Made]] = {
    "sensor_msgs/Imu": _imu,
    "sensor_msgs/NavSatFix": _fix,
    "sensor_msgs/MagneticField": _magnetometer,
    "sensor_msgs/FluidPressure": _barometer,
    "geometry_msgs/Twist": _twist,
    "geometry_msgs/TwistStamped": _twist,
    "geometry_msgs/TwistWithCovarianceStamped": _twist,
    "nav_msgs/Odometry": _odometry,
}
