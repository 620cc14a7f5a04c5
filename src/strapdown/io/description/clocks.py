"""One clock for the tables of several files. The week of a time of week and the day of a time of
day come from another file; device clocks with known zeros are converted to one of them; anything
still unknown becomes a question to the user."""

from collections.abc import Callable, Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...units.time_scales import DAY, WEEK, gps_of, iso
from ..reader import Log, Section
from ..tables.table_file import FileTable
from .schema_base import Time
from .source_files import times_of

HALF_WEEK = timedelta(days=3, hours=12).total_seconds()


class Timed(NamedTuple):
    """A section with its first and last time, s: GPS time since its zero on an absolute clock, else
    as counted."""

    path: Path
    section: Section
    kind: str  # "absolute", "week" without a number, "day" without a date, or "own"
    first: float
    last: float


def table_of(log: Log, section: Section) -> FileTable | None:
    """Return the table that a section names, or the only one."""
    name = section.keys.get("table")
    return log.tables.get(name) if name else next(iter(log.tables.values()), None)


def timed_section(path: Path, log: Log, section: Section) -> Timed | None:
    """Return the section with its times; None without times, or where reading refuses them."""
    keys, table = section.keys.get("time"), table_of(log, section)
    if keys is None or table is None:
        return None
    is_week = "week" in keys and keys["week"] is None
    try:
        time, t = Time.model_validate(keys), times_of(table, keys)
    except (DataError, ValueError):
        return None
    known = t[np.isfinite(t)]
    if not len(known):
        return None
    own_kind = "own" if time.format is None else "day"
    kind = "week" if is_week else own_kind if time.absolute is None else "absolute"
    return Timed(path, section, kind, float(known[0]), float(known[-1]))


class OneClock(NamedTuple):
    """The conversion of the sections of several files to one clock."""

    complete: Callable[[Path, Section], Section]
    asked: Sequence[str] = ()
    assumed: Sequence[str] = ()


def one_clock(
    taken: Sequence[tuple[Path, Section]], logs: Mapping[Path, Log], head: Mapping[str, Any]
) -> OneClock:
    """The clock of sections with their files; `head` has the epoch of the recording."""
    found = [
        each
        for path, section in taken
        if (each := timed_section(path, logs[path], section)) is not None
    ]
    loose = [each for each in found if each.kind == "own"]
    zeros = {each.path: logs[each.path].head.get("epoch") for each in loose}
    unknown = [each for each in loose if zeros[each.path] is None]
    dated = [each for each in loose if zeros[each.path] is not None]
    weeks, asked = _weeks(found, unknown)
    assumed = []
    if unknown and dated and not asked:
        asked = [_of_two(unknown[0], dated[0])]
    elif len(zeros) > 1 and not dated:
        names = ", ".join(path.name for path in zeros)
        assumed = [f"the clocks of {names} count from the same moment"]

    of_imu = next((each for each in found if each.section.of == "imu"), None)
    is_absolute = of_imu is not None and of_imu.kind not in ("own", "day")

    def complete(path: Path, section: Section) -> Section:
        zero = zeros.get(path)
        if zero is not None and is_absolute:
            return _later(section, gps_of(zero), "gps")
        if zero is not None and zero != head.get("epoch"):
            return _later(section, gps_of(zero) - gps_of(head["epoch"]))
        return weeks(section)

    return OneClock(complete, asked, assumed)


def _later(section: Section, seconds: float, clock: str = "") -> Section:
    """Return the section with its times counted from a zero so many seconds earlier, on that
    absolute clock."""

    def set_clock(keys: Mapping[str, Any]) -> dict[str, Any]:
        if "time" not in keys:
            return dict(keys)
        time = {**keys["time"], "offset": keys["time"].get("offset", 0.0) + seconds}
        return {**keys, "time": {**time, "clock": clock} if clock else time}

    keys = _change_times(section.keys, set_clock)
    told = {"time": "to the clock of the IMU, by the UTC of both logs"}
    return section._replace(keys=keys, assumed={**section.assumed, **told})


def _weeks(
    found: Sequence[Timed], unknown: Sequence[Timed]
) -> tuple[Callable[[Section], Section], list[str]]:
    """(function that completes a time of week or of day, open questions)."""
    absolute = next((each for each in found if each.kind == "absolute"), None)
    loose = [each for each in found if each.kind == "own"]
    weeks = [each for each in found if each.kind == "week"]
    days = [each for each in found if each.kind == "day"]
    if absolute is None:
        odd = next((each for each in loose for other in weeks if not _overlap(each, other)), None)
        asked = [] if odd is None else [_of_two(odd, weeks[0])]
        return lambda section: _with_week(section, None, ""), asked
    asked = []
    if unknown:
        asked = [_of_two(unknown[0], absolute)]

    def complete(section: Section) -> Section:
        keys = section.keys.get("time", {})
        day = next((each.first for each in days if each.section.keys["time"] == keys), None)
        if day is not None:
            told = {"time": f"the day of {absolute.path.name}"}
            date = iso(absolute.first - day + 0.5 * DAY)[:10]
            completed = {**section.keys, "time": {**keys, "date": date}}
            return section._replace(keys=completed, assumed={**section.assumed, **told})
        if "week" not in keys or keys["week"] is not None:
            return section
        own = next((each.first for each in weeks if each.section.keys["time"] == keys), 0.0)
        week = int(np.floor((absolute.first - own + HALF_WEEK) / WEEK))
        return _with_week(section, week, f"the week of {absolute.path.name}")

    return complete, asked


def _with_week(section: Section, week: int | None, why: str) -> Section:
    """Return the section with the number of the week, or without an absolute clock where that is
    None."""

    def set_week(keys: Mapping[str, Any]) -> dict[str, Any]:
        time = keys.get("time", {})
        if "week" not in time or time["week"] is not None:
            return dict(keys)
        time = {key: value for key, value in time.items() if key not in ("week", "clock")}
        return {**keys, "time": time if week is None else {**time, "clock": "gps", "week": week}}

    keys = _change_times(section.keys, set_week)
    if keys == section.keys:
        return section
    told = " and ".join(filter(None, [section.assumed.get("time", ""), why]))
    assumed = {**section.assumed, **({"time": told} if told else {})}
    return section._replace(keys=keys, assumed=assumed)


def _change_times(
    keys: Mapping[str, Any], change: Callable[[Mapping[str, Any]], dict[str, Any]]
) -> dict[str, Any]:
    """Return the keys of a section with changed times, including those of a gyro or
    accelerometer."""
    of_signals = {key: change(keys[key]) for key in ("gyro", "accel") if key in keys}
    return change(keys) | of_signals


def _overlap(one: Timed, other: Timed) -> bool:
    return one.first <= other.last and other.first <= one.last


def _of_two(own: Timed, other: Timed) -> str:
    column, there = (each.section.keys["time"]["column"] for each in (own, other))
    moment = f", from {iso(other.first)}," if other.kind == "absolute" else ""
    return (
        f"{own.path}: the zero of its time {column!r} ({own.first:.6g} to "
        f"{own.last:.6g} s) is unknown, but that of {there!r} of {other.path.name}{moment} is known: draft "
        f"with `strapdown inspect ... --write recording.toml` and give the UTC of {column!r} = 0 at its top, "
        f'as epoch = "2024-05-01T12:30:00Z"'
    )
