"""Units of the positions, speeds and courses of a table of fixes. Latitude and longitude take their
signs from the hemisphere columns beside them. Where a name gives no unit, or an incorrect one, the
positions decide."""

from typing import NamedTuple

import numpy as np

from ...core.mathematics.earth import A
from ...geometry.geodesy import wrap
from ...typing import Array, Mask
from ...units.conversion import DEG, UNITS
from .column_names import ColumnNames

BASE = 4.0
"""s between two positions whose difference gives a speed."""
WORST_FIT = 0.25
"""Largest relative difference of a speed, and largest difference of a course (rad), from those of
the positions with which a unit fits."""


def units_of_course(
    columns: ColumnNames, speed: str, course: str, t: Array, track: Array | None
) -> tuple[list[str], str]:
    """Return ([unit of the speed, of the course], why they are assumed): the units of the names
    unless the positions show others."""
    named = [columns.unit(speed, tuple(UNITS["speed"])), columns.unit(course, ("rad", "deg"))]
    angles = columns.numbers(course)
    largest = float(np.nanmax(np.abs(angles))) if np.isfinite(angles).any() else 0.0
    units = [named[0] or "m/s", named[1] or ("rad" if largest < 6.4 else "deg")]
    told = [f"{name!r} names no unit" for name, unit in zip((speed, course), named) if unit is None]
    if track is None:
        return units, "; ".join(told)
    fast, way = _of_positions(t, track)
    values = columns.numbers(speed)
    fits = _best_unit(values, fast) if named[0] is None else None
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
            told.append(f"{course!r} is in rad in spite of its name: only rad fits the positions")
    return units, "; ".join(told)


def unit_of_velocity(
    columns: ColumnNames, north: str, east: str, t: Array, track: Array | None
) -> tuple[str, str]:
    """Return (unit of a velocity, why it is assumed): that of the name, else the one that fits the
    positions."""
    named = columns.unit(north, tuple(UNITS["speed"]))
    if named:
        return named, ""
    if track is not None:
        values = np.hypot(columns.numbers(north), columns.numbers(east))
        fits = _best_unit(values, _of_positions(t, track)[0])
        if fits:
            return fits, f"the name has no unit; {fits} fits the positions"
    return "m/s", "the name has no unit"


def _best_unit(values: Array, fast: Array) -> str | None:
    """Return the unit in which speeds (n,) agree with those of the positions (n,), m/s; None where
    none does."""
    moving = (fast > 2.0) & np.isfinite(values)
    if not moving.any():
        return None
    ratio = max(float(np.median(values[moving] / fast[moving])), 1e-9)
    miss = {unit: abs(np.log(ratio * size)) for unit, size in UNITS["speed"].items()}
    best = min(miss, key=lambda unit: miss[unit])
    return best if miss[best] < WORST_FIT else None


def _of_positions(t: Array, track: Array) -> tuple[Array, Array]:
    """Return speed (n,), m/s, and course (n,), rad, from the positions half of `BASE` before and
    after each; NaN without them."""
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


# ---- latitude and longitude

HEMISPHERES = ("NS", "EW")
"""Letters of the two columns beside latitude and longitude, the negative one last."""


class Angles(NamedTuple):
    """Latitude and longitude."""

    names: tuple[str, str]
    unit: str
    scale: float
    track: Array  # (n, 2), rad
    # columns (n,) in degrees by name, where they are converted from others
    made: dict[str, Array]
    sources: tuple[str, ...] = ()  # the columns that these are converted from
    why: str = ""


def angles_of(columns: ColumnNames, lat: str, lon: str) -> Angles:
    """Return the Angles of two columns of a table: rad, degrees, 1e-7 degrees, or degrees and
    minutes as ddmm.mmmm of NMEA 0183. Columns of N and S, E and W beside them give the signs."""
    values = np.stack([columns.numbers(lat), columns.numbers(lon)], axis=1)
    some = values[np.isfinite(values).all(axis=1) & (values != 0).any(axis=1)]
    largest = float(np.abs(some).max(initial=0.0))
    beside = [_hemisphere(columns, name, each) for name, each in zip((lat, lon), HEMISPHERES)]
    minutes = 180 < largest <= 18000 or (
        all(beside) and largest > 100 and bool(np.all(np.abs(some) % 100 < 60))
    )
    signs = [_negative(columns, *each) for each in zip(beside, HEMISPHERES, values.T)]
    unit, scale = ("deg", 1e-7 if largest > 18000 else 1.0)
    if scale == 1 and not minutes:
        unit = columns.unit(lat, ("rad", "deg")) or ("rad" if 0 < largest < np.pi / 2 else "deg")
    if not minutes and not any(sign is not None and sign.any() for sign in signs):
        return Angles((lat, lon), unit, scale, values * (scale * UNITS["angle"][unit]), {})
    in_deg = values if minutes else values * (scale * UNITS["angle"][unit] / DEG)
    made = {
        f"{name} in deg": _signed_degrees(each, sign, minutes)
        for name, each, sign in zip((lat, lon), in_deg.T, signs)
    }
    first, second = made
    track = np.stack([*made.values()], axis=1) * DEG
    sources = (lat, lon, *filter(None, beside))
    why = _why(lat, minutes, beside, bool((some < 0).any()))
    return Angles((first, second), "deg", 1.0, track, made, sources, why)


def _why(lat: str, minutes: bool, beside: list[str | None], signed: bool) -> str:
    told = [name for name in beside if name]
    source = f"the degrees and minutes of {lat!r}" if minutes else repr(lat)
    letters = f" and the letters of {', '.join(map(repr, told))}" if told else ""
    text = f"degrees, from {source}{letters}"
    if len(told) == 2 or signed:
        return text
    lacking = [which for which, name in zip(("north", "east"), beside) if name is None]
    return f"{text}; assumed {' and '.join(lacking)}, because no column gives the hemisphere"


def _negative(columns: ColumnNames, name: str | None, letters: str, values: Array) -> Mask | None:
    """Return True for the rows (n,) that are south or west by the letters of a column; None where
    the values have signs of their own."""
    if name is None or (values < 0).any():
        return None
    cells = columns.table.frame[name].astype(str).str.strip().str.upper().str[:1]
    return cells.eq(letters[1]).to_numpy(bool)


def _signed_degrees(values: Array, negative: Mask | None, minutes: bool) -> Array:
    size = np.abs(values)
    degrees = np.floor(size / 100) + size % 100 / 60 if minutes else size
    return np.where(np.signbit(values) if negative is None else negative, -degrees, degrees)


def _hemisphere(columns: ColumnNames, beside: str, letters: str) -> str | None:
    """Return the column nearest to that of the coordinate, columns behind it first, whose cells are
    these letters or words that begin with them."""
    words = {"N", "S", "NORTH", "SOUTH"} if letters == "NS" else {"E", "W", "EAST", "WEST"}
    at = columns.names.index(beside)
    near = sorted(range(len(columns.names)), key=lambda i: (abs(i - at), i < at))
    for name in (columns.names[i] for i in near):
        if columns.table.content[name].dtype.kind in "iuf":
            continue
        cells = columns.table.frame[name].dropna().astype(str).str.strip().str.upper()
        if len(cells) and cells.isin(words).all():
            return str(name)
    return None
