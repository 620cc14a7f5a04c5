"""Two filters on the same outages: ratios of their errors with intervals; Table 1 of Alam et al. redrawn, and what the published one says.

A case is one outage of the simulated flight over all seeds, or all windows of a recording. Within a block (a seed; windows of a recording that
overlap its first one) log ratios are averaged, over blocks Student's t gives the interval: overlapping windows are not independent. The windows of
neighbouring blocks overlap too, which widens the interval.
"""
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown.experiments.outages.summaries import over_blocks
from .runs import AXES, EKF, MEASURES, NLO, XKF
from ..common.verdicts import SIZE, Count

PUBLISHED = {
    ("north", EKF): (7.9, 7.5, 6.7, 31.5, 38.2), ("north", NLO): (15.8, 14.9, 23.5, 15.1, 11.3), ("north", XKF): (14.1, 14.9, 23.6, 14.3, 11.2),
    ("east", EKF): (16.6, 10.4, 28.8, 129.1, 18.4), ("east", NLO): (12.4, 9.4, 13.1, 22.2, 12.6), ("east", XKF): (11.4, 9.4, 13.3, 21.4, 11.8),
    ("down", EKF): (1.8, 12.1, 31.8, 50.0, 5.4), ("down", NLO): (25.7, 4.9, 27.6, 18.9, 12.5), ("down", XKF): (24.7, 4.3, 25.6, 18.2, 12.0)}
"""Table 1: RMSE in m of the five outages by axis and filter."""
OUTAGES = 5
LEAST = 1e-6
"""m and m/s: smaller errors count as this, so that they have a logarithm."""
THREE = (EKF, NLO, XKF)


class Ratio(NamedTuple):
    """Geometric mean of the ratio of a measure of two filters with its 95 % interval, in how many of `count` outages the first one's is smaller."""
    value: float
    low: float
    high: float
    wins: int
    count: int

    @property
    def side(self):
        """+1 where the first filter is better by more than SIZE, -1 where it is worse or surely not better, 0 where that is open."""
        if self.high < 1 / (1 + SIZE):
            return 1
        return -1 if self.low >= 1 / (1 + SIZE) else 0

    def __str__(self):
        if not np.isfinite(self.value):
            return "–"
        return f"{self.value:.3g} ({self.low:.3g} to {self.high:.3g})" if np.isfinite(self.low) else f"{self.value:.3g}"


def wide(scores):
    """{case: DataFrame} of the table of scores: a row per outage under its block, columns by measure and filter, cases in their order.

    attrs["widening"] of each: by how much the intervals of its blocks are wider, from the column of that name, 1 where there is none.
    """
    if not len(scores):
        return {}
    measures, found = [name for name in MEASURES if name in scores], {}
    for case, own in scores.groupby("case", sort=False):
        found[case] = own.set_index(["block", "outage", "filter"])[measures].unstack("filter")
        known = own["widening"].dropna() if "widening" in own else ()
        found[case].attrs["widening"] = float(known.iloc[0]) if len(known) else 1.0
    return found


def both_of(table, measure, first, second):
    """(block (n,), values of the first filter (n,), of the second) of the outages that both have; empty where one is not in the table."""
    if not {(measure, first), (measure, second)} <= set(table.columns):
        return np.empty((3, 0))
    a, b = (np.maximum(table[measure, name].to_numpy(float), LEAST) for name in (first, second))
    known = np.isfinite(a) & np.isfinite(b)
    return table.index.get_level_values("block").to_numpy()[known], a[known], b[known]


def ratio(table, measure, first, second, probability=0.95):
    """Ratio of `measure` of filter `first` to that of `second` in the table of a case."""
    block, a, b = both_of(table, measure, first, second)
    found = over_blocks(np.log(a / b), block, table.attrs["widening"], probability)
    return Ratio(*map(float, np.exp(found[:3])), int((a < b).sum()), len(a))


def difference(table, measure, first, second):
    """Mean over blocks of the difference of a measure of two filters with its interval, as a Paired, in the unit of the measure."""
    block, a, b = both_of(table, measure, first, second)
    return over_blocks(a - b, block, table.attrs["widening"])


def change(table, measure, first, second, other_first, other_second):
    """(block (n,), log ratio of `measure` of the first two filters less that of the other two (n,)) of the outages that all have."""
    if not {(measure, name) for name in (first, second, other_first, other_second)} <= set(table.columns):
        return np.empty((2, 0))
    a, b, c, d = (np.log(np.maximum(table[measure, name].to_numpy(float), LEAST)) for name in (first, second, other_first, other_second))
    return table.index.get_level_values("block").to_numpy(), a - b - (c - d)


def stronger(table, one, other, *filters):
    """By how much the `change` between four `filters` is larger in measure `one` than in measure `other`: Paired of logarithms."""
    (block, a), (_, b) = (change(table, measure, *filters) for measure in (one, other))
    return over_blocks(a - b, block, table.attrs["widening"])


def sides(tables, measures, first, second, probability=0.95):
    """Count of the cells (case and measure) in which filter `first` is better than `second`; where it surely is not contradicts."""
    return against(tables, measures, first, [second], probability)


def against(tables, measures, first, others, probability=0.95):
    """Count of the cells in which filter `first` is better than every one of `others`; where it surely is not than one of them contradicts."""
    found = [min(ratio(table, measure, first, other, probability).side for other in others) for table in tables.values() for measure in measures]
    return Count(found.count(1), found.count(-1), len(found))


def any_better(tables, measures, first, others):
    """Count of the same cells for a claim that one of them is enough for: better is decided with Bonferroni's level of so many cells.

    That a filter is better nowhere is told by each cell at 95 %, as elsewhere.
    """
    cells = max(len(tables) * len(measures), 1)
    one = against(tables, measures, first, others)
    return one._replace(supports=against(tables, measures, first, others, 1 - 0.05 / cells).supports)


def redrawn(scores, names=THREE):
    """DataFrame shaped as Table 1: a row per case, for each axis and filter the published RMSE and ours, its mean over runs and standard deviation."""
    rows = []
    for case, own in scores.groupby("case", sort=False):
        row = {"outage": case.removeprefix("outage ")}
        for axis in AXES:
            for name in names:
                values = own.loc[own["filter"] == name, f"{axis}_rmse_m"]
                text = f"{values.mean():.3g} ± {values.std():.2g}" if len(values) else "–"
                published = case.startswith("outage ") and name in THREE
                row[f"{axis}, {name}, m"] = f"{PUBLISHED[axis, name][int(case.split()[1]) - 1]:g} / {text}" if published else text
        rows.append(row)
    return pd.DataFrame(rows)


def published_wins(axis, first=XKF, second=EKF):
    """Text: in how many rows of the published Table 1 the first filter's RMSE is smaller."""
    return f"{sum(a < b for a, b in zip(PUBLISHED[axis, first], PUBLISHED[axis, second]))} of {OUTAGES}"


def listed(tables, measure, first, second):
    """Text: what over what, and the ratio of every case; empty without cases."""
    return f"{first} / {second}: " * bool(tables) + "; ".join(f"{case} {ratio(table, measure, first, second)}" for case, table in tables.items())


def won(tables, measure, first, second):
    """Text: share of the simulated outages in which the first filter's measure is smaller."""
    found = [ratio(table, measure, first, second) for case, table in tables.items() if case.startswith("outage ")]
    count = sum(each.count for each in found)
    return f"{first} smaller in {sum(each.wins for each in found) / count:.0%} of {count} simulated outages" if count else "no simulated outage"
