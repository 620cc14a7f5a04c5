"""Parts that the logs of flight controllers share: rates, the epoch of their clock, the delay and
the lever arms that their parameters state, a trajectory of several messages as one table."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ....preprocessing.attitude_record import quaternions
from ....preprocessing.imu_samples import ARRAYS
from ....typing import Array
from ....units.time_scales import iso
from ...reader import Section

VEHICLES: dict[float, str] = {
    **dict.fromkeys((1, *range(19, 26)), "aircraft"),
    **dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), "multicopter"),
    10: "car",
    11: "ship",
}
"""Kinds of MAV_TYPE (https://mavlink.io/en/messages/common.html#MAV_TYPE) with limits of their
own."""
LATEST = 5e9  # s of GPS time, in 2138
GRADE_OF_MEMS = "flight controllers have a MEMS IMU"
ESTIMATE = "the autopilot's own estimate from the same sensors"
NO_DATE = "the geomagnetic model needs a date, and the log has none"
OTHERS = {
    "magnetometer": ("magnetic-field", "gauss"),
    "barometer": ("pressure", "Pa"),
    "airspeed": ("true-airspeed", "m/s"),
}
"""Kind and unit of the sources by their roles."""
Columns = Mapping[str, Any]
UNSURE = ('# estimate = ["clock"]           # the filter then finds the delay itself',)
"""Lines for a receiver whose delay is assumed."""


class Deviation(NamedTuple):
    """The key `std` of a section."""

    std: Any  # a number or names of columns
    why: str  # its source; "" where the log has it for each fix

    @property
    def key(self) -> dict[str, Any]:
        """The entry in a section, {"std": value}."""
        return {"std": self.std}

    @property
    def assumed(self) -> dict[str, str]:
        """The reason for an assumed value, {"std": reason}; {} where the log states the value."""
        return {"std": self.why} if self.why else {}


def zero_of_clock(gps: Array, t: Array) -> dict[str, str]:
    """Return the head of a Log whose clock is zero at the median of `gps` (s of GPS time) minus `t`
    (s of that clock); {} without such a time."""
    good = (gps > 0) & (gps < LATEST) & np.isfinite(t)
    if not good.any():
        return {}
    zero = float(np.median(gps[good] - t[good]))
    return {"epoch": iso(zero), "date": iso(float(gps[good][0]))[:10]} if zero > 0 else {}


def arm(parameters: Mapping[str, float], name: str) -> list[float]:
    """The vector of three parameters whose names end in X, Y and Z, m; zeros where one is
    missing."""
    found = [float(parameters.get(f"{name}{axis}", np.nan)) for axis in "XYZ"]
    return found if np.isfinite(found).all() else [0.0, 0.0, 0.0]


def add_arm(
    keys: dict[str, Any],
    assumed: dict[str, str],
    parameters: Mapping[str, float],
    names: Iterable[str],
) -> None:
    """Add the key `lever_arm` from the first of these parameters that is set."""
    for name in names:
        found = arm(parameters, name)
        if any(found):
            keys["lever_arm"], assumed["lever_arm"] = found, f"{name.rstrip('_')} of the log"
            return


def setting(parameters: Mapping[str, float], name: str, default: float) -> Deviation:
    """Return the standard deviation from a parameter of the autopilot's own filter, or its
    default."""
    found = parameters.get(name, 0.0)
    if found > 0:
        return Deviation(float(f"{found:.6g}"), f"{name} of the log")
    return Deviation(default, f"the default of {name}")


def deviation(fixes: Columns, names: Sequence[str], own: Deviation) -> Deviation:
    """Return the standard deviations in the receiver's columns, else the autopilot's own
    setting."""
    if all(name in fixes and np.any(fixes[name] > 0) for name in names):
        return Deviation(names[0] if len(names) == 1 else list(names), "")
    return Deviation(own.std, f"the receiver states none; {own.why}")


def imu_section(
    parameters: Mapping[str, float],
    arm_of: str,
    keys: dict[str, Any],
    instance: int,
    title: str,
    assumed: Mapping[str, str],
    faster: str,
) -> Section:
    """[imu] of a flight controller; the parameters `arm_of` have its lever arm."""
    keys = {**keys, "grade": "consumer"}
    assumed = {**assumed, "grade": GRADE_OF_MEMS}
    add_arm(keys, assumed, parameters, [arm_of])
    return Section("imu", "imu", keys, instance, title, assumed, faster=faster)


Part = tuple[Mapping[str, Any], Mapping[str, str]]
"""Keys of a section, and the reasons for the assumed ones."""


def receiver_sections(
    receiver: Section, position: Part, velocity: Part, no_velocity: str = ""
) -> list[Section]:
    """Return the sections of a receiver's position and velocity with their common keys;
    `no_velocity` is the reason why the velocity is left out."""
    return [
        receiver._replace(
            keys={"kind": kind, **receiver.keys, **keys},
            title=f"{receiver.title}, {kind}",
            assumed={**receiver.assumed, **why},
            left=left,
        )
        for kind, (keys, why), left in (
            ("position", position, ""),
            ("velocity", velocity, no_velocity),
        )
    ]


def other_section(
    role: str,
    table: str,
    keys: Mapping[str, Any],
    own: Deviation,
    instance: int,
    hz: float,
    dated: bool,
    **more: Any,
) -> Section:
    """Return the section of a magnetometer, a barometer or an airspeed with `keys`, its time and
    columns; `dated`: the log has a date."""
    kind, unit = OTHERS[role]
    keys = {"kind": kind, "table": table, **keys, "unit": unit, **own.key, **more}
    left = "" if dated or role != "magnetometer" else NO_DATE
    return Section("source", role, keys, instance, f"{table}, {hz:.3g} Hz", own.assumed, left)


def changes(
    parameters: Mapping[str, float], changed: Mapping[str, Sequence[float]], names: Sequence[str]
) -> list[str]:
    """Return lines on those of these parameters that change within the log."""
    return [
        f"{name} was changed during the log, from {changed[name][0]:g} to {parameters[name]:g}: the last "
        f"value is used for the whole log"
        for name in names
        if name in changed
    ]


def at_times(t: Any, there: Array, values: Array) -> Array:
    """Interpolate the vectors `values` (m, k) at the times `there` to the times t; NaN beyond them.
    The signs of quaternions are made consistent first."""
    order = np.argsort(there, kind="stable")
    there, values = np.asarray(there, float)[order], np.asarray(values, float)[order]
    if not len(there):
        return np.full((len(t), values.shape[1]), np.nan)
    return np.stack([np.interp(t, there, each, np.nan, np.nan) for each in values.T], axis=1)


def quaternions_at(t: Any, there: Array, q: Array) -> Array:
    """Interpolate quaternions (m, 4) along the chord; at 10 Hz and more, the error is a
    ten-thousandth of the turn between the samples."""
    q = np.asarray(q, float)
    flips = np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0, -1.0, 1.0)
    found = at_times(t, there, q * np.cumprod(np.r_[1.0, flips])[:, None] if len(q) else q)
    with np.errstate(invalid="ignore"):
        return found / np.linalg.norm(found, axis=1)[:, None]


def quaternions_of(roll: Array, pitch: Array, yaw: Array) -> Array:
    """Return quaternions (n, 4), scalar first, from angles in deg."""
    return quaternions(np.radians(np.c_[roll, pitch, yaw]), None, None, ARRAYS)


def trajectory(
    position: tuple[Any, ...], attitude: tuple[Any, Any], velocity: tuple[Any, Any] | None
) -> dict[str, Any]:
    """Columns t (us), lat, lon (deg), alt (m), q0 to q3 and, where there is a velocity, vn, ve, vd
    (m/s), of (t, lat, lon, alt), (t, q) and (t, v), at the times of the positions."""
    t = np.asarray(position[0]).astype(np.int64)
    found = dict(zip(("t", "lat", "lon", "alt"), (t, *position[1:])))
    turned = quaternions_at(t, np.asarray(attitude[0]).astype(np.int64), attitude[1])
    found |= {f"q{k}": turned[:, k] for k in range(4)}
    if velocity is not None:
        v = at_times(t, np.asarray(velocity[0]).astype(np.int64), velocity[1])
        found |= {f"v{axis}": v[:, k] for k, axis in enumerate("ned")}
    return found


def reference(
    columns: dict[str, Any],
    table: str,
    instance: int,
    title: str,
    left: str,
    geoid: bool,
    **time: Any,
) -> tuple[dict[str, Any], Section]:
    """(columns, section) of a trajectory, whose heights are above the geoid or the ellipsoid;
    `time` are further keys of its time."""
    keys: dict[str, Any] = {
        "table": table,
        "time": {"column": "t", "unit": "us", **time},
        "position": {"columns": ["lat", "lon", "alt"], "unit": ["deg", "deg", "m"]},
        "attitude": {"columns": [f"q{k}" for k in range(4)], "quaternion": "wxyz"},
    }
    if geoid:
        keys["position"]["geoid"] = "EGM96"
    if "vn" in columns:
        keys["velocity"] = {"columns": ["vn", "ve", "vd"], "unit": "m/s"}
    return columns, Section("reference", "reference", keys, instance, title, left=left)
