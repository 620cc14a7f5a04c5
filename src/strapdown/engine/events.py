"""Events of a run as text: rows of the loop's log and runs of rejected measurements become (t,
text)."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from enum import IntEnum
from typing import Any

import numpy as np

from .. import aiding
from ..core.compile.records import copy_row, rows
from ..core.loop.contract import POS, Cursor, Filter
from ..core.loop.integrity import MAX_NIS, MAX_WHITENED
from ..core.loop.log import FOLD, Code, LogRow
from ..core.loop.measurement import LIFT_AFTER, LIFTS, REJECTED
from ..core.loop.stages.disturbed_field import KNOWN_HEADING
from ..core.loop.tables import FixRow
from ..data.solution import Rejected, Source
from ..data.vehicle import Vehicle
from ..typing import Array
from ..units import quantities
from ..units.wording import count_text
from .rejections import runs
from .rejections.contradictions import RejectedRun, plain_run, run_of_plain
from .rejections.sequel import repeated_spans, unresolved_spans
from .rejections.texts import rejection_texts
from .rejections.windows import BEFORE as EARLIER, MAX_BEFORE as MAX_EARLIER, WindowFixes
from .saved_state import put_array

MAX_OF_A_KIND = 20
"""Largest number of separate events of one kind and source; the last one includes all that
follow."""


class Said(IntEnum):
    """Kinds of events that only a stream has: invalid rows, its start, its callback."""

    SAMPLES_NOT_FINITE = 100
    SAMPLES_TWICE = 101
    SAMPLES_LATE = 102
    FIXES_NOT_FINITE = 103
    FIXES_TWICE = 104
    FIXES_LATE = 105
    NO_START = 106
    POOR_START = 107
    CALLBACK = 108
    STOPPED = 109
    AHRS_STOPPED = 110
    AHRS_SAYS = 111
    AHRS_SILENT = 112
    FIXES_AHEAD = 113
    FIXES_OF_WRONG_LENGTH = 114
    SAMPLES_OVERLAP = 115


LONG_LAG = 60.0
"""s: fixes that are further behind or ahead are on another clock."""
SENSORS = ("gyro", "gyro", "gyro", "accelerometer", "accelerometer", "accelerometer")
CLOCKS = "check both clocks"
NED = ("north", "east", "down")


class Events:
    """Events of a run of `filter` with these sources on this vehicle; `take` empties its cursor's
    log."""

    def __init__(self, filter: Filter, sources: Sequence[Source], vehicle: Vehicle) -> None:
        self.rows: list[LogRow] = []
        self.vehicle = vehicle
        self._filter, self._sources = filter, sources
        self.because: dict[int, str] = {}  # by code: text that the message adds
        self.of_ahrs: tuple[str, ...] = ()  # conditions that an AHRS beside the filter may report
        self._counts: dict[tuple[float, float], list[LogRow]] = {}
        self.rejected: list[Rejected] = []  # found by `look_at`
        self.unresolved: list[
            tuple[float, float]
        ] = []  # s: sequels of jumps, drifts and repeated failures
        self._runs: list[RejectedRun] = []  # of fixes that are no longer kept
        self._known = np.full(len(sources), -np.inf)  # s, end of these runs, by source
        self._begin = np.full(len(sources), np.inf)  # s, the first tested fix, by source
        # fixes before those of the history, as `look_at` takes them
        self._earlier: tuple[Any, Array] = rows(FixRow, 0), np.empty((0, 3))

    def take(self, cursor: Cursor) -> None:
        """Take the rows of the log, and empty it."""
        for row in cursor.log[: cursor.state[0].logged]:
            self._fold(row)
        cursor.state[0].logged = 0

    def tell(self, code: int, t: Array, values: Array) -> None:
        """Take events at the times `t` (s), in order, with these values."""
        apart = np.flatnonzero(np.diff(t) > FOLD) + 1
        for some in np.split(np.arange(len(t)), apart) if len(t) else ():
            first, last = t[some[0]], t[some[-1]]
            self._fold(log_row(first, last, code, 0, len(some), values[some].max()))

    def look_at(self, fixes: Any, std: Array, before: float = -np.inf) -> None:
        """Find the runs of rejections in the loop's fixes, a table of FixRow with their standard
        deviations (m, 3). Runs that begin before the time `before` (s) are final."""
        fixes, std = self._with_earlier(fixes, std)
        tested = fixes[np.isfinite(fixes["nis"])]
        np.minimum.at(self._begin, tested["source"].astype(int), tested["t"])
        found = runs.find(WindowFixes(fixes, std, self._known, self._begin), self._sources)
        joined = runs.join_runs(self._runs, found)
        self.rejected = rejection_texts(joined, self._sources)
        own = [s for s, a in enumerate(self._sources) if a.kind in ("position", "velocity")]
        off = [row for row in self.rows if row.code == Code.MEAN_OFF]
        again = repeated_spans((int(row.which) // 3, row.t, row.until) for row in off)
        self.unresolved = unresolved_spans(joined, own) + again
        kept = [run for run in found if run.start < before]
        self._runs = runs.join_runs(self._runs, kept)
        for run in kept:
            self._known[run.source] = max(self._known[run.source], run.stop)
        if len(self._earlier[0]) and before > -np.inf:
            left = self._earlier[0]["t"] >= before
            self._earlier = self._earlier[0][left], self._earlier[1][left]

    def _with_earlier(self, fixes: Any, std: Array) -> tuple[Any, Array]:
        before = self._earlier
        if not len(before[0]):
            return fixes, std
        joined = rows(FixRow, len(before[0]) + len(fixes))
        joined[: len(before[0])], joined[len(before[0]) :] = before[0], fixes
        return joined, np.concatenate([before[1], std])

    def state(self, fixes: Any, std: Array) -> dict[str, Any]:
        """Return the events, with the last of these fixes (as for `look_at`) that runs of
        rejections which go on may need, as `put` takes them."""
        recent, recent_std = self._with_earlier(fixes, std)
        last = recent["t"][-MAX_EARLIER:]
        begin = max(last[0], last[-1] - EARLIER) if len(last) else np.inf
        left = recent["t"] >= begin
        then = copy(self)
        then._known, then._begin = self._known.copy(), self._begin.copy()
        then.look_at(fixes, std, begin)
        return {
            "rows": [[getattr(row, name) for name in LogRow.__annotations__] for row in self.rows],
            "because": [*self.because.items()],
            "runs": [plain_run(run) for run in then._runs],
            "known": then._known,
            "begin": then._begin,
            "fixes": np.ascontiguousarray(recent[left]).view(np.int64),
            "std": recent_std[left],
        }

    def anew(self) -> "Events":
        """Return those of the same filter, sources and vehicle before anything happened."""
        own = Events(self._filter, self._sources, self.vehicle)
        own.of_ahrs = self.of_ahrs
        return own

    def put(self, saved: Mapping[str, Any]) -> None:
        """Go on from a `state`. Raises ValueError, TypeError or KeyError where it is none of these
        sources."""
        self.because = {int(code): str(text) for code, text in saved["because"]}
        self.rows, self._counts = [], {}
        for fields in saved["rows"]:
            t, until, code, which, count, value = map(float, fields)
            row = log_row(t, until, int(code), int(which), int(count), value)
            self.text(row)  # a code or a source that is not there
            self._rows_like(row).append(row)
            self.rows.append(row)
        self._runs = [run_of_plain(run) for run in saved["runs"]]
        put_array(self._known, saved["known"])
        put_array(self._begin, saved["begin"])
        earlier = rows(FixRow, len(saved["std"]))
        std = np.empty((len(earlier), 3))
        put_array(earlier.view(np.int64), saved["fixes"])
        put_array(std, saved["std"])
        if not np.isin(earlier["source"], np.arange(len(self._sources))).all():
            raise ValueError("a source that is not there")
        self._earlier = earlier, std

    def note(self, code: int, which: int, t: float, value: float = 0.0) -> bool:
        """Log an event from outside the loop; return True where it does not continue an earlier
        one."""
        return self._fold(log_row(t, t, code, which, 1, value))

    def new_rows(self, cursor: Cursor, since: int) -> list[LogRow]:
        """Return the rows of the log from number `since` on that do not continue an earlier one,
        and keep them."""
        begun = []
        for k in range(since, int(cursor.state[0].logged)):
            row, before = cursor.log[k], cursor.log[:k]
            alike = self._rows_like(row)
            there = int(((before["code"] == row.code) & (before["which"] == row.which)).sum())
            if there + len(alike) < MAX_OF_A_KIND and (there or not _goes_on(alike, row)):
                begun.append(copy_row(row))
        return begun

    def _rows_like(self, row: LogRow) -> list[LogRow]:
        return self._counts.setdefault((row.code, row.which), [])

    def _fold(self, row: LogRow) -> bool:
        """Take a row as a new event or as part of the last one of its kind; return True for a new
        one."""
        alike = self._rows_like(row)
        if len(alike) == MAX_OF_A_KIND or _goes_on(alike, row):
            _merge(alike[-1], row)
            return False
        alike.append(copy_row(row))
        self.rows.append(alike[-1])
        return True

    def text(self, row: LogRow) -> str:
        """Return the message of a row of the log."""
        which, value = int(row.which), float(row.value)
        return WORDS[int(row.code)](self, row, which, value)

    @property
    def all(self) -> list[tuple[float, str]]:
        """Return [(t, text)] in time order."""
        said = [(float(row.t), self.text(row)) for row in self.rows]
        return sorted(said + [(run.start, str(run)) for run in self.rejected])

    def name(self, s: int) -> str:
        """Return the name of a source as in tables."""
        return self._sources[s].name or self._sources[s].kind

    def component(self, which: int) -> str:
        """Return source and component of a mean, such as "position north"."""
        s, i = divmod(which, 3)
        kind = self._sources[s].kind
        width = len(aiding.find(kind).quantities)
        return f"{self.name(s)} {NED[i]}" if width == 3 else self.name(s)

    def contradiction(self, which: int) -> tuple[int, int, bool]:
        """Return, for two heights that contradict each other, the excluded source, the used source,
        and whether the data decide which one is incorrect."""
        pair, told = divmod(which, 2)
        return *divmod(pair, len(self._sources)), bool(told)

    @property
    def heights_apart(self) -> list[dict[str, Any]]:
        """Return the excluded heights as plain values."""
        return [
            {
                "source": self.name(wrong),
                "other": self.name(other),
                "decided": told,
                "start": float(row.t),
                "stop": float(row.until),
                "difference": float(row.value),
            }
            for row in self.rows
            if row.code == Code.HEIGHT_APART
            for wrong, other, told in [self.contradiction(int(row.which))]
        ]

    def size(self, s: int, value: float) -> str:
        """Return an innovation of source `s` with its unit."""
        unit, shown = quantities.shown_unit(aiding.find(self._sources[s].kind).quantities[0])
        return f"{value * shown:.3g} {unit}"

    @property
    def speed(self) -> str:
        """Text of the vehicle's speed limit."""
        return f"the {self.vehicle.speed:.4g} m/s of {self.vehicle}"

    @property
    def heights(self) -> str:
        """Text of the vehicle's height limits."""
        return f"the {self.vehicle.lowest:.0f} to {self.vehicle.highest:.0f} m of {self.vehicle}"

    @property
    def held(self) -> str:
        """Text on the effect of a gap that is too long to be bridged."""
        return (
            "velocity and attitude held, invalid until the next position fix"
            if POS.start in self._filter.estimates
            else "attitude held"
        )

    def condition(self, which: int) -> str:
        """Return the message of a condition that the filter reports."""
        return self._filter.conditions[which].text


def log_row(t: float, until: float, code: int, which: int, count: int, value: float) -> Any:
    """A row of the log."""
    (row,) = rows(LogRow, 1)
    row.t, row.until, row.code = t, until, code
    row.which, row.count, row.value = which, count, value
    return row


def _goes_on(alike: list[LogRow], row: LogRow) -> bool:
    """True where a row continues the last of these."""
    return bool(alike) and bool(row.t - alike[-1].until <= FOLD)


def _merge(row: LogRow, more: LogRow) -> None:
    row.until = max(row.until, more.until)
    row.count += more.count
    if abs(more.value) > abs(row.value):
        row.value = more.value


def _gap(events: Events, row: LogRow, value: float, what: str) -> str:
    if row.count == 1:
        return f"IMU gap of {value:.3g} s: {what}"
    return f"{row.count:.0f} IMU gaps of up to {value:.3g} s from here to {row.until:.1f} s: {what}"


def _times(row: LogRow) -> str:
    """Return the count and the last time of a repeated event."""
    if row.count == 1:
        return ""
    return f" ({row.count:.0f} times until {row.until:.1f} s)"


def _event_count(row: LogRow, noun: str) -> str:
    return count_text(int(row.count), noun)


def _seconds(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _till(row: LogRow) -> str:
    """Return the end of a lasting event as text."""
    return f" until {row.until:.1f} s" if row.until > row.t else ""


def _missed_text(row: LogRow) -> str:
    return f" ({count_text(int(row.count) - 1, 'event')} since)" if row.count > 1 else ""


def _imu(which: int, value: float) -> tuple[str, str]:
    shown = f"{np.degrees(value):.4g} deg/s" if which < 3 else f"{value:.4g} m/s^2"
    return f"{SENSORS[which]} {'xyz'[which % 3]}", shown


def _out_of_range(events: Events, row: LogRow, which: int, value: float) -> str:
    axis, shown = _imu(which, value)
    most = events.vehicle.acceleration
    bound = "" if which < 3 else f": more than the {most:.4g} m/s^2 of {events.vehicle}"
    return f"{axis} reads {shown}, which is out of range{bound}: bridged{_times(row)}"


def _full_scale(events: Events, row: LogRow, which: int, value: float) -> str:
    axis, shown = _imu(which, value)
    return f"{axis} is at full scale, {shown}: the true value was larger{_times(row)}"


def _stuck_text(events: Events, row: LogRow, which: int, value: float) -> str:
    axis, shown = _imu(which, value)
    return f"{axis} is stuck at {shown}{_till(row)}: check the sensor and its log"


def _coarse(events: Events, row: LogRow, which: int, value: float) -> str:
    return (
        f"specific force changes by {value:.3g} m/s^2 from sample to sample, until "
        f"{row.until:.0f} s: vibration, or a sample rate too low for the motion; velocity errors "
        "exceed the claimed std"
    )


def _at_least(value: float, most: float) -> str:
    """Return a value that is limited to `most` as text."""
    return f"{most:.2g} or more" if value > 0.95 * most else f"{value:.2g}"


def _mean_off(events: Events, row: LogRow, which: int, value: float) -> str:
    return (
        f"{events.component(which)}: fixes are on average {_at_least(abs(value), MAX_WHITENED)} "
        f"standard deviations off the prediction, until {row.until:.0f} s: they drift or jump, or "
        "contradict another source"
    )


def _height_apart(events: Events, row: LogRow, which: int, value: float) -> str:
    wrong, other, told = events.contradiction(which)
    why = (
        "vertical velocity or a third source contradicts it"
        if told
        else f"the data do not show which is incorrect, so the height may be {abs(value):.3g} m off"
    )
    return (
        f"{events.name(wrong)}: its height is left out from here{_till(row)}; it differs by up to {value:+.3g} m "
        f"from that of {events.name(other)}; {why}"
    )


Words = Callable[[Events, LogRow, int, float], str]
WORDS: dict[int, Words] = {
    Code.BRIDGED_GAP: lambda e, row, s, value: _gap(e, row, value, "bridged"),
    Code.HELD_GAP: lambda e, row, s, value: _gap(e, row, value, e.held),
    Code.LIFTED: lambda e, row, s, value: (
        f"{e.name(s)}: gate opened after {REJECTED} or more rejections in a row over "
        f"{LIFT_AFTER:g} s"
    ),
    Code.LEFT_OUT: lambda e, row, s, value: (
        f"{e.name(s)}: left out from here until one of its fixes passes the gate, because opening the "
        f"gate {LIFTS} times did not help"
    ),
    Code.TOO_FAR: lambda e, row, s, value: (
        f"{e.name(s)}: fixes are up to {value / 1000:.4g} km off, farther than {e.vehicle} can move "
        f"at {e.vehicle.speed:.4g} m/s: left out{_times(row)}"
    ),
    Code.DISTURBED: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'field')} left out{_till(row)}, of up to {e.size(s, value)}: "
        "not the Earth's in strength or dip: iron or a current is near, or the magnetometer is not "
        "calibrated"
    ),
    Code.IRON_WAITS: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'field')} left out{_till(row)}: its hard iron is estimated once "
        f"the heading is known to {np.degrees(KNOWN_HEADING):.0f} deg; accelerate, brake or turn"
    ),
    Code.FROZEN: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'reading')} left out{_till(row)}: frozen at one value for up to "
        f"{value:.0f} s; a pitot tube is blocked or iced, or its driver stopped"
    ),
    Code.UNCHECKED: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'reading')} left out{_till(row)}: nothing checks it without "
        "position and velocity, and it contradicted them shortly before; run `strapdown inspect`, and let "
        "the filter estimate its `scale`"
    ),
    Code.HEIGHT_APART: lambda e, row, s, value: _height_apart(e, row, s, value),
    Code.HEIGHT_AGAIN: lambda e, row, s, value: (
        f"{e.name(s)}: its height agrees with the others again and is used"
    ),
    Code.CONTRADICTS: lambda e, row, s, value: (
        f"{e.name(s)}: left out from here{_till(row)}, because it contradicts position and velocity: "
        "check its unit, sign, scale and clock"
    ),
    Code.AGREES_AGAIN: lambda e, row, s, value: (
        f"{e.name(s)}: agrees with position and velocity again and is used"
    ),
    Code.OUT_OF_RANGE: _out_of_range,
    Code.FULL_SCALE: _full_scale,
    Code.STUCK: _stuck_text,
    Code.COARSE: _coarse,
    Code.JITTERED: lambda e, row, s, value: (
        f"time stamps of the IMU jitter by {value:.0%} of their interval, until {row.until:.0f} "
        "s: use the counter of the sensor, or smooth the time stamps"
    ),
    Code.FLOORED: lambda e, row, s, value: (
        f"{e.name(s)}: standard deviations are smaller than any receiver's, {e.size(s, value)}: "
        f"raised{_times(row)}"
    ),
    Code.NO_FIX: lambda e, row, s, value: (
        f"{e.name(s)}: latitude 0 and longitude 0 are not a fix: left out{_times(row)}"
    ),
    Code.TOO_FAST: lambda e, row, s, value: (
        f"{e.name(s)}: {value:.4g} m/s is more than {e.speed}: left out{_times(row)}"
    ),
    Code.TOO_HIGH: lambda e, row, s, value: (
        f"{e.name(s)}: a height of {value:.0f} m is beyond {e.heights}: left out{_times(row)}"
    ),
    Code.MEAN_OFF: _mean_off,
    Code.NIS_OFF: lambda e, row, s, value: (
        f"{e.name(s)}: fixes scatter {_at_least(np.sqrt(value), np.sqrt(MAX_NIS))} times as much "
        f"as their standard deviations predict, until {row.until:.0f} s"
    ),
    Code.BELIEF_TOO_FAST: lambda e, row, s, value: (
        f"the filter's speed of {value:.4g} m/s is more than {e.speed}, until {row.until:.0f} s"
    ),
    Code.BELIEF_TOO_HIGH: lambda e, row, s, value: (
        f"the filter's height of {value:.0f} m is beyond {e.heights}, until {row.until:.0f} s"
    ),
    Code.IN_CONDITION: lambda e, row, s, value: e.condition(s),
    Code.APART: lambda e, row, s, value: (
        f"filter and smoother are up to {value:.2g} standard deviations apart, until "
        f"{row.until:.0f} s: later fixes contradict earlier ones"
    ),
    Code.CLOCK_OFF: lambda e, row, s, value: (
        f"the clock error of {e.name(s)} is estimated as {value:.2g} s, which exceeds the filter's buffer "
        f"of past states, until {row.until:.0f} s: set time.offset"
    ),
    Said.SAMPLES_NOT_FINITE: lambda e, row, s, value: (
        f"IMU: {_event_count(row, 'sample')} with NaN or infinite values dropped{_till(row)}"
    ),
    Said.SAMPLES_TWICE: lambda e, row, s, value: (
        f"IMU: {_event_count(row, 'repeated time')} dropped{_till(row)}"
    ),
    Said.SAMPLES_LATE: lambda e, row, s, value: (
        f"IMU: {_event_count(row, 'late sample')} dropped, up to {value:.3g} s "
        f"behind{_till(row)}: set a longer lag"
    ),
    Said.SAMPLES_OVERLAP: lambda e, row, s, value: (
        f"IMU: {_event_count(row, 'sample')} overlap the one before, by up to {value:.2g} s"
        f"{_till(row)}: the clock of the IMU stepped back and is now early by an unknown time, or `dt` "
        "is too long"
    ),
    Said.FIXES_NOT_FINITE: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'row')} without time or value dropped{_till(row)}"
    ),
    Said.FIXES_OF_WRONG_LENGTH: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'vector')} dropped, whose length differs from that of "
        f"`baseline` by up to {value:.3g} m{_till(row)}"
    ),
    Said.FIXES_TWICE: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'repeated row')} dropped{_till(row)}"
    ),
    Said.FIXES_LATE: lambda e, row, s, value: (
        f"{e.name(s)}: {_event_count(row, 'late row')} dropped, up to {_seconds(value)} s "
        f"behind{_till(row)}: {'set a longer lag' if value < LONG_LAG else CLOCKS}"
    ),
    Said.FIXES_AHEAD: lambda e, row, s, value: (
        f"{e.name(s)}: fixes are up to {_seconds(value)} s ahead of the IMU: "
        f"{'' if value > LONG_LAG else 'samples are missing, or '}{CLOCKS}"
    ),
    Said.NO_START: lambda e, row, s, value: f"no start yet: {e.because[Said.NO_START]}",
    Said.POOR_START: lambda e, row, s, value: (
        f"started with incomplete data: {e.because[Said.POOR_START]}"
    ),
    Said.CALLBACK: lambda e, row, s, value: (
        f"on_event raised {e.because[Said.CALLBACK]}; the callback is not called again{_missed_text(row)}"
    ),
    Said.AHRS_STOPPED: lambda e, row, s, value: e.because[Said.AHRS_STOPPED],
    Said.AHRS_SAYS: lambda e, row, s, value: e.of_ahrs[s],
    Said.AHRS_SILENT: lambda e, row, s, value: (
        f"{e.because[Said.AHRS_SILENT]} gave no attitude for {value:.0f} s, until {row.until:.0f} "
        "s: its samples are missing or implausible"
    ),
    Said.STOPPED: lambda e, row, s, value: e.because[Said.STOPPED].removeprefix("stream "),
}
"""Functions that return the message of each code of the log."""
