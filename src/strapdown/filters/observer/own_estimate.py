"""The exogenous filter while estimate and observer agree: linearised at the estimate itself, but at
the heading of the observer where that is the better known one.

Without turns the bias of a poor gyro makes the heading uncertain by tens of degrees, and no fix
corrects it. At such a heading the model joins tilt (n) and accelerometer bias (body) wrongly, and
what it has learnt of the two no longer agrees when the heading is corrected. So it is taken at the
estimate turned back by TURN, to the observer's heading; TURN is what remains of delta. Errors are
counted from the estimate, and P is theirs: to first order its tilts lie half of TURN further about
the vertical than those about the heading of the model, log(exp(a) exp([0 0 -TURN])).
"""

import math

from ...core.contract import (
    ATTITUDE_KIND,
    COURSE_KIND,
    HEADING_KIND,
    STATES,
    Belief,
    Noise,
    Observe,
    Slots,
    matrix,
)
from ...core.error_state import (
    DX,
    JACOBIAN,
    WORK,
    X,
    bias_free,
    inject,
    inject_biases,
    linearised_step,
    observed,
    turn_half,
)
from ...core.jit import helper, inlined
from ...core.kalman import update, used_rows
from ...core.mechanization import mechanize
from ...core.rotation import wrap
from ...typing import Array
from .equations import LARGEST_COURSE_SD, SINCE_COURSE, SINCE_FIELD, SINCE_HEADING, TRUSTED

OWN = Slots()
TURN = OWN.number("TURN")  # rad, estimated heading less that of the model
DOUBT = OWN.number("DOUBT")  # forgetting mean of the NIS by rows
AT = OWN.matrix("AT", 3, 3)  # attitude that the model is taken at
CERTAIN = 0.5 * LARGEST_COURSE_SD
"""Standard deviation of the heading, rad, below which the model is taken at it."""
SHARE = 0.05
"""Of a fix in DOUBT."""
LARGEST_NIS = 10.0
"""By rows, that counts in DOUBT: one outlier is no reason for it."""
LOST = 2.0
"""DOUBT, 1 for a filter that is right, beyond which the fixes speak against the estimate."""
WITHIN = 3.0
"""Standard deviations that the observer's heading may be off the estimate to be taken."""


@inlined
def carry_own(belief: Belief, own: Array, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the belief over dt."""
    workspace, x, z = belief.workspace, belief.workspace[X], own[TURN]
    if z != 0:
        for i in range(STATES):
            x[i] = 0.0
        x[8] = z
        turn_heading(belief.C, -z)
        turn_tilt(belief.P, -0.5 * z)
    r0, r1, r2, a0, a1, a2 = bias_free(u, belief.ba, belief.bg, dt)
    linearised_step(belief, belief.C, 1.0, u, dt, noise, z != 0)
    mechanize(belief.lla, belief.v, belief.C, r0, r1, r2, a0, a1, a2, dt, workspace[DX], 1.0)
    if z != 0:
        x[8] -= z
        inject(belief.lla, belief.v, belief.C, x)
        turn_heading(belief.C, z)
        turn_tilt(belief.P, 0.5 * z)


@inlined
def correct_own(
    belief: Belief,
    own: Array,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and the belief by one fix, and the doubt about it. Returns the NIS."""
    workspace, n, z, C = belief.workspace, belief.P.shape[0], own[TURN], matrix(own, AT, 3, 3)
    dx, H = workspace[DX], matrix(workspace, JACOBIAN, 3, n)
    rows = observed(turned_back(belief, C, z), y, observe, parameters, innovation, H)
    if z != 0:
        for i in range(rows):
            innovation[i] -= H[i, 8] * z
            if kind == HEADING_KIND or kind == COURSE_KIND or kind == ATTITUDE_KIND:
                innovation[i] = wrap(innovation[i])
            H[i, 6], H[i, 7] = rotated(H[i, 6], H[i, 7], 0.5 * z)
    nis = update(belief.P, H, innovation, sd, rows, gate, workspace[WORK], dx)
    if nis == nis and gate >= 0:  # not where it is only asked
        by_rows = min(nis / workspace[WORK.start + used_rows(n)], LARGEST_NIS)
        own[DOUBT] += SHARE * (by_rows - own[DOUBT])
    if nis <= gate:
        if z != 0:
            dx[6], dx[7] = rotated(dx[6], dx[7], -0.5 * z)
            turn_tilt(belief.P, 0.5 * dx[8])
            own[TURN] += dx[8]
        else:
            turn_half(belief.P, dx[6], dx[7], dx[8])
        inject(belief.lla, belief.v, C, dx)
        inject_biases(belief, dx)
        for i in range(3):
            for j in range(3):
                belief.C[i, j] = C[i, j]
        turn_heading(belief.C, z)
    return nis


@inlined
def turned_back(belief: Belief, C: Array, z: float) -> Belief:
    """The belief at the heading of the model, its attitude in C."""
    for i in range(3):
        for j in range(3):
            C[i, j] = belief.C[i, j]
    turn_heading(C, -z)
    return Belief(
        belief.lla,
        belief.v,
        C,
        belief.ba,
        belief.bg,
        belief.P,
        belief.omega,
        belief.f,
        belief.workspace,
        belief.extra_states,
    )


@inlined
def take_heading(belief: Belief, bar: Belief, own: Array) -> None:
    """Decide the heading of the model: the observer's where something tells it one, the estimate's
    is uncertain, and the two do not contradict each other.

    The observer's turns leave the errors about the model as they are, and with them P.
    """
    said, C, variance = bar.workspace, belief.C, belief.P[8, 8]
    z = wrap(math.atan2(C[1, 0], C[0, 0]) - math.atan2(bar.C[1, 0], bar.C[0, 0]))
    since = min(said[SINCE_COURSE], min(said[SINCE_HEADING], said[SINCE_FIELD]))
    if since > TRUSTED or variance < CERTAIN * CERTAIN or z * z > WITHIN * WITHIN * variance:
        own[TURN] = 0.0
    else:
        if own[TURN] != 0:
            turn_tilt(belief.P, 0.5 * wrap(z - own[TURN]))
        own[TURN] = z


@helper
def turn_heading(C: Array, z: float) -> None:
    """C <- exp([0 0 z]) C, rad."""
    if z != 0:
        c, s = math.cos(z), math.sin(z)
        for j in range(3):
            C[0, j], C[1, j] = c * C[0, j] - s * C[1, j], s * C[0, j] + c * C[1, j]


@helper
def turn_tilt(P: Array, z: float) -> None:
    """P of tilts that are turned by z (rad) about the vertical."""
    c, s = math.cos(z), math.sin(z)
    for j in range(P.shape[0]):
        P[6, j], P[7, j] = c * P[6, j] - s * P[7, j], s * P[6, j] + c * P[7, j]
    for j in range(P.shape[0]):
        P[j, 6], P[j, 7] = c * P[j, 6] - s * P[j, 7], s * P[j, 6] + c * P[j, 7]


@helper
def rotated(x: float, y: float, z: float) -> tuple[float, float]:
    """The vector (x, y) turned by z (rad)."""
    c, s = math.cos(z), math.sin(z)
    return c * x - s * y, s * x + c * y
