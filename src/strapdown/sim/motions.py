"""Motions to simulate: at rest, hand-held, multicopter, moored in waves, straight along a geodesic,
and flights, drives and voyages by legs. SI and radians.

A leg is a dict with `duration` (s), and `turn` (rad, clockwise positive), `speed` (m/s, reached
linearly at its end), `climb` (m/s) or, on the road, `gradient` (rise over run). A turn may have a
`bank` (rad) instead of a duration: it lasts as long as a coordinated turn with that bank, but at
least six times `smoothing`, to roll in and out. {"repeat": n, "legs": [...]} repeats legs n times.
Corners between legs are rounded over a few times `smoothing` seconds.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev

from ..checks import DataError, check_keys, check_number, locate_errors
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY as G
from .analytic import (
    MotionProfile,
    Numbers,
    Times,
    arctangent,
    cosine,
    lift_complex,
    root,
    sine,
    waves,
)
from .trajectory import DEG, Motion, radii, ramp, ramp_rate, static as _static

LEG_KEYS = ("duration", "turn", "bank", "speed", "climb", "gradient", "repeat", "legs")
CLIMB_KEYS = {"flight": "climb", "sortie": "climb", "car": "gradient", "ship": None}
"""Key of the climb in a leg of each motion by legs."""
MAX_LEGS, MAX_MOTION = 5000, 10 * 86400.0
"""Largest numbers of legs and of seconds of a motion."""
_SLACK = 1.0  # s beyond the end of a geodesic that are solved too, to check slopes at the end
# of a light aircraft in light turbulence: amplitude rad or m/s, period s, phase rad
AIRCRAFT_GUSTS = {
    "roll": ((1.5 * DEG, 5.3, 0.0), (0.5 * DEG, 1.9, 1.0)),
    "pitch": ((1.0 * DEG, 4.1, 0.5), (0.4 * DEG, 1.3, 2.0)),
    "heading": ((0.8 * DEG, 6.7, 1.5),),
    "speed": ((0.4, 11.0, 0.0), (0.2, 4.7, 2.5)),
    "down": ((0.4, 7.9, 1.0), (0.2, 3.1, 0.3)),
}
_SHAKES = {
    "roll": ((0.5 * DEG, 1.1, 0.0), (0.2 * DEG, 0.37, 1.0)),
    "pitch": ((0.4 * DEG, 0.9, 2.0), (0.2 * DEG, 0.29, 0.5)),
    "down": ((0.02, 0.71, 0.4),),
}
# share of amplitude, of period, phase rad
_SEA = (
    (0.75, 1.0, 0.0),
    (0.45, 0.83, 2.1),
    (0.35, 1.21, 4.0),
    (0.25, 0.67, 1.2),
    (0.2, 1.47, 5.1),
)

# amplitude rad or m/s, period s, phase rad: the periods have no common multiple within an hour
_HAND = {
    "roll": ((42 * DEG, 4.3, 0.0), (9 * DEG, 1.7, 1.1)),
    "pitch": ((33 * DEG, 5.1, 0.7), (8 * DEG, 1.9, 2.3)),
    "heading": ((125 * DEG, 13.7, 0.0), (25 * DEG, 3.7, 1.9), (6 * DEG, 1.3, 0.4)),
    "north": ((0.31, 1.31, 0.0), (0.26, 2.9, 1.0), (0.07, 0.71, 2.0)),
    "east": ((0.26, 1.13, 2.2), (0.22, 3.3, 0.3), (0.08, 0.83, 1.4)),
    "down": ((0.20, 0.97, 1.3), (0.24, 2.3, 2.6), (0.06, 0.67, 0.9)),
}
# share of the speed or of the yaw, share of the period, phase rad
_ROTORS = {
    "north": ((0.7, 1.0, 0.0), (0.3, 0.61, 1.0)),
    "east": ((0.6, 1.17, 2.2), (0.3, 0.53, 0.3)),
    "down": ((0.15, 1.6, 1.3), (0.05, 0.47, 2.6)),
    "heading": ((1.0, 4.3, 0.0), (0.2, 1.9, 1.9)),
}
# as _SEA, around one long swell
_SWELL = (
    (1.0, 1.0, 0.0),
    (0.3, 0.83, 2.1),
    (0.25, 1.21, 4.0),
    (0.15, 0.67, 1.2),
    (0.1, 1.47, 5.1),
)


def static(
    start: Sequence[float], roll: float = 0.0, pitch: float = 0.0, heading: float = 0.0
) -> Motion:
    """At rest at `start` (latitude rad, longitude rad, height m); angles rad."""
    return _static(start, (roll, pitch, heading))


def hand_held(
    start: Sequence[float],
    heading: float = 0.0,
    turning: float = 1.0,
    travel: float = 1.0,
    rest: float = 0.0,
    name: str = "hand-held",
) -> Motion:
    """Return a hand-held motion that rotates about all axes and moves to and fro at `start`: by 50
    deg of roll, 40 of pitch, 155 around `heading` (rad).

    `turning` scales the angles (1: rates to 3 rad/s), `travel` the movement (1: some 15 cm with 1
    to 3 m/s^2; 0: the IMU stays in place and measures only gravity). It lies level and still for
    the first `rest` s and is in full motion 2 s later. Raises DataError.
    """
    with locate_errors("a motion in a hand"):
        check_number(
            turning, "turning, which above 1.5 pitches beyond the vertical,", least=0, most=1.5
        )
        check_number(travel, "travel", least=0)
        check_number(rest, "rest", "s", least=0)
    begun: Callable[[Numbers], Numbers] = (
        lift_complex(lambda t: ramp(t, rest + 1.0, 0.25), lambda t: ramp_rate(t, rest + 1.0, 0.25))
        if rest
        else lambda t: 1.0
    )

    def swing(t: Times, what: str, size: float) -> Numbers:
        return size * begun(t) * waves(t, _HAND[what])

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return swing(t, "north", travel), swing(t, "east", travel), swing(t, "down", travel)

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return (
            swing(t, "roll", turning),
            swing(t, "pitch", turning),
            heading + swing(t, "heading", turning),
        )

    return Motion(name, tuple(start), velocity, attitude)


def multicopter(
    start: Sequence[float],
    heading: float = 0.0,
    speed: float = 5.0,
    period: float = 8.0,
    yaw: float = 60 * DEG,
    name: str = "multicopter",
) -> Motion:
    """Return a multicopter that flies to and fro about `start`, tilted so that only its rotors
    accelerate it: without drag its accelerometers measure nothing across the thrust.

    `speed` (m/s) is the sum of the amplitudes along north, `period` (s) that of its largest wave,
    and `yaw` (rad) the amplitude of the turns around `heading` (rad). A small speed is a hover.
    Raises DataError.
    """
    with locate_errors("a multicopter"):
        check_number(speed, "speed", "m/s", least=0)
        check_number(period, "period", "s", above=0)
    axes = ("north", "east", "down")
    moves = {
        axis: [(speed * share, period * longer, phase) for share, longer, phase in _ROTORS[axis]]
        for axis in axes
    }
    turns = [(yaw * share, period * longer, phase) for share, longer, phase in _ROTORS["heading"]]
    if sum(a * 2 * np.pi / T for a, T, _ in moves["down"]) > 0.5 * G:
        raise DataError("a multicopter: it would fall; choose a smaller speed or a longer period")

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return waves(t, moves["north"]), waves(t, moves["east"]), waves(t, moves["down"])

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        north, east, down = (
            waves(t, [(a * 2 * np.pi / T, T, phase + np.pi / 2) for a, T, phase in moves[axis]])
            for axis in axes
        )
        bearing = heading + waves(t, turns)
        ahead = north * cosine(bearing) + east * sine(bearing)
        right = east * cosine(bearing) - north * sine(bearing)
        lift = G - down
        pitch = -arctangent(ahead / lift)
        return arctangent(right / root(ahead * ahead + lift * lift)), pitch, bearing

    return Motion(name, tuple(start), velocity, attitude)


def moored_vessel(
    start: Sequence[float],
    heading: float = 0.0,
    heave: float = 1.0,
    wave_period: float = 8.0,
    roll: float = 6 * DEG,
    pitch: float = 2 * DEG,
    name: str = "moored",
) -> Motion:
    """Return a moored vessel in a swell that heaves about the height of `start`, its mean over
    time.

    `heave` (m), `roll` and `pitch` (rad) are amplitudes of the largest of five waves, that of the
    period `wave_period` (s); the others have 0.3 of it and less. It surges and sways by 0.3 of the
    heave and yaws by a fifth of the roll around `heading` (rad). Raises DataError.
    """
    check_number(heave, "heave of a swell", "m", least=0)
    check_number(wave_period, "period of a swell", "s", above=0)

    def swell(t: Numbers, size: float, phase: float) -> Numbers:
        return waves(
            t, [(size * share, wave_period * longer, phase + p) for share, longer, p in _SWELL]
        )

    def rate(t: Numbers, size: float, phase: float) -> Numbers:
        return waves(
            t,
            [
                (
                    size * share * 2 * np.pi / (wave_period * longer),
                    wave_period * longer,
                    phase + p + np.pi / 2,
                )
                for share, longer, p in _SWELL
            ],
        )

    lat, lon, mean = start

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return rate(t, 0.3 * heave, 1.4), rate(t, 0.3 * heave, 2.2), -rate(t, heave, 0.0)

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return swell(t, roll, 1.7), swell(t, pitch, 0.6), heading + swell(t, 0.2 * roll, 2.9)

    return Motion(name, (lat, lon, mean + float(swell(0.0, heave, 0.0))), velocity, attitude)


def straight(
    start: Sequence[float],
    azimuth: float,
    speed: float,
    duration: float,
    amplitude: float = 5 * DEG,
    period: float = 100.0,
) -> Motion:
    """Return level flight above a geodesic of the ellipsoid for `duration` s, with the flight's
    `speed`.

    Roll, pitch and heading swing by `amplitude` (rad) with `period` (s), a third of a period apart,
    heading around the course.
    """
    with locate_errors("a straight flight"):
        check_number(speed, "speed", "m/s", above=0)
        check_number(duration, "duration", "s", above=0)
        check_number(period, "period", "s", above=0)
    course = _geodesic_course(start, azimuth, speed, duration + _SLACK)

    def swing(t: Times, phase: float) -> Numbers:
        return waves(t, ((amplitude, period, phase),))

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        angle = course(t)
        return speed * cosine(angle), speed * sine(angle), 0.0

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return swing(t, 0.0), swing(t, 2 * np.pi / 3), course(t) + swing(t, 4 * np.pi / 3)

    return Motion("straight flight", tuple(start), velocity, attitude, float(duration))


def _geodesic_course(
    start: Sequence[float], azimuth: float, speed: float, duration: float
) -> Callable[[Numbers], Numbers]:
    """Return the course at the height of `start` over time: a Chebyshev series through a solution
    of the geodesic's differential equation.

    Along it dlat = cos(azimuth) ds / M and dazimuth = sin(azimuth) tan(lat) ds / N (Rapp 1991,
    Geometric Geodesy I). At the height h, north and east go (M + h)/M and (N + h)/N as far, which
    turns the course from the azimuth by up to 1e-5 rad per 10 km of height.
    """
    from scipy.integrate import solve_ivp

    lat0, _, alt = start

    def parts(lat: Array, angle: Array) -> tuple[float | Array, float | Array, Array, Array, Array]:
        meridian, normal = radii(lat)
        north, east = np.cos(angle) * (1 + alt / meridian), np.sin(angle) * (1 + alt / normal)
        return meridian, normal, north, east, speed / np.hypot(north, east)

    def slope(time: float, state: Array) -> Array:
        lat, angle = state
        meridian, normal, _, _, foot = parts(lat, angle)
        return np.array(
            [foot * np.cos(angle) / meridian, foot * np.sin(angle) * np.tan(lat) / normal]
        )

    def course(t: Array) -> Array:
        assert solution.sol is not None  # `dense_output` asks for it
        lat, angle = solution.sol(t)
        _, _, north, east, _ = parts(lat, angle)
        return angle + np.arctan2(
            east * np.cos(angle) - north * np.sin(angle),
            north * np.cos(angle) + east * np.sin(angle),
        )

    if abs(lat0) >= 89 * DEG:
        raise DataError(
            f"a straight flight begins at {lat0 / DEG:.6g} deg of latitude; give one below 89"
        )
    solution = solve_ivp(
        slope,
        (0.0, duration),
        (lat0, azimuth),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
        dense_output=True,
    )
    if np.abs(solution.y[0]).max() >= 89 * DEG:
        raise DataError(
            "the geodesic of a straight flight comes within 1 deg of a pole, where courses change too "
            "fast; "
            "choose another azimuth or duration"
        )
    series = Chebyshev.interpolate(course, 40, domain=[0.0, duration])
    used = 1 + np.flatnonzero(np.abs(series.coef) > 1e-15)[-1]
    series = series.truncate(used)
    return lift_complex(series, series.deriv())


def flight(
    start: Sequence[float],
    course: float,
    speed: float,
    legs: Sequence[dict[str, Any]],
    smoothing: float = 2.0,
    roughness: float = 1.0,
    name: str = "flight",
) -> Motion:
    """Return a light aircraft by `legs` from `start` (rad, rad, m), first course (rad) and speed
    (m/s).

    Turns are coordinated: bank = atan(speed * turn rate / g).

    `roughness` scales sinusoidal gusts in attitude, speed and sink rate (1: light turbulence; 0:
    smooth air).
    """
    flat = flat_legs(legs, "climb")
    _check_flight(flat, speed)
    return aircraft_motion(start, *profiles(flat, course, speed, smoothing), roughness, name)


def _check_flight(legs: list[dict[str, Any]], speed: float) -> None:
    """Raise DataError where an aircraft would stop in the air or climb faster than its speed."""
    now = speed
    for number, leg in enumerate(legs, 1):
        then = leg.get("speed", now)
        slowest = min(now, then)
        if not slowest > 0:
            raise DataError(
                f"leg {number} (repeats written out): speed is {slowest!r}; an aircraft's must be "
                f"above 0"
            )
        if not abs(leg["climb"]) <= slowest:
            raise DataError(
                f"leg {number} (repeats written out): a climb of {leg['climb']:g} m/s at a speed of "
                f"{slowest:g} m/s; "
                "it must not be larger than the speed"
            )
        now = then


def aircraft_motion(
    start: Sequence[float],
    path: MotionProfile,
    pace: MotionProfile,
    climb: MotionProfile,
    end: float,
    roughness: float,
    name: str,
) -> Motion:
    """Return the Motion of an aircraft from profiles of course (rad), speed (m/s) and height (m,
    only its slope is used)."""

    def gust(t: Times, what: str) -> Numbers:
        return roughness * waves(t, AIRCRAFT_GUSTS[what])

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        angle, v = path(t), pace(t) + gust(t, "speed")
        return v * cosine(angle), v * sine(angle), gust(t, "down") - climb.rate(t)

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        v = pace(t)
        bank = arctangent(v * path.rate(t) / G)
        return (
            bank + gust(t, "roll"),
            2.5 * DEG + arctangent(climb.rate(t) / v) + gust(t, "pitch"),
            path(t) + gust(t, "heading"),
        )

    return Motion(name, tuple(start), velocity, attitude, end)


def car(
    start: Sequence[float],
    course: float,
    legs: Sequence[dict[str, Any]],
    speed: float = 0.0,
    smoothing: float = 0.7,
    roughness: float = 1.0,
    name: str = "car",
) -> Motion:
    """Return a car by `legs`; on a `gradient` it climbs and pitches with the road; it leans out of
    turns by 3 deg per g.

    `roughness` scales the shaking of the body, which grows with the speed and ends at a stop.
    """
    path, pace, rise, end = profiles(flat_legs(legs, "gradient"), course, speed, smoothing)

    def shake(t: Times, what: str) -> Numbers:
        return roughness * (pace(t) / 15.0) * waves(t, _SHAKES[what])

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        angle, v = path(t), pace(t)
        return v * cosine(angle), v * sine(angle), shake(t, "down") - v * rise.rate(t)

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        lean = -3 * DEG * pace(t) * path.rate(t) / G
        return lean + shake(t, "roll"), arctangent(rise.rate(t)) + shake(t, "pitch"), path(t)

    return Motion(name, tuple(start), velocity, attitude, end)


def ship(
    start: Sequence[float],
    course: float,
    speed: float,
    legs: Sequence[dict[str, Any]],
    wave_height: float = 2.0,
    wave_period: float = 9.0,
    smoothing: float = 15.0,
    name: str = "ship",
) -> Motion:
    """Return a ship by `legs` in a sea of significant `wave_height` (m) and peak `wave_period` (s),
    with roll, pitch, yaw, heave and sway.

    A metre of wave height rolls it by 2.5 deg and pitches it by 0.8 deg (standard deviations 1.8
    and 0.6 deg), as a vessel of some 50 m.
    """
    check_number(wave_height, "wave height of a sea", "m", least=0)
    check_number(wave_period, "wave period of a sea", "s", above=0)
    path, pace, _, end = profiles(flat_legs(legs, None), course, speed, smoothing)
    surge = 2 * np.pi / wave_period  # from a displacement to its speed

    def sea(t: Times, size: float, phase: float) -> Numbers:
        return waves(
            t,
            [
                (size * wave_height * share, wave_period * longer, phase + p)
                for share, longer, p in _SEA
            ],
        )

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        angle, v, sway = path(t), pace(t), sea(t, 0.12 * surge, 1.0)
        return (
            v * cosine(angle) - sway * sine(angle),
            v * sine(angle) + sway * cosine(angle),
            sea(t, 0.25 * surge, 0.0),
        )

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return sea(t, 2.5 * DEG, 1.7), sea(t, 0.8 * DEG, 0.6), path(t) + sea(t, 0.4 * DEG, 2.9)

    return Motion(name, tuple(start), velocity, attitude, end)


def flat_legs(legs: Sequence[dict[str, Any]], vertical: str | None) -> list[dict[str, Any]]:
    """Return [leg] with repeats written out, each with its climb (m/s or slope) under "climb";
    `vertical` is the key of the climb, or None. Raises DataError."""
    found: list[dict[str, Any]] = []
    for number, leg in enumerate(legs, 1):
        if not isinstance(leg, dict):
            raise DataError(f"leg {number} is {leg!r}; write a table of its keys")
        check_keys(leg, leg_keys(vertical), f"leg {number}")
        if "legs" in leg or "repeat" in leg:
            if (
                set(leg) != {"legs", "repeat"}
                or not isinstance(leg["repeat"], int)
                or leg["repeat"] < 1
            ):
                raise DataError(
                    f"leg {number}: a repeat has a whole number from 1 as repeat, a list of legs, "
                    f"and nothing else"
                )
            inner = flat_legs(leg["legs"], vertical)
            _check_legs(len(found) + len(inner) * leg["repeat"])
            found += inner * leg["repeat"]
        else:
            found.append(
                {
                    "climb": leg.get(vertical, 0.0) if vertical else 0.0,
                    **{key: value for key, value in leg.items() if key != vertical},
                }
            )
    _check_legs(len(found))
    return found


def leg_keys(vertical: str | None) -> list[str]:
    """Keys of a leg; `vertical` is that of its climb, or None."""
    return [key for key in LEG_KEYS if key not in {"climb", "gradient"} - {vertical}]


def _check_legs(count: int) -> None:
    if count > MAX_LEGS:
        raise DataError(f"{count} legs, repeats written out; at most {MAX_LEGS} are flown")


def profiles(
    legs: list[dict[str, Any]], course: float, speed: float, smoothing: float
) -> tuple[MotionProfile, MotionProfile, MotionProfile, float]:
    """(course, speed, height or rise, end s): profiles along `flat_legs`; initial course rad and
    speed m/s, smoothing s. Raises DataError."""
    if not legs or not smoothing > 0 or not 0 <= speed < np.inf:
        raise DataError(
            f"a motion by legs needs a leg or more, smoothing above 0 s and a speed from 0, not "
            f"{len(legs)}, {smoothing!r}, {speed!r}"
        )
    durations, turning, changing, climbing, now = [], [], [], [], float(speed)
    for number, leg in enumerate(legs, 1):
        then, turn = leg.get("speed", now), leg.get("turn", 0.0)
        duration = leg.get("duration")
        if "bank" in leg and not 0 < leg["bank"] < 80 * DEG:
            raise DataError(
                f"leg {number} (repeats written out): a turn needs a bank between 0 and 80 deg, not "
                f"{leg['bank'] / DEG:g}"
            )
        if duration is None and "bank" in leg and turn:
            duration = max(
                abs(turn) * 0.5 * (now + then) / (G * np.tan(leg["bank"])), 6 * smoothing
            )
        if duration is None or not 0 < duration < np.inf or ("bank" in leg and "duration" in leg):
            raise DataError(
                f"leg {number} (repeats written out): it needs a duration above 0 s or, with a "
                f"turn, a bank between 0 and 80 deg"
            )
        if not 0 <= then < np.inf:
            raise DataError(
                f"leg {number} (repeats written out): speed is {then!r}; it must be 0 or more"
            )
        durations.append(duration)
        turning.append(turn / duration)
        changing.append((then - now) / duration)
        climbing.append(leg["climb"])
        now = then
    if sum(durations) > MAX_MOTION:
        raise DataError(
            f"the legs last {sum(durations):g} s; at most {MAX_MOTION:g} s (10 days) are simulated"
        )
    path, pace, climb = (
        MotionProfile.of(value, [*durations, np.inf], [*slopes, 0.0], smoothing)
        for value, slopes in ((course, turning), (speed, changing), (0.0, climbing))
    )
    return path, pace, climb, float(sum(durations))
