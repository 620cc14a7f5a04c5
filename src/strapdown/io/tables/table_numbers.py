"""Texts that hold nothing but numbers, read without pandas, which takes 0.25 s to load."""

import io
import re
import warnings
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError
from ...file_limits import check_size, regular
from ...opening import CELL, ROW, open_file
from .table_file import Numbers
from .table_layout import Layout

SHORT, LINES = 30_000_000, 500_000
"""Bytes and lines of a text that is tried; with longer ones pandas, which parses twice as fast, is
ahead, and keeps no text of each line."""
WHOLE = re.compile(r"\s*[+-]?\d+\s*", re.ASCII)


def numbers_of(path: Path, found: Layout) -> Numbers | None:
    """The columns of a plain text each of whose lines has a finite number in every column, as pandas
    reads them: a column is whole where each of its numbers is written so. None of any other text.
    Raises OSError, and DataError of a file beyond the limits."""
    if found.decimal != "." or len(found.separator) > 1 or regular(path).stat().st_size > SHORT:
        return None
    try:
        with io.TextIOWrapper(open_file(path), "utf-8-sig") as file:
            lines = list(islice(file, LINES + found.skipped + 1))[found.skipped :]
        if len(lines) > LINES:
            return None
        square = _parsed(lines, found.separator, float)
        check_size(CELL * square.size + ROW * len(lines), path)
        names = found.names or range(1, square.shape[1] + 1)
        if square.shape != (len(lines), len(names)) or not np.isfinite(square).all():
            return None
        columns = Numbers(zip(names, np.ascontiguousarray(square.T)))
        first = lines[0].split(found.separator)
        round_ones = np.flatnonzero((square == np.rint(square)).all(axis=0)).tolist()
        whole = [k for k in round_ones if WHOLE.fullmatch(first[k])]
        if whole:  # as numbers of 64 bits, which floats are too short for
            integers = _parsed(lines, found.separator, np.int64, whole)
            columns |= zip([names[k] for k in whole], np.ascontiguousarray(integers.T))
    except DataError:  # too large
        raise
    except (ValueError, Warning):  # something is no number, or missing
        return None
    return columns


def _parsed(
    lines: Sequence[str], separator: str, kind: type, only: Sequence[int] | None = None
) -> np.ndarray[Any, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of no lines, of 1.5 as a whole number
        return np.loadtxt(lines, kind, None, separator, usecols=only, ndmin=2)
