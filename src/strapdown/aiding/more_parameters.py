"""Parameters of a source behind the first three: a direction in the body or the place of a beacon."""

import math
from collections.abc import Sequence

import numpy as np

from ..checks import DataError
from ..core.loop.contract import MeasurementModel

DIRECTION = "direction"
"""Unit vector in the body."""
BEACON = "beacon"
"""Latitude and longitude, rad, height above the ellipsoid, m."""
ATMOSPHERE = "atmosphere"
"""Pressure, Pa, and temperature, K, at a height, m; none for the ICAO atmosphere."""
MEANINGS = ("", DIRECTION, BEACON, ATMOSPHERE)
"""Meanings that source.parameters[3:6] of a source can have."""
PRESSURES, TEMPERATURES = (10e3, 110e3), (180.0, 340.0)
"""Pa and K, of a weather station or aloft."""
UNIT = 1e-3
"""By which the length of a unit vector may be off 1."""


def check_more_parameters(sensor: MeasurementModel, parameters: Sequence[float], name: str) -> None:
    """Refuse parameters of a source that lack what its kind needs behind the first three. Raises
    DataError.

    Parameters
    ----------
    sensor : MeasurementModel
        Its kind.
    parameters : sequence of float
        All of the source's.
    name : str
        Of the source, for the message.
    """
    given = tuple(parameters)
    if sensor.more_parameters == DIRECTION and not (
        len(given) == 6 and abs(float(np.linalg.norm(given[3:])) - 1) < UNIT
    ):
        raise DataError(
            f"{name}: parameters are {given}; kind {sensor.name} needs six: the lever arm, m, and a "
            f"unit vector, both forward, right, down"
        )
    if sensor.more_parameters == BEACON and not (
        len(given) == 6 and abs(given[3]) <= math.pi / 2 and abs(given[4]) <= 2 * math.pi
    ):
        raise DataError(
            f"{name}: parameters are {given}; kind {sensor.name} needs six: the lever arm, m forward, "
            f"right, down, and the place of the beacon: latitude, longitude, rad, height, m"
        )
    if sensor.more_parameters == ATMOSPHERE:
        _check_atmosphere(given, name)


def _check_atmosphere(given: tuple[float, ...], name: str) -> None:
    """Raise DataError where these are neither a lever arm, or none, nor one and the air."""
    air = given[3:]
    plausible = len(air) == 3 and (
        PRESSURES[0] <= air[0] <= PRESSURES[1] and TEMPERATURES[0] <= air[1] <= TEMPERATURES[1]
    )
    if len(given) not in (0, 3, 6) or (any(air) and not plausible):
        raise DataError(
            f"{name}: parameters are {given}, where the lever arm, m forward, right, down, and then the "
            f"pressure of the air in Pa, its temperature in K and the height in m are needed; leave the "
            f"air out for the ICAO atmosphere"
        )


def placeholder(sensor: MeasurementModel) -> tuple[float, ...]:
    """Parameters of a source of this kind before anybody gives them: forward, or a place at sea."""
    needed = sensor.more_parameters in (DIRECTION, BEACON)
    return (0.0, 0.0, 0.0, 1.0, 0.0, 0.0) if needed else ()


def direction_of(given: Sequence[float]) -> tuple[float, ...]:
    """The unit vector along `given`. Raises DataError where it has no direction."""
    length = math.hypot(*given)
    if not length > 0:
        raise DataError("a vector without a length has no direction")
    return tuple(each / length for each in given)
