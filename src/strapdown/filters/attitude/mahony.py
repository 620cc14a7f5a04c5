"""Nonlinear attitude observer with gyro bias: the rate is corrected by the cross products of
measured and expected directions.

q' = T(omega - b + sigma) q, b' = -k_i sigma, sigma = sum of k_j v_j x R' v0_j. The directions are
specific force (up), magnetic field projected on the horizontal plane, and compass; those that are
measured are used, whatever the combination. The specific force is low-passed in a frame that the
gyros carry, which keeps most of the body's own accelerations out.

Standard deviations are those of its linear error dynamics under its own gains K,
P <- (I - K h) P (I - K h)' + K R K', with the noise that `attitude-mekf` assumes of the sensors.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...checks import check_number
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
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
from ...core.mathematics.earth import GRAVITY_EQUATOR
from ...core.mathematics.kalman import decay, of_estimates
from ...core.mathematics.rotation import orthonormalise, rotate_left, rotate_vector, wrap
from ...typing import Array
from . import attitude_mekf
from .attitude_error_state import (
    FREE_FALL_FORCE,
    SIX,
    UNAIDED,
    absorb_bias,
    carry_bias,
    count_bias,
    gain_update,
    low_passed,
    off_vertical,
    propagate,
    turn,
)
from .attitude_mekf import (
    ACCELERATION,
    BIAS_VARIANCE,
    CLOCK,
    DISTURBANCE,
    EARTH_D,
    EARTH_N,
    ELAPSED,
    HEADED,
    HOLDS,
    LEAN_E,
    LEAN_N,
    LOW_PASS,
    RATE_ERROR,
    SECONDS,
    SENSITIVITY,
    TOLD,
    active_condition,
    attitude_noise_growth,
    count_time,
    field_density,
    field_used,
    is_field_rejected,
    level_bias,
    level_density,
)

SLOTS = Slots(after=attitude_mekf.ATTITUDE)
K1, K2, K3, KI = SLOTS.numbers("K1", "K2", "K3", "KI")  # gains, 1/s
# s since the last field and compass
SINCE_FIELD, SINCE_COMPASS = SLOTS.numbers("SINCE_FIELD", "SINCE_COMPASS")
# gains of the six states about north, east and down, of the last pull
K_NORTH, K_EAST, K_DOWN = (SLOTS.array(name, 6) for name in ("K_NORTH", "K_EAST", "K_DOWN"))
LEVEL = SLOTS.number("LEVEL")  # density of the specific force besides gravity, m^2/s^3
MAX_GAP = 1.0
"""s: a direction that was not measured for longer counts as if it were for so long."""
ACCELERATION_LEFT, SCALE_ERROR = 0.9, 0.002
"""m/s^2 sqrt(s): what the low-pass leaves of the body's own acceleration, for its standard deviation
(an acceleration of 1 m/s^2 that does not show tilts it by 2 of them); sqrt(s): attitude noise per
rate."""


def start(
    start: InitialState,
    noise: Noise,
    k1: float = 0.5,
    k2: float = 0.1,
    k3: float = 0.1,
    ki: float = 0.005,
    low_pass: float = 2.0,
) -> FilterState:
    """The filter state at `start`. Gains: k1 of the specific force, k2 of the magnetic field, k3 of a compass
    (1/s; 0 leaves it out), ki of the bias (1/s, times sigma). low_pass: time constant of the
    specific force, s, rotated with the gyros; 0 is the published observer. Refuses unstable gains.
    """
    gains = dict(k1=k1, k2=k2, k3=k3)
    for name, value in {**gains, "ki": ki}.items():
        check_number(value, name)
    check_number(low_pass, "low_pass", "s", least=0)
    if not any(gains.values()):
        raise ValueError(
            "k1, k2 and k3 are all zero, so nothing corrects the attitude; give one of them above "
            "zero"
        )
    for name, k in gains.items():
        found = poles(k, ki, 0.0 if name == "k3" else low_pass)
        if k and not (found.real < 0).all():
            raise ValueError(
                f"{name} = {k:g}, ki = {ki:g}, low_pass = {low_pass:g} are not stable: poles "
                f"{', '.join(f'{pole:.3g}' for pole in found)} 1/s; "
                "give gains above zero, and ki well below them"
            )
    belief = attitude_mekf.begin(SLOTS, start, noise, low_pass, ACCELERATION_LEFT, SCALE_ERROR)
    workspace = belief.workspace
    workspace[K1], workspace[K2], workspace[K3], workspace[KI] = k1, k2, k3, ki
    return belief


def poles(k: float, ki: float, low_pass: float) -> NDArray[np.inexact]:
    """Poles (1/s) of a small error about one axis: s^2 + k s + ki k without a low-pass of time
    constant T, else (s + k)(s + 1/T) s + ki k/T.

    Without ki the bias stands still, and its pole at 0 is left out.
    """
    if low_pass == 0:
        return np.roots([1.0, k, ki * k] if ki else [1.0, k])
    return np.roots(
        [1.0, k + 1 / low_pass, k / low_pass, ki * k / low_pass]
        if ki
        else [1.0, k + 1 / low_pass, k / low_pass]
    )


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Turn the attitude with the bias-free gyros and pull it to the specific force."""
    workspace, b_g, C = belief.workspace, belief.b_g, belief.C_nb
    if dt <= 0:
        return
    r0, r1, r2 = u[0] - b_g[0] * dt, u[1] - b_g[1] * dt, u[2] - b_g[2] * dt
    keep = decay(of_estimates(noise).gyro_decay * dt)
    _propagate_covariance(belief, r0 * r0 + r1 * r1 + r2 * r2, keep, dt, noise)
    count_time(belief, r0, r1, r2, dt)
    turn(belief, r0, r1, r2, workspace[EARTH_N] * dt, workspace[EARTH_D] * dt, dt)
    for i in range(3):
        b_g[i] *= keep
    workspace[SINCE_FIELD] += dt
    workspace[SINCE_COMPASS] += dt
    made_up = noise.accel > workspace[TOLD]  # the loop adds noise in a gap
    workspace[SECONDS] = low_passed(
        belief, u, r0, r1, r2, dt, workspace[LOW_PASS], workspace[SECONDS], made_up
    )
    if made_up:
        workspace[ELAPSED] = 0.0
    else:
        _level(belief, dt, noise.gyro * noise.gyro / dt)
    count_bias(belief.P, matrix(workspace, SENSITIVITY, 6, 3), workspace[BIAS_VARIANCE], 1.0)
    workspace[HOLDS] = active_condition(belief)
    orthonormalise(C)


@helper
def _propagate_covariance(
    belief: FilterState, turned_square: float, keep: float, dt: float, noise: Noise
) -> None:
    """P without accelerometer biases, and the sensitivity to them, over dt; turned_square: of the
    rotation in it, rad^2."""
    workspace, P, C = belief.workspace, belief.P, belief.C_nb
    sensitivity = matrix(workspace, SENSITIVITY, 6, 3)
    w0, w2 = workspace[EARTH_N] * dt, workspace[EARTH_D] * dt
    q = (noise.gyro * noise.gyro + attitude_noise_growth(workspace)) * dt + workspace[
        RATE_ERROR
    ] * turned_square / dt
    count_bias(P, sensitivity, workspace[BIAS_VARIANCE], -1.0)
    propagate(P, C, w0, w2, q, dt, noise)
    carry_bias(sensitivity, C, w0, w2, keep, dt)


@helper
def _level(belief: FilterState, dt: float, q: float) -> None:
    """Pull the attitude to the specific force; q: variance of the gyros' rate, rad^2/s^2."""
    f, workspace, P = belief.f, belief.workspace, belief.P
    size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if not size > FREE_FALL_FORCE:
        return
    n0, n1, _ = _upwards(belief.C_nb, f, size)
    north, east = off_vertical(belief.C_nb, f)
    white = workspace[ACCELERATION]
    lasting = level_density(belief, size, north, east, dt, q) - white
    # of an acceleration that lasts longer than the pull takes, an observer follows no more than all
    workspace[LEVEL] = white + lasting / (1 + workspace[DISTURBANCE] * workspace[K1])
    if workspace[K1] == 0:
        return
    variance = workspace[LEVEL] / (GRAVITY_EQUATOR * GRAVITY_EQUATOR * dt)
    gain = _gains(belief, workspace[K1], dt)
    gain_update(P, workspace[K_NORTH], 1.0, 0.0, 0.0, variance)
    gain_update(P, workspace[K_EAST], 0.0, 1.0, 0.0, variance)
    level_bias(belief, workspace[K_NORTH], workspace[K_EAST])
    workspace[LEAN_N] += gain * n1
    workspace[LEAN_E] -= gain * n0
    _pull(belief, -n1, n0, 0.0, gain)


@helper
def _gains(belief: FilterState, k: float, seconds: float) -> float:
    """Return the gain of a correction by k (1/s) over `seconds`, exact for a small error that
    nothing else corrects; write those of the six states, K_NORTH to K_DOWN."""
    workspace, C = belief.workspace, belief.C_nb
    gain = 1 - decay(k * min(seconds, MAX_GAP))
    K_north, K_east, K_down = workspace[K_NORTH], workspace[K_EAST], workspace[K_DOWN]
    for i in range(3):
        K_north[i] = K_east[i] = K_down[i] = 0.0
        K_north[3 + i] = -workspace[KI] * gain * C[0, i]
        K_east[3 + i] = -workspace[KI] * gain * C[1, i]
        K_down[3 + i] = -workspace[KI] * gain * C[2, i]
    K_north[0] = K_east[1] = K_down[2] = gain
    return gain


@helper
def _upwards(C: Array, f: Array, size: float) -> tuple[float, float, float]:
    """The unit vector of the specific force f of that size, in n."""
    return rotate_vector(C, f[0] / size, f[1] / size, f[2] / size)


@helper
def _pull(belief: FilterState, x: float, y: float, z: float, gain: float) -> None:
    """Rotate the attitude by the cross product (x, y, z), in n, times `gain`, and correct the gyro
    bias by it."""
    C, bias = belief.C_nb, belief.workspace[KI] * gain
    for i in range(3):
        belief.b_g[i] -= bias * (C[0, i] * x + C[1, i] * y + C[2, i] * z)
    rotate_left(gain * x, gain * y, gain * z, C)


@helper
def _heading_pulled(belief: FilterState, variance: float, innovation: Array) -> None:
    """P, the sensitivity to accelerometer biases and the whitened innovation of a heading (rad) of
    that variance, by the gains K_DOWN."""
    workspace, K = belief.workspace, belief.workspace[K_DOWN]
    biases, sensitivity = workspace[BIAS_VARIANCE], matrix(workspace, SENSITIVITY, 6, 3)
    known = belief.P[8, 8]
    count_bias(belief.P, sensitivity, biases, -1.0)
    gain_update(belief.P, K, 0.0, 0.0, 1.0, variance)
    absorb_bias(sensitivity, K, 0.0, 0.0, 1.0, (0.0, 0.0, 0.0))
    count_bias(belief.P, sensitivity, biases, 1.0)
    if innovation.size > 3 and known + variance > 0:
        innovation[3] = innovation[0] / math.sqrt(known + variance)
    if innovation.size > 6:
        innovation[6] = math.sqrt(known + variance)


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
    """Pull the attitude to a magnetic field or a compass; the innovation is the angle about the
    vertical, rad. It does not gate."""
    workspace, C = belief.workspace, belief.C_nb
    for i in range(innovation.size):
        innovation[i] = math.nan
    if kind == Kind.MAGNETIC_FIELD:
        _field(belief, y, std, source, innovation)
    elif kind == Kind.HEADING:
        innovation[0] = wrap(y[0] - math.atan2(C[1, 0], C[0, 0]))
        if not math.isnan(innovation[0]):
            gain = _gains(belief, workspace[K3], workspace[SINCE_COMPASS])
            _heading_pulled(belief, std[0] * std[0], innovation)
            _pull(belief, 0.0, 0.0, math.sin(innovation[0]), gain)
            workspace[SINCE_COMPASS] = 0.0
            if workspace[K3] > 0:
                workspace[HEADED] = workspace[CLOCK]
    return math.nan


@helper
def _field(belief: FilterState, y: Array, std: Array, source: SourceRow, innovation: Array) -> None:
    """The field y (T, body) across the specific force, against magnetic north across the
    vertical."""
    C, workspace, f = belief.C_nb, belief.workspace, belief.f
    size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if not size > FREE_FALL_FORCE:
        return
    u0, u1, u2 = _upwards(C, f, size)
    m0, m1, m2 = rotate_vector(C, y[0], y[1], y[2])
    along = m0 * u0 + m1 * u1 + m2 * u2
    m0, m1, m2 = m0 - along * u0, m1 - along * u1, m2 - along * u2
    size, level = (
        math.sqrt(m0 * m0 + m1 * m1 + m2 * m2),
        math.sqrt(
            source.parameters[0] * source.parameters[0]
            + source.parameters[1] * source.parameters[1]
        ),
    )
    if not (size > 0 and level > 0):
        return
    seconds = min(workspace[SINCE_FIELD], MAX_GAP)
    workspace[SINCE_FIELD] = 0.0
    if is_field_rejected(belief, y, std, source, size * size, -along):
        return
    n0, n1 = source.parameters[0] / level, source.parameters[1] / level
    innovation[0] = math.atan2(m0 * n1 - m1 * n0, m0 * n0 + m1 * n1)
    density, strength, dip = field_density(belief, source, size * size, -along, seconds)
    if workspace[K2] > 0:
        field_used(workspace, source, strength, dip)
    # levelled by a force that leans, the azimuth errs by the lean times the tangent of the dip
    density += workspace[LEVEL] * (along / (size * GRAVITY_EQUATOR)) ** 2
    noise = (std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / (3 * size * size)
    gain = _gains(belief, workspace[K2], seconds)
    _heading_pulled(belief, noise + (density / seconds if seconds > 0 else 0.0), innovation)
    _pull(
        belief,
        -m2 * n1 / size,
        m2 * n0 / size,
        (m0 * n1 - m1 * n0) / size,
        gain,
    )


MAHONY = Filter(
    "mahony",
    "Mahony, Hamel & Pflimlin (2008), IEEE TAC 53(5); Grip et al. (2013); Fossen (2021) section "
    "14.2",
    start,
    predict,
    correct,
    states=SIX,
    estimates=SIX,
    slots=SLOTS,
    uses=("magnetic-field", "heading"),
    unaided_note=UNAIDED,
    conditions=attitude_mekf.CONDITIONS,
    condition=HOLDS,
    weighs=False,
    bias=DECAYING,
    good_for="attitude at a small cost, on small processors",
    poor_for="claimed std, which is too large at rest; long turns",
)
