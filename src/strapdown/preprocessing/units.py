"""Names of units, and the numbers that turn them into SI and radians."""

import math
from difflib import get_close_matches

from ..checks import DataError

DEG, G, KNOT, FOOT = math.pi / 180, 9.80665, 1852 / 3600, 0.3048

UNIT_FACTORS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "angle": {"rad": 1.0, "deg": DEG, "arcsec": DEG / 3600},
    "angular rate": {"rad/s": 1.0, "deg/s": DEG, "deg/h": DEG / 3600},
    "acceleration": {"m/s^2": 1.0, "g": G, "mg": G / 1000},
    "velocity increment": {"m/s": 1.0, "g*s": G},
    "length": {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": FOOT},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "knot": KNOT, "cm/s": 0.01, "mm/s": 0.001, "ft/s": FOOT},
    "magnetic field": {"T": 1.0, "uT": 1e-6, "nT": 1e-9, "gauss": 1e-4, "mgauss": 1e-7},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "kPa": 1000.0, "mbar": 100.0, "bar": 1e5},
}
"""Factor to SI of every unit, by dimension. The standard gravity g is 9.80665 m/s^2."""

QUANTITY_DIMENSIONS = {
    "latitude": "angle",
    "longitude": "angle",
    "angle": "angle",
    "length": "length",
    "speed": "speed",
    "acceleration": "acceleration",
    "magnetic field": "magnetic field",
    "pressure": "pressure",
}
"""Dimension of each quantity that a kind of aiding can have."""

ALIASES = {
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "µs": "us",
    "usec": "us",
    "microseconds": "us",
    "nsec": "ns",
    "nanoseconds": "ns",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "radian": "rad",
    "radians": "rad",
    "rad/sec": "rad/s",
    "rps": "rad/s",
    "dps": "deg/s",
    "°/s": "deg/s",
    "degrees/s": "deg/s",
    "deg/sec": "deg/s",
    "deg/hr": "deg/h",
    "°/h": "deg/h",
    "dph": "deg/h",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "m/s/s": "m/s^2",
    "m/s**2": "m/s^2",
    "mps2": "m/s^2",
    "G": "g gauss",
    "milli-g": "mg",
    "mG": "mg mgauss",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "feet": "ft",
    "foot": "ft",
    "mps": "m/s",
    "m/sec": "m/s",
    "kph": "km/h",
    "kmh": "km/h",
    "kn": "knot",
    "kt": "knot",
    "kts": "knot",
    "knots": "knot",
    "tesla": "T",
    "µT": "uT",
    "μT": "uT",
    "microtesla": "uT",
    "nanotesla": "nT",
    "Gauss": "gauss",
    "Gs": "gauss",
    "milligauss": "mgauss",
    "pascal": "Pa",
    "mb": "mbar",
    "millibar": "mbar",
}
"""Other spellings, which are suggested, not accepted: one name for each unit keeps descriptions
readable. Where there are two names, the dimension decides."""


def factor(unit: str | None, dimension: str) -> float:
    """What a value in `unit` is multiplied with to be SI and radians. Raises DataError that
    lists the accepted names."""
    known = UNIT_FACTORS[dimension]
    if unit in known:
        return known[unit]
    accepted = f"accepted for {dimension}: {', '.join(known)}"
    if unit is None:
        raise DataError(f"unit is missing; {accepted}")
    other = next((name for name, units in UNIT_FACTORS.items() if unit in units), None)
    if other:
        raise DataError(f"unit {unit!r} is one of {other}; {accepted}")
    spellings = (ALIASES.get(unit) or ALIASES.get(unit.lower().strip()) or "").split()
    near = [
        name
        for name in (*spellings, *known)
        if name in known and (name in spellings or name.lower() == unit.lower().strip())
    ]
    near = near or get_close_matches(unit.lower(), known, 1)
    raise DataError(
        f"unknown unit {unit!r}{f', did you mean {near[0]!r}?' if near else ';'} {accepted}"
    )
