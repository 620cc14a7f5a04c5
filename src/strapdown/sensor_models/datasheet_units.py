"""Units of IMU errors: what a specification file may write, what tables show, and numbers with
units in and out of TOML."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ..checks import DataError, check_keys, did_you_mean, is_number
from ..typing import Array

_DEG, _G = np.pi / 180, 9.80665

UNITS_OF_SI = {
    "rad/sqrt(s)": {
        "rad/sqrt(s)": 1.0,
        "rad/s/sqrt(Hz)": 1.0,
        "deg/sqrt(s)": _DEG,
        "deg/s/sqrt(Hz)": _DEG,
        "mdps/sqrt(Hz)": _DEG * 1e-3,
        "deg/sqrt(h)": _DEG / 60,
        "deg/h/sqrt(Hz)": _DEG / 3600,
    },
    "m/s/sqrt(s)": {
        "m/s/sqrt(s)": 1.0,
        "m/s^2/sqrt(Hz)": 1.0,
        "m/s/sqrt(h)": 1 / 60,
        "mg/sqrt(Hz)": _G * 1e-3,
        "ug/sqrt(Hz)": _G * 1e-6,
    },
    "rad/s": {"rad/s": 1.0, "deg/s": _DEG, "deg/h": _DEG / 3600},
    "m/s^2": {"m/s^2": 1.0, "g": _G, "mg": _G * 1e-3, "ug": _G * 1e-6},
    "rad/s/sqrt(s)": {
        "rad/s/sqrt(s)": 1.0,
        "rad/s^2/sqrt(Hz)": 1.0,
        "deg/s/sqrt(s)": _DEG,
        "deg/s/sqrt(h)": _DEG / 60,
        "deg/h/sqrt(s)": _DEG / 3600,
        "deg/h/sqrt(h)": _DEG / 3600 / 60,
    },
    "m/s^2/sqrt(s)": {
        "m/s^2/sqrt(s)": 1.0,
        "m/s^3/sqrt(Hz)": 1.0,
        "m/s^2/sqrt(h)": 1 / 60,
        "mg/sqrt(s)": _G * 1e-3,
        "mg/sqrt(h)": _G * 1e-3 / 60,
        "ug/sqrt(s)": _G * 1e-6,
        "ug/sqrt(h)": _G * 1e-6 / 60,
    },
    "rad/s^2": {"rad/s^2": 1.0, "deg/s/h": _DEG / 3600, "deg/h/h": _DEG / 3600**2},
    "m/s^3": {"m/s^3": 1.0, "mg/h": _G * 1e-3 / 3600, "ug/h": _G * 1e-6 / 3600},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0},
    "1": {"1": 1.0, "%": 1e-2, "ppm": 1e-6},
    "rad": {
        "rad": 1.0,
        "mrad": 1e-3,
        "urad": 1e-6,
        "deg": _DEG,
        "arcmin": _DEG / 60,
        "arcsec": _DEG / 3600,
    },
    "m/s": {
        "m/s": 1.0,
        "mm/s": 1e-3,
        "um/s": 1e-6,
        "g*s": _G,
        "mg*s": _G * 1e-3,
        "ug*s": _G * 1e-6,
    },
    "rad/s/(m/s^2)": {"rad/s/(m/s^2)": 1.0, "deg/s/g": _DEG / _G, "deg/h/g": _DEG / 3600 / _G},
    "degC": {"degC": 1.0},
}
"""Accepted units of each SI unit and their size in it; g is the standard 9.80665 m/s^2, a noise
density is two-sided (equal to the random walk)."""

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
"""The unit of each SI unit that datasheets use, for tables; a term may name another."""

Values = TypeVar("Values", float, Array)


def in_units(value: Values, si: str, unit: str | None = None) -> Values:
    """An SI value in `unit`, by default the one of datasheets."""
    return value / UNITS_OF_SI[si][unit or SHEET[si]]


def check(value: object, name: str) -> None:
    """Refuse what is no finite number of 0 or more. Raises DataError."""
    if not is_number(value) or not 0 <= value < np.inf:
        raise DataError(f"{name} is {value!r}; it must be a finite number, 0 or more")


def check_finite(value: object, name: str) -> None:
    """Refuse what is no finite number. Raises DataError."""
    if not is_number(value) or not np.isfinite(value):
        raise DataError(f"{name} is {value!r}; it must be a finite number")


def size(unit: object, si: str, where: str) -> float:
    """What one `unit` is in the SI unit `si`. Raises DataError."""
    if unit not in list(UNITS_OF_SI[si]):
        raise DataError(
            f"{where}: unknown unit {unit!r}{did_you_mean(unit, UNITS_OF_SI[si])}; known: "
            f"{', '.join(UNITS_OF_SI[si])}"
        )
    return UNITS_OF_SI[si][unit]


def quantity(
    entry: object,
    si: str,
    where: str,
    example: str | None = None,
    checked: Callable[[object, str], None] = check,
) -> float:
    """The SI value of the TOML table {value, unit}. Raises DataError."""
    if not isinstance(entry, dict):
        raise DataError(
            f"{where}: {entry!r} has no unit; write {{ value = {entry}, unit = "
            f'"{example or SHEET[si]}" }}'
        )
    check_keys(entry, ["value", "unit"], where)
    if missing := [key for key in ("value", "unit") if key not in entry]:
        raise DataError(
            f"{where}: {missing[0]} is missing; known units: {', '.join(UNITS_OF_SI[si])}"
        )
    factor = size(entry["unit"], si, where)
    checked(entry["value"], where)
    return float(entry["value"]) * factor


def toml_quantity(value: float, si: str, unit: str | None = None) -> str:
    """The TOML of an SI value with its unit, and beside it as a comment the value in `unit` (by
    default the one of datasheets)."""
    return f'{{ value = {float(value)!r}, unit = "{si}" }}  # {in_units(value, si, unit):.6g} {unit or SHEET[si]}'
