"""Moments of NMEA 0183, whose sentences have the time of the day, by the dates that some have."""

from typing import Any, NamedTuple

import numpy as np

from ....typing import Array, Ints
from .cyclic_times import DAY, moments, undated
from .nmea_sentences import TIME_FIELD, Kind, Sentences


class Clock(NamedTuple):
    """The moments that dates of a file say; without any, days count from the first."""

    place: Ints
    moment: Ints
    absolute: bool

    @property
    def column(self) -> str:
        """Of a table: the name of the times."""
        return "unix_ms" if self.absolute else "day_ms"

    @property
    def time(self) -> dict[str, Any]:
        """As a description has it."""
        clock = {"clock": "unix"} if self.absolute else {}
        return {"column": self.column, "unit": "ms", **clock}

    def ms(self, place: Ints, t: Ints) -> Ints:
        """Moments (n,) of times of day."""
        return moments(place, t, self.place, self.moment, DAY)


def clock_of(sentences: Sentences) -> Clock:
    """The clock of a file."""
    place, moment = dates(sentences.kinds)
    if len(place):
        order = np.argsort(place, kind="stable")
        return Clock(place[order], moment[order], True)
    timed = [
        (each.place, each.time_of_day(TIME_FIELD[name]))
        for name, each in sentences.kinds.items()
        if name in TIME_FIELD
    ]
    if timed:
        place, t = (np.concatenate(each) for each in zip(*timed))
        place, moment = undated(place[t >= 0], t[t >= 0], DAY)
    if not len(place):
        place = moment = np.zeros(1, int)
    return Clock(place, moment, False)


def epochs(sentences: Sentences) -> tuple[Ints, Ints, bool]:
    """(place in the file, ms, whether these are POSIX) of all sentences with a time of day."""
    clock, found = clock_of(sentences), []
    for name, kind in sentences.kinds.items():
        if name in TIME_FIELD:
            t = kind.time_of_day(TIME_FIELD[name])
            found.append((kind.place[t >= 0], clock.ms(kind.place[t >= 0], t[t >= 0])))
    if not found:
        return np.zeros(0, int), np.zeros(0, int), False
    place, ms = (np.concatenate(each) for each in zip(*found))
    order = np.argsort(place)
    place, ms = place[order], ms[order]
    first = np.diff(ms, prepend=-1) != 0
    return place[first], ms[first], clock.absolute


def dates(kinds: dict[str, Kind]) -> tuple[Ints, Ints]:
    """(place (m,), POSIX ms (m,)) of the sentences that say a date: RMC of a fix, else ZDA, else any
    RMC."""
    empty = np.zeros(0, int)
    every = []
    if "RMC" in kinds:
        rmc = kinds["RMC"]
        date = rmc.numbers(9)
        day, month, year = date // 10000, date // 100 % 100, date % 100
        year = np.where(year < 80, 2000 + year, 1900 + year)
        place, moment = _moments(rmc, rmc.time_of_day(1), year, month, day)
        fixed = np.isin(place, [p for p, state in zip(rmc.place, rmc.text(2)) if state == b"A"])
        every += [(place[fixed], moment[fixed]), (place, moment)]
    if "ZDA" in kinds:
        zda = kinds["ZDA"]
        parts = (zda.numbers(4), zda.numbers(3), zda.numbers(2))
        every.insert(1, _moments(zda, zda.time_of_day(1), *parts))
    return next((each for each in every if len(each[0])), (empty, empty))


def _moments(kind: Kind, t: Ints, year: Array, month: Array, day: Array) -> tuple[Ints, Ints]:
    with np.errstate(invalid="ignore"):
        fits = (t >= 0) & (year >= 1980) & (year < 2100) & (month >= 1) & (month <= 12)
        fits &= (day >= 1) & (day <= 31)
    months = (12 * (year[fits] - 1970) + month[fits] - 1).astype(int)
    first = months.astype("datetime64[M]").astype("datetime64[D]")
    days = first + (day[fits] - 1).astype(int)
    real = days.astype("datetime64[M]") == first.astype("datetime64[M]")  # no 31 February
    return kind.place[fits][real], days[real].astype(int) * DAY + t[fits][real]
