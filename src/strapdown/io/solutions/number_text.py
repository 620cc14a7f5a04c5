"""Rows of numbers as lines of CSV, many rows at a time.

A cell is five words of four characters, `-1 | 2345 | .678 | 9012 | 345,`. Lookup tables hold the
text of each word, with a zero byte for each character that is not written, such as leading and
trailing zeros. All zero bytes are deleted at the end.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from ...typing import Ints, Mask

Bytes: TypeAlias = np.ndarray[Any, np.dtype[np.uint8]]

DECIMALS = 10
"""Decimals: 0.01 mm of latitude, and nine orders of magnitude below the biases of any sensor."""
MAX_EXACT = 10**5
"""Larger numbers are written one by one; below, fifteen digits are exact."""
SMALL = 10**6
"""Limit in units of the last digit, 0.0001, below which Python writes an exponent."""
CHUNK = 1 << 13
"""Number of cells that are formatted together, which fit the processor's cache."""


def _digits(many: int) -> Bytes:
    """Return the characters (10^many, many) of all numbers of `many` digits."""
    powers = 10 ** np.arange(many)[::-1]
    return (np.arange(10**many)[:, None] // powers % 10 + ord("0")).astype(np.uint8)


def _words(*variants: tuple[str, Bytes, str]) -> np.ndarray[Any, np.dtype[np.uint32]]:
    """Return the table of a word: consecutive variants (character before, digits, character
    after)."""
    parts = []
    for before, digits, behind in variants:
        sides = [np.full((len(digits), 1), ord(each)) for each in (before, behind) if each]
        parts.append(np.hstack([*sides[: len(before)], digits, *sides[len(before) :]]))
    return np.ascontiguousarray(np.vstack(parts).astype(np.uint8)).view(np.uint32).ravel()


def _without(zeros: str, digits: Bytes) -> Bytes:
    """Return digits without the zeros "before" the first other digit, or "behind" the last one; the
    digit next to the point stays."""
    zero = digits == ord("0")
    if zeros == "before":
        gone = np.logical_and.accumulate(zero, axis=1)
        gone[:, -1] = False
    else:
        gone = np.logical_and.accumulate(zero[:, ::-1], axis=1)[:, ::-1]
    return np.where(gone, 0, digits).astype(np.uint8)


THREE, FOUR = _digits(3), _digits(4)
FIRST = np.zeros((20, 4), np.uint8)  # sign and ten thousands
FIRST[10:, 2] = ord("-")
FIRST[1:10, 3] = FIRST[11:, 3] = np.arange(1, 10) + ord("0")
AFTER_POINT = _without("behind", THREE)
AFTER_POINT[:, 0] = THREE[:, 0]
TABLES = (
    FIRST.view(np.uint32).ravel(),
    # with digits before it, without
    _words(("", FOUR, ""), ("", _without("before", FOUR), "")),
    # with digits behind it, without; of a whole number
    _words((".", THREE, ""), (".", AFTER_POINT, ""), ("\0", 0 * THREE, "")),
    # with digits behind it, without
    _words(("", FOUR, ""), ("", _without("behind", FOUR), "")),
    _words(("", _without("behind", THREE), ",")),
)
PAIRS = _words(("", np.pad(_without("behind", _digits(2)), ((0, 0), (0, 2))), ""))
POWERS = np.frombuffer(b"".join(b"e-%02d" % (11 - k) for k in range(7)), np.uint32)
"""By the digits of a small number."""
NAN = np.array([0, 0, 0, ord(",")], np.uint8).view(np.uint32)[0]


def lines(columns: Sequence[np.ndarray[Any, Any]]) -> bytes:
    """Return the rows of columns (n,) as lines of CSV. Numbers are rounded to DECIMALS decimals and
    formatted as in Python; NaN is an empty cell. Columns of text stay unchanged."""
    size = max(1, CHUNK // len(columns))
    return b"".join(
        _lines([column[k : k + size] for column in columns])
        for k in range(0, len(columns[0]), size)
    )


def _lines(columns: Sequence[np.ndarray[Any, Any]]) -> bytes:
    parts: list[Bytes] = []
    together: list[np.ndarray[Any, Any]] = []
    for column in (*columns, None):
        if column is not None and column.dtype.kind in "iuf" and not _large(column):
            together.append(column)
            continue
        parts += [_numbers(together)] if together else []
        parts += [_texts(column)] if column is not None else []
        together = []
    text = np.hstack(parts) if len(parts) > 1 else parts[0]
    text[:, -1] = ord("\n")  # a comma before
    return text.tobytes().translate(None, b"\0")


def _large(column: np.ndarray[Any, Any]) -> bool:
    """Return True where a number of the column is infinite or, once rounded, too large for a
    cell."""
    return bool((np.abs(column.astype(float)) >= MAX_EXACT - 0.5 * 10.0**-DECIMALS).any())


def _numbers(columns: Sequence[np.ndarray[Any, Any]]) -> Bytes:
    """Return the characters (n, 20 * columns) of columns without large numbers."""
    values = np.stack(columns, axis=1).astype(float)
    unknown = np.isnan(values)
    with np.errstate(invalid="ignore"):
        number = np.rint(np.abs(values) * 10**DECIMALS).astype(np.int64)
    number[unknown] = 0
    whole = number // 10**10
    last = number - whole * 10**10
    third, last = last // 10**7, (last % 10**7).astype(np.uint32)
    fourth, fifth = last // 1000, last % 1000
    first, second = whole // 10000, whole % 10000
    ends = fifth == 0
    third += 1000 * (ends & (fourth == 0))
    third[:, [column.dtype.kind != "f" for column in columns]] = 2000
    indices = (
        first + 10 * np.signbit(values),
        second + 10000 * (first == 0),
        third,
        fourth + 10000 * ends,
        fifth,
    )
    words = np.empty((*values.shape, 5), np.uint32)
    for k, (table, index) in enumerate(zip(TABLES, indices)):
        words[:, :, k] = table.take(index)
    words[unknown] = [0, 0, 0, 0, NAN]
    small = (number > 0) & (number < SMALL)
    if small.any():
        words[small] = _exponents(number[small], np.signbit(values[small]))
    return words.view(np.uint8).reshape(len(values), -1)


def _exponents(number: Ints, below: Mask) -> np.ndarray[Any, np.dtype[np.uint32]]:
    """Return the words (n, 5) of cells that Python writes as `-1.23456e-05`, from numbers in units
    of the last digit, 1 to SMALL: `-1 | .234 | 56 | e-05 | ,`."""
    length = np.searchsorted(10 ** np.arange(1, 6), number, side="right") + 1
    first, rest = np.divmod(number * 10 ** (6 - length), 10**5)
    upper, lower = np.divmod(rest, 100)
    words = (
        TABLES[0][first + 10 * below],
        TABLES[2][np.where(rest == 0, 2000, upper + 1000 * (lower == 0))],
        PAIRS[lower],
        POWERS[length],
        np.full(len(number), NAN),
    )
    return np.stack(words, axis=1)


def _texts(column: np.ndarray[Any, Any]) -> Bytes:
    """Return the characters (n, w) of a column of text or with large numbers."""
    if column.dtype.kind == "f":
        whole = ~(np.abs(column) < 2.0**53)  # these have no decimals
        rounded = np.where(whole, column, np.round(np.where(whole, 0.0, column), DECIMALS))
        texts = ["" if each != each else repr(each) for each in rounded.tolist()]
        column = np.array(texts, "S")
    elif column.dtype.kind != "S":
        column = np.char.encode(column.astype(str), "utf-8")
    text = np.ascontiguousarray(column).view(np.uint8).reshape(len(column), -1)
    return np.pad(text, ((0, 0), (0, 1)), constant_values=ord(","))
