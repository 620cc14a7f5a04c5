"""Covariance of a filter whose gains do not come from it: P by the linear dynamics of its errors,
in Joseph's form, which holds for any gain. Source: Bucy & Joseph (1968); Gelb (1974), 4.2.
"""

from ...typing import Array
from ..compile.jit import helper, inline, matrix
from ..compile.selection import any_of, where
from ..compile.workspace import MAX_STATES, Slots
from .belief import STATES, Noise
from .error_dynamics import BLOCKS, CORRECTED, kinematic_blocks
from .kalman import WORKSPACE, propagate, update
from .rotation import rotate_vector, turned_on

JOSEPH = Slots()
"""Its slots of a workspace."""
BLOCK = JOSEPH.array("BLOCK", BLOCKS)  # blocks of F
MID = JOSEPH.matrix("MID", 3, 3)  # C_nb at mid-interval
WORK = JOSEPH.array("WORK", WORKSPACE)  # of core.mathematics.kalman
DX = JOSEPH.array("DX", MAX_STATES)  # not used
# since the last step: rotation (rad) and velocity increments (m/s) without biases, s, the noise
PENDING = JOSEPH.array("PENDING", 6)
SECONDS = JOSEPH.number("SECONDS")
NOISE = JOSEPH.array("NOISE", 6)
FORCE = JOSEPH.array("FORCE", 3)  # mean specific force of the last step, body, m/s^2
PRODUCT = JOSEPH.matrix("PRODUCT", 3, MAX_STATES)  # of `joseph_update`
MAX_STEP = 0.05  # s: P need not see each sample, which would cost more than such a filter


@inline
def has_new_noise(own: Array, noise: Noise) -> bool:
    """True where the waiting samples have other white noise, so that P must be propagated before the
    next one."""
    told = own[NOISE]
    other = float(told[0]) != noise.gyro or float(told[1]) != noise.accel
    return other and float(own[SECONDS]) > 0


@inline
def await_step(own: Array, omega: Array, f: Array, dt: float, noise: Noise) -> bool:
    """Let a sample, of bias-free rate and specific force, wait for the next step of P. Returns
    whether that is due."""
    sums, told = own[PENDING], own[NOISE]
    told[0], told[1], told[2] = noise.gyro, noise.accel, noise.gyro_bias
    told[3], told[4], told[5] = noise.accel_bias, noise.gyro_decay, noise.accel_decay
    for i in range(3):
        sums[i] += omega[i] * dt
        sums[3 + i] += f[i] * dt
    own[SECONDS] += dt
    return float(own[SECONDS]) >= MAX_STEP


@helper
def carry(P: Array, own: Array, lla: Array, v: Array, C: Array) -> float:
    """P (n, n) over the samples that wait, which end at lla (rad, rad, m), v_n (m/s) and C_nb, by
    the error dynamics of the INS; `own` of JOSEPH. States beyond the fifteenth stand still.

        C_mid = C (I - S(r / 2)),  dv_n = C_mid a,  P <- Phi P Phi' + Q_d     of `propagate`

    with r and a the bias-free increments that wait (rad, m/s). Returns the seconds; the mean specific force stays in own[FORCE].
    """
    mid, blocks, u, n, f = matrix(own, MID, 3, 3), own[BLOCK], own[PENDING], own[NOISE], own[FORCE]
    dt = float(own[SECONDS])
    turned_on(C, (-0.5 * u[0], -0.5 * u[1], -0.5 * u[2]), mid)  # half a turn back from the end
    dv_n = own[DX]
    dv_n[0], dv_n[1], dv_n[2] = rotate_vector(mid, u[3], u[4], u[5])
    w0, w1, w2 = kinematic_blocks(lla, v, CORRECTED, blocks)
    noise = Noise(float(n[0]), float(n[1]), float(n[2]), float(n[3]), float(n[4]), float(n[5]), 0.0)
    propagate(P, blocks, mid, dv_n, (w0 * dt, w1 * dt, w2 * dt), dt, noise, own[WORK])
    for i in range(3):
        f[i] = u[3 + i] / dt
        u[i] = u[3 + i] = 0.0
    own[SECONDS] = 0.0
    return dt


@inline
def test(P: Array, own: Array, H: Array, innovation: Array, std: Array, rows: int) -> float:
    """NIS of a fix under P, which stays, NaN without any measured row; the whitened innovation as
    `core.mathematics.kalman.update` writes it."""
    return update(P, H, innovation, std, rows, -1.0, own[WORK], own[DX])


@helper
def joseph_update(P: Array, own: Array, A: Array, B: Array, R: Array) -> None:
    """Joseph's form, for any gain K: with A = -K' and B = H,

        P <- (I - K H) P (I - K H)' + K R K' = (I + A' B) P (I + A' B)' + A' R A
           = P + A' V + V' A,  V = B P + S A / 2,  S = B P B' + R

    A, B (3, n): row i of A is what a unit of B x + noise, of covariance R (3, 3), adds to the
    errors. P (n, n) symmetric; `own` of JOSEPH.
    """
    n = P.shape[0]
    V = matrix(own, PRODUCT, 3, n)
    _product(n, B, P, V)
    _half_of_square(n, A, B, R, V, own[DX])
    for i in range(n):
        a0, a1, a2, v0, v1, v2 = A[0, i], A[1, i], A[2, i], V[0, i], V[1, i], V[2, i]
        for j in range(i + 1):
            P[i, j] += (a0 * V[0, j] + v0 * A[0, j]) + (
                (a1 * V[1, j] + v1 * A[1, j]) + (a2 * V[2, j] + v2 * A[2, j])
            )
        for j in range(i):
            P[j, i] = P[i, j]


@inline
def _product(n: int, B: Array, P: Array, V: Array) -> None:
    """V = B P (3, n)."""
    for i in range(3):
        for j in range(n):
            V[i, j] = 0.0
        for k in range(n):
            b = B[i, k]
            if any_of(b != 0):
                for j in range(n):
                    V[i, j] += b * P[k, j]


@inline
def _half_of_square(n: int, A: Array, B: Array, R: Array, V: Array, S: Array) -> None:
    """V += S A / 2 with S = V B' + R, nine numbers."""
    for i in range(3):
        for j in range(3):
            S[3 * i + j] = R[i, j]
            for k in range(n):
                S[3 * i + j] += V[i, k] * B[j, k]
    for i in range(3):
        s0, s1, s2 = 0.5 * S[3 * i], 0.5 * S[3 * i + 1], 0.5 * S[3 * i + 2]
        for j in range(n):
            V[i, j] += s0 * A[0, j] + s1 * A[1, j] + s2 * A[2, j]


@inline
def learn_beyond(P: Array, own: Array, x: Array, augmented: Array, n: int, taken: bool) -> None:
    """Correct the states from the fifteenth to the n-th, for which such a filter has no gains, by what
    `test` has left of a fix that is taken, with the gain of least variance: P_s <- P_s - U_s' U, and no
    other."""
    m = P.shape[0]
    U = matrix(own, WORK.start, 3, m)
    for s in range(STATES, n):
        augmented[s - STATES] += where(taken, x[s], 0.0)
        for j in range(m):
            less = U[0, s] * U[0, j] + U[1, s] * U[1, j] + U[2, s] * U[2, j]
            P[s, j] -= where(taken, less, 0.0)
    for s in range(STATES, n):
        for j in range(STATES):
            P[j, s] = P[s, j]
        for j in range(n, m):
            P[j, s] = P[s, j]
