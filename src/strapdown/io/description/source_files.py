"""The tables that a description names, where they are, and their times on the clock of the
recording."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError, did_you_mean
from ...time_scales import midnight, seconds_since
from ...typing import Array, File
from ..contract import Log
from ..locate import locate
from ..registry import ask, find
from ..table_file import Table
from ..table_text import read_table
from .schema_base import Time


class Files:
    """The tables that one description names, each read once.

    `epoch` is the moment of t = 0, in seconds of GPS time since its zero: that of the description,
    else midnight, UTC, before the first time that is asked for, which is the IMU's; None where that
    has no absolute clock. `notes` say what of the tables was left out.
    """

    def __init__(
        self,
        description_path: File,
        epoch: float | None = None,
        folder: File | None = None,
        logs: dict[Path, Log] | None = None,
    ) -> None:
        self.path = Path(description_path)
        self.folder = self.path.parent if folder is None else Path(folder)
        self.table = cache(self._table)
        self.notes: list[str] = []
        self.epoch = epoch
        self._first: Time | None = None
        self._times: dict[tuple[str, Time], Array] = {}
        self._logs = {} if logs is None else logs

    def _table(self, file: str, header: bool = True, table: str | None = None) -> Table:
        path = self.locate(file)
        reader = find(path)
        if reader is None or reader.open is None or (reader.name == "table" and table is None):
            found = read_table(path, header)
            self.notes += found.notes
            return found
        if path not in self._logs:
            self._logs[path] = ask(reader, "open", path)
        tables = self._logs[path].tables
        if table is None and len(tables) == 1:
            return next(iter(tables.values()))
        if table is None or table not in tables:
            wrong = "is missing" if table is None else f"{table!r} is none of the file"
            hint = did_you_mean(table, tables) if table is not None else ""
            raise DataError(f"{path}: table: {wrong}{hint}; it has {', '.join(tables) or 'none'}")
        return tables[table]

    def locate(self, file: str) -> Path:
        """The path that the description means by `file`."""
        try:
            return locate(file, self.folder)
        except DataError as error:
            raise DataError(f"{self.path}: {error}") from None

    def columns(
        self, file: str, time: Time, columns: Sequence[str | int], table: str | None = None
    ) -> tuple[Table, Array, list[Array]]:
        """(Table, t in s, list of arrays) of one table; columns given by number say that it has
        no header."""
        found = self.table(
            file, not any(isinstance(column, int) for column in (time.column, *columns)), table
        )
        return found, self.times(found, time), [found.numbers(column) for column in columns]

    def times(self, table: Table, time: Time) -> Array:
        """Times of the rows of a table (n,), s, made once. Raises DataError where one part of a
        recording has an absolute clock and another has none."""
        key = table.name, time
        if key not in self._times:
            self._times[key] = self._made_times(table, time)
        return self._times[key]

    def _made_times(self, table: Table, time: Time) -> Array:
        if self._first is None:
            self._first = time
            if time.clock is not None and self.epoch is None:
                t = self._since(0.0, table, time)
                some = t[np.isfinite(t)]
                self.epoch = midnight(some[0]) if len(some) else 0.0
        if time.clock is None:
            if self._first.clock is not None:
                raise DataError(
                    f"{table.name}: its time {time.column!r} has no absolute clock and that of "
                    f"[imu] is {self._first.clock!r}; say its clock too, or bring both to one"
                )
            return table.numbers(time.column) * (time.scale * time.unit) + time.offset
        if self.epoch is None:
            raise DataError(
                f"{table.name}: its time {time.column!r} is on the clock {time.clock!r} and that of "
                f"[imu] counts from an unknown moment; say its clock too, or its zero at the top, "
                f'as epoch = "2024-05-01T12:30:00Z"'
            )
        return self._since(self.epoch, table, time)

    def _since(self, epoch: float, table: Table, time: Time) -> Array:
        assert time.clock is not None
        cells: Any = table.cells(time.column)
        if cells.dtype.kind not in "iu":
            cells = table.numbers(time.column)
        week = time.week
        if week is not None and not isinstance(week, int):
            week = table.numbers(week)
        return seconds_since(epoch, cells, time.clock, time.scale * time.unit, week) + time.offset
