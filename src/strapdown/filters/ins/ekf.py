"""Extended Kalman filter in its textbook form: dP/dt = F P + P F' + G Q G' integrated by
Runge-Kutta, the correction in Joseph form.

States, errors, mean and Jacobians are those of `closed-loop`, which does the same in less time;
this is the form to compare with.
"""

import math

from ...core.compile.selection import all_of, any_of, where
from ...core.loop.contract import (
    ATT,
    CORRECT,
    DECAYING,
    MAX_STATES,
    PREDICT,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.error_dynamics import (
    BLOCKS,
    CORRECTED,
    PP,
    TP,
    TV,
    VP,
    VV,
    kinematic_blocks,
)
from ...core.mathematics.error_state import (
    bias_free,
    decay_biases,
    inject_all,
    observe_innovation,
    publish_rates,
    turn_half,
)
from ...core.mathematics.kalman import MIN_NOISE
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import Three
from ...typing import Array

SLOTS = Slots()
BLOCK = SLOTS.array("BLOCK", BLOCKS)  # blocks of F
JACOBIAN_F = SLOTS.matrix("JACOBIAN_F", STATES, STATES)  # 1/s
# of the prediction, each (n, n): a term of the series in dt, and half of the next
TERM = SLOTS.matrix("TERM", MAX_STATES, MAX_STATES)
HALF = SLOTS.matrix("HALF", MAX_STATES, MAX_STATES)
# of the correction, each (3, n): H, then (n, n): (I - K H) P
JACOBIAN_H = SLOTS.matrix("JACOBIAN_H", 3, MAX_STATES)
PRODUCT = SLOTS.matrix("PRODUCT", 3, MAX_STATES)  # H P
GAIN = SLOTS.matrix("GAIN", 3, MAX_STATES)  # K'
LEFT = SLOTS.matrix("LEFT", MAX_STATES, MAX_STATES)
ROOT = SLOTS.matrix("ROOT", 3, 3)  # Cholesky factor of the covariance of the innovation
USED = SLOTS.array("USED", 3)  # innovations of the measured rows
VARIANCE = SLOTS.array("VARIANCE", 3)  # of their noise
DX = SLOTS.array("DX", MAX_STATES)  # the correction, n numbers
FORCE = SLOTS.array("FORCE", 3)  # specific-force velocity increment in n, m/s


def start(start: InitialState, noise: Noise) -> FilterState:
    """The filter state at `start`."""
    return start.belief(SLOTS.zeros())


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Integrate P over the sample with F and G Q G' at its middle, and mechanize the mean."""
    workspace, n = belief.workspace, belief.P.shape[0]
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    F = matrix(workspace, JACOBIAN_F, STATES, STATES)
    _jacobian(belief, r, (a[0] / dt, a[1] / dt, a[2] / dt), noise, F)
    _integrate(belief.P, F, dt, noise, matrix(workspace, TERM, n, n), matrix(workspace, HALF, n, n))
    publish_rates(belief, r, a, dt)
    decay_biases(belief.b_a, belief.b_g, dt, noise)
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, workspace[FORCE])


@helper
def _jacobian(
    belief: FilterState,
    r: Three,
    f: Three,
    noise: Noise,
    F: Array,
) -> None:
    """F (15, 15) in 1/s at the belief, with the attitude half a rotation r (rad) later; f is the
    specific force, m/s^2, body."""
    blocks, C = belief.workspace[BLOCK], belief.C_nb
    r0, r1, r2 = r
    f0, f1, f2 = f
    w0, w1, w2 = kinematic_blocks(belief.lla, belief.v_n, CORRECTED, blocks)
    for i in range(3):
        for j in range(3):
            k = 3 * i + j
            F[i, j], F[3 + i, j], F[3 + i, 3 + j], F[6 + i, j], F[6 + i, 3 + j] = (
                blocks[PP + k],
                blocks[VP + k],
                blocks[VV + k],
                blocks[TP + k],
                blocks[TV + k],
            )
        F[i, 3 + i], F[9 + i, 9 + i], F[12 + i, 12 + i] = 1.0, -noise.accel_decay, -noise.gyro_decay
        m0 = C[i, 0] + 0.5 * (C[i, 1] * r2 - C[i, 2] * r1)
        m1 = C[i, 1] + 0.5 * (C[i, 2] * r0 - C[i, 0] * r2)
        m2 = C[i, 2] + 0.5 * (C[i, 0] * r1 - C[i, 1] * r0)
        F[3 + i, 9], F[3 + i, 10], F[3 + i, 11] = -m0, -m1, -m2
        F[6 + i, 12], F[6 + i, 13], F[6 + i, 14] = -m0, -m1, -m2
    n0 = -(F[3, 9] * f0 + F[3, 10] * f1 + F[3, 11] * f2)
    n1 = -(F[4, 9] * f0 + F[4, 10] * f1 + F[4, 11] * f2)
    n2 = -(F[5, 9] * f0 + F[5, 10] * f1 + F[5, 11] * f2)
    F[3, 7], F[3, 8], F[4, 6], F[4, 8], F[5, 6], F[5, 7] = n2, -n1, -n2, n0, n1, -n0
    F[6, 7], F[6, 8], F[7, 6], F[7, 8], F[8, 6], F[8, 7] = w2, -w1, -w2, w0, w1, -w0


@helper
def _integrate(P: Array, F: Array, dt: float, noise: Noise, D: Array, T: Array) -> None:
    """One Runge-Kutta step of fourth order of dP/dt: with F and Q constant over it, the first
    four terms D of the series in dt."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            D[i, j] = P[i, j]
            T[i, j] = 0.0
    for order in range(1, 5):
        for i in range(STATES):
            for j in range(n):
                T[i, j] = 0.0
            for k in range(STATES):
                a = F[i, k]
                if any_of(a != 0):
                    for j in range(n):
                        T[i, j] += a * D[k, j]
        if order == 1:  # half of G Q G', because T is added to its transpose
            for i in range(3):
                T[3 + i, 3 + i] += 0.5 * noise.accel * noise.accel
                T[6 + i, 6 + i] += 0.5 * noise.gyro * noise.gyro
                T[9 + i, 9 + i] += 0.5 * noise.accel_bias * noise.accel_bias
                T[12 + i, 12 + i] += 0.5 * noise.gyro_bias * noise.gyro_bias
        for i in range(n):
            for j in range(i + 1):
                D[i, j] = D[j, i] = dt / order * (T[i, j] + T[j, i])
        for i in range(n):
            for j in range(n):
                P[i, j] += D[i, j]


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
    """Gain K, P <- (I - K H) P (I - K H)' + K R K', the error injected into INS and biases."""
    workspace, P, n = belief.workspace, belief.P, belief.P.shape[0]
    H, U, K = (
        matrix(workspace, JACOBIAN_H, 3, n),
        matrix(workspace, PRODUCT, 3, n),
        matrix(workspace, GAIN, 3, n),
    )
    dx, L, e, variance = (
        workspace[DX][:n],
        matrix(workspace, ROOT, 3, 3),
        workspace[USED],
        workspace[VARIANCE],
    )
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    used, measured = _gather(P, H, rows, std, innovation, e, variance)
    for j in range(n):
        dx[j] = 0.0
    nis = where(measured > 0, _gain(P, H, used, e, variance, U, L, K, dx), math.nan)
    _write_whitened(rows, L, e, innovation)
    taken = nis <= gate
    if any_of(taken):
        for a in range(used):  # nothing where it was not
            for j in range(n):
                U[a, j], K[a, j] = where(taken, U[a, j], 0.0), where(taken, K[a, j], 0.0)
        for j in range(n):
            dx[j] = where(taken, dx[j], 0.0)
        _joseph(P, H, used, variance, U, K, matrix(workspace, LEFT, n, n))
        inject_all(belief, dx)
        theta = dx[ATT]
        turn_half(P, theta[0], theta[1], theta[2])
    return nis


@helper
def _gather(
    P: Array, H: Array, rows: int, std: Array, innovation: Array, e: Array, variance: Array
) -> tuple[int, float]:
    """Bring the measured rows to the front: of H, of the innovations in e and of their noise in
    `variance`. Returns how many they are, and 1.0 where there is one, else 0.0."""
    n, used, measured = P.shape[0], 0, 0.0
    for i in range(rows):
        missing = math.isnan(innovation[i])
        if not all_of(missing):
            terms = 0.0
            for j in range(n):
                H[used, j] = where(missing, 0.0, H[i, j])
                terms += H[used, j] * H[used, j] * P[j, j]
            e[used] = where(missing, 0.0, innovation[i])
            variance[used] = where(missing, 1.0, max(std[i] * std[i], MIN_NOISE * terms))
            measured = where(missing, measured, 1.0)
            used += 1
    return used, measured


@helper
def _write_whitened(rows: int, L: Array, e: Array, innovation: Array) -> None:
    """The whitened innovations e and the rows of L behind the innovations, each at the place of its
    measured row."""
    a = 0
    for i in range(rows):
        missing = math.isnan(innovation[i])
        if not all_of(missing):
            if innovation.size > 3:
                innovation[3 + i] = where(missing, math.nan, e[a])
            if innovation.size > 6:
                root, b = 6 + i * (i + 1) // 2, 0
                for k in range(i + 1):
                    nowhere = all_of(math.isnan(innovation[k]))
                    factor = 0.0 if nowhere else L[a, b]
                    innovation[root + k] = where(missing, math.nan, factor)
                    b += not nowhere
            a += 1


@helper
def _project_row(P: Array, h: Array, u: Array) -> None:
    """u = h P."""
    n = P.shape[0]
    for j in range(n):
        u[j] = 0.0
    for k in range(n):
        if any_of(h[k] != 0):
            for j in range(n):
                u[j] += h[k] * P[k, j]


@helper
def _gain(
    P: Array,
    H: Array,
    used: int,
    e: Array,
    variance: Array,
    U: Array,
    L: Array,
    K: Array,
    dx: Array,
) -> float:
    """U = H P, K' = (H P H' + R)^-1 U by Cholesky, dx = K e. Returns the NIS, inf where there is
    no Cholesky; e becomes L^-1 e."""
    n, nis = P.shape[0], 0.0
    for a in range(used):
        _project_row(P, H[a], U[a])
        for b in range(a + 1):
            total = variance[a] if a == b else 0.0
            for j in range(n):
                total += U[a, j] * H[b, j]
            for m in range(b):
                total -= L[a, m] * L[b, m]
            if a == b:  # where S is not positive definite: rejected, and counted so
                nis = where(total > 0, nis, math.inf)
                total = where(total > 0, total, 1.0)
            L[a, b] = math.sqrt(total) if a == b else total / L[b, b]
        for b in range(a):
            e[a] -= L[a, b] * e[b]
        e[a] /= L[a, a]
        nis += e[a] * e[a]
    for j in range(n):
        for a in range(used):
            total = U[a, j]
            for b in range(a):
                total -= L[a, b] * K[b, j]
            K[a, j] = total / L[a, a]
            dx[j] += K[a, j] * e[a]
        for a in range(used - 1, -1, -1):
            for b in range(a + 1, used):
                K[a, j] -= L[b, a] * K[b, j]
            K[a, j] /= L[a, a]
    return nis


@helper
def _joseph(P: Array, H: Array, used: int, variance: Array, U: Array, K: Array, M: Array) -> None:
    """P <- (I - K H) P (I - K H)' + K R K', M (n, n) being (I - K H) P; U becomes (M H' - K R)'."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            M[i, j] = P[i, j]
        for a in range(used):
            for j in range(n):
                M[i, j] -= K[a, i] * U[a, j]
    for i in range(n):
        for a in range(used):
            back = -variance[a] * K[a, i]
            for j in range(n):
                back += M[i, j] * H[a, j]
            U[a, i] = back
    for i in range(n):
        for j in range(i + 1):
            total = M[i, j] + M[j, i]
            for a in range(used):
                total -= U[a, i] * K[a, j] + U[a, j] * K[a, i]
            P[i, j] = P[j, i] = 0.5 * total


EKF = Filter(
    "ekf",
    "Gelb (1974) section 6.1; Mollaei, Shafieirad & Moradi (2025) equations (19)-(22), corrected",
    start,
    predict,
    correct,
    slots=SLOTS,
    installation=True,
    lanes=True,
    bias=DECAYING,
    good_for="checking closed-loop against a textbook filter",
    poor_for="daily use: the result of closed-loop in 5 times its time",
)
