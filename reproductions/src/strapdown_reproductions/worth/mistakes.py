"""Mistakes of a sensor beside GNSS: what each makes of its readings, and the causes that name it."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from strapdown.data.solution import Source
from strapdown.geometry.geodesy import displace_lla
from strapdown.typing import Array

FEET, KNOTS = 1 / 0.3048, 3600 / 1852
"""In a metre, in a m/s."""
LATE = 0.2  # s
FAR = 100.0  # m by which a beacon is off
CURRENT = (8e-6, -5e-6, 6e-6)
"""T: the field of the current of a motor beside the magnetometer, body."""
ON, PERIOD = 20.0, 40.0
"""s that a motor runs, or that a log does not see the bottom, of every PERIOD."""
STUCK = 0.4
"""Part of the recording after which a sensor is stuck."""


class SensorMistake(NamedTuple):
    """A mistake of one sensor."""

    name: str
    # of strapdown.data.verdict.CAUSES: those that count as the true one
    causes: tuple[str, ...]
    make: Callable[[Source], Source]


def scale_readings(factor: float) -> Callable[[Source], Source]:
    """Readings `factor` times as large."""
    return lambda a: replace(a, y=a.y * factor)


def delay_stamps(a: Source) -> Source:
    """Stamps that come LATE after the instant of the reading."""
    return replace(a, t=a.t + LATE)


def hold_reading(a: Source) -> Source:
    """The reading of one instant from then on."""
    y, first = a.y.copy(), int(STUCK * len(a.t))
    y[first:] = y[first]
    return replace(a, y=y)


def lost_bottom(a: Source) -> Source:
    """Zeros where the beams do not see the bottom."""
    return replace(a, y=np.where(_on(a.t)[:, None], 0.0, a.y))


def beside_motor(a: Source) -> Source:
    """A field with that of a current that goes on and off."""
    return replace(a, y=a.y + np.where(_on(a.t)[:, None], CURRENT, 0.0))


def beacon_off(a: Source) -> Source:
    """A beacon that is FAR to the north of its given place."""
    place = displace_lla(np.array(a.parameters[3:6]), np.array([FAR, 0.0, 0.0]))
    return replace(a, parameters=(*a.parameters[:3], *map(float, place)))


def _on(t: Array) -> Array:
    return np.asarray((t - t[0]) % PERIOD > PERIOD - ON)


SCALED = SensorMistake("scale 10 %", ("unit", "scale"), scale_readings(1.1))
DELAYED = SensorMistake("late by 0.2 s", ("clock",), delay_stamps)
HELD = SensorMistake("stuck", ("repeated",), hold_reading)
REVERSED = SensorMistake("wrong sign", ("unit", "frame"), scale_readings(-1.0))
IN_FEET = SensorMistake("feet", ("unit", "scale"), scale_readings(FEET))
USUAL = (SCALED, DELAYED, HELD, REVERSED)
OF_SPEED = (*USUAL, SensorMistake("knots", ("unit", "scale"), scale_readings(KNOTS)))
OF_LOG = (*OF_SPEED, SensorMistake("bottom lost", ("repeated", "outliers"), lost_bottom))
OF_DEPTH = (*USUAL, IN_FEET)
MISTAKES: dict[str, tuple[SensorMistake, ...]] = {
    "magnetic-field": (
        SCALED._replace(causes=("unit", "scale", "calibration")),
        DELAYED,
        HELD,
        REVERSED._replace(causes=("unit", "frame", "axes", "calibration")),
        SensorMistake("gauss", ("unit", "calibration"), scale_readings(0.01)),
        SensorMistake("motor current", ("disturbed field",), beside_motor),
    ),
    "baseline": (
        SCALED._replace(causes=("unit", "scale", "baseline")),
        DELAYED,
        HELD,
        REVERSED._replace(name="antennas swapped", causes=("baseline",)),
        IN_FEET._replace(causes=("unit", "scale", "baseline")),
    ),
    "body-velocity": OF_LOG,
    "beam-velocity": OF_LOG,
    "speed": OF_SPEED,
    "depth": OF_DEPTH,
    "water-pressure": OF_DEPTH,
    "range": (*OF_DEPTH, SensorMistake("beacon off by 100 m", ("beacon",), beacon_off)),
    "true-airspeed": OF_SPEED,
}
"""{kind: its mistakes}."""
