"""Which rule decides which kind of claim.

That something is so always falls with one counter-example, that it is so mostly does not. So each
kind of claim has a rule of its own, on one of three kinds of evidence: votes of cells at a level of
confidence, the share of single trials (outages, flights) with an interval clustered by seed, or one
number with its interval. Not decidable is left where the intervals are too wide, never because the
rule asks for too much.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from strapdown.evaluation.consistency import proportion

from .claims import ClaimKind, JudgedClaim
from .pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from .verdicts import count_votes, decide

CONFIDENCE = 0.95
SELDOM = 0.05
"""Share of the trials above which something happens sometimes, and below which it does not."""
Votes: TypeAlias = Callable[[float], Sequence[int]]
"""Votes of the cells at a level of confidence: +1 supports, -1 contradicts, 0 is open."""


ALWAYS = ClaimKind(
    "always",
    "reproduced where every cell supports it, not reproduced where one contradicts it at "
    "Bonferroni's level of all cells, else not decidable",
)
NEVER = ClaimKind(
    "never",
    "reproduced where every cell speaks against its happening, not reproduced where it happens in "
    "one at Bonferroni's level of all cells, else not decidable",
)
SOMETIMES = ClaimKind(
    "sometimes",
    f"reproduced where it is so in more than {SELDOM:.0%} of the single trials, not reproduced "
    "where in fewer (95 % interval, clustered by seed), else not decidable",
)
ONE_OR_THE_OTHER = ClaimKind(
    "sometimes one, sometimes the other",
    f"reproduced where each is so in more than {SELDOM:.0%} of the single trials, not reproduced "
    "where one is in fewer (95 % interval, clustered by seed), else not decidable",
)
MOSTLY = ClaimKind(
    "mostly",
    "reproduced where more than half of the cells (or of the single trials, 95 % interval) support "
    "it, not reproduced once one half is out of reach, else not decidable",
)
OVERALL = ClaimKind(
    "overall",
    "over the cells of all measures: reproduced where more than half of them support it, not "
    "reproduced once one half is out of reach, else not decidable",
)
MORE_THAN = ClaimKind(
    "more than",
    "reproduced where the 95 % interval lies above the bound, not reproduced where it lies below, "
    "else not decidable",
)
EXPLANATION = ClaimKind(
    "explanation",
    "reproduced where the effect goes with what is to cause it, and without it does not come; not "
    "reproduced where it comes without; else not decidable",
)
KINDS = [each for each in list(globals().values()) if isinstance(each, ClaimKind)]
"""All of them."""


class Share(NamedTuple):
    """Share of single trials with its 95 % interval, clustered by seed."""

    value: float
    low: float
    high: float
    successes: int
    trials: int
    seeds: int

    @property
    def opposite(self) -> "Share":
        """The share of the trials in which the condition does not hold."""
        successes = self.trials - self.successes
        return Share(1 - self.value, 1 - self.high, 1 - self.low, successes, *self[4:])

    def __str__(self) -> str:
        if not self.trials:
            return "no trial"
        return (
            f"{self.successes} of {self.trials} ({self.value:.0%}; {self.low:.0%} to "
            f"{self.high:.0%} over {self.seeds} seeds)"
        )


def cluster_share(seeds: Iterable[tuple[int, int]]) -> Share:
    """Return the Share of [(successes of a seed, its trials)].

    Wilson's interval of as many independent trials as these are worth: their number divided by the
    design effect of the clusters (Korn & Graubard 1998), which is at least 1, and reduced for the
    degrees of freedom of few seeds. Where the share is 0 or 1 a seed counts as one trial, as
    the correlation of its trials is unknown. A single seed gives the interval from 0 to 1.
    """
    from scipy.stats import norm, t

    found = np.array([pair for pair in seeds if pair[1]], float).reshape(-1, 2)
    k, (successes, trials) = len(found), found.sum(axis=0)
    if k < 2:
        value = successes / trials if trials else np.nan
        return Share(float(value), 0.0, 1.0, int(successes), int(trials), k)
    share = successes / trials
    effective = float(k)
    if 0 < share < 1:
        own = share * (1 - share) / trials
        between = k / (k - 1) * ((found[:, 0] - share * found[:, 1]) ** 2).sum() / trials**2
        effective = trials / max(between / own, 1.0)
    level = 0.5 * (1 - CONFIDENCE)
    effective *= float(norm.isf(level) / t.isf(level, k - 1)) ** 2
    ends = proportion(share * effective, effective, CONFIDENCE)
    return Share(float(share), ends.low, ends.high, int(successes), int(trials), k)


def of_all(*parts: Votes) -> Votes:
    """The votes of several together."""
    return lambda confidence: [each for votes in parts for each in votes(confidence)]


def always(votes: Votes) -> JudgedClaim:
    """ALWAYS."""
    count = count_votes(votes(CONFIDENCE))
    certain = count_votes(votes(1 - (1 - CONFIDENCE) / max(count.total, 1)))
    every = 0 < count.total == count.supports
    return JudgedClaim(decide(every, certain.contradicts > 0), str(count))


def never(happens: Votes) -> JudgedClaim:
    """NEVER: `happens` votes for its happening."""
    return always(lambda confidence: [-vote for vote in happens(confidence)])


def sometimes(share: Share) -> JudgedClaim:
    """SOMETIMES."""
    return JudgedClaim(decide(share.low > SELDOM, share.high < SELDOM), str(share))


def one_or_the_other(share: Share) -> JudgedClaim:
    """ONE_OR_THE_OTHER: `share` is that of the one."""
    both = SELDOM < share.low and share.high < 1 - SELDOM
    one = share.high < SELDOM or share.low > 1 - SELDOM
    return JudgedClaim(decide(both, one), str(share))


def mostly(votes: Votes) -> JudgedClaim:
    """MOSTLY and OVERALL, of cells."""
    count = count_votes(votes(CONFIDENCE))
    verdict = UNDECIDED
    if 2 * count.supports > count.total:
        verdict = REPRODUCED
    elif count.total and 2 * count.contradicts >= count.total:
        verdict = NOT_REPRODUCED
    return JudgedClaim(verdict, str(count))


def mostly_of(share: Share) -> JudgedClaim:
    """MOSTLY, of single trials."""
    return JudgedClaim(decide(share.low > 0.5, share.high < 0.5), str(share))


def more_than(low: float, high: float, bound: float, text: str) -> JudgedClaim:
    """MORE_THAN, of an interval; text: what was measured."""
    return JudgedClaim(decide(low > bound, high < bound), text)
