"""The tables that a description names, their paths, and their times on the clock of the
recording."""

from collections.abc import Mapping, Sequence, Set
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError, did_you_mean, locate_errors
from ...fileio.limits import check_inside, in_force
from ...preprocessing.origin import RowsOfFile
from ...typing import Array, File, Mask
from ...units.time_scales import (
    DAY,
    WEEK,
    YEARS,
    calendar_seconds,
    midnight,
    rollover_count,
    seconds_since,
    year_of,
)
from ..locate import locate
from ..reader import Log
from ..registry import ask, looker
from ..tables.calendar_text import Moments, Pattern, read_moments
from ..tables.table_arrays import MATLAB, tables_of
from ..tables.table_file import FileTable
from .schema_base import KeyCondition, Time


class SourceColumns(NamedTuple):
    """Columns of a table, and notes on rows left out."""

    table: FileTable
    t: Array  # (n,) s
    values: list[Array]  # (n,) each
    notes: list[str]


class Files:
    """The tables that one description names, each read once.

    `epoch` is the time of t = 0, in seconds of GPS time since its zero: that of the description,
    else midnight, UTC, before the first requested time, which is the IMU's; None without an
    absolute clock. `notes` list rows left out of the tables. `later` are the files needed after
    [imu] is read; None: all of them.
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
        self.later: Set[str] | None = None
        self.notes: list[str] = []
        self.epoch = epoch
        self._first: Time | None = None
        self._read: dict[tuple[int, Time], tuple[FileTable, Moments]] = {}
        self._start: float | None = None  # of times of day without a date
        # a description may name one file in several ways
        self._logs = {path.resolve(): log for path, log in (logs or {}).items()}

    def _table(self, file: str, header: bool = True, table: str | None = None) -> FileTable:
        path = self.locate(file)
        same = path.resolve()
        if same in self._logs and header:
            tables = self._logs[same].tables
        else:
            tables = self._open_tables(path, header, table is None)
        if table is None and len(tables) == 1:
            (table,) = tables
        if table is None or table not in tables:
            wrong = "is missing" if table is None else f"{table!r} is not in the file"
            hint = did_you_mean(table, tables) if table is not None else ""
            raise DataError(f"{path}: table: {wrong}{hint}; it has {', '.join(tables) or 'none'}")
        found = tables[table]
        self.notes += [note for note in found.notes if note not in self.notes]
        return found

    def _open_tables(self, path: Path, header: bool, alone: bool) -> Mapping[str, FileTable]:
        """Read the tables of a file; `alone`: the description names none of them."""
        reader = looker(path)
        is_bare = reader.open is None or reader.name == "table"
        if is_bare and (alone or path.suffix.lower() == MATLAB):
            return tables_of(path, header)
        log = self._logs[path.resolve()] = ask(reader, "open", path)
        return log.tables

    def forget(self, file: str) -> None:
        """Release the tables of a file that are not needed later."""
        self._read.clear()
        if self.later is not None and file not in self.later:
            self.table.cache_clear()

    def locate(self, file: str) -> Path:
        """Return the path of `file` in the description."""
        with locate_errors(self.path):
            path = locate(file, self.folder)
            if not in_force().outside and path.resolve() not in self._logs:
                check_inside(path, self.folder)
            return path

    def columns(
        self,
        file: str,
        time: Time,
        columns: Sequence[str | int],
        table: str | None = None,
        where: Sequence[KeyCondition] = (),
    ) -> "SourceColumns":
        """Return columns of one table, without the rows that do not count; columns given by number
        mean that it has no header."""
        named = [time.column, *columns, *(each.column for each in where)]
        found = self.table(file, not any(isinstance(column, int) for column in named), table)
        notes: list[str] = []
        for condition in where:
            found, more = _counting_rows(found, condition)
            notes += more
        return SourceColumns(
            found, self.times(found, time), [found.numbers(column) for column in columns], notes
        )

    def has_rows(
        self,
        file: str,
        columns: Sequence[str | int],
        table: str | None = None,
        where: Sequence[KeyCondition] = (),
    ) -> bool:
        """True where some row of a table counts; `columns` as for the method of that name."""
        named = [*columns, *(each.column for each in where)]
        found = self.table(file, not any(isinstance(column, int) for column in named), table)
        return bool(np.all([holds(found, each) for each in where], axis=0).any())

    def times(self, table: FileTable, time: Time) -> Array:
        """Return the times of the rows of a table (n,), s. Raises DataError where one part of a
        recording has an absolute clock and another does not."""
        if self._first is None:
            self._first = time
            if time.absolute is not None and self.epoch is None:
                t = self._since(0.0, table, time)
                some = t[np.isfinite(t)]
                self.epoch = midnight(_check_gps_time(some[0], table, time)) if len(some) else 0.0
        if time.absolute is None:
            if self._first.absolute is not None:
                raise DataError(
                    f"{table.name}: its time {time.column!r} has no absolute clock, but that of "
                    f"[imu] has {self._first.absolute!r}; give its clock too, or convert both to one"
                )
            if time.format is not None:
                return self._of_day(table, time) + time.offset
            return table.numbers(time.column) * (time.scale * time.unit) + time.offset
        if self.epoch is None:
            raise DataError(
                f"{table.name}: its time {time.column!r} is on the clock {time.absolute!r}, but the zero "
                f"of that of [imu] is unknown; give its clock too, or its zero at the top, "
                f'as epoch = "2024-05-01T12:30:00Z"'
            )
        return self._since(self.epoch, table, time)

    def _since(self, epoch: float, table: FileTable, time: Time) -> Array:
        """Return times on an absolute clock, s since `epoch`, which is in s of GPS time since its
        zero."""
        assert time.absolute is not None
        if time.format is not None:
            minute, second = self._moments(table, time)
            return calendar_seconds(epoch, minute, second, time.absolute) + time.offset
        cells: Any = table.cells(time.column)
        if cells.dtype.kind not in "iu":
            cells = table.numbers(time.column)
        week, unit = time.week, time.scale * time.unit
        if isinstance(week, int):  # that of the first row
            week = week + rollover_count(cells * unit, WEEK)
        elif week is not None:
            week = table.numbers(week)
        return seconds_since(epoch, cells, time.absolute, unit, week) + time.offset

    def _moments(self, table: FileTable, time: Time) -> Moments:
        """Return the calendar times of a table with the day of its `date`. They are read once,
        since gyro and accelerometer share them."""
        key = (id(table.content), time)  # of the rows that count
        if key not in self._read:
            self._read[key] = table, self._read_moments(table, time)
        return self._read[key][1]

    def _read_moments(self, table: FileTable, time: Time) -> Moments:
        of_days, pattern = time.patterns

        def read(column: str | int, pattern: Pattern) -> Moments:
            return read_moments(column, table.cells(column), pattern, table.origin)

        found = read(time.column, pattern)
        if of_days is not None:
            return found._replace(minute=found.minute + read(time.date, of_days).minute)
        if time.date is None:
            return found
        first = float(DAY) * (time.date - date(1970, 1, 1)).days
        return found._replace(
            minute=found.minute + first + DAY * rollover_count(np.add(*found), DAY)
        )

    def _of_day(self, table: FileTable, time: Time) -> Array:
        """Return times of day without a date, s since midnight before the first IMU sample."""
        t = np.add(*self._moments(table, time))
        t += DAY * rollover_count(t, DAY)
        some = t[np.isfinite(t)]
        if self._start is None:
            self._start = some[0] if len(some) else 0.0
        return t + DAY * np.round((self._start - some[0]) / DAY) if len(some) else t


def times_of(table: FileTable, keys: Mapping[str, Any]) -> Array:
    """Return the times of the rows of a table (n,), s, from the key `time` of a section: GPS time
    since its zero on an absolute clock, else as counted, also for a time of week without its
    week."""
    if "week" in keys and keys["week"] is None:
        keys = {key: keys[key] for key in keys if key not in ("clock", "week")}
    return Files("", 0.0).times(table, Time.model_validate(dict(keys)))


def _check_gps_time(gps: float, table: FileTable, time: Time) -> float:
    """Return a first time, s of GPS time since its zero. Raises DataError for an impossible one."""
    year = year_of(gps)
    if not YEARS[0] <= year < YEARS[1]:
        raise DataError(
            f"{table.name}: its first time {time.column!r} is in the year {year:.0f} on the clock "
            f"{time.absolute!r}; check unit, clock and week"
        )
    return gps


def _counting_rows(table: FileTable, condition: KeyCondition) -> tuple[FileTable, list[str]]:
    """(Table of the rows that satisfy the condition, notes on the others). Raises DataError where
    there is none."""
    left_out = ~holds(table, condition)
    if not left_out.any():
        return table, []
    if left_out.all():
        cells = table.cells(condition.column)
        raise DataError(
            f"{table.name}: where: none of its {len(cells)} rows has {condition}; the first has "
            f"{str(cells[0])[:40]!r}: check the key `where`"
        )
    rows = RowsOfFile(table.origin, (np.arange(len(left_out)),), []).without(
        left_out, "row", f"of {len(left_out)} left out, without {condition}"
    )
    return table.take(~left_out), rows.notes


def holds(table: FileTable, condition: KeyCondition) -> Mask:
    """Return True for the rows (n,) that satisfy it; an empty cell never does."""
    found = np.ones(len(table.lines), bool)
    if condition.least is not None or condition.most is not None:
        numbers = table.numbers(condition.column)
        found &= numbers >= (-np.inf if condition.least is None else condition.least)
        found &= numbers <= (np.inf if condition.most is None else condition.most)
    if condition.equals is not None:
        cells = table.cells(condition.column)
        wanted = [each for each in condition.values if not isinstance(each, str)]
        same = np.isin(_as_numbers(cells), np.array(wanted, float))
        if cells.dtype.kind not in "iufb":
            texts = [each for each in condition.values if isinstance(each, str)]
            same |= np.isin([str(each).strip() for each in cells], texts)
        found &= same
    if condition.unequal is not None:
        numbers = table.numbers(condition.column)
        found &= np.isfinite(numbers) & (numbers != condition.unequal)
    if condition.changes:  # the first row counts too
        cells = table.cells(condition.column)
        known = np.flatnonzero(cells == cells)  # NaN is not itself
        changed = cells[known][1:] != cells[known][:-1]
        found &= np.isin(np.arange(len(cells)), known[np.r_[True, changed][: len(known)]])
    return found


def _as_numbers(cells: Any) -> Array:
    """Return cells (n,) as numbers, NaN for others."""
    if cells.dtype.kind in "iuf":
        return np.asarray(cells, float)
    import pandas as pd

    return np.asarray(pd.to_numeric(pd.Series(cells), errors="coerce"), float)
