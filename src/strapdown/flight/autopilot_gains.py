"""Gains of the autopilot from an aircraft's trim and its linear model: each loop by pole placement,
the outer ones slower than the inner ones.

Proportional gains of the inner loops spend the travel of a control on the largest error that is
expected; damping places the poles. What the rules need of the aircraft are its derivatives; no
number belongs to one aircraft. Source: Beard & McLain (2012), sections 5.4 and 6.3, 6.4.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..checks import DataError
from ..core.compile.records import Table, rows
from .aircraft_model.modes import MODEL_STATES, Modes
from .aircraft_model.parameters import Aircraft, Parameters
from .aircraft_model.trim import SURFACES, Trim
from .autopilot import AutopilotMemory, Gains, Pilot, Segment, Steering

RAD_PER_DEG = math.pi / 180
ROLL_ERROR, PITCH_ERROR, SPEED_ERROR = 45 * RAD_PER_DEG, 15 * RAD_PER_DEG, 0.2
"""Errors that spend the travel of aileron and elevator from trim to the nearer stop; and half
the throttle's travel, as a share of the airspeed."""
DAMPING, DUTCH_ROLL = 0.9, 0.7
"""Damping ratios of roll and pitch, and of the Dutch roll that the yaw damper brings about where
it is lower."""
SEPARATION, FOLLOWING = 5.0, 3.0
"""Factors by which course is slower than roll, height than pitch; and following a line than holding a
course."""
# squared proportional rate over the integral one: two real poles, 6 % overshoot of a step at most
INTEGRAL = 8.0
ROLL_MAX, PITCH_MAX, CLIMB_MAX, COURSE_ZONE = (
    45 * RAD_PER_DEG,
    20 * RAD_PER_DEG,
    8 * RAD_PER_DEG,
    20 * RAD_PER_DEG,
)
MIN_TRAVEL = 0.1 * RAD_PER_DEG  # of aileron and elevator from their trim


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


def make_steering(
    gains: Gains,
    trim: Trim,
    parameters: Parameters,
    route: Table[Segment],
    wind: Sequence[float],
) -> Steering:
    """The Steering of an aircraft from its trim along a route from the trim's origin, with the
    scales and the gravity of its parameters, in the steady wind (m/s, NED) that it is told."""
    (pilot,) = pilots = rows(Pilot, 1)
    pilot.course_zone, pilot.height_zone = COURSE_ZONE, CLIMB_MAX / gains.height_p
    pilot.max_roll, pilot.max_pitch = ROLL_MAX, PITCH_MAX
    pilot.north_scale, pilot.east_scale = (
        1 / parameters.latitude_rate,
        1 / parameters.longitude_rate,
    )
    pilot.origin_lat, pilot.origin_lon, _ = trim.origin
    pilot.gravity, pilot.trim_pitch, pilot.trim[:] = parameters.gravity, trim.pitch, trim.commands
    for i, control in enumerate(SURFACES):
        pilot.low[i], pilot.high[i] = (
            trim.aircraft[f"{control}_min"],
            trim.aircraft[f"{control}_max"],
        )
    chosen = rows(Gains, 1)
    chosen[0] = gains
    return Steering(chosen, pilots, rows(AutopilotMemory, 1), route, np.array(wind))


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
    if not left > MIN_TRAVEL:
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
