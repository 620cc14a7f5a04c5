"""The International Standard Atmosphere from 5 km below sea level to 20 km: pressure of a height,
and height of a pressure (ISO 2533:1975).

Two layers: the troposphere, where it gets colder by 6.5 K per km, and above 11 km the lower
stratosphere of one temperature. Heights are geopotential, as the standard's are: at 10 km, 16 m
less than the geometric height.
"""

import numpy as np

from ..checks import DataError
from ..typing import Array, ArrayLike, Mask
from ..units.constants import STANDARD_GRAVITY

SEA_LEVEL_PRESSURE, SEA_LEVEL_TEMPERATURE = 101325.0, 288.15  # Pa, K
LAPSE, GAS = 6.5e-3, 287.05287  # K/m, J/(kg K) of dry air
TROPOPAUSE, MIN_AIR, MAX_AIR = 11_000.0, -5_000.0, 20_000.0  # m
"""Constants of ISO 2533:1975; its gravity is the standard one."""
_POWER = STANDARD_GRAVITY / (GAS * LAPSE)
_COLD = SEA_LEVEL_TEMPERATURE - LAPSE * TROPOPAUSE  # K
_THERE = SEA_LEVEL_PRESSURE * (_COLD / SEA_LEVEL_TEMPERATURE) ** _POWER  # Pa at the tropopause
_SCALE = GAS * _COLD / STANDARD_GRAVITY  # m in which the pressure above it falls by e


def standard_pressure(height: ArrayLike) -> Array:
    """Pressure, Pa, of the standard atmosphere at heights in m (an array or a number). Raises
    DataError outside -5 to 20 km."""
    height = np.asarray(height, float)
    _refuse(
        ~((height >= MIN_AIR) & (height <= MAX_AIR)),
        height,
        f"height {{:.6g}} m; the standard atmosphere here goes from {MIN_AIR:g} to {MAX_AIR:g} m",
    )
    low = (
        SEA_LEVEL_PRESSURE
        * (1 - LAPSE / SEA_LEVEL_TEMPERATURE * np.minimum(height, TROPOPAUSE)) ** _POWER
    )
    return low * np.exp(-np.maximum(height - TROPOPAUSE, 0.0) / _SCALE)


def pressure_altitude(pressure: ArrayLike) -> Array:
    """Height, m, at which the standard atmosphere has these pressures, Pa (an array or a
    number). Raises DataError outside -5 to 20 km."""
    pressure = np.asarray(pressure, float)
    _refuse(
        ~((pressure >= _MIN) & (pressure <= _MAX)),
        pressure,
        f"pressure {{:.6g}} Pa; between {MIN_AIR / 1e3:g} and {MAX_AIR / 1e3:g} km it is "
        f"{_MIN:.0f} to {_MAX:.0f} Pa: is the unit right?",
    )
    low = (
        SEA_LEVEL_TEMPERATURE
        / LAPSE
        * (1 - (np.maximum(pressure, _THERE) / SEA_LEVEL_PRESSURE) ** (1 / _POWER))
    )
    return low + _SCALE * np.log(_THERE / np.minimum(pressure, _THERE))


def pressure_gradient(height: ArrayLike) -> Array:
    """Change of pressure with height, Pa/m (negative), at heights in m: -p g/(R T), the weight
    of the air. Raises DataError as above."""
    temperature = SEA_LEVEL_TEMPERATURE - LAPSE * np.minimum(np.asarray(height, float), TROPOPAUSE)
    return -standard_pressure(height) * STANDARD_GRAVITY / (GAS * temperature)


def _refuse(bad: Mask, values: Array, text: str) -> None:
    if np.any(bad):
        raise DataError(text.format(float(values[bad].flat[0])))


_MAX, _MIN = float(standard_pressure(MIN_AIR)), float(standard_pressure(MAX_AIR))
