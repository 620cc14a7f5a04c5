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
MEANINGS = ("", DIRECTION, BEACON)
"""Meanings that source.parameters[3:6] of a source can have."""
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


def placeholder(sensor: MeasurementModel) -> tuple[float, ...]:
    """Parameters of a source of this kind before anybody gives them: forward, or a place at sea."""
    return (0.0, 0.0, 0.0, 1.0, 0.0, 0.0) if sensor.more_parameters else ()


def direction_of(given: Sequence[float]) -> tuple[float, ...]:
    """The unit vector along `given`. Raises DataError where it has no direction."""
    length = math.hypot(*given)
    if not length > 0:
        raise DataError("a vector without a length has no direction")
    return tuple(each / length for each in given)
