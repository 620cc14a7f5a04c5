"""The time columns of a table and their clock, from names, magnitudes and content."""

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...typing import Array
from ...units.conversion import UNITS
from ...units.time_scales import DAY, GPS_ZERO, WEEK
from ..tables.calendar_text import Pattern, moments, patterns
from .column_names import ColumnNames, plain

TIME = (
    r"(?!.*(acc|offset|bias|drift|zone|valid|uncert))(t|ts|clock|[mun]s|milli(s|seconds?)|micro(s|seconds?)|zeit|zeitstempel|t_?stamp|seconds?|elapsed|epoch|i_?tow|tow|sow|gwk|gps_?sec|gps_?s|"
    r"unix|posix|utc|iso|stamp|date_?time|[a-z]{0,8}_?(time|timestamp|time_?stamp)(_?(of_?week|utc|gps|unix|us|ms|ns|s))?)"
)
OF_WEEK = r"(i_?tow|(gps_?)?(tow|sow|sec(onds?)?|s)(_?(of_?week))?|gms|(gps_?)?time_?of_?week)"
WEEK_NUMBER = r"((gps_?)?(week|wn|wk|week_?(no|num|number))|gwk)"
DATE = r"((utc|gps)_?)?(date|day|datum)"
CLOCK = r"((utc|gps|local)_?)?(time|time_?of_?day|tod|clock|utc|uhrzeit|zeit)"
GPS_NAME = r".*gps.*"
GPS_TIME = r"gps_?time"
AFTER = r"([_ .,\[(].*)?"
"""Words that may follow a name."""
UNIX_UNITS = ("s", "ms", "us", "ns")
MAX_INTERVALS = (float(DAY), 100.0)
"""s: largest interval of fixes, and of IMU samples; a unit that gives a larger one is excluded."""
MIN_UNIX = 0.95e9
"""POSIX seconds of the year 2000; a clock that counts from switch-on never reaches it."""
FORMATS = (
    "iso",
    "%d.%m.%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%Y.%m.%d %H:%M:%S",
    "%d/%m/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S",
    "%d-%m-%Y %H:%M:%S",
    "%d%m%y %H%M%S",
    "%Y%m%d %H%M%S",
)
OF_DAY = "%H:%M:%S"
"""A time of day without a date; the date may come from another file."""
DAYS = 2
"""Number of formats (the first ones) with an all-digit date that are tried in a single column."""


class ColumnClock(NamedTuple):
    """The time of a table as keys of a description. A `week` of None is unknown: the column is the
    time of week, and the week may come from another file."""

    keys: dict[str, Any]
    fact: str
    assumed: str = ""


def find_clock(columns: ColumnNames, is_imu: bool) -> ColumnClock | None:
    """The ColumnClock of a table, or None where no column is named like a time."""
    day, clock = columns.find(DATE), columns.find(CLOCK)
    if day and clock and (form := _format(columns, clock, day)):
        keys = {"column": clock, "date": day, "format": form} | _scale(clock)
        return ColumnClock(keys, f"time: {day!r} and {clock!r}, {_scale_name(keys)}")
    name = columns.find(TIME)
    if name is None and (name := columns.find(OF_WEEK)) is None:
        return _by_content(columns, is_imu)
    if columns.table.content[name].dtype.kind not in "iuf":
        form = _format(columns, name)
        if form is None:
            raise DataError(_of_no_form(columns, name))
        if form == OF_DAY:
            return ColumnClock(
                {"column": name, "format": form}, f"time: {name!r}, time of day, UTC"
            )
        keys = {"column": name, "format": form} | _scale(name)
        why = "" if "%d/%m" not in form else "days before months"
        return ColumnClock(keys, f"time: {name!r}, {_scale_name(keys)}", why)
    return _number_clock(columns, name, is_imu)


def _by_content(columns: ColumnNames, is_imu: bool) -> ColumnClock | None:
    """Return the ColumnClock of the first column that holds POSIX times or dates, whatever its
    name."""
    for name in columns.names:
        if columns.table.content[name].dtype.kind not in "iuf":
            form = _format(columns, name)
            if form:
                keys = {"column": name, "format": form}
                return ColumnClock(keys, f"time: {name!r}, UTC", "by its content")
        else:
            t = columns.numbers(name)
            steps = np.diff(t[np.isfinite(t)])
            if len(steps) and steps.min() >= 0 and (unit := _unix_unit(t, UNIX_UNITS, is_imu)):
                keys = {"column": name, "unit": unit, "clock": "unix"}
                fact = f"time: {name!r} in {unit}, POSIX time, UTC"
                return ColumnClock(keys, fact, "by its content")
    return None


def _unix_unit(t: Array, units: Iterable[str], is_imu: bool) -> str | None:
    """Return the unit in which a column (n,) counts from 1970, or GPS time from 1980, with
    intervals that suit the table; None where there is none."""
    known = t[np.isfinite(t)]
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    for unit in units:
        size = UNITS["time"][unit]
        longest = MAX_INTERVALS[is_imu]
        if len(known) and MIN_UNIX <= known[0] * size < 3e9 and step * size < longest:
            return unit
    return None


def _number_clock(columns: ColumnNames, name: str, is_imu: bool) -> ColumnClock:
    """The Clock of a column of numbers."""
    week = columns.find(WEEK_NUMBER)
    of_week = columns.find(OF_WEEK) if week else None
    if week and of_week:
        name = of_week
    t = columns.numbers(name)
    named = columns.unit(name, ("ns", "us", "ms", "s"))
    known = t[np.isfinite(t)]
    first = float(known[0]) if len(known) else 0.0
    if unit := _unit_of_week(name, t, named, is_imu):
        keys = {"column": name, "unit": unit, "clock": "gps", "week": week}
        return ColumnClock(
            keys, f"time: {name!r} in {unit} of the GPS week" + f" {week!r}" * bool(week)
        )
    absolute = _unix_unit(t, [named] if named else UNIX_UNITS, is_imu)
    if absolute:
        seconds = first * UNITS["time"][absolute]
        is_gps = bool(re.fullmatch(GPS_NAME, plain(name)))
        keys = {"column": name, "unit": absolute, "clock": "gps" if is_gps else "unix"}
        which = "GPS time since 1980" if is_gps else "POSIX time, UTC"
        sure = "" if is_gps or seconds > MIN_UNIX + GPS_ZERO else "or GPS time since 1980"
        return ColumnClock(keys, f"time: {name!r} in {absolute}, {which}", sure)
    unit = named or _unit_by_interval(t, is_imu)
    why = "" if named or unit == "s" else "from the interval of its rows"
    return ColumnClock({"column": name, "unit": unit}, f"time: {name!r} in {unit}", why)


def _unit_of_week(name: str, t: Array, named: str | None, is_imu: bool) -> str | None:
    """Return the unit of a column (n,) of times of week, from name and magnitude; None for other
    columns."""
    known = t[np.isfinite(t)]
    called = plain(name)
    if not len(known) or known.min() < 0:
        return None
    unit = named or ("ms" if known.max() > WEEK * 1.01 else "s")
    if named is None and re.match("i_?tow", called) and _unit_by_interval(t, is_imu) == "ms":
        unit = "ms"
    size = UNITS["time"][unit]
    if known.max() * size > WEEK * 1.01:
        return None
    if re.fullmatch(OF_WEEK + AFTER, called):
        return unit
    late = (
        re.fullmatch(GPS_TIME + AFTER, called) and known.min() * size > DAY
    )  # smaller numbers may count from switch-on
    return unit if late else None


def _unit_by_interval(t: Array, is_imu: bool) -> str:
    interval = float(np.median(np.diff(t[np.isfinite(t)]))) if np.isfinite(t).sum() > 1 else 0.01
    for unit, least in (
        ("ns", 1e6 if is_imu else 3e7),  # 1 Hz fixes in us must not pass for 1 kHz fixes in ns
        ("us", 1e3 if is_imu else 1e4),
        ("ms", 1.0 if is_imu else 20.0),
    ):
        if interval >= least:
            return unit
    return "s"


def _format(columns: ColumnNames, name: str, day: str | None = None) -> str | None:
    """The first of the formats that all of the first and last rows are written in."""
    frame = columns.table.frame[[name, day] if day else [name]].dropna()
    frame = (
        frame.iloc[np.unique(np.linspace(0, len(frame) - 1, 400).astype(int))]
        if len(frame)
        else frame
    )
    if not len(frame):
        return None
    for form in FORMATS if day else (*FORMATS[:-DAYS], OF_DAY):
        try:
            of_days, of_times = patterns(form, "column" if day else "")
        except ValueError:
            continue
        read = [(name, of_times), *([(day, of_days)] if day and of_days else [])]
        if all(_is_written(frame[each].to_numpy(), pattern) for each, pattern in read):
            return form
    return None


def _of_no_form(columns: ColumnNames, name: str) -> str:
    """Return the message on a text column that holds no times; where most cells are numbers, it
    names the cell that is not."""
    table = columns.table
    numbers, known = columns.numbers(name), table.cells_filled(name)
    odd = np.flatnonzero(known & ~np.isfinite(numbers))
    if 0 < len(odd) < np.isfinite(numbers).sum():
        return (
            f"{table.origin.row(int(odd[0]))}, column {name!r}: {table.cells(name)[odd[0]]!r} is not a "
            f"number; correct the cell or leave it empty"
        )
    return (
        f"{table.name}: {name!r} begins with {table.frame[name].iloc[0]!r}, whose time format is "
        f"unknown; give its `format` in a recording.toml"
    )


def _is_written(cells: Any, pattern: Pattern) -> bool:
    """Return True where all cells are times of a pattern and after 1970; the digits of 010524 could
    otherwise mean the year 1."""
    found, wrong = moments(cells, pattern)
    return not wrong.any() and bool(np.all(found.minute >= 0))


def _scale(name: str) -> dict[str, str]:
    return {"clock": "gps"} if re.fullmatch(GPS_NAME, plain(name)) else {}


def _scale_name(keys: dict[str, Any]) -> str:
    return "GPS time" if keys.get("clock") == "gps" else "UTC"
