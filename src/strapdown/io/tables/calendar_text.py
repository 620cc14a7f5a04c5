"""Dates and times of day in tables, as text or as digits such as NMEA's hhmmss.ss: ISO 8601, or a
pattern of strptime directives. All rows are parsed together, character by character.
"""

import re
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...preprocessing.origin import Origin
from ...typing import Array, Ints, Mask
from ...units.time_scales import days_of

ISO = "iso"
ISO_DATE, ISO_TIME = "%Y-%m-%d", "%H:%M:%S%z"
DIGITS = {"Y": 4, "y": 2, "m": 2, "d": 2, "j": 3, "H": 2, "I": 2, "M": 2, "S": 2}
"""Numeric directives with their largest number of digits; %S takes a fraction too."""
WORDS = "bpz"
"""Directives with letters: English name of the month, AM or PM, zone (`Z`, `+02:00`)."""
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
WIDEST = 48
"""Largest number of characters of a time; in a longer cell the rest is an error in any case."""
FINEST = 12
"""Largest number of digits of a fraction."""


class Moments(NamedTuple):
    """Calendar times (n,); NaN where the cell is empty. They have two parts because leap seconds
    have the number 60, and because whole numbers are exact."""

    minute: Array  # its beginning, s since 1970-01-01 without leap seconds, or since midnight
    second: Array  # of the minute, 0 to 61


class Pattern(NamedTuple):
    """Format of a cell: directives such as "%Y", and the characters between them."""

    tokens: tuple[str, ...]
    # as in ISO 8601, dashes and colons may be missing and T may replace the blank
    loose: bool

    @property
    def dated(self) -> bool:
        """True where the pattern has a day."""
        return any(token in self.tokens for token in ("%d", "%j"))


def patterns(format: str, date: str = "") -> tuple[Pattern | None, Pattern]:
    """Return (Pattern of the column of dates, Pattern of the times) for a `format` of a
    description.

    date: "column" where a separate column has the dates, whose pattern is then the first part of
    the format; "day" where one day is given; "". Raises ValueError.
    """
    loose = format == ISO
    if date != "column":
        return None, _pattern(
            (ISO_TIME if date else f"{ISO_DATE} {ISO_TIME}") if loose else format, loose
        )
    text = f"{ISO_DATE} {ISO_TIME}" if loose else format
    if text.count(" ") != 1:
        raise ValueError(
            f'{format!r} must be the format of the date, one blank, and that of the time, such as "%d.%m.%Y '
            f'%H:%M:%S"'
        )
    days, times = (_pattern(part, loose) for part in text.split(" "))
    return days, times


def _pattern(text: str, loose: bool) -> Pattern:
    # %f is the fraction, which %S takes in any case
    tokens = tuple(re.findall(r"%.|.", re.sub(r"[.,]?%f", "", text), re.DOTALL))
    for token in tokens:
        if token[0] == "%" and token[1:] not in (*DIGITS, *WORDS, "%"):
            known = " ".join(f"%{each}" for each in (*DIGITS, *WORDS))
            raise ValueError(f'{token!r} is not one of {known}; or write "iso" for ISO 8601')
    if not any(token in tokens for token in ("%H", "%I", "%d", "%j")):
        raise ValueError(f'{text!r} has neither a day nor an hour; write it as "%d.%m.%Y %H:%M:%S"')
    for token in tokens:
        if token[0] == "%" and token != "%%" and tokens.count(token) > 1:
            raise ValueError(f"{text!r} has {token!r} more than once")
    return Pattern(tokens, loose)


def moments(cells: np.ndarray[Any, Any], pattern: Pattern) -> tuple[Moments, Mask]:
    """(Moments of the cells of a column (n,), text or numbers; mask of cells that are not times).

    Without a day in the pattern they count from midnight; without a time they are midnights.
    """
    characters, fraction, empty = _characters(cells, pattern)
    row = _Rows(characters, pattern.loose)
    for before, token, after in zip(
        ("", *pattern.tokens), pattern.tokens, (*pattern.tokens[1:], "")
    ):
        row.take(token, before[1:] in DIGITS or after[1:] in DIGITS)
    row.end()
    value = row.value
    zero, wrong = np.zeros(len(cells)), ~row.fine
    hour = value.get("H", zero)
    if "I" in value:
        wrong |= (value["I"] < 1) | (value["I"] > 12)
        hour = value["I"] % 12 + 12 * value.get("p", zero)
    minute, second = value.get("M", zero), value.get("S", zero) + fraction
    wrong |= (hour > 23) | (minute > 59) | (second >= 61) | ((fraction > 0) & ("S" not in value))
    days, no_day = _days(value, len(cells))
    start = 86400.0 * days + 3600 * hour + 60 * minute - value.get("z", zero)
    start, second = np.where(empty, np.nan, start), np.where(empty, np.nan, second)
    return Moments(start, second), (wrong | no_day) & ~empty


def _days(value: dict[str, Array], n: int) -> tuple[Array, Mask]:
    """(Days since 1970-01-01, 0 without a day; mask of impossible days)."""
    if "d" not in value and "j" not in value:
        return np.zeros(n), np.zeros(n, bool)
    year = value.get("Y", np.full(n, 1970.0))
    if "y" in value:  # as in strptime, 69 to 99 belong to the last century
        year = value["y"] + np.where(value["y"] < 69, 2000, 1900)
    one = np.ones(n)
    if "j" in value:
        days = days_of(year, one, one) + value["j"] - 1
        wrong = (value["j"] < 1) | (days >= days_of(year + 1, one, one))
    else:
        days = days_of(year, value.get("m", value.get("b", one)), value["d"])
        wrong = np.isnan(days)
    return np.where(wrong, 0.0, days), wrong


def _characters(
    cells: np.ndarray[Any, Any], pattern: Pattern
) -> tuple[np.ndarray[Any, np.dtype[np.uint8]], Array, Mask]:
    """(Characters (n, w), fractions of seconds that are not among them, mask of empty cells).

    Numbers, which have lost their leading zeros, get the number of digits in the pattern.
    """
    if cells.dtype.kind in "iuf":
        empty = np.isnan(cells)
        width = sum(DIGITS.get(token[1:], 0) for token in pattern.tokens if token[0] == "%")
        numbers = np.where(np.isfinite(cells.astype(float)), cells, -1)
        whole = np.floor(numbers)
        fits = (whole >= 0) & (whole < 10.0**width)
        digits = np.where(fits, whole, 0).astype(np.int64)[:, None] // 10 ** np.arange(width)[::-1]
        found = np.where(fits[:, None], digits % 10 + ord("0"), ord("?")).astype(np.uint8)
        return found, numbers - whole, empty
    import pandas as pd

    empty = np.asarray(pd.isna(cells))
    given = np.where(empty, "", cells)
    try:
        text = np.array(given, dtype=f"S{WIDEST}")
    except UnicodeEncodeError:  # a time has only ASCII characters
        wide = np.array(given, dtype=f"U{WIDEST}").view(np.uint32).reshape(len(cells), WIDEST)
        text = np.where(wide < 128, wide, ord("?")).astype(np.uint8).view(f"S{WIDEST}").ravel()
    found = text.view(np.uint8).reshape(len(cells), WIDEST)
    return found, np.zeros(len(cells)), empty | (np.char.strip(text) == b"")


class _Rows:
    """A position in each of n texts, which advances as their parts are taken."""

    def __init__(self, characters: np.ndarray[Any, np.dtype[np.uint8]], loose: bool) -> None:
        n, width = characters.shape
        self._width, self._loose = width + 1, loose
        # a column of zeros ends every text
        self._flat = np.pad(characters, ((0, 0), (0, 1))).ravel()
        self._at = np.arange(n, dtype=np.int64) * self._width
        self._last = self._at + width
        self.fine = np.ones(n, bool)
        self.value: dict[str, Array] = {}
        self._skip(" ")

    @property
    def _here(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        return self._flat[self._at]

    def _move(self, steps: Mask) -> None:
        self._at = np.minimum(self._at + steps, self._last)

    def _skip(self, these: str) -> Mask:
        """Skip one character of `these`, or all blanks, where present."""
        wanted = np.zeros(256, bool)
        wanted[list(these.encode())] = True
        there = wanted[self._here]
        self._move(there)
        while these == " " and (more := self._here == ord(" ")).any():
            self._move(more)
        return there

    def take(self, token: str, tight: bool) -> None:
        """Take a token of a pattern; `tight`: digits follow it without a separator."""
        if token[0] != "%" or token == "%%":
            there = self._skip("T t_" if self._loose and token == " " else token[-1])
            if not (self._loose and token in "-:") and token != " ":
                self.fine &= there
            elif token == " ":
                self._skip(" ")
        elif token[1] in DIGITS:
            most = DIGITS[token[1]]
            value, count = self._digits(most)
            self.fine &= count >= (most if tight or self._loose or token[1] in "Yy" else 1)
            self.value[token[1]] = value + (self._fraction() if token == "%S" else 0.0)
        else:
            self.value[token[1]] = {"b": self._month, "p": self._half, "z": self._zone}[token[1]]()

    def end(self) -> None:
        """Check that only blanks are left."""
        self._skip(" ")
        self.fine &= self._here == 0

    def _digits(self, most: int, of: Mask | None = None) -> tuple[Array, Ints]:
        """(Number in the next digits, count of digits, at most `most`) in the rows `of`."""
        value, count = np.zeros(len(self._at)), np.zeros(len(self._at), np.int64)
        more = np.ones(len(self._at), bool) if of is None else of.copy()
        for _ in range(most):
            digit = self._here - np.uint8(ord("0"))  # other characters wrap around to 10 and more
            more &= digit < 10
            if not more.any():
                break
            value = np.where(more, 10 * value + digit, value)
            count += more
            self._move(more)
        return value, count

    def _fraction(self) -> Array:
        value, count = self._digits(FINEST, self._skip(".,"))
        return value / 10.0**count

    def _letters(self, many: int) -> list[Any]:
        """Return the next `many` letters in lower case, each (n,)."""
        found = []
        for _ in range(many):
            found.append(self._here | np.uint8(32))
            self._move(self._here != 0)
        return found

    def _month(self) -> Array:
        letters, month = self._letters(3), np.zeros(len(self._at))
        for number, name in enumerate(MONTHS, 1):
            same = [letter == mark for letter, mark in zip(letters, name.encode())]
            month[np.logical_and.reduce(same)] = number
        return month

    def _half(self) -> Array:
        half, m = self._letters(2)
        self.fine &= np.isin(half, list(b"ap")) & (m == ord("m"))
        return (half == ord("p")).astype(float)

    def _zone(self) -> Array:
        """Seconds by which the zone is ahead of UTC; 0 without a zone."""
        self._skip(" ")
        self._skip("Zz")
        for letter in "UTC":
            self._skip(letter)
        sign = np.where(self._here == ord("-"), -1.0, 1.0)
        signed = self._skip("+-")
        hours, count = self._digits(2, signed)
        self._skip(":")
        minutes, _ = self._digits(2, signed)
        self.fine &= (signed == (count == 2)) & (hours < 24) & (minutes < 60)
        return sign * (3600 * hours + 60 * minutes)


def read_moments(column: str | int, cells: Any, pattern: Pattern, origin: Origin) -> Moments:
    """Return the Moments of the cells of a column of the table of `origin`. Raises DataError that
    names the first cell that is not a time."""
    found, wrong = moments(cells, pattern)
    if wrong.any():
        first = int(np.argmax(wrong))
        written = ISO if pattern.loose else "".join(pattern.tokens)
        raise DataError(
            f"{origin.row(first)}, column {column!r}: {str(cells[first])[:40]!r} is not a time of the "
            f"format {written!r}; correct the cell, leave it empty, or give another `format`"
        )
    return found
