"""The calls of the error-state filters undone: what `linearised_step` and `measure` leave
behind, and their adjoints on lam and Lam (core/mathematics/smoother.py).

The transposed transition goes the other way round than the transition: position, velocity,
attitude, bias. Like that it is applied to rows of a workspace, with constant offsets, strides and
trip counts. States beyond the fifteenth stand still.
"""

from collections.abc import Callable

from ...typing import Array
from ..compile.jit import flatten, helper, inline, kernel, matrix
from . import error_state
from .belief import FilterState
from .error_state import CALL, DV, DX, JACOBIAN, PREDICTED, WORK, turn_half
from .kalman import Fifteen, coefficients, decay, used_rows, whiten
from .rotation import rotation_terms, turned_by
from .tape import ADJOINT_STEP, SAVE_STEP, Smoother

PREDICTION = DV.stop - CALL
"""Numbers of a record of a prediction: those of workspace from CALL to DV."""
DT, W, DECAY_A, DECAY_G, HELD, F, C, HALF_FORCE = (
    slot - CALL
    for slot in (
        error_state.DT,
        error_state.TRANSPORT.start,
        error_state.DECAY_A,
        error_state.DECAY_G,
        error_state.HELD,
        error_state.BLOCK.start,
        error_state.MID,
        DV.start,
    )
)
"""Places in it: the first number is PREDICTED."""
# of a correction: rows used, whitened innovations (3), U and H, each (3, n), rows not used zero, and
# the rotation vector of the correction, in n
INNOVATION, U = (
    1,
    4,
)
ONE, OTHER, COLUMN = 0, 240, 480  # of the workspace: 15 rows of 16 twice, and a column


def width(n: int) -> int:
    """Numbers of a record of one call, with n states."""
    return max(PREDICTION, U + 6 * n + 3)


@kernel(SAVE_STEP)
def save_step(belief: FilterState, record: Array) -> None:
    """Save from workspace the last step, of `linearised_step` or `measure`."""
    save_step_rows(belief, record)


@helper
def save_step_rows(belief: FilterState, record: Array) -> None:
    """The step of `save_step`, for a filter that keeps something beside."""
    workspace = belief.workspace
    record[0] = workspace[CALL]
    if record[0] == PREDICTED:
        for i in range(PREDICTION):
            record[i] = workspace[CALL + i]
    elif record[0] > 0:
        kept_rows(belief, record, int(record[0]))


@helper
def kept_rows(belief: FilterState, record: Array, rows: int) -> None:
    """Whitened innovations, U and H of the rows that `measure` found, whether used or not."""
    workspace, n = belief.workspace, belief.P.shape[0]
    used, first = WORK.start + used_rows(n), WORK.start
    whiten(matrix(workspace, JACOBIAN, 3, n), workspace[WORK])
    for k in range(3):
        record[INNOVATION + k] = workspace[used + 1 + k]
        for j in range(n):
            record[U + k * n + j] = workspace[first + k * n + j]
            record[U + (3 + k) * n + j] = workspace[JACOBIAN + k * n + j] if k < rows else 0.0
        record[U + 6 * n + k] = workspace[DX][6 + k]


@kernel(ADJOINT_STEP)
def adjoint_step(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of the call in a record of `save_step`."""
    apply_adjoint(call, lam, Lam, work)


@helper
def apply_adjoint(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The step of `adjoint_step`, for a filter that keeps something beside."""
    if call[0] == PREDICTED:
        adjoint_propagate(call, lam, Lam, work)
    elif call[0] > 0:
        _adjoint_turn_half(call, lam, Lam)
        adjoint_update(call, lam, Lam, work)


@inline
def adjoint_update(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `update`: see `_adjoint_update`."""
    if lam.size == 15:  # the same code with constant lengths
        _adjoint_update(15, call, lam, Lam, work)
    else:
        _adjoint_update(lam.size, call, lam, Lam, work)


@inline
def adjoint_column(
    phi: tuple[tuple[float, ...], ...], keep: tuple[float, float], x: Fifteen
) -> Fifteen:
    """Phi' times a column of fifteen numbers, phi of `kalman.coefficients` and keep what is left of
    an accelerometer and a gyro bias: `kalman.column` from its last line to its first.

    With x = (p, v, theta, a, g), f = dv_n / 2 and D = C_nb dt:

        u  = v + p dt / 2                                   what the new velocity gets
        s  = f x u                                          the sum of old and new attitude
        n  = theta + s                                      the new attitude
        p' = p + dt (F_pp' p + F_vp' u + F_theta_p' n)
        v' = p dt / 2 + u + dt (F_vv' u + F_theta_v' n)
        theta' = s + n + omega_in dt x n
        a' = keep_a a - D' u,  g' = keep_g g - D' n
    """
    w, half, pp, vp, vv, tp, tv, c0, c1, c2 = phi
    w0, w1, w2 = w
    f0, f1, f2, half_dt = half
    p0, p1, p2, v0, v1, v2, t0, t1, t2, a0, a1, a2, g0, g1, g2 = x
    q0, q1, q2 = half_dt * p0, half_dt * p1, half_dt * p2  # what the old velocity alone gets
    u0, u1, u2 = v0 + q0, v1 + q1, v2 + q2
    s0, s1, s2 = f1 * u2 - f2 * u1, f2 * u0 - f0 * u2, f0 * u1 - f1 * u0
    n0, n1, n2 = t0 + s0, t1 + s1, t2 + s2
    return (
        (p0 + pp[0] * p0 + pp[2] * p1)
        + (vp[0] * u0 + vp[2] * u1 + vp[4] * u2)
        + (tp[0] * n0 + tp[3] * n2),
        p1 + pp[3] * p1,
        (p2 + pp[1] * p0 + pp[4] * p1)
        + (vp[1] * u0 + vp[3] * u1 + vp[5] * u2)
        + (tp[1] * n0 + tp[2] * n1 + tp[4] * n2),
        (q0 + u0) + (vv[0] * u0 + vv[3] * u1 + vv[6] * u2) + tv[1] * n1,
        (q1 + u1) + (vv[1] * u0 + vv[4] * u1 + vv[7] * u2) + (tv[0] * n0 + tv[2] * n2),
        (q2 + u2) + (vv[2] * u0 + vv[5] * u1),
        (s0 + n0) + (w1 * n2 - w2 * n1),
        (s1 + n1) + (w2 * n0 - w0 * n2),
        (s2 + n2) + (w0 * n1 - w1 * n0),
        keep[0] * a0 - (c0[0] * u0 + c1[0] * u1 + c2[0] * u2),
        keep[0] * a1 - (c0[1] * u0 + c1[1] * u1 + c2[1] * u2),
        keep[0] * a2 - (c0[2] * u0 + c1[2] * u1 + c2[2] * u2),
        keep[1] * g0 - (c0[0] * n0 + c1[0] * n1 + c2[0] * n2),
        keep[1] * g1 - (c0[1] * n0 + c1[1] * n1 + c2[1] * n2),
        keep[1] * g2 - (c0[2] * n0 + c1[2] * n1 + c2[2] * n2),
    )


def transposed_transition(
    name: str, source: int, target: int, stride: int, blocks_of_lanes: tuple[int, ...], lanes: int
) -> Callable[[Array, Array], None]:
    """A helper that applies Phi' to columns of 15 rows in the workspace, from `source` to
    `target`: `lanes` of them from each of `blocks_of_lanes` on."""
    x, y = (tuple(first + i * stride for i in range(15)) for first in (source, target))

    def apply(work: Array, step: Array) -> None:
        dt, C_nb = step[DT], matrix(step, C, 3, 3)
        keep = decay(step[DECAY_A] * dt), decay(step[DECAY_G] * dt)
        w = step[W], step[W + 1], step[W + 2]
        phi = coefficients(step[F:C], C_nb, step[HALF_FORCE : HALF_FORCE + 3], w, dt)
        for block in blocks_of_lanes:
            for lane in range(lanes):
                j = block + lane
                (
                    work[y[0] + j],
                    work[y[1] + j],
                    work[y[2] + j],
                    work[y[3] + j],
                    work[y[4] + j],
                    work[y[5] + j],
                    work[y[6] + j],
                    work[y[7] + j],
                    work[y[8] + j],
                    work[y[9] + j],
                    work[y[10] + j],
                    work[y[11] + j],
                    work[y[12] + j],
                    work[y[13] + j],
                    work[y[14] + j],
                ) = adjoint_column(
                    phi,
                    keep,
                    (
                        work[x[0] + j],
                        work[x[1] + j],
                        work[x[2] + j],
                        work[x[3] + j],
                        work[x[4] + j],
                        work[x[5] + j],
                        work[x[6] + j],
                        work[x[7] + j],
                        work[x[8] + j],
                        work[x[9] + j],
                        work[x[10] + j],
                        work[x[11] + j],
                        work[x[12] + j],
                        work[x[13] + j],
                        work[x[14] + j],
                    ),
                )

    # Kernels loaded from the cache bring their helpers along, and the linker takes helpers of one
    # name for one function.
    apply.__name__ = apply.__qualname__ = name
    return helper(apply)


_sixteen = transposed_transition("_sixteen", ONE, OTHER, 16, (0, 8), 8)
_one = transposed_transition("_one", COLUMN, COLUMN + 15, 1, (0,), 1)


@helper
def adjoint_propagate(step: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `propagate`: lam <- Phi' lam and Lam <- Phi' Lam Phi = (Phi' (Phi' Lam)')'. lam
    goes along as the sixteenth column of Lam.

    Lam is left as symmetric as rounding leaves it; the next correction makes it so to the last bit.
    """
    if lam.size > 15:
        _beyond(step, Lam, work)
    _laid_out(Lam, work)
    for i in range(15):
        work[ONE + 16 * i + 15] = lam[i]
    _sixteen(work, step)
    for i in range(15):
        lam[i] = work[OTHER + 16 * i + 15]
        for j in range(16):  # a sixteenth that means nothing
            work[ONE + 16 * i + j] = work[OTHER + 16 * j + i]
    _sixteen(work, step)
    _taken_back(Lam, work)


@inline
def _beyond(step: Array, Lam: Array, work: Array) -> None:
    """Phi' times the columns of Lam with states beyond the fifteenth, which stand still
    themselves."""
    for column in range(15, Lam.shape[0]):
        for i in range(15):
            work[COLUMN + i] = Lam[i, column]
        _one(work, step)
        for i in range(15):
            Lam[i, column] = Lam[column, i] = work[COLUMN + 15 + i]


@inline
def _laid_out(Lam: Array, work: Array) -> None:
    """The first fifteen rows and columns of Lam in rows of 16, of which the last number of fifteen
    states belongs to the next row: such copies are fast."""
    if Lam.shape[0] == 15:
        numbers = flatten(Lam)
        for i in range(14):
            for j in range(16):
                work[ONE + 16 * i + j] = numbers[15 * i + j]
        for j in range(15):
            work[ONE + 224 + j] = numbers[210 + j]
    else:
        for i in range(15):
            for j in range(15):
                work[ONE + 16 * i + j] = Lam[i, j]


@inline
def _taken_back(Lam: Array, work: Array) -> None:
    """Lam from the rows of 16 that Phi' was applied to."""
    if Lam.shape[0] == 15:
        numbers = flatten(Lam)
        for i in range(14):
            for j in range(16):
                numbers[15 * i + j] = work[OTHER + 16 * i + j]
        for j in range(15):
            numbers[210 + j] = work[OTHER + 224 + j]
    else:
        for i in range(15):
            for j in range(15):
                Lam[i, j] = work[OTHER + 16 * i + j]


@inline
def _adjoint_turn_half(call: Array, lam: Array, Lam: Array) -> None:
    """The adjoint of `turn_half`: lam <- A' lam and Lam <- A' Lam A."""
    theta = call[U + 6 * lam.size :]
    x, y, z = -theta[0], -theta[1], -theta[2]
    turn_half(Lam, x, y, z)
    R = rotation_terms(0.5 * x, 0.5 * y, 0.5 * z)
    lam[6], lam[7], lam[8] = turned_by(R, lam[6], lam[7], lam[8])


@inline
def _adjoint_update(n: int, call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `update`, with K H = U' H of whitened rows and their innovations w:

        lam <- (I - U' H)' lam - H' w = lam - H' (U lam + w)
        Lam <- (I - U' H)' Lam (I - U' H) + H' H = Lam - H' Z - Z' H
        Z = U Lam - M H / 2,  M = U Lam U' + I

    Source: Bierman (1973), Automatica 9.
    """
    _symmetric(n, Lam, work)
    _gain_product(n, call, work)
    _subtract_half(n, call, lam, work)
    H, Z, numbers = U + 3 * n, n * n, flatten(Lam)
    for i in range(n):
        h0, h1, h2 = call[H + i], call[H + n + i], call[H + 2 * n + i]
        z0, z1, z2 = work[Z + i], work[Z + n + i], work[Z + 2 * n + i]
        for j in range(n):
            numbers[n * i + j] = work[n * i + j] - (
                (h0 * work[Z + j] + h1 * work[Z + n + j] + h2 * work[Z + 2 * n + j])
                + (z0 * call[H + j] + z1 * call[H + n + j] + z2 * call[H + 2 * n + j])
            )


@inline
def _symmetric(n: int, Lam: Array, work: Array) -> None:
    """Lam made symmetric to the last bit, also into the workspace (n, n)."""
    numbers = flatten(Lam)
    for i in range(n):
        for j in range(i):
            Lam[i, j] = Lam[j, i] = 0.5 * (Lam[i, j] + Lam[j, i])
    for i in range(n * n):
        work[i] = numbers[i]


@inline
def _gain_product(n: int, call: Array, work: Array) -> None:
    """Z = U Lam (3, n), behind Lam in the workspace."""
    Z = n * n
    for i in range(3 * n):
        work[Z + i] = 0.0
    for j in range(n):
        u0, u1, u2 = call[U + j], call[U + n + j], call[U + 2 * n + j]
        for i in range(n):
            work[Z + i] += u0 * work[n * j + i]
            work[Z + n + i] += u1 * work[n * j + i]
            work[Z + 2 * n + i] += u2 * work[n * j + i]


@inline
def _subtract_half(n: int, call: Array, lam: Array, work: Array) -> None:
    """lam <- lam - H' (U lam + w), and Z <- Z - M H / 2 with M = Z U' + I."""
    H, Z = U + 3 * n, n * n
    a0, a1, a2 = call[INNOVATION], call[INNOVATION + 1], call[INNOVATION + 2]
    m00, m01, m02, m11, m12, m22 = 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    for i in range(n):
        u0, u1, u2 = call[U + i], call[U + n + i], call[U + 2 * n + i]
        z0, z1, z2 = work[Z + i], work[Z + n + i], work[Z + 2 * n + i]
        a0, a1, a2 = a0 + u0 * lam[i], a1 + u1 * lam[i], a2 + u2 * lam[i]
        m00, m01, m02 = m00 + u0 * z0, m01 + u0 * z1, m02 + u0 * z2
        m11, m12, m22 = m11 + u1 * z1, m12 + u1 * z2, m22 + u2 * z2
    for i in range(n):
        h0, h1, h2 = call[H + i], call[H + n + i], call[H + 2 * n + i]
        lam[i] -= a0 * h0 + a1 * h1 + a2 * h2
        work[Z + i] -= 0.5 * (m00 * h0 + m01 * h1 + m02 * h2)
        work[Z + n + i] -= 0.5 * (m01 * h0 + m11 * h1 + m12 * h2)
        work[Z + 2 * n + i] -= 0.5 * (m02 * h0 + m12 * h1 + m22 * h2)


SMOOTHER = Smoother(width, save_step, adjoint_step)
"""Smoother of every filter whose calls end in `linearised_step` or `measure`."""
