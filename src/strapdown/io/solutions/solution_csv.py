"""Solutions as CSV: the table of a solution, a unit in brackets behind each name (`lat [deg]`), and
the verdict as a comment before it."""

import csv
import gzip
import io
import json
import lzma
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError
from ...data import NAV_COLUMNS, UNITS, Innovations, Solution
from ...time_scales import gps_of, iso, iso_text
from ...typing import Array
from ...verdict import NOT_JUDGED
from ..tables.table_file import Table, open_text, reading
from ..tables.table_text import read_table
from .number_text import lines
from .solution_netcdf import checked
from .solution_table import state_of, table_of

VERDICT_LINE = "# verdict: "
"""Begins the first line of a file whose solution was judged; the word follows, then all as JSON."""
UTC = "utc"
"""Name of the column of ISO 8601 texts."""
ROWS = 1 << 14
"""Rows whose table is made at once."""


def write_csv(solution: Solution, part: Path, path: Path, utc: bool = False) -> None:
    """Write a Solution to `part`, packed as `path` ends; with `utc` the second column is ISO 8601
    text. Raises DataError where there is no absolute clock to write."""
    if utc and solution.utc is None:
        raise DataError(
            f"{path}: no column of UTC, because the recording has no absolute clock; say its `clock` "
            f"or `epoch` in the recording.toml, or leave utc out"
        )
    ways: dict[str, Any] = {".gz": gzip.open, ".xz": partial(lzma.open, preset=1)}
    verdict = solution.verdict
    with ways.get(path.suffix.lower(), open)(part, "wb") as file:
        if verdict.word != NOT_JUDGED:
            said = f"{VERDICT_LINE}{verdict.word} {json.dumps(verdict.as_dict())}\n"
            file.write(said.encode())
        for text in _texts(solution, utc):
            file.write(text)


def _texts(solution: Solution, utc: bool) -> Iterator[bytes]:
    """The header and the rows, some thousands at a time."""
    for k in range(0, max(len(solution.t), 1), ROWS):
        part = _rows(solution, slice(k, k + ROWS))
        table = table_of(part)
        if not k:
            names = ["t", *([UTC] if utc else []), *map(str, table.columns)]
            yield _header(f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names)
        moments = part.utc if utc else None
        stamps = [] if moments is None else [iso_text(moments, 6)]
        columns = [table[name].to_numpy() for name in table.columns]
        yield lines([part.t, *stamps, *columns]) if len(part.t) else b""


def _rows(solution: Solution, rows: slice) -> Solution:
    """These rows of its table."""
    return replace(
        solution,
        trajectory=solution.trajectory.taking(rows),
        b_a=solution.b_a[rows],
        b_g=solution.b_g[rows],
        status=solution.status[rows],
        columns={name: values[rows] for name, values in solution.columns.items()},
        covariance=None,
        recording=None,
    )


def _header(names: Iterator[str]) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(names)
    return line.getvalue().encode()


def read_csv(path: Path) -> Solution:
    """The Solution in a file of `write_csv`, without innovations, events and covariance. Raises
    DataError."""
    table = read_table(path)
    columns = {}
    for column in map(str, table.frame.columns):
        name, unit = column.removesuffix("]").split(" [", 1) if " [" in column else (column, None)
        if name in UNITS and unit not in (None, UNITS[name]):
            raise DataError(
                f"{path}: column {name!r} is in {unit!r}; a solution has it in {UNITS[name]!r}"
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

    none = Innovations(
        np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0, bool)
    )
    extra = {
        name: table.frame[column].to_numpy()
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
        meta={
            "recording": path.name,
            "notes": [f"read from {path.name}: a table without innovations, events or covariance"],
            **_epoch_of(table),
            **_verdict_of(path),
        },
    )


def _epoch_of(table: Table) -> dict[str, Any]:
    """{"epoch": UTC of t = 0} where the table has a column of UTC."""
    if UTC not in table.frame.columns:
        return {}
    known = np.flatnonzero(table.frame[UTC].notna())
    if not len(known):
        return {}
    first = int(known[0])
    return {"epoch": iso(gps_of(str(table.cells(UTC)[first])) - table.numbers("t [s]")[first])}


def _verdict_of(path: Path) -> dict[str, Any]:
    """{"verdict": as the first line of a CSV file says it}; {} where it says none."""
    with reading(path), open_text(path) as file:
        first = file.readline()
    if not first.startswith(VERDICT_LINE):
        return {}
    return {"verdict": checked(json.loads(first[first.index("{") :]))}


def _quaternion(rph: Array) -> Array | None:
    """From roll, pitch, heading in degrees; None where none is known."""
    from scipy.spatial.transform import Rotation

    if not np.isfinite(rph).any():
        return None
    return Rotation.from_euler("ZYX", rph[:, ::-1], degrees=True).as_quat()[:, [3, 0, 1, 2]]
