"""From a Recording and a filter to a Solution: `prepare` compiles what a run needs, `fuse` runs a recording, `Stream` runs it live."""
import inspect
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from . import aiding, filters
from .core import loop
from .core.contract import COMPILED, PARAMETERS, Cursor, Fixes, Imu, Output, address, compile_kernel, entry_point, is_cached
from .data import DataError, Innovations, Solution, Trajectory

CHUNK = 65536 if COMPILED else 500
"""IMU rows between two looks at the keyboard and the progress bar."""
GATES = {1: 10.828, 2: 13.816, 3: 16.266}
"""Bound on the NIS by number of rows: 0.1 % of right fixes are rejected (chi-square quantiles)."""


class Prepared(NamedTuple):
    """A filter and the addresses of its compiled kernels."""
    filter: filters.Filter
    predict: int
    correct: int
    observers: np.ndarray   # by kind; 0 where the run has no such source


def prepare(filter, kinds, say=None):
    """Compile (or load from the cache) the kernels of `filter` and of the aiding `kinds`. `say` is told once where that takes seconds."""
    try:
        filter = filters.find(filter)
        sensors = [aiding.find(kind) for kind in dict.fromkeys(kinds)]
    except ValueError as error:
        raise DataError(str(error)) from None
    kernels = [filter.predict, filter.correct, loop.run, *(sensor.observe for sensor in sensors)]
    if say and not all(is_cached(kernel) for kernel in kernels):
        say("compiling the filter for the first time on this machine, about 15 s ...")
    for kernel in kernels:
        compile_kernel(kernel)
    observers = np.zeros(len(aiding.sensors()), np.int64)
    for sensor in sensors:
        observers[sensor.kind] = address(sensor.observe)
    return Prepared(filter, address(filter.predict), address(filter.correct), observers)


def merge(aidings, after=-np.inf):
    """All fixes later than `after` in time order (Fixes), simultaneous ones in the order of `aidings`."""
    sensors = [aiding.find(a.kind) for a in aidings]
    count = len(aidings)
    t = np.concatenate([np.asarray(a.t, float) for a in aidings] or [np.empty(0)])
    source = np.repeat(np.arange(count), [len(a.t) for a in aidings])
    order = np.argsort(t, kind="stable")
    order = order[t[order] > after]
    y, sd = (np.concatenate([_three_columns(getattr(a, part)) for a in aidings] or [np.empty((0, 3))])[order] for part in ("y", "sd"))
    parameters, gate = np.zeros((count, PARAMETERS)), np.empty(count)
    for s, (a, sensor) in enumerate(zip(aidings, sensors)):
        parameters[s, :len(a.parameters)] = a.parameters
        gate[s] = GATES[len(sensor.quantities)] if a.gate is None else a.gate
    return Fixes(t[order], source[order].astype(np.int64), y, sd, np.array([s.kind for s in sensors], np.int64), parameters, gate)


def _three_columns(values):
    values = np.asarray(values, float)
    values = values[:, None] if values.ndim == 1 else values
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])), constant_values=np.nan)


def new_cursor(t, sources):
    """A Cursor at time `t` before the first sample, for that many sources."""
    count = lambda: np.zeros(sources, np.int64)
    cursor = Cursor(np.zeros(loop.CURSOR_SIZE, np.int64), np.array([float(t)]), np.zeros(7), np.zeros(15), count(), count(), count(), np.zeros(sources))
    cursor.at[loop.EVERY] = 1
    return cursor


def fuse(recording, filter="closed-loop", imu=None, start=None, noise=None, every=1, covariance=False, say=None, progress=None, **options):
    """Run `filter` over `recording` and return the Solution.

    imu: grade, file or ImuSpec (default: what the recording names); start: a Start (default: `alignment.align`); noise: a Noise in place of the IMU's;
    every: keep each n-th row (the last one always); covariance: keep the whole covariance of these rows too; say: told of slow compilation;
    progress: called with the fraction done; options: the filter's own. Raises DataError.
    """
    if every < 1:
        raise DataError(f"every is {every}; it must be at least 1")
    noise, spec = _noise(recording, imu, noise, needed=start is None)
    if start is None:
        from .alignment import align
        start = align(recording, spec)
    prepared = prepare(filter, [a.kind for a in recording.aidings], say)
    belief = _belief(prepared.filter, start, noise, options)
    samples = Imu(*(np.require(column, float, "CW") for column in recording.imu))
    first, rows = int(np.searchsorted(samples.t, start.t + loop.SAME_TIME)), len(samples.t)
    if first == rows:
        raise DataError(f"the start at {start.t:g} s is not before the last IMU sample at {samples.t[-1]:g} s; give an earlier start")
    fixes = merge(recording.aidings, start.t - loop.SAME_TIME)
    cursor = new_cursor(start.t, len(fixes.kind))
    cursor.at[loop.ROW], cursor.at[loop.FIXES], cursor.at[loop.EVERY] = first, len(fixes.t), every
    cursor.at[loop.PHASE] = (rows - 1) % every
    kept = -(-(rows - first) // every)
    out = Output(np.empty((kept, loop.NAV_WIDTH + len(prepared.filter.columns))),
                 np.empty((kept if covariance else 0, *belief.P.shape)), np.empty((len(fixes.t), loop.FIX_WIDTH)))
    while cursor.at[loop.ROW] < rows and not cursor.at[loop.FAULT]:
        cursor.at[loop.STOP] = min(cursor.at[loop.ROW] + CHUNK, rows)
        loop.run(*prepared[1:], belief, samples, fixes, noise, cursor, out)
        if progress:
            progress((cursor.at[loop.ROW] - first) / (rows - first))
    return _solution(recording, samples, prepared.filter, start, noise, spec, fixes, cursor, out)


def _noise(recording, imu, noise, needed):
    """The Noise to assume and the ImuSpec it comes from (None where the caller gave everything)."""
    from .sensors.imu import grade, grades
    imu = imu if imu is not None else recording.meta.get("grade")
    if imu is None and (noise is None or needed):
        raise DataError(f"the recording does not name its IMU: give imu=, one of {', '.join(grades())}, or a file that describes it")
    spec = grade(imu) if imu is not None else None
    return type(noise)(*map(float, noise)) if noise else spec.noise(), spec


def _belief(filter, start, noise, options):
    known = {name: option.default for name, option in list(inspect.signature(filter.start).parameters.items())[2:]}
    for name, value in options.items():
        if name not in known:
            raise DataError(f"filter {filter.name!r} has no option {name!r}; it has {', '.join(known) or 'none'}")
        if isinstance(value, str) and not isinstance(known[name], str):
            raise DataError(f"filter {filter.name!r}: {name} is {value!r}; it must be a number")
    try:
        return filter.start(start, noise, **options)
    except ValueError as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None


def _solution(recording, samples, filter, start, noise, spec, fixes, cursor, out):
    """The Solution from what `run` wrote; a run that stopped early keeps what it has and says why."""
    nav, used = out.nav[:cursor.at[loop.OUT]], out.fix[:cursor.at[loop.FIX]]
    events = _events(samples, start, used, [a.name or a.kind for a in recording.aidings])
    meta = {"filter": filter.name, "recording": recording.meta.get("name", ""), "notes": list(recording.meta.get("notes", [])),
            "imu": spec.name if spec else "", "start": start._asdict(), "noise": noise._asdict(), "fixes_outside": sum(len(a.t) for a in recording.aidings) - len(used),
            "kinds": {a.name or a.kind: a.kind for a in recording.aidings}, "date": recording.meta.get("date"), "point": recording.meta.get("point", "imu")}
    if cursor.at[loop.FAULT]:
        t = samples.t[cursor.at[loop.ROW]]
        meta["stopped"] = f"stopped at {t:.2f} s: the latitude left the +-89 deg where results hold, or the filter diverged"
        events.append((float(t), meta["stopped"]))
        if not len(nav):
            raise DataError(f"{filter.name} {meta['stopped']}")
    sd = nav[:, loop.SD:loop.ROW_STATUS]
    sd[:, [i for i in range(sd.shape[1]) if i not in filter.states]] = np.nan
    trajectory = Trajectory(nav[:, loop.T], nav[:, loop.LLA:loop.V], nav[:, loop.V:loop.Q], nav[:, loop.Q:loop.BIASES], sd)
    if recording.meta.get("point") == "reference":
        rows = np.searchsorted(samples.t, trajectory.t)
        omega = samples.dtheta[rows] / samples.dt[rows, None] - nav[:, loop.BIASES + 3:loop.SD]
        trajectory = trajectory.displaced(-np.asarray(recording.meta["imu_lever_arm"]), omega)
    return Solution(trajectory, nav[:, loop.BIASES:loop.BIASES + 3], nav[:, loop.BIASES + 3:loop.SD], nav[:, loop.ROW_STATUS].astype(np.int8),
                    innovations(used, recording.aidings, fixes.gate), tuple(sorted(events)),
                    {name: nav[:, loop.NAV_WIDTH + i] for i, name in enumerate(filter.columns)},
                    out.covariance[:len(nav)] if len(out.covariance) else None, meta)


def innovations(used, aidings, gates):
    """Innovations from the fix rows that `run` wrote."""
    return Innovations(used[:, loop.F_T], used[:, loop.F_SOURCE].astype(int), used[:, loop.F_INNOVATION:loop.F_NIS], used[:, loop.F_NIS],
                       used[:, loop.F_USE] > 0, tuple(a.name or a.kind for a in aidings), tuple(float(gate) for gate in gates))


def _events(samples, start, used, names):
    """Gaps of the IMU and re-acquisitions of a source, as (t, text)."""
    events = []
    for first in range(0, len(samples.t), CHUNK):  # in pieces: a day of samples is too long for temporary columns
        t, dt = (column[first:first + CHUNK] for column in samples[:2])
        before = np.r_[samples.t[first - 1] if first else start.t, t[:-1]]
        gap = t - dt - np.maximum(before, start.t)
        for k in np.flatnonzero((gap > 0.5 * dt + loop.SAME_TIME) & (t > start.t)):
            rule = "bridged" if gap[k] <= loop.BRIDGE else "velocity and attitude held, invalid until the next position fix"
            events.append((float(before[k]), f"IMU gap of {gap[k]:.3g} s: {rule}"))
    for s, name in enumerate(names):
        lifted = used[(used[:, loop.F_SOURCE] == s) & (used[:, loop.F_USE] == loop.REACQUIRED), loop.F_T]
        first = lifted[np.diff(lifted, prepend=-np.inf) > 2 * loop.PATIENCE]
        events += [(float(t), f"{name}: gate lifted after {loop.REJECTED} or more rejections in a row over {loop.PATIENCE:g} s") for t in first]
    return events


class Sample(NamedTuple):
    """One IMU sample of a stream: increments over (t - dt, t], body FRD, rad and m/s."""
    t: float
    dt: float
    dtheta: tuple
    dv: tuple


class Fix(NamedTuple):
    """One fix of a stream. `source` is the place of its source among the stream's `aidings`; y and sd as in Aiding, NaN where not measured."""
    t: float
    source: int
    y: tuple
    sd: tuple


class Stream:
    """The same kernels live: events wait `lag` seconds, are used in time order, and later ones are dropped and counted.

    aidings: Aiding values whose kind, parameters and gate describe the sources (their fixes are not used). The result is that of `fuse` on the
    same events, bit for bit.
    """

    def __init__(self, filter, start, imu=None, noise=None, aidings=(), lag=0.0, say=None, **options):
        from .data import Recording
        if not lag >= 0:
            raise DataError(f"lag is {lag} s; it must be 0 or more")
        self.noise, _ = _noise(Recording(None), imu, noise, needed=False)
        self.prepared = prepare(filter, [a.kind for a in aidings], say)
        self.belief = _belief(self.prepared.filter, start, self.noise, options)
        sources = [a._where(np.zeros(len(a.t), bool)) for a in aidings]
        self._fixes = merge(sources)._replace(t=np.empty(64), source=np.zeros(64, np.int64), y=np.full((64, 3), np.nan), sd=np.full((64, 3), np.nan))
        self._imu = Imu(np.empty(1), np.empty(1), np.empty((1, 3)), np.empty((1, 3)))
        self._cursor = new_cursor(start.t, len(aidings))
        self._cursor.at[loop.EVERY], self._cursor.at[loop.PHASE], self._cursor.at[loop.STOP] = 2, 1, 1  # no output rows
        self._out = Output(np.empty((0, loop.NAV_WIDTH)), np.empty((0, *self.belief.P.shape)), np.empty((64, loop.FIX_WIDTH)))
        self._arguments = (*self.prepared[1:], self.belief, self._imu, self._fixes, self.noise, self._cursor, self._out)
        self._run = entry_point(loop.run)
        self._waiting, self._number, self.lag, self.newest, self._done, self.dropped = [], 0, lag, start.t, start.t, 0

    @property
    def t(self):
        """Time of the belief, s."""
        return float(self._cursor.now[0])

    def step(self, event):
        """Take a Sample or a Fix, use what has waited long enough, and return the belief (updated in place)."""
        t = event[0]
        fix = type(event) is Fix
        if t <= self._done - loop.SAME_TIME * fix:
            self.dropped += 1
            return self.belief
        if t > self.newest:
            self.newest = t
        self._number += 1
        heappush(self._waiting, (t, event[1], self._number, event) if fix else (t + loop.SAME_TIME, 1e9, self._number, event))
        self._use(self.newest - self.lag + loop.SAME_TIME)
        return self.belief

    def _use(self, until):
        waiting = self._waiting
        while waiting and waiting[0][0] <= until:
            event = heappop(waiting)[3]
            if type(event) is Fix:
                self._take_fix(event)
            else:
                self._take_sample(event)

    def _take_fix(self, event):
        at, fixes = self._cursor.at, self._fixes
        k = at[loop.FIXES]
        if k == len(fixes.t):
            raise DataError(f"{k} fixes without an IMU sample, the first at {fixes.t[0]:.3f} s; the stream needs samples to go on")
        fixes.t[k], fixes.source[k] = event.t, event.source
        fixes.y[k, :len(event.y)], fixes.sd[k, :len(event.sd)] = event.y, event.sd
        at[loop.FIXES] = k + 1

    def _take_sample(self, event):
        at, imu = self._cursor.at, self._imu
        imu.t[0], imu.dt[0], imu.dtheta[0], imu.dv[0] = event
        at[loop.ROW], at[loop.STOP] = 0, 1
        self._run(*self._arguments)
        if at[loop.FAULT]:
            raise DataError(f"stream stopped at {event.t:.2f} s: the latitude left the +-89 deg where results hold, or the filter diverged")
        if at[loop.FIX]:  # all of them were used
            at[loop.FIX] = at[loop.FIXES] = 0
        self._done = event.t

    @property
    def now(self):
        """The belief at the newest sample: a copy, propagated through what still waits."""
        saved = [column.copy() for part in (self.belief, self._cursor) for column in part]
        waiting, done, fixes = list(self._waiting), self._done, [column[:64].copy() for column in self._fixes[:4]]
        self._use(np.inf)
        ahead = type(self.belief)(*(column.copy() for column in self.belief))
        for column, before in zip([c for part in (self.belief, self._cursor) for c in part] + list(self._fixes[:4]), saved + fixes):
            column[...] = before
        self._waiting, self._done = waiting, done
        return ahead

    def finish(self):
        """Use all that waits and return the belief."""
        self._use(np.inf)
        return self.belief

    def counts(self):
        """(accepted, rejected) per source."""
        return list(zip(self._cursor.accepted.tolist(), self._cursor.rejected.tolist()))
