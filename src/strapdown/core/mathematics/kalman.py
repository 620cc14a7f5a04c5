"""Covariance: prediction with the block-sparse transition of the 15 error states, correction that
keeps P symmetric and positive.

The transition is applied to rows, in the order in which the states feed each other (bias, attitude,
velocity, position) and with mid-interval values, so that it is of second order in dt at the cost of
the first-order one. Tests compare it with Van Loan's matrix exponential (IEEE TAC 1978) and the
correction with the Joseph form.
"""

import math
from collections.abc import Callable
from typing import TypeAlias

from ...typing import Array
from ..compile.jit import flatten, helper, inline, matrix
from ..compile.selection import all_of, any_of, one_or_several, where
from ..compile.workspace import MAX_STATES
from .belief import Noise
from .elementary import exponential
from .error_dynamics import PP, TP, TV, VP, VV
from .rotation import Three

COPY, PRODUCT, TRANSPOSED = 0, 225, 480
"""Parts of the flat workspace: P (rows of 15), Phi P (rows of 16), the first 8 rows of Phi P
transposed (rows of 8). One array with constant offsets, strides and trip counts, because then
the compiler sees that nothing overlaps and makes vector code."""
WIDTH = 48
WIDE, WIDE_PRODUCT, WIDE_END = 600, 600 + 15 * WIDTH, 600 + 24 * WIDTH
"""The same of more than fifteen states: P (15 rows of WIDTH) and Phi P (9 rows of WIDTH). What is written
eight numbers at a time is read so: the processor waits where the two do not match."""
MIN_NOISE = 1e-9
"""A fix has at least this fraction of the variance that its states would bring without their
correlations: below it P would lose its positive sign to rounding."""


Nine: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""Errors of position, velocity and attitude."""
Fifteen: TypeAlias = tuple[
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
]
"""Those with the errors of the biases."""


@inline
def coefficients(
    blocks: Array, C: Array, dv_n: Array, w: Three, dt: float
) -> tuple[tuple[float, ...], ...]:
    """The numbers of Phi, for `column`; arguments as for `propagate`."""
    return (
        w,
        # halves: they meet the sum of old and new attitude, and of old and new velocity
        (0.5 * dv_n[0], 0.5 * dv_n[1], 0.5 * dv_n[2], 0.5 * dt),
        (
            dt * blocks[PP],
            dt * blocks[PP + 2],
            dt * blocks[PP + 3],
            dt * blocks[PP + 4],
            dt * blocks[PP + 5],
        ),
        (
            dt * blocks[VP],
            dt * blocks[VP + 2],
            dt * blocks[VP + 3],
            dt * blocks[VP + 5],
            dt * blocks[VP + 6],
            dt * blocks[VP + 8],
        ),
        (
            dt * blocks[VV],
            dt * blocks[VV + 1],
            dt * blocks[VV + 2],
            dt * blocks[VV + 3],
            dt * blocks[VV + 4],
            dt * blocks[VV + 5],
            dt * blocks[VV + 6],
            dt * blocks[VV + 7],
        ),
        (
            dt * blocks[TP],
            dt * blocks[TP + 2],
            dt * blocks[TP + 5],
            dt * blocks[TP + 6],
            dt * blocks[TP + 8],
        ),
        (dt * blocks[TV + 1], dt * blocks[TV + 3], dt * blocks[TV + 7]),
        (dt * C[0, 0], dt * C[0, 1], dt * C[0, 2]),
        (dt * C[1, 0], dt * C[1, 1], dt * C[1, 2]),
        (dt * C[2, 0], dt * C[2, 1], dt * C[2, 2]),
    )


@inline
def column(phi: tuple[tuple[float, ...], ...], errors: Nine, biases: tuple[float, ...]) -> Nine:
    """Phi times a column of fifteen errors: position p (m), velocity v (m/s), attitude theta (rad),
    all in n; biases of the accelerometer a (m/s^2) and gyro g (rad/s), which only decay and are left
    to the caller. With F of `error_dynamics` and dv_n = f_n dt:

        theta+ = theta - omega_in dt x theta + dt (F_theta_p p + F_theta_v v) - dt C g
        v+     = v + dt (F_vp p + F_vv v) - dt C a - dv_n x (theta + theta+) / 2
        p+     = p + dt F_pp p + dt (v + v+) / 2
    """
    w, half, pp, vp, vv, tp, tv, c0, c1, c2 = phi
    w0, w1, w2 = w
    f0, f1, f2, half_dt = half
    p0, p1, p2, v0, v1, v2, t0, t1, t2 = errors
    a0, a1, a2, g0, g1, g2 = biases
    # sums in groups that do not wait for each other
    n0 = (
        (t0 + w2 * t1 - w1 * t2)
        + (tp[0] * p0 + tp[1] * p2 + tv[0] * v1)
        - (c0[0] * g0 + c0[1] * g1 + c0[2] * g2)
    )
    n1 = (
        (t1 + w0 * t2 - w2 * t0)
        + (tp[2] * p2 + tv[1] * v0)
        - (c1[0] * g0 + c1[1] * g1 + c1[2] * g2)
    )
    n2 = (
        (t2 + w1 * t0 - w0 * t1)
        + (tp[3] * p0 + tp[4] * p2 + tv[2] * v1)
        - (c2[0] * g0 + c2[1] * g1 + c2[2] * g2)
    )
    u0 = (
        (v0 + vp[0] * p0 + vp[1] * p2)
        + (vv[0] * v0 + vv[1] * v1 + vv[2] * v2)
        - (c0[0] * a0 + c0[1] * a1 + c0[2] * a2)
    )
    u1 = (
        (v1 + vp[2] * p0 + vp[3] * p2)
        + (vv[3] * v0 + vv[4] * v1 + vv[5] * v2)
        - (c1[0] * a0 + c1[1] * a1 + c1[2] * a2)
    )
    u2 = (
        (v2 + vp[4] * p0 + vp[5] * p2)
        + (vv[6] * v0 + vv[7] * v1)
        - (c2[0] * a0 + c2[1] * a1 + c2[2] * a2)
    )
    s0, s1, s2 = t0 + n0, t1 + n1, t2 + n2
    u0 += f2 * s1 - f1 * s2
    u1 += f0 * s2 - f2 * s0
    u2 += f1 * s0 - f0 * s1
    return (
        (p0 + pp[0] * p0 + pp[1] * p2) + half_dt * (v0 + u0),
        (p1 + pp[2] * p0 + pp[3] * p1 + pp[4] * p2) + half_dt * (v1 + u1),
        p2 + half_dt * (v2 + u2),
        u0,
        u1,
        u2,
        n0,
        n1,
        n2,
    )


def transition(
    name: str,
    source: int,
    source_stride: int,
    target: int,
    target_stride: int,
    blocks_of_lanes: tuple[int, ...],
    lanes: int,
) -> Callable[[Array, Array, Array, Array, Three, float], None]:
    """A helper that applies Phi to columns of the workspace: the 9 rows of position, velocity and
    attitude errors from `source` to `target`.

    The columns are `lanes` beginning at each of `blocks_of_lanes`. Bias rows, which only decay, are
    left to the caller.
    """
    p, v, t = (tuple(source + (3 * k + i) * source_stride for i in range(3)) for k in range(3))
    a, g = (tuple(source + (3 * k + i) * source_stride for i in range(3)) for k in (3, 4))
    P, V, T = (tuple(target + (3 * k + i) * target_stride for i in range(3)) for k in range(3))

    def apply(
        work: Array,
        blocks: Array,
        C: Array,
        dv_n: Array,
        w: Three,
        dt: float,
    ) -> None:
        phi = coefficients(blocks, C, dv_n, w, dt)
        for block in blocks_of_lanes:
            for lane in range(lanes):
                j = block + lane
                (
                    work[P[0] + j],
                    work[P[1] + j],
                    work[P[2] + j],
                    work[V[0] + j],
                    work[V[1] + j],
                    work[V[2] + j],
                    work[T[0] + j],
                    work[T[1] + j],
                    work[T[2] + j],
                ) = column(
                    phi,
                    (
                        work[p[0] + j],
                        work[p[1] + j],
                        work[p[2] + j],
                        work[v[0] + j],
                        work[v[1] + j],
                        work[v[2] + j],
                        work[t[0] + j],
                        work[t[1] + j],
                        work[t[2] + j],
                    ),
                    (
                        work[a[0] + j],
                        work[a[1] + j],
                        work[a[2] + j],
                        work[g[0] + j],
                        work[g[1] + j],
                        work[g[2] + j],
                    ),
                )

    # Kernels loaded from the cache bring their helpers along, and the linker takes helpers of one
    # name for one function.
    apply.__name__ = apply.__qualname__ = name
    return helper(apply)


# all 15 columns; the eighth is done twice, alike
_rows = transition("_rows", COPY, 15, PRODUCT, 16, (0, 7), 8)
# up to 23 columns, up to 31, up to 47
_rows_23 = transition("_rows_23", WIDE, WIDTH, WIDE_PRODUCT, WIDTH, (0, 8, 16), 8)
_rows_31 = transition("_rows_31", WIDE, WIDTH, WIDE_PRODUCT, WIDTH, (0, 8, 16, 24), 8)
_rows_47 = transition("_rows_47", WIDE, WIDTH, WIDE_PRODUCT, WIDTH, (0, 8, 16, 24, 32, 40), 8)
# columns 0-7 of Phi P: symmetry gives the rest
_columns = transition("_columns", TRANSPOSED, 8, TRANSPOSED, 8, (0,), 8)
_last = transition("_last", PRODUCT + 8 * 16, 1, COPY, 1, (0,), 1)  # its row 8
_last_wide = transition("_last_wide", WIDE_PRODUCT + 8 * WIDTH, 1, COPY, 1, (0,), 1)
_single = transition("_single", COPY, 1, PRODUCT, 1, (0,), 1)


@helper
def propagate_by_rows(
    P: Array,
    blocks: Array,
    C: Array,
    dv_n: Array,
    w: Three,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """Covariance over dt (s), by symmetry from 9 rows of Phi P; P (n, n) in the units of the
    states, `blocks` from kinematic_blocks, C = C_nb and the specific-force increment dv_n (m/s, n)
    at mid-interval, w = omega_in_n dt (rad).

        P <- Phi (P + Q_d / 2) Phi' + Q_d / 2        Phi of `column`
        Q_d = G Q_c G' dt = dt diag(0, S_accel^2, S_gyro^2, S_accel_bias^2, S_gyro_bias^2)

    with the root densities S of `noise`; half of Q_d before and half after the transition is the
    trapezoidal rule for its integral. States beyond the fifteenth stand still.

    Source: Hager & Bryne (18), to second order in dt instead of Van Loan's (1978) exponential.
    """
    keep, q = _decays(dt, noise), _half_noise(dt, noise)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]
    numbers, n = flatten(P), P.shape[0]
    if n == 15:
        for i in range(225):
            work[COPY + i] = numbers[i]
        _rows(work, blocks, C, dv_n, w, dt)
        _transpose(PRODUCT, 16, work)
        _columns(work, blocks, C, dv_n, w, dt)
        _last(work, blocks, C, dv_n, w, dt)
        _write_back(PRODUCT, 16, P, keep, work)
    else:
        if n <= 23:
            _widen(P, 24, work)
            _rows_23(work, blocks, C, dv_n, w, dt)
        elif n <= 31:
            _widen(P, 32, work)
            _rows_31(work, blocks, C, dv_n, w, dt)
        else:
            _widen(P, 48, work)
            _rows_47(work, blocks, C, dv_n, w, dt)
        _transpose(WIDE_PRODUCT, WIDTH, work)
        _columns(work, blocks, C, dv_n, w, dt)
        _last_wide(work, blocks, C, dv_n, w, dt)
        _write_back(WIDE_PRODUCT, WIDTH, P, keep, work)
        _write_beyond(P, keep, work)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]


@helper
def propagate_in_place(
    P: Array,
    blocks: Array,
    C: Array,
    dv_n: Array,
    w: Three,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """`propagate`, the same to the last bit, for numbers that are vectors themselves: without the
    copies that make vector code of it."""
    keep, q = _decays(dt, noise), _half_noise(dt, noise)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]
    phi = coefficients(blocks, C, dv_n, w, dt)
    if P.shape[0] == 15:  # the same code with constant lengths
        _apply_in_place(15, P, phi, keep, work)
    else:
        _apply_in_place(P.shape[0], P, phi, keep, work)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]


propagate = one_or_several(propagate_by_rows, propagate_in_place)
"""P <- Phi P Phi' + Q_d over dt: see `propagate_by_rows`."""


@inline
def _apply_in_place(
    n: int, P: Array, phi: tuple[tuple[float, ...], ...], keep: tuple[float, ...], work: Array
) -> None:
    """P <- Phi P Phi', by way of 9 rows of Phi P."""
    numbers = flatten(P)
    for j in range(n):  # its column j, from that of P, which is a row
        y = column(phi, _nine(numbers, n * j), _six(numbers, n * j + 9))
        for k in range(9):
            work[n * k + j] = y[k]
    for i in range(9):
        y = column(phi, _nine(work, n * i), _six(work, n * i + 9))
        for k in range(9):
            if k >= i:
                P[i, k] = y[k]
                P[k, i] = y[k]
        for j in range(6):
            x = keep[j] * work[n * i + 9 + j]
            P[i, 9 + j] = x
            P[9 + j, i] = x
        for j in range(15, n):
            x = work[n * i + j]
            P[i, j] = x
            P[j, i] = x
    for i in range(6):
        for j in range(6):
            P[9 + i, 9 + j] *= keep[i] * keep[j]
        for j in range(15, n):
            x = keep[i] * P[9 + i, j]
            P[9 + i, j] = x
            P[j, 9 + i] = x


@inline
def _nine(numbers: Array, k: int) -> Nine:
    """Nine numbers from k on."""
    return (
        numbers[k],
        numbers[k + 1],
        numbers[k + 2],
        numbers[k + 3],
        numbers[k + 4],
        numbers[k + 5],
        numbers[k + 6],
        numbers[k + 7],
        numbers[k + 8],
    )


@inline
def _six(numbers: Array, k: int) -> tuple[float, ...]:
    """Six numbers from k on."""
    return (
        numbers[k],
        numbers[k + 1],
        numbers[k + 2],
        numbers[k + 3],
        numbers[k + 4],
        numbers[k + 5],
    )


@inline
def _decays(dt: float, noise: Noise) -> tuple[float, ...]:
    """Return the share of each bias that remains after dt."""
    a, g = decay(noise.accel_decay * dt), decay(noise.gyro_decay * dt)
    return (a, a, a, g, g, g)


@inline
def _half_noise(dt: float, noise: Noise) -> tuple[float, ...]:
    """Half of Q_d of velocity, attitude and biases."""
    v, t = noise.accel * noise.accel * 0.5 * dt, noise.gyro * noise.gyro * 0.5 * dt
    a = noise.accel_bias * noise.accel_bias * 0.5 * dt
    g = noise.gyro_bias * noise.gyro_bias * 0.5 * dt
    return (v, v, v, t, t, t, a, a, a, g, g, g)


@inline
def _transpose(product: int, stride: int, work: Array) -> None:
    """The first 8 rows of Phi P transposed."""
    for i in range(15):
        for j in range(8):
            work[TRANSPOSED + 8 * i + j] = work[product + stride * j + i]


@inline
def _write_back(product: int, stride: int, P: Array, keep: tuple[float, ...], work: Array) -> None:
    """P of the first fifteen states from Phi P and Phi (Phi P)'."""
    for i in range(9):
        for j in range(min(i + 1, 8)):
            P[i, j] = P[j, i] = work[TRANSPOSED + 8 * i + j]
        for j in range(6):
            P[i, 9 + j] = P[9 + j, i] = keep[j] * work[product + stride * i + 9 + j]
    P[8, 8] = work[COPY + 8]
    for i in range(6):
        for j in range(6):
            P[9 + i, 9 + j] *= keep[i] * keep[j]


@inline
def _widen(P: Array, lanes: int, work: Array) -> None:
    """The first fifteen rows of P in rows of WIDTH. Lanes beyond the states reach into the next row."""
    n, numbers = P.shape[0], flatten(P)
    for i in range(15):
        row = numbers[n * i : n * i + lanes]  # in which the compiler knows no index to be negative
        for lane in range(lanes):
            work[WIDE + WIDTH * i + lane] = row[lane]


@inline
def _write_beyond(P: Array, keep: tuple[float, ...], work: Array) -> None:
    """The covariances with states beyond the fifteenth, which stand still themselves."""
    for column in range(15, P.shape[0]):
        for i in range(9):
            P[i, column] = P[column, i] = work[WIDE_PRODUCT + WIDTH * i + column]
        if keep[0] != 1.0 or keep[3] != 1.0:
            for i in range(6):
                P[9 + i, column] = P[column, 9 + i] = (
                    keep[i] * work[WIDE + WIDTH * (9 + i) + column]
                )


@helper
def propagate_error(
    x: Array,
    blocks: Array,
    C: Array,
    dv_n: Array,
    w: Three,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """x <- Phi x over dt, arguments as for `propagate`."""
    for i in range(15):
        work[COPY + i] = x[i]
    _single(work, blocks, C, dv_n, w, dt)
    keep_a, keep_g = decay(noise.accel_decay * dt), decay(noise.gyro_decay * dt)
    for i in range(9):
        x[i] = work[PRODUCT + i]
    for i in range(3):
        x[9 + i] *= keep_a
        x[12 + i] *= keep_g


@helper
def decay(a: float) -> float:
    """exp(-a), by its series where a is as small as between two samples; exactly 1 for a random
    walk."""
    left, long = 1 - a * (1 - a * (0.5 - a * (1 - 0.25 * a) / 6)), not a < 1e-3
    return where(long, exponential(-a), left) if any_of(long) else left


@inline
def of_estimates(noise: Noise) -> Noise:
    """`noise` with the decays of the estimates of the biases in place of those of the biases.

    A prediction is the mean of what is to come. Held estimates are it where what was found of a
    bias lasts and only the uncertainty of it is that of a Gauss-Markov process about it.
    """
    decaying = 1 - noise.held
    return Noise(
        noise.gyro,
        noise.accel,
        noise.gyro_bias,
        noise.accel_bias,
        decaying * noise.gyro_decay,
        decaying * noise.accel_decay,
        noise.held,
    )


@inline
def used_rows(n: int) -> int:
    """Where `update` leaves, in its workspace, what its rows share (from COUNT on); U = L^-1 H P
    (3, n) lies before it, from 0 on."""
    return 3 * n


COUNT, WHITENED, SCALE, ROW, OVERLAP, SHARED = 0, 1, 4, 7, 10, 13
"""Behind U, of the rows that were used: how many there are; of each its innovation by L^-1, 1 over the
diagonal of L, and which row of H it is; then what L has below its diagonal, row by row."""
WORKSPACE = max(WIDE_END, used_rows(MAX_STATES) + SHARED)
"""Numbers of the flat workspace of `propagate`, and of `update`, which uses it in its own way."""


@helper
def whiten(H: Array, work: Array) -> None:
    """After `update`: the first rows of H, as many as were used, become those of L^-1 H, L L' =
    H P H' + R."""
    whiten_rows(H, work, used_rows(H.shape[1]))


@helper
def whiten_rows(H: Array, work: Array, used: int) -> None:
    """`whiten` for rows of any length, such as those of the identity; `used` is `used_rows(n)`."""
    n = H.shape[1]
    for m in range(int(work[used + COUNT])):
        scale, i = work[used + SCALE + m], int(work[used + ROW + m])
        for j in range(n):
            H[m, j] = H[i, j]
            for k in range(m):
                H[m, j] -= work[used + OVERLAP - 1 + m + k] * H[k, j]
            H[m, j] *= scale


@helper
def update(
    P: Array,
    H: Array,
    innovation: Array,
    std: Array,
    rows: int,
    gate: float,
    work: Array,
    dx: Array,
) -> float:
    """Correct P (n, n) by the first `rows` rows of an innovation e = y - h(x) with Jacobian H
    (3, n) and independent noise of standard deviations std; NaN is a row that was not measured.

        S   = H P H' + R = L L',  R = diag(std^2)
        U   = L^-1 H P,  w = L^-1 e         row by row, the later ones less what the first have said
        NIS = e' S^-1 e = w' w
        dx  = K e = P H' S^-1 e = U' w
        P  <- (I - K H) P = P - U' U        unless NIS > gate, which leaves P as it was

    e in the units of the measurement, dx in those of the states. Returns the NIS, NaN without any
    measured row. `innovation` gets w behind its three rows, and L (6 numbers, by rows) behind that,
    where it has room. What a smoother needs stays in `work`: see `used_rows` and `whiten`.

    Source: Hager & Bryne (14) to (16) and Groves (2013) section 3.2 for K and P, here without an
    inverse; Bierman (1977), "Factorization methods for discrete sequential estimation", for rows
    taken one after the other.
    """
    if P.shape[0] == 15:  # the same code with constant lengths
        return _update(15, P, H, innovation, std, rows, gate, work, dx)
    return _update(P.shape[0], P, H, innovation, std, rows, gate, work, dx)


@helper
def update_fifteen(
    P: Array,
    H: Array,
    innovation: Array,
    std: Array,
    rows: int,
    gate: float,
    work: Array,
    dx: Array,
) -> float:
    """`update` where no source brings states along."""
    return _update(15, P, H, innovation, std, rows, gate, work, dx)


@inline
def _update(
    n: int,
    P: Array,
    H: Array,
    innovation: Array,
    std: Array,
    rows: int,
    gate: float,
    work: Array,
    dx: Array,
) -> float:
    """`update` of n states."""
    U, shared = matrix(work, 0, 3, n), work[used_rows(n) : used_rows(n) + SHARED]
    for i in range(used_rows(n) + SCALE):
        work[i] = 0.0
    m, nis = 0, 0.0
    for i in range(rows):
        missing = math.isnan(innovation[i])
        if all_of(missing):
            continue
        w = _whiten_row(n, i, m, P, H[i], innovation[i], std[i], U, shared)
        _write_whitened(i, m, w, shared, innovation)
        shared[COUNT] += where(missing, 0.0, 1.0)
        nis += w * w
        m += 1
    w0, w1, w2 = shared[WHITENED], shared[WHITENED + 1], shared[WHITENED + 2]
    for j in range(n):
        dx[j] = w0 * U[0, j] + w1 * U[1, j] + w2 * U[2, j]
    nis = where(shared[COUNT] == 0, math.nan, nis)
    taken = nis <= gate
    if any_of(taken):
        for j in range(n):  # in lanes those that take nothing
            dx[j] = where(taken, dx[j], 0.0)
            for k in range(3):
                U[k, j] = where(taken, U[k, j], 0.0)
        _reduce(n, P, U)
    return nis


@inline
def _whiten_row(
    n: int, i: int, m: int, P: Array, h: Array, e: float, std: float, U: Array, shared: Array
) -> float:
    """Row i of H, with innovation e, as the m-th that is used: its row of U and its numbers in
    `shared`. Returns its innovation by L^-1, 0 where it is missing.

    u = P h' less the overlap l_k = h U_k' with each row before it, e less l_k w_k; then both by
    1/sqrt(h u + r), with r = std^2.
    """
    u, missing = U[m], math.isnan(e)
    terms, first, last = _project_row(n, P, h, u)
    for k in range(m):
        overlap = _along(h, U[k], first, last)
        shared[OVERLAP - 1 + m + k] = overlap
        e -= overlap * shared[WHITENED + k]
        for j in range(n):
            u[j] -= overlap * U[k, j]
    scale = 1 / math.sqrt(_along(h, u, first, last) + max(std * std, MIN_NOISE * terms))
    for j in range(n):
        u[j] = where(missing, 0.0, u[j] * scale)
    w = where(missing, 0.0, e * scale)
    shared[WHITENED + m], shared[SCALE + m], shared[ROW + m] = w, scale, i
    return w


@inline
def _project_row(n: int, P: Array, h: Array, u: Array) -> tuple[float, int, int]:
    """u += P h'. Returns the variance of h x without the correlations of x, and the range of the
    columns where h is not zero."""
    terms, first, last = 0.0, n, 0
    for j in range(n):
        if any_of(h[j] != 0):
            first, last = min(first, j), j + 1
            terms += h[j] * h[j] * P[j, j]
            for k in range(n):
                u[k] += h[j] * P[j, k]
    return terms, first, last


@inline
def _along(h: Array, u: Array, first: int, last: int) -> float:
    """h u, of the columns in a range."""
    total = 0.0
    for j in range(first, last):
        total += h[j] * u[j]
    return total


@inline
def _write_whitened(i: int, m: int, w: float, shared: Array, innovation: Array) -> None:
    """Whitened innovation and row of L of row i, the m-th used, behind the innovation."""
    missing = math.isnan(innovation[i])
    if innovation.size > 3:
        innovation[3 + i] = where(missing, math.nan, w)
    if innovation.size > 6:
        root = 6 + i * (i + 1) // 2
        for k in range(i):
            innovation[root + k] = where(missing, math.nan, 0.0)
        for k in range(m):
            place = root + int(shared[ROW + k])
            innovation[place] = where(missing, math.nan, shared[OVERLAP - 1 + m + k])
        innovation[root + i] = where(missing, math.nan, 1 / shared[SCALE + m])


@inline
def _reduce(n: int, P: Array, U: Array) -> None:
    """P <- P - U' U, of which one half is computed and written twice."""
    u, v, w = U[0], U[1], U[2]
    for i in range(n):
        a, b, c = u[i], v[i], w[i]
        for j in range(i + 1):
            x = P[i, j] - (a * u[j] + b * v[j] + c * w[j])
            P[i, j] = x
            P[j, i] = x
