"""Vertical reference unit: roll, pitch and heave of a floating body, or of one with a barometer,
from a 6-DOF IMU.

Attitude and gyro bias are those of `attitude_mekf` without a heading reference. Beside them a
Kalman filter of height, vertical velocity and accelerometer bias is driven by the specific force
turned to n: v_D' = (C (f - b_a))_D + g. Its measurements correct no attitude, as in the textbook,
but it reckons with the tilt: while that settles, the body's own acceleration leans into the
vertical, and a channel that took the attitude for known would learn accelerometer biases of it.
"""

import math

from ...checks import check_number
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.earth import gravity
from ...core.mathematics.error_state import DX, JACOBIAN, WORK, inject_tail, observe_innovation
from ...core.mathematics.kalman import decay, of_estimates, update
from ...core.mathematics.rotation import rotate_vector
from ...typing import Array
from . import attitude_mekf
from .attitude_error_state import DOWN, GAIN, KEEP, NORTH, SIX, count_bias
from .attitude_mekf import (
    BIAS_VARIANCE,
    FIRST_RECORD,
    LAST,
    SECOND_RECORD,
    SENSITIVITY,
    STEP,
    TOLD,
    predict_attitude,
)

VERTICAL = (2, 5, 9, 10, 11)
"""Places of height, vertical velocity and accelerometer bias among the error states."""
TILT_AND_BIAS = (6, 7, 9, 10, 11)
"""Places of those by which the vertical acceleration errs."""
HEIGHT_STD = 10e3
"""m: nothing that a barometer or the sea aids is further from height 0; an unknown place says
the radius of the Earth."""
MIN_ACCEL, MIN_LEVEL_INTERVAL = 1e-6, 1e-3
"""m/s/sqrt(s): accelerometer noise to reckon with at least; s: between two heights of
zero-sea-level, which may come at one time."""
MANY_HEIGHTS = 18
"""Independent heights, six waves, after which the density of the waves replaces theirs."""
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
ERRS = SLOTS.array("ERRS", 5)  # by TILT_AND_BIAS: the velocity gained in the last step errs by it
ATTITUDE_P = SLOTS.matrix("ATTITUDE_P", 6, 6)  # kept over a correction


def start(
    start: InitialState,
    noise: Noise,
    heave: float = 1.0,
    wave_period: float = 10.0,
    low_pass: float = 2.0,
    acceleration: float = 0.2,
    rate_error: float = 0.002,
) -> FilterState:
    """The filter state at `start`. Until a source measures the height, it heaves about that of the start:
    heave is the standard deviation of that, m.

    wave_period: period of the waves, s, which sets how fast they average to zero; 0: errors of
    zero-sea-level are independent. low_pass (s), acceleration (m/s^2 sqrt(s)) and rate_error
    (sqrt(s)) are those of `attitude-mekf`.
    """
    check_number(heave, "heave", "m", above=0)
    check_number(wave_period, "wave_period", "s", least=0)
    belief = attitude_mekf.begin(SLOTS, start, noise, low_pass, acceleration, rate_error)
    for i in VERTICAL:
        belief.P[i, i] = min(start.std[i], HEIGHT_STD) ** 2
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
    w, q = 2 * math.pi / wave_period, max(accel, MIN_ACCEL) ** 2
    return q**0.2 * (8 * math.sqrt(2) / (3 * w * w)) ** 0.8


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """The vertical channel at the attitude where the sample begins, then the attitude; the mean
    level as long as nothing else aids the height."""
    if dt > 0:
        workspace = belief.workspace
        _fall(belief, u, dt, noise)
        _propagate_vertical(belief, dt, noise)
        predict_attitude(belief, u, dt, noise)
        _follow(belief.P, workspace[LAST])
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
def _fall(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Height and vertical velocity over a sample, by the bias-free velocity increment at
    mid-interval and gravity; keep the row by which acceleration errs."""
    C, b_a, b_g, row = belief.C_nb, belief.b_a, belief.b_g, belief.workspace[ERRS]
    r0, r1, r2 = 0.5 * (u[0] - b_g[0] * dt), 0.5 * (u[1] - b_g[1] * dt), 0.5 * (u[2] - b_g[2] * dt)
    a0, a1, a2 = u[3] - b_a[0] * dt, u[4] - b_a[1] * dt, u[5] - b_a[2] * dt
    north, east, gained = rotate_vector(
        C, a0 + r1 * a2 - r2 * a1, a1 + r2 * a0 - r0 * a2, a2 + r0 * a1 - r1 * a0
    )
    row[0], row[1] = east, -north
    for i in range(3):
        row[2 + i] = -dt * C[2, i]
    gained += gravity(math.sin(belief.lla[0]), belief.lla[2]) * dt
    belief.lla[2] -= (belief.v_n[2] + 0.5 * gained) * dt
    belief.v_n[2] += gained
    keep = decay(of_estimates(noise).accel_decay * dt)
    for i in range(3):
        b_a[i] *= keep


@helper
def _propagate_vertical(belief: FilterState, dt: float, noise: Noise) -> None:
    """P of the vertical channel over dt: p' = v, v' = the row ERRS of tilt and accelerometer bias;
    its covariances with the attitude and with the augmented states."""
    P, workspace, n = belief.P, belief.workspace, belief.P.shape[0]
    row, w = workspace[ERRS], workspace[DX]  # of the velocity gained, w = row . x
    keep, q = decay(noise.accel_decay * dt), noise.accel * noise.accel * dt
    sensitivity, biases = matrix(workspace, SENSITIVITY, 6, 3), workspace[BIAS_VARIANCE]
    # a tilt by accelerometer biases is as constant as they are, and the channel knows them
    count_bias(P, sensitivity, biases, -1.0)
    w_w = 0.0
    for k in range(n):
        w[k] = 0.0
        for i in range(5):
            w[k] += row[i] * P[TILT_AND_BIAS[i], k]
    for i in range(5):
        w_w += row[i] * w[TILT_AND_BIAS[i]]
    pp, pv, vv = P[2, 2], P[2, 5], P[5, 5]
    for k in range(n):
        P[2, k] += dt * P[5, k] + 0.5 * dt * w[k]
        P[5, k] += w[k]
    P[2, 2] = pp + dt * (2 * pv + dt * vv + w[2] + dt * w[5] + 0.25 * dt * w_w + dt * q / 3)
    P[2, 5] = P[5, 2] = pv + w[2] + dt * (vv + 1.5 * w[5] + 0.5 * w_w + 0.5 * q)
    P[5, 5] = vv + 2 * w[5] + w_w + q
    for i in range(9, 12):
        for k in range(n):
            P[i, k] *= keep * keep if 9 <= k < 12 else keep
        P[i, i] += noise.accel_bias * noise.accel_bias * dt
        P[2, i] *= keep
        P[5, i] *= keep
    _mirror(P)
    count_bias(P, sensitivity, biases, 1.0)


@helper
def _mirror(P: Array) -> None:
    """The columns of the vertical channel as its rows."""
    for i in range(5):
        a = VERTICAL[i]
        for k in range(P.shape[0]):
            P[k, a] = P[a, k]


@helper
def _follow(P: Array, last: Array) -> None:
    """Covariances with the six states of the attitude over their step `last`: they were propagated
    and then levelled, of which the vertical channel took nothing."""
    step, first, second = last[STEP], last[FIRST_RECORD], last[SECOND_RECORD]
    w0, w2, keep = step[NORTH], step[DOWN], step[KEEP]
    for a in range(P.shape[0]):
        if a in SIX:
            continue
        x0, x1, x2 = P[a, 6], P[a, 7], P[a, 8]
        b0, b1, b2 = P[a, 12], P[a, 13], P[a, 14]
        P[a, 6] = x0 + w2 * x1 - (step[0] * b0 + step[1] * b1 + step[2] * b2)
        P[a, 7] = x1 - w2 * x0 + w0 * x2 - (step[3] * b0 + step[4] * b1 + step[5] * b2)
        P[a, 8] = x2 - w0 * x1 - (step[6] * b0 + step[7] * b1 + step[8] * b2)
        for i in range(12, 15):
            P[a, i] *= keep
        _level_row(P, a, P[a, 6], first[GAIN])
        _level_row(P, a, P[a, 7], second[GAIN])
        for i in SIX:
            P[i, a] = P[a, i]


@helper
def _level_row(P: Array, a: int, seen: float, gain: Array) -> None:
    """Row a after a levelling that sees the tilt with which its covariance is `seen`."""
    for i in range(6):
        P[a, SIX[i]] -= gain[i] * seen


@helper
def _tether(belief: FilterState, variance: float) -> None:
    """Correct the vertical channel by the height of the start, measured with that variance
    (m^2): the mean of the heave is zero."""
    P, e = belief.P, belief.lla[2] - belief.workspace[LEVEL]
    h = belief.workspace[DX]
    scale = 1 / (P[2, 2] + variance)
    for k in range(STATES):
        h[k] = P[2, k]
    for i in range(5):
        a = VERTICAL[i]
        for k in range(STATES):
            P[a, k] -= scale * h[a] * h[k]
    _mirror(P)
    e *= scale
    belief.lla[2] -= h[2] * e
    belief.v_n[2] += h[5] * e
    for i in range(3):
        belief.b_a[i] += h[9 + i] * e
    for k in range(STATES):
        h[k] = 0.0


@helper
def _unmeasured_variance(belief: FilterState, H: Array) -> float:
    """Variance of a height, m^2, before one was measured, with that of the states of its source."""
    known = belief.workspace[VARIANCE]
    for k in range(STATES, belief.P.shape[0]):
        known += H[0, k] * H[0, k] * belief.P[k, k]
    return known


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
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
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    if math.isnan(innovation[0]):
        return math.nan
    a, b, known = H[0, 6], H[0, 7], P[2, 2]
    variance = std[0] * std[0] + a * a * P[6, 6] + 2 * a * b * P[6, 7] + b * b * P[7, 7]
    H[0, 6] = H[0, 7] = 0.0
    waves = kind == Kind.ZERO_SEA_LEVEL and seconds < workspace[INDEPENDENT]
    if workspace[MEASURED] == 0:
        known = _unmeasured_variance(belief, H)
    gated = waves or workspace[MEASURED] == 0
    if gated:  # one height errs by all the heave, and is gated so; many in a row know better
        nis, limit = innovation[0] * innovation[0] / (known + variance), math.inf
        variance = (
            _waves(workspace, variance) / max(seconds, MIN_LEVEL_INTERVAL) if waves else variance
        )
    if nis <= gate and workspace[MEASURED] == 0:
        _untie(P, workspace)
    if nis <= gate:
        workspace[DEVIATION][0] = math.sqrt(variance)
        kept = matrix(workspace, ATTITUDE_P, 6, 6)
        _copy_attitude(P, kept, False)
        found = update(
            P, H, innovation, workspace[DEVIATION], rows, limit, workspace[WORK], workspace[DX]
        )
        _copy_attitude(P, kept, True)  # heights correct no attitude
        nis = nis if gated else found
    if nis <= gate:
        if kind == Kind.ZERO_SEA_LEVEL:
            workspace[SINCE_LEVEL] = 0.0
        _inject_vertical(belief, workspace[DX])
    return nis


@helper
def _copy_attitude(P: Array, kept: Array, back: bool) -> None:
    """Keep P of the six states of the attitude, or give it back."""
    for i in range(6):
        for j in range(6):
            if back:
                P[SIX[i], SIX[j]] = kept[i, j]
            else:
                kept[i, j] = P[SIX[i], SIX[j]]


@helper
def _inject_vertical(belief: FilterState, dx: Array) -> None:
    belief.lla[2] -= dx[2]
    belief.v_n[2] += dx[5]
    for i in range(3):
        belief.b_a[i] += dx[9 + i]
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
