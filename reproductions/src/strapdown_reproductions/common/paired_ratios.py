"""Two filters on the same cases: geometric means of the ratios of their errors, with intervals.

Within a block (a seed; windows of a recording that overlap its first one) log ratios are averaged,
over blocks Student's t gives the interval: overlapping windows are not independent. The windows of
neighbouring blocks overlap too, which widens the interval.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import Paired
from strapdown.experiments.outages.summaries import over_blocks
from strapdown.typing import Array, Ints

from .kinds import Votes
from .verdicts import SIZE

MIN_ERROR = 1e-6
"""m and m/s: smaller errors count as this, so that they have a logarithm."""


class PairedRatio(NamedTuple):
    """Geometric mean of the ratio of a measure of two filters with its 95 % interval, in how
    many of `count` outages the first one's is smaller."""

    value: float
    low: float
    high: float
    wins: int
    count: int

    @property
    def side(self) -> int:
        """+1 where the first filter is better by more than SIZE, -1 where it is worse or surely
        not better, 0 where that is open."""
        if self.high < 1 / (1 + SIZE):
            return 1
        return -1 if self.low >= 1 / (1 + SIZE) else 0

    def __str__(self) -> str:
        if not np.isfinite(self.value):
            return "–"
        return (
            f"{self.value:.3g} ({self.low:.3g} to {self.high:.3g})"
            if np.isfinite(self.low)
            else f"{self.value:.3g}"
        )


def by_case(
    scores: pd.DataFrame, keys: str | list[str], measures: Mapping[str, float], filters: str
) -> dict[Any, pd.DataFrame]:
    """{case: table} of rows of scores, cases by the values of `keys` in their order: a row per
    outage under its block, columns by those of the `measures` that there are and by filter, which
    the column `filters` names.

    attrs["widening"] of each: by how much the intervals of its blocks are wider, from the column of
    that name, 1 where there is none.
    """
    own_measures, found = [name for name in measures if name in scores], {}
    for case, own in scores.groupby(keys, sort=False):
        table = own.set_index(["block", "outage", filters])[own_measures].unstack(filters)
        known = own["widening"].dropna() if "widening" in own else ()
        table.attrs["widening"] = float(known.iloc[0]) if len(known) else 1.0
        found[case] = table
    return found


def both_of(
    table: pd.DataFrame, measure: str, first: str, second: str
) -> tuple[Ints, Array, Array]:
    """(block (n,), values of the first filter (n,), of the second) of the outages that both
    have; empty where one is not in the table."""
    if not {(measure, first), (measure, second)} <= set(table.columns):
        return np.empty(0, int), np.empty(0), np.empty(0)
    a, b = (np.maximum(table[measure, name].to_numpy(float), MIN_ERROR) for name in (first, second))
    known = np.isfinite(a) & np.isfinite(b)
    return table.index.get_level_values("block").to_numpy()[known], a[known], b[known]


def ratio(
    table: pd.DataFrame, measure: str, first: str, second: str, probability: float = 0.95
) -> PairedRatio:
    """Ratio of `measure` of filter `first` to that of `second` in the table of a case."""
    block, a, b = both_of(table, measure, first, second)
    found = over_blocks(np.log(a / b), block, table.attrs["widening"], probability)
    return PairedRatio(*map(float, np.exp(found[:3])), int((a < b).sum()), len(a))


def better(
    tables: Mapping[Any, pd.DataFrame], measures: Sequence[str], first: str, *others: str
) -> Votes:
    """Votes of the cells (a case and a measure) for filter `first` being better than every one of
    `others`."""
    return lambda confidence: [
        min(ratio(table, measure, first, other, confidence).side for other in others)
        for table in tables.values()
        for measure in measures
    ]


def difference(table: pd.DataFrame, measure: str, first: str, second: str) -> Paired:
    """Mean over blocks of the difference of a measure of two filters with its interval, as a
    Paired, in the unit of the measure."""
    block, a, b = both_of(table, measure, first, second)
    return over_blocks(a - b, block, table.attrs["widening"])


def change(
    table: pd.DataFrame, measure: str, first: str, second: str, other_first: str, other_second: str
) -> tuple[Ints, Array]:
    """(block (n,), log ratio of `measure` of the first two filters minus that of the other two
    (n,)) of the outages that all have."""
    if not {(measure, name) for name in (first, second, other_first, other_second)} <= set(
        table.columns
    ):
        return np.empty(0, int), np.empty(0)
    a, b, c, d = (
        np.log(np.maximum(table[measure, name].to_numpy(float), MIN_ERROR))
        for name in (first, second, other_first, other_second)
    )
    return table.index.get_level_values("block").to_numpy(), a - b - (c - d)


def stronger(table: pd.DataFrame, one: str, other: str, *filters: str) -> Paired:
    """By how much the `change` between four `filters` is larger in measure `one` than in measure
    `other`: Paired of logarithms."""
    (block, a), (_, b) = (change(table, measure, *filters) for measure in (one, other))
    return over_blocks(a - b, block, table.attrs["widening"])
