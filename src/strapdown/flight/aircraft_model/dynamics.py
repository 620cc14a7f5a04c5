"""Motion of the aircraft: six degrees of freedom over a rotating ellipsoidal or a flat Earth,
integrated by RK4 with the increments of an ideal IMU.

Velocity is integrated in the navigation frame, never airspeed and flow angles: it has no
singularity at rest or at any attitude.
"""

import math
from typing import Annotated

import numpy as np

from ...checks import DataError, check_number
from ...core.compile.jit import helper, inline, kernel
from ...core.compile.records import row_of
from ...core.compile.signatures import REAL, reals, signature
from ...core.loop.contract import Imu, Slots
from ...core.mathematics.earth import gravity, gravity_north, place, rotation_rates
from ...typing import Array, ArrayLike, File
from .forces import air_data, density, forces, propeller
from .parameters import (
    PARAMETERS,
    Aircraft,
    Parameters,
    aircraft as find,
    checked_array,
)

STATE = Slots()
"""Slots of the state of an aircraft."""
LLA = STATE.array("LLA", 3)  # latitude, longitude (rad), height (m)
VELOCITY = STATE.array("VELOCITY", 3)  # v_n, m/s
QUATERNION = STATE.array("QUATERNION", 4)  # q_nb
OMEGA = STATE.array("OMEGA", 3)  # omega_ib_b, rad/s
CONTROLS = STATE.array("CONTROLS", 4)  # positions of elevator, aileron, rudder (rad) and throttle
STATE_SIZE = STATE.size


class Loads:
    """Result of `evaluate`: forces and moments, air data and propeller."""

    force: Annotated[Array, 3]  # N, body
    moment: Annotated[Array, 3]  # N m, body
    airspeed: float  # m/s
    alpha: float  # angle of attack, rad
    beta: float  # sideslip, rad
    propeller: float  # its speed, rad/s
    thrust: float  # N
    torque: float  # of the propeller, N m


LOADS = row_of(Loads)
MAX_RK4_STEP = 0.01
"""s; a longer step is integrated in pieces."""
MAX_HELD = 1.0
"""s; commands and wind that are held for longer are none of a flight."""


@helper
def _against_air(
    x: tuple[float, ...], wind: Array, ie_n: float, ie_d: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, ...]]:
    """Velocity (m/s) and rates (rad/s) against the air in body axes, and C_nb row by row, of the 13
    numbers of motion x.

    Wind is steady NED velocity, gust velocity and gust rates in body axes; the air turns with the
    Earth, by (ie_n, 0, ie_d) rad/s.
    """
    a, b, c, d = x[6], x[7], x[8], x[9]
    c00, c01, c02 = a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)
    c10, c11, c12 = 2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)
    c20, c21, c22 = 2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d
    v0, v1, v2 = x[3] - wind[0], x[4] - wind[1], x[5] - wind[2]
    velocity = (
        c00 * v0 + c10 * v1 + c20 * v2 - wind[3],
        c01 * v0 + c11 * v1 + c21 * v2 - wind[4],
        c02 * v0 + c12 * v1 + c22 * v2 - wind[5],
    )
    rates = (
        x[10] - wind[6] - c00 * ie_n - c20 * ie_d,
        x[11] - wind[7] - c01 * ie_n - c21 * ie_d,
        x[12] - wind[8] - c02 * ie_n - c22 * ie_d,
    )
    return velocity, rates, (c00, c01, c02, c10, c11, c12, c20, c21, c22)


@helper
def _earth(parameters: Parameters, x: tuple[float, ...]) -> tuple[float, ...]:
    """Rates of lat, lon, height to the m/s; omega_ie_n (north, down); omega_in_n (north, east,
    down), rad/s; gravity (north, down), m/s^2."""
    if parameters.rotates == 0:
        return (
            parameters.latitude_rate,
            parameters.longitude_rate,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            parameters.gravity,
        )
    sine, cosine, M, N = place(x[0], x[2])
    ie_n, ie_d, w0, w1, w2 = rotation_rates(x[3], x[4], sine, cosine, M, N)
    return (
        1 / M,
        1 / (N * cosine),
        ie_n,
        ie_d,
        w0,
        w1,
        w2,
        gravity_north(sine, cosine, x[2]),
        gravity(sine, x[2]),
    )


@helper
def _derivative(
    parameters: Parameters, x: tuple[float, ...], controls: tuple[float, ...], wind: Array
) -> tuple[float, ...]:
    """Rates of the 13 numbers of motion, then omega_ib_b and f_ib_b: the rates of the
    increments."""
    lat_rate, lon_rate, ie_n, ie_d, w0, w1, w2, north, g = _earth(parameters, x)
    velocity, rates, C = _against_air(x, wind, ie_n, ie_d)
    c00, c01, c02, c10, c11, c12, c20, c21, c22 = C
    F_x, F_y, F_z, M_x, M_y, M_z = forces(
        parameters, density(parameters, x[2]), velocity, rates, controls
    )
    p, q, r = x[10], x[11], x[12]
    f0, f1, f2 = F_x / parameters.mass, F_y / parameters.mass, F_z / parameters.mass
    v0, v1, v2 = x[3], x[4], x[5]
    o0, o1, o2 = w0 + ie_n, w1, w2 + ie_d
    a0 = c00 * f0 + c01 * f1 + c02 * f2 - o1 * v2 + o2 * v1 + north
    a1 = c10 * f0 + c11 * f1 + c12 * f2 - o2 * v0 + o0 * v2
    a2 = c20 * f0 + c21 * f1 + c22 * f2 - o0 * v1 + o1 * v0 + g
    n0, n1, n2 = (
        p - c00 * w0 - c10 * w1 - c20 * w2,
        q - c01 * w0 - c11 * w1 - c21 * w2,
        r - c02 * w0 - c12 * w1 - c22 * w2,
    )
    a, b, c, d = 0.5 * x[6], 0.5 * x[7], 0.5 * x[8], 0.5 * x[9]
    hx, hy, hz = (
        parameters.J_x * p - parameters.J_xz * r,
        parameters.J_y * q,
        parameters.J_z * r - parameters.J_xz * p,
    )
    t0, t1, t2 = M_x - q * hz + r * hy, M_y - r * hx + p * hz, M_z - p * hy + q * hx
    return (
        lat_rate * v0,
        lon_rate * v1,
        -v2,
        a0,
        a1,
        a2,
        -b * n0 - c * n1 - d * n2,
        a * n0 + c * n2 - d * n1,
        a * n1 + d * n0 - b * n2,
        a * n2 + b * n1 - c * n0,
        parameters.inverse_xx * t0 + parameters.inverse_xz * t2,
        parameters.inverse_yy * t1,
        parameters.inverse_xz * t0 + parameters.inverse_zz * t2,
        p,
        q,
        r,
        f0,
        f1,
        f2,
    )


@inline
def _ahead(x: tuple[float, ...], k: tuple[float, ...], h: float) -> tuple[float, ...]:
    """x + h k of 19 numbers."""
    return (
        x[0] + h * k[0],
        x[1] + h * k[1],
        x[2] + h * k[2],
        x[3] + h * k[3],
        x[4] + h * k[4],
        x[5] + h * k[5],
        x[6] + h * k[6],
        x[7] + h * k[7],
        x[8] + h * k[8],
        x[9] + h * k[9],
        x[10] + h * k[10],
        x[11] + h * k[11],
        x[12] + h * k[12],
        x[13] + h * k[13],
        x[14] + h * k[14],
        x[15] + h * k[15],
        x[16] + h * k[16],
        x[17] + h * k[17],
        x[18] + h * k[18],
    )


@helper
def _actuator_position(
    low: float, high: float, rate: float, lag: float, position: float, command: float, h: float
) -> float:
    """Where an actuator is after h s: first-order lag towards the command within its end stops,
    at no more than its rate; exact."""
    command = min(max(command, low), high)
    error, slow = command - position, rate * lag
    if abs(error) > slow:
        seconds = (abs(error) - slow) / rate
        if seconds >= h:
            return position + math.copysign(rate * h, error)
        h -= seconds
        error = math.copysign(slow, error)
    return command - error * math.exp(-h / lag) if lag > 0 else command


@helper
def actuator_positions(
    parameters: Parameters, c: tuple[float, ...], commands: Array, h: float
) -> tuple[float, float, float, float]:
    """Positions of the four controls after h s, from positions `c` (a tuple) towards `commands`
    (4,)."""
    p = parameters
    return (
        _actuator_position(
            p.elevator_min, p.elevator_max, p.elevator_rate, p.elevator_lag, c[0], commands[0], h
        ),
        _actuator_position(
            p.aileron_min, p.aileron_max, p.aileron_rate, p.aileron_lag, c[1], commands[1], h
        ),
        _actuator_position(
            p.rudder_min, p.rudder_max, p.rudder_rate, p.rudder_lag, c[2], commands[2], h
        ),
        _actuator_position(
            p.throttle_min, p.throttle_max, p.throttle_rate, p.throttle_lag, c[3], commands[3], h
        ),
    )


STEP = signature(
    "step",
    parameters=PARAMETERS,
    state=reals(STATE_SIZE),
    commands=reals(4),
    wind=reals(9),
    dt=REAL,
    increments=reals(6),
)
EVALUATE = signature(
    "evaluate",
    parameters=PARAMETERS,
    state=reals(STATE_SIZE),
    wind=reals(9),
    rates=reals(19),
    loads=LOADS,
)


@kernel(STEP)
def step(
    parameters: Parameters, state: Array, commands: Array, wind: Array, dt: float, increments: Array
) -> None:
    """Advance `state` (STATE_SIZE,) by dt s under held `commands` (4,) and `wind` (9,);
    `increments` (6,) gets the integrals of omega_ib_b and f_ib_b.

    Wind is steady velocity NED (m/s), gust velocity (m/s) and gust rates (rad/s) in body axes. RK4
    in pieces of at most MAX_RK4_STEP; the actuators, which are linear but for their rate limit,
    are exact. Longitude stays in [-pi, pi], the quaternion's scalar part at 0 or above.
    """
    pieces = max(1, int(math.ceil(dt / MAX_RK4_STEP - 1e-9)))
    h = dt / pieces
    x: tuple[float, ...] = (
        state[0],
        state[1],
        state[2],
        state[3],
        state[4],
        state[5],
        state[6],
        state[7],
        state[8],
        state[9],
        state[10],
        state[11],
        state[12],
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    c0 = (state[13], state[14], state[15], state[16])
    for _ in range(pieces):
        c1 = actuator_positions(parameters, c0, commands, 0.5 * h)
        c2 = actuator_positions(parameters, c1, commands, 0.5 * h)
        k1 = _derivative(parameters, x, c0, wind)
        k2 = _derivative(parameters, _ahead(x, k1, 0.5 * h), c1, wind)
        k3 = _derivative(parameters, _ahead(x, k2, 0.5 * h), c1, wind)
        k4 = _derivative(parameters, _ahead(x, k3, h), c2, wind)
        x = _ahead(_ahead(_ahead(_ahead(x, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6)
        c0 = c2
    norm = math.copysign(1 / math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9]), x[6])
    lon = x[1] - math.copysign(2 * math.pi, x[1]) if abs(x[1]) > math.pi else x[1]
    state[0], state[1], state[2], state[3], state[4], state[5] = x[0], lon, x[2], x[3], x[4], x[5]
    state[6], state[7], state[8], state[9] = norm * x[6], norm * x[7], norm * x[8], norm * x[9]
    state[10], state[11], state[12] = x[10], x[11], x[12]
    state[13], state[14], state[15], state[16] = c0
    increments[0], increments[1], increments[2], increments[3], increments[4], increments[5] = (
        x[13],
        x[14],
        x[15],
        x[16],
        x[17],
        x[18],
    )


@kernel(EVALUATE)
def evaluate(parameters: Parameters, state: Array, wind: Array, rates: Array, loads: Loads) -> None:
    """At one instant: `rates` (19,) of the 13 numbers of motion and of the increments
    (omega_ib_b, f_ib_b), and the Loads."""
    x = (
        state[0],
        state[1],
        state[2],
        state[3],
        state[4],
        state[5],
        state[6],
        state[7],
        state[8],
        state[9],
        state[10],
        state[11],
        state[12],
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    controls = (state[13], state[14], state[15], state[16])
    k = _derivative(parameters, x, controls, wind)
    for i in range(19):
        rates[i] = k[i]
    _, _, ie_n, ie_d, _, _, _, _, _ = _earth(parameters, x)
    velocity, turning, _ = _against_air(x, wind, ie_n, ie_d)
    rho = density(parameters, state[2])
    force = forces(parameters, rho, velocity, turning, controls)
    for i in range(3):
        loads.force[i], loads.moment[i] = force[i], force[3 + i]
    loads.airspeed, loads.alpha, loads.beta, _, _ = air_data(velocity[0], velocity[1], velocity[2])
    loads.thrust, loads.torque, loads.propeller = propeller(
        parameters, rho, loads.airspeed, state[16]
    )


def checked_state(state: ArrayLike, what: str) -> Array:
    """`state` as a new array (STATE_SIZE,), finite and with a unit quaternion. Raises DataError
    naming `what` is given it."""
    state = checked_array(state, (STATE_SIZE,), f"{what}: state").copy()
    norm = float(np.linalg.norm(state[QUATERNION]))
    if abs(norm - 1) > 1e-6:
        raise DataError(
            f"{what}: the quaternion of the state, numbers {QUATERNION.start} to {QUATERNION.stop - 1}, has length "
            f"{norm:g}; make it a unit one"
        )
    return state


def _winds(wind: ArrayLike | None, n: int) -> Array:
    """(n, 9) of no wind, (9,) or (n, 9). Raises DataError."""
    if wind is None or np.ndim(wind) == 1:
        return np.tile(
            checked_array(np.zeros(9) if wind is None else wind, (9,), "respond: wind"), (n, 1)
        )
    return checked_array(wind, (n, 9), "respond: wind")


def respond(
    aircraft: Aircraft | File,
    state: ArrayLike,
    commands: ArrayLike,
    dt: float,
    earth: str = "geodetic",
    wind: ArrayLike | None = None,
) -> tuple[Array, Imu]:
    """Fly `commands` (n, 4), each held for dt s, from `state` (STATE_SIZE,): states (n + 1,
    STATE_SIZE) and the Imu of an ideal IMU.

    `aircraft` is an Aircraft or its name; wind: none, (9,) or (n, 9), as for `step`; dt: at most
    MAX_HELD. The flat Earth touches WGS-84 where the flight begins. Raises DataError, also
    where the motion does not stay finite.
    """
    aircraft, commands, state = (
        find(aircraft),
        checked_array(commands, (None, 4), "respond: commands"),
        checked_state(state, "respond"),
    )
    check_number(dt, "respond: dt", "s", above=0, most=MAX_HELD)
    parameters, n = aircraft.parameters(earth, state[:3]), len(commands)
    winds = _winds(wind, n)
    states, increments = np.empty((n + 1, STATE_SIZE)), np.empty((n, 6))
    states[0] = state
    for k in range(n):
        step(parameters, state, commands[k], winds[k], float(dt), increments[k])
        if not np.isfinite(state).all():
            raise DataError(
                f"respond: {aircraft.name!r} does not stay finite after {k * dt:g} s; take shorter "
                f"steps or smaller commands"
            )
        states[k + 1] = state
    return states, Imu(
        np.asarray(dt * np.arange(1, n + 1), float),
        np.full(n, float(dt)),
        np.ascontiguousarray(increments[:, :3]),
        np.ascontiguousarray(increments[:, 3:]),
    )
