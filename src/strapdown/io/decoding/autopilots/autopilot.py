"""What the logs of flight controllers have in common: rates, the moment of their zero, the delay
and the arms that their parameters state, a trajectory of several messages as one table."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....preprocessing.attitude_record import quaternions
from ....preprocessing.imu_samples import ARRAYS
from ....time_scales import iso
from ....typing import Array
from ...contract import Section

VEHICLES: dict[float, str] = {
    **dict.fromkeys((1, *range(19, 26)), "aircraft"),
    **dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), "multicopter"),
    10: "car",
    11: "ship",
}
"""Kinds of MAV_TYPE (https://mavlink.io/en/messages/common.html#MAV_TYPE) with bounds of their own."""
LATEST = 5e9  # s of GPS time, in 2138
GRADE_OF_MEMS = "flight controllers have a MEMS IMU"
Columns = Mapping[str, Any]
UNSURE = ('# estimate = ["clock"]           # the filter then finds the delay itself',)
"""Of a receiver whose delay is assumed."""


def rate(t_us: Any) -> float:
    """Hz of times in us: 1 / their median interval; 0 of fewer than two."""
    steps = np.diff(np.sort(np.asarray(t_us).astype(np.int64)))
    steps = steps[steps > 0]
    return 1e6 / float(np.median(steps)) if len(steps) else 0.0


def zero_of_clock(gps: Array, t: Array) -> dict[str, str]:
    """The head of a Log whose clock has its zero where the median of `gps` (s of GPS time) less `t`
    (s of that clock) says; {} where there is no such time."""
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


def changes(
    parameters: Mapping[str, float], changed: Mapping[str, Sequence[float]], names: Sequence[str]
) -> list[str]:
    """Lines on those of these parameters that the log changes on its way."""
    return [
        f"{name} was changed on the way, from {changed[name][0]:g} to {parameters[name]:g}: the last "
        f"value is taken for the whole log"
        for name in names
        if name in changed
    ]


def at_times(t: Any, there: Array, values: Array) -> Array:
    """Vectors `values` (m, k) at the times `there`, between which they are interpolated, at the
    times t; NaN beyond them. Of quaternions the signs are made to agree first."""
    order = np.argsort(there, kind="stable")
    there, values = np.asarray(there, float)[order], np.asarray(values, float)[order]
    if not len(there):
        return np.full((len(t), values.shape[1]), np.nan)
    return np.stack([np.interp(t, there, each, np.nan, np.nan) for each in values.T], axis=1)


def quaternions_at(t: Any, there: Array, q: Array) -> Array:
    """The same of quaternions (m, 4), along the chord, which between samples of 10 Hz and more is
    right to a ten-thousandth of the turn between them."""
    q = np.asarray(q, float)
    flips = np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0, -1.0, 1.0)
    found = at_times(t, there, q * np.cumprod(np.r_[1.0, flips])[:, None] if len(q) else q)
    with np.errstate(invalid="ignore"):
        return found / np.linalg.norm(found, axis=1)[:, None]


def quaternions_of(roll: Array, pitch: Array, yaw: Array) -> Array:
    """(n, 4) quaternions, scalar first, of angles in deg."""
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
