"""Verdict of a cell: the issue's rule, and the part that chance explains.

The mean NEES over the runs of a consistent filter is chi-square distributed at each epoch, but the
epochs of a run are correlated, so that now and then even a consistent filter is outside its band
for a quarter of them. Its linear twin tells how often.
"""

from typing import NamedTuple

import numpy as np

from strapdown.evaluation.consistency import band
from strapdown.typing import Array

INSIDE, SURVIVED = 0.90, 0.98
"""Least share of the epochs inside the 95 % band, and of the runs that survive."""
CHANCE = 0.01
"""Share of right filters that are called wrong."""
CONSISTENT, BY_CHANCE, CAUTIOUS, SURE, DIVERGING = (
    "consistent",
    "by chance",
    "too cautious",
    "too sure",
    "diverging",
)
VERDICTS = (CONSISTENT, BY_CHANCE, CAUTIOUS, SURE, DIVERGING)
"""From best to worst."""


class Shares(NamedTuple):
    """Shares of the epochs by the mean NEES over all runs; they add to 1."""

    below: float
    inside: float
    above: float


def shares(nees: Array, states: int) -> Shares:
    """Return the shares of the epochs whose mean NEES over the runs is below, inside and above its
    95 % band; nees: (runs, epochs). Every run counts to the end; NaN and inf count as above."""
    mean = np.where(np.isfinite(nees), nees, np.inf).mean(axis=0)
    low, high = band(states, len(nees))
    below, above = float((mean < low).mean()), float((mean > high).mean())
    return Shares(below, 1.0 - below - above, above)


def chance(inside: float, right: Array) -> float:
    """Return the share of sets of a consistent filter with no more epochs inside than this one."""
    return float((right <= inside + 1e-12).mean())


def verdict(found: Shares, survived: float, p: float) -> str:
    """Return the verdict of a cell; p: of `chance`."""
    if survived < SURVIVED:
        return DIVERGING
    if found.inside >= INSIDE:
        return CONSISTENT
    if p >= CHANCE:
        return BY_CHANCE
    return SURE if found.above >= found.below else CAUTIOUS
