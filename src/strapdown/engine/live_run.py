"""A filter that takes one sample at a time and keeps the newest part of its input and output,
enough for a Solution of that part."""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import replace
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError
from ..core.compile.records import place
from ..core.loop import loop
from ..core.loop.contract import (
    STATES,
    Cursor,
    Filter,
    FilterState,
    Imu,
    InitialState,
    Kernels,
    Noise,
    Use,
    bind_kernel,
)
from ..core.loop.cursor import LoopState
from ..core.loop.log import LOG_FULL, LogRow
from ..core.mathematics import solution_row
from ..core.mathematics.rotation import quaternion_to_euler
from ..data.recording import Recording, RecordingMeta
from ..data.solution import Solution, Source, Trajectory
from ..data.value import read_only
from ..data.vehicle import Vehicle
from ..sensor_models.imu import ImuSpec
from ..typing import Array, Notify
from .arrivals import MAX_WAITING_FIXES, Sample, UsableFix
from .events import Events
from .finish import solution, stop_message
from .installation import OfImu
from .plausible_limits import limits
from .prepare import Run, blame, merge, new_belief, new_cursor, new_output, prepare, stages_of
from .saved_state import put_array

ROW, STOP, FIX, FIXES, OUT, FAULT, LOGGED, SHOWN, T = (
    place(LoopState, name)
    for name in ("row", "stop", "fix", "fixes", "out", "fault", "logged", "shown", "t")
)
"""Offsets of these in the memory of a LoopState."""
OF_HISTORY = ("row", "stop", "fix", "fixes", "out")
"""Fields of a LoopState that count rows of the history."""
TELL = 10.0  # s from the first of rejected fixes until their cause is determined


class SetUp(NamedTuple):
    """A filter, with the descriptions of the IMU, the sources and the vehicle."""

    filter: Filter
    noise: Noise
    spec: ImuSpec | None
    options: dict[str, Any]  # the filter's own
    sources: tuple[Source, ...]  # the sources that it uses
    vehicle: Vehicle
    of_imu: OfImu  # estimated parameters of the IMU


class TestedMeasurement(NamedTuple):
    """A measurement with the result of its test.

    Attributes
    ----------
    t : float
        Time of its use, s.
    source : int
        Index of its source.
    y : (3,) array
        Measured values, SI; NaN beyond the last component.
    innovation : (3,) array
        Measured less predicted, SI.
    nis : float
        Normalised innovation squared; NaN where the filter does not gate.
    gate : float
        Bound on it; inf without a gate.
    accepted : bool
        True where the filter used it.
    """

    t: float
    source: int
    y: Array
    innovation: Array
    nis: float
    gate: float
    accepted: bool


class _Room:
    """Memory for samples, fixes and results, and views of it without numpy, whose writing takes a
    third of the time."""

    def __init__(
        self,
        of: SetUp,
        kernels: Kernels,
        belief: FilterState,
        cursor: Cursor,
        rows: int,
        covariance: bool = False,
    ) -> None:
        most = rows + MAX_WAITING_FIXES
        self.imu = Imu(np.empty(rows), np.empty(rows), np.empty((rows, 3)), np.empty((rows, 3)))
        self.fixes = merge(of.sources, of_imu=of.of_imu)._replace(
            t=np.empty(most),
            source=np.zeros(most, np.int64),
            y=np.empty((most, 3)),
            std=np.empty((most, 3)),
        )
        # std of the fixes as received: fixes may wait, and the loop raises a std below the floor
        self.stamp, self.std = np.empty(most), np.empty((most, 3))
        self.waits = self.fixes.sources["delay"].tolist()
        self.out = new_output(of.filter, belief, rows, covariance, most)
        self._of = kernels, belief, of.noise, cursor
        self._bind()

    def _bind(self) -> None:
        """Bind the loop to the arrays, and take views of them."""
        kernels, belief, noise, cursor = self._of
        self.run = bind_kernel(
            loop.run, kernels, belief, self.imu, self.fixes, noise, cursor, self.out
        )
        state: Any = cursor.state
        columns: list[Any] = [state.view(np.int64), state.view(np.float64), *self.imu]
        views: list[Any] = [memoryview(column.reshape(-1)) for column in columns]
        self.state, self.numbers, self.t, self.dt, self.dtheta, self.dv = views
        changing: list[Any] = [*belief, *cursor]
        # the bytes of what a step changes, except the history
        self.changing = [memoryview(column.reshape(-1).view(np.uint8)) for column in changing]

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Room":
        own = object.__new__(type(self))
        memo[id(self)] = own
        for name in ("imu", "fixes", "stamp", "std", "waits", "out", "_of"):
            setattr(own, name, deepcopy(getattr(self, name), memo))
        own._bind()
        return own

    def put(self, fixes: Iterable[UsableFix], k: int) -> None:
        """Write fixes into the rows from `k` on."""
        into = self.fixes
        for fix in fixes:
            t, source, into.y[k], std = fix
            into.t[k], into.source[k], self.stamp[k] = t + self.waits[source], source, t
            into.std[k] = self.std[k] = std
            k += 1
        self.state[FIXES] = k


class LiveRun:
    """A filter from `start` on over the input of `take`, with the last `rows` samples.

    covariance: also keep the covariances of these samples; events: continue these. Raises
    DataError.
    """

    def __init__(
        self,
        set_up: SetUp,
        start: InitialState,
        rows: int,
        covariance: bool = False,
        notify: Notify | None = None,
        events: Events | None = None,
    ) -> None:
        filter, noise, spec, options, sources, vehicle, of_imu = set_up
        self.filter, self.spec, self.options = filter, spec, options
        # the start of the filter, and that of the history
        self.begun = self.start = start
        self.sources = tuple(a._where(np.zeros(len(a.t), bool)) for a in sources)
        self.belief = new_belief(filter, start, noise, options, sources, of_imu)
        self.noise = noise = filter.with_bias_model(noise, options)
        self.cursor = new_cursor(
            filter, start.t, self.sources, limits(spec, noise, vehicle), of_imu
        )
        needed = stages_of(filter, self.sources, of_imu)
        self.kernels = prepare(filter, [a.kind for a in self.sources], notify, needed)
        self.events = events or Events(filter, self.sources, vehicle)
        self.seen = 0  # rows of the log that were examined
        self.forgotten = 0  # times that the older half of the history was dropped
        self._dt = nan  # s, length of the newest sample
        # s, begin of a source's rejections that are not reported yet; the reported ones
        self._refusing: dict[int, float] = {}
        self._told: set[tuple[str, float]] = set()
        self._used = set_up._replace(noise=noise, sources=self.sources)
        self._room = _Room(self._used, self.kernels, self.belief, self.cursor, rows, covariance)
        self._rows = rows

    def run_ahead(self) -> "LiveRun":
        """Return a run from here on with a state of its own, for `look`."""
        own = copy(self)
        tables: list[Any] = [table.copy() for table in self.cursor]
        own.belief, own.cursor = self.copy(), Cursor(*tables)
        own._room = _Room(self._used, self.kernels, own.belief, own.cursor, 1)
        return own

    # ---- samples and fixes

    def take(self, sample: Sample, fixes: Sequence[UsableFix]) -> bool:
        """Run over one sample and the fixes up to its end; return True where the log has new rows.
        Raises DataError where the filter stops."""
        room, state = self._room, self._room.state
        row = state[ROW]
        if row == self._rows or state[FIX] >= self._rows:
            self._forget()
            row = state[ROW]
        if fixes:
            room.put(fixes, state[FIX])
        self._go(room, sample, row)
        return state[LOGGED] > self.seen

    def look(self, sample: Sample, fixes: Sequence[UsableFix]) -> None:
        """Do the same in a run of `run_ahead`, without a history."""
        room, state = self._room, self._room.state
        state[ROW] = state[FIX] = state[FIXES] = state[OUT] = 0
        room.put(fixes, 0)
        self._go(room, sample, 0)

    def _go(self, room: _Room, sample: Sample, row: int) -> None:
        state, dtheta, dv = room.state, room.dtheta, room.dv
        i = 3 * row
        j, k = i + 1, i + 2
        self._dt = sample[1]
        room.t[row], room.dt[row], (dtheta[i], dtheta[j], dtheta[k]), (dv[i], dv[j], dv[k]) = sample
        state[STOP] = row + 1
        try:
            room.run()
        except Exception as error:
            blame(error, self.filter, self.sources)
            raise
        if state[FAULT]:
            raise DataError(f"stream {stop_message(sample[0])}")

    @property
    def t(self) -> float:
        """Time of the filter state, s."""
        t: float = self._room.numbers[T]
        return t

    @property
    def rate(self) -> float:
        """Rate of the IMU, Hz, from its newest sample."""
        return 1 / float(self._dt)

    @property
    def status(self) -> int:
        """Status of the newest row."""
        status: int = self._room.state[SHOWN]
        return status

    def new_events(self) -> list[LogRow]:
        """Rows of the log that began since the last call."""
        begun = self.events.new_rows(self.cursor, self.seen)
        if self.cursor.state[0].logged >= LOG_FULL:
            self.events.take(self.cursor)
        self.seen = int(self.cursor.state[0].logged)
        return begun

    def all_events(self) -> Events:
        """All events so far."""
        self._take_log()
        fix = int(self.cursor.state[0].fix)
        self.events.look_at(self._room.out.fix[:fix], self._room.fixes.std[:fix])
        return self.events

    def _take_log(self) -> None:
        self.events.take(self.cursor)
        self.seen = 0

    def new_rejections(self, fixes: int, over: bool = False) -> list[tuple[float, str]]:
        """Take the `fixes` newest measurements, and return the events of rejections that began at
        least TELL s ago, or of all where the stream is `over`. Each is reported once."""
        rows, refusing = self._room.out.fix, self._refusing
        for row in rows[self._room.state[FIX] - fixes : self._room.state[FIX]]:
            t, s = float(row.t), int(row.source)
            if row.use == Use.REJECTED:
                refusing.setdefault(s, t)
        now = self.t
        due = [s for s, first in refusing.items() if over or now > first + TELL]
        if not due:
            return []
        for s in due:
            del refusing[s]
        new = [
            run for run in self.all_events().rejected if (run.source, run.start) not in self._told
        ]
        self._told |= {(run.source, run.start) for run in new}
        return [(run.start, str(run)) for run in new]

    def tested_after(self, t: float, most: int) -> list[TestedMeasurement]:
        """Return the `most` newest of the measurements in the history that are later than `t` s."""
        fixes, rows = self._room.fixes, self._room.out.fix
        stop = int(self.cursor.state[0].fix)
        first = max(int(np.searchsorted(fixes.t[:stop], t, side="right")), stop - most)
        found = []
        for k in range(first, stop):
            row, source = rows[k], int(fixes.source[k])
            gate = float(fixes.sources["gate"][source])
            values = fixes.y[k].copy(), row.innovation.copy(), float(row.nis), gate
            found.append(TestedMeasurement(float(fixes.t[k]), source, *values, row.use > 0))
        return found

    # ---- history

    def _forget(self) -> None:
        """Drop the older half of the history; the start moves to the beginning of the rest."""
        self.forgotten += 1  # before anything moves
        state, room = self.cursor.state[0], self._room
        imu, fixes, std, out = room.imu, room.fixes, room.std, room.out
        row, fix = int(state.row), int(state.fix)
        end = imu.t[row // 2 - 1] if row == self._rows else -inf
        end = max(end, fixes.t[fix // 2] if fix >= self._rows else -inf) + loop.SAME_TIME
        end = min(end, imu.t[row - 1])
        first = max(int(np.searchsorted(imu.t[:row], end, side="right")), 1)
        first_fix = int(np.searchsorted(fixes.t[:fix], imu.t[first - 1] + loop.SAME_TIME, "right"))
        self.start = start_at(out.nav[first - 1])
        self.events.look_at(out.fix[:fix], fixes.std[:fix], float(imu.t[first - 1]))
        by_sample: list[Any] = [*imu, out.nav]
        by_fix: list[Any] = [fixes.t, fixes.source, fixes.y, fixes.std, room.stamp, std, out.fix]
        for column in [*by_sample, out.covariance] if len(out.covariance) else by_sample:
            column[: row - first] = column[first:row].copy()
        for column in by_fix:
            column[: fix - first_fix] = column[first_fix:fix].copy()
        state.row = state.out = row - first
        state.fix = state.fixes = fix - first_fix

    @property
    def samples(self) -> Imu:
        """The kept samples."""
        row = int(self.cursor.state[0].row + self.cursor.state[0].fault)
        return Imu(*(read_only(column[:row].copy()) for column in self._room.imu))

    def recording(self, meta: RecordingMeta) -> Recording:
        """Return the kept samples and fixes."""
        return self._recording(self.samples, meta)

    def _recording(self, samples: Imu, meta: RecordingMeta) -> Recording:
        fixes, stamp, std = self._room.fixes, self._room.stamp, self._room.std
        kept = slice(0, int(self.cursor.state[0].fixes))
        sources = []
        for s, a in enumerate(self.sources):
            mine, width = np.flatnonzero(fixes.source[kept] == s), a.y.shape[1]
            sources.append(
                replace(a, t=stamp[mine], y=fixes.y[mine, :width], std=std[mine, : a.std.shape[1]])
            )
        return Recording(samples, tuple(sources), meta=meta)

    def solution(self, every: int, meta: RecordingMeta) -> Solution:
        """Return the Solution of the history, each n-th row and the last."""
        return solution_of(self.history(meta), every)

    def history(self, meta: RecordingMeta) -> Run:
        """Return the history as a run for `solution_of`. Its samples and results are views, which
        hold as long as `forgotten` stays."""
        self._take_log()
        state, room = self.cursor.state[0], self._room
        row, fix, out = int(state.row), int(state.fix), int(state.out)
        samples = Imu(*(read_only(column[: row + int(state.fault)]) for column in room.imu))
        recording = self._recording(samples, meta)
        fixes = room.fixes._replace(
            t=room.fixes.t[:fix],
            source=room.fixes.source[:fix],
            y=room.fixes.y[:fix],
            std=room.fixes.std[:fix],
        )
        results = room.out._replace(
            nav=room.out.nav[:out],
            covariance=room.out.covariance[:out],
            fix=room.out.fix[:fix].view(np.ndarray),
        )
        return Run(
            recording,
            samples,
            self.filter,
            self.kernels,
            self.start,
            self.noise,
            self.spec,
            self.copy(),
            fixes,
            self.cursor,
            results,
            0,
            self.options,
            self.events,
        )

    def newest(self) -> Trajectory:
        """Return the newest row in the form of a Solution."""
        row = self._room.out.nav[self._room.state[OUT] - 1]
        std = row[None, solution_row.STD : solution_row.ROW_STATUS].copy()
        std[:, [i for i in range(STATES) if i not in self.filter.states]] = np.nan
        parts = (
            solution_row.T,
            solution_row.LLA,
            solution_row.V,
            solution_row.Q,
            solution_row.BIASES,
        )
        lla, v, q = (row[None, a:b].copy() for a, b in zip(parts[1:], parts[2:]))
        return Trajectory(row[:1].copy(), lla, v, q, std)

    # ---- state

    def state(self) -> dict[str, Any]:
        """Return everything that the run needs to go on, except the history, as `put` takes it."""
        events, state = self.all_events(), self.cursor.state[0]
        row, fix = int(state.row), int(state.fix)
        end = start_at(self._room.out.nav[row - 1]) if row else self.start
        tables = self.cursor._replace(state=self.cursor.state.copy())
        for field in OF_HISTORY:
            tables.state[field] = 0
        return {
            "begun": self.begun,
            "start": end,
            "belief": [column.copy() for column in self.belief],
            "cursor": [table.view(np.int64).copy() for table in tables],
            "dt": self._dt,
            "refusing": [*self._refusing.items()],
            "told": [*self._told],
            "events": events.state(self._room.out.fix[:fix], self._room.fixes.std[:fix]),
        }

    def put(self, saved: Mapping[str, Any]) -> None:
        """Go on from a `state`, with a history that begins there. Raises ValueError, TypeError or
        KeyError where it is none of this filter and these sources."""
        address = self.cursor.state[0].save_step
        for column, before in zip(self.belief, saved["belief"], strict=True):
            put_array(column, before)
        for table, before in zip(self.cursor, saved["cursor"], strict=True):
            put_array(table.view(np.int64), before)
        state = self.cursor.state[0]
        state.save_step = address
        if not (
            0 <= state.logged < LOG_FULL and 0 <= state.latest < max(len(self.cursor.recent), 2)
        ):
            raise ValueError("a row that is not there")
        self.start, self._dt = start_of(saved["start"]), float(saved["dt"])
        self._refusing = {int(s): float(t) for s, t in saved["refusing"]}
        self._told = {(str(name), float(t)) for name, t in saved["told"]}
        self.events.put(saved["events"])

    def snapshot(self) -> list[Any]:
        """Return copies of everything that a step changes, except the history."""
        return [*map(bytes, self._room.changing), self._dt]

    def restore(self, snapshot: Sequence[Any]) -> None:
        """Go back to a `snapshot`."""
        *contents, self._dt = snapshot
        for memory, before in zip(self._room.changing, contents, strict=True):
            memory[:] = before

    def copy(self) -> FilterState:
        """Return a copy of the filter state."""
        return FilterState(*(column.copy() for column in self.belief))


def solution_of(history: Run, every: int) -> Solution:
    """Return the Solution of a `LiveRun.history`, each n-th row and the last, in memory of its own."""
    out, state = history.out, history.cursor.state.copy()
    samples = Imu(*(read_only(column.copy()) for column in history.samples))
    rows = slice((len(out.nav) - 1) % every, None, every)
    out = out._replace(
        nav=out.nav[rows].copy(),
        covariance=out.covariance[rows].copy(),
        fix=out.fix.copy().view(np.recarray),
    )
    state[0].out = len(out.nav)
    return solution(
        history._replace(
            recording=replace(history.recording, imu=samples),
            samples=samples,
            cursor=history.cursor._replace(state=state),
            out=out,
        )
    )


def start_of(saved: Any) -> InitialState:
    """Return an InitialState from its fields as JSON has them."""
    fields: list[Any] = [tuple(part) if isinstance(part, list) else part for part in saved]
    return InitialState(*fields)


def start_at(row: Array) -> InitialState:
    """Return the InitialState from a row of the output, without correlations."""
    t, rph_now = (
        float(row[solution_row.T]),
        quaternion_to_euler(row[solution_row.Q : solution_row.BIASES]),
    )
    parts = np.r_[
        row[solution_row.LLA : solution_row.Q],
        rph_now,
        row[solution_row.BIASES : solution_row.ROW_STATUS],
    ].tolist()
    lla, v, rph, b_a, b_g = (tuple(parts[k : k + 3]) for k in range(0, 15, 3))
    note = f"state of the filter at {t:.2f} s"
    return InitialState(t, lla, v, rph, b_a, b_g, tuple(parts[15:]), note)
