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
from ..compile.choosing import all_of, any_of, one_or_several, where
from ..compile.jit import flatten, helper, inlined
from ..compile.workspace import MOST_STATES
from .belief import Noise
from .elementary import exponential
from .error_dynamics import PP, TP, TV, VP, VV

COPY, PRODUCT, TRANSPOSED = 0, 225, 480
"""Parts of the flat workspace: P (rows of 15), Phi P (rows of 16), the first 8 rows of Phi P
transposed (rows of 8). One array with constant offsets, strides and trip counts, because then
the compiler sees that nothing overlaps and makes vector code."""
WIDTH = 48
WIDE, WIDE_PRODUCT, WIDE_END = 600, 600 + 15 * WIDTH, 600 + 24 * WIDTH
"""The same of more than fifteen states: P (15 rows of WIDTH) and Phi P (9 rows of WIDTH). What is written
eight numbers at a time is read so: the processor waits where the two do not match."""
LEAST_NOISE = 1e-9
"""A fix has at least this fraction of the variance that its states would bring without their
correlations: below it P would lose its positive sign to rounding."""


Nine: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""Errors of position, velocity and attitude."""


@inlined
def coefficients(
    blocks: Array, C: Array, dv_n: Array, w0: float, w1: float, w2: float, dt: float
) -> tuple[tuple[float, ...], ...]:
    """The numbers of Phi, for `column`; arguments as for `propagate`."""
    return (
        (w0, w1, w2),
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


@inlined
def column(phi: tuple[tuple[float, ...], ...], errors: Nine, biases: tuple[float, ...]) -> Nine:
    """Phi times a column of fifteen errors, of which the biases only decay and are left to the
    caller."""
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
) -> Callable[[Array, Array, Array, Array, float, float, float, float], None]:
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
        w0: float,
        w1: float,
        w2: float,
        dt: float,
    ) -> None:
        phi = coefficients(blocks, C, dv_n, w0, w1, w2, dt)
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
    w0: float,
    w1: float,
    w2: float,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """P <- Phi P Phi' + Q_d over dt, by symmetry from 9 rows of Phi P.

    `blocks` from kinematic_blocks, C and the specific-force increment dv_n (m/s, n) at
    mid-interval, w = omega_in dt (rad). Half of Q_d is added before and half after the transition:
    the trapezoidal rule for its integral.
    """
    keep, q = _decays(dt, noise), _half_noise(dt, noise)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]
    numbers, n = flatten(P), P.shape[0]
    if n == 15:
        for i in range(225):
            work[COPY + i] = numbers[i]
        _rows(work, blocks, C, dv_n, w0, w1, w2, dt)
        _transpose(PRODUCT, 16, work)
        _columns(work, blocks, C, dv_n, w0, w1, w2, dt)
        _last(work, blocks, C, dv_n, w0, w1, w2, dt)
        _write_back(PRODUCT, 16, P, keep, work)
    else:
        if n <= 23:
            _widen(P, 24, work)
            _rows_23(work, blocks, C, dv_n, w0, w1, w2, dt)
        elif n <= 31:
            _widen(P, 32, work)
            _rows_31(work, blocks, C, dv_n, w0, w1, w2, dt)
        else:
            _widen(P, 48, work)
            _rows_47(work, blocks, C, dv_n, w0, w1, w2, dt)
        _transpose(WIDE_PRODUCT, WIDTH, work)
        _columns(work, blocks, C, dv_n, w0, w1, w2, dt)
        _last_wide(work, blocks, C, dv_n, w0, w1, w2, dt)
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
    w0: float,
    w1: float,
    w2: float,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """`propagate`, the same to the last bit, for numbers that are vectors themselves: without the
    copies that make vector code of it."""
    keep, q = _decays(dt, noise), _half_noise(dt, noise)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]
    phi = coefficients(blocks, C, dv_n, w0, w1, w2, dt)
    if P.shape[0] == 15:  # the same code with constant lengths
        _apply_in_place(15, P, phi, keep, work)
    else:
        _apply_in_place(P.shape[0], P, phi, keep, work)
    for i in range(12):
        P[3 + i, 3 + i] += q[i]


propagate = one_or_several(propagate_by_rows, propagate_in_place)
"""P <- Phi P Phi' + Q_d over dt: see `propagate_by_rows`."""


@inlined
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


@inlined
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


@inlined
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


@inlined
def _decays(dt: float, noise: Noise) -> tuple[float, ...]:
    """What is left of each bias after dt."""
    a, g = decay(noise.accel_decay * dt), decay(noise.gyro_decay * dt)
    return (a, a, a, g, g, g)


@inlined
def _half_noise(dt: float, noise: Noise) -> tuple[float, ...]:
    """Half of Q_d of velocity, attitude and biases."""
    v, t = noise.accel * noise.accel * 0.5 * dt, noise.gyro * noise.gyro * 0.5 * dt
    a = noise.accel_bias * noise.accel_bias * 0.5 * dt
    g = noise.gyro_bias * noise.gyro_bias * 0.5 * dt
    return (v, v, v, t, t, t, a, a, a, g, g, g)


@inlined
def _transpose(product: int, stride: int, work: Array) -> None:
    """The first 8 rows of Phi P transposed."""
    for i in range(15):
        for j in range(8):
            work[TRANSPOSED + 8 * i + j] = work[product + stride * j + i]


@inlined
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


@inlined
def _widen(P: Array, lanes: int, work: Array) -> None:
    """The first fifteen rows of P in rows of WIDTH. Lanes beyond the states reach into the next row."""
    n, numbers = P.shape[0], flatten(P)
    for i in range(15):
        row = numbers[n * i : n * i + lanes]  # in which the compiler knows no index to be negative
        for lane in range(lanes):
            work[WIDE + WIDTH * i + lane] = row[lane]


@inlined
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
    w0: float,
    w1: float,
    w2: float,
    dt: float,
    noise: Noise,
    work: Array,
) -> None:
    """x <- Phi x over dt, arguments as for `propagate`."""
    for i in range(15):
        work[COPY + i] = x[i]
    _single(work, blocks, C, dv_n, w0, w1, w2, dt)
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


@inlined
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


@inlined
def used_rows(n: int) -> int:
    """Where `update` leaves, in its workspace, how many rows it used and their innovations by
    L^-1; U = L^-1 H P (3, n) lies before it, from 0 on."""
    return 3 * n


WORKSPACE = max(WIDE_END, used_rows(MOST_STATES) + 13)
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
    for m in range(int(work[used])):
        scale, i = work[used + 4 + m], int(work[used + 7 + m])
        for j in range(n):
            H[m, j] = H[i, j]
            for k in range(m):
                H[m, j] -= work[used + 9 + m + k] * H[k, j]
            H[m, j] *= scale


@helper
def update(
    P: Array, H: Array, innovation: Array, sd: Array, rows: int, gate: float, work: Array, dx: Array
) -> float:
    """Correct P by the measured rows (not NaN) of an innovation y - h with Jacobian H (3, n) and
    standard deviations sd.

    Writes dx = P H' (H P H' + R)^-1 innovation, behind the three rows where there is room the
    whitened innovation and L, and returns the NIS, NaN without any measured row.
    Unless NIS <= gate P is left as it was. What a smoother needs stays in `work`: see `used_rows`
    and `whiten`.
    """
    if P.shape[0] == 15:  # the same code with constant lengths
        return _update(15, P, H, innovation, sd, rows, gate, work, dx)
    return _update(P.shape[0], P, H, innovation, sd, rows, gate, work, dx)


@helper
def update_fifteen(
    P: Array, H: Array, innovation: Array, sd: Array, rows: int, gate: float, work: Array, dx: Array
) -> float:
    """`update` where no aiding brings states along."""
    return _update(15, P, H, innovation, sd, rows, gate, work, dx)


@inlined
def _update(
    n: int,
    P: Array,
    H: Array,
    innovation: Array,
    sd: Array,
    rows: int,
    gate: float,
    work: Array,
    dx: Array,
) -> float:
    """Whitening: U = L^-1 H P with L L' = H P H' + R row by row, then P - U' U, of which one half
    is computed and written twice."""
    numbers, used = flatten(P), used_rows(n)
    for i in range(used):
        work[i] = 0.0
    m, count, nis, e0, e1, e2 = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(rows):
        e = innovation[i]
        missing = math.isnan(e)
        if all_of(missing):
            continue
        count += where(missing, 0.0, 1.0)
        row, terms, first, last = m * n, 0.0, n, 0
        for j in range(n):
            h = H[i, j]
            if any_of(h != 0):
                first, last = min(first, j), j + 1
                terms += h * h * numbers[n * j + j]
                for k in range(n):
                    work[row + k] += h * numbers[n * j + k]
        for k in range(m):
            before, overlap = k * n, 0.0
            for j in range(first, last):
                overlap += H[i, j] * work[before + j]
            e -= overlap * (e0 if k == 0 else e1)
            work[used + 9 + m + k] = overlap
            for j in range(n):
                work[row + j] -= overlap * work[before + j]
        variance = 0.0
        for j in range(first, last):
            variance += H[i, j] * work[row + j]
        scale = 1 / math.sqrt(variance + max(sd[i] * sd[i], LEAST_NOISE * terms))
        e = where(missing, 0.0, e * scale)
        for j in range(n):
            work[row + j] = where(missing, 0.0, work[row + j] * scale)
        work[used + 4 + m], work[used + 7 + m] = scale, i
        if innovation.size > 3:
            innovation[3 + i] = where(missing, math.nan, e)
        if innovation.size > 6:
            root = 6 + i * (i + 1) // 2
            for k in range(i):
                innovation[root + k] = where(missing, math.nan, 0.0)
            for k in range(m):
                place = root + int(work[used + 7 + k])
                innovation[place] = where(missing, math.nan, work[used + 9 + m + k])
            innovation[root + i] = where(missing, math.nan, 1 / scale)
        nis += e * e
        e0, e1, e2 = (e, e1, e2) if m == 0 else ((e0, e, e2) if m == 1 else (e0, e1, e))
        m += 1
    work[used], work[used + 1], work[used + 2], work[used + 3] = count, e0, e1, e2
    V, W = n, 2 * n
    for j in range(n):
        dx[j] = e0 * work[j] + e1 * work[V + j] + e2 * work[W + j]
    nis = where(count == 0, math.nan, nis)
    taken = nis <= gate
    if any_of(taken):
        for j in range(n):
            dx[j] = where(taken, dx[j], 0.0)
            a, b, c = work[j], work[V + j], work[W + j]
            work[j], work[V + j], work[W + j] = (
                where(taken, a, 0.0),
                where(taken, b, 0.0),
                where(taken, c, 0.0),
            )
        for i in range(n):
            a, b, c = work[i], work[V + i], work[W + i]
            for j in range(i + 1):
                x = numbers[n * i + j] - (a * work[j] + b * work[V + j] + c * work[W + j])
                numbers[n * i + j] = x
                numbers[n * j + i] = x
    return nis
