"""Nonlinear attitude observer with gyro bias: the rate is corrected by the cross products of
measured and expected directions.

q' = T(omega - b + sigma) q, b' = -k_i sigma, sigma = sum of k_j v_j x R' v0_j. The directions are
specific force (up), magnetic field projected on the horizontal plane, and compass; those that are
measured are used, whatever the combination. No covariance, so no standard deviations. The specific
force is low-passed in a frame that the gyros carry, which keeps most of the body's own
accelerations out.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...checks import check_number
from ...core.contract import (
    CORRECT,
    HEADING_KIND,
    MAGNETIC_KIND,
    PREDICT,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Start,
    helper,
    kernel,
)
from ...core.earth import RATE
from ...core.kalman import decay
from ...core.rotation import orthonormalise, rotate_left, turned, wrap
from ...typing import Array
from .attitude_error_state import FREE_FALL_FORCE, SIX, UNAIDED, low_passed, turn

SLOTS = Slots()
EARTH_N, EARTH_D = SLOTS.numbers("EARTH_N", "EARTH_D")  # Earth rate, rad/s
K1, K2, K3, KI = SLOTS.numbers("K1", "K2", "K3", "KI")  # gains, 1/s
LOW_PASS = SLOTS.number("LOW_PASS")  # s
# s that the specific force is a mean over, and since the last field and compass
SECONDS, SINCE_FIELD, SINCE_COMPASS = SLOTS.numbers("SECONDS", "SINCE_FIELD", "SINCE_COMPASS")
TOLD = SLOTS.number("TOLD")  # accelerometer noise while there are samples
LONGEST_GAP = 1.0
"""s: a direction that was not measured for longer counts as if it were for so long."""


def start(
    start: Start,
    noise: Noise,
    k1: float = 0.5,
    k2: float = 0.1,
    k3: float = 0.1,
    ki: float = 0.005,
    low_pass: float = 2.0,
) -> Belief:
    """Belief at `start`. Gains: k1 of the specific force, k2 of the magnetic field, k3 of a compass
    (1/s; 0 leaves it out), ki of the bias (1/s, times sigma). low_pass: time constant of the
    specific force, s, carried along by the gyros; 0 is the published observer. Refuses unstable
    gains.
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
    belief = start.belief(SLOTS.zeros())
    workspace, lat = belief.workspace, belief.lla[0]
    workspace[EARTH_N], workspace[EARTH_D] = RATE * math.cos(lat), -RATE * math.sin(lat)
    (
        workspace[K1],
        workspace[K2],
        workspace[K3],
        workspace[KI],
        workspace[LOW_PASS],
        workspace[TOLD],
    ) = k1, k2, k3, ki, low_pass, noise.accel
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
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Turn the attitude with the bias-free gyros and pull it to the specific force."""
    workspace, bg, f, C = belief.workspace, belief.bg, belief.f, belief.C
    if dt <= 0:
        return
    r0, r1, r2 = u[0] - bg[0] * dt, u[1] - bg[1] * dt, u[2] - bg[2] * dt
    turn(belief, r0, r1, r2, workspace[EARTH_N] * dt, workspace[EARTH_D] * dt, dt)
    keep = decay(noise.gyro_decay * dt)
    for i in range(3):
        bg[i] *= keep
    workspace[SINCE_FIELD] += dt
    workspace[SINCE_COMPASS] += dt
    made_up = noise.accel > workspace[TOLD]  # the loop adds noise in a gap
    workspace[SECONDS] = low_passed(
        belief, u, r0, r1, r2, dt, workspace[LOW_PASS], workspace[SECONDS], made_up
    )
    size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if size > FREE_FALL_FORCE and workspace[K1] > 0 and not made_up:
        n0, n1, _ = _upwards(C, f, size)
        _pull(belief, -n1, n0, 0.0, workspace[K1], dt)
    orthonormalise(C)


@helper
def _upwards(C: Array, f: Array, size: float) -> tuple[float, float, float]:
    """The unit vector of the specific force f of that size, in n."""
    return turned(C, f[0] / size, f[1] / size, f[2] / size)


@helper
def _pull(belief: Belief, x: float, y: float, z: float, k: float, seconds: float) -> None:
    """What k times the cross product (x, y, z), in n, does in that time: exact for a small error
    that nothing else corrects."""
    gain, C = 1 - decay(k * min(seconds, LONGEST_GAP)), belief.C
    bias = belief.workspace[KI] * gain
    for i in range(3):
        belief.bg[i] -= bias * (C[0, i] * x + C[1, i] * y + C[2, i] * z)
    rotate_left(gain * x, gain * y, gain * z, C)


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
    """Pull the attitude to a magnetic field or a compass; the innovation is the angle about the
    vertical, rad. It does not gate."""
    workspace, C = belief.workspace, belief.C
    innovation[0] = innovation[1] = innovation[2] = math.nan
    if kind == MAGNETIC_KIND:
        _field(belief, y, parameters, innovation)
    elif kind == HEADING_KIND:
        innovation[0] = wrap(y[0] - math.atan2(C[1, 0], C[0, 0]))
        if not math.isnan(innovation[0]):
            _pull(
                belief, 0.0, 0.0, math.sin(innovation[0]), workspace[K3], workspace[SINCE_COMPASS]
            )
            workspace[SINCE_COMPASS] = 0.0
    return math.nan


@helper
def _field(belief: Belief, y: Array, parameters: Array, innovation: Array) -> None:
    """The field y (T, body) across the specific force, against magnetic north across the
    vertical."""
    C, workspace, f = belief.C, belief.workspace, belief.f
    size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if not size > FREE_FALL_FORCE:
        return
    u0, u1, u2 = _upwards(C, f, size)
    m0, m1, m2 = turned(C, y[0], y[1], y[2])
    along = m0 * u0 + m1 * u1 + m2 * u2
    m0, m1, m2 = m0 - along * u0, m1 - along * u1, m2 - along * u2
    size, level = (
        math.sqrt(m0 * m0 + m1 * m1 + m2 * m2),
        math.sqrt(parameters[0] * parameters[0] + parameters[1] * parameters[1]),
    )
    if not (size > 0 and level > 0):
        return
    n0, n1 = parameters[0] / level, parameters[1] / level
    innovation[0] = math.atan2(m0 * n1 - m1 * n0, m0 * n0 + m1 * n1)
    _pull(
        belief,
        -m2 * n1 / size,
        m2 * n0 / size,
        (m0 * n1 - m1 * n0) / size,
        workspace[K2],
        workspace[SINCE_FIELD],
    )
    workspace[SINCE_FIELD] = 0.0


MAHONY = Filter(
    "mahony",
    "Mahony, Hamel & Pflimlin (2008), IEEE TAC 53(5); Grip et al. (2013); Fossen (2021) section "
    "14.2",
    start,
    predict,
    correct,
    states=(),
    estimates=SIX,
    slots=SLOTS,
    uses=("magnetic-field", "heading"),
    unaided_note=UNAIDED,
)
