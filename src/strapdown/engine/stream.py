"""The filters live: `Stream` takes samples and fixes as they come and gives what `fuse` gives,
bit for bit."""

from collections.abc import Sequence
from heapq import heappop, heappush
from math import inf, isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from .. import aiding, filters
from ..checks import DataError
from ..core import cursor as places, loop
from ..core.contract import Belief, Filter, Imu, Noise, Start, entry_point
from ..data import Aiding
from ..typing import Say
from ..vehicle import GivenVehicle, find as find_vehicle
from .events import Events
from .limits import limits
from .prepare import (
    LONGEST_GAP,
    GivenImu,
    assumed_noise,
    blame,
    check_needs,
    fitted,
    merge,
    new_belief,
    new_cursor,
    new_output,
    prepare,
    usable,
)

MOST_WAITING_FIXES = 1024
"""Fixes that a stream holds while it waits for a sample."""


class Sample(NamedTuple):
    """One IMU sample of a stream: increments over (t - dt, t], body FRD, rad and m/s."""

    t: float
    dt: float
    dtheta: tuple[float, float, float]
    dv: tuple[float, float, float]


class Fix(NamedTuple):
    """One fix of a stream. `source` is the place of its source among the stream's `aidings`; y
    and sd as in Aiding, NaN where not measured."""

    t: float
    source: int
    y: tuple[float, ...]
    sd: tuple[float, ...]


class _UsableFix(NamedTuple):
    """A fix of a source that the filter uses: `source` is its place among those."""

    t: float
    source: int
    y: list[float]
    sd: list[float]


class Stream:
    """The same kernels live: samples wait `lag` seconds for late events, then all is used in time
    order; what comes later still is dropped and counted.

    aidings: Aiding values whose kind, parameters and gate describe the sources (their fixes are not
    used). The result is that of `fuse` on the same events, bit for bit. A fix is used with the
    sample that reaches its time; a sample with a NaN is dropped. Fixes of sources that the filter
    cannot use change nothing. Where a filter takes options from the fixes of a recording, such as
    their interval, it takes them from these Aidings, which may hold none: then give the options.
    `notes` says what it took. Raises DataError.
    """

    def __init__(
        self,
        filter: str | Filter,
        start: Start,
        imu: GivenImu | None = None,
        noise: Noise | None = None,
        aidings: Sequence[Aiding] = (),
        lag: float = 0.0,
        say: Say | None = None,
        vehicle: GivenVehicle | None = None,
        **options: Any,
    ) -> None:
        if not lag >= 0:
            raise DataError(f"lag is {lag} s; it must be 0 or more")
        self.noise, spec = assumed_noise(imu, noise, needed=False)
        filter = filters.find(filter)
        used, _ = usable(filter, aidings)
        check_needs(
            filter, aidings, "a stream runs no AHRS: give an Aiding of that kind among its aidings"
        )
        options, self.notes = fitted(filter, options, used)
        self.belief = new_belief(filter, start, self.noise, options, used)
        self.prepared = prepare(filter, [a.kind for a in used], say)
        self.lag, self.newest, self.dropped = lag, start.t, 0
        self._filter, self._used = filter, used  # to blame where one of them raises
        self._widths = [len(aiding.find(a.kind).quantities) for a in aidings]
        # among those that the filter can use
        self._places = [next((i for i, b in enumerate(used) if b is a), None) for a in aidings]
        # heaps of samples and of fixes; a number that keeps equal times in order
        self._samples: list[tuple[float, int, Sample]] = []
        self._waiting: list[tuple[float, int, int, _UsableFix]] = []
        self._number = 0
        # what is not later than this is too late
        self._late = self._late_fix = start.t + loop.SAME_TIME
        sources = [a._where(np.zeros(len(a.t), bool)) for a in used]
        self._fixes = merge(sources)._replace(
            t=np.empty(MOST_WAITING_FIXES),
            source=np.zeros(MOST_WAITING_FIXES, np.int64),
            y=np.full((MOST_WAITING_FIXES, 3), np.nan),
            sd=np.full((MOST_WAITING_FIXES, 3), np.nan),
        )
        self._imu = Imu(np.empty(1), np.empty(1), np.empty((1, 3)), np.empty((1, 3)))
        bounds = find_vehicle(vehicle)
        self._cursor = new_cursor(filter, start.t, used, limits(spec, self.noise, bounds))
        self._events = Events(filter, used, bounds)
        # no output rows
        (
            self._cursor.at[places.EVERY],
            self._cursor.at[places.PHASE],
            self._cursor.at[places.STOP],
        ) = (
            2,
            1,
            1,
        )
        self._out = new_output(filter, self.belief, 0, fixes=MOST_WAITING_FIXES)
        self._arguments = (
            self.prepared.predict,
            self.prepared.correct,
            self.prepared.observers,
            self.belief,
            self._imu,
            self._fixes,
            self.noise,
            self._cursor,
            self._out,
        )
        self._run = entry_point(loop.run)

    @property
    def t(self) -> float:
        """Time of the belief, s."""
        return float(self._cursor.now[0])

    @property
    def status(self) -> int:
        """VALID, BRIDGED, INVALID or DOUBTFUL, as of a row of a Solution."""
        return int(self._cursor.at[places.SHOWN])

    @property
    def events(self) -> list[tuple[float, str]]:
        """[(t, text)] of what a user must know, as of a Solution."""
        return self._events.all

    def step(self, event: Sample | Fix) -> Belief:
        """Take a Sample or a Fix, use what has waited long enough, and return the belief
        (updated in place)."""
        t = event[0]
        self._number += 1
        if isinstance(event, Fix):
            if not t > self._late_fix:
                self.dropped += 1
            elif (fix := self._usable(event)) is not None:
                heappush(self._waiting, (t, fix.source, self._number, fix))
            return self.belief
        if not (t > self._late and isfinite(t + sum(event[2]) + sum(event[3])) and event[1] > 0):
            self.dropped += 1
            return self.belief
        if t > self.newest:
            if t - self.newest > LONGEST_GAP:
                raise DataError(
                    f"IMU sample at {t:.3f} s: time jumps by {t - self.newest:.0f} s; begin a new "
                    f"stream there"
                )
            self.newest = t
        heappush(self._samples, (t, self._number, event))
        self._use(self.newest - self.lag)
        return self.belief

    def _usable(self, fix: Fix) -> _UsableFix | None:
        """The fix with NaN for what is not finite, None where the filter cannot use its source;
        raises DataError for what no source delivers."""
        if not (isinstance(fix.source, (int, np.integer)) and 0 <= fix.source < len(self._widths)):
            raise DataError(
                f"fix at {fix.t:.3f} s: source is {fix.source!r}; the stream has "
                f"{len(self._widths)}, counted from 0"
            )
        width = self._widths[fix.source]
        try:
            y, deviations = [float(value) for value in fix.y], [float(value) for value in fix.sd]
        except (TypeError, ValueError):
            raise DataError(
                f"fix at {fix.t:.3f} s: y is {fix.y!r} and sd {fix.sd!r}; each must be a tuple, "
                f"source {fix.source} needs {width} "
                f"number{'s' * (width > 1)}"
            ) from None
        if not len(y) == len(deviations) == width:
            raise DataError(
                f"fix at {fix.t:.3f} s: y has {len(y)} and sd {len(deviations)} numbers; source "
                f"{fix.source} needs {width}"
            )
        y = [value if isfinite(value) else nan for value in y]
        if not all(value != value or 0 < sd < inf for value, sd in zip(y, deviations)):
            raise DataError(
                f"fix at {fix.t:.3f} s: standard deviations are {tuple(fix.sd)}; they must be above "
                f"zero"
            )
        if len(self._waiting) == MOST_WAITING_FIXES:
            raise DataError(
                f"{MOST_WAITING_FIXES} fixes wait for an IMU sample, the first at "
                f"{self._waiting[0][0]:.3f} s; the stream needs samples to go on"
            )
        place = self._places[fix.source]
        return None if place is None else _UsableFix(fix.t, place, y, deviations)

    def _use(self, until: float) -> None:
        samples = self._samples
        while samples and samples[0][0] <= until:
            sample = heappop(samples)[2]
            if sample[0] > self._late:
                self._take(sample)
            else:
                self.dropped += 1

    def _take(self, sample: Sample) -> None:
        """Run over one sample and the fixes up to its end."""
        at, imu, fixes, waiting, end, k = (
            self._cursor.at,
            self._imu,
            self._fixes,
            self._waiting,
            sample[0] + loop.SAME_TIME,
            0,
        )
        while waiting and waiting[0][0] <= end:
            fixes.t[k], fixes.source[k], y, sd = heappop(waiting)[3]
            fixes.y[k, : len(y)], fixes.sd[k, : len(y)] = y, sd
            k += 1
        imu.t[0], imu.dt[0], imu.dtheta[0], imu.dv[0] = sample
        at[places.ROW], at[places.STOP], at[places.FIXES] = 0, 1, k
        try:
            self._run(*self._arguments)
        except Exception as error:
            blame(error, self._filter, self._used)
            raise
        if at[places.LOGGED]:
            self._events.take(self._cursor)
        if at[places.FAULT]:
            raise DataError(
                f"stream stopped at {sample[0]:.2f} s: the latitude left the +-89 deg where results "
                f"hold, or the filter diverged"
            )
        if k:
            at[places.FIX] = at[places.FIXES] = 0
        self._late, self._late_fix = sample[0], sample[0] - loop.SAME_TIME

    @property
    def now(self) -> Belief:
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

    def finish(self) -> Belief:
        """Use all that waits and return the belief."""
        self._use(inf)
        return self.belief

    def counts(self) -> list[tuple[int, int]]:
        """(accepted, rejected) per source; (0, 0) of one that the filter cannot use."""
        counts = list(zip(self._cursor.accepted.tolist(), self._cursor.rejected.tolist()))
        return [(0, 0) if place is None else counts[place] for place in self._places]
