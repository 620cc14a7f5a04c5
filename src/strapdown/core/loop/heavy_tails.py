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

from ...typing import Array, Ints
from ..compile.jit import caller, helper
from ..mathematics.innovation_moments import known, moments, solved
from .contract import CORRECT, KEPT, MEMORY, OBSERVE, ROBUST, Belief, Cursor, Fixes
from .followed_noise import follow

OUTLIERS = 0.05
"""Probability of a larger variance. docs/how-to/robust.md has what others cost and gain."""
SCALES, STEP = 10, 4.0
"""Larger variances, and how many times the one before each is: up to a million times the stated."""
HALVINGS = 40  # of the interval of the logarithm of the factor
OTHER, COVARIANCE, NOISE, WIDENED = slice(33, 45), slice(45, 51), slice(51, 57), slice(57, 60)
"""Of Cursor.work: the innovation by other standard deviations; S and R of a fix, their lower triangles
by rows; standard deviations."""

correct_at, observe_at = caller(CORRECT), caller(OBSERVE)


@helper
def suspicious(innovation: Array, nis: float) -> bool:
    """Whether a fix is further off than 19 in 20 right ones, so that a look at it pays."""
    rows = 0
    for i in range(3):
        rows += not math.isnan(innovation[i])
    return nis > 2 + 2 * rows


@helper
def weigh(
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    k: int,
    sd: Array,
    innovation: Array,
    nis: float,
    cursor: Cursor,
) -> float:
    """Correct by fix `k` of a robust or adaptive source, of which the filter, asked with the
    standard deviations `sd`, has said `innovation` and `nis`.

    Returns its weight: the stated variance over that which was used, 0 where it was not used.
    """
    s, work = fixes.source[k], cursor.work
    own, robust, wide, factor = (
        fixes.parameters[s],
        fixes.parameters[s, ROBUST] > 0,
        work[WIDENED],
        1.0,
    )
    own[KEPT] = 1.0  # what faded since the fix before has faded once
    if own[MEMORY] > 0 or robust and suspicious(innovation, nis):
        for i in range(3):
            wide[i] = 2 * sd[i]
        _hand_over(correct, observers, belief, fixes, k, wide, -1.0, work[OTHER])
        S, R = work[COVARIANCE], work[NOISE]
        seen = moments(innovation, work[OTHER], S, R)
        robust = robust and seen
        if robust and suspicious(innovation, nis):
            factor = variance_factor(S, R, innovation)
        if own[MEMORY] > 0 and seen:
            follow(cursor.tests[s], own[MEMORY], fixes.t[k], innovation, S, R, factor)
    if nis > fixes.gate[s] and not robust:
        return 0.0
    for i in range(3):
        wide[i] = math.sqrt(factor) * sd[i]
    _hand_over(correct, observers, belief, fixes, k, wide, math.inf, work[OTHER])
    return 1 / factor


@helper
def _hand_over(
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    k: int,
    sd: Array,
    gate: float,
    innovation: Array,
) -> None:
    """`correct` by fix `k` with other standard deviations."""
    kind, own = fixes.kind[fixes.source[k]], fixes.parameters[fixes.source[k]]
    for i in range(12):
        innovation[i] = math.nan
    observe = observe_at(observers[kind])
    correct_at(correct)(belief, fixes.y[k], sd, kind, observe, own, gate, innovation)


@helper
def variance_factor(S: Array, R: Array, innovation: Array) -> float:
    """The factor on R (6 numbers, as S = H P H' + R) with which a fix counts as the mixture says."""
    e0, e1, e2 = known(innovation[0]), known(innovation[1]), known(innovation[2])
    best, total, mean, factor, share = -math.inf, 0.0, 0.0, 1.0, 1 - OUTLIERS
    for k in range(SCALES + 1):
        _, _, _, nis, size = solved(S, R, factor, e0, e1, e2)
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
        if solved(S, R, math.exp(middle), e0, e1, e2)[3] > mean / total:
            low = middle
        else:
            high = middle
    return math.exp(low)
