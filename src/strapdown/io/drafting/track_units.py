"""Units of a speed and a course that a table of fixes does not name, or misnames, by its positions."""

import numpy as np

from ...core.mathematics.earth import A
from ...geodesy import wrap
from ...typing import Array
from ...units import UNITS
from .column_names import Names

BASE = 4.0
"""s between two positions whose difference tells a speed."""
WORST_FIT = 0.25
"""Relative difference of a speed, and rad of a course, from those of the positions, up to which a
unit fits."""


def units_of_course(
    columns: Names, speed: str, course: str, t: Array, track: Array | None
) -> tuple[list[str], str]:
    """([unit of the speed, of the course], why they are assumed): those of the names, unless the
    positions show another."""
    named = [columns.unit(speed, tuple(UNITS["speed"])), columns.unit(course, ("rad", "deg"))]
    angles = columns.numbers(course)
    largest = float(np.nanmax(np.abs(angles))) if np.isfinite(angles).any() else 0.0
    units = [named[0] or "m/s", named[1] or ("rad" if largest < 6.4 else "deg")]
    told = [f"{name!r} names no unit" for name, unit in zip((speed, course), named) if unit is None]
    if track is None:
        return units, "; ".join(told)
    fast, way = _of_positions(t, track)
    values = columns.numbers(speed)
    fits = _fitting(values, fast) if named[0] is None else None
    if fits:
        units[0], told = fits, [f"{speed!r} in {fits} fits the positions", *told[1:]]
    sure = (fast > 2.0) & np.isfinite(angles)
    if largest < 6.4 and sure.sum() > 10:
        miss = {
            unit: float(np.median(np.abs(wrap(angles[sure] * UNITS["angle"][unit] - way[sure]))))
            for unit in ("rad", "deg")
        }
        if miss["rad"] < WORST_FIT < miss["deg"] and units[1] != "rad":
            units[1] = "rad"
            told.append(f"{course!r} is in rad in spite of its name: only so it fits the positions")
    return units, "; ".join(told)


def unit_of_velocity(
    columns: Names, north: str, east: str, t: Array, track: Array | None
) -> tuple[str, str]:
    """(unit of a velocity, why it is assumed): that of the name, else the one that fits the
    positions."""
    named = columns.unit(north, tuple(UNITS["speed"]))
    if named:
        return named, ""
    if track is not None:
        values = np.hypot(columns.numbers(north), columns.numbers(east))
        fits = _fitting(values, _of_positions(t, track)[0])
        if fits:
            return fits, f"the name says none; {fits} fits the positions"
    return "m/s", "the name says none"


def _fitting(values: Array, fast: Array) -> str | None:
    """The unit in which speeds (n,) are those of the positions (n,), m/s; None where none is."""
    moving = (fast > 2.0) & np.isfinite(values)
    if not moving.any():
        return None
    ratio = max(float(np.median(values[moving] / fast[moving])), 1e-9)
    miss = {unit: abs(np.log(ratio * size)) for unit, size in UNITS["speed"].items()}
    best = min(miss, key=lambda unit: miss[unit])
    return best if miss[best] < WORST_FIT else None


def _of_positions(t: Array, track: Array) -> tuple[Array, Array]:
    """Speed (n,), m/s, and course (n,), rad, between the positions half of `BASE` before and after
    each; NaN where there are none."""
    fast, way = np.full(len(t), np.nan), np.full(len(t), np.nan)
    known = np.flatnonzero(np.isfinite(track).all(axis=1) & np.isfinite(t))
    known = known[(track[known] != 0).any(axis=1)]
    if len(known) < 3:
        return fast, way
    k = max(1, round(0.5 * BASE / max(float(np.median(np.diff(t[known]))), 1e-9)))
    if len(known) <= 2 * k:
        return fast, way
    before, here, after = known[: -2 * k], known[k:-k], known[2 * k :]
    step = (track[after] - track[before]) * A
    step[:, 1] *= np.cos(track[here, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        fast[here] = np.linalg.norm(step, axis=1) / (t[after] - t[before])
    way[here] = np.arctan2(step[:, 1], step[:, 0])
    return fast, way
