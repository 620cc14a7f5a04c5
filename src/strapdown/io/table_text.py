"""Tables of text as loggers write them. Encoding, separator, decimal mark, header and units are
found from the first lines; lines that hold no data are left out and counted."""

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..checks import DataError
from ..preprocessing.origin import counted
from ..typing import Ints, Mask
from .table_file import PACKED, Table, first_line_of, open_bytes, reading

if TYPE_CHECKING:
    import pandas as pd

HEAD, SAMPLE = 65536, 50
"""Bytes of a file that its layout is found from, and lines of them."""
CHUNK = 65536
"""Rows that are parsed at a time: pandas keeps the text of as many."""
BLANKS = r"\s+"
SEPARATORS = (";", "\t", "|", ",", BLANKS)
"""In the order in which they are believed where several fit: cells of a table with semicolons may
have decimal commas, never the other way round."""
COMMENT = re.compile(r"\s*(#|%|//)")
MARK = re.compile(r"\s*(#|%|//|[-=*]{3})")
"""Beginnings of a line that is a comment, or that is no data."""
NUMBER = re.compile(
    r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?|[+-]?(nan|inf(inity)?)|na|n/a|null|", re.IGNORECASE
)
STAMP = re.compile(
    r"(\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?[-/.]\d\d?[-/.]\d{4})([T ].*)?|\d\d?:\d\d(:\d\d.*)?"
)
"""A date, a time of day or both."""
UNIT = re.compile(
    r"[(\[]?\s*(-|n/a|1|#|(milli|micro|nano)?s(ec(onds?)?)?|[mun]s|[µμ]s|h|"
    r"(deg(rees?)?|rad|°|[mµμ]?rad|mdeg)([/ ]?(s|sec|h)(\^?-1)?)?|dps|[kcm]?m|ft|feet|"
    r"k?m[/ ]?(s|h)(ec)?(\^?-?[12]|²)?|m/s/s|kn|kts?|knots?|mph|m?g|[nuµμm]?t|m?gauss|gs|"
    r"°?c|degc|k|[hkm]?pa|m?bar|v|%|utc|gpst?|unix|iso.*|yyyy.*|hh.*|dd.*|mm.*)\s*[)\]]?",
    re.IGNORECASE,
)
"""What stands in a line of units."""


class Layout(NamedTuple):
    """How a file writes its table."""

    encoding: str
    separator: str  # as pandas takes it
    decimal: str
    skipped: int  # lines before the first row
    names: list[str]  # of the columns; empty where there is no header
    units: dict[str, str]  # of a line of units below the header


def read_table(path: Path, header: bool = True) -> Table:
    """The Table of a text file, plain or packed. Raises DataError.

    Lines that begin with #, % or //, titles above the header and lines without any number are left
    out; those after the first row are counted in the notes of the Table. Without `header` the
    columns are numbered from 1. A table without a header line, read with one, has its first row as
    names, by which `Table.numbers` says so.
    """
    import pandas as pd

    with reading(path):
        found = layout(path)
        if not header:
            found = found._replace(names=[], units={})
        elif not found.names:
            found = _first_row_as_names(path, found)
        try:
            frame, lines, notes = _rows(path, found)
        except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
            raise DataError(
                f"{path}: is not a table of comma-separated values ({first_line_of(error)})"
            ) from error
    if not len(frame):
        raise DataError(f"{path}: has a header but no rows of numbers")
    if not header or not found.names:
        frame.columns = pd.Index(range(1, frame.shape[1] + 1))
    _to_numbers(frame)
    empty = [
        name for name in frame if str(name).startswith("Unnamed: ") and frame[name].isna().all()
    ]
    frame = frame.drop(columns=empty) if empty else frame
    return Table(str(path), frame, lines, units=found.units, notes=tuple(notes))


def _rows(path: Path, found: Layout) -> tuple["pd.DataFrame", Ints, list[str]]:
    """(frame, line of each row, notes) of the lines that hold data. The file is parsed again where
    others do not, so that whole numbers stay such."""
    import pandas as pd

    marks: list[int] = []  # numbers of lines, counted from 0
    try:
        frame = _parsed(path, found)
    except (pd.errors.ParserError, pd.errors.ParserWarning):
        marks = _marks_of_many_cells(path, found)
        frame = _parsed(path, found, marks)
    lines = np.arange(found.skipped, found.skipped + len(frame) + len(marks))
    lines = np.delete(lines, np.array(marks, int) - found.skipped)
    filled, mark = _filled(frame), _marks(frame)
    marks += lines[mark].tolist()
    if not (keep := filled & ~mark).all():
        left = [*marks, *lines[~filled].tolist()]
        frame, lines = _parsed(path, found, left) if keep.any() else frame[keep], lines[keep]
    if not marks:
        return frame, lines + 1, []
    count = counted(len(marks), "line")
    note = f"{path}: {count} without data left out, the first is line {min(marks) + 1}"
    return frame, lines + 1, [note]


def _filled(frame: "pd.DataFrame") -> Mask:
    """Which rows have any cell."""
    first = frame.iloc[:, 0].notna().to_numpy()
    return first if first.all() else frame.notna().any(axis=1).to_numpy()


def _texts(frame: "pd.DataFrame") -> list[Any]:
    return [name for name in frame if frame[name].dtype.kind not in "iufb"]


def _marks(frame: "pd.DataFrame") -> Mask:
    """Which rows hold no data: those that begin like a comment or have text and no number."""
    import pandas as pd

    texts, marks = _texts(frame), np.zeros(len(frame), bool)
    if not texts:
        return marks
    first = frame.columns[0]
    if first in texts:
        marks = np.array(frame[first].astype(str).str.match(MARK.pattern), bool)
    suspect = np.flatnonzero(frame.drop(columns=texts).isna().all(axis=1).to_numpy())
    for name in texts:
        cells = frame[name].iloc[suspect]
        numbers = pd.to_numeric(_with_points(cells), errors="coerce")
        suspect = suspect[numbers.isna().to_numpy()]
    for row in suspect:
        cells = [str(cell) for cell in frame[texts].iloc[row] if not pd.isna(cell)]
        marks[row] |= bool(cells) and not any(STAMP.fullmatch(cell.strip()) for cell in cells)
    return marks


def _with_points(cells: "pd.Series[Any]") -> "pd.Series[Any]":
    """Cells with a decimal comma with a point."""
    return cells.astype(str).str.replace(r"^(\s*[+-]?\d*),(\d+\D*\d*\s*)$", r"\1.\2", regex=True)


def _to_numbers(frame: "pd.DataFrame") -> None:
    """Make numbers of the columns of text that hold nothing else, in place."""
    import pandas as pd

    for name in _texts(frame):
        cells = frame[name]
        known = cells.notna()
        if cells.isna().all():
            frame[name] = np.nan
        for form in (cells, _with_points(cells).where(known)):
            numbers = pd.to_numeric(form, errors="coerce")
            if (numbers.notna() == known).all():
                frame[name] = numbers
                break


def _parsed(path: Path, found: Layout, left: Sequence[int] = ()) -> "pd.DataFrame":
    """What pandas makes of the file without the lines `left`, counted from 0."""
    import pandas as pd

    # a plain file is fastest by its path: pandas then decodes UTF-8 itself
    source = open_bytes(path) if path.suffix.lower() in PACKED else str(path)
    with warnings.catch_warnings():
        # rows with more cells than the header has names
        warnings.simplefilter("error", pd.errors.ParserWarning)
        chunks = pd.read_csv(
            source,
            sep=found.separator,
            decimal=found.decimal,
            header=None,
            names=found.names or None,
            skiprows=[*range(found.skipped), *left] if left else found.skipped,
            skip_blank_lines=False,
            skipinitialspace=True,
            low_memory=False,
            index_col=False,
            encoding=found.encoding,
            encoding_errors="replace",
            chunksize=CHUNK,
        )
        with chunks:
            frames = list(chunks)
    return frames[0] if len(frames) == 1 else pd.concat(frames, ignore_index=True)


def _marks_of_many_cells(path: Path, found: Layout) -> list[int]:
    """Numbers, from 0, of the lines below the header that have more cells than it and no data."""
    marks, most = [], len(found.names)
    with io.TextIOWrapper(open_bytes(path), found.encoding, "replace") as file:
        for number, line in enumerate(file):
            if number < found.skipped or not len(line) > most > 0:
                continue
            cells = _cells(line, found.separator)
            if len(cells) > most and (MARK.match(line) or not any(map(_is_data, cells))):
                marks.append(number)
    return marks


def layout(path: Path) -> Layout:
    """The Layout of a text file by its first lines. Raises DataError where it holds no text."""
    with open_bytes(path) as file:
        head = file.read(HEAD)
    if not head.strip():
        raise DataError(f"{path}: is empty; it must hold a header and rows of numbers")
    encoding = _encoding(head)
    text = head.decode(encoding, "replace")
    if "\0" in text:
        raise DataError(f"{path}: is no table of text, such as comma-separated values")
    lines = text.splitlines()
    if len(head) == HEAD and len(lines) > 1:
        del lines[-1]
    used = [(k, line) for k, line in enumerate(lines) if line.strip() and not COMMENT.match(line)]
    separator, many = _separator([line for _, line in used])
    first = next(
        (i for i, (_, line) in enumerate(used) if _is_row(_cells(line, separator), many)),
        min(1, len(used)),  # a header alone, or text: the first line is the header
    )
    skipped = used[first][0] if first < len(used) else len(lines)
    titles = [line for _, line in used[:first]] or [
        COMMENT.sub("", line).strip() for line in lines[:skipped] if COMMENT.match(line)
    ]
    rows = [_cells(line, separator) for _, line in used[first : first + SAMPLE]]
    names, units = _header([_cells(line, separator, many) for line in titles], rows, many)
    decimal = _decimal(rows)
    return Layout(encoding, separator, decimal, skipped, names, units)


def _encoding(head: bytes) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if len(head) > 3 and head[1:200:2].count(0) == len(head[1:200:2]):
        return "utf-16-le"
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return "utf-8" if error.start > len(head) - 4 else "cp1252"
    return "utf-8"


def _cells(line: str, separator: str, many: int = 0) -> list[str]:
    """The cells of a line; names may hold a blank where that gives `many`."""
    if separator == BLANKS:  # a unit in brackets belongs to the name before it
        wide = re.split(r"\s{2,}|\t", line.strip())
        if len(wide) == many:
            return wide
        return re.findall(r"\"[^\"]*\"|\S+(?:\s[(\[][^)\]]*[)\]])?", line.strip())
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _is_data(cell: str) -> bool:
    return cell != "" and bool(NUMBER.fullmatch(cell) or STAMP.fullmatch(cell))


def _is_row(cells: Sequence[str], many: int) -> bool:
    """Whether cells are a row of data: most are numbers, and not far fewer than elsewhere."""
    some = [cell for cell in cells if cell]
    return 2 * len(cells) > many and 2 * sum(map(_is_data, some)) >= max(1, len(some))


def _separator(lines: Sequence[str]) -> tuple[str, int]:
    """(separator, cells in a row): those by which most rows are numbers."""
    best, best_score, many = ",", 0.0, 1
    sample = lines[-SAMPLE:]
    for separator in SEPARATORS:
        rows = [_cells(line, separator) for line in sample]
        counts = Counter(len(cells) for cells in rows if any(map(_is_data, cells)))
        usual, _ = counts.most_common(1)[0] if counts else (1, 0)
        shares = [
            sum(bool(NUMBER.fullmatch(cell) or STAMP.fullmatch(cell)) for cell in cells) / usual
            for cells in rows
            if len(cells) == usual
        ]
        score = sum(shares) / len(sample) if sample else 0.0
        if usual > 1 and score > best_score + 1e-9:
            best, best_score, many = separator, score, usual
    return best, many


def _decimal(rows: Iterable[Sequence[str]]) -> str:
    numbers = [cell for cells in rows for cell in cells if NUMBER.fullmatch(cell)]
    return (
        "," if sum("," in cell for cell in numbers) > sum("." in cell for cell in numbers) else "."
    )


def _header(
    above: Sequence[list[str]], rows: Sequence[list[str]], many: int
) -> tuple[list[str], dict[str, str]]:
    """(names, {name: unit}) of the lines above the first row; no names where none fits."""
    trailing = bool(rows) and all(len(cells) == many and not cells[-1] for cells in rows)
    fitting = [
        cells
        for cells in above
        if any(char.isalpha() for cell in cells for char in cell)
        and (len(cells) > 1 or many == 1)
        and (not rows or len(cells) >= many - trailing)
    ]
    if not fitting:
        return [], {}
    names, units = fitting[-1], []
    if len(fitting) > 1 and all(UNIT.fullmatch(cell) for cell in names if cell):
        names, units = fitting[-2], fitting[-1]
    while names and not names[-1] and len(names) > many:
        names = names[:-1]
    names = _distinct(names + [""] * (many - len(names)))
    return names, {name: unit.strip("[]() ") for name, unit in zip(names, units) if unit}


def _distinct(names: Iterable[str]) -> list[str]:
    """Names of which none is empty and none is twice."""
    found: list[str] = []
    for i, name in enumerate(names):
        name = name.strip().strip('"').strip() or f"Unnamed: {i}"
        again, number = name, 0
        while again in found:
            number += 1
            again = f"{name}.{number}"
        found.append(again)
    return found


def _first_row_as_names(path: Path, found: Layout) -> Layout:
    with io.TextIOWrapper(open_bytes(path), found.encoding, "replace") as file:
        for _ in range(found.skipped):
            next(file)
        names = _distinct(_cells(next(file, ""), found.separator))
    return found._replace(names=names, skipped=found.skipped + 1)
