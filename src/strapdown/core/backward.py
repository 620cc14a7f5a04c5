"""Fixed-interval smoothing in the form of Bryson and Frazier: backwards over what each call of a filter left on the tape, without inverting a covariance.

Between the calls stand lam and Lam: what all later measurements say about the belief there. With its covariance P, its error is - P lam, with
covariance P - P Lam P. A call of predict or correct acts on them by its adjoint, which the filter brings along; a call that only adds to P needs none.
Source: Bryson & Frazier (1963), modified as in Bierman (1973), Automatica 9; Gibbs (2011), Advanced Kalman Filtering, section 6.2.
"""
import math

from .compiling import caller, helper, kernel, matrix
from .contract import BACK, RUN_BACK
from .earth import displace
from .loop import BIASES, LLA, SD, Q, V
from .rotation import turn_quaternion

back_at = caller(BACK)


@kernel(RUN_BACK)
def run_back(back, tape, mark, P, estimated, lam, Lam, work, nav):
    """From the last call on `tape` to the first. Rows of `nav` (as of the loop) and of P (rows, n, n), the filter's, become the smoothed ones.

    Before each row `mark` calls were done. `estimated` (k,) are the states in lam (k,) and Lam (k, k), which begin with what is known of later tapes
    and end with what earlier ones need. work has 2 k k + n numbers.
    """
    call, error = tape.shape[0] - 1, work[work.size - P.shape[1]:]
    for row in range(mark.size - 1, -1, -1):
        while call >= mark[row]:
            back_at(back)(tape[call], lam, Lam, work)
            call -= 1
        _smoothed(P[row], estimated, lam, Lam, work, error)
        _compose(error, P[row], nav[row])
    while call >= 0:
        back_at(back)(tape[call], lam, Lam, work)
        call -= 1


@helper
def _smoothed(P, estimated, lam, Lam, work, error):
    """error (n,) = - P lam and P <- P - P Lam P, in the estimated states; the other errors are 0."""
    k = lam.size
    p, product = matrix(work, 0, k, k), matrix(work, k * k, k, k)
    for i in range(error.size):
        error[i] = 0.0
    for i in range(k):
        for j in range(k):
            p[i, j] = P[estimated[i], estimated[j]]
            product[i, j] = 0.0
            error[estimated[i]] -= p[i, j] * lam[j]
    for i in range(k):
        for m in range(k):
            for j in range(k):
                product[i, j] += p[i, m] * Lam[m, j]
    for i in range(k):
        for j in range(i, k):
            total = p[i, j]
            for m in range(k):
                total -= product[i, m] * p[j, m]
            P[estimated[i], estimated[j]] = P[estimated[j], estimated[i]] = total


@helper
def _compose(error, P, row):
    """Compose the error (n,) into a row of the output, and put the standard deviations of P in place of the filter's."""
    tail = error.size - 15
    own = row.size - 2 * tail
    displace(row[LLA:V], error[0], error[1], error[2])
    turn_quaternion(error[6], error[7], error[8], row[Q:BIASES])
    for i in range(3):
        row[V + i] += error[3 + i]
    for i in range(6):
        row[BIASES + i] += error[9 + i]
    for i in range(15):
        row[SD + i] = math.sqrt(max(P[i, i], 0.0))
    for i in range(tail):
        row[own + i] += error[15 + i]
        row[own + tail + i] = math.sqrt(max(P[15 + i, 15 + i], 0.0))
