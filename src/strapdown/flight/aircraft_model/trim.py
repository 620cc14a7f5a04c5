"""Steady flight: the attitude and the controls at which an aircraft climbs and turns without
change."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from ...checks import DataError, check_array, check_number
from ...core.compile.records import copy_row, rows
from ...data.value import Value
from ...typing import Array, File
from .dynamics import CONTROLS, LLA, OMEGA, QUATERNION, STATE, VELOCITY, Loads, evaluate
from .parameters import Aircraft, Parameters, aircraft as find, checked_origin

SURFACES = ("elevator", "aileron", "rudder", "throttle")
_ROUNDS, _ENOUGH = 60, 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Trim(Value):
    """Steady flight of `aircraft` through the air: what was asked, and what it takes; SI and rad.

    state (17,) and commands (4,) start a flight that stays as it is: position is the origin,
    velocity includes the wind. On the geodetic Earth omega_ib has its rotation and transport rate;
    the balance itself is that of a flat Earth with the origin's gravity. `residual` is the largest
    acceleration (m/s^2 or rad/s^2) that is left of it.
    """

    aircraft: Aircraft
    airspeed: float
    climb: float  # flight-path angle against the air
    radius: float  # of the turn through the air, m; positive to the right, infinite when straight
    origin: tuple[float, float, float]
    earth: str
    alpha: float
    roll: float
    pitch: float
    turn_rate: float
    residual: float
    state: Array = field(compare=False)
    commands: Array = field(compare=False)
    loads: Loads = field(compare=False)

    def __hash__(self) -> int:  # type: ignore[override]  # its arrays follow from the rest
        return hash(tuple(getattr(self, each.name) for each in fields(self) if each.compare))

    def table(self) -> dict[str, float]:
        """{"airspeed, m/s": ...}: the flight and its controls, angles in deg, propeller speed in
        rpm."""
        degrees = np.degrees(
            [self.climb, self.alpha, self.roll, self.pitch, self.turn_rate, *self.commands[:3]]
        )
        names = (
            "climb, deg",
            "alpha, deg",
            "roll, deg",
            "pitch, deg",
            "turn rate, deg/s",
            "elevator, deg",
            "aileron, deg",
            "rudder, deg",
        )
        return {
            "airspeed, m/s": self.airspeed,
            **dict(zip(names, degrees.tolist())),
            "throttle": float(self.commands[3]),
            "thrust, N": float(self.loads.thrust),
            "propeller, rpm": float(self.loads.propeller) * 30 / math.pi,
        }

    def __repr__(self) -> str:
        turn = "" if math.isinf(self.radius) else f", turning at {self.radius:g} m"
        return f"Trim({self.aircraft.name} at {self.airspeed:g} m/s, climb {math.degrees(self.climb):g} deg{turn}: residual {self.residual:.1e})"


def trim(
    aircraft: Aircraft | File,
    airspeed: float,
    climb: float = 0.0,
    radius: float = math.inf,
    origin: Iterable[float] = (0.0, 0.0, 0.0),
    course: float = 0.0,
    wind: Sequence[float] | Array = (0.0, 0.0, 0.0),
    earth: str = "geodetic",
) -> Trim:
    """Return the controls and the attitude of steady flight without sideslip.

    Parameters
    ----------
    aircraft : str, path or Aircraft
        The aircraft, its name or its file.
    airspeed : float
        m/s.
    climb : float
        Flight-path angle against the air, rad.
    radius : float
        Of the turn through the air, m: positive to the right, negative to the left, inf straight.
    origin : iterable of float, shape (3,)
        Where it flies: latitude and longitude in rad, height in m.
    course : float
        Where to through the air, rad.
    wind : array_like, shape (3,)
        Steady, NED, m/s.
    earth : {"geodetic", "flat"}
        Rotating ellipsoid, or a plane that touches it at the origin.

    Returns
    -------
    Trim
        State and commands that start a flight that stays as it is.

    Raises
    ------
    DataError
        Where it cannot be trimmed, with what stands against it.

    References
    ----------
    Beard & McLain (2012), "Small Unmanned Aircraft", chapter 5.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.flight.trim("aerosonde", 25.0).residual < 1e-6
    True
    """
    aircraft = find(aircraft)
    _check(airspeed, climb, radius, course, wind)
    origin = checked_origin(origin)
    turn_rate = 0.0 if math.isinf(radius) else airspeed * math.cos(climb) / radius
    balance = _Balance(
        aircraft.parameters("flat", origin), origin, airspeed, climb, turn_rate, course
    )
    z, residual = _solve(balance, _guess(balance.parameters.gravity, aircraft, airspeed, turn_rate))
    where = (
        f"aircraft {aircraft.name!r} cannot be trimmed at {airspeed:g} m/s, climb "
        f"{math.degrees(climb):.3g} deg" + ("" if math.isinf(radius) else f", radius {radius:g} m")
    )
    _refuse(balance, aircraft, z, residual, where)
    state, (roll, pitch, _) = balance.state(z)
    loads: Loads = copy_row(balance.loads)
    state[VELOCITY] += wind
    if earth != "flat":
        state[OMEGA] += _frame_rate(aircraft.parameters(earth, origin), state)
    return Trim(
        aircraft,
        float(airspeed),
        float(climb),
        float(radius),
        origin,
        earth,
        float(z[0]),
        roll,
        pitch,
        turn_rate,
        residual,
        state,
        z[2:].copy(),
        loads,
    )


def quaternion(roll: float, pitch: float, heading: float) -> Array:
    """q_nb, scalar first and not negative, of Euler angles in rad (ZYX)."""
    (a, b, c), (x, y, z) = (
        np.cos([roll / 2, pitch / 2, heading / 2]),
        np.sin([roll / 2, pitch / 2, heading / 2]),
    )
    q = np.array(
        [a * b * c + x * y * z, x * b * c - a * y * z, a * y * c + x * b * z, a * b * z - x * y * c]
    )
    return q if q[0] >= 0 else -q


class _Balance:
    """The unbalanced accelerations of steady flight as a function of alpha, roll and the four
    controls."""

    def __init__(
        self,
        parameters: Parameters,
        origin: tuple[float, float, float],
        airspeed: float,
        climb: float,
        turn_rate: float,
        course: float,
    ) -> None:
        self.parameters, self.origin, self.airspeed, self.climb, self.turn_rate, self.course = (
            parameters,
            origin,
            airspeed,
            climb,
            turn_rate,
            course,
        )
        self.rates, self.calm, self.evaluate = np.zeros(19), np.zeros(9), evaluate
        self.loads: Loads
        (self.loads,) = rows(Loads, 1)

    def state(self, z: Array) -> tuple[Array, tuple[float, float, float]]:
        """State and Euler angles in which the air comes with angle of attack z[0] and no
        sideslip, banked by z[1], with controls z[2:]."""
        V, alpha, roll = self.airspeed, z[0], z[1]
        along, aside, below = (
            V * math.cos(alpha),
            -V * math.sin(alpha) * math.sin(roll),
            V * math.sin(alpha) * math.cos(roll),
        )
        pitch = math.atan2(below, along) + math.asin(
            max(-1.0, min(1.0, V * math.sin(self.climb) / math.hypot(along, below)))
        )
        ahead = along * math.cos(pitch) + below * math.sin(pitch)
        heading = self.course - math.atan2(aside, ahead)
        state = STATE.zeros()
        state[LLA] = self.origin
        state[VELOCITY] = (
            V * math.cos(self.climb) * math.cos(self.course),
            V * math.cos(self.climb) * math.sin(self.course),
            -V * math.sin(self.climb),
        )
        state[QUATERNION] = quaternion(roll, pitch, heading)
        state[OMEGA] = self.turn_rate * np.array(
            [-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)]
        )
        state[CONTROLS] = z[2:]
        return state, (roll, pitch, heading)

    def max_thrust(self, z: Array, throttle: float) -> float:
        """Thrust, N, at the most that `throttle` may be."""
        self(np.r_[z[:5], throttle])
        return float(self.loads.thrust)

    def __call__(self, z: Array) -> Array:
        state, _ = self.state(z)
        self.evaluate(self.parameters, state, self.calm, self.rates, self.loads)
        turning = self.turn_rate * np.array([-state[4], state[3], 0.0])
        return np.r_[self.rates[3:6] - turning, self.rates[10:13]]


def _guess(gravity: float, aircraft: Aircraft, airspeed: float, turn_rate: float) -> Array:
    """Where to begin: lift that carries the weight in the turn, elevator for no pitching moment,
    half throttle."""
    roll = math.atan(airspeed * turn_rate / gravity)
    pressure = 0.5 * (aircraft["density"] or 1.0) * airspeed**2 * aircraft["area"]
    alpha = (aircraft["mass"] * gravity / math.cos(roll) / pressure - aircraft["C_L_0"]) / aircraft[
        "C_L_alpha"
    ]
    alpha = min(max(alpha, -0.2), 0.9 * aircraft["stall_alpha"])
    elevator = -(aircraft["C_m_0"] + aircraft["C_m_alpha"] * alpha) / (
        aircraft["C_m_elevator"] or 1.0
    )
    return np.array([alpha, roll, elevator, 0.0, 0.0, 0.5])


def _solve(balance: _Balance, z: Array) -> tuple[Array, float]:
    """Newton's method with halved steps: (z, largest acceleration left)."""
    f = balance(z)
    for _ in range(_ROUNDS):
        if np.abs(f).max() < 1e-13:
            break
        J = np.stack([(balance(z + h) - balance(z - h)) / 2e-6 for h in 1e-6 * np.eye(6)], axis=1)
        if not np.isfinite(J).all():
            break
        change, share = np.linalg.lstsq(J, -f, rcond=None)[0], 1.0
        while share > 1e-6:
            ahead = balance(z + share * change)
            if np.abs(ahead).max() < np.abs(f).max():
                break
            share *= 0.5
        else:
            break
        z, f = z + share * change, ahead
    return z, float(np.abs(balance(z)).max())


def _refuse(balance: _Balance, aircraft: Aircraft, z: Array, residual: float, where: str) -> None:
    """Raise DataError unless z is a balance within the stall and the end stops."""
    attack, stall = (f"{math.degrees(angle):.1f} deg" for angle in (z[0], aircraft["stall_alpha"]))
    if not residual < _ENOUGH:
        if (thrust := balance.max_thrust(z, aircraft["throttle_max"])) <= 0:
            raise DataError(
                f"{where}: at full throttle its propeller gives {thrust:.2g} N, no thrust; check "
                f"voltage, propeller and motor, "
                "fly slower, or descend"
            )
        raise DataError(
            f"{where}: at an angle of attack of {attack} (stall at {stall}) {residual:.2g} m/s^2 or "
            f"rad/s^2 are left over; fly faster, "
            "turn wider, or climb or descend less steeply"
        )
    if abs(z[0]) > aircraft["stall_alpha"]:
        raise DataError(
            f"{where}: it needs an angle of attack of {attack}, beyond the stall at {stall}; fly "
            f"faster, turn wider, or climb or descend "
            "less steeply"
        )
    for name, value in zip(SURFACES, z[2:]):
        low, high = aircraft[f"{name}_min"], aircraft[f"{name}_max"]
        if not low <= value <= high:

            def show(x: float, name: str = name) -> str:
                return f"{x:.2f}" if name == "throttle" else f"{math.degrees(x):.1f} deg"

            remedy = {
                "throttle": "fly slower, climb less or turn wider"
                if value > high
                else "descend less steeply or fly faster",
                "elevator": "fly faster or turn wider" if value < low else "fly slower",
            }.get(name, "fly faster or turn wider")
            raise DataError(
                f"{where}: it needs {name} {show(value)}, beyond its stop at "
                f"{show(high if value > high else low)}; {remedy}"
            )


def _frame_rate(parameters: Parameters, state: Array) -> Array:
    """omega_in in body axes (rad/s) at a state, from the attitude's rate without any body rate."""
    rates, still, loads = np.zeros(19), state.copy(), rows(Loads, 1)
    still[OMEGA] = 0.0
    evaluate(parameters, still, np.zeros(9), rates, loads[0])
    a, b, c, d = state[QUATERNION]
    to_body = np.array([[-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]])
    return -2 * to_body @ rates[6:10]


def _check(
    airspeed: float, climb: float, radius: float, course: float, wind: Sequence[float] | Array
) -> None:
    check_number(airspeed, "trim: airspeed", "m/s", above=0, below=500)
    check_number(climb, "trim: climb, a flight-path angle within 57 deg,", "rad", least=-1, most=1)
    check_number(course, "trim: course", "rad")
    check_array(wind, "trim: wind", (3,), what="numbers: north, east, down, m/s")
    if math.isnan(check_number(radius, "trim: radius", "m", infinite=True)) or abs(radius) < 1:
        raise DataError(
            f"trim: radius is {radius:g} m; give 1 m or more, negative to the left, infinite for "
            f"straight flight"
        )
