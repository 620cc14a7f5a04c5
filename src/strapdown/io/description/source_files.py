"""The tables that a description names, where they are, and their times on the clock of the
recording."""

from collections.abc import Sequence
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError, did_you_mean
from ...time_scales import DAY, WEEK, calendar_seconds, midnight, rolled, seconds_since
from ...typing import Array, File
from ..calendar_text import Moments, Pattern, read_moments
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
        self._start: float | None = None  # of times of day without a date
        # a description may name the same file another way
        self._logs = {path.resolve(): log for path, log in (logs or {}).items()}

    def _table(self, file: str, header: bool = True, table: str | None = None) -> Table:
        path = self.locate(file)
        reader = find(path)
        if reader is None or reader.open is None or (reader.name == "table" and table is None):
            found = read_table(path, header)
            self.notes += found.notes
            return found
        key = path.resolve()
        if key not in self._logs:
            self._logs[key] = ask(reader, "open", path)
        tables = self._logs[key].tables
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
        """Times of the rows of a table (n,), s. Raises DataError where one part of a recording
        has an absolute clock and another has none."""
        if self._first is None:
            self._first = time
            if time.absolute is not None and self.epoch is None:
                t = self._since(0.0, table, time)
                some = t[np.isfinite(t)]
                self.epoch = midnight(some[0]) if len(some) else 0.0
        if time.absolute is None:
            if self._first.absolute is not None:
                raise DataError(
                    f"{table.name}: its time {time.column!r} has no absolute clock and that of "
                    f"[imu] is {self._first.absolute!r}; say its clock too, or bring both to one"
                )
            if time.format is not None:
                return self._of_day(table, time) + time.offset
            return table.numbers(time.column) * (time.scale * time.unit) + time.offset
        if self.epoch is None:
            raise DataError(
                f"{table.name}: its time {time.column!r} is on the clock {time.absolute!r} and that "
                f"of [imu] counts from an unknown moment; say its clock too, or its zero at the top, "
                f'as epoch = "2024-05-01T12:30:00Z"'
            )
        return self._since(self.epoch, table, time)

    def _since(self, epoch: float, table: Table, time: Time) -> Array:
        """Times on an absolute clock, s since `epoch` in seconds of GPS time since its zero."""
        assert time.absolute is not None
        if time.format is not None:
            minute, second = self._moments(table, time)
            return calendar_seconds(epoch, minute, second, time.absolute) + time.offset
        cells: Any = table.cells(time.column)
        if cells.dtype.kind not in "iu":
            cells = table.numbers(time.column)
        week, unit = time.week, time.scale * time.unit
        if isinstance(week, int):  # that of the first row
            week = week + rolled(cells * unit, WEEK)
        elif week is not None:
            week = table.numbers(week)
        return seconds_since(epoch, cells, time.absolute, unit, week) + time.offset

    def _moments(self, table: Table, time: Time) -> Moments:
        """What the calendar text of a table says, with the day of its `date`."""
        of_days, pattern = time.patterns

        def read(column: str | int, pattern: Pattern) -> Moments:
            return read_moments(column, table.cells(column), pattern, table.origin)

        found = read(time.column, pattern)
        if of_days is not None:
            return found._replace(minute=found.minute + read(time.date, of_days).minute)
        if time.date is None:
            return found
        first = float(DAY) * (time.date - date(1970, 1, 1)).days
        return found._replace(minute=found.minute + first + DAY * rolled(np.add(*found), DAY))

    def _of_day(self, table: Table, time: Time) -> Array:
        """Times of day without a date, s since midnight before the first sample of the IMU."""
        t = np.add(*self._moments(table, time))
        t += DAY * rolled(t, DAY)
        some = t[np.isfinite(t)]
        if self._start is None:
            self._start = some[0] if len(some) else 0.0
        return t + DAY * np.round((self._start - some[0]) / DAY) if len(some) else t
