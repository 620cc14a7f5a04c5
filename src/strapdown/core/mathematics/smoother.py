"""Fixed-interval smoothing in the form of Bryson and Frazier: backwards over what each call of a
filter left on the record, without inverting a covariance.

Between the calls stand lam and Lam: what all later measurements say about the belief there, in the
inverse units of the states. From the last call to the first, lam = 0 and Lam = 0 behind it:

    lam <- Phi' lam,  Lam <- Phi' Lam Phi                                  before a prediction
    lam <- (I - K H)' lam - H' S^-1 e
    Lam <- (I - K H)' Lam (I - K H) + H' S^-1 H                            before a correction
    x_smoothed = x - P lam,  P_smoothed = P - P Lam P                      at a row of the solution

The filter brings these adjoints of its calls along; a call that only adds to P needs none.
Source: Bryson & Frazier (1963), modified as in Bierman (1973), Automatica 9; Gibbs (2011), Advanced
Kalman Filtering, section 6.2.
"""

import math

from ...typing import Array, Ints
from ..compile.jit import caller, flatten, helper, inline, kernel
from ..compile.signatures import WHOLE, reals, signature, wholes
from .coupling import COUPLED, uncouple
from .earth import displace
from .rotation import turn_quaternion
from .solution_row import BIASES, LLA, STD, Q, V
from .tape import ADJOINT_STEP
from .time_correlated import FADED, unfade

RUN_BACK = signature(
    "run_back",
    adjoint_step=WHOLE,
    record=reals("calls", "width"),
    mark=wholes("rows"),
    P=reals("rows", "n", "n"),
    estimated=wholes("k"),
    lam=reals("k"),
    Lam=reals("k", "k"),
    work=reals("work"),
    nav=reals("rows", "columns"),
    covariance=reals("covariances", "n", "n"),
)

adjoint_step_at = caller(ADJOINT_STEP)


def work_size(k: int, n: int) -> int:
    """Numbers of the workspace of `run_back` and of `adjoint_step` with k estimated of n states."""
    return max(512, 2 * k * (k + 2)) + 2 * (k + 2) + 240 + n


@kernel(RUN_BACK)
def run_back(
    adjoint_step: int,
    record: Array,
    mark: Ints,
    P: Array,
    estimated: Ints,
    lam: Array,
    Lam: Array,
    work: Array,
    nav: Array,
    covariance: Array,
) -> None:
    """From the last call on `record` to the first. Rows of `nav` (as of the loop), the filter's,
    become the smoothed ones, with P (rows, n, n) theirs.

    Before each row `mark` calls were done. `estimated` (k,) are the states in lam (k,) and Lam (k,
    k), which begin with what is known of later tapes and end with what earlier ones need. work has
    `work_size(k, n)` numbers. `covariance` gets the smoothed covariances, unless it has no rows.
    """
    call = record.shape[0] - 1
    for row in range(mark.size - 1, -1, -1):
        while call >= mark[row]:
            _undo(adjoint_step, record[call], lam, Lam, work)
            call -= 1
        _smooth_row(P[row], estimated, lam, Lam, work, nav[row])
        if covariance.shape[0] > 0:
            _write_covariance(P[row], estimated, lam.size, work, covariance[row])
    while call >= 0:
        _undo(adjoint_step, record[call], lam, Lam, work)
        call -= 1


@inline
def _undo(adjoint_step: int, call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of a call of the filter, or of what the loop did beside it."""
    if call[0] == COUPLED:
        uncouple(call, lam, Lam)
    elif call[0] == FADED:
        unfade(call, lam, Lam)
    else:
        adjoint_step_at(adjoint_step)(call, lam, Lam, work)


@helper
def _smooth_row(P: Array, estimated: Ints, lam: Array, Lam: Array, work: Array, row: Array) -> None:
    """A row of the output from the filter's to the smoothed one."""
    k, n = lam.size, P.shape[0]
    error = work[work.size - n :]
    if k < n:
        for i in range(n):
            error[i] = 0.0
    if k == 15:  # the same code with constant lengths
        _smooth_state(15, P, estimated, lam, Lam, work, error, row)
    elif k == 6:
        _smooth_state(6, P, estimated, lam, Lam, work, error, row)
    else:
        _smooth_state(k, P, estimated, lam, Lam, work, error, row)
    _compose(error, row)


@inline
def _smooth_state(
    k: int, P: Array, estimated: Ints, lam: Array, Lam: Array, work: Array, error: Array, row: Array
) -> None:
    """error (n,) = - P lam in the estimated states; the standard deviations of P - P Lam P into the
    row of the output.

    The workspace gets P in the estimated states, rows of k, then Lam P and three more rows of
    `_lanes`.
    """
    lanes, product = _lanes(k), k * _lanes(k)
    diagonal, change = 2 * product, 2 * product + lanes
    _gather_covariance(k, P, estimated, work)
    _product(k, Lam, 0, k, product, work)
    _products_of_columns(k, lam, work)
    for j in range(lanes):
        work[diagonal + j] = math.sqrt(max(work[(k + 1) * j] + work[diagonal + j], 0.0))
    if k == 15 and error.size == 15:
        for i in range(15):
            error[i], row[STD + i] = work[change + i], work[diagonal + i]
    else:
        for i in range(k):
            state = estimated[i]
            error[state] = work[change + i]
            row[STD + state if state < 15 else row.size - error.size + state] = work[diagonal + i]


@inline
def _gather_covariance(k: int, P: Array, estimated: Ints, work: Array) -> None:
    """P in the estimated states, rows of k, into the workspace."""
    if k == P.shape[0]:
        numbers = flatten(P)
        for i in range(k * k):
            work[i] = numbers[i]
    else:
        for i in range(k):
            for j in range(k):
                work[k * i + j] = P[estimated[i], estimated[j]]


@inline
def _products_of_columns(k: int, lam: Array, work: Array) -> None:
    """Behind P and Lam P in the workspace, each of `_lanes`: the diagonal of - P Lam P, and
    - P lam."""
    lanes, product = _lanes(k), k * _lanes(k)
    diagonal, change = 2 * product, 2 * product + lanes
    for j in range(2 * lanes):
        work[diagonal + j] = 0.0
    for m in range(0, k - k % 3, 3):  # three at a time, because each waits for the one before
        p, q, l0, l1, l2 = k * m, product + lanes * m, lam[m], lam[m + 1], lam[m + 2]
        for j in range(lanes):
            p0, p1, p2 = work[p + j], work[p + k + j], work[p + 2 * k + j]
            work[diagonal + j] -= (
                p0 * work[q + j] + p1 * work[q + lanes + j] + p2 * work[q + 2 * lanes + j]
            )
            work[change + j] -= l0 * p0 + l1 * p1 + l2 * p2
    for m in range(k - k % 3, k):
        for j in range(lanes):
            work[diagonal + j] -= work[k * m + j] * work[product + lanes * m + j]
            work[change + j] -= lam[m] * work[k * m + j]


@inline
def _lanes(k: int) -> int:
    """Lanes that a row of k numbers is worked on with: beyond k they reach into the next row,
    which does no harm."""
    return 16 if k == 15 else (8 if k == 6 else k)


@inline
def _product(k: int, A: Array, source: int, stride: int, target: int, work: Array) -> None:
    """A times the matrix at `source` with rows of `stride`, row by row; for 15 and 6 states
    written out, because then the compiler makes vector code."""
    lanes, s = _lanes(k), stride
    for i in range(k):
        row = target + i * lanes
        if k == 15:
            a0, a1, a2, a3, a4, a5, a6, a7 = (
                A[i, 0],
                A[i, 1],
                A[i, 2],
                A[i, 3],
                A[i, 4],
                A[i, 5],
                A[i, 6],
                A[i, 7],
            )
            a8, a9, b0, b1, b2, b3, b4 = (
                A[i, 8],
                A[i, 9],
                A[i, 10],
                A[i, 11],
                A[i, 12],
                A[i, 13],
                A[i, 14],
            )
            for lane in range(16):
                j = source + lane
                work[row + lane] = (
                    (a0 * work[j] + a1 * work[s + j] + a2 * work[2 * s + j])
                    + (a3 * work[3 * s + j] + a4 * work[4 * s + j] + a5 * work[5 * s + j])
                    + (a6 * work[6 * s + j] + a7 * work[7 * s + j] + a8 * work[8 * s + j])
                    + (a9 * work[9 * s + j] + b0 * work[10 * s + j] + b1 * work[11 * s + j])
                    + (b2 * work[12 * s + j] + b3 * work[13 * s + j] + b4 * work[14 * s + j])
                )
        elif k == 6:
            a0, a1, a2, a3, a4, a5 = A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5]
            for lane in range(8):
                j = source + lane
                work[row + lane] = (a0 * work[j] + a1 * work[s + j] + a2 * work[2 * s + j]) + (
                    a3 * work[3 * s + j] + a4 * work[4 * s + j] + a5 * work[5 * s + j]
                )
        else:
            for j in range(k):
                work[row + j] = 0.0
            for m in range(k):
                for j in range(k):
                    work[row + j] += A[i, m] * work[source + s * m + j]


@helper
def _write_covariance(P: Array, estimated: Ints, k: int, work: Array, out: Array) -> None:
    """P - P Lam P from what `_smooth_state` left, in the estimated states; the others are the
    filter's."""
    n, lanes, product = P.shape[0], _lanes(k), k * _lanes(k)
    if k == 15 and n == 15:  # the same code with constant lengths
        _product(15, P, 240, 16, 512, work)
        for i in range(15):
            for j in range(i, 15):
                out[i, j] = out[j, i] = P[i, j] - work[512 + 16 * i + j]
        return
    for i in range(n):
        for j in range(n):
            out[i, j] = P[i, j]
    for i in range(k):
        for j in range(i, k):
            total = work[k * i + j]
            for m in range(k):
                total -= work[k * m + i] * work[product + lanes * m + j]
            out[estimated[i], estimated[j]] = out[estimated[j], estimated[i]] = total


@helper
def _compose(error: Array, row: Array) -> None:
    """Compose the error (n,) into a row of the output."""
    tail = error.size - 15
    own = row.size - 2 * tail
    displace(row[LLA:V], error[0], error[1], error[2])
    turn_quaternion(error[6], error[7], error[8], row[Q:BIASES])
    for i in range(3):
        row[V + i] += error[3 + i]
    for i in range(6):
        row[BIASES + i] += error[9 + i]
    for i in range(tail):
        row[own + i] += error[15 + i]
