"""The chapter's filters whose attitude states are Euler angles, as printed: a direct extended Kalman
filter (14.3.3), and an indirect one with feedback (14.4.2 in Euler angles, the published ins_euler.m).

Angles are integrated by their own rates and corrected by adding to them, and the covariance is that
of the angles. Nothing keeps them from a pitch of 90 deg, where T(Theta) has no value. With
w = omega - b_ars, f = f_imu - b_acc and the order of the library:

    p' = v, v' = R(Theta) f + g, Theta' = T(Theta) w, b_acc' = -b_acc/T_acc, b_ars' = -b_ars/T_ars

    direct: dv' = d(R f)/dTheta dTheta - R db_acc, dTheta' = d(T w)/dTheta dTheta - T db_ars
    indirect, printed: dv' = -R S(f) dTheta - R db_acc, dTheta' = -S(w) dTheta - db_ars

The printed indirect errors are those of a small rotation in body axes, which is then added to the
angles; corrected, they are those of the direct filter. The Earth turns and is round in the prediction
of the state, as the simulated one is; the Jacobians know a flat one, as printed.
"""

import math
from collections.abc import Sequence
from typing import Any

from strapdown.checks import check_choice
from strapdown.core.compile.jit import helper, inlined, matrix
from strapdown.core.loop.contract import (
    CORRECT,
    HELD,
    PREDICT,
    RANDOM_WALK,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    Source,
    SourceRow,
    kernel,
)
from strapdown.core.mathematics.earth import displace, place, rotation_rates
from strapdown.core.mathematics.error_state import bias_free, decay_biases, publish_rates
from strapdown.core.mathematics.kalman import WORKSPACE, update
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.core.mathematics.rotation import Three, euler_to_matrix, rotate_vector
from strapdown.typing import Array

SLOTS = Slots()
MAX_COLUMN = "max_angle_sd [rad]"
# standard deviation of an angle that a prediction left, the largest so far
MAX = SLOTS.output(MAX_COLUMN)
ANGLES = SLOTS.array("ANGLES", 3)  # roll, pitch, heading, rad
P_ANGLES = SLOTS.matrix("P_ANGLES", STATES, STATES)  # covariance, with errors of the angles
F = SLOTS.matrix("F", STATES, STATES)  # 1/s
PHI = SLOTS.matrix("PHI", STATES, STATES)
PRODUCT = SLOTS.matrix("PRODUCT", STATES, STATES)
T = SLOTS.matrix("T", 3, 3)  # T(Theta)
H = SLOTS.matrix("H", 3, STATES)
DX = SLOTS.array("DX", STATES)
FORCE = SLOTS.array("FORCE", 3)  # specific-force velocity increment in n, m/s
WORK = SLOTS.array("WORK", WORKSPACE)  # of core.mathematics.kalman
PRINTED = SLOTS.number("PRINTED")  # 1 where the errors are the printed ones of the indirect filter
ERRORS = {"corrected": 0.0, "printed": 1.0}
KINDS = ("position", "velocity", "heading")


def start(start: InitialState, noise: Noise) -> FilterState:
    """Belief of the direct filter at `start`."""
    if len(start.sd) > STATES:
        raise ValueError("it knows no states of aidings; give sources without any")
    belief = start.belief(SLOTS.zeros())
    slots = SLOTS.named(belief.workspace)
    slots["ANGLES"][:], slots["P_ANGLES"][:] = start.rph, belief.P
    return belief


def start_indirect(begin: InitialState, noise: Noise, errors: str = "printed") -> FilterState:
    """Belief of the indirect filter at `begin`. errors: "printed", a small rotation in body axes that
    is added to the angles, or "corrected", the errors of the angles."""
    belief = start(begin, noise)
    belief.workspace[PRINTED] = ERRORS[check_choice(errors, "errors", ERRORS)]
    return belief


def configure(
    options: dict[str, Any], aidings: Sequence[Source]
) -> tuple[dict[str, Any], list[str]]:
    """Refuses an antenna away from the IMU, which the printed rows do not know."""
    for aiding in aidings:
        if any(aiding.parameters[:3]):
            raise ValueError(
                f"{aiding.name or aiding.kind} has a lever arm, which its printed rows do not know: "
                "give the fixes of the IMU's own place"
            )
    return options, []


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """P of the angles by I + F dt at the state, then the state; the angles by the midpoint rule."""
    if dt <= 0:
        return
    workspace, C, angles = belief.workspace, belief.C, belief.workspace[ANGLES]
    r, a = bias_free(u, belief.ba, belief.bg, dt)
    transform(angles, matrix(workspace, T, 3, 3))
    _jacobian(belief, r, a, dt, noise)
    _propagate(belief, dt, noise)
    sine, cosine, M, N = place(belief.lla[0], belief.lla[2])
    _, _, w0, w1, w2 = rotation_rates(belief.v[0], belief.v[1], sine, cosine, M, N)
    roll, pitch, heading = angles[0], angles[1], angles[2]
    for half in range(2):
        b0 = r[0] - dt * (C[0, 0] * w0 + C[1, 0] * w1 + C[2, 0] * w2)
        b1 = r[1] - dt * (C[0, 1] * w0 + C[1, 1] * w1 + C[2, 1] * w2)
        b2 = r[2] - dt * (C[0, 2] * w0 + C[1, 2] * w1 + C[2, 2] * w2)
        d0, d1, d2 = rotate_vector(matrix(workspace, T, 3, 3), b0, b1, b2)
        share = 0.5 + 0.5 * half
        angles[0], angles[1], angles[2] = (
            roll + share * d0,
            pitch + share * d1,
            heading + share * d2,
        )
        transform(angles, matrix(workspace, T, 3, 3))
    mechanize(belief.lla, belief.v, C, r, a, dt, workspace[FORCE])
    publish_rates(belief, r, a, dt)
    decay_biases(belief.ba, belief.bg, dt, noise)
    _publish(belief)


@helper
def transform(angles: Array, to: Array) -> None:
    """T(Theta) (3, 3) from angles, rad."""
    sr, cr, cp, tp = (
        math.sin(angles[0]),
        math.cos(angles[0]),
        math.cos(angles[1]),
        math.tan(angles[1]),
    )
    to[0, 0], to[0, 1], to[0, 2] = 1.0, sr * tp, cr * tp
    to[1, 0], to[1, 1], to[1, 2] = 0.0, cr, -sr
    to[2, 0], to[2, 1], to[2, 2] = 0.0, sr / cp, cr / cp


@helper
def _jacobian(belief: FilterState, r: Three, a: Three, dt: float, noise: Noise) -> None:
    """F (15, 15) at the state, from the increments of a sample in the body, rad and m/s."""
    w0, w1, w2 = r[0] / dt, r[1] / dt, r[2] / dt
    f0, f1, f2 = a[0] / dt, a[1] / dt, a[2] / dt
    workspace, C, angles = belief.workspace, belief.C, belief.workspace[ANGLES]
    J, to = matrix(workspace, F, STATES, STATES), matrix(workspace, T, 3, 3)
    for i in range(STATES):
        for j in range(STATES):
            J[i, j] = 0.0
    printed = workspace[PRINTED] > 0
    for i in range(3):
        J[i, 3 + i] = 1.0
        J[9 + i, 9 + i], J[12 + i, 12 + i] = -noise.accel_decay, -noise.gyro_decay
        for j in range(3):
            J[3 + i, 9 + j] = -C[i, j]
            J[6 + i, 12 + j] = -(1.0 if i == j else 0.0) if printed else -to[i, j]
        if printed:
            J[3 + i, 6] = -(C[i, 1] * f2 - C[i, 2] * f1)
            J[3 + i, 7] = -(C[i, 2] * f0 - C[i, 0] * f2)
            J[3 + i, 8] = -(C[i, 0] * f1 - C[i, 1] * f0)
        else:  # by roll: R (e_x x f)
            J[3 + i, 6] = C[i, 2] * f1 - C[i, 1] * f2
    if printed:
        J[6, 7], J[6, 8], J[7, 6], J[7, 8], J[8, 6], J[8, 7] = w2, -w1, -w2, w0, w1, -w0
        return
    n0, n1, n2 = rotate_vector(C, f0, f1, f2)
    sh, ch = math.sin(angles[2]), math.cos(angles[2])
    J[3, 7], J[4, 7], J[5, 7] = ch * n2, sh * n2, -(sh * n1 + ch * n0)
    J[3, 8], J[4, 8] = -n1, n0
    sr, cr, cp, tp = (
        math.sin(angles[0]),
        math.cos(angles[0]),
        math.cos(angles[1]),
        math.tan(angles[1]),
    )
    across, along = sr * w1 + cr * w2, cr * w1 - sr * w2
    J[6, 6], J[7, 6], J[8, 6] = tp * along, -across, along / cp
    J[6, 7], J[8, 7] = across / (cp * cp), across * tp / cp


@helper
def _propagate(belief: FilterState, dt: float, noise: Noise) -> None:
    """P <- (I + F dt) P (I + F dt)' + Q dt; the gyros' noise reaches the angles as their bias
    does."""
    workspace = belief.workspace
    J, Phi, X, P, to = (
        matrix(workspace, F, STATES, STATES),
        matrix(workspace, PHI, STATES, STATES),
        matrix(workspace, PRODUCT, STATES, STATES),
        matrix(workspace, P_ANGLES, STATES, STATES),
        matrix(workspace, T, 3, 3),
    )
    for i in range(STATES):
        for j in range(STATES):
            Phi[i, j] = dt * J[i, j] + (1.0 if i == j else 0.0)
    _times(Phi, P, X)
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] = X[j, i]  # (Phi P)' = P Phi'
    _times(Phi, P, X)
    printed = workspace[PRINTED] > 0
    for i in range(3):
        X[3 + i, 3 + i] += noise.accel * noise.accel * dt
        X[9 + i, 9 + i] += noise.accel_bias * noise.accel_bias * dt
        X[12 + i, 12 + i] += noise.gyro_bias * noise.gyro_bias * dt
        for j in range(3):
            q = 1.0 if i == j else 0.0
            if not printed:
                q = to[i, 0] * to[j, 0] + to[i, 1] * to[j, 1] + to[i, 2] * to[j, 2]
            X[6 + i, 6 + j] += q * noise.gyro * noise.gyro * dt
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] = 0.5 * (X[i, j] + X[j, i])
    for i in range(6, 9):
        workspace[MAX] = max(workspace[MAX], math.sqrt(max(P[i, i], 0.0)))


@helper
def _times(A: Array, B: Array, to: Array) -> None:
    """to <- A B of matrices (15, 15), where most of A is zero."""
    for i in range(STATES):
        for j in range(STATES):
            to[i, j] = 0.0
        for k in range(STATES):
            if A[i, k] != 0:
                for j in range(STATES):
                    to[i, j] += A[i, k] * B[k, j]


@helper
def _publish(belief: FilterState) -> None:
    """C by the angles, and P of the library's errors: a change of the angles is a small rotation in
    n of J times it."""
    workspace, angles = belief.workspace, belief.workspace[ANGLES]
    euler_to_matrix(angles[0], angles[1], angles[2], belief.C)
    P, X = matrix(workspace, P_ANGLES, STATES, STATES), matrix(workspace, PRODUCT, STATES, STATES)
    sp, cp, sh, ch = (
        math.sin(angles[1]),
        math.cos(angles[1]),
        math.sin(angles[2]),
        math.cos(angles[2]),
    )
    for i in range(STATES):
        for j in range(STATES):
            X[i, j] = P[i, j]
    for j in range(STATES):
        X[6, j], X[7, j], X[8, j] = _rotation(X[6, j], X[7, j], X[8, j], sp, cp, sh, ch)
    for i in range(STATES):
        X[i, 6], X[i, 7], X[i, 8] = _rotation(X[i, 6], X[i, 7], X[i, 8], sp, cp, sh, ch)
    for i in range(STATES):
        for j in range(STATES):
            belief.P[i, j] = X[i, j]


@inlined
def _rotation(
    roll: float, pitch: float, heading: float, sp: float, cp: float, sh: float, ch: float
) -> tuple[float, float, float]:
    """The small rotation in n that changes the angles by so much."""
    return (
        ch * cp * roll - sh * pitch,
        sh * cp * roll + ch * pitch,
        heading - sp * roll,
    )


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P of the angles, and add the correction to the state; the row of a compass is
    [0 0 1] on the angles."""
    workspace = belief.workspace
    row, P = matrix(workspace, H, 3, STATES), matrix(workspace, P_ANGLES, STATES, STATES)
    for i in range(innovation.size):
        innovation[i] = math.nan
    rows = observe(belief, y, source, innovation, row)
    first = 0 if kind == Kind.POSITION else (8 if kind == Kind.HEADING else 3)
    for i in range(3):
        for j in range(STATES):
            row[i, j] = 1.0 if j == first + i else 0.0
    dx = workspace[DX]
    nis = update(P, row, innovation, sd, rows, gate, workspace[WORK], dx)
    if nis <= gate:
        displace(belief.lla, dx[0], dx[1], dx[2])
        for i in range(3):
            belief.v[i] += dx[3 + i]
            workspace[ANGLES][i] += dx[6 + i]
            belief.ba[i] += dx[9 + i]
            belief.bg[i] += dx[12 + i]
        _publish(belief)
    return nis


DIRECT = Filter(
    "euler-direct",
    "Fossen (2021) section 14.3.3, as printed",
    start,
    predict,
    correct,
    slots=SLOTS,
    uses=KINDS,
    configure=configure,
    bias=RANDOM_WALK,
)
INDIRECT = Filter(
    "euler-indirect",
    "Fossen (2021) section 14.4.2 in Euler angles, as the published ins_euler.m",
    start_indirect,
    predict,
    correct,
    slots=SLOTS,
    uses=KINDS,
    configure=configure,
    bias=HELD,
)
EULER_FILTERS = {filter.name: filter for filter in (DIRECT, INDIRECT)}
"""The values, which no name of the library finds: `strapdown.register` makes one known."""
