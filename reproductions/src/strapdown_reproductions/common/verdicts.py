"""Verdicts on claims from numbers with intervals: a cell supports a claim, contradicts it, or
leaves it open, and the shares of cells decide."""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from .pages import DEPENDS, NOT_REPRODUCED, PARTLY, REPRODUCED, UNDECIDED

SIZE = 0.01
"""A difference of RMSE below this part is called none, however well many runs resolve it."""
OPEN, CLOSED, NONE, UNKNOWN = "open", "closed", "none", "unknown"
"""Which filter is better in a cell; NONE: the whole interval is below SIZE."""


class Count(NamedTuple):
    """Cells that support a claim, that contradict it, and all."""

    supports: int
    contradicts: int
    total: int

    def __str__(self) -> str:
        return f"{self.supports} of {self.total} cells for it, {self.contradicts} against, {self.total - self.supports - self.contradicts} open"


BETTER = f"better: the 95 % interval of the ratio of RMSEs over common runs lies beyond 1 by more than {SIZE:.0%}; no difference: all of it is within {SIZE:.0%}"


def decide(yes: bool, no: bool) -> str:
    """The verdict of a rule without shares: reproduced, not reproduced, or neither."""
    return REPRODUCED if yes else NOT_REPRODUCED if no else UNDECIDED


def vote(low: float, high: float, level: float) -> int:
    """Return +1 for an interval above `level`, -1 for one below, 0 for one that contains it."""
    return int(low > level) - int(high < level)


def count_votes(votes: Iterable[int]) -> Count:
    """Count of cells of which each votes for a claim (+1), against it (-1), or not (0)."""
    found = list(votes)
    return Count(found.count(1), found.count(-1), len(found))


def better(row: pd.Series, name: str) -> str:
    """Which filter is better in a row by its ratio `name`, of open by closed."""
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    if high < 1 / (1 + SIZE):
        return OPEN
    if low > 1 + SIZE:
        return CLOSED
    return NONE if low >= 1 / (1 + SIZE) and high <= 1 + SIZE else UNKNOWN


def compare_intervals(first: pd.Series, second: pd.Series, name: str) -> int:
    """+1 where interval `name` of row `first` is above that of `second`, -1 where it is below, 0
    where they overlap."""
    return int(first[f"{name}_low"] > second[f"{name}_high"]) - int(
        first[f"{name}_high"] < second[f"{name}_low"]
    )


def both(*verdicts: str) -> str:
    """Return the verdict of a claim whose parts must all hold: mixed where one part is supported
    and another is not."""
    found = set(verdicts)
    if len(found) <= 1:
        return verdicts[0] if verdicts else UNDECIDED
    if found == {REPRODUCED, DEPENDS}:
        return DEPENDS
    return PARTLY if found & {REPRODUCED, PARTLY, DEPENDS} else NOT_REPRODUCED


def over_readings(*verdicts: str) -> str:
    """Return the verdict over the readings of a point that a paper leaves open.

    Opposite verdicts mean that the reading decides, as does one that depends on a reading itself;
    else the less favourable verdict counts.
    """
    if DEPENDS in verdicts or {REPRODUCED, NOT_REPRODUCED} <= set(verdicts):
        return DEPENDS
    return max(verdicts, key=(REPRODUCED, PARTLY, UNDECIDED, NOT_REPRODUCED).index)


def tally(verdicts: Iterable[str]) -> str:
    """Text: how many there are of each verdict, the most favourable first."""
    found = list(verdicts)
    order = (REPRODUCED, PARTLY, DEPENDS, UNDECIDED, NOT_REPRODUCED)
    return ", ".join(f"{found.count(each)} {each}" for each in order if each in found)


def without_verdicts(text: str) -> str:
    """The text without the sentences that have a verdict, for runs that are too few for any."""
    words = "|".join((REPRODUCED, PARTLY, DEPENDS, UNDECIDED))
    lines = [
        " ".join(
            each
            for each in re.split(r"(?<=[.;:]) ", line)
            if not re.search(rf"\b({words})\b", each, re.IGNORECASE)
        )
        for line in text.splitlines()
    ]
    return "\n".join(filter(None, lines))


def ratios(rows: pd.DataFrame, name: str) -> str:
    """Text: smallest, median and largest ratio of the rows."""
    values = rows[name].to_numpy(float)
    values = values[np.isfinite(values)]
    if not len(values):
        return "no common runs"
    least, middle, most = factors((np.min(values), np.median(values), np.max(values)))
    return f"RMSE of the open loop against the closed one: {least} to {most}, median {middle}"


def factors(values: Sequence[float]) -> list[str]:
    """Texts of ratios: changes in per cent where all are near 1, else factors."""
    small = all(0.5 < value < 1.5 for value in values)
    change = lambda share: f"{share:+.2f} %" if abs(share) < 1 else f"{share:+.3g} %"
    return [change(100 * (value - 1)) if small else f"x{value:.3g}" for value in values]


def interval(row: pd.Series, name: str) -> str:
    """Text of a ratio of a row with its interval."""
    values = [row[f"{name}{end}"] for end in ("", "_low", "_high")]
    if not values[0] > 0:
        return "–"
    middle, low, high = factors(values)
    return f"{middle} ({low} to {high})"
