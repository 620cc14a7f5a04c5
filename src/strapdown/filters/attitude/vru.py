"""Vertical reference unit: roll, pitch and heave of a floating body, or of one with a barometer,
from a 6-DOF IMU.

Attitude and gyro bias are those of `attitude_mekf` without a heading reference. Beside them a
Kalman filter of height, vertical velocity and accelerometer bias is driven by the specific force
turned to n: v_D' = (C (f - b_a))_D + g. The two are decoupled, as in the textbook: the vertical
channel takes the attitude for known, and its measurements correct no attitude.
"""

import math

from ...checks import check_number
from ...core.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    SEA_LEVEL_KIND,
    STATES,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Start,
    helper,
    kernel,
    matrix,
)
from ...core.earth import gravity
from ...core.error_state import DX, JACOBIAN, WORK, inject_tail, observed
from ...core.kalman import decay, of_estimates, update
from ...typing import Array
from . import attitude_mekf
from .attitude_mekf import TOLD, predict_attitude

VERTICAL = (2, 5, 9, 10, 11)
"""Places of height, vertical velocity and accelerometer bias among the error states."""
HEIGHT_SD = 10e3
"""m: nothing that a barometer or the sea aids is further from height 0; an unknown place says
the radius of the Earth."""
LEAST_ACCEL, SHORTEST_LEVEL_INTERVAL = 1e-6, 1e-3
"""m/s/sqrt(s): accelerometer noise to reckon with at least; s: between two heights of
zero-sea-level, which may come at one time."""
MANY_HEIGHTS = 18
"""Independent heights, six waves, after which their average is better than that of so many."""
SLOTS = Slots(after=attitude_mekf.ATTITUDE)
LEVEL = SLOTS.number("LEVEL")  # height at the start, m
VARIANCE = SLOTS.number("VARIANCE")  # of it, m^2
MEASURED = SLOTS.number("MEASURED")  # 1 once a source has measured the height
SINCE_LEVEL = SLOTS.number("SINCE_LEVEL")  # s since the last zero-sea-level
HEAVE = SLOTS.number("HEAVE")  # variance of the heave before any source, m^2
DENSITY = SLOTS.number("DENSITY")  # of waves with 1 m of heave, m^2 s
INDEPENDENT = SLOTS.number("INDEPENDENT")  # s from which on heights are independent
SETTLED = SLOTS.number("SETTLED")  # s since the start or the last gap
DEVIATION = SLOTS.array("DEVIATION", 3)  # of a fix, with what it does not know, m


def start(
    start: Start,
    noise: Noise,
    heave: float = 1.0,
    wave_period: float = 10.0,
    low_pass: float = 2.0,
    acceleration: float = 0.2,
    rate_error: float = 0.002,
) -> Belief:
    """Belief at `start`. Until a source measures the height, it heaves about that of the start:
    heave is the standard deviation of that, m.

    wave_period: of the waves, s, which tells how fast they average to zero; 0: heights of
    zero-sea-level err independently. low_pass (s), acceleration (m/s^2 sqrt(s)) and rate_error
    (sqrt(s)) are those of `attitude-mekf`.
    """
    check_number(heave, "heave", "m", above=0)
    check_number(wave_period, "wave_period", "s", least=0)
    belief = attitude_mekf.begin(SLOTS, start, noise, low_pass, acceleration, rate_error)
    for i in VERTICAL:
        belief.P[i, i] = min(start.sd[i], HEIGHT_SD) ** 2
    workspace = belief.workspace
    workspace[LEVEL], workspace[VARIANCE] = belief.lla[2], belief.P[2, 2]
    workspace[DENSITY], workspace[INDEPENDENT] = (
        wave_density(noise.accel, wave_period) if wave_period else 1.0,
        wave_period / 3,
    )
    workspace[HEAVE] = heave**2
    return belief


def wave_density(accel: float, wave_period: float) -> float:
    """White density (m^2 s) as which waves of 1 m heave are told to the filter; that of s metres is
    s^1.6 times as large.

    Waves have nothing at low frequencies, so that their average vanishes faster than that of
    independent heights. With accelerometer noise of density q^1/2 a filter of height and velocity
    takes density S for a corner of w0 = (q/S)^1/4. Of waves at w it lets 2 (w0/w)^2 s^2 through,
    the noise adds q/(2 sqrt(2) w0^3); their sum is least at w0^5 = 3 q w^2/(8 sqrt(2) s^2).
    """
    w, q = 2 * math.pi / wave_period, max(accel, LEAST_ACCEL) ** 2
    return q**0.2 * (8 * math.sqrt(2) / (3 * w * w)) ** 0.8


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """The vertical channel at the attitude where the sample begins, then the attitude; the mean
    level as long as nothing else aids the height."""
    if dt > 0:
        _fall(belief, u, dt, noise)
        _spread(belief, dt, noise)
        predict_attitude(belief, u, dt, noise)
        workspace = belief.workspace
        workspace[SINCE_LEVEL] += dt
        workspace[SETTLED] = 0.0 if noise.accel > workspace[TOLD] else workspace[SETTLED] + dt
        if workspace[MEASURED] == 0:
            _tether(belief, _waves(workspace, workspace[HEAVE]) / dt)


@helper
def _waves(workspace: Array, variance: float) -> float:
    """Density (m^2 s) of waves of that variance (m^2): of independent heights until the filter
    has seen enough of them."""
    return (
        variance * workspace[INDEPENDENT]
        if workspace[SETTLED] < MANY_HEIGHTS * workspace[INDEPENDENT]
        else workspace[DENSITY] * variance**0.8
    )


@helper
def _fall(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Height and vertical velocity over a sample, by the bias-free velocity increment at
    mid-interval and gravity."""
    C, ba, bg = belief.C, belief.ba, belief.bg
    r0, r1, r2 = 0.5 * (u[0] - bg[0] * dt), 0.5 * (u[1] - bg[1] * dt), 0.5 * (u[2] - bg[2] * dt)
    a0, a1, a2 = u[3] - ba[0] * dt, u[4] - ba[1] * dt, u[5] - ba[2] * dt
    gained = (
        C[2, 0] * (a0 + r1 * a2 - r2 * a1)
        + C[2, 1] * (a1 + r2 * a0 - r0 * a2)
        + C[2, 2] * (a2 + r0 * a1 - r1 * a0)
    )
    gained += gravity(math.sin(belief.lla[0]), belief.lla[2]) * dt
    belief.lla[2] -= (belief.v[2] + 0.5 * gained) * dt
    belief.v[2] += gained
    keep = decay(of_estimates(noise).accel_decay * dt)
    for i in range(3):
        ba[i] *= keep


@helper
def _spread(belief: Belief, dt: float, noise: Noise) -> None:
    """P of the vertical channel over dt: p' = v, v' = - c b with c the down row of C, and with
    the states that aidings brought along."""
    P, C, half = belief.P, belief.C, 0.5 * dt
    c0, c1, c2 = dt * C[2, 0], dt * C[2, 1], dt * C[2, 2]
    keep, q = decay(noise.accel_decay * dt), noise.accel * noise.accel * dt
    # with u = dt c b: the covariances of u with the others
    u_p = c0 * P[2, 9] + c1 * P[2, 10] + c2 * P[2, 11]
    u_v = c0 * P[5, 9] + c1 * P[5, 10] + c2 * P[5, 11]
    u0 = c0 * P[9, 9] + c1 * P[9, 10] + c2 * P[9, 11]
    u1 = c0 * P[9, 10] + c1 * P[10, 10] + c2 * P[10, 11]
    u2 = c0 * P[9, 11] + c1 * P[10, 11] + c2 * P[11, 11]
    u_u = c0 * u0 + c1 * u1 + c2 * u2
    pp, pv, vv = P[2, 2], P[2, 5], P[5, 5]
    P[2, 2] = pp + dt * (2 * pv + dt * vv - u_p - dt * u_v + 0.25 * dt * u_u + dt * q / 3)
    P[2, 5] = P[5, 2] = pv - u_p + dt * (vv - 1.5 * u_v + 0.5 * u_u + 0.5 * q)
    P[5, 5] = vv - 2 * u_v + u_u + q
    for i in range(3):
        u_b = u0 if i == 0 else (u1 if i == 1 else u2)
        P[2, 9 + i] = P[9 + i, 2] = keep * (P[2, 9 + i] + dt * P[5, 9 + i] - half * u_b)
        P[5, 9 + i] = P[9 + i, 5] = keep * (P[5, 9 + i] - u_b)
        for j in range(3):
            P[9 + i, 9 + j] *= keep * keep
        P[9 + i, 9 + i] += noise.accel_bias * noise.accel_bias * dt
    for k in range(STATES, P.shape[0]):
        u_k = c0 * P[9, k] + c1 * P[10, k] + c2 * P[11, k]
        P[2, k] = P[k, 2] = P[2, k] + dt * P[5, k] - half * u_k
        P[5, k] = P[k, 5] = P[5, k] - u_k
        for i in range(3):
            P[9 + i, k] = P[k, 9 + i] = keep * P[9 + i, k]


@helper
def _tether(belief: Belief, variance: float) -> None:
    """Correct the vertical channel by the height of the start, measured with that variance
    (m^2): the mean of the heave is zero."""
    P, e = belief.P, belief.lla[2] - belief.workspace[LEVEL]
    k = (P[2, 2], P[2, 5], P[2, 9], P[2, 10], P[2, 11])
    scale = 1 / (P[2, 2] + variance)
    for i in range(5):
        for j in range(i, 5):
            P[VERTICAL[i], VERTICAL[j]] -= scale * k[i] * k[j]
            P[VERTICAL[j], VERTICAL[i]] = P[VERTICAL[i], VERTICAL[j]]
    e *= scale
    belief.lla[2] -= k[0] * e
    belief.v[2] += k[1] * e
    for i in range(3):
        belief.ba[i] += k[2 + i] * e


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct the vertical channel by a height. What the tilt makes of a lever arm is noise; the
    waves about mean sea level are no white one."""
    n, workspace, P = belief.P.shape[0], belief.workspace, belief.P
    H, seconds, limit, nis = (
        matrix(workspace, JACOBIAN, 3, n),
        workspace[SINCE_LEVEL],
        gate,
        0.0,
    )
    rows = observed(belief, y, observe, parameters, innovation, H)
    if math.isnan(innovation[0]):
        return math.nan
    a, b, known = H[0, 6], H[0, 7], P[2, 2]
    variance = sd[0] * sd[0] + a * a * P[6, 6] + 2 * a * b * P[6, 7] + b * b * P[7, 7]
    H[0, 6] = H[0, 7] = 0.0
    waves = kind == SEA_LEVEL_KIND and seconds < workspace[INDEPENDENT]
    if workspace[MEASURED] == 0:
        known = workspace[VARIANCE]
        for k in range(STATES, n):
            known += H[0, k] * H[0, k] * P[k, k]
    gated = waves or workspace[MEASURED] == 0
    if gated:  # one height errs by all the heave, and is gated so; many in a row know better
        nis, limit = innovation[0] * innovation[0] / (known + variance), math.inf
        variance = (
            _waves(workspace, variance) / max(seconds, SHORTEST_LEVEL_INTERVAL)
            if waves
            else variance
        )
    if nis <= gate and workspace[MEASURED] == 0:
        _untie(P, workspace)
    if nis <= gate:
        workspace[DEVIATION][0] = math.sqrt(variance)
        found = update(
            P, H, innovation, workspace[DEVIATION], rows, limit, workspace[WORK], workspace[DX]
        )
        nis = nis if gated else found
    if nis <= gate:
        if kind == SEA_LEVEL_KIND:
            workspace[SINCE_LEVEL] = 0.0
        _inject_vertical(belief, workspace[DX])
    return nis


@helper
def _inject_vertical(belief: Belief, dx: Array) -> None:
    belief.lla[2] -= dx[2]
    belief.v[2] += dx[5]
    for i in range(3):
        belief.ba[i] += dx[9 + i]
    inject_tail(belief, dx)


@helper
def _untie(P: Array, workspace: Array) -> None:
    """The first source of height: from now on the height is as uncertain as it was at the start,
    and no longer that of the mean level."""
    workspace[MEASURED] = 1.0
    for j in range(P.shape[0]):
        P[2, j] = P[j, 2] = 0.0
    P[2, 2] = workspace[VARIANCE]


VRU = Filter(
    "vru",
    "Fossen (2021) section 14.2.2 and 14.3.2, heave by a Kalman filter; attitude as attitude-mekf",
    start,
    predict,
    correct,
    slots=SLOTS,
    states=(2, 5, 6, 7, 9, 10, 11, 12, 13, 14),
    estimates=(2, 5, 6, 7, 9, 10, 11, 12, 13, 14),
    unaided_note="no source of height: heave is that about the height of the start, which is taken "
    "for its mean",
    uses=("pressure", "pressure-altitude", "altitude", "zero-sea-level"),
    conditions=attitude_mekf.CONDITIONS,
    condition=attitude_mekf.HOLDS,
    bias=DECAYING,
    good_for="roll, pitch and heave of a vessel without GNSS",
    poor_for="heading, and the height of flights and drives",
)
