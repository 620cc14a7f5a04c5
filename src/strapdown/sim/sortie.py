"""A flight from standstill to standstill: parked, taxiing, rolling, in the air by legs, landed and
stopped again, in a steady wind. SI and radians.

Legs are those of `motions`; their course and speed are heading and airspeed, to which the wind is
added in the air. Legs keep their durations, so short ones make sharp corners: a dive of 2.5 s
followed by a climb is a pull-up of several g, and a turn of a few seconds rolls in quickly.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..checks import DataError
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY as G
from .analytic import Numbers, Times, arctangent, cosine, lift_complex, sine, waves
from .motions import AIRCRAFT_GUSTS, flat_legs, profiles
from .trajectory import DEG, Motion

LIFT_OFF, ROTATION = 27.0, 2.0
"""m/s: the airspeed at which the wings carry half the weight, and the difference of airspeed to 12
or 88 % of it."""
_CRAWL = 1e-3  # m/s, avoids division of a slope by zero at rest


def sortie(
    start: Sequence[float],
    course: float,
    legs: Sequence[dict[str, Any]],
    speed: float = 0.0,
    wind: float = 0.0,
    wind_from: float = 0.0,
    smoothing: float = 2.0,
    roughness: float = 1.0,
    name: str = "sortie",
) -> Motion:
    """A light aircraft by `legs` from `start` (rad, rad, m), first heading (rad) and speed (m/s, 0:
    parked).

    It stands and rolls level below some 20 m/s and flies above some 34: with bank = atan(airspeed *
    turn rate / g), pitch 2.5 deg above its path through the air, gusts scaled by `roughness`, and
    the steady `wind` (m/s) out of `wind_from` (rad), in which its course is not its heading. A
    climb at less than that is refused, and so is one faster than the airspeed. Raises DataError.
    """
    if not (0 <= wind < np.inf and np.isfinite(wind_from)):
        raise DataError(
            f"the wind must be 0 m/s or more from a direction in rad, not {wind!r} m/s from "
            f"{wind_from!r} rad"
        )
    flat = flat_legs(legs, "climb")
    _check(flat, speed)
    path, pace, climb, end = profiles(flat, course, speed, smoothing)
    drift = (-wind * np.cos(wind_from), -wind * np.sin(wind_from))

    def gust(t: Times, what: str) -> Numbers:
        return roughness * waves(t, AIRCRAFT_GUSTS[what])

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        angle, lifted_off = path(t), airborne(pace(t))
        v = pace(t) + lifted_off * gust(t, "speed")
        return (
            v * cosine(angle) + lifted_off * drift[0],
            v * sine(angle) + lifted_off * drift[1],
            lifted_off * gust(t, "down") - climb.rate(t),
        )

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        v = pace(t)
        lifted_off = airborne(v)
        bank, slope = arctangent(v * path.rate(t) / G), arctangent(climb.rate(t) / (v + _CRAWL))
        return (
            lifted_off * (bank + gust(t, "roll")),
            lifted_off * (2.5 * DEG + gust(t, "pitch")) + slope,
            path(t) + lifted_off * gust(t, "heading"),
        )

    return Motion(name, tuple(start), velocity, attitude, end)


def _share(speed: Array) -> Array:
    return 0.5 + 0.5 * np.tanh((speed - LIFT_OFF) / ROTATION)


airborne = lift_complex(
    _share, lambda speed: 0.5 / ROTATION * (1 - np.tanh((speed - LIFT_OFF) / ROTATION) ** 2)
)
"""Share of the weight that the wings carry at an airspeed (m/s): 0 on the ground, 1 in the air."""


def _check(legs: list[dict[str, Any]], speed: float) -> None:
    """Raise DataError where an aircraft would climb on the ground or faster than it flies."""
    now = speed
    for number, leg in enumerate(legs, 1):
        then = leg.get("speed", now)
        slowest = min(now, then)
        if leg["climb"] and not max(abs(leg["climb"]), LIFT_OFF) <= slowest:
            raise DataError(
                f"leg {number} (repeats written out): a climb of {leg['climb']:g} m/s at a speed of "
                f"{slowest:g} m/s; "
                f"it must fly at {LIFT_OFF:g} m/s at least, and not slower than it climbs"
            )
        now = then
