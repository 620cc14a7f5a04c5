"""Sigma points in square-root form: sets, propagation, correction. For any number of states n,
without allocation, shared by all that need them.

A covariance P is kept as rows A with A'A = P, n of them and upper triangular: the Cholesky factor
transposed, so that sigma points are estimate +- spread * row. All tables are flat, rows of `lanes`
>= n numbers, a multiple of LANES, zeros beyond n.

A set has pairs of points and a centre. With u the errors of the propagated points about the
propagated centre, m their weighted mean and z the plain mean of the outer points, its covariance is
    sum (u - z)(u - z)' / (2 spread^2) + rest z z',
    rest = s + s^2 (beta - alpha^2),   s = states / spread^2,
which is the textbook sum about m, put together again: there the centre of `merwe` with alpha = 0.1,
kappa = 0 weighs -96, here every term is positive as long as beta + alpha^2 kappa / states is.
`symmetric` has alpha = 1, kappa = 0, beta = 0 and with them rest = 0.

Source: Van der Merwe (2004), chapter 3; Julier & Uhlmann (2004); Arasaratnam & Haykin (2009); Golub
& Van Loan (2013) sections 5.2, 6.5.
"""

import math

from ...core.compile.jit import helper, inline, lanes_of, sides
from ...core.compile.selection import where
from ...core.compile.signatures import LANES
from ...typing import Array

VARIANCE_FLOOR = 1e-13
"""A variance given all states before it is at least this fraction of the variance itself; what
is smaller is rounding, or no covariance at all."""
DOWNDATE_FLOOR = 1e-6
"""Share of a variance that a downdate leaves where it was to take off more than there is."""


def merwe(
    states: int, alpha: float = 0.1, beta: float = 2.0, kappa: float = 0.0
) -> tuple[float, float]:
    """Return (spread, rest) of Van der Merwe's scaled set for this number of states, noise
    included. Raises ValueError where it has no points."""
    if not (
        alpha > 0
        and states + kappa > 0
        and math.isfinite(alpha)
        and math.isfinite(beta)
        and math.isfinite(kappa)
    ):
        raise ValueError(
            f"sigma points: alpha is {alpha} and kappa {kappa}; alpha must be above 0 and kappa "
            f"above -{states}, beta finite"
        )
    square = alpha * alpha * (states + kappa)
    share = states / square
    return math.sqrt(square), share + share * share * (beta - alpha * alpha)


def symmetric(states: int) -> tuple[float, float]:
    """(spread, rest) of the 2 n points of equal weight, which are those of the cubature rule of
    third degree."""
    return math.sqrt(states), 0.0


@helper
def factor(P: Array, n: int, lanes: int, A: Array) -> int:
    """Rows A (n, lanes) of the square root of P (n, n). Returns how many of its numbers had to be
    repaired, 0 for a covariance.

    A correlation, given all states before, that is not within (-1, 1) becomes the nearest that is,
    or 0 where nothing is left to correlate with; variances stay, but for what is less than
    VARIANCE_FLOOR.
    """
    repaired = 0
    for j in range(n):
        row, pivot = lanes * j, P[j, j]
        for i in range(j):
            A[row + i] = 0.0
            pivot -= A[lanes * i + j] * A[lanes * i + j]
        empty = not pivot > VARIANCE_FLOOR * P[j, j]
        repaired += empty and P[j, j] != 0
        root = math.sqrt(VARIANCE_FLOOR * max(P[j, j], 0.0)) if empty else math.sqrt(pivot)
        A[row + j] = root
        for k in range(j + 1, lanes):
            A[row + k] = 0.0
        for k in range(j + 1, 0 if empty else n):
            left, rest = P[j, k], P[k, k]
            for i in range(j):
                left -= A[lanes * i + j] * A[lanes * i + k]
                rest -= A[lanes * i + k] * A[lanes * i + k]
            most = math.sqrt(max(rest, 0.0) * (1 - 4 * VARIANCE_FLOOR))
            A[row + k] = left / root
            if abs(A[row + k]) > most:
                repaired += abs(A[row + k]) > most + 4 * VARIANCE_FLOOR * math.sqrt(abs(P[k, k]))
                A[row + k] = math.copysign(most, left)
    return repaired


@inline
def covariance(A: Array, n: int, lanes: int, P: Array) -> None:
    """P (n, n) = A'A of n rows, symmetric to the last bit; the row after them is workspace."""
    last = lanes * n
    for i in range(n):
        for side in sides():
            rows, width = lanes_of(A, 0, (n + 1) * (lanes // LANES), side), lanes // LANES
            for w in range(i // LANES + 1):
                sum = 0.0
                for k in range(i + 1):
                    sum += A[lanes * k + i] * rows[width * k + w]
                rows[width * n + w] = sum
        for j in range(i + 1):
            P[i, j] = P[j, i] = A[last + j]


@inline
def triangle(A: Array, rows: int, n: int, lanes: int) -> None:
    """Householder: the first n rows of A become upper triangular with a positive diagonal, A'A of
    all `rows` >= n stays. The rest is lost, and so is the row after the last, which is workspace.
    """
    for first in range(0, n, LANES):  # what stands before it is done
        for j in range(first, min(n, first + LANES)):
            _reflect(A, rows, j, first, lanes)


@inline
def _reflect(A: Array, rows: int, j: int, first: int, lanes: int) -> None:
    """Column j below the diagonal becomes zero; before column `first` there is nothing any more."""
    d, head, width, begin = lanes * rows, lanes * j, lanes // LANES, first // LANES
    for side in sides():
        R = lanes_of(A, 0, width * (rows + 1), side)
        for w in range(begin, width):
            # products with all columns, four rows at a time, because each sum waits for the one
            # before
            sum, i = 0.0, j
            while i + 4 <= rows:
                r, at = lanes * i + j, width * i + w
                sum += (A[r] * R[at] + A[r + lanes] * R[at + width]) + (
                    A[r + 2 * lanes] * R[at + 2 * width] + A[r + 3 * lanes] * R[at + 3 * width]
                )
                i += 4
            while i < rows:
                sum += A[lanes * i + j] * R[width * i + w]
                i += 1
            R[width * rows + w] = sum
    norm = math.sqrt(A[d + j])
    if norm == 0:
        return
    at = A[head + j]
    sign = -1.0 if at > 0 else 1.0
    scale, v = 1 / (norm * (norm + abs(at))), at - sign * norm
    for side in sides():
        R = lanes_of(A, 0, width * (rows + 1), side)
        for w in range(begin, width):
            product = scale * (R[width * rows + w] - sign * norm * R[width * j + w])
            R[width * rows + w] = product
            R[width * j + w] = sign * (R[width * j + w] - v * product)
    A[head + j] = norm
    for i in range(j + 1, rows):
        r = lanes * i
        a = A[r + j]
        for side in sides():
            R = lanes_of(A, 0, width * (rows + 1), side)
            for w in range(begin, width):
                R[width * i + w] -= a * R[width * rows + w]
        A[r + j] = 0.0


@helper
def downdate(A: Array, x: Array, n: int, lanes: int, work: Array) -> int:
    """A'A <- A'A - x x' on n triangular rows. Returns 0; or 1 where that would be no covariance:
    then x x' is taken off as far as leaves DOWNDATE_FLOOR of the variance along it, which is
    nearest in the metric of A'A.

    x has n numbers, `work` 2 n. LINPACK's dchdd (Dongarra et al. 1979).
    """
    size, outside = 0.0, False
    for j in range(n):
        p = x[j]
        for i in range(j):
            p -= A[lanes * i + j] * work[i]
        outside |= p != 0 and not A[lanes * j + j] > 0
        work[j] = p / A[lanes * j + j] if A[lanes * j + j] > 0 else 0.0
        size += work[j] * work[j]
    failed = outside or not size < 1 - VARIANCE_FLOOR
    if not size < 1 - VARIANCE_FLOOR:
        scale = math.sqrt((1 - DOWNDATE_FLOOR) / size)
        for j in range(n):
            work[j] *= scale
        size = 1 - DOWNDATE_FLOOR
    rest = math.sqrt(1 - size)
    for k in range(n - 1, -1, -1):
        longer = math.hypot(rest, work[k])
        work[n + k], work[k] = rest / longer, work[k] / longer
        rest = longer
    for j in range(n):
        carried = 0.0
        for k in range(j, -1, -1):
            a = A[lanes * k + j]
            A[lanes * k + j] = work[n + k] * a - work[k] * carried
            carried = work[n + k] * carried + work[k] * a
    return 1 if failed else 0


@inline
def deviations(
    A: Array, pairs: int, still: int, lanes: int, spread: float, rest: float, mean: Array
) -> float:
    """From errors about the centre to rows of the square root of their covariance. Returns what the
    last of them is worth where it is to be taken off.

    A holds the errors of the points estimate + spread * row and, `pairs` rows further, of the
    points with -; it becomes 2 pairs + 1 rows. `still` more pairs stay where they are put, such as
    noise that is only added: their rows are the caller's to append. `mean` (lanes) receives the
    weighted mean. Where 0 is returned all is well; else the last row, which is then zero, must be
    subtracted (`downdate`) with that factor times `mean`.
    """
    half, twice = 0.5 / spread, 1 / (pairs + still)
    worth = rest + still / (spread * spread)
    root, weight = math.sqrt(abs(worth)) * 0.5 * twice, 0.5 / (spread * spread)
    for side in sides():
        width = lanes // LANES
        rows, sums = lanes_of(A, 0, width * (2 * pairs + 1), side), lanes_of(mean, 0, width, side)
        for w in range(width):
            sum = 0.0
            for i in range(2 * pairs):
                sum += rows[width * i + w]
            outer = twice * sum  # the plain mean of the outer points, and once more
            for i in range(pairs):
                r, s = width * i + w, width * (i + pairs) + w
                a, b = rows[r], rows[s]
                rows[r], rows[s] = half * (a - b), half * (a + b - outer)
            rows[2 * width * pairs + w] = where(worth > 0, root * sum, 0.0)
            sums[w] = weight * sum
    return root / weight if worth < 0 else 0.0


@inline
def correct_root(
    A: Array,
    n: int,
    lanes: int,
    E: Array,
    rows: int,
    spread: float,
    rest: float,
    variance: Array,
    gate: float,
    innovation: Array,
    work: Array,
    dx: Array,
) -> tuple[float, int]:
    """Correct the square root A, n rows (and one of workspace), by the innovations y - h at its
    sigma points. Returns (NIS, repaired).

    E (2 n + 1, rows): at the centre, at the points with + and at those with -. `variance` (rows) of
    the noise. innovation (rows) receives the weighted mean, NaN where not measured; dx (n) the
    correction of the mean; `work` needs rows (n + rows + 5) numbers. Unless NIS <= gate A is left
    as it was. The deviations of h that are linear in the points make rows G in the coordinates xi
    of A' xi; those of second order count as noise beside `variance`. The correction is then that of
    a Kalman filter with prior covariance I, row by row I - c phi phi' (Potter), and nothing is
    taken off that could be too much. Where rest < 0 leaves no covariance of that noise, its second
    order is left out and 1 returned as `repaired`.
    """
    repaired = 0
    used = _innovation_statistics(n, E, rows, spread, innovation, work)
    if not _whiten_rows(n, E, rows, used, spread, rest, variance, work):
        repaired = 1
        _whiten_rows(n, E, rows, used, spread, math.nan, variance, work)
    nis = _gains(n, rows, used, work)
    _write_whitened(n, rows, used, work, innovation)
    for j in range(n):
        dx[j] = 0.0
    if nis <= gate:
        for a in range(used):
            _take_off(A, n, lanes, rows, a, work, dx)
        triangle(A, n, n, lanes)
    return nis, repaired


@helper
def _write_whitened(n: int, rows: int, used: int, work: Array, innovation: Array) -> None:
    """The whitened innovations and the square root of their covariance behind the innovations, each
    at the place of its measured row."""
    if innovation.size <= 3:
        return
    e, order = rows * n + rows * rows, rows * n + rows * rows + 4 * rows
    for a in range(used):
        i = int(work[order + a])
        innovation[3 + i] = work[e + a]
        root = 6 + i * (i + 1) // 2
        for k in range(i if innovation.size > 6 else 0):
            innovation[root + k] = 0.0
        for b in range(a + 1 if innovation.size > 6 else 0):
            innovation[root + int(work[order + b])] = work[rows * n + rows * a + b]


@helper
def _take_off(A: Array, n: int, lanes: int, rows: int, a: int, work: Array, dx: Array) -> None:
    """A <- (I - c phi phi') A and the share of the correction dx, for row a of G whitened; the row
    behind A is workspace."""
    share, last = rows * n + rows * rows + rows, lanes * n
    for lane in range(lanes):
        A[last + lane] = 0.0
    for k in range(n):
        phi = work[n * a + k]
        for lane in range(lanes):
            A[last + lane] += phi * A[lanes * k + lane]
    for j in range(n):
        dx[j] += work[share + a] * A[last + j]
    for k in range(n):
        phi = work[share + rows + a] * work[n * a + k]
        for lane in range(lanes):
            A[lanes * k + lane] -= phi * A[last + lane]


@helper
def _gains(n: int, rows: int, used: int, work: Array) -> float:
    """Row by row of the whitened G and innovations: e / size and 1 / (size + sqrt(size)), with
    those before taken into account; e is divided by sqrt(size), and the square root of the noise
    becomes that of the innovation's covariance. Returns the NIS."""
    L, e = rows * n, rows * n + rows * rows
    share, c, nis = e + rows, e + 2 * rows, 0.0 if used > 0 else math.nan
    for a in range(used):
        size = 1.0
        for j in range(n):
            size += work[n * a + j] * work[n * a + j]
        work[share + a], work[c + a] = work[e + a] / size, 1 / (size + math.sqrt(size))
        work[e + a] /= math.sqrt(size)
        nis += work[e + a] * work[e + a]
        for b in range(a, used):
            work[L + rows * b + a] *= math.sqrt(size)
        for b in range(a + 1, used):
            overlap = 0.0
            for j in range(n):
                overlap += work[n * b + j] * work[n * a + j]
            for row in range(b, used):
                work[L + rows * row + a] += work[L + rows * row + b] * overlap / math.sqrt(size)
            work[e + b] -= overlap * work[share + a]
            for j in range(n):
                work[n * b + j] -= overlap * work[c + a] * work[n * a + j]
    return nis


@helper
def _innovation_statistics(
    n: int, E: Array, rows: int, spread: float, innovation: Array, work: Array
) -> int:
    """The weighted mean of the innovations; of the measured ones the rows G, the mean, the mean
    of the outer points less the centre, and their index."""
    own, used = rows * n + rows * rows, 0
    for a in range(rows):
        total = 0.0
        for i in range(1, 2 * n + 1):
            total += E[i, a] - E[0, a]
        innovation[a] = E[0, a] + total * 0.5 / (spread * spread)
        if not math.isnan(innovation[a]):
            for j in range(n):
                work[n * used + j] = (E[1 + n + j, a] - E[1 + j, a]) * 0.5 / spread
            work[own + used], work[own + 3 * rows + used], work[own + 4 * rows + used] = (
                innovation[a],
                total * 0.5 / n,
                a,
            )
            used += 1
    return used


@helper
def _whiten_rows(
    n: int, E: Array, rows: int, used: int, spread: float, rest: float, variance: Array, work: Array
) -> bool:
    """Divide rows G and innovations by the square root of their noise: `variance` and, unless
    `rest` is NaN, what is of second order. False: it has none."""
    L, own = rows * n, rows * n + rows * rows
    for a in range(used):
        i, z = int(work[own + 4 * rows + a]), work[own + 3 * rows + a]
        for b in range(a + 1):
            k, y = int(work[own + 4 * rows + b]), work[own + 3 * rows + b]
            noise = variance[i] if a == b else 0.0
            if not math.isnan(rest):
                for j in range(n):
                    one, other = (
                        E[1 + j, i] + E[1 + n + j, i] - 2 * (E[0, i] + z),
                        E[1 + j, k] + E[1 + n + j, k] - 2 * (E[0, k] + y),
                    )
                    noise += 0.25 / (spread * spread) * one * other
                noise += rest * z * y
            for m in range(b):
                noise -= work[L + rows * a + m] * work[L + rows * b + m]
            if a != b:
                work[L + rows * a + b] = noise / work[L + rows * b + b]
            elif noise > VARIANCE_FLOOR * variance[i] or math.isnan(rest):
                work[L + rows * a + a] = math.sqrt(noise)
            else:
                return False
    for a in range(used):
        for b in range(a + 1):
            scale = 1 / work[L + rows * a + a] if a == b else -work[L + rows * a + b]
            if a != b:
                work[own + a] += scale * work[own + b]
                for j in range(n):
                    work[n * a + j] += scale * work[n * b + j]
            else:
                work[own + a] *= scale
                for j in range(n):
                    work[n * a + j] *= scale
    return True
