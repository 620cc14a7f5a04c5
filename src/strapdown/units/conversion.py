"""Names of units, the numbers that turn them into SI and radians, and numbers with units in and out
of TOML."""

import math
from typing import TypeVar

from ..checks import DataError, check_keys, check_number, did_you_mean
from ..typing import Array
from .constants import STANDARD_GRAVITY

DEG, G, KNOT, FOOT = math.pi / 180, STANDARD_GRAVITY, 1852 / 3600, 0.3048

UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {
        "rad": 1.0,
        "deg": DEG,
        "arcsec": DEG / 3600,
        "arcmin": DEG / 60,
        "mrad": 1e-3,
        "urad": 1e-6,
    },
    "angular rate": {"rad/s": 1.0, "deg/s": DEG, "deg/h": DEG / 3600},
    "acceleration": {"m/s^2": 1.0, "g": G, "mg": G * 1e-3, "ug": G * 1e-6},
    "velocity increment": {
        "m/s": 1.0,
        "g*s": G,
        "mg*s": G * 1e-3,
        "ug*s": G * 1e-6,
        "mm/s": 1e-3,
        "um/s": 1e-6,
    },
    "length": {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": FOOT},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "knot": KNOT, "cm/s": 0.01, "mm/s": 0.001, "ft/s": FOOT},
    "magnetic field": {"T": 1.0, "uT": 1e-6, "nT": 1e-9, "gauss": 1e-4, "mgauss": 1e-7},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "kPa": 1000.0, "mbar": 100.0, "dbar": 1e4, "bar": 1e5},
    "angular random walk": {
        "rad/sqrt(s)": 1.0,
        "rad/s/sqrt(Hz)": 1.0,
        "deg/sqrt(s)": DEG,
        "deg/s/sqrt(Hz)": DEG,
        "mdps/sqrt(Hz)": DEG * 1e-3,
        "deg/sqrt(h)": DEG / 60,
        "deg/h/sqrt(Hz)": DEG / 3600,
    },
    "velocity random walk": {
        "m/s/sqrt(s)": 1.0,
        "m/s^2/sqrt(Hz)": 1.0,
        "m/s/sqrt(h)": 1 / 60,
        "mg/sqrt(Hz)": G * 1e-3,
        "ug/sqrt(Hz)": G * 1e-6,
    },
    "rate random walk": {
        "rad/s/sqrt(s)": 1.0,
        "rad/s^2/sqrt(Hz)": 1.0,
        "deg/s/sqrt(s)": DEG,
        "deg/s/sqrt(h)": DEG / 60,
        "deg/h/sqrt(s)": DEG / 3600,
        "deg/h/sqrt(h)": DEG / 3600 / 60,
    },
    "acceleration random walk": {
        "m/s^2/sqrt(s)": 1.0,
        "m/s^3/sqrt(Hz)": 1.0,
        "m/s^2/sqrt(h)": 1 / 60,
        "mg/sqrt(s)": G * 1e-3,
        "mg/sqrt(h)": G * 1e-3 / 60,
        "ug/sqrt(s)": G * 1e-6,
        "ug/sqrt(h)": G * 1e-6 / 60,
    },
    "rate ramp": {"rad/s^2": 1.0, "deg/s/h": DEG / 3600, "deg/h/h": DEG / 3600**2},
    "acceleration ramp": {"m/s^3": 1.0, "mg/h": G * 1e-3 / 3600, "ug/h": G * 1e-6 / 3600},
    "g-sensitivity": {"rad/s/(m/s^2)": 1.0, "deg/s/g": DEG / G, "deg/h/g": DEG / 3600 / G},
    "ratio": {"1": 1.0, "%": 1e-2, "ppm": 1e-6},
    "temperature": {"degC": 1.0},
}
"""Factor to SI and radians of every unit, by dimension; the first of each is the SI unit. The
standard gravity g is 9.80665 m/s^2, a noise density is two-sided (equal to the random walk)."""

SHEET = {
    "rad/sqrt(s)": "deg/sqrt(h)",
    "m/s/sqrt(s)": "m/s/sqrt(h)",
    "rad/s": "deg/h",
    "m/s^2": "mg",
    "rad/s/sqrt(s)": "deg/h/sqrt(h)",
    "m/s^2/sqrt(s)": "mg/sqrt(h)",
    "rad/s^2": "deg/h/h",
    "m/s^3": "mg/h",
    "s": "s",
    "1": "ppm",
    "rad": "arcsec",
    "m/s": "mm/s",
    "rad/s/(m/s^2)": "deg/h/g",
    "degC": "degC",
}
"""The unit of each SI unit that datasheets of IMUs use, for tables; a term may name another."""

DIMENSIONS = {
    next(iter(units)): dimension for dimension, units in UNITS.items() if dimension != "speed"
}
"""Dimension of each SI unit; m/s is that of a velocity increment, as in a datasheet."""

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

Values = TypeVar("Values", float, Array)


def factor(unit: object, of: str, where: str = "") -> float:
    """Return the factor from `unit` to SI and radians; `of` is a dimension or its SI unit
    (`DIMENSIONS`). Raises DataError that names `where` and lists the accepted names."""
    dimension = DIMENSIONS.get(of, of)
    known = UNITS[dimension]
    if isinstance(unit, str) and unit in known:
        return known[unit]
    where, accepted = where and f"{where}: ", f"accepted for {dimension}: {', '.join(known)}"
    if unit is None:
        raise DataError(f"{where}unit is missing; {accepted}")
    for other, units in UNITS.items():
        if str(unit) in units:
            raise DataError(f"{where}unit {unit!r} is one of {other}; {accepted}")
    text = str(unit).strip()
    spelt = [
        name for name in ALIASES.get(text, ALIASES.get(text.lower(), "")).split() if name in known
    ]
    meant = f" (did you mean {spelt[0]!r}?)" if spelt else did_you_mean(text, known)
    raise DataError(f"{where}unknown unit {unit!r}{meant}; {accepted}")


def spread_factor(unit: object, of: str) -> tuple[float, bool]:
    """(what makes SI of a standard deviation in `unit`, False), or, of a unit such as "m^2" or
    "(m/s)^2", (the same of its root, True): the values are variances. Raises DataError."""
    squares = {
        f"({name})^2" if "/" in name else f"{name}^2": size
        for name, size in UNITS[DIMENSIONS.get(of, of)].items()
    }
    text = str(unit)
    return (squares[text], True) if text in squares else (factor(unit, of), False)


def in_units(value: Values, si: str, unit: str | None = None) -> Values:
    """An SI value in `unit`, by default the one of datasheets."""
    return value / factor(unit or SHEET[si], si)


def quantity(
    entry: object, si: str, where: str, example: str | None = None, least: float = 0.0
) -> float:
    """The SI value of the TOML table {value, unit}, whose value is a finite number, `least` or more.
    Raises DataError."""
    if not isinstance(entry, dict):
        raise DataError(
            f"{where}: {entry!r} has no unit; write {{ value = {entry}, unit = "
            f'"{example or SHEET[si]}" }}'
        )
    check_keys(entry, ["value", "unit"], where)
    if "value" not in entry:
        raise DataError(f"{where}: value is missing beside the unit")
    size = factor(entry.get("unit"), si, where)
    return float(check_number(entry["value"], where, least=least)) * size


def toml_quantity(value: float, si: str, unit: str | None = None) -> str:
    """The TOML of an SI value with its unit, and beside it as a comment the value in `unit` (by
    default the one of datasheets)."""
    return f'{{ value = {float(value)!r}, unit = "{si}" }}  # {in_units(value, si, unit):.6g} {unit or SHEET[si]}'
