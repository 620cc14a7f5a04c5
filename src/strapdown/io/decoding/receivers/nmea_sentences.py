"""Sentences of NMEA 0183 among whatever else is in a file.

A sentence is $, talker (2 letters), type (3), fields after commas, * and the exclusive or of all
bytes between $ and * in hexadecimal (NMEA 0183 version 4; gpsd's "NMEA Revealed"). A sentence
without a checksum, or with an incorrect one, is not used. Most sentences have the time of day;
`clock` adds the dates that some of them have.
"""

import re
from typing import NamedTuple

import numpy as np

from ....typing import Array, Ints
from ....units.time_scales import days_of
from .cyclic_times import DAY_MS, CyclicClock, clock_of

TYPES = ("GGA", "GNS", "GLL", "RMC", "VTG", "GST", "ZDA", "HDT", "THS", "GSA")
"""Sentences that are read; all others, such as GSV, are skipped."""
PATTERN = re.compile(
    rb"\$([A-Z]{2})(%s)(,[^$*\r\n]{0,120})(?:\*([0-9A-Fa-f]{2}))?" % "|".join(TYPES).encode()
)
TIME_FIELD = {"GGA": 1, "GNS": 1, "GLL": 5, "RMC": 1, "GST": 1, "ZDA": 1}
"""Field with the time of day, by type; VTG, HDT, THS and GSA have none."""


class SentenceKind(NamedTuple):
    """The sentences of one type, in the order of the file."""

    place: Ints  # of the $ in the file (n,)
    end: Ints  # of the checksum (n,)
    talkers: list[bytes]
    fields: list[list[bytes]]  # the first is empty, so that numbering starts at 1

    def text(self, field: int) -> list[bytes]:
        """Return one field of each sentence; empty for shorter sentences."""
        return [row[field] if field < len(row) else b"" for row in self.fields]

    def numbers(self, field: int) -> Array:
        """Return one field of each sentence as a number (n,); NaN for an empty or other field."""
        return numbers(self.text(field))

    def degrees(self, field: int) -> Array:
        """Return latitude or longitude (n,), deg, from a field ddmm.mm and the next field with its
        hemisphere."""
        value = self.numbers(field)
        whole = np.floor(value / 100)
        minutes = value - 100 * whole
        signs = [
            {b"N": 1.0, b"E": 1.0, b"S": -1.0, b"W": -1.0}.get(each)
            for each in self.text(field + 1)
        ]
        sign = np.array([np.nan if each is None else each for each in signs])
        return np.where(minutes < 60, sign * (whole + minutes / 60), np.nan)

    def time_of_day(self, field: int) -> Ints:
        """ms (n,) of a field hhmmss.ss; -1 where there is none."""
        value = self.numbers(field)
        clock = np.floor(np.where(np.isfinite(value), value, -1))
        hours, minutes, seconds = clock // 10000, clock // 100 % 100, clock % 100
        fits = (clock >= 0) & (hours < 24) & (minutes < 60) & (seconds < 61)
        with np.errstate(invalid="ignore"):
            ms = 1000 * (3600 * hours + 60 * minutes + seconds) + np.round(1000 * (value - clock))
        return np.where(fits, ms, -1).astype(int)

    def rows(self, keep: Ints) -> "SentenceKind":
        """These sentences alone."""
        return SentenceKind(
            self.place[keep],
            self.end[keep],
            [self.talkers[i] for i in keep],
            [self.fields[i] for i in keep],
        )


class Sentences(NamedTuple):
    """The sentences of the TYPES in a file."""

    kinds: dict[str, SentenceKind]
    rejected: int  # sentences of these types that fail their checksum
    bare: int  # and those without one

    @property
    def timed(self) -> tuple[Ints, Ints, Ints]:
        """(place, end, time of day in ms or -1) of the sentences with a time, in file order."""
        none = np.zeros(0, int)
        found = [
            (each.place, each.end, each.time_of_day(TIME_FIELD[name]))
            for name, each in self.kinds.items()
            if name in TIME_FIELD
        ]
        place, end, t = (np.concatenate(each) for each in zip((none, none, none), *found))
        order = np.argsort(place)
        return place[order], end[order], t[order]

    def time_beside(self, kind: SentenceKind) -> Ints:
        """Return a time of day (n,), ms, for sentences without one: that of the nearest sentence in
        the file, the earlier one of two; -1 without any."""
        place, end, t = self.timed
        if not len(place):
            return np.full(len(kind.place), -1)
        after = np.searchsorted(place, kind.place)
        before, after = np.maximum(after - 1, 0), np.minimum(after, len(place) - 1)
        nearer = np.abs(place[after] - kind.end) < np.abs(kind.place - end[before])
        return t[np.where(nearer, after, before)]


def find_sentences(data: bytes) -> Sentences:
    """The sentences in these bytes."""
    found = list(PATTERN.finditer(data))
    whole = [each for each in found if each.group(4) is not None]
    bytes_ = np.frombuffer(data, np.uint8)
    running = np.bitwise_xor.accumulate(bytes_) if whole else bytes_
    start = np.array([each.start() for each in whole], int)
    star = np.array([each.end(3) for each in whole], int)
    told = np.array([int(each.group(4), 16) for each in whole], int)
    right = running[star - 1] ^ running[start] == told if whole else np.zeros(0, bool)
    by_type: dict[str, list[int]] = {}
    for i in np.flatnonzero(right).tolist():
        by_type.setdefault(whole[i].group(2).decode(), []).append(i)
    kinds = {
        name: SentenceKind(
            start[rows],
            star[rows] + 3,
            [whole[i].group(1) for i in rows],
            [whole[i].group(3).split(b",") for i in rows],
        )
        for name, rows in by_type.items()
    }
    return Sentences(kinds, int(np.count_nonzero(~right)), len(found) - len(whole))


def numbers(texts: list[bytes]) -> Array:
    """Return numbers (n,); NaN for an empty text or one that is not a plain number."""
    cells = np.array([each or b"nan" for each in texts], "S32") if texts else np.zeros(0, "S32")
    try:
        values = cells.astype(float)
    except ValueError:
        values = np.array([number(each) for each in texts])
    return np.where(np.isfinite(values), values, np.nan)


def number(text: bytes | str) -> float:
    """Return the number in a text, NaN for any other text."""
    try:
        return float(text)
    except ValueError:
        return np.nan


# ---- moments

UNIX = {"column": "unix_ms", "unit": "ms", "clock": "unix"}
OF_DAY = {"column": "day_ms", "unit": "ms"}
"""The key `time` of a description, with and without dates; without, days count from the first."""


def clock(sentences: Sentences) -> CyclicClock:
    """The clock of a file."""
    dated = dates(sentences.kinds)
    if len(dated[0]):
        return clock_of([dated], [], DAY_MS, UNIX, OF_DAY)
    place, _, t = sentences.timed
    return clock_of([], [(place[t >= 0], t[t >= 0])], DAY_MS, UNIX, OF_DAY)


def epochs(sentences: Sentences) -> tuple[Ints, Ints, bool]:
    """(place in the file, ms, whether these are POSIX) of all sentences with a time of day."""
    found = clock(sentences)
    place, _, t = sentences.timed
    place, ms = place[t >= 0], found.ms(place[t >= 0], t[t >= 0])
    first = np.diff(ms, prepend=-1) != 0
    return place[first], ms[first], bool(len(place)) and found.absolute


def dates(kinds: dict[str, SentenceKind]) -> tuple[Ints, Ints]:
    """(place (m,), POSIX ms (m,)) of the sentences with a date: RMC with a fix, else ZDA, else any
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


def _moments(
    kind: SentenceKind, t: Ints, year: Array, month: Array, day: Array
) -> tuple[Ints, Ints]:
    days = days_of(year, month, day)
    fits = (t >= 0) & (year >= 1980) & (year < 2100) & np.isfinite(days)
    return kind.place[fits], days[fits].astype(int) * DAY_MS + t[fits]
