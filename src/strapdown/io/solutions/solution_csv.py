"""Solutions as CSV: the table of a solution with a unit in brackets after each name (`lat [deg]`),
and the verdict in a comment before it."""

import csv
import gzip
import io
import json
import lzma
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError, locate_errors
from ...data.solution import NAV_COLUMNS, UNITS, Innovations, Solution, SolutionMeta
from ...data.verdict import NOT_JUDGED
from ...fileio.checksum import DAMAGED
from ...fileio.spreadsheet import as_written, inert
from ...geometry.rotations import Rotation
from ...typing import Array
from ...units.time_scales import gps_of, iso, iso_text
from ..own.array_rules import broken_rules
from ..tables.table_file import FileTable, open_text, reading_file
from ..tables.table_text import read_table
from .number_text import lines
from .solution_netcdf import SCHEMA, columns_of, state_of

VERDICT_LINE = "# verdict: "
"""Beginning of the first line where the solution has a verdict; its word follows, then all as
JSON."""
UTC = "utc"
"""Name of the column of ISO 8601 texts."""
ROWS = 1 << 14
"""Number of rows that are formatted at once."""


def write_csv(solution: Solution, part: Path, path: Path, utc: bool = False) -> None:
    """Write a Solution to `part`, compressed according to the ending of `path`; with `utc` the
    second column is ISO 8601 text. Raises DataError without an absolute clock."""
    if utc and solution.utc is None:
        raise DataError(
            f"{path}: no column of UTC, because the recording has no absolute clock; set its `clock` "
            f"or `epoch` in the recording.toml, or leave utc out"
        )
    ways: dict[str, Any] = {".gz": gzip.open, ".xz": partial(lzma.open, preset=1)}
    verdict = solution.verdict
    with ways.get(path.suffix.lower(), open)(part, "wb") as file:
        if verdict.word != NOT_JUDGED:
            said = verdict.as_dict() | {"rows": len(solution.t)}
            file.write(f"{VERDICT_LINE}{verdict.word} {json.dumps(said)}\n".encode())
        for text in _texts(solution, utc):
            file.write(text)


def _texts(solution: Solution, utc: bool) -> Iterator[bytes]:
    """Yield the header and the rows, some thousands at a time."""
    for k in range(0, max(len(solution.t), 1), ROWS):
        part = solution.take(slice(k, k + ROWS))
        columns = columns_of(part)
        if not k:
            names = ["t", *([UTC] if utc else []), *map(str, columns)]
            yield _header(f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names)
        moments = part.utc if utc else None
        stamps = [] if moments is None else [iso_text(moments, 6)]
        yield lines([part.t, *stamps, *columns.values()]) if len(part.t) else b""


def _header(names: Iterator[str]) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(map(inert, names))
    return line.getvalue().encode()


def read_csv(path: Path) -> Solution:
    """Return the Solution in a file of `write_csv`, without innovations, events and covariance.
    Raises DataError."""
    said = _read_comment(path)
    table = read_table(path)
    _check_rows(table, 3 if said else 2, said.pop("rows", None))
    columns = {}
    for column in map(str, table.names):
        name, unit = column.removesuffix("]").split(" [", 1) if " [" in column else (column, None)
        if name in UNITS and unit not in (None, UNITS[name]):
            raise DataError(
                f"{path}: column {name!r} is in {unit!r}; it must be in {UNITS[name]!r}"
            )
        columns[name if name in UNITS else column] = column
    if missing := [name for name in (*UNITS, "status") if name not in columns]:
        wanted = f"{missing[0]} [{UNITS[missing[0]]}]" if missing[0] in UNITS else missing[0]
        raise DataError(
            f"{path}: column {wanted!r} is missing; write the solution again, or use read for a "
            f"recording"
        )

    def read(names: list[str]) -> Array:
        return np.column_stack([table.numbers(columns[name]) for name in names])

    _check_cells(table, columns)
    none = Innovations(
        np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0, bool)
    )
    extra = {
        as_written(name): table.numbers(column)
        for name, column in columns.items()
        if name not in (*UNITS, "status", UTC)
    }
    trajectory, b_a, b_g = state_of(
        table.numbers(columns["t"]), read, _quaternion(read(NAV_COLUMNS[6:]))
    )
    return Solution(
        trajectory,
        b_a,
        b_g,
        table.numbers("status").astype(np.int64),
        none,
        columns=extra,
        meta=_meta(path, table, said),
    )


def _check_rows(table: FileTable, first: int, rows: int | None) -> None:
    """Refuse a truncated table, or one with lines without data below or above its header; `first`
    is the first line of data. Raises DataError."""
    odd = np.flatnonzero(table.lines != np.arange(first, first + len(table.lines)))
    if len(odd):
        line = first + int(odd[0]) if odd[0] else 1
        raise DataError(
            f"{table.name}, line {line}: is not a row of a solution; {DAMAGED}, or remove the line"
        )
    if rows is not None and rows != len(table.lines):
        raise DataError(
            f"{table.name}: has {len(table.lines)} rows, but its first line states {rows}; {DAMAGED}, "
            f"or remove its first line if you removed rows"
        )


def _check_cells(table: FileTable, columns: Mapping[str, str]) -> None:
    """Refuse impossible numbers, with their line. Raises DataError."""
    for name, column in columns.items():
        if name not in SCHEMA and name != "t":
            continue
        values, rule = table.numbers(column), SCHEMA["time" if name == "t" else name]
        wrong = np.any([broken for broken, _ in broken_rules(values, rule)], axis=0)
        if rule.rising:
            wrong[1:] |= ~(np.diff(values) > 0)
        table.origin.refuse(
            wrong,
            lambda row: (
                f"{column} is {values[row]:.9g}, which is impossible there (times increase, std are "
                f"not negative, status is 0 to 3); {DAMAGED}"
            ),
        )


def _meta(path: Path, table: FileTable, verdict: dict[str, Any]) -> SolutionMeta:
    """Return the meta of a solution read from a table: its name, epoch and verdict."""
    note = f"read from {path.name}: a table without innovations, events or covariance"
    meta: SolutionMeta = {"recording": path.name, "notes": [note]}
    if epoch := _epoch_of(table):
        meta["epoch"] = epoch
    if verdict:
        meta["verdict"] = verdict
    return meta


def _epoch_of(table: FileTable) -> str | None:
    """UTC of t = 0 where the table has a column of UTC."""
    if UTC not in table.names:
        return None
    known = np.flatnonzero(table.cells_filled(UTC))
    if not len(known):
        return None
    first = int(known[0])
    with locate_errors(f"{table.origin.row(first)}, column {UTC!r}"):
        return iso(gps_of(str(table.cells(UTC)[first])) - table.numbers("t [s]")[first])


def _read_comment(path: Path) -> dict[str, Any]:
    """Return the verdict in the comment before the table, with the number of rows as `rows`; {}
    without a comment. Raises DataError."""
    from ..own.text_rules import VerdictRules, check_values, from_json

    with reading_file(path), open_text(path) as file:
        first = file.readline()
    if not first.startswith(VERDICT_LINE):
        return {}
    where = f"{path}: line 1"
    return dict(check_values(VerdictRules, from_json(first[first.find("{") :], where), where))


def _quaternion(rph: Array) -> Array | None:
    """Return quaternions from roll, pitch, heading in degrees; None where none is known."""
    if not np.isfinite(rph).any():
        return None
    return Rotation.from_rph(np.radians(rph)).as_wxyz()
