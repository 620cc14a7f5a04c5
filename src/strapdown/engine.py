"""From a Recording and a filter to a Solution: `prepare` compiles what a run needs, `fuse` runs a recording, `Stream` runs it live."""
import inspect
from heapq import heappop, heappush
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from . import aiding, filters
from .core import loop
from .core.contract import COMPILED, PARAMETERS, STATES, Cursor, Fixes, Imu, Output, address, compile_kernel, entry_point, is_cached
from .core.earth import LATITUDE_LIMIT
from .data import DataError, Innovations, Solution, Trajectory

CHUNK = 65536 if COMPILED else 500
"""IMU rows between two looks at the keyboard and the progress bar."""
GATES = {1: 10.828, 2: 13.816, 3: 16.266}
"""Bound on the NIS by number of rows: 0.1 % of right fixes are rejected (chi-square quantiles)."""
LONGEST_GAP = 86400.0
"""s without IMU samples; more is a mistaken clock and no pause."""
ROOM = 1024
"""Fixes that a stream holds while it waits for a sample."""


class Prepared(NamedTuple):
    """A filter and the addresses of its compiled kernels."""
    filter: filters.Filter
    predict: int
    correct: int
    observers: np.ndarray   # by kind; 0 where the run has no such source


def prepare(filter, kinds, say=None):
    """Compile (or load from the cache) the kernels of `filter` and of the aiding `kinds`. `say` is told once where that takes seconds."""
    filter = _found(filters.find, filter)
    sensors = [_found(aiding.find, kind) for kind in dict.fromkeys(kinds)]
    slow = [filter.predict, filter.correct, loop.run]
    if say and not all(map(is_cached, slow)):
        say("compiling the filter for the first time on this machine, about 15 s ...")
    for kernel in [*slow, *(sensor.observe for sensor in sensors)]:
        compile_kernel(kernel)
    observers = np.zeros(len(aiding.sensors()), np.int64)
    for sensor in sensors:
        observers[sensor.kind] = address(sensor.observe)
    return Prepared(filter, address(filter.predict), address(filter.correct), observers)


def _found(find, name):
    """What `find` has of that name; what it has not is bad input."""
    try:
        return find(name)
    except ValueError as error:
        raise DataError(str(error)) from None


def merge(aidings, after=-np.inf):
    """All fixes later than `after` (s) in time order (Fixes), simultaneous ones in the order of `aidings`."""
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

    imu: grade, file or ImuSpec (default: what the recording names); start: a Start (default: `alignment.align`), to which
    fixes at its time belong: they are not used again; noise: a Noise in place of the IMU's; every: keep each n-th row (the last one always);
    covariance: keep the whole covariance of these rows too; say: told of slow compilation; progress: called with the fraction done;
    options: the filter's own. Raises DataError.
    """
    if not isinstance(every, (int, np.integer)) or every < 1:
        raise DataError(f"every is {every}; it must be a whole number, at least 1")
    noise, spec = _noise(recording.meta.get("grade") if imu is None else imu, noise, needed=start is None)
    if start is None:
        from .alignment import align
        start = align(recording, spec)
    filter = _found(filters.find, filter)
    belief = _belief(filter, start, noise, options)
    prepared = prepare(filter, [a.kind for a in recording.aidings], say)
    samples = Imu(*(np.require(column, float, "CW") for column in recording.imu))
    first, rows = int(np.searchsorted(samples.t, start.t + loop.SAME_TIME, side="right")), len(samples.t)
    if first == rows:
        raise DataError(f"the start at {start.t:g} s is not before the last IMU sample at {samples.t[-1]:g} s; give an earlier start")
    if samples.t[first] - start.t > LONGEST_GAP:
        raise DataError(f"the start at {start.t:g} s is {samples.t[first] - start.t:.0f} s before the first IMU sample; "
                        f"the longest gap is {LONGEST_GAP:.0f} s")
    fixes = merge(recording.aidings, start.t + loop.SAME_TIME)
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


def _noise(imu, noise, needed):
    """The Noise to assume and the ImuSpec it comes from; None where the caller gave a noise and the spec is not `needed`."""
    from .sensors.imu import grade, grades
    if imu is None and (noise is None or needed):
        raise DataError(f"the recording does not name its IMU: give imu=, one of {', '.join(grades())}, or a file that describes it")
    spec = None if imu is None else grade(imu)
    return type(noise)(*map(float, noise)) if noise else spec.noise(), spec


def _checked(start, noise):
    """Raise DataError naming the first field of a Start or a Noise that no filter can begin with."""
    for name, size in (("t", 1), ("lla", 3), ("v", 3), ("rph", 3), ("ba", 3), ("bg", 3), ("sd", STATES)):
        values = np.atleast_1d(np.asarray(getattr(start, name), float))
        if values.shape != (size,) or not np.isfinite(values).all():
            raise DataError(f"start: {name} is {getattr(start, name)}; it must be {size} finite number{'s' * (size > 1)}")
    if min(start.sd) < 0:
        raise DataError(f"start: sd has {min(start.sd):g}; standard deviations must be 0 or more")
    if abs(start.lla[0]) > LATITUDE_LIMIT:
        raise DataError(f"start: latitude is {np.degrees(start.lla[0]):.6g} deg; results hold up to {np.degrees(LATITUDE_LIMIT):.0f} deg")
    for name, value in noise._asdict().items():
        if not 0 <= value < np.inf:
            raise DataError(f"noise: {name} is {value:g}; it must be a finite number, 0 or more")


def _belief(filter, start, noise, options):
    _checked(start, noise)
    known = {name: option.default for name, option in list(inspect.signature(filter.start).parameters.items())[2:]}
    for name, value in options.items():
        if name not in known:
            raise DataError(f"filter {filter.name!r} has no option {name!r}; it has {', '.join(known) or 'none'}")
        if isinstance(value, str) and not isinstance(known[name], str):
            raise DataError(f"filter {filter.name!r}: {name} is {value!r}; it must be a number")
    try:
        return filter.start(start, noise, **options)
    except (TypeError, ValueError) as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None


def _solution(recording, samples, filter, start, noise, spec, fixes, cursor, out):
    """The Solution from what `run` wrote; a run that stopped early keeps what it has and says why."""
    nav, used = out.nav[:cursor.at[loop.OUT]], out.fix[:cursor.at[loop.FIX]]
    events = _events(samples, cursor.at[loop.ROW], start, used, [a.name or a.kind for a in recording.aidings])
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


def _events(samples, rows, start, used, names):
    """Gaps in the first `rows` samples and re-acquisitions of a source, as (t, text)."""
    events = []
    for first in range(0, rows, CHUNK):  # in pieces: a day of samples is too long for temporary columns
        t, dt = (column[first:min(first + CHUNK, rows)] for column in samples[:2])
        before = np.r_[samples.t[first - 1] if first else start.t, t[:-1]]
        gap = t - dt - np.maximum(before, start.t)
        for k in np.flatnonzero((gap > 0.5 * dt + loop.SAME_TIME) & (t > start.t)):
            rule = "bridged" if gap[k] <= loop.BRIDGE else "velocity and attitude held, invalid until the next position fix"
            events.append((float(before[k]), f"IMU gap of {gap[k]:.3g} s: {rule}"))
    for s, name in enumerate(names):
        own = used[(used[:, loop.F_SOURCE] == s) & (used[:, loop.F_USE] != loop.UNMEASURED)]
        lifted = np.r_[False, own[:, loop.F_USE] == loop.REACQUIRED]
        events += [(float(t), f"{name}: gate lifted after {loop.REJECTED} or more rejections in a row over {loop.PATIENCE:g} s")
                   for t in own[lifted[1:] & ~lifted[:-1], loop.F_T]]
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
    """The same kernels live: samples wait `lag` seconds for late events, then all is used in time order; what comes later still is dropped and counted.

    aidings: Aiding values whose kind, parameters and gate describe the sources (their fixes are not used). The result is that of `fuse` on the
    same events, bit for bit. A fix is used with the sample that reaches its time; a sample with a NaN is dropped. Raises DataError.
    """

    def __init__(self, filter, start, imu=None, noise=None, aidings=(), lag=0.0, say=None, **options):
        if not lag >= 0:
            raise DataError(f"lag is {lag} s; it must be 0 or more")
        self.noise, _ = _noise(imu, noise, needed=False)
        filter = _found(filters.find, filter)
        self.belief = _belief(filter, start, self.noise, options)
        self.prepared = prepare(filter, [a.kind for a in aidings], say)
        self.lag, self.newest, self.dropped = lag, start.t, 0
        self._widths = [len(aiding.find(a.kind).quantities) for a in aidings]
        self._samples, self._waiting, self._number = [], [], 0      # heaps of samples and of fixes; a number that keeps equal times in order
        self._late = self._late_fix = start.t + loop.SAME_TIME      # what is not later than this is too late
        sources = [a._where(np.zeros(len(a.t), bool)) for a in aidings]
        self._fixes = merge(sources)._replace(t=np.empty(ROOM), source=np.zeros(ROOM, np.int64), y=np.full((ROOM, 3), np.nan), sd=np.full((ROOM, 3), np.nan))
        self._imu = Imu(np.empty(1), np.empty(1), np.empty((1, 3)), np.empty((1, 3)))
        self._cursor = new_cursor(start.t, len(aidings))
        self._cursor.at[loop.EVERY], self._cursor.at[loop.PHASE], self._cursor.at[loop.STOP] = 2, 1, 1  # no output rows
        self._out = Output(np.empty((0, loop.NAV_WIDTH)), np.empty((0, *self.belief.P.shape)), np.empty((ROOM, loop.FIX_WIDTH)))
        self._arguments = (*self.prepared[1:], self.belief, self._imu, self._fixes, self.noise, self._cursor, self._out)
        self._run = entry_point(loop.run)

    @property
    def t(self):
        """Time of the belief, s."""
        return float(self._cursor.now[0])

    @property
    def status(self):
        """VALID, BRIDGED or INVALID, as of a row of a Solution."""
        return int(self._cursor.at[loop.STATUS])

    def step(self, event):
        """Take a Sample or a Fix, use what has waited long enough, and return the belief (updated in place)."""
        t = event[0]
        self._number += 1
        if type(event) is Fix:
            if t > self._late_fix:
                heappush(self._waiting, (t, event[1], self._number, self._usable(event)))
            else:
                self.dropped += 1
            return self.belief
        if not (t > self._late and isfinite(t + sum(event[2]) + sum(event[3])) and event[1] > 0):
            self.dropped += 1
            return self.belief
        if t > self.newest:
            if t - self.newest > LONGEST_GAP:
                raise DataError(f"IMU sample at {t:.3f} s: time jumps by {t - self.newest:.0f} s; begin a new stream there")
            self.newest = t
        heappush(self._samples, (t, self._number, event))
        self._use(self.newest - self.lag)
        return self.belief

    def _usable(self, fix):
        """The fix as (t, source, y, sd) with NaN for what is not finite; raises DataError for what no source delivers."""
        if not (isinstance(fix.source, (int, np.integer)) and 0 <= fix.source < len(self._widths)):
            raise DataError(f"fix at {fix.t:.3f} s: source is {fix.source!r}; the stream has {len(self._widths)}, counted from 0")
        width = self._widths[fix.source]
        if not len(fix.y) == len(fix.sd) == width:
            raise DataError(f"fix at {fix.t:.3f} s: y has {len(fix.y)} and sd {len(fix.sd)} numbers; source {fix.source} needs {width}")
        y = [value if isfinite(value) else nan for value in fix.y]
        if not all(value != value or 0 < sd < inf for value, sd in zip(y, fix.sd)):
            raise DataError(f"fix at {fix.t:.3f} s: standard deviations are {tuple(fix.sd)}; they must be above zero")
        if len(self._waiting) == ROOM:
            raise DataError(f"{ROOM} fixes wait for an IMU sample, the first at {self._waiting[0][0]:.3f} s; the stream needs samples to go on")
        return fix.t, fix.source, y, fix.sd

    def _use(self, until):
        samples = self._samples
        while samples and samples[0][0] <= until:
            sample = heappop(samples)[2]
            if sample[0] > self._late:
                self._take(sample)
            else:
                self.dropped += 1

    def _take(self, sample):
        """Run over one sample and the fixes up to its end."""
        at, imu, fixes, waiting, end, k = self._cursor.at, self._imu, self._fixes, self._waiting, sample[0] + loop.SAME_TIME, 0
        while waiting and waiting[0][0] <= end:
            fixes.t[k], fixes.source[k], y, sd = heappop(waiting)[3]
            fixes.y[k, :len(y)], fixes.sd[k, :len(y)] = y, sd
            k += 1
        imu.t[0], imu.dt[0], imu.dtheta[0], imu.dv[0] = sample
        at[loop.ROW], at[loop.STOP], at[loop.FIXES] = 0, 1, k
        self._run(*self._arguments)
        if at[loop.FAULT]:
            raise DataError(f"stream stopped at {sample[0]:.2f} s: the latitude left the +-89 deg where results hold, or the filter diverged")
        if k:
            at[loop.FIX] = at[loop.FIXES] = 0
        self._late, self._late_fix = sample[0], sample[0] - loop.SAME_TIME

    @property
    def now(self):
        """The belief at the newest sample: a copy, propagated through what still waits."""
        arrays = [column for part in (self.belief, self._cursor) for column in part]
        saved = [column.copy() for column in arrays]
        plain = list(self._samples), list(self._waiting), self._late, self._late_fix, self.dropped
        try:
            self._use(inf)
            return type(self.belief)(*(column.copy() for column in self.belief))
        finally:
            for column, before in zip(arrays, saved):
                column[...] = before
            self._samples, self._waiting, self._late, self._late_fix, self.dropped = plain

    def finish(self):
        """Use all that waits and return the belief."""
        self._use(inf)
        return self.belief

    def counts(self):
        """(accepted, rejected) per source."""
        return list(zip(self._cursor.accepted.tolist(), self._cursor.rejected.tolist()))
