"""Absolute times from times of day or of week, with the dates that some records have."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ....typing import Array, Ints
from ....units.time_scales import rollover_count

DAY_MS = 86_400_000
WEEK_MS = 604_800_000


class CyclicClock(NamedTuple):
    """The absolute times that records of a file give."""

    place: Ints  # in the file (m,)
    moment: Ints  # ms since the zero of an absolute clock, or of the first day or week (m,)
    period: int  # ms, of the times in the other records
    absolute: bool
    time: dict[str, Any]  # as a description has it

    @property
    def column(self) -> str:
        """The name of the column of times in a table."""
        return str(self.time["column"])

    def ms(self, place: Ints, t: Ints) -> Ints:
        """Return the absolute times (n,) of times of day or of week at places in the file."""
        return moments(place, t.astype(int), self.place, self.moment, self.period)


def clock_of(
    dated: Iterable[tuple[Ints, Ints]],
    timed: Iterable[tuple[Ints, Ints]],
    period: int,
    absolute: dict[str, Any],
    own: dict[str, Any],
) -> CyclicClock:
    """Return the CyclicClock of records with a date, each (place, moment), or without any of
    records with a time, (place, t). `absolute` and `own` are the key `time` of a description in
    these two cases."""
    none = np.zeros(0, int)
    place, moment = (np.concatenate([none, *each]) for each in zip((none, none), *dated))
    is_absolute = len(place) > 0
    if not is_absolute:
        place, t = (np.concatenate([none, *each]) for each in zip((none, none), *timed))
        place, moment = undated_times(place, t, period)
    if not len(place):
        place = moment = np.zeros(1, int)
    order = np.argsort(place, kind="stable")
    return CyclicClock(
        place[order], moment[order], period, is_absolute, absolute if is_absolute else own
    )


def moments(place: Ints, t: Ints, dated: Ints, moment: Ints, period: int) -> Ints:
    """Return absolute times (n,), ms, of times t (n,) of a day or week at `place` (n,) in the file.
    The day or week is chosen so that each is nearest to the `moment` (m,) of the nearest record
    with a date, at `dated` (m,) in the file."""
    after = np.clip(np.searchsorted(dated, place), 0, len(dated) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(place - dated[before]) <= np.abs(dated[after] - place)
    near = moment[np.where(closer, before, after)]
    # integers, because ms since 1970 times the sum of two exceed the precision of a float
    return t + period * ((near - t + period // 2) // period)


def undated_times(place: Ints, t: Ints, period: int) -> tuple[Ints, Ints]:
    """(place, moment) of records without a date, in file order, counted from the first day or
    week."""
    order = np.argsort(place, kind="stable")
    turns = rollover_count(t[order].astype(float), period).astype(int)
    return place[order], t[order] + period * turns


def in_order(t: Ints) -> tuple[Ints, int, int]:
    """(rows in time order, each time once; number of rows out of order; number that repeat a
    time)."""
    order = np.argsort(t, kind="stable")
    first = np.diff(t[order], prepend=t[order][:1] - 1) > 0
    return order[first], int(np.count_nonzero(np.diff(t) < 0)), int(np.count_nonzero(~first))


def same_time(t: Ints, there: Ints, values: Array) -> Array:
    """Return the values (m,) at times `there` (m,) that belong to the times t (n,); NaN without
    one."""
    if not len(there):
        return np.full(len(t), np.nan)
    order = np.argsort(there, kind="stable")
    at = np.minimum(np.searchsorted(there[order], t), len(there) - 1)
    return np.where(there[order][at] == t, values[order][at], np.nan)
