"""Fixed-interval smoothing in the form of Bryson and Frazier: backwards over what each call of a filter left on the tape, without inverting a covariance.

Between the calls stand lam and Lam: what all later measurements say about the error of the belief there is - P lam, with covariance P - P Lam P. A call
of predict or correct acts on them by its adjoint, which the filter brings along. Calls that only add to P need none.
Source: Bryson & Frazier (1963), modified as in Bierman (1973), Automatica 9; Gibbs (2011), Advanced Kalman Filtering, section 6.2.
"""
from .compiling import caller, helper, kernel
from .contract import BACK, RUN_BACK

back_at = caller(BACK)


@kernel(RUN_BACK)
def run_back(back, tape, mark, P, estimated, lam, Lam, work, error, covariance):
    """From the last call on `tape` to the first. For each row, where `mark` calls were done and the filter had P (rows, n, n): the error (rows, k) and
    covariance (rows, k, k) of the `estimated` states given all that came later. lam (k,) and Lam (k, k) begin with what is known of later tapes and
    end with what earlier ones need; work has k (k + 2) numbers.
    """
    call = tape.shape[0] - 1
    for row in range(mark.size - 1, -1, -1):
        while call >= mark[row]:
            back_at(back)(tape[call], lam, Lam, work)
            call -= 1
        _smoothed(P[row], estimated, lam, Lam, work, error[row], covariance[row])
    while call >= 0:
        back_at(back)(tape[call], lam, Lam, work)
        call -= 1


@helper
def _smoothed(P, estimated, lam, Lam, product, error, covariance):
    """error = - P lam, covariance = P - P Lam P, of the estimated states."""
    k = lam.size
    for i in range(k):
        error[i] = 0.0
        for j in range(k):
            p = P[estimated[i], estimated[j]]
            error[i] -= p * lam[j]
            covariance[i, j] = p
    for i in range(k):
        for j in range(k):
            total = 0.0
            for m in range(k):
                total += Lam[i, m] * covariance[m, j]
            product[k * i + j] = total
    for i in range(k):
        for j in range(k):
            total = 0.0
            for m in range(k):
                total += P[estimated[i], estimated[m]] * product[k * m + j]
            covariance[i, j] -= total
