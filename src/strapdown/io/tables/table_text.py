"""Text tables as loggers write them. Lines without data are left out and counted. Texts with only
numbers are read without pandas, which takes 0.25 s to load."""

import io
import re
import warnings
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ...checks import DataError
from ...fileio.file_access import CELL, ROW, TEXT, check_lines
from ...fileio.limits import Meter, check_count, check_size, regular
from ...typing import Ints, Mask
from ...units.wording import count_text
from .table_file import (
    PACKED,
    FileTable,
    NumberColumns,
    is_number,
    open_bytes,
    reading_file,
    split_error,
)
from .table_layout import STAMP, TableLayout, cells_of, distinct, is_data, layout

if TYPE_CHECKING:
    import pandas as pd

DIGITS = frozenset("0123456789")
CHUNK, CELLS = 65536, 1 << 20
"""Rows and cells that are parsed at a time: pandas keeps the text of as many."""
FEW, PADDED = 1_000_000, 4
"""Number of cells that any text may have, and number per byte of a longer text. A written cell has
at least a byte, but rows are padded with empty cells, also an empty line below a row of
thousands."""
SAMPLED = 200
"""Number of cells of a text column that decide whether it may hold numbers."""
MARK = re.compile(r"\s*(#|%|//|[-=*]{3})")
"""Beginnings of a line without data."""
WORD = re.compile(r"\s*\"?[^\W\d_]+(?![^\W_])")
"""Beginning of a cell that is a word rather than a damaged number."""


def read_table(path: Path, header: bool = True) -> FileTable:
    """Return the FileTable of a text file, plain or compressed. Raises DataError.

    Lines that begin with #, % or //, titles above the header and lines without any number are left
    out; those after the first row are counted in the notes of the FileTable. Without `header` the
    columns are numbered from 1. A table without a header line, read with one, has its first row as
    names, by which `FileTable.numbers` says so.
    """
    with reading_file(path):
        found = layout(path)
        if path.suffix.lower() not in PACKED:
            check_lines(path)
        if not header:
            found = found._replace(names=[], units={})
        elif not found.names:
            found = _first_row_as_names(path, found)
        if numbers := numbers_of(path, found):
            lines = 1 + found.skipped + np.arange(len(next(iter(numbers.values()))))
            return FileTable(str(path), numbers, lines, units=found.units)
        return _of_any_cells(path, found)


def _of_any_cells(path: Path, found: TableLayout) -> FileTable:
    """Return the FileTable of a text that holds more than numbers, parsed by pandas."""
    import pandas as pd

    try:
        frame, lines, notes = _rows(path, found)
    except DataError:  # a limit was exceeded while reading
        raise
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
        raise DataError(
            f"{path}: is not a table of comma-separated values ({split_error(error)}); correct the line, "
            f"or export a table from the device's own format"
        ) from error
    if not len(frame):
        raise DataError(f"{path}: has a header but no rows of numbers")
    if not found.names:
        frame.columns = pd.Index(range(1, frame.shape[1] + 1))
    _to_numbers(frame)
    kept = [not str(name).startswith("Unnamed: ") or frame[name].notna().any() for name in frame]
    frame = frame if all(kept) else frame.loc[:, kept]
    return FileTable(str(path), frame, lines, units=found.units, notes=tuple(notes))


def _rows(path: Path, found: TableLayout) -> tuple["pd.DataFrame", Ints, list[str]]:
    """(frame, line of each row, notes) of the lines with data. Where other lines exist, the file is
    parsed again without them, so that integers stay integers."""
    import pandas as pd

    marks: list[int] = []  # numbers of lines, counted from 0
    try:
        frame = _parse_frame(path, found)
    except (pd.errors.ParserError, pd.errors.ParserWarning):
        marks = _marks_of_many_cells(path, found)
        frame = _parse_frame(path, found, marks)
    lines = np.arange(found.skipped, found.skipped + len(frame) + len(marks))
    lines = np.delete(lines, np.array(marks, int) - found.skipped)
    filled = _nonblank_rows(frame)
    mark = _marks(frame, filled)
    marks += lines[mark].tolist()
    if not (keep := filled & ~mark).all():
        left = [*marks, *lines[~filled].tolist()]
        frame, lines = frame[keep], lines[keep]
        again = _parse_frame(path, found, left) if len(frame) else frame
        if len(again) == len(frame):  # with line ends of old Macs, pandas skips other lines
            frame = again
    if not marks:
        return frame, lines + 1, []
    count = count_text(len(marks), "line")
    note = f"{path}: {count} without data left out, the first is line {min(marks) + 1}"
    return frame, lines + 1, [note]


def _nonblank_rows(frame: "pd.DataFrame") -> Mask:
    """Return True for the rows with any filled cell."""
    first = frame.iloc[:, 0].notna().to_numpy()
    return first if first.all() else frame.notna().any(axis=1).to_numpy()


def _texts(frame: "pd.DataFrame") -> list[Any]:
    return [name for name in frame if frame[name].dtype.kind not in "iufb"]


def _marks(frame: "pd.DataFrame", filled: Mask) -> Mask:
    """Return True for the `filled` rows without data: those that begin like a comment, that begin
    with a word where the others begin with a number or a time, or that have text and no number."""
    import pandas as pd

    texts, marks = _texts(frame), np.zeros(len(frame), bool)
    if not texts:
        return marks
    first = frame.columns[0]
    if first in texts:
        known = np.flatnonzero(frame[first].notna().to_numpy())
        cells = [str(cell) for cell in frame[first].to_numpy(object)[known]]
        odd = [(row, cell) for row, cell in zip(known, cells) if cell[:1] not in DIGITS]
        words = [row for row, cell in odd if WORD.match(cell)]
        marks[[row for row, cell in odd if MARK.match(cell)]] = True
        if 2 * len(words) < len(known):
            marks[words] = True
    # by position: from a list of names, pandas makes an array in which all are as wide as the longest
    is_text = frame.columns.isin(texts)
    places = np.flatnonzero(is_text)
    numbers_there = frame.loc[:, ~is_text]
    suspect = np.flatnonzero(filled & numbers_there.isna().all(axis=1).to_numpy())
    start, many = 0, 1
    while start < len(texts) and len(suspect):  # the first column decides most of them
        square = frame.iloc[suspect, places[start : start + many]].to_numpy(object)
        numbers = pd.to_numeric(_with_points(pd.Series(square.ravel())), errors="coerce")
        suspect = suspect[numbers.isna().to_numpy().reshape(square.shape).all(axis=1)]
        start, many = start + many, 2 * many
    left = frame.iloc[suspect, places].to_numpy(object)
    for row, texts_there, filled_there in zip(suspect, left, pd.notna(left)):
        known_texts = map(str, texts_there[filled_there])
        marks[row] |= not any(STAMP.fullmatch(text.strip()) for text in known_texts)
    return marks


def _with_points(cells: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return the cells with decimal points instead of commas."""
    return cells.astype(str).str.replace(r"^(\s*[+-]?\d*),(\d+\D*\d*\s*)$", r"\1.\2", regex=True)


def _to_numbers(frame: "pd.DataFrame") -> None:
    """Convert text columns that hold only numbers, in place."""
    import pandas as pd

    for name in _texts(frame):
        cells = frame[name]
        known = cells.notna()
        if not known.any():
            frame[name] = np.nan
        some = cells[known].iloc[:: max(1, int(known.sum()) // SAMPLED)]
        if not any(is_number(str(cell).replace(",", ".", 1)) for cell in some):
            continue  # as times of the calendar
        for form in (cells, _with_points(cells).where(known)):
            numbers = pd.to_numeric(form, errors="coerce")
            if (numbers.notna() == known).all():
                frame[name] = numbers
                break
        else:
            if 2 * numbers.notna().sum() > known.sum():  # a later check reports the others
                frame[name] = form


def _parse_frame(path: Path, found: TableLayout, left: Sequence[int] = ()) -> "pd.DataFrame":
    """Parse the file with pandas, without the lines `left`, counted from 0. Skipping blanks before
    cells takes time, so it is done only where there is more than numbers."""
    frame = _as_pandas_parses(path, found, left, blanks=False)
    if not _texts(frame):
        return frame
    del frame  # before the second one comes
    return _as_pandas_parses(path, found, left, blanks=True)


def _as_pandas_parses(
    path: Path, found: TableLayout, left: Sequence[int], blanks: bool
) -> "pd.DataFrame":
    import pandas as pd

    # a plain file is fastest by its path: pandas then decodes UTF-8 itself
    packed = path.suffix.lower() in PACKED
    source: Any = open_bytes(path, lines=True) if packed else nullcontext(str(regular(path)))
    with source as content, warnings.catch_warnings():
        # rows with more cells than the header has names
        warnings.simplefilter("error", pd.errors.ParserWarning)
        # a column of numbers and words is handled where it is used
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)
        chunks = pd.read_csv(
            content,
            sep=found.separator,
            decimal=found.decimal,
            header=None,
            names=found.names or None,
            skiprows=[*range(found.skipped), *left] if left else found.skipped,
            skip_blank_lines=False,
            skipinitialspace=blanks,
            index_col=False,
            encoding=found.encoding,
            encoding_errors="replace",
            chunksize=max(1, min(CHUNK, CELLS // found.columns)),
        )
        with chunks:
            frames = _gather_chunks(chunks, path, content if packed else None)
    return frames[0] if len(frames) == 1 else pd.concat(frames, ignore_index=True)


def _gather_chunks(
    chunks: Iterable["pd.DataFrame"], path: Path, unpacked: BinaryIO | None
) -> list["pd.DataFrame"]:
    """Return all chunks of an `unpacked` or plain file, with their cells counted. Raises DataError
    where there are too many cells, in total or for the size of the text."""
    size, cells = regular(path).stat().st_size, 0
    frames, meter = [], Meter(path, size if unpacked else None)
    for frame in chunks:
        texts = sum(int(frame[name].notna().sum()) for name in _texts(frame))
        meter.add(CELL * frame.size + ROW * len(frame) + (TEXT - CELL) * texts)
        cells += frame.size
        if cells > FEW + PADDED * (unpacked.tell() if unpacked else size):
            raise DataError(
                f"{path}: is not a table: a row has {frame.shape[1]} cells, but most others have few "
                f"or none; correct the long row, or export a table from the device's own format"
            )
        frames.append(frame)
    return frames


def _marks_of_many_cells(path: Path, found: TableLayout) -> list[int]:
    """Return the numbers, from 0, of the lines below the header that have more cells than the
    header but no data."""
    marks, most, in_words = [], len(found.names), False
    with io.TextIOWrapper(open_bytes(path, lines=True), found.encoding, "replace") as file:
        for number, line in enumerate(file):
            if number == found.skipped:
                in_words = bool(WORD.match(line))
            if number < found.skipped or not len(line) > most > 0:
                continue
            cells = cells_of(line, found.separator)
            is_mark = MARK.match(line) or (WORD.match(line) and not in_words)
            if len(cells) > most and (is_mark or not any(map(is_data, cells))):
                marks.append(number)
    return marks


def _first_row_as_names(path: Path, found: TableLayout) -> TableLayout:
    with io.TextIOWrapper(open_bytes(path, lines=True), found.encoding, "replace") as file:
        for _ in range(found.skipped):
            next(file)
        names = distinct(cells_of(next(file, ""), found.separator))
    check_count(len(names), path, "columns", "columns")
    return found._replace(names=names, skipped=found.skipped + 1)


# ---- nothing but numbers

SHORT, LINES = 30_000_000, 500_000
"""Largest bytes and lines of a text read without pandas. For longer texts pandas wins, which parses
twice as fast and does not keep the text of each line."""
WHOLE = re.compile(r"\s*[+-]?\d+\s*", re.ASCII)


def numbers_of(path: Path, found: TableLayout) -> NumberColumns | None:
    """Return the columns of a text with a finite number in every column of every line, as pandas
    would read them: a column has integers where all its numbers are written as integers. None for
    any other text. Raises OSError, and DataError for a file beyond the limits."""
    if found.decimal != "." or len(found.separator) > 1 or regular(path).stat().st_size > SHORT:
        return None
    try:
        with io.TextIOWrapper(open_bytes(path, lines=True), "utf-8-sig") as file:
            lines = list(islice(file, LINES + found.skipped + 1))[found.skipped :]
        if len(lines) > LINES:
            return None
        square = _load_numbers(lines, found.separator, float)
        check_size(CELL * square.size + ROW * len(lines), path)
        names = found.names or range(1, square.shape[1] + 1)
        if square.shape != (len(lines), len(names)) or not np.isfinite(square).all():
            return None
        columns = NumberColumns(zip(names, np.ascontiguousarray(square.T)))
        first = lines[0].split(found.separator)
        round_ones = np.flatnonzero((square == np.rint(square)).all(axis=0)).tolist()
        whole = [k for k in round_ones if WHOLE.fullmatch(first[k])]
        if whole:  # as 64-bit integers, which exceed the precision of floats
            integers = _load_numbers(lines, found.separator, np.int64, whole)
            columns |= zip([names[k] for k in whole], np.ascontiguousarray(integers.T))
    except DataError:  # too large
        raise
    except (ValueError, Warning):  # a cell is missing or not a number
        return None
    return columns


def _load_numbers(
    lines: Sequence[str], separator: str, kind: type, only: Sequence[int] | None = None
) -> np.ndarray[Any, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # for no lines, and for 1.5 as an integer
        return np.loadtxt(lines, kind, None, separator, usecols=only, ndmin=2)
