"""What the air and the propeller do to the aircraft: forces and moments in body axes, without
gravity. Compiled helpers.

Aerodynamics are those of Beard & McLain, Small Unmanned Aircraft (2012), chapter 4: linear
derivatives, parabolic drag, and lift that blends from linear to that of a flat plate beyond the
stall. The propeller is their later one: a DC motor on a voltage of throttle times the battery's, in
balance with the torque of a propeller whose coefficients are quadratic in the advance ratio. Its
speed is algebraic (the rotor has no inertia).
"""

import math
from typing import TypeAlias

from ...core.compile.jit import helper
from ...typing import Array
from .parameters import (
    AREA,
    C_D_ELEVATOR,
    C_D_P,
    C_D_Q,
    C_L_0,
    C_L_ALPHA,
    C_L_ELEVATOR,
    C_L_Q,
    C_M_0,
    C_M_ALPHA,
    C_M_ELEVATOR,
    C_M_Q,
    C_N_0,
    C_N_AILERON,
    C_N_BETA,
    C_N_P,
    C_N_R,
    C_N_RUDDER,
    C_Q_0,
    C_Q_1,
    C_Q_2,
    C_ROLL_0,
    C_ROLL_AILERON,
    C_ROLL_BETA,
    C_ROLL_P,
    C_ROLL_R,
    C_ROLL_RUDDER,
    C_T_0,
    C_T_1,
    C_T_2,
    C_Y_0,
    C_Y_AILERON,
    C_Y_BETA,
    C_Y_P,
    C_Y_R,
    C_Y_RUDDER,
    CHORD,
    DENSITY,
    DIAMETER,
    IDLE_CURRENT,
    MOTOR_CONSTANT,
    POLAR,
    RESISTANCE,
    SPAN,
    STALL_ALPHA,
    STALL_BLEND,
    VOLTAGE,
)

Numbers: TypeAlias = tuple[float, ...] | Array
"""Three or four of them; kernels take either."""
RAD_PER_TURN = 2 * math.pi


@helper
def density(parameters: Array, height: float) -> float:
    """Density of the air, kg/m^3: the aircraft's constant one, or where that is 0 the standard
    atmosphere's at `height` (m, up to 11 km)."""
    if parameters[DENSITY] > 0:
        return parameters[DENSITY]
    height = min(max(height, -5000.0), 11000.0)
    return 1.225 * (1 - 2.25577e-5 * height / (1 + height / 6356766)) ** 4.25588


@helper
def air_data(u: float, v: float, w: float) -> tuple[float, float, float, float, float]:
    """Airspeed V (m/s), angle of attack and sideslip (rad), and the cosine and sine of the
    former, from the air-relative velocity in body axes."""
    across = u * u + w * w
    V, across = math.sqrt(across + v * v), math.sqrt(across)
    if across == 0:
        return V, 0.0, math.atan2(v, across), 1.0, 0.0
    return V, math.atan2(w, u), math.atan2(v, across), u / across, w / across


@helper
def propeller(
    parameters: Array, rho: float, V: float, throttle: float
) -> tuple[float, float, float]:
    """Thrust (N), torque that the air puts on the propeller (N m, its reaction rolls the body to
    the left) and speed (rad/s) in balance with the motor.

    Where the voltage is too low to turn it against the idle current, it stands still.
    """
    D, K, R = parameters[DIAMETER], parameters[MOTOR_CONSTANT], parameters[RESISTANCE]
    D3 = D * D * D
    a = parameters[C_Q_0] * rho * D3 * D * D / (RAD_PER_TURN * RAD_PER_TURN)
    b = parameters[C_Q_1] * rho * D3 * D * V / RAD_PER_TURN + K * K / R
    c = parameters[C_Q_2] * rho * D3 * V * V - K * (
        throttle * parameters[VOLTAGE] / R - parameters[IDLE_CURRENT]
    )
    root = b * b - 4 * a * c
    # the positive root, without loss in thin air
    speed = max(-2 * c / (b + math.sqrt(root)), 0.0) if root > 0 else 0.0
    nD, scale = speed * D / RAD_PER_TURN, rho * D * D
    thrust = scale * (
        parameters[C_T_0] * nD * nD + parameters[C_T_1] * nD * V + parameters[C_T_2] * V * V
    )
    torque = (
        scale
        * D
        * (parameters[C_Q_0] * nD * nD + parameters[C_Q_1] * nD * V + parameters[C_Q_2] * V * V)
    )
    return thrust, torque, speed


@helper
def lift_and_drag(
    parameters: Array, alpha: float, cosine: float, sine: float
) -> tuple[float, float]:
    """C_L and C_D of the wing at an angle of attack: linear lift blended into 2 sign(alpha)
    sin^2 cos of a flat plate, and the parabolic polar."""
    linear = parameters[C_L_0] + parameters[C_L_ALPHA] * alpha
    over = 1 / (1 + math.exp(-parameters[STALL_BLEND] * (alpha - parameters[STALL_ALPHA])))
    under = 1 / (1 + math.exp(parameters[STALL_BLEND] * (alpha + parameters[STALL_ALPHA])))
    stalled = over + under - over * under
    plate = 2 * math.copysign(sine * sine, alpha) * cosine
    return (1 - stalled) * linear + stalled * plate, parameters[C_D_P] + parameters[
        POLAR
    ] * linear * linear


@helper
def forces(
    parameters: Array, rho: float, velocity: Numbers, rates: Numbers, controls: Numbers
) -> tuple[float, float, float, float, float, float]:
    """(F_x, F_y, F_z) N and (M_x, M_y, M_z) N m as one tuple, body axes, aerodynamic and
    propulsive, without gravity.

    From the density of the air (`density`), the velocity (m/s) and rates (rad/s) against the air in
    body axes, and the positions of elevator, aileron, rudder (rad) and throttle: three tuples, or
    arrays.
    """
    u, v, w = velocity[0], velocity[1], velocity[2]
    p, q, r = rates[0], rates[1], rates[2]
    elevator, aileron, rudder, throttle = controls[0], controls[1], controls[2], controls[3]
    V, alpha, beta, cosine, sine = air_data(u, v, w)
    half = 0.5 * rho * V * parameters[AREA]
    qS, b, c = half * V, parameters[SPAN], parameters[CHORD]
    # qS times the rates in c/2V and b/2V: no division by a small V
    longitudinal, lateral = (
        0.5 * half * c * q,
        0.5 * half * b,
    )
    C_L, C_D = lift_and_drag(parameters, alpha, cosine, sine)
    lift = qS * (C_L + parameters[C_L_ELEVATOR] * elevator) + longitudinal * parameters[C_L_Q]
    drag = qS * (C_D + parameters[C_D_ELEVATOR] * elevator) + longitudinal * parameters[C_D_Q]
    side = qS * (
        parameters[C_Y_0]
        + parameters[C_Y_BETA] * beta
        + parameters[C_Y_AILERON] * aileron
        + parameters[C_Y_RUDDER] * rudder
    ) + lateral * (parameters[C_Y_P] * p + parameters[C_Y_R] * r)
    roll = qS * (
        parameters[C_ROLL_0]
        + parameters[C_ROLL_BETA] * beta
        + parameters[C_ROLL_AILERON] * aileron
        + parameters[C_ROLL_RUDDER] * rudder
    ) + lateral * (parameters[C_ROLL_P] * p + parameters[C_ROLL_R] * r)
    pitch = (
        qS
        * (parameters[C_M_0] + parameters[C_M_ALPHA] * alpha + parameters[C_M_ELEVATOR] * elevator)
        + longitudinal * parameters[C_M_Q]
    )
    yaw = qS * (
        parameters[C_N_0]
        + parameters[C_N_BETA] * beta
        + parameters[C_N_AILERON] * aileron
        + parameters[C_N_RUDDER] * rudder
    ) + lateral * (parameters[C_N_P] * p + parameters[C_N_R] * r)
    thrust, torque, _ = propeller(parameters, rho, V, throttle)
    return (
        lift * sine - drag * cosine + thrust,
        side,
        -lift * cosine - drag * sine,
        b * roll - torque,
        c * pitch,
        b * yaw,
    )
