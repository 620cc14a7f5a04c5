"""The chapter's Kalman filters as printed: direct and indirect, with Euler angles, with the attitude of
an AHRS, and the multiplicative one.

With w = omega - b_ars, f = f_imu - b_acc, R the attitude and T what makes angle rates of body rates, in
the order of the library:

    p' = v, v' = R f + g, Theta' = T w, b_acc' = -b_acc/T_acc, b_ars' = -b_ars/T_ars

    euler-direct (14.3.3): dv' = d(R f)/dTheta dTheta - R db_acc, dTheta' = d(T w)/dTheta dTheta - T db_ars
    euler-indirect (ins_euler.m): dv' = -R S(f) dTheta - R db_acc, dTheta' = -S(w) dTheta - db_ars
    ahrs-direct, ahrs-indirect (14.3.2, ins_ahrs.m): dv' = -R db_acc, dTheta' = -T db_ars
    mekf-printed (14.4.3, ins_mekf.m): as euler-indirect, with a 2 x Gibbs vector in place of dTheta

The errors of ins_euler are those of a small rotation in body axes, which is then added to the angles;
"corrected", they are those of the direct filter. R and T of an AHRS are those of its last record, which
the gyros carry on; with it the direct filter and the indirect one with feedback are one recursion, and
differ in the model of the biases. Euler angles are integrated by their own rates and corrected by adding
to them: nothing keeps them from a pitch of 90 deg, where T has no value.

Ad = I + h A in the direct filter with Euler angles, I + h A + (h A)^2/2 elsewhere. The Earth turns and is
round in the prediction of the state, as the simulated one is; the Jacobians know a flat one, as
printed. Measurements of one time are taken one after the other.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from strapdown.checks import check_choice
from strapdown.core.compile.jit import helper, matrix
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
    SourceLike,
    SourceRow,
    kernel,
)
from strapdown.core.mathematics.earth import displace, place, rotation_rates
from strapdown.core.mathematics.error_state import bias_free, decay_biases, publish_rates
from strapdown.core.mathematics.kalman import WORKSPACE, update
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.core.mathematics.rotation import (
    Three,
    euler_to_matrix,
    matrix_to_euler,
    orthonormalise,
    rotate_right,
    rotate_vector,
    wrap,
)
from strapdown.filters.ins.mekf import rotation_vector
from strapdown.typing import Array

SLOTS = Slots()
MAX_COLUMN = "max_angle_std [rad]"
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
KNOWN = SLOTS.matrix("KNOWN", 3, 3)  # R: the attitude that turns the force
STD = SLOTS.array("STD", 3)  # of a unit vector
FORM = SLOTS.number("FORM")  # of the errors of attitude, one of the four below
COMPASS = SLOTS.number("COMPASS")  # 1 where the row of a compass is the printed one of the MEKF
OF_ANGLES, ADDED, OF_AHRS, GIBBS = 0.0, 1.0, 2.0, 3.0
ERRORS = {"corrected": OF_ANGLES, "printed": ADDED}
COMPASSES = {"corrected": 0.0, "printed": 1.0}
KINDS = ("position", "velocity", "heading")
GRAVITY_SIZE = 9.82
"""m/s^2: by which a standard deviation of the constraint `gravity` is that of a unit vector."""


def start(start: InitialState, noise: Noise) -> FilterState:
    """Belief of the direct filter at `start`."""
    return _begin_filter(start, OF_ANGLES)


def start_indirect(start: InitialState, noise: Noise, errors: str = "printed") -> FilterState:
    """Belief of the indirect filter at `start`. errors: "printed", a small rotation in body axes that
    is added to the angles, or "corrected", the errors of the angles."""
    return _begin_filter(start, ERRORS[check_choice(errors, "errors", ERRORS)])


def start_ahrs(start: InitialState, noise: Noise) -> FilterState:
    """Belief of a filter with an AHRS at `start`, whose attitude is the first known one."""
    return _begin_filter(start, OF_AHRS)


def start_mekf(start: InitialState, noise: Noise, compass: str = "printed") -> FilterState:
    """Belief of the multiplicative filter at `start`. compass: its row, "printed", the derivative by
    the Gibbs vector of the whole attitude, or "corrected", by that of the error."""
    belief = _begin_filter(start, GIBBS)
    belief.workspace[COMPASS] = COMPASSES[check_choice(compass, "compass", COMPASSES)]
    A = np.eye(STATES)
    A[6:9, 6:9] = belief.C_nb.T
    SLOTS.views(belief.workspace)["P_ANGLES"][:] = A @ belief.P @ A.T
    return belief


def _begin_filter(start: InitialState, form: float) -> FilterState:
    if len(start.std) > STATES:
        raise ValueError("it knows no states of sources; give sources without any")
    belief = start.belief(SLOTS.zeros())
    slots = SLOTS.views(belief.workspace)
    slots["ANGLES"][:], slots["P_ANGLES"][:], slots["KNOWN"][:] = start.rph, belief.P, belief.C_nb
    belief.workspace[FORM] = form
    return belief


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """Refuses an antenna away from the IMU, which the printed rows do not know."""
    for source in sources:
        if source.kind in ("position", "velocity") and any(source.parameters[:3]):
            raise ValueError(
                f"{source.name or source.kind} has a lever arm, which its printed rows do not know: "
                "give the fixes of the IMU's own place"
            )
    return options, []


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """P by Ad at the state, then the state; the angles by the midpoint rule, with an AHRS by T of its
    attitude."""
    if dt <= 0:
        return
    workspace, angles, form = belief.workspace, belief.workspace[ANGLES], belief.workspace[FORM]
    R, to = matrix(workspace, KNOWN, 3, 3), matrix(workspace, T, 3, 3)
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    if form == OF_AHRS:
        transform(matrix_to_euler(R), to)
    else:
        _copy(belief.C_nb, R)
        transform((angles[0], angles[1], angles[2]), to)
    _jacobian(belief, r, a, dt, noise)
    _propagate(belief, dt, noise)
    if form != GIBBS:
        _turn_angles(belief, r, dt)
    mechanize(belief.lla, belief.v_n, R, r, a, dt, workspace[FORCE])
    if form == GIBBS:
        _copy(R, belief.C_nb)
        orthonormalise(belief.C_nb)
    publish_rates(belief, r, a, dt)
    decay_biases(belief.b_a, belief.b_g, dt, noise)
    _publish(belief)


@helper
def _copy(A: Array, to: Array) -> None:
    """to <- A of matrices (3, 3)."""
    for i in range(3):
        for j in range(3):
            to[i, j] = A[i, j]


@helper
def _turn_angles(belief: FilterState, r: Three, dt: float) -> None:
    """Angles by the rotation r of the body minus that of n, rad, before the velocity moves."""
    workspace, angles = belief.workspace, belief.workspace[ANGLES]
    R, to = matrix(workspace, KNOWN, 3, 3), matrix(workspace, T, 3, 3)
    sine, cosine, M, N = place(belief.lla[0], belief.lla[2])
    _, _, w0, w1, w2 = rotation_rates(belief.v_n[0], belief.v_n[1], sine, cosine, M, N)
    b0 = r[0] - dt * (R[0, 0] * w0 + R[1, 0] * w1 + R[2, 0] * w2)
    b1 = r[1] - dt * (R[0, 1] * w0 + R[1, 1] * w1 + R[2, 1] * w2)
    b2 = r[2] - dt * (R[0, 2] * w0 + R[1, 2] * w1 + R[2, 2] * w2)
    roll, pitch, heading = angles[0], angles[1], angles[2]
    d0, d1, d2 = rotate_vector(to, b0, b1, b2)
    if workspace[FORM] != OF_AHRS:
        transform((roll + 0.5 * d0, pitch + 0.5 * d1, heading + 0.5 * d2), to)
        d0, d1, d2 = rotate_vector(to, b0, b1, b2)
    angles[0], angles[1], angles[2] = roll + d0, pitch + d1, heading + d2


@helper
def transform(angles: Three, to: Array) -> None:
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
    """A (15, 15) at the state, from the increments of a sample in the body, rad and m/s."""
    w, f = (r[0] / dt, r[1] / dt, r[2] / dt), (a[0] / dt, a[1] / dt, a[2] / dt)
    workspace, form = belief.workspace, belief.workspace[FORM]
    J, R, to = (
        matrix(workspace, F, STATES, STATES),
        matrix(workspace, KNOWN, 3, 3),
        matrix(workspace, T, 3, 3),
    )
    of_body = form == ADDED or form == GIBBS
    for i in range(STATES):
        for j in range(STATES):
            J[i, j] = 0.0
    for i in range(3):
        J[i, 3 + i] = 1.0
        J[9 + i, 9 + i], J[12 + i, 12 + i] = -noise.accel_decay, -noise.gyro_decay
        for j in range(3):
            J[3 + i, 9 + j] = -R[i, j]
            J[6 + i, 12 + j] = -(1.0 if i == j else 0.0) if of_body else -to[i, j]
    if of_body:
        _errors_of_body(J, R, w, f)
    elif form == OF_ANGLES:
        _errors_of_angles(J, R, w, f, workspace[ANGLES])


@helper
def _errors_of_body(J: Array, R: Array, w: Three, f: Three) -> None:
    """-R S(f) and -S(w) into A: errors of a small rotation in body axes."""
    for i in range(3):
        J[3 + i, 6] = -(R[i, 1] * f[2] - R[i, 2] * f[1])
        J[3 + i, 7] = -(R[i, 2] * f[0] - R[i, 0] * f[2])
        J[3 + i, 8] = -(R[i, 0] * f[1] - R[i, 1] * f[0])
    J[6, 7], J[6, 8], J[7, 6] = w[2], -w[1], -w[2]
    J[7, 8], J[8, 6], J[8, 7] = w[0], w[1], -w[0]


@helper
def _errors_of_angles(J: Array, R: Array, w: Three, f: Three, angles: Array) -> None:
    """d(R f)/dTheta and d(T w)/dTheta into A."""
    for i in range(3):  # by roll: R (e_x x f)
        J[3 + i, 6] = R[i, 2] * f[1] - R[i, 1] * f[2]
    n0, n1, n2 = rotate_vector(R, f[0], f[1], f[2])
    sh, ch = math.sin(angles[2]), math.cos(angles[2])
    J[3, 7], J[4, 7], J[5, 7] = ch * n2, sh * n2, -(sh * n1 + ch * n0)
    J[3, 8], J[4, 8] = -n1, n0
    sr, cr, cp, tp = (
        math.sin(angles[0]),
        math.cos(angles[0]),
        math.cos(angles[1]),
        math.tan(angles[1]),
    )
    across, along = sr * w[1] + cr * w[2], cr * w[1] - sr * w[2]
    J[6, 6], J[7, 6], J[8, 6] = tp * along, -across, along / cp
    J[6, 7], J[8, 7] = across / (cp * cp), across * tp / cp


@helper
def _propagate(belief: FilterState, dt: float, noise: Noise) -> None:
    """P <- Ad P Ad' + Q dt; the gyros' noise reaches the attitude as their bias does."""
    workspace, form = belief.workspace, belief.workspace[FORM]
    Phi, X, P, to = (
        matrix(workspace, PHI, STATES, STATES),
        matrix(workspace, PRODUCT, STATES, STATES),
        matrix(workspace, P_ANGLES, STATES, STATES),
        matrix(workspace, T, 3, 3),
    )
    _transition(matrix(workspace, F, STATES, STATES), dt, form == OF_ANGLES, X, Phi)
    _times(Phi, P, X)
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] = X[j, i]  # (Phi P)' = P Phi'
    _times(Phi, P, X)
    of_body = form == ADDED or form == GIBBS
    for i in range(3):
        X[3 + i, 3 + i] += noise.accel * noise.accel * dt
        X[9 + i, 9 + i] += noise.accel_bias * noise.accel_bias * dt
        X[12 + i, 12 + i] += noise.gyro_bias * noise.gyro_bias * dt
        for j in range(3):
            q = 1.0 if i == j else 0.0
            if not of_body:
                q = to[i, 0] * to[j, 0] + to[i, 1] * to[j, 1] + to[i, 2] * to[j, 2]
            X[6 + i, 6 + j] += q * noise.gyro * noise.gyro * dt
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] = 0.5 * (X[i, j] + X[j, i])
    for i in range(6, 9):
        workspace[MAX] = max(workspace[MAX], math.sqrt(max(P[i, i], 0.0)))


@helper
def _transition(A: Array, dt: float, first_order: bool, X: Array, to: Array) -> None:
    """Ad of A over dt, by way of X, as printed: to the first or to the second order."""
    for i in range(STATES):
        for j in range(STATES):
            to[i, j] = dt * A[i, j]
    if not first_order:
        _times(to, to, X)
        for i in range(STATES):
            for j in range(STATES):
                to[i, j] += 0.5 * X[i, j]
    for i in range(STATES):
        to[i, i] += 1.0


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
    n of J times it, one of the body a rotation in n of C times it."""
    workspace, angles, C = belief.workspace, belief.workspace[ANGLES], belief.C_nb
    own = workspace[FORM] != GIBBS
    if own:
        euler_to_matrix(angles[0], angles[1], angles[2], C)
    P, X = matrix(workspace, P_ANGLES, STATES, STATES), matrix(workspace, PRODUCT, STATES, STATES)
    terms = math.sin(angles[1]), math.cos(angles[1]), math.sin(angles[2]), math.cos(angles[2])
    for i in range(STATES):
        for j in range(STATES):
            X[i, j] = P[i, j]
    for j in range(STATES):
        x = X[6, j], X[7, j], X[8, j]
        X[6, j], X[7, j], X[8, j] = (
            _rotation(x, terms) if own else rotate_vector(C, x[0], x[1], x[2])
        )
    for i in range(STATES):
        x = X[i, 6], X[i, 7], X[i, 8]
        X[i, 6], X[i, 7], X[i, 8] = (
            _rotation(x, terms) if own else rotate_vector(C, x[0], x[1], x[2])
        )
    for i in range(STATES):
        for j in range(STATES):
            belief.P[i, j] = X[i, j]


@helper
def _rotation(x: Three, terms: tuple[float, float, float, float]) -> Three:
    """The small rotation in n that changes roll, pitch and heading by x; terms: sine and cosine of
    pitch and heading."""
    sp, cp, sh, ch = terms
    return (ch * cp * x[0] - sh * x[1], sh * cp * x[0] + ch * x[1], x[2] - sp * x[0])


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
    """Correct P, and add the correction to the state, that of the multiplicative filter as a
    rotation."""
    workspace, used = belief.workspace, belief.workspace[STD]
    row, P = matrix(workspace, H, 3, STATES), matrix(workspace, P_ANGLES, STATES, STATES)
    for i in range(innovation.size):
        innovation[i] = math.nan
    rows = observe(belief, y, source, innovation, row)
    for i in range(3):
        used[i] = std[i]
        for j in range(STATES):
            row[i, j] = 0.0
    if kind == Kind.GRAVITY or kind == Kind.MAGNETIC_FIELD:
        rows = _see_direction(belief, y, kind == Kind.GRAVITY, source, innovation, row)
    elif kind == Kind.HEADING and workspace[FORM] == GIBBS:
        _compass_row(workspace[COMPASS] > 0, belief.C_nb, row)
    else:
        _see_states(workspace[ANGLES], y, kind, innovation, row)
    dx = workspace[DX]
    nis = update(P, row, innovation, used, rows, gate, workspace[WORK], dx)
    if nis <= gate:
        _add(belief, dx)
        if kind == Kind.ATTITUDE:
            euler_to_matrix(y[0], y[1], y[2], matrix(workspace, KNOWN, 3, 3))
        _publish(belief)
    return nis


@helper
def _see_states(angles: Array, y: Array, kind: int, innovation: Array, row: Array) -> None:
    """Rows of measured states, and innovations of measured angles."""
    first = 0 if kind == Kind.POSITION else (8 if kind == Kind.HEADING else 3)
    if kind == Kind.ATTITUDE:
        first = 6
        for i in range(3):
            innovation[i] = wrap(y[i] - angles[i])
    for i in range(3):
        if first + i < STATES:
            row[i, first + i] = 1.0


@helper
def _see_direction(
    belief: FilterState, y: Array, up: bool, source: SourceRow, innovation: Array, row: Array
) -> int:
    """Innovation v - R' v0 and rows S(R' v0) of a unit vector, against gravity (`up`) that of the
    specific force less its bias; the standard deviations become those of it. Returns the rows."""
    C, used = belief.C_nb, belief.workspace[STD]
    v0, v1, v2, scale = belief.f[0], belief.f[1], belief.f[2], GRAVITY_SIZE
    n0, n1, n2 = 0.0, 0.0, -1.0
    if not up:
        v0, v1, v2 = y[0], y[1], y[2]
        n0, n1, n2 = source.parameters[0], source.parameters[1], source.parameters[2]
        scale = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        n0, n1, n2 = n0 / scale, n1 / scale, n2 / scale
    size = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    b0 = C[0, 0] * n0 + C[1, 0] * n1 + C[2, 0] * n2
    b1 = C[0, 1] * n0 + C[1, 1] * n1 + C[2, 1] * n2
    b2 = C[0, 2] * n0 + C[1, 2] * n1 + C[2, 2] * n2
    innovation[0], innovation[1], innovation[2] = v0 / size - b0, v1 / size - b1, v2 / size - b2
    row[0, 7], row[0, 8], row[1, 6] = -b2, b1, b2
    row[1, 8], row[2, 6], row[2, 7] = -b0, -b1, b0
    for i in range(3):
        used[i] /= scale
    return 3


@helper
def _compass_row(printed: bool, C: Array, row: Array) -> None:
    """Derivative of the heading by a 2 x Gibbs vector: of the error, or, as printed, of the whole
    attitude a = 2 q_v / q_w, with tan(heading) = (2 a1 a2 + 4 a3) / (4 + a1^2 - a2^2 - a3^2)."""
    if not printed:
        level = C[2, 1] * C[2, 1] + C[2, 2] * C[2, 2]
        row[0, 7], row[0, 8] = C[2, 1] / level, C[2, 2] / level
        return
    scale = 2 / (1 + C[0, 0] + C[1, 1] + C[2, 2])
    a1, a2, a3 = (
        scale * (C[2, 1] - C[1, 2]),
        scale * (C[0, 2] - C[2, 0]),
        scale * (C[1, 0] - C[0, 1]),
    )
    y, x = 2 * a1 * a2 + 4 * a3, 4 + a1 * a1 - a2 * a2 - a3 * a3
    size = x * x + y * y
    row[0, 6] = (2 * a2 * x - 2 * a1 * y) / size
    row[0, 7] = (2 * a1 * x + 2 * a2 * y) / size
    row[0, 8] = (4 * x + 2 * a3 * y) / size


@helper
def _add(belief: FilterState, dx: Array) -> None:
    """Add a correction to the state."""
    displace(belief.lla, dx[0], dx[1], dx[2])
    for i in range(3):
        belief.v_n[i] += dx[3 + i]
        belief.b_a[i] += dx[9 + i]
        belief.b_g[i] += dx[12 + i]
    if belief.workspace[FORM] == GIBBS:
        turned = dx[6:9]
        rotation_vector(turned)
        rotate_right(belief.C_nb, turned[0], turned[1], turned[2])
    else:
        for i in range(3):
            belief.workspace[ANGLES][i] += dx[6 + i]


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
    uses=(*KINDS, "gravity"),
    configure=configure,
    bias=HELD,
)
AHRS_DIRECT, AHRS_INDIRECT = (
    Filter(
        name,
        source,
        start_ahrs,
        predict,
        correct,
        slots=SLOTS,
        uses=("position", "velocity", "attitude"),
        needs=("attitude",),
        configure=configure,
        bias=bias,
    )
    for name, source, bias in (
        ("ahrs-direct", "Fossen (2021) section 14.3.2, as printed", RANDOM_WALK),
        ("ahrs-indirect", "Fossen (2021) section 14.4.2, as the published ins_ahrs.m", HELD),
    )
)
MEKF_PRINTED = Filter(
    "mekf-printed",
    "Fossen (2021) section 14.4.3, as the published ins_mekf.m and ins_mekf_psi.m",
    start_mekf,
    predict,
    correct,
    slots=SLOTS,
    uses=(*KINDS, "gravity", "magnetic-field"),
    configure=configure,
    bias=HELD,
)
PRINTED_FILTERS = {
    filter.name: filter for filter in (DIRECT, INDIRECT, AHRS_DIRECT, AHRS_INDIRECT, MEKF_PRINTED)
}
"""The values, which no name of the library finds: `strapdown.register` makes one known."""
