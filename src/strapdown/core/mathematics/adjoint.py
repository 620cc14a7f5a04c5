"""How the calls of the error-state filters are undone: what `linearised_step` and `measure` leave
behind, and their adjoints on lam and Lam (core/mathematics/smoother.py).

The transposed transition goes the other way round than the transition: position, velocity,
attitude, bias. Like that it is applied to rows of a workspace, with constant offsets, strides and
trip counts. States beyond the fifteenth stand still.
"""

from collections.abc import Callable

from ...typing import Array
from ..compile.jit import flatten, helper, inlined, kernel, matrix
from . import error_state
from .belief import Belief
from .error_dynamics import PP, TP, TV, VP, VV
from .error_state import CALL, DV, DX, JACOBIAN, PREDICTED, WORK, turn_half
from .kalman import decay, used_rows, whiten
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
def save_step(belief: Belief, record: Array) -> None:
    """What `linearised_step` or `measure`, whichever was called last, left in workspace."""
    kept(belief, record)


@helper
def kept(belief: Belief, record: Array) -> None:
    """The step of `save_step`, for a filter that keeps something beside."""
    workspace = belief.workspace
    record[0] = workspace[CALL]
    if record[0] == PREDICTED:
        for i in range(PREDICTION):
            record[i] = workspace[CALL + i]
    elif record[0] > 0:
        kept_rows(belief, record, int(record[0]))


@helper
def kept_rows(belief: Belief, record: Array, rows: int) -> None:
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
    undone(call, lam, Lam, work)


@helper
def undone(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The step of `adjoint_step`, for a filter that keeps something beside."""
    if call[0] == PREDICTED:
        unpropagated(call, lam, Lam, work)
    elif call[0] > 0:
        _unturned(call, lam, Lam)
        if lam.size == 15:  # the same code with constant lengths
            _uncorrected(15, call, lam, Lam, work)
        else:
            _uncorrected(lam.size, call, lam, Lam, work)


def transposed_transition(
    name: str, source: int, target: int, stride: int, blocks_of_lanes: tuple[int, ...], lanes: int
) -> Callable[[Array, Array], None]:
    """A helper that applies Phi' to columns of 15 rows in the workspace, from `source` to
    `target`: `lanes` of them from each of `blocks_of_lanes` on."""
    p, v, t, a, g = (tuple(source + (3 * k + i) * stride for i in range(3)) for k in range(5))
    P, V, T, A, G = (tuple(target + (3 * k + i) * stride for i in range(3)) for k in range(5))

    def apply(work: Array, step: Array) -> None:
        dt = step[DT]
        keep_a, keep_g = decay(step[DECAY_A] * dt), decay(step[DECAY_G] * dt)
        w0, w1, w2 = step[W], step[W + 1], step[W + 2]
        half = 0.5 * dt
        pp0, pp2, pp3, pp4, pp5 = (
            dt * step[F + PP],
            dt * step[F + PP + 2],
            dt * step[F + PP + 3],
            dt * step[F + PP + 4],
            dt * step[F + PP + 5],
        )
        vp0, vp2, vp3, vp5 = (
            dt * step[F + VP],
            dt * step[F + VP + 2],
            dt * step[F + VP + 3],
            dt * step[F + VP + 5],
        )
        vp6, vp8 = dt * step[F + VP + 6], dt * step[F + VP + 8]
        vv0, vv1, vv2, vv3 = (
            dt * step[F + VV],
            dt * step[F + VV + 1],
            dt * step[F + VV + 2],
            dt * step[F + VV + 3],
        )
        vv4, vv5, vv6, vv7 = (
            dt * step[F + VV + 4],
            dt * step[F + VV + 5],
            dt * step[F + VV + 6],
            dt * step[F + VV + 7],
        )
        tp0, tp2, tp5 = dt * step[F + TP], dt * step[F + TP + 2], dt * step[F + TP + 5]
        tp6, tp8 = dt * step[F + TP + 6], dt * step[F + TP + 8]
        tv1, tv3, tv7 = dt * step[F + TV + 1], dt * step[F + TV + 3], dt * step[F + TV + 7]
        c00, c01, c02 = dt * step[C], dt * step[C + 1], dt * step[C + 2]
        c10, c11, c12 = dt * step[C + 3], dt * step[C + 4], dt * step[C + 5]
        c20, c21, c22 = dt * step[C + 6], dt * step[C + 7], dt * step[C + 8]
        f0, f1, f2 = 0.5 * step[HALF_FORCE], 0.5 * step[HALF_FORCE + 1], 0.5 * step[HALF_FORCE + 2]
        for block in blocks_of_lanes:
            for lane in range(lanes):
                j = block + lane
                p0, p1, p2 = work[p[0] + j], work[p[1] + j], work[p[2] + j]
                v0, v1, v2 = half * p0, half * p1, half * p2  # what the old velocity alone gets
                # the new velocity
                u0, u1, u2 = (
                    work[v[0] + j] + v0,
                    work[v[1] + j] + v1,
                    work[v[2] + j] + v2,
                )
                # the sum of old and new attitude
                s0, s1, s2 = (
                    f1 * u2 - f2 * u1,
                    f2 * u0 - f0 * u2,
                    f0 * u1 - f1 * u0,
                )
                # the new attitude
                n0, n1, n2 = (
                    work[t[0] + j] + s0,
                    work[t[1] + j] + s1,
                    work[t[2] + j] + s2,
                )
                work[P[0] + j] = (
                    (p0 + pp0 * p0 + pp3 * p1)
                    + (vp0 * u0 + vp3 * u1 + vp6 * u2)
                    + (tp0 * n0 + tp6 * n2)
                )
                work[P[1] + j] = p1 + pp4 * p1
                work[P[2] + j] = (
                    (p2 + pp2 * p0 + pp5 * p1)
                    + (vp2 * u0 + vp5 * u1 + vp8 * u2)
                    + (tp2 * n0 + tp5 * n1 + tp8 * n2)
                )
                work[V[0] + j] = (v0 + u0) + (vv0 * u0 + vv3 * u1 + vv6 * u2) + tv3 * n1
                work[V[1] + j] = (
                    (v1 + u1) + (vv1 * u0 + vv4 * u1 + vv7 * u2) + (tv1 * n0 + tv7 * n2)
                )
                work[V[2] + j] = (v2 + u2) + (vv2 * u0 + vv5 * u1)
                work[T[0] + j] = (s0 + n0) + (w1 * n2 - w2 * n1)
                work[T[1] + j] = (s1 + n1) + (w2 * n0 - w0 * n2)
                work[T[2] + j] = (s2 + n2) + (w0 * n1 - w1 * n0)
                work[A[0] + j] = keep_a * work[a[0] + j] - (c00 * u0 + c10 * u1 + c20 * u2)
                work[A[1] + j] = keep_a * work[a[1] + j] - (c01 * u0 + c11 * u1 + c21 * u2)
                work[A[2] + j] = keep_a * work[a[2] + j] - (c02 * u0 + c12 * u1 + c22 * u2)
                work[G[0] + j] = keep_g * work[g[0] + j] - (c00 * n0 + c10 * n1 + c20 * n2)
                work[G[1] + j] = keep_g * work[g[1] + j] - (c01 * n0 + c11 * n1 + c21 * n2)
                work[G[2] + j] = keep_g * work[g[2] + j] - (c02 * n0 + c12 * n1 + c22 * n2)

    # Kernels loaded from the cache bring their helpers along, and the linker takes helpers of one
    # name for one function.
    apply.__name__ = apply.__qualname__ = name
    return helper(apply)


_sixteen = transposed_transition("_sixteen", ONE, OTHER, 16, (0, 8), 8)
_one = transposed_transition("_one", COLUMN, COLUMN + 15, 1, (0,), 1)


@helper
def unpropagated(step: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `propagate`: lam <- Phi' lam and Lam <- Phi' Lam Phi. lam goes along as the
    sixteenth column of Lam.

    Lam is left as symmetric as rounding leaves it; the next correction makes it so to the last bit.
    """
    n, numbers = lam.size, flatten(Lam)
    # rows of 16, of which the last number belongs to the next row: such copies are fast
    if n == 15:
        for i in range(14):
            for j in range(16):
                work[ONE + 16 * i + j] = numbers[15 * i + j]
        for j in range(15):
            work[ONE + 224 + j] = numbers[210 + j]
    else:
        for column in range(15, n):
            for i in range(15):
                work[COLUMN + i] = Lam[i, column]
            _one(work, step)
            for i in range(15):
                Lam[i, column] = Lam[column, i] = work[COLUMN + 15 + i]
        for i in range(15):
            for j in range(15):
                work[ONE + 16 * i + j] = Lam[i, j]
    for i in range(15):
        work[ONE + 16 * i + 15] = lam[i]
    _sixteen(work, step)
    for i in range(15):
        lam[i] = work[OTHER + 16 * i + 15]
        for j in range(16):  # a sixteenth that means nothing
            work[ONE + 16 * i + j] = work[OTHER + 16 * j + i]
    _sixteen(work, step)
    if n == 15:
        for i in range(14):
            for j in range(16):
                numbers[15 * i + j] = work[OTHER + 16 * i + j]
        for j in range(15):
            numbers[210 + j] = work[OTHER + 224 + j]
    else:
        for i in range(15):
            for j in range(15):
                Lam[i, j] = work[OTHER + 16 * i + j]


@inlined
def _unturned(call: Array, lam: Array, Lam: Array) -> None:
    """The adjoint of `turn_half`: lam <- A' lam and Lam <- A' Lam A."""
    theta = call[U + 6 * lam.size :]
    x, y, z = -theta[0], -theta[1], -theta[2]
    turn_half(Lam, x, y, z)
    R = rotation_terms(0.5 * x, 0.5 * y, 0.5 * z)
    lam[6], lam[7], lam[8] = turned_by(R, lam[6], lam[7], lam[8])


@inlined
def _uncorrected(n: int, call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `update`, with its K H = U' H, both whitened: lam <- lam - H' (U lam + e) and
    Lam <- (I - U' H)' Lam (I - U' H) + H' H.

    The latter is Lam - H' Z - Z' H with Z = U Lam - M H / 2, M = U Lam U' + I.
    """
    H, Z, numbers = U + 3 * n, n * n, flatten(Lam)
    for i in range(n):
        for j in range(i):
            Lam[i, j] = Lam[j, i] = 0.5 * (Lam[i, j] + Lam[j, i])
    for i in range(n * n):
        work[i] = numbers[i]
    for i in range(3 * n):
        work[Z + i] = 0.0
    for j in range(n):
        u0, u1, u2 = call[U + j], call[U + n + j], call[U + 2 * n + j]
        for i in range(n):
            work[Z + i] += u0 * work[n * j + i]
            work[Z + n + i] += u1 * work[n * j + i]
            work[Z + 2 * n + i] += u2 * work[n * j + i]
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
    for i in range(n):
        h0, h1, h2 = call[H + i], call[H + n + i], call[H + 2 * n + i]
        z0, z1, z2 = work[Z + i], work[Z + n + i], work[Z + 2 * n + i]
        for j in range(n):
            numbers[n * i + j] = work[n * i + j] - (
                (h0 * work[Z + j] + h1 * work[Z + n + j] + h2 * work[Z + 2 * n + j])
                + (z0 * call[H + j] + z1 * call[H + n + j] + z2 * call[H + 2 * n + j])
            )


SMOOTHER = Smoother(width, save_step, adjoint_step)
"""Of every filter whose calls end in `linearised_step` or `measure`."""
