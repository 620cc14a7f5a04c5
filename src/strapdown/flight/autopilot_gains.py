"""Gains of the autopilot from an aircraft's trim and its linear model: each loop by pole placement,
the outer ones slower than the inner ones.

Proportional gains of the inner loops spend the travel of a control on the largest error that is
expected; damping places the poles. What the rules need of the aircraft are its derivatives; no
number belongs to one aircraft. Source: Beard & McLain (2012), sections 5.4 and 6.3, 6.4.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..checks import DataError
from ..typing import Array
from . import autopilot as p
from .aircraft.modes import MODEL_STATES, Modes
from .aircraft.parameters import Aircraft
from .aircraft.trim import Trim

RAD_PER_DEG = math.pi / 180
ROLL_ERROR, PITCH_ERROR, SPEED_ERROR = 45 * RAD_PER_DEG, 15 * RAD_PER_DEG, 0.2
"""Errors that spend the travel of aileron and elevator from trim to the nearer stop; and half
the throttle's travel, as a share of the airspeed."""
DAMPING, DUTCH_ROLL = 0.9, 0.7
"""Damping ratios of roll and pitch, and of the Dutch roll that the yaw damper brings about where
it is lower."""
SEPARATION, FOLLOWING = 5.0, 3.0
"""How much slower course is than roll, height than pitch; and following a line than holding a
course."""
# squared proportional rate over the integral one: two real poles, 6 % overshoot of a step at most
INTEGRAL = 8.0
ROLL_MOST, PITCH_MOST, CLIMB_MOST, COURSE_ZONE = (
    45 * RAD_PER_DEG,
    20 * RAD_PER_DEG,
    8 * RAD_PER_DEG,
    20 * RAD_PER_DEG,
)
LEAST_TRAVEL = 0.1 * RAD_PER_DEG  # of aileron and elevator from their trim


class Gains(NamedTuple):
    """Gains of the loops, SI and radians; signs are those of the controls' effects."""

    roll_p: float  # aileron per rad of roll
    roll_d: float  # aileron per rad/s
    course_p: float  # rad/s of course per rad
    course_i: float  # 1/s^2
    pitch_p: float  # elevator per rad of pitch
    pitch_d: float  # elevator per rad/s
    height_p: float  # rad of climb per m
    height_i: float  # rad of climb per m s
    airspeed_p: float  # throttle per m/s
    airspeed_i: float  # throttle per m
    yaw_d: float  # rudder per rad/s beside the rate of a coordinated turn
    line: float  # 1/s: how fast a line is approached
    turn_pitch: float  # rad of pitch per (1 - cos roll)
    turn_elevator: float  # rad of elevator per (1/cos roll - 1)


def gains(aircraft: Aircraft, trim: Trim, modes: Modes, gravity: float) -> Gains:
    """The Gains of an Aircraft from its Trim and Modes (aircraft.trim, aircraft.modes). Raises
    DataError where a control has no effect."""
    A, B, V = modes.A, modes.B, trim.airspeed
    row = {name: i for i, name in enumerate(MODEL_STATES)}

    def state(to: str, of: str) -> float:
        return float(A[row[to], row[of]])

    def control(i: int) -> Callable[[str], float]:
        return lambda to: float(B[row[to], i])

    elevator, aileron, rudder, throttle = (control(i) for i in range(4))
    for name, effect in (
        ("elevator", elevator("q")),
        ("aileron", aileron("p")),
        ("throttle", throttle("u")),
    ):
        if not abs(effect) > 1e-6:
            raise DataError(
                f"aircraft {aircraft.name!r}: the {name} has no effect in trim at {V:g} m/s; an "
                f"autopilot cannot fly it"
            )
    roll_p, roll_d, roll_rate = _inner(
        -state("p", "p"), 0.0, aileron("p"), _travel(aircraft, trim, 1, "aileron") / ROLL_ERROR
    )
    pitch_p, pitch_d, pitch_rate = _inner(
        -state("q", "q"),
        -state("q", "w") * V,
        elevator("q"),
        _travel(aircraft, trim, 0, "elevator") / PITCH_ERROR,
    )
    course, height = roll_rate / SEPARATION, min(pitch_rate, -state("w", "w")) / SEPARATION
    speed_p = 0.5 / (SPEED_ERROR * V)
    speed = throttle("u") * speed_p - state("u", "u")
    lift = gravity / (-state("w", "w") * V)  # rad of angle of attack that carry the weight
    stiffness = state("q", "w") * V * lift + 2 * state("q", "q") * gravity / V
    return Gains(
        roll_p,
        roll_d,
        course,
        course**2 / INTEGRAL,
        pitch_p,
        pitch_d,
        height / V,
        height**2 / INTEGRAL / V,
        speed_p,
        speed**2 / INTEGRAL / throttle("u"),
        _yaw_damper(state, rudder("r"), V),
        course / FOLLOWING,
        lift - trim.alpha,
        -stiffness / elevator("q"),
    )


def pilot_array(
    gains: Gains,
    aircraft: Aircraft,
    trim: Trim,
    origin: Sequence[float],
    scales: tuple[float, float],
    gravity: float,
) -> Array:
    """What autopilot.steer reads, (PILOT_SIZE,): Gains, limits, origin of the route (rad, rad,
    m), metres per rad north and east, gravity (m/s^2)."""
    pilot = np.zeros(p.PILOT_SIZE)
    for name, place in (
        ("roll_p", p.ROLL_P),
        ("roll_d", p.ROLL_D),
        ("course_p", p.COURSE_P),
        ("course_i", p.COURSE_I),
        ("pitch_p", p.PITCH_P),
        ("pitch_d", p.PITCH_D),
        ("height_p", p.HEIGHT_P),
        ("height_i", p.HEIGHT_I),
        ("airspeed_p", p.SPEED_P),
        ("airspeed_i", p.SPEED_I),
        ("yaw_d", p.YAW_D),
        ("line", p.LINE),
        ("turn_pitch", p.TURN_PITCH),
        ("turn_elevator", p.TURN_ELEVATOR),
    ):
        pilot[place] = getattr(gains, name)
    pilot[p.COURSE_ZONE], pilot[p.HEIGHT_ZONE] = COURSE_ZONE, CLIMB_MOST / gains.height_p
    pilot[p.ROLL_MOST], pilot[p.PITCH_MOST] = ROLL_MOST, PITCH_MOST
    pilot[p.NORTH_SCALE], pilot[p.EAST_SCALE], pilot[p.ORIGIN_LAT], pilot[p.ORIGIN_LON] = (
        *scales,
        *origin[:2],
    )
    pilot[p.GRAVITY], pilot[p.TRIM_PITCH] = gravity, trim.pitch
    pilot[p.TRIM : p.TRIM + 4] = trim.commands
    for i, control in enumerate(("elevator", "aileron", "rudder", "throttle")):
        pilot[p.LOW + i], pilot[p.HIGH + i] = aircraft[f"{control}_min"], aircraft[f"{control}_max"]
    return pilot


def _inner(
    damping: float, stiffness: float, effect: float, gain: float
) -> tuple[float, float, float]:
    """(proportional gain, damping gain, bandwidth in rad/s) of angle'' = -damping angle' -
    stiffness angle + effect control."""
    p_gain = math.copysign(gain, effect)
    square = max(stiffness + effect * p_gain, effect * p_gain)
    lacking = 2 * DAMPING * math.sqrt(square) - damping
    d_gain = max(lacking, 0.0) / effect
    half = 0.5 * (damping + effect * d_gain)
    root = math.sqrt(max(half * half - square, 0.0))
    return p_gain, d_gain, square / (half + root)  # of two real poles the slower one


def _travel(aircraft: Aircraft, trim: Trim, i: int, control: str) -> float:
    """rad from the trim's position of a control to its nearer stop. Raises DataError where it
    stands there."""
    left = float(
        min(
            aircraft[f"{control}_max"] - trim.commands[i],
            trim.commands[i] - aircraft[f"{control}_min"],
        )
    )
    if not left > LEAST_TRAVEL:
        raise DataError(
            f"aircraft {aircraft.name!r}: in trim at {trim.airspeed:g} m/s the {control} stands at "
            f"its stop, and no autopilot can "
            "move it both ways; fly at another airspeed"
        )
    return left


def _yaw_damper(state: Callable[[str, str], float], effect: float, V: float) -> float:
    """Rudder per rad/s of yaw that gives the Dutch roll its damping; 0 where it has it, or where
    there is no rudder."""
    stiffness = max(state("r", "v") * V + state("v", "v") * state("r", "r"), 0.0)
    lacking = 2 * DUTCH_ROLL * math.sqrt(stiffness) + state("v", "v") + state("r", "r")
    return max(lacking, 0.0) / effect if abs(effect) > 1e-6 else 0.0
