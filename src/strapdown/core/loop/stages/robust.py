"""Fixes of robust and of adaptive sources: the filter is asked first what it makes of one, then given
it with the standard deviations that this tells.

A robust source has a likelihood with heavy tails in place of the gate: the noise of a fix is N(0, R)
with the probability 1 - OUTLIERS, else N(0, 4^k R), k = 1 to SCALES, with weights that halve from
one to the next. Its density falls off as one over the error squared, while right fixes keep the
normal one. Given the innovation e, the variances have the probabilities p_k, and the filter is to be
corrected as the mean over them says. One factor on R does that along e:

    e' S(factor)^-1 e = sum p_k e' S(4^k)^-1 e,    S(f) = H P H' + f R.

In one dimension the corrected mean is that of the mixture, and the variance lacks what the means of
its terms differ by. The influence of a fix goes back to nothing as its error grows. Source: West
(1987), Biometrika 74(3), scale mixtures of normals; Sorenson & Alspach (1971), Automatica 7(4).
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.innovation_moments import moments, solve_innovation, zero_if_missing
from ..cursor import Cursor
from ..kernels import STAGE, Kernels, correct_at, observe_at
from ..tables import Fixes
from .adaptive import follow

OUTLIERS = 0.05
"""Probability of a larger variance. docs/how-to/robust.md has what others cost and gain."""
SCALES, STEP = 10, 4.0
"""Larger variances, and how many times the one before each is: up to a million times the stated."""
HALVINGS = 40  # of the interval of the logarithm of the factor


@helper
def suspicious(innovation: Array, nis: float) -> bool:
    """True where the NIS is above the 95 % limit, so that an outlier test is worth its time."""
    rows = 0
    for i in range(3):
        rows += not math.isnan(innovation[i])
    return nis > 2 + 2 * rows


@kernel(STAGE)
def weigh(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Correct by measurement k of a robust or adaptive source, of which the filter, asked first, has
    said work.innovation and work.nis.

    Leaves its weight in the work: the stated variance over that which was used, 0 where it was not
    used.
    """
    source, work = fixes.sources[fixes.source[k]], cursor.work[0]
    source.kept = 1.0  # what faded since the measurement before has faded once
    seen, factor = False, 1.0
    if source.memory > 0 or source.robust > 0 and suspicious(work.innovation, work.nis):
        seen = _moments(kernels, belief, fixes, k, cursor)
        if seen and source.robust > 0 and suspicious(work.innovation, work.nis):
            factor = variance_factor(work.covariance, work.noise, work.innovation)
        if source.memory > 0 and seen:
            books, S, R = cursor.books[fixes.source[k]], work.covariance, work.noise
            follow(books, source.memory, fixes.t[k], work.innovation, S, R, factor)
        robust = source.robust > 0 and seen
    else:
        robust = source.robust > 0
    if work.nis > source.gate and not robust:
        work.weight = 0.0
    else:
        for i in range(3):
            work.widened[i] = math.sqrt(factor) * work.stds[i]
        _hand_over(kernels, belief, fixes, k, cursor, math.inf)
        work.weight = 1 / factor
    return 0


@helper
def _moments(kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor) -> bool:
    """S and R of measurement k into the work, by asking the filter with twice the standard
    deviations; False where it has none."""
    work = cursor.work[0]
    for i in range(3):
        work.widened[i] = 2 * work.stds[i]
    _hand_over(kernels, belief, fixes, k, cursor, -1.0)
    return moments(work.innovation, work.other, work.covariance, work.noise)


@helper
def _hand_over(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, gate: float
) -> None:
    """`correct` by measurement k with the standard deviations work.widened; its innovation goes into
    work.other."""
    source, work = fixes.sources[fixes.source[k]], cursor.work[0]
    for i in range(12):
        work.other[i] = math.nan
    observe = observe_at(kernels.observers[source.kind])
    correct_at(kernels.correct)(
        belief, fixes.y[k], work.widened, source.kind, observe, source, gate, work.other
    )


@helper
def variance_factor(S: Array, R: Array, innovation: Array) -> float:
    """The factor on R (6 numbers, as S = H P H' + R) with which a fix counts as the mixture says."""
    e0, e1, e2 = (
        zero_if_missing(innovation[0]),
        zero_if_missing(innovation[1]),
        zero_if_missing(innovation[2]),
    )
    best, total, mean, factor, share = -math.inf, 0.0, 0.0, 1.0, 1 - OUTLIERS
    for k in range(SCALES + 1):
        _, _, _, nis, size = solve_innovation(S, R, factor, e0, e1, e2)
        if math.isnan(nis):
            return 1.0
        likely = math.log(share) - 0.5 * (nis + size)
        if likely > best:
            total, mean, best = (
                total * math.exp(best - likely),
                mean * math.exp(best - likely),
                likely,
            )
        weight = math.exp(likely - best)
        total, mean = total + weight, mean + weight * nis
        share = (0.5 * share if k > 0 else OUTLIERS * 0.5) if k < SCALES - 1 else share
        factor *= STEP
    low, high = 0.0, SCALES * math.log(STEP)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if solve_innovation(S, R, math.exp(middle), e0, e1, e2)[3] > mean / total:
            low = middle
        else:
            high = middle
    return math.exp(low)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source is robust or adaptive."""
    return bool(np.any((sources["robust"] > 0) | (sources["memory"] > 0)))
