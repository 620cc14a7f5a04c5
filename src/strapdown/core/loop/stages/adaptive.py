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
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.innovation_moments import solve_innovation, zero_if_missing
from ..cursor import Books, Cursor
from ..kernels import STAGE, Kernels
from ..tables import Fixes

MIN_FACTOR, MAX_FACTOR = 0.01, 100.0  # of the variance: standard deviations of 0.1 to 10 times
LASTING = 0.3  # correlation of whitened innovations one fix apart
MAX_STEP = 0.1  # of the memory, at one fix: ten fixes decide at least
MAX_NIS = 16.0  # which a fix counts with at most: an outlier is no noise
MAX_WHITENED = 3.0  # with which it counts for the correlation


@kernel(STAGE)
def inflate_std(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """The standard deviations of a measurement by what is known of its source, and their factors; not
    below its floor."""
    s, work = fixes.source[k], cursor.work[0]
    if fixes.sources[s].memory > 0:
        apply_factors(work.stds, cursor.books[s], work.factor)
    return 0


@helper
def apply_factors(std: Array, books: Books, factor: Array) -> None:
    """Multiply standard deviations by the factors that the books tell, not below their floor."""
    lasting = books.alike > LASTING * books.power
    for i in range(3):
        square = books.factor[i]
        factor[i] = math.sqrt(max(square, 1.0) if lasting else square)
        std[i] = max(factor[i] * std[i], books.floor[i])


@helper
def follow(
    books: Books, memory: float, t: float, innovation: Array, S: Array, R: Array, factor: float
) -> None:
    """Take what a fix at `t` s says into the books of its source; S and R of
    `innovation_moments.moments`, `factor` the one on R with which a robust source uses it."""
    share = 1 - math.exp(-min((t - books.followed_at) / memory, MAX_STEP))
    books.followed_at = t
    e0, e1, e2 = (
        zero_if_missing(innovation[0]),
        zero_if_missing(innovation[1]),
        zero_if_missing(innovation[2]),
    )
    x0, x1, x2, nis, _ = solve_innovation(S, R, factor, e0, e1, e2)
    if math.isnan(nis):
        return
    bounded = min(1.0, MAX_NIS / nis) if nis > 0 else 1.0
    for i in range(3):
        if math.isnan(innovation[i]):
            continue
        x = x0 if i == 0 else (x1 if i == 1 else x2)
        y = solve_innovation(S, R, factor, 1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2))[i]
        change = factor * R[i * (i + 3) // 2] * (bounded * x * x - y)
        told = books.factor[i] * (1 + share * change)
        books.factor[i] = min(max(told, MIN_FACTOR), MAX_FACTOR)
    _correlate(books, innovation, share)


@helper
def _correlate(books: Books, innovation: Array, share: float) -> None:
    """Mean products of whitened innovations with themselves and with those of the fix before."""
    before, alike, power, rows = books.whitened_before, 0.0, 0.0, 0
    for i in range(3):
        w = innovation[3 + i]
        if math.isnan(w):
            continue
        w = min(max(w, -MAX_WHITENED), MAX_WHITENED)
        alike, power, rows = alike + w * before[i], power + w * w, rows + 1
        before[i] = w
    if rows > 0:
        books.alike += share * (alike / rows - books.alike)
        books.power += share * (power / rows - books.power)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source has adaptive R."""
    return bool(np.any(sources["memory"] > 0))
