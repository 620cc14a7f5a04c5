"""Moments from times that begin anew each day or week, by the dates that some records have."""

import numpy as np

from ....time_scales import rolled
from ....typing import Ints

DAY, WEEK = 86_400_000, 604_800_000
"""ms"""


def moments(place: Ints, t: Ints, dated: Ints, moment: Ints, period: int) -> Ints:
    """Moments (n,), ms, of times t (n,) of a day or week, at `place` (n,) in the file: of those that
    t can mean the one nearest to the `moment` (m,) of the record nearest in the file, at `dated`
    (m,)."""
    after = np.clip(np.searchsorted(dated, place), 0, len(dated) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(place - dated[before]) <= np.abs(dated[after] - place)
    near = moment[np.where(closer, before, after)]
    # whole numbers, for ms since 1970 times the sum of two are beyond what a float holds
    return t + period * ((near - t + period // 2) // period)


def undated(place: Ints, t: Ints, period: int) -> tuple[Ints, Ints]:
    """(place, moment) of records that say no date, in the order of the file, counted from the first
    day or week."""
    order = np.argsort(place, kind="stable")
    turns = rolled(t[order].astype(float), period).astype(int)
    return place[order], t[order] + period * turns


def in_order(t: Ints) -> tuple[Ints, int, int]:
    """(rows in the order of time, each time once; how many were out of order; how many repeat a
    time)."""
    order = np.argsort(t, kind="stable")
    first = np.diff(t[order], prepend=t[order][:1] - 1) > 0
    return order[first], int(np.count_nonzero(np.diff(t) < 0)), int(np.count_nonzero(~first))
