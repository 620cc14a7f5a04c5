"""Layout of a text table: encoding, separator, decimal mark, header and units, from its first
lines."""

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ...checks import DataError
from ...fileio.limits import check_count
from .table_file import open_bytes

HEAD, SAMPLE = 65536, 50
"""Numbers of bytes and of lines from which the layout is found."""
BLANKS = r"\s+"
SEPARATORS = (";", "\t", "|", ",", BLANKS)
"""In order of preference where several fit: cells of a table with semicolons may have decimal
commas, never the reverse."""
COMMENT = re.compile(r"\s*(#|%|//)")
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
"""Pattern of a cell in a line of units."""


class TableLayout(NamedTuple):
    """Layout of the table in a file."""

    encoding: str
    separator: str  # as pandas takes it
    decimal: str
    skipped: int  # lines before the first row
    names: list[str]  # of the columns; empty where there is no header
    columns: int  # cells of the header or of a row, if those are more
    units: dict[str, str]  # of a line of units below the header


def layout(path: Path) -> TableLayout:
    """Return the TableLayout of a text file from its first lines. Raises DataError for other
    content."""
    with open_bytes(path) as file:
        head = file.read(HEAD)
    if not head.strip():
        raise DataError(f"{path}: is empty; it must hold a header and rows of numbers")
    encoding = _encoding(head)
    text = head.decode(encoding, "replace")
    if "\0" in text:
        raise DataError(f"{path}: is not a text table, such as comma-separated values; export one")
    lines = [line.rstrip("\n") for line in io.StringIO(text, newline=None)]  # any line ending
    unfinished = lines.pop() if len(head) == HEAD else ""
    used = [(k, line) for k, line in enumerate(lines) if line.strip() and not COMMENT.match(line)]
    if not used and unfinished and not COMMENT.match(unfinished):
        raise DataError(
            f"{path}: is not a table: its first row does not end within 64 KB; export it again"
        )
    separator, many = _separator([line for _, line in used])
    first = next(
        (i for i, (_, line) in enumerate(used) if _is_row(cells_of(line, separator), many)),
        min(1, len(used)),  # a header alone, or text: the first line is the header
    )
    skipped = used[first][0] if first < len(used) else len(lines)
    titles = [line for _, line in used[:first]] or [
        COMMENT.sub("", line).strip() for line in lines[:skipped] if COMMENT.match(line)
    ]
    rows = [cells_of(line, separator) for _, line in used[first : first + SAMPLE]]
    names, units = _header([cells_of(line, separator, many) for line in titles], rows, many)
    columns = max(many, len(names), *map(len, rows[:1]))
    check_count(columns, path, "columns", "columns")
    if rows and not _is_table(rows, names, separator, many):
        raise DataError(
            f"{path}: is not a table: most of its first lines are not rows of numbers; give a table with "
            f"a line of names and rows of numbers, or the device's own format"
        )
    decimal = _decimal(rows)
    return TableLayout(encoding, separator, decimal, skipped, names, columns, units)


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


def cells_of(line: str, separator: str, many: int = 0) -> list[str]:
    """Return the cells of a line; names may contain a blank if this gives `many` cells."""
    if separator == BLANKS:  # a unit in brackets belongs to the name before it
        wide = re.split(r"\s{2,}|\t", line.strip())
        if len(wide) == many:
            return wide
        return re.findall(r"\"[^\"]*\"|\S+(?:\s[(\[][^)\]]*[)\]])?", line.strip())
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def is_data(cell: str) -> bool:
    """Return True where a cell is a number, a date or a time."""
    return cell != "" and bool(NUMBER.fullmatch(cell) or STAMP.fullmatch(cell))


def _is_row(cells: Sequence[str], many: int) -> bool:
    """Return True where cells are a row of data: at least half of the filled ones are numbers or
    times, and their count is more than half of the usual one."""
    some = [cell for cell in cells if cell]
    return 2 * len(cells) > many and 2 * sum(map(is_data, some)) >= max(1, len(some))


def _is_table(
    rows: Sequence[Sequence[str]], names: Sequence[str], separator: str, many: int
) -> bool:
    """Return True where a file is a table, so that messages may quote its names and cells: at least
    half of its lines are rows of data, or have as many cells as a line of names above them, one of
    them a number or time. Other files, such as settings or secrets, are not quoted."""
    filled = [cells for cells in rows if any(cells)]
    if 2 * sum(_is_row(cells, many) for cells in filled) >= len(filled):
        return True
    fit = [cells for cells in filled if len(cells) == len(names) and any(map(is_data, cells))]
    named = len(names) > 1 and separator != BLANKS and not any(map(is_data, names))
    return named and 2 * len(fit) >= len(filled)


def _separator(lines: Sequence[str]) -> tuple[str, int]:
    """(separator, cells in a row) with which most rows are numbers."""
    best, best_score, many = ",", 0.0, 1
    sample = lines[-SAMPLE:]
    for separator in SEPARATORS:
        rows = [cells_of(line, separator) for line in sample]
        counts = Counter(len(cells) for cells in rows if any(map(is_data, cells)))
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
    names = distinct(names + [""] * (many - len(names)))
    return names, {name: unit.strip("[]() ") for name, unit in zip(names, units) if unit}


def distinct(names: Iterable[str]) -> list[str]:
    """Return names without empty or repeated ones."""
    found: dict[str, None] = {}
    numbers: Counter[str] = Counter()  # the last number given to a name
    for i, name in enumerate(names):
        name = again = name.strip().strip('"').strip() or f"Unnamed: {i}"
        while again in found:
            numbers[name] += 1
            again = f"{name}.{numbers[name]}"
        found[again] = None
    return list(found)
