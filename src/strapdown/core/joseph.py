"""Covariance of a filter whose gains do not come from it: P by the linear dynamics of its errors,
in Joseph's form, which holds for any gain. Source: Bucy & Joseph (1968); Gelb (1974), 4.2.
"""

from ..typing import Array
from .contract import MOST_STATES, Noise, Slots
from .error_dynamics import BLOCKS, CORRECTED, kinematic_blocks
from .jit import helper, inlined, matrix
from .kalman import WORKSPACE, propagate, update
from .rotation import turned

JOSEPH = Slots()
"""What it needs of a workspace."""
BLOCK = JOSEPH.array("BLOCK", BLOCKS)  # blocks of F
MID = JOSEPH.matrix("MID", 3, 3)  # C_nb at mid-interval
WORK = JOSEPH.array("WORK", WORKSPACE)  # of core.kalman
DX = JOSEPH.array("DX", MOST_STATES)  # not used
PRODUCT = JOSEPH.matrix("PRODUCT", 3, MOST_STATES)  # of `spread`


@helper
def carry(
    P: Array,
    own: Array,
    lla: Array,
    v: Array,
    C: Array,
    increments: tuple[float, float, float, float, float, float],
    dt: float,
    noise: Noise,
) -> None:
    """P (n, n) over dt by the error dynamics of the INS that stands at lla, v, C, with bias-free
    rotation (rad) and velocity increments (m/s); `own` of JOSEPH. States beyond the fifteenth stand
    still."""
    mid, blocks = matrix(own, MID, 3, 3), own[BLOCK]
    r0, r1, r2, a0, a1, a2 = increments
    r0, r1, r2 = 0.5 * r0, 0.5 * r1, 0.5 * r2
    for i in range(3):
        mid[i, 0] = C[i, 0] + C[i, 1] * r2 - C[i, 2] * r1
        mid[i, 1] = C[i, 1] + C[i, 2] * r0 - C[i, 0] * r2
        mid[i, 2] = C[i, 2] + C[i, 0] * r1 - C[i, 1] * r0
    dv_n = own[DX]
    dv_n[0], dv_n[1], dv_n[2] = turned(mid, a0, a1, a2)
    w0, w1, w2 = kinematic_blocks(lla, v, CORRECTED, blocks)
    propagate(P, blocks, mid, dv_n, w0 * dt, w1 * dt, w2 * dt, dt, noise, own[WORK])


@inlined
def test(P: Array, own: Array, H: Array, innovation: Array, sd: Array, rows: int) -> float:
    """NIS of a fix under P, which stays, NaN without any measured row; the whitened innovation as
    `core.kalman.update` writes it."""
    return update(P, H, innovation, sd, rows, -1.0, own[WORK], own[DX])


@helper
def spread(P: Array, own: Array, A: Array, B: Array, R: Array) -> None:
    """P <- (I + A' B) P (I + A' B)' + A' R A, which is Joseph's form with A = -K' and B = H.

    A, B (3, n): row i of A is what a unit of B x + noise, of covariance R (3, 3), adds to the
    errors. P (n, n) symmetric; `own` of JOSEPH.
    """
    n = P.shape[0]
    V = matrix(own, PRODUCT, 3, n)
    for i in range(3):
        for j in range(n):
            V[i, j] = 0.0
        for k in range(n):
            b = B[i, k]
            if b != 0:
                for j in range(n):
                    V[i, j] += b * P[k, j]
    S = own[DX]
    for i in range(3):
        for j in range(3):
            S[3 * i + j] = R[i, j]
            for k in range(n):
                S[3 * i + j] += V[i, k] * B[j, k]
    for i in range(3):
        s0, s1, s2 = 0.5 * S[3 * i], 0.5 * S[3 * i + 1], 0.5 * S[3 * i + 2]
        for j in range(n):
            V[i, j] += s0 * A[0, j] + s1 * A[1, j] + s2 * A[2, j]
    for i in range(n):
        a0, a1, a2, v0, v1, v2 = A[0, i], A[1, i], A[2, i], V[0, i], V[1, i], V[2, i]
        for j in range(i + 1):
            P[i, j] += (a0 * V[0, j] + v0 * A[0, j]) + (
                (a1 * V[1, j] + v1 * A[1, j]) + (a2 * V[2, j] + v2 * A[2, j])
            )
        for j in range(i):
            P[j, i] = P[i, j]
