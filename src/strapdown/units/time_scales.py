"""Absolute clocks: GPS time, which runs on through leap seconds, and UTC with its POSIX seconds.

Leap seconds come from the table of the time zone database (the package tzdata), so that an update
of that package brings a new one.
"""

import re
from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.resources import files
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..checks import DataError, is_number, locate_errors
from ..typing import Array, ArrayLike, Mask

Moment: TypeAlias = float | str | datetime | np.datetime64
"""A time as a user gives it: s of a recording, or a date in UTC."""
GPS_ZERO = 315964800
"""POSIX seconds at 1980-01-06 00:00:00 UTC, from which GPS time counts."""
DAY = 86400
"""s"""
WEEK = 7 * DAY
YEARS = (1970, 2200)
"""Years of the times that are believed: others have a wrong unit or clock, and beyond 2262 there is no
datetime64[ns]."""
CLOCKS = ("gps", "unix")
"""Absolute clocks that a description can name: seconds of GPS time since its zero, POSIX seconds."""


@cache
def leap_seconds() -> tuple[Array, Array]:
    """(POSIX seconds from which it holds (n,), GPS time less UTC in s (n,)), from 1980 on."""
    text = files("tzdata").joinpath("zoneinfo", "leapseconds").read_text(encoding="utf-8")
    days = re.findall(r"^Leap\s+(\d{4}\s+\w{3}\s+\d+)\s+23:59:60\s+\+", text, re.MULTILINE)
    starts = [
        (datetime.strptime(" ".join(day.split()), "%Y %b %d") + timedelta(days=1))
        .replace(tzinfo=UTC)
        .timestamp()
        for day in days
    ]
    since = np.array([GPS_ZERO, *(each for each in starts if each > GPS_ZERO)], float)
    return since, np.arange(len(since), dtype=float)


def gps_from_unix(t: ArrayLike) -> Array:
    """Seconds of GPS time since its zero, of POSIX seconds. Before 1980 there were no leap
    seconds to it."""
    since, ahead = leap_seconds()
    t = np.asarray(t, float)
    return t - GPS_ZERO + ahead[np.maximum(np.searchsorted(since, t, side="right") - 1, 0)]


def unix_from_gps(t: ArrayLike) -> Array:
    """POSIX seconds of seconds of GPS time since its zero."""
    since, ahead = leap_seconds()
    t = np.asarray(t, float)
    return (
        t
        + GPS_ZERO
        - ahead[np.maximum(np.searchsorted(since - GPS_ZERO + ahead, t, side="right") - 1, 0)]
    )


def gps_of(epoch: str | datetime) -> float:
    """Seconds of GPS time since its zero at an epoch, as ISO 8601 text or datetime; UTC where it
    names no zone. Raises DataError."""
    if not isinstance(epoch, datetime):
        try:
            epoch = datetime.fromisoformat(epoch)
        except (TypeError, ValueError):
            raise DataError(
                f'{epoch!r:.40} is no time; write it as "2024-05-01T12:30:00Z"'
            ) from None
    if not YEARS[0] <= epoch.year < YEARS[1]:
        raise DataError(f"{str(epoch)!r:.40} is no time between {YEARS[0]} and {YEARS[1]}")
    if epoch.tzinfo is None:
        epoch = epoch.replace(tzinfo=UTC)
    return float(gps_from_unix(epoch.timestamp()))


def year_of(gps: float) -> float:
    """The year, roughly, of seconds of GPS time since its zero."""
    return 1980.0 + gps / 31556952


def iso(gps: float) -> str:
    """ISO 8601 text in UTC of seconds of GPS time since its zero, to the microsecond. Raises
    DataError where the calendar has no such moment."""
    try:
        seconds = timedelta(seconds=round(float(unix_from_gps(gps)), 6))
        moment = datetime.fromtimestamp(0, UTC) + seconds
    except (OverflowError, ValueError):
        raise DataError(
            f"a time {gps:.3g} s after 1980 is in no calendar; check unit and clock of the time"
        ) from None
    return moment.isoformat().replace("+00:00", "Z")


def utc(epoch: str, t: ArrayLike) -> NDArray[np.datetime64]:
    """UTC as datetime64[ns] (n,) of times t (n,), s since an `epoch` as ISO 8601 text; NaT where t is
    not finite or more than 150 years away. Leap seconds between the two are counted; within one, that
    second is shown twice.

    Raises DataError where the epoch is no time.
    """
    zero, t = gps_of(epoch), np.asarray(t, float)
    known = np.abs(t) < 150 * 31556952
    t = np.where(known, t, 0.0)
    unix = unix_from_gps(zero)
    # leap seconds and the epoch apart, so that nanoseconds of t stay
    leaps = np.round(t + zero - unix_from_gps(zero + t) - (zero - unix))
    start = np.datetime64("1970-01-01", "ns") + np.timedelta64(
        round(float(unix) * 1e6) * 1000, "ns"
    )
    found = start + np.round((t - leaps) * 1e9).astype("m8[ns]")
    return np.where(known, found, np.datetime64("NaT", "ns"))


def seconds_to(moment: Moment, epoch: str | None, what: str) -> float:
    """s at which `moment` is: itself where it is a number of s, else a date (ISO 8601 text, datetime
    or datetime64), UTC, counted from an `epoch`.

    Raises DataError, which names `what`, where it is none, or a date without an epoch.
    """
    if is_number(moment):
        if np.isnan(moment):
            raise DataError(f"{what}: nan is no time; give seconds")
        return float(moment)
    if isinstance(moment, np.datetime64):
        moment = moment.astype("M8[us]").item()
    if not isinstance(moment, (str, datetime)):
        raise DataError(f"{what}: {moment!r:.40} is no time; give seconds, or a date")
    if epoch is None:
        raise DataError(
            f"{what}: {str(moment)!r:.40} is a date, and the clock is not absolute; give seconds"
        )
    with locate_errors(what):
        ahead, zero = gps_of(moment), gps_of(epoch)
    # microseconds and leap seconds apart: seconds since 1980 as floats are not as fine
    start, stop = (_as_utc(each) for each in (epoch, moment))
    passed = (stop - start).total_seconds()
    return passed + round(ahead - zero - passed)


def _as_utc(moment: str | datetime) -> datetime:
    """A time that `gps_of` takes, in UTC."""
    made = moment if isinstance(moment, datetime) else datetime.fromisoformat(moment)
    return made.replace(tzinfo=UTC) if made.tzinfo is None else made.astimezone(UTC)


def within(t: Array, start: float, stop: float, what: str) -> Mask:
    """Which of the times t (n,), s, lie from start to stop, both included. Raises DataError, which
    names `what`, where none does."""
    taken: Mask = (t >= start) & (t <= stop)
    if not taken.any():
        covers = f"it covers {t[0]:.3f} to {t[-1]:.3f} s" if len(t) else "it has none at all"
        raise DataError(f"{what}: no rows from {start:g} to {stop:g} s; {covers}")
    return taken


def ends(
    start: Moment | None, stop: Moment | None, epoch: str | None, what: str
) -> tuple[float, float]:
    """First and last time of a part, s: each as `seconds_to` takes it, open where it is None. Raises
    DataError, which names `what`."""
    first = -np.inf if start is None else seconds_to(start, epoch, what)
    last = np.inf if stop is None else seconds_to(stop, epoch, what)
    if first > last:
        raise DataError(f"{what}: {first:g} s is after {last:g} s; write the earlier time first")
    return first, last


def iso_text(moments: NDArray[np.datetime64], decimals: int) -> NDArray[np.bytes_]:
    """ISO 8601 text in UTC of datetime64 (n,), as `2024-05-01T12:30:00.250Z` with that many digits,
    3, 6 or 9; empty where there is none."""
    unit: Any = {3: "ms", 6: "us", 9: "ns"}[decimals]
    half = np.timedelta64(10 ** (9 - decimals) // 2, "ns")
    text = np.datetime_as_string((moments + half).astype(f"M8[{unit}]"), unit=unit).astype("S")
    return np.where(np.isnat(moments), b"", np.char.add(text, b"Z"))


def span(moments: NDArray[np.datetime64]) -> str:
    """First and last of datetime64 (n,) for people, `2024-05-01 12:30:00.0 to 12:40:00.0 UTC`."""
    known = moments[~np.isnat(moments)]
    if not len(known):
        return "no time"
    tenth = np.timedelta64(50, "ms")
    first, last = (
        str((each + tenth).astype("M8[ms]")).replace("T", " ")[:-2] for each in known[[0, -1]]
    )
    return f"{first} to {last[11:] if first[:10] == last[:10] else last} UTC"


def days_of(year: Array, month: Array, day: Array) -> Array:
    """Days since 1970-01-01 of dates (n,); NaN where the calendar has no such day."""
    with np.errstate(invalid="ignore"):
        fits = (np.abs(year) < 1e5) & (month >= 1) & (month <= 12) & (day >= 1)
    months = np.where(fits, 12 * (year - 1970) + month - 1, 0).astype(np.int64)
    first, following = (
        each.astype("M8[M]").astype("M8[D]").astype(np.int64) for each in (months, months + 1)
    )
    days = first + day - 1
    return np.where(fits & (days < following), days, np.nan)


def midnight(gps: float) -> float:
    """The last midnight, UTC, before a moment, both in seconds of GPS time since its zero."""
    return float(gps_from_unix(np.floor(unix_from_gps(gps) / DAY) * DAY))


def calendar_seconds(epoch: float, minute: Array, second: Array, clock: str) -> Array:
    """Seconds since `epoch` (seconds of GPS time since its zero) of times by the calendar: begins
    of minutes, s since 1970-01-01 without leap seconds, and seconds, a leap second being the
    60th. The calendar is that of UTC, or of GPS time with the clock "gps"."""
    start = minute - GPS_ZERO if clock == "gps" else gps_from_unix(minute)
    return start - epoch + second


def seconds_since(epoch: float, t: Any, clock: str, unit: float, week: Any = None) -> Array:
    """t (n,) in units of `unit` s on an absolute clock, as seconds since `epoch` (seconds of GPS
    time since its zero).

    Of clock "gps", t counts from the week `week` where that is given. Whole numbers are subtracted
    as such, because POSIX nanoseconds do not fit a float.
    """
    t = np.asarray(t)
    offset: Any
    if clock == "unix":
        whole = t.astype(float) * unit
        ahead = gps_from_unix(whole) - whole
        steady = np.where(np.isfinite(ahead), np.round(ahead), 0.0)
        offset = steady - epoch
    else:
        offset = (0.0 if week is None else np.asarray(week, float) * WEEK) - epoch
    if t.dtype.kind in "iu" and len(t):
        # whole seconds apart: a difference of times may be beyond their type
        wide = t.astype(np.uint64 if t.dtype.kind == "u" else np.int64)
        per_second = max(round(1 / unit), 1)
        second, rest = np.divmod(wide, wide.dtype.type(per_second))
        first, second = float(second[0]), second.astype(float)
        step = per_second * unit
        return (second - first) * step + rest * unit + (first * step + offset)
    return t.astype(float) * unit + offset


def rate_of(t: ArrayLike, unit: float = 1.0) -> float:
    """Hz of times in units of `unit` s: 1 / their median interval; 0 of fewer than two."""
    t = np.asarray(t)
    steps = np.diff(t.astype(np.int64) if t.dtype.kind == "u" else t)
    if (steps < 0).any():
        steps = np.diff(np.sort(t))
    steps = steps[steps > 0]
    return 1 / (unit * float(np.median(steps))) if len(steps) else 0.0


def rollover_count(t: Array, period: float) -> Array:
    """Whole periods (n,) that a clock has counted which begins anew after `period`, such as a time
    of day or of the week; NaN are passed over.

    A step back by more than half a period is a new one. Rows out of order at its begin step
    forward by nearly all of it, and belong to the one before; a shorter step forward is a pause.
    """
    count = np.zeros(len(t))
    known = np.flatnonzero(np.isfinite(t))
    step = np.diff(t[known])
    count[known[1:]] = np.cumsum(1.0 * (step < -0.5 * period) - 1.0 * (step > 0.99 * period))
    return count
