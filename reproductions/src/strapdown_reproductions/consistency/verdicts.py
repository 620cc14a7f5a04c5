"""What a cell is called: the issue's rule, and what chance leaves of it.

The mean NEES over the runs of a right filter is chi-square distributed at each epoch, but the epochs
of a run are alike, so that now and then even a right filter is outside its band for a quarter of
them. How often is known from its linear twin.
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
    """Of the epochs, by the mean NEES over all runs; they add to 1."""

    below: float
    inside: float
    above: float


def shares(nees: Array, states: int) -> Shares:
    """Of NEES (runs, epochs): shares of the epochs whose mean over the runs is below, inside and
    above its 95 % band. Every run counts to the end; what is no number is above."""
    mean = np.where(np.isfinite(nees), nees, np.inf).mean(axis=0)
    low, high = band(states, len(nees))
    below, above = float((mean < low).mean()), float((mean > high).mean())
    return Shares(below, 1.0 - below - above, above)


def chance(inside: float, right: Array) -> float:
    """Share of sets of a right filter that have no more epochs inside than this one."""
    return float((right <= inside + 1e-12).mean())


def verdict(found: Shares, survived: float, p: float) -> str:
    """What a cell is called; p: of `chance`."""
    if survived < SURVIVED:
        return DIVERGING
    if found.inside >= INSIDE:
        return CONSISTENT
    if p >= CHANCE:
        return BY_CHANCE
    return SURE if found.above >= found.below else CAUTIOUS
