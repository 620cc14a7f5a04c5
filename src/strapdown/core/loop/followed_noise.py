"""The noise of an adaptive source, followed by its fixes: a factor on the variance of each row.

After a fix the residual r = R S^-1 e and what the belief then still does not know of the measured,
H P+ H' = R - R S^-1 R, say what the noise was, r r' + H P+ H', R in the mean where that is right. A
factor goes on by the share 1 - exp(-dt / memory) towards what a fix says: the variational filter of
Sarkka & Nummenmaa (2009), IEEE Trans. Automatic Control 54(3), with one step of its iteration, which
starts with a memory full of what is stated.

Errors that last are no noise: a filter that follows them finds small residuals, and would believe
them the more. They show in whitened innovations that are alike from one fix to the next. Where their
correlation is above LASTING, no variance is less than stated.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from ..mathematics.innovation_moments import known, solved
from .cursor import ALIKE, FACTOR, FOLLOWED_AT, POWER, WHITENED_BEFORE

LEAST_FACTOR, MOST_FACTOR = 0.01, 100.0  # of the variance: standard deviations of 0.1 to 10 times
LASTING = 0.3  # correlation of whitened innovations one fix apart
LARGEST_STEP = 0.1  # of the memory, at one fix: ten fixes decide at least
MOST_NIS = 16.0  # which a fix counts with at most: an outlier is no noise
MOST_WHITENED = 3.0  # with which it counts for the correlation


@helper
def followed(sd: Array, tests: Array, floor: Array, own: Array, factor: Array) -> Array:
    """The standard deviations `sd` of a fix by what is known of its source, in `own`, and their
    factors; not below the `floor`."""
    lasting = tests[ALIKE] > LASTING * tests[POWER]
    for i in range(3):
        square = tests[FACTOR][i]
        factor[i] = math.sqrt(max(square, 1.0) if lasting else square)
        own[i] = max(factor[i] * sd[i], floor[i])
    return own


@helper
def follow(
    tests: Array, memory: float, t: float, innovation: Array, S: Array, R: Array, factor: float
) -> None:
    """Take what a fix at `t` s says into the books `tests` of its source; S and R of
    `innovation_moments.moments`, `factor` the one on R with which a robust source uses it."""
    share = 1 - math.exp(-min((t - tests[FOLLOWED_AT]) / memory, LARGEST_STEP))
    tests[FOLLOWED_AT] = t
    e0, e1, e2 = known(innovation[0]), known(innovation[1]), known(innovation[2])
    x0, x1, x2, nis, _ = solved(S, R, factor, e0, e1, e2)
    if math.isnan(nis):
        return
    bounded = min(1.0, MOST_NIS / nis) if nis > 0 else 1.0
    for i in range(3):
        if math.isnan(innovation[i]):
            continue
        x = x0 if i == 0 else (x1 if i == 1 else x2)
        y = solved(S, R, factor, 1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2))[i]
        change = factor * R[i * (i + 3) // 2] * (bounded * x * x - y)
        told = tests[FACTOR][i] * (1 + share * change)
        tests[FACTOR][i] = min(max(told, LEAST_FACTOR), MOST_FACTOR)
    _correlate(tests, innovation, share)


@helper
def _correlate(tests: Array, innovation: Array, share: float) -> None:
    """Mean products of whitened innovations with themselves and with those of the fix before."""
    before, alike, power, rows = tests[WHITENED_BEFORE], 0.0, 0.0, 0
    for i in range(3):
        w = innovation[3 + i]
        if math.isnan(w):
            continue
        w = min(max(w, -MOST_WHITENED), MOST_WHITENED)
        alike, power, rows = alike + w * before[i], power + w * w, rows + 1
        before[i] = w
    if rows > 0:
        tests[ALIKE] += share * (alike / rows - tests[ALIKE])
        tests[POWER] += share * (power / rows - tests[POWER])
