"""Messages of ROS to samples and measurements, and states to messages. Nothing here needs ROS: messages
are whatever has the fields of their definitions.

Axes and units: REP 103 (SI; body forward, left, up; world east, north, up), REP 105 (frames), REP 145
(an accelerometer at rest reads +9.8 m/s^2 upwards) of https://ros.org/reps, and the comments in the
definitions of the messages. Times and increments are those that `strapdown.read` makes of a bag.
"""

from math import isfinite, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

import strapdown as sd
from strapdown.core.loop.contract import ATT, BG, INVALID, POS, VEL, FilterState
from strapdown.core.mathematics.rotation import matrix_to_quaternion
from strapdown.geometry.geodesy import displace_lla, ned_axes, to_ecef
from strapdown.geometry.rotations import Rotation
from strapdown.io.decoding.robots.robot_streams import SECOND, YEAR_2000
from strapdown.io.decoding.robots.ros_transforms import Pose, plain
from strapdown.io.solutions.tum import FLU as SIGNS, TURN
from strapdown.preprocessing.axes import rotate_rows
from strapdown.preprocessing.imu_samples import StreamIntervals
from strapdown.typing import Array
from strapdown.units.conversion import factor
from strapdown.units.time_scales import midnight, seconds_since, unix_from_gps

from .mounts import Mount

NANOSECOND = factor("ns", "time")
DEGREE = factor("deg", "angle")
NO_FIX, NO_STD = "no fix", "without covariance"
NO_STAMP, OTHER_CLOCK = "without stamp", "on another clock"
NO_IMU, NO_NUMBER = "without rates or forces", "without a number"
"""Reasons why a message is not used."""


class UnusedMessage(Exception):
    """A message that is not used, and the reason."""


# ---- times


def stamp_of(message: Any) -> int:
    """Return the stamp of a message, ns; 0 where it has none."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


class RosClock:
    """The times of a stream: s since midnight, UTC, before the first IMU message, or as they are
    stamped where the clock has no date, as in a simulator.

    Parameters
    ----------
    first : int
        Stamp of the first IMU message, ns.
    """

    def __init__(self, first: int) -> None:
        self.absolute = first >= YEAR_2000
        self.epoch = midnight(self._gps(first)) if self.absolute else None
        self._first: dict[str, int] = {}

    @staticmethod
    def _gps(stamp: int) -> float:
        return float(seconds_since(0.0, np.array([stamp]), "unix", NANOSECOND)[0])

    def time(self, topic: str, stamp: int) -> float:
        """Return the time of a stamp of a topic, s.

        Raises
        ------
        UnusedMessage
            If there is no stamp, or it is on another clock than that of the IMU.
        """
        if stamp == 0:
            raise UnusedMessage(NO_STAMP)
        if (stamp >= YEAR_2000) != self.absolute:
            raise UnusedMessage(OTHER_CLOCK)
        if self.epoch is None:
            return float(stamp) * NANOSECOND
        first = self._first.setdefault(topic, stamp)
        # a recording counts from the first row of each table, and so rounds as this does
        both = np.array([first, stamp])
        return float(seconds_since(self.epoch, both, "unix", NANOSECOND)[1])

    def stamp(self, t: float) -> int:
        """Return the stamp of a time, ns."""
        if self.epoch is None:
            return round(t * SECOND)
        whole = int(t // 1)
        seconds = round(float(unix_from_gps(self.epoch + whole)))
        return seconds * SECOND + round((t - whole) * SECOND)


# ---- the IMU


class Increments:
    """Samples from the rates and forces of an IMU: each counts over its interval of a stream."""

    def __init__(self, mount: Mount) -> None:
        self._mount, self._intervals = mount, StreamIntervals()

    def sample(self, t: float, message: Any) -> sd.Sample | None:
        """Return the Sample of a sensor_msgs/Imu at t s; None of the first, which has no interval.

        Raises
        ------
        UnusedMessage
            If the message has no rates or no forces, or one that is no number.
        """
        if -1 in (
            message.angular_velocity_covariance[0],
            message.linear_acceleration_covariance[0],
        ):
            raise UnusedMessage(NO_IMU)
        rates = np.array([_xyz(message.angular_velocity), _xyz(message.linear_acceleration)])
        if not np.isfinite(rates).all():
            raise UnusedMessage(NO_NUMBER)
        dt = self._intervals.interval(t)
        if dt is None:
            return None
        gyro, accel = _in_body(rates * dt, self._mount)
        return sd.Sample(t, dt, gyro, accel)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


# ---- sources


class Reading(NamedTuple):
    """A measurement without its time: y and std as in a `Measurement`, NaN where unknown."""

    y: tuple[float, ...]
    std: tuple[float, ...]


def frame_of(message: Any) -> str:
    """Return the frame in which a message measures: of nav_msgs/Odometry the child frame."""
    return plain(getattr(message, "child_frame_id", None) or message.header.frame_id)


def reading_of(kind: str, message: Any, mount: Mount, std: tuple[float, ...] | None) -> Reading:
    """Return what a message of a source of this kind measures.

    Parameters
    ----------
    kind : str
        A key of `parameters.MESSAGES`.
    message : object
        With the fields of its definition.
    mount : Mount
        How the sensor stands in the vehicle.
    std : tuple of float or None
        Standard deviations, which replace the covariance of the message.

    Raises
    ------
    UnusedMessage
        If it is without a fix or a number, or its standard deviations are unknown.
    """
    y, own = READINGS[kind](message, mount)
    used = own if std is None else std
    if not any(map(isfinite, y)):
        raise UnusedMessage(NO_NUMBER)
    if not all(0 < each < np.inf for value, each in zip(y, used) if isfinite(value)):
        raise UnusedMessage(NO_STD)
    return Reading(y, used)


def _std(variance: float) -> float:
    """Return NaN of a variance that is 0 or negative, which means unknown."""
    return sqrt(variance) if variance > 0 else nan


def _position(message: Any, mount: Mount) -> Reading:
    lat, lon, height = message.latitude, message.longitude, message.altitude
    if message.status.status < 0 or (lat == 0 and lon == 0):
        raise UnusedMessage(NO_FIX)
    covariance = message.position_covariance  # east, north, up
    known = message.position_covariance_type > 0
    std = tuple(_std(covariance[k]) if known else nan for k in (4, 0, 8))
    return Reading((lat * DEGREE, lon * DEGREE, height), std)


def _twist(message: Any) -> tuple[tuple[float, float, float], tuple[float, ...]]:
    """Return the velocity of a message and its standard deviations, NaN where it has none."""
    twist = message.twist
    covariance = getattr(twist, "covariance", None)
    if covariance is None:
        return _xyz(twist.linear), (nan, nan, nan)
    return _xyz(twist.twist.linear), tuple(_std(covariance[k]) for k in (0, 7, 14))


def _velocity(message: Any, mount: Mount) -> Reading:
    (east, north, up), (std_east, std_north, std_up) = _twist(message)
    # receivers without a vertical velocity send 0
    return Reading((north, east, -up or nan), (std_north, std_east, std_up))


def _body_velocity(message: Any, mount: Mount) -> Reading:
    velocity, std = _twist(message)
    variances = np.array(std) ** 2 @ (mount.matrix**2).T
    return Reading(_in_body([velocity], mount)[0], tuple(np.sqrt(variances).tolist()))


def _speed(message: Any, mount: Mount) -> Reading:
    velocity, std = _twist(message)
    return Reading(_in_body([velocity], mount)[0][:1], std[:1])


def _magnetic_field(message: Any, mount: Mount) -> Reading:
    (field,) = _in_body([_xyz(message.magnetic_field)], mount)
    return Reading(field, (nan, nan, nan))


def _pressure(message: Any, mount: Mount) -> Reading:
    return Reading((message.fluid_pressure,), (nan,))


READINGS = {
    "position": _position,
    "velocity": _velocity,
    "body-velocity": _body_velocity,
    "speed": _speed,
    "magnetic-field": _magnetic_field,
    "pressure": _pressure,
}
"""{kind: function of a message and the mount of its sensor}."""


def _in_body(vectors: Any, mount: Mount) -> list[tuple[float, float, float]]:
    """Return vectors of messages in the axes of the body; with an infinite component, as NaN."""
    with np.errstate(invalid="ignore", over="ignore"):
        rows = rotate_rows(np.array(vectors, float), mount.matrix)
    return [(x, y, z) for x, y, z in rows.tolist()]


# ---- states


class LocalFrame:
    """East, north and up, m, in the tangent plane at an origin.

    Parameters
    ----------
    origin : array_like
        Latitude and longitude, rad, and height above the ellipsoid, m.
    """

    def __init__(self, origin: Array) -> None:
        self._zero, self._axes = to_ecef(origin), TURN @ ned_axes(origin)

    def place(self, lla: Array) -> Array:
        """Return a geodetic position (3,) as east, north, up."""
        return self._axes @ (to_ecef(lla) - self._zero)

    def turn(self, lla: Array) -> Array:
        """Return the matrix from north, east, down at a position to east, north, up here."""
        turned: Array = self._axes @ ned_axes(lla).T
        return turned


class BaseState(NamedTuple):
    """The state of the base frame, in the axes of ROS."""

    stamp: int  # ns
    lla: Array  # rad, rad, m
    place: Array  # (3,) m east, north, up from the origin
    q: tuple[float, float, float, float]  # x, y, z, w: from the base frame to east, north, up
    velocity: Array  # (3,) m/s in the base frame
    rate: Array  # (3,) rad/s in the base frame, against inertial space
    pose_covariance: Array  # (6, 6) position, rotation about the axes of the world
    twist_covariance: Array  # (6, 6) in the base frame
    position_covariance: Array  # (3, 3) m^2 east, north, up at the position
    status: int


def shown_state(
    stamp: int, status: int, state: FilterState, arm: Array, frame: LocalFrame
) -> BaseState | None:
    """Return the state of the base frame from that of the IMU.

    Parameters
    ----------
    stamp : int
        ns.
    status : int
        That of a row of a Solution.
    state : FilterState
        With position and attitude.
    arm : array (3,)
        m, from the base frame to the IMU, body.
    frame : LocalFrame
        The world's.

    Returns
    -------
    BaseState or None
        None where the state is not known.
    """
    if status == INVALID or not np.isfinite(state.lla).all() or not np.isfinite(state.C_nb).all():
        return None
    C, swing = state.C_nb, np.cross(state.omega, arm)
    lla = displace_lla(state.lla, -C @ arm)
    turn = frame.turn(lla)
    position, pose, twist = _covariances(state, arm, turn)
    q = np.empty(4)
    matrix_to_quaternion(turn @ (C * SIGNS), q)
    w, x, y, z = (q if q[0] >= 0 else -q).tolist()
    return BaseState(
        stamp,
        lla,
        frame.place(lla),
        (x, y, z, w),
        SIGNS * (C.T @ state.v_n - swing),
        SIGNS * state.omega,
        pose,
        twist,
        position,
        status,
    )


def _covariances(state: FilterState, arm: Array, turn: Array) -> tuple[Array, Array, Array]:
    """Return those of the position east, north, up, of the pose and of the twist of the base frame.

    With the lever arm l from it to the IMU, dp_base = dp + (C l) x theta; with the rate w = measured
    - b_g and v_b = C^T v_n - w x l, dw = -db_g and dv_b = C^T (dv + v_n x theta) - l x db_g.
    """
    P, C = state.P, SIGNS[:, None] * state.C_nb.T
    pose, twist = np.zeros((6, len(P))), np.zeros((6, len(P)))
    pose[:3, POS], pose[:3, ATT] = turn, turn @ _cross(state.C_nb @ arm)
    pose[3:, ATT] = turn
    twist[:3, VEL], twist[:3, ATT] = C, C @ _cross(state.v_n)
    twist[:3, BG] = -SIGNS[:, None] * _cross(arm)
    twist[3:, BG] = -np.diag(SIGNS)
    of_pose = pose @ P @ pose.T
    level = TURN @ turn.T
    return level @ of_pose[:3, :3] @ level.T, of_pose, twist @ P @ twist.T


def _cross(a: Array) -> Array:
    """Return the matrix (3, 3) of a x."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


# ---- messages out


def fill_header(header: Any, stamp: int, frame: str) -> None:
    """Set stamp (ns) and frame of a std_msgs/Header."""
    header.stamp.sec, header.stamp.nanosec = divmod(stamp, SECOND)
    header.frame_id = frame


def fill_odometry(message: Any, it: BaseState, world: str, base: str) -> Any:
    """Return a nav_msgs/Odometry with the state."""
    fill_header(message.header, it.stamp, world)
    message.child_frame_id = base
    pose, twist = message.pose, message.twist
    _set(pose.pose.position, "xyz", it.place)
    _set(pose.pose.orientation, "xyzw", it.q)
    _set(twist.twist.linear, "xyz", it.velocity)
    _set(twist.twist.angular, "xyz", it.rate)
    pose.covariance = it.pose_covariance.ravel().tolist()
    twist.covariance = it.twist_covariance.ravel().tolist()
    return message


def odom_state(it: BaseState, in_odom: Pose) -> BaseState:
    """Return the state with place and attitude of the odometry's frame, in which the base frame has
    the pose `in_odom`."""
    x, y, z, w = it.q
    base = Pose(Rotation.from_wxyz((w, x, y, z)).as_matrix(), it.place)
    found = base.of(in_odom.inverse)
    w, x, y, z = Rotation.from_matrix(found.C).as_wxyz().tolist()
    return it._replace(place=found.t, q=(x, y, z, w))


def fill_transform(message: Any, it: BaseState, world: str, child: str) -> Any:
    """Return a geometry_msgs/TransformStamped from the world to the frame of the state."""
    fill_header(message.header, it.stamp, world)
    message.child_frame_id = child
    _set(message.transform.translation, "xyz", it.place)
    _set(message.transform.rotation, "xyzw", it.q)
    return message


def fill_fix(message: Any, it: BaseState, base: str) -> Any:
    """Return a sensor_msgs/NavSatFix with the position."""
    fill_header(message.header, it.stamp, base)
    message.status.status = message.status.STATUS_FIX
    message.latitude, message.longitude = np.degrees(it.lla[:2]).tolist()
    message.altitude = float(it.lla[2])
    message.position_covariance = it.position_covariance.ravel().tolist()
    message.position_covariance_type = message.COVARIANCE_TYPE_KNOWN
    return message


def _set(vector: Any, names: str, values: Any) -> None:
    for name, value in zip(names, values):
        setattr(vector, name, float(value))
