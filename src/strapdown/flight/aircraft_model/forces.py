"""Forces and moments of air and propeller on the aircraft, in body axes, without gravity. Compiled
helpers.

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
from .parameters import Parameters

Numbers: TypeAlias = tuple[float, ...] | Array
"""Three or four of them; kernels take either."""
RAD_PER_TURN = 2 * math.pi


@helper
def density(parameters: Parameters, height: float) -> float:
    """Density of the air, kg/m^3: the aircraft's constant one, or where that is 0 the standard
    atmosphere's at `height` (m, up to 11 km)."""
    if parameters.density > 0:
        return parameters.density
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
    parameters: Parameters, rho: float, V: float, throttle: float
) -> tuple[float, float, float]:
    """Thrust (N), torque that the air puts on the propeller (N m, its reaction rolls the body to
    the left) and speed (rad/s) in balance with the motor.

    Where the voltage is too low to turn it against the idle current, it stands still.
    """
    D, K, R = parameters.diameter, parameters.motor_constant, parameters.resistance
    D3 = D * D * D
    a = parameters.C_Q_0 * rho * D3 * D * D / (RAD_PER_TURN * RAD_PER_TURN)
    b = parameters.C_Q_1 * rho * D3 * D * V / RAD_PER_TURN + K * K / R
    c = parameters.C_Q_2 * rho * D3 * V * V - K * (
        throttle * parameters.voltage / R - parameters.idle_current
    )
    root = b * b - 4 * a * c
    # the positive root, without loss in thin air
    speed = max(-2 * c / (b + math.sqrt(root)), 0.0) if root > 0 else 0.0
    nD, scale = speed * D / RAD_PER_TURN, rho * D * D
    thrust = scale * (
        parameters.C_T_0 * nD * nD + parameters.C_T_1 * nD * V + parameters.C_T_2 * V * V
    )
    torque = (
        scale
        * D
        * (parameters.C_Q_0 * nD * nD + parameters.C_Q_1 * nD * V + parameters.C_Q_2 * V * V)
    )
    return thrust, torque, speed


@helper
def lift_and_drag(
    parameters: Parameters, alpha: float, cosine: float, sine: float
) -> tuple[float, float]:
    """C_L and C_D of the wing at an angle of attack: linear lift blended into 2 sign(alpha)
    sin^2 cos of a flat plate, and the parabolic polar."""
    linear = parameters.C_L_0 + parameters.C_L_alpha * alpha
    over = 1 / (1 + math.exp(-parameters.stall_blend * (alpha - parameters.stall_alpha)))
    under = 1 / (1 + math.exp(parameters.stall_blend * (alpha + parameters.stall_alpha)))
    stalled = over + under - over * under
    plate = 2 * math.copysign(sine * sine, alpha) * cosine
    return (
        1 - stalled
    ) * linear + stalled * plate, parameters.C_D_p + parameters.polar * linear * linear


@helper
def forces(
    parameters: Parameters, rho: float, velocity: Numbers, rates: Numbers, controls: Numbers
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
    half = 0.5 * rho * V * parameters.area
    qS, b, c = half * V, parameters.span, parameters.chord
    # qS times the rates in c/2V and b/2V: no division by a small V
    longitudinal, lateral = (
        0.5 * half * c * q,
        0.5 * half * b,
    )
    C_L, C_D = lift_and_drag(parameters, alpha, cosine, sine)
    lift = qS * (C_L + parameters.C_L_elevator * elevator) + longitudinal * parameters.C_L_q
    drag = qS * (C_D + parameters.C_D_elevator * elevator) + longitudinal * parameters.C_D_q
    side = qS * (
        parameters.C_Y_0
        + parameters.C_Y_beta * beta
        + parameters.C_Y_aileron * aileron
        + parameters.C_Y_rudder * rudder
    ) + lateral * (parameters.C_Y_p * p + parameters.C_Y_r * r)
    roll = qS * (
        parameters.C_l_0
        + parameters.C_l_beta * beta
        + parameters.C_l_aileron * aileron
        + parameters.C_l_rudder * rudder
    ) + lateral * (parameters.C_l_p * p + parameters.C_l_r * r)
    pitch = (
        qS * (parameters.C_m_0 + parameters.C_m_alpha * alpha + parameters.C_m_elevator * elevator)
        + longitudinal * parameters.C_m_q
    )
    yaw = qS * (
        parameters.C_n_0
        + parameters.C_n_beta * beta
        + parameters.C_n_aileron * aileron
        + parameters.C_n_rudder * rudder
    ) + lateral * (parameters.C_n_p * p + parameters.C_n_r * r)
    thrust, torque, _ = propeller(parameters, rho, V, throttle)
    return (
        lift * sine - drag * cosine + thrust,
        side,
        -lift * cosine - drag * sine,
        b * roll - torque,
        c * pitch,
        b * yaw,
    )
