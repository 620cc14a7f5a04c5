"""Latitude and longitude of a table: their unit, and the hemisphere that stands beside them."""

from typing import NamedTuple

import numpy as np

from ...typing import Array, Mask
from ...units import DEG, UNITS
from .column_names import Names

HEMISPHERES = ("NS", "EW")
"""Letters of the two columns beside latitude and longitude, the negative one last."""


class Angles(NamedTuple):
    """Latitude and longitude."""

    names: tuple[str, str]
    unit: str
    scale: float
    track: Array  # (n, 2), rad
    # columns (n,) of degrees by name, where they are made of others
    made: dict[str, Array]
    sources: tuple[str, ...] = ()  # the columns that these are made of
    why: str = ""


def angles_of(columns: Names, lat: str, lon: str) -> Angles:
    """The Angles of two columns of a table: rad, degrees, 1e-7 degrees, or degrees and minutes as
    ddmm.mmmm of NMEA 0183; columns of N and S, E and W beside them say their signs."""
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
        f"{name} in deg": _signed(each, sign, minutes)
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
    text = f"degrees, made of {source}{letters}"
    if len(told) == 2 or signed:
        return text
    lacking = [which for which, name in zip(("north", "east"), beside) if name is None]
    return f"{text}; taken as {' and '.join(lacking)}, for no column says otherwise"


def _negative(columns: Names, name: str | None, letters: str, values: Array) -> Mask | None:
    """Which rows (n,) are south or west by the letters of a column; None where the values have
    signs of their own."""
    if name is None or (values < 0).any():
        return None
    cells = columns.table.frame[name].astype(str).str.strip().str.upper().str[:1]
    return cells.eq(letters[1]).to_numpy(bool)


def _signed(values: Array, negative: Mask | None, minutes: bool) -> Array:
    size = np.abs(values)
    degrees = np.floor(size / 100) + size % 100 / 60 if minutes else size
    return np.where(np.signbit(values) if negative is None else negative, -degrees, degrees)


def _hemisphere(columns: Names, beside: str, letters: str) -> str | None:
    """The column nearest to that of the coordinate, those behind it first, whose cells are these
    letters or words that begin so."""
    words = {"N", "S", "NORTH", "SOUTH"} if letters == "NS" else {"E", "W", "EAST", "WEST"}
    at = columns.names.index(beside)
    near = sorted(range(len(columns.names)), key=lambda i: (abs(i - at), i < at))
    for name in (columns.names[i] for i in near):
        cells = columns.table.frame[name]
        if cells.dtype.kind in "iuf":
            continue
        cells = cells.dropna().astype(str).str.strip().str.upper()
        if len(cells) and cells.isin(words).all():
            return str(name)
    return None
