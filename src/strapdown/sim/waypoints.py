"""A flight by waypoints: after each of them it continues for a few seconds, then turns until a
straight line leads to the next."""

from collections.abc import Iterable, Sequence

import numpy as np

from ..checks import DataError
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..geometry.geodesy import displacement
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY as G
from .analytic import MotionProfile
from .motions import MAX_MOTION, aircraft_motion
from .trajectory import DEG, Motion, sample

_ROUNDS = 5  # each brings the aim at a waypoint a hundred times closer
# of the smoothing, from a waypoint to the next corner: what the rounding there moves is 5e-5 of a
# turn
_MARGIN = 5.0


def waypoints(
    waypoints: Iterable[Sequence[float]],
    speed: float,
    bank: float = 25 * DEG,
    smoothing: float = 2.0,
    roughness: float = 1.0,
    name: str = "waypoint flight",
) -> Motion:
    """Return a flight over all `waypoints` (latitude rad, longitude rad, height m) in order at a
    ground `speed` (m/s), with about `bank` (rad) at most in turns.

    It begins over the first, on course to the second, and ends over the last. In smooth air
    (`roughness` 0) it passes each one within 0.5 m; gusts move it by some metres. Course is
    constant after a turn (a rhumb line), and so is climb except for a level sixth of the time at
    either end. Raises DataError, also where a waypoint is too near to settle on the line to it.
    """
    places = [tuple(map(float, place)) for place in waypoints]
    if len(places) < 2 or not 0 < speed < np.inf or not 0 < bank < 80 * DEG or not smoothing > 0:
        raise DataError(
            f"a flight by waypoints needs two or more, speed and smoothing above 0 and a bank "
            f"between 0 and 80 deg, not {len(places)}, "
            f"{speed!r} m/s, {smoothing!r} s, {bank / DEG:.6g} deg"
        )
    _check(places, speed)
    here: tuple[float, ...] = places[0]
    course: float | None = None
    first: float | None = None
    turns: list[tuple[float, float]] = []
    climbs: list[tuple[float, float]] = []
    for number, place in enumerate(places[1:], 2):
        aim = displacement(place, here)[:2]
        for _ in range(_ROUNDS):
            if course is not None:
                begin, turn = course, _turn_then_line(aim, course, speed, bank, smoothing, number)
            else:
                begin, turn = (
                    float(np.arctan2(aim[1], aim[0])),
                    [(float(np.hypot(*aim)) / speed, 0.0)],
                )
            seconds = sum(duration for duration, _ in turn)
            climb = [
                (seconds / 6, 0.0),
                (seconds * 2 / 3, (place[2] - here[2]) / (seconds * 2 / 3)),
                (seconds / 6, 0.0),
            ]
            reached = _reached_position(
                here,
                _profile(begin, turn, smoothing),
                _profile(0.0, climb, smoothing),
                speed,
                seconds,
                number,
            )
            aim = aim + displacement(place, reached)[:2]
        if abs(climb[1][1]) > speed:
            raise DataError(
                f"waypoint {number} needs a climb of {climb[1][1]:.3g} m/s at a speed of {speed:g} "
                f"m/s; it must not be larger than the speed"
            )
        first = begin if first is None else first
        here, course, turns, climbs = (
            tuple(reached),
            begin + sum(duration * rate for duration, rate in turn),
            turns + turn,
            climbs + climb,
        )
    assert first is not None  # there are two places or more
    pace = MotionProfile(float(speed), np.zeros(1), np.empty(0), np.empty(0))
    end = float(sum(duration for duration, _ in turns))
    return aircraft_motion(
        places[0],
        _profile(first, turns, smoothing),
        pace,
        _profile(0.0, climbs, smoothing),
        end,
        roughness,
        name,
    )


def _check(places: Sequence[tuple[float, ...]], speed: float) -> None:
    """Raise DataError, before any flying, where places cannot be flown over in turn at that
    speed."""
    if not np.all(np.isfinite(places)):
        raise DataError("a waypoint is not finite; give latitude, longitude and height of each")
    for number, (lat, _, _) in enumerate(places, 1):
        if abs(lat) > LATITUDE_LIMIT:
            raise DataError(
                f"waypoint {number} is at {lat / DEG:.6g} deg of latitude; the models are valid up to "
                f"{LATITUDE_LIMIT / DEG:g}"
            )
    total = 0.0
    for number, (here, place) in enumerate(zip(places, places[1:]), 2):
        north, east, _ = displacement(place, here)
        length = float(np.hypot(north, east))
        if length < 1.0:
            raise DataError(
                f"waypoints {number - 1} and {number} are at the same place; leave one of them out"
            )
        total += length / speed
    if total > MAX_MOTION:
        raise DataError(
            f"the flight by these waypoints takes {total:.3g} s; at most {MAX_MOTION:g} s (10 "
            f"days) are simulated; fly faster"
        )


def _profile(value: float, lines: list[tuple[float, float]], smoothing: float) -> MotionProfile:
    durations, slopes = zip(*lines)
    return MotionProfile.of(value, [*durations, np.inf], [*slopes, 0.0], smoothing)


def _reached_position(
    here: tuple[float, ...],
    path: MotionProfile,
    climb: MotionProfile,
    speed: float,
    seconds: float,
    number: int,
) -> Array:
    leg = Motion(
        "leg",
        here,
        lambda t: (speed * np.cos(path(t)), speed * np.sin(path(t)), -climb.rate(t)),
        lambda t: (0.0, 0.0, 0.0),
    )
    try:
        return sample(leg, [0.0, seconds], 0.5).lla[-1]
    except DataError:
        raise DataError(
            f"the line to waypoint {number} comes within 1 deg of a pole, where courses change too "
            f"fast; avoid the pole"
        ) from None


def _turn_then_line(
    aim: Array, course: float, speed: float, bank: float, smoothing: float, number: int
) -> list[tuple[float, float]]:
    """[(duration, course rate)] from the origin to `aim` (north, east, m) in the plane: straight, a
    turn, straight; the shorter of both senses.

    An aim inside the turning circle of one side is reached by a turn to the other side; it cannot
    be in both circles.
    """
    pause, quickest, rate = _MARGIN * smoothing, 6 * smoothing, G * np.tan(bank) / speed
    begin = aim - speed * pause * np.array([np.cos(course), np.sin(course)])
    turn: float | None = None
    # a small turn takes `quickest` all the same, so its radius depends on its angle
    for _ in range(30):
        radius = (
            speed / rate if turn is None else speed * max(1 / rate, quickest / max(abs(turn), 1e-9))
        )
        ways = [
            way for sense in (1, -1) if (way := _tangent(begin, course, radius, sense)) is not None
        ]
        if not ways:
            raise DataError(
                f"waypoint {number} follows too soon: it lies within the turn to it; fly slower, "
                f"bank more, or leave it out"
            )
        turn, line = min(ways, key=lambda way: radius * abs(way[0]) + way[1])
    assert turn is not None
    if line < speed * pause:
        raise DataError(
            f"waypoint {number} follows too soon: {line:.0f} m of straight line are left after the "
            f"turn to it, {speed * pause:.0f} m "
            "are needed; fly slower, bank more, or leave it out"
        )
    turning = max(abs(turn) / rate, quickest)
    return [(pause, 0.0), (turning, turn / turning), (line / speed, 0.0)]


def _tangent(aim: Array, course: float, radius: float, sense: int) -> tuple[float, float] | None:
    """(turn rad, length m of the line after it) of a circle of `radius` to the right (sense 1)
    or left (-1); None where `aim` is inside."""
    to_aim = aim - sense * radius * np.array([-np.sin(course), np.cos(course)])
    square = to_aim @ to_aim - radius**2
    if square < 0:
        return None
    line = float(np.sqrt(square))
    after = np.arctan2(to_aim[1], to_aim[0]) + sense * np.arctan2(radius, line)
    return sense * float(sense * (after - course) % (2 * np.pi)), line
