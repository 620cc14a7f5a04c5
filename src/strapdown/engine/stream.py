"""Live filters: `Stream` takes samples and fixes as they arrive, and returns the results and
messages of `fuse`, bit for bit."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from heapq import heapify, heappop, heappush
from math import inf, isfinite, nan
from typing import Any, NoReturn, Unpack

import numpy as np

from .. import __version__, filters
from ..alignment.missing_fields import missing_fields
from ..checks import DataError, check_flag, check_number
from ..core.compile.records import Table, rows
from ..core.loop.contract import INVALID, STATES, VALID, Filter, FilterState, InitialState, Noise
from ..core.loop.cursor import Limits
from ..core.loop.loop import SAME_TIME
from ..core.loop.tables import FixRow
from ..data.recording import Recording, RecordingMeta
from ..data.solution import Solution, Source
from ..data.vehicle import Vehicle, find as find_vehicle
from ..data.verdict import Verdict
from ..preprocessing.imu_samples import MAX_INTERVAL
from ..preprocessing.plausible import mistakes
from ..typing import Array, File
from ..units.constants import MAX_PAUSE
from . import events as words
from .alignment_buffer import Gathering
from .arrivals import (
    MAX_TIME,
    MAX_WAITING_FIXES,
    Measurement as Measurement,
    Sample as Sample,
    Sources,
    UsableFix,
    checked_sources,
    fix_of,
    refuse_event,
    refuse_sample,
    sample_of,
)
from .events import Events
from .front import Front, numbers_of
from .installation import (
    Estimate,
    OfImu,
    asked_of,
    check_estimates,
    delays,
    of_grade,
    parameters,
    without_estimates,
)
from .live_run import LiveRun, SetUp, TestedMeasurement, start_of
from .notifier import BEYOND, Notifier, OnEvent
from .options import RunOptions, run_options, takes
from .plausible_limits import limits
from .prepare import (
    Run,
    assumed_noise,
    augmented_states,
    check_needs,
    check_options,
    check_start,
    configure_options,
    has_position,
    prepare,
    stages_of,
    usable,
)
from .saved_state import check_set_up, contradiction, plain_source, read_state, write_state
from .source_noise import with_correlated_errors
from .source_weights import apply_weights
from .with_ahrs import SILENT, attitudes, choose_ahrs, notes_on, taken_by, whose

AHEAD = 10.0
"""s by which a fix may be ahead of the newest sample, or the lag where that is longer."""
HISTORY = 65536
"""Number of samples that a stream keeps, at least the newer half of them."""
MAX_HISTORY = 10_000_000
"""Largest number of samples that it may keep, 4 GB; with covariances a fifth of that."""
MAX_OVERLAP = 0.45
"""Share of its `dt` by which a sample may begin before the end of the one before: of two interleaved
series of stamps one in two overlaps by half and more."""
OCCUPIED = 0.75
"""Share of its `dt` within which a sample has the time of another one: half of it where their series
interleave."""
OnUse = Callable[[Sample, list[Measurement]], object]
"""(sample, measurements) that the filter has used; their sources by index among those that it can use."""
LOOKS = (10.0, 60.0, inf)
"""s of samples after which they are compared with gravity."""


@takes(RunOptions)
class Stream:
    """A filter run live: it takes samples and fixes as they come, and gives its state after each.

    Samples wait `lag` seconds for late events; then the stream uses all of them in time order. It
    drops and counts later events, and reports them. Before the start, no fix is too late. The
    result is that of `fuse` on the same events, bit for bit. A fix is used with the sample that
    reaches its time, or slightly later if its clock is estimated; a sample with a NaN is dropped.
    Fixes of sources that the filter cannot use have no effect. A filter that derives options from
    the fixes of a recording, such as their interval, uses the fixes of these sources, or without
    any, those before the start; `notes` lists the options. All kernels are compiled or loaded when
    the constructor returns.

    Without a complete start, the stream finds one from the first samples and fixes, and then uses
    them again from there on. It tries every 10 s. It accepts a start with known heading at once,
    and any other one `align_within` s (of samples) after the first sample. Until then the state is
    NaN and the status INVALID.

    Parameters
    ----------
    filter : str or Filter
        Name of one of the filters, or one of your own.
    sources : sequence of Source
        Kind, parameters and gate of each source; their fixes are not used.
    lag : float
        s that samples wait.
    on_event : callable
        Function called with (t, text) of each event when it begins. If it raises, the stream
        reports this as an event and does not call it again.
    align_within : float
        s of samples after which any start is taken.
    replay : bool
        True: `step` returns the state at the newest sample at once. A fix that is up to `lag` s
        late is used at its own time, and the samples since are used again.
    on_use : callable
        Function called with each Sample, and a list of Measurement, after the filter has used them.
    history : int
        Number of samples for `solution` and `verdict`; at least the newer half of them is kept.

    Raises
    ------
    DataError
        If an argument is out of range.
    """

    def __init__(
        self,
        filter: str | Filter,
        *,
        sources: Sequence[Source] = (),
        lag: float = 0.0,
        on_event: OnEvent | None = None,
        align_within: float = 60.0,
        history: int = HISTORY,
        replay: bool = False,
        on_use: OnUse | None = None,
        **given: Unpack[RunOptions],
    ) -> None:
        self._asked = asked = run_options(**given)
        _check(lag, align_within, history, asked["covariance"], replay)
        sources = apply_weights(checked_sources(sources), asked["robust"], asked["adaptive"])
        sources, of_imu = _with_estimates(sources, asked["estimate"])
        start, vehicle = asked["start"], asked["vehicle"]
        whole = isinstance(start, InitialState) and not missing_fields(start)
        self.noise, self._spec = assumed_noise(
            asked["imu"], asked["noise"], needed=not whole, without=""
        )
        self._filter = filter = filters.find(filter)
        sources, widened = with_correlated_errors(filter, sources)
        self._ahrs: _Ahrs | None = None
        first = choose_ahrs(filter, {a.kind for a in sources}, asked["ahrs"], asked["ahrs_rate"])
        if first:
            stream = Stream(
                first,
                sources=without_estimates(a for a in sources if a.kind != "attitude"),
                lag=lag,
                on_event=self._hear,
                align_within=align_within,
                history=history,
                start=start if whole else None,
                imu=asked["imu"],
                noise=asked["noise"],
                vehicle=vehicle,
                notify=asked["notify"],
            )
            sources = self._follow(stream, sources, asked["ahrs_rate"])
        self.notes = (self._ahrs.notes if self._ahrs else []) + widened
        if asked["estimate"] is None or (asked["estimate"] and not of_imu):
            of_imu, said = of_grade(filter, self._spec)
            self.notes += said
        self._vehicle, self._rows = find_vehicle(vehicle), history
        self.lag, self._replay, self._on_use = lag, replay, on_use
        self._serve(sources, of_imu)
        self._meta = _meta(self._vehicle if vehicle else None, of_imu)
        self._notifier = Notifier(_events(filter, self._used, self._vehicle, first), on_event)
        self._nothing_yet()
        _check_start(start, self.noise)
        check_options(filter, asked["options"] or {})
        self._make_ready(sources, tries=start is None and self._spec is not None)
        self._gathered = Gathering(
            filter, sources, self._spec, asked, align_within, history, self._meta
        )
        if start is not None and whole:
            self.begin(start)

    def _follow(self, ahrs: "Stream", sources: Sequence[Source], rate: float) -> tuple[Source, ...]:
        """Return the sources, with the attitudes of the AHRS stream."""
        self._ahrs = _Ahrs(ahrs, sources, rate)
        ahrs._row = self._take_attitude
        return (*sources, self._ahrs.made)

    def _serve(self, sources: Sequence[Source], of_imu: OfImu) -> None:
        """Set these sources and the estimated parameters of the IMU. Raises DataError."""
        of_ahrs = [self._ahrs is not None and self._ahrs.has_for_itself(a) for a in sources]
        left = [a for a, elsewhere in zip(sources, of_ahrs) if not elsewhere]
        self._used, _ = usable(self._filter, left)
        check_needs(self._filter, left)
        check_estimates(self._filter, parameters(self._used, of_imu))
        augmented_states(self._used, of_imu)  # refuses too many
        self._of_imu, self._sources, self._elsewhere = of_imu, Sources(sources), of_ahrs
        # among those that the filter can use
        self._places = [
            next((i for i, b in enumerate(self._used) if b is a), None) for a in sources
        ]
        waits = delays(self._used, of_imu)
        self._waits = [0.0 if place is None else waits[place] for place in self._places]
        self._before: list[UsableFix | None] = [None] * len(sources)  # the last fix used, by source

    def _nothing_yet(self) -> None:
        """Begin without samples and fixes."""
        # heaps of samples and of fixes; a number that keeps equal times in order
        self._samples: list[tuple[float, int, Sample]] = []
        self._waiting: list[tuple[float, int, int, UsableFix]] = []
        self._number = 0
        self.newest = -inf
        # events up to this time are too late
        self._late = self._late_fix = -inf
        self._began, self._stopped, self._looking = -inf, "", False
        self._look_at = inf  # s, when samples are compared with gravity
        self._decided: dict[str, Any] = {}  # options of the filter that its sources decided
        self._live: LiveRun | None = None
        self._front: Front | None = None
        self.belief = _nothing_known()
        self._row: Callable[[Stream, LiveRun], None] | None = None  # called after each sample

    def _make_ready(self, sources: Sequence[Source], tries: bool) -> None:
        """Compile or load all kernels that a step may need, so that no sample waits for them; with
        `tries`, also those of heading hypotheses."""
        kinds = [a.kind for a in self._used]
        needed = stages_of(self._filter, self._used, self._of_imu)
        prepare(self._filter, kinds, self._asked["notify"], needed)
        if tries and has_position(self._filter):
            closed_loop = filters.find("closed-loop")
            used, _ = usable(closed_loop, sources)
            needed = stages_of(closed_loop, used)
            prepare(closed_loop, [a.kind for a in used], self._asked["notify"], needed)

    # ---- the start

    @property
    def started(self) -> bool:
        """True once the stream has its start."""
        return self._live is not None

    @property
    def stopped(self) -> str:
        """Reason why the stream has stopped, which each further sample raises; empty while it
        runs."""
        return self._stopped

    @property
    def used(self) -> tuple[Source, ...]:
        """The sources that the filter can use."""
        return self._used

    def has_sample_at(self, sample: Sample) -> bool:
        """Return True where the time of a sample is that of used ones, or of one that waits."""
        t, near = sample[0], OCCUPIED * sample[1]
        return t <= self._late or any(abs(t - row[0]) < near for row in self._samples)

    def explains(self, samples: Sequence[Sample]) -> bool:
        """Return True where samples from before the newest one come late and have no other clock: the
        history has the same ones, or lacks them."""
        try:
            given, own = _rows_of(samples), self._kept_rows()
        except (TypeError, ValueError, OverflowError):  # some are no samples
            return False
        if not len(own) or given[0, 0] < own[0, 0]:
            return False
        row = np.searchsorted(own[:-1, 0], given[:, 0])
        count = int(((own[:, 0] >= given[0, 0]) & (own[:, 0] <= given[-1, 0])).sum())
        return np.array_equal(own[row], given) or 2 * count < len(given)

    def _kept_rows(self) -> Array:
        """Return the samples of the history, and those that wait, as `_rows_of`."""
        waiting = _rows_of([row[2] for row in sorted(self._samples)])
        if self._live is None:
            return np.vstack([_rows_of(self._gathered.samples), waiting])
        imu = self._live.samples
        return np.vstack([np.column_stack([imu.t, imu.dtheta, imu.dv]), waiting])

    @property
    def estimated(self) -> OfImu:
        """{parameter of the IMU that is a state: prior standard deviations}."""
        return self._of_imu

    @property
    def limits(self) -> Table[Limits]:
        """Limits of its samples and states, one row."""
        found: Table[Limits] = limits(self._spec, self.noise, self._vehicle)
        return found

    @property
    def waits_for(self) -> str:
        """Data that are needed before the state is valid, as text; empty where it is."""
        if self._live is None:
            return self._gathered.needs
        gap = self.status == INVALID and has_position(self._filter)
        return "a position fix that ends the gap" if gap else ""

    @property
    def unused(self) -> int:
        """Number of samples and measurements that wait, or serve to find a start."""
        gathered = self._gathered
        waiting = [row[-1] for row in self._waiting]
        fixes = sum(map(self._is_own, [*gathered.fixes, *waiting]))
        return len(self._samples) + len(gathered.samples) + fixes

    def _is_own(self, fix: UsableFix) -> bool:
        """Return True for a measurement of the caller that the filter uses; others have no effect."""
        made = self._ahrs._source if self._ahrs else None
        return self._places[fix.source] is not None and fix.source != made

    def source_index(self, source: str | int) -> int:
        """Return the index of a source, given by name or index. Raises DataError."""
        return self._sources.place(source, "stream")

    @property
    def start(self) -> InitialState | None:
        """Beginning of its history: the start, until older samples are dropped; None before."""
        return self._live.start if self._live else None

    def align(self) -> InitialState:
        """Return the InitialState from the samples and fixes so far, for `begin`; after the start,
        the one in use. Raises DataError where there is none."""
        return self._find_start() if self._live is None else self._live.start

    def _find_start(self) -> InitialState:
        """Return the start from the buffered data. Raises DataError, about the clock where it is
        the reason for a missing position."""
        try:
            return self._gathered.start()
        except DataError:
            events = self._notifier.events
            for row in events.rows:
                ahead = row.code == words.Said.FIXES_AHEAD
                if ahead and self._used[int(row.which)].kind == "position":
                    raise DataError(events.text(row)) from None
            raise

    def begin(self, start: InitialState | None = None) -> FilterState:
        """Start now, from this InitialState or that of `align`, and run over the data buffered
        since. Raises DataError."""
        if self._live is not None:
            raise DataError(f"the stream has started at {self._began:.3f} s; begin a new one")
        start = start or self.align()
        sources = self._used
        if self._gathered.samples and not any(len(a.t) for a in sources):
            sources = usable(self._filter, self._gathered.recording().sources)[0]
        asked = self._asked["options"] or {}
        options, notes = configure_options(self._filter, asked, sources)
        self._decided = {name: value for name, value in options.items() if name not in asked}
        self.notes += notes
        # with the fixes that the start is made of
        live = self._new_run(start, options, sources, self._notifier.events)
        samples, self._gathered.samples = self._gathered.samples, []
        fixes, self._gathered.fixes = self._gathered.fixes, []
        self._live, self.belief, self._began = live, live.belief, start.t
        self.newest = max(self.newest, start.t)
        self._late = self._late_fix = start.t + SAME_TIME
        self._look_at = start.t + LOOKS[0]
        self._count_before_start([*fixes, *(row[-1] for row in self._waiting)])
        fixes = sorted(
            (fix for fix in fixes if fix.t > self._late_fix),
            key=lambda fix: (self._due_at(fix), fix.source),
        )
        self._waiting = [row for row in self._waiting if row[-1].t > self._late_fix]
        heapify(self._waiting)
        self._use_gathered(live, samples, fixes)
        self._renew_front()
        return self.belief

    def _use_gathered(self, live: LiveRun, samples: list[Sample], fixes: list[UsableFix]) -> None:
        """Use the samples and fixes since the start, or count them as before it."""
        for k, sample in enumerate(samples):
            if not sample.t > self._late:
                self._notifier.drop("before the start", 0, None, sample.t)
                continue
            end = sample.t + SAME_TIME
            count = next((k for k, fix in enumerate(fixes) if self._due_at(fix) > end), len(fixes))
            try:
                self._advance(live, sample, fixes[:count])
            except DataError:
                self._put_back(samples[k + 1 :], fixes[count:])
                raise
            del fixes[:count]

    def _count_before_start(self, fixes: Sequence[UsableFix]) -> None:
        """Count those of the caller's measurements that served the start alone."""
        for fix in fixes:
            if self._is_own(fix) and fix.t <= self._late_fix:
                self._notifier.drop("before the start", 0, None, fix.t)

    def _new_run(
        self,
        start: InitialState,
        options: dict[str, Any],
        sources: tuple[Source, ...],
        events: Events,
    ) -> LiveRun:
        """Return the run from this start, with these options of the filter."""
        return LiveRun(
            SetUp(
                self._filter,
                self.noise,
                self._spec,
                options,
                sources,
                self._vehicle,
                self._of_imu,
            ),
            start,
            self._rows,
            self._asked["covariance"],
            self._asked["notify"],
            events,
        )

    def _gather(self, sample: Sample, fixes: list[UsableFix]) -> None:
        """Buffer data before the start, and start as soon as a sufficient start is found."""
        gathered = self._gathered
        self._late, self._late_fix = sample[0], sample[0] - SAME_TIME
        is_due = gathered.take(sample, fixes)
        self._notifier.dropped_by["before the start"] += sum(
            isinstance(each, Sample) or self._is_own(each) for each in gathered.forgotten
        )
        gathered.forgotten = []
        if not is_due:
            return
        try:
            gathered.check()
        except DataError as error:
            self._stop(sample[0], str(error))
        try:
            start = self._find_start()
        except DataError as error:
            text = str(error)
            gathered.found = f"a{text[2:]}" if text.startswith("no ") else f"a start: {text}"
            if gathered.late:
                self._notifier.note(words.Said.NO_START, 0, sample[0], because=str(error))
            return
        if not gathered.suffices(start):
            gathered.found = f"a better start than this one: {start.note}"
            if not gathered.late:
                return
            self._notifier.note(words.Said.POOR_START, 0, sample[0], because=start.note)
        self.begin(start)

    # ---- samples and fixes

    def step(self, event: Sample | Measurement) -> FilterState:
        """Take a Sample or a Measurement, use all data that have waited long enough, and return the
        filter state (updated in place). Raises DataError for other objects, without any change, and
        where the stream has stopped."""
        front = self._front if self._replay else None
        numbers = numbers_of(self) if front else []
        if isinstance(event, Sample):
            self._take_sample(event)
        elif isinstance(event, Measurement):
            self._take_fix(event)
        else:
            refuse_event(event)
        if front:
            front.take(self, event, numbers)
            self.belief = front.belief
        if self._notifier.waits:
            self._notifier.tell(self._event_time(self.t))
        return self.belief

    def _take_sample(self, event: Sample) -> None:
        try:
            t, dt, (a, b, c), (d, e, f) = event
            finite = isfinite(t + dt + a + b + c + d + e + f)
            possible = 0 < dt <= MAX_INTERVAL and type(t) is not bool and type(dt) is not bool
            possible = possible and -MAX_TIME <= t <= MAX_TIME
        except (TypeError, ValueError, OverflowError):
            refuse_sample(event)
        if not finite:
            self._notifier.drop("not finite", words.Said.SAMPLES_NOT_FINITE, 0, self._event_time(t))
        elif not possible:
            refuse_sample(event)
        elif not t > self._late:
            self._drop_sample(t)
        else:
            if t > self.newest:
                if t - self.newest > MAX_PAUSE and self.newest > -inf:
                    raise DataError(
                        f"IMU sample at {t:.3f} s: time jumps by {t - self.newest:.0f} s; begin a "
                        f"new stream there"
                    )
                self.newest = t
            if self._ahrs is not None:
                self._feed(self._ahrs, event)
            if self.lag == 0 and not self._samples:
                self._use_sample(event)
            else:
                self._number += 1
                heappush(self._samples, (t, self._number, event))
                self._use(self.newest - self.lag)

    def _take_fix(self, event: Measurement) -> None:
        fix = self._sources.usable(event)
        place = self._places[fix.source]
        if self._ahrs is not None:
            self._feed(self._ahrs, event._replace(source=fix.source))
        if place is None and (self._live is not None or self._elsewhere[fix.source]):
            return
        if not isfinite(fix.t) or not any(map(isfinite, fix.y)):
            self._notifier.drop(
                "not finite", words.Said.FIXES_NOT_FINITE, place, self._event_time(fix.t)
            )
        elif off := self._sources.length_error(fix):
            self._notifier.drop("wrong length", words.Said.FIXES_OF_WRONG_LENGTH, place, fix.t, off)
        elif self._live is None and self._due_at(fix) <= self._late + SAME_TIME:
            if self._is_new(fix):
                self._gathered.fixes.append(fix)
        elif not (self._due_at(fix) > self._late_fix and fix.t > self._began + SAME_TIME):
            self._drop_fix(fix)
        else:
            self._compare_clocks(fix)
            if len(self._waiting) == MAX_WAITING_FIXES:
                raise DataError(
                    f"{MAX_WAITING_FIXES} fixes wait for an IMU sample, the first at "
                    f"{self._waiting[0][-1].t:.3f} s; the stream needs samples to go on"
                )
            self._number += 1
            heappush(self._waiting, (self._due_at(fix), fix.source, self._number, fix))

    def _due_at(self, fix: UsableFix) -> float:
        """Return the time of its use, s: a fix whose clock is estimated waits."""
        return fix.t + self._waits[fix.source]

    def _compare_clocks(self, fix: UsableFix) -> None:
        """Report a fix far ahead of the samples, once there are any."""
        ahead, place = fix.t - self.newest, self._places[fix.source]
        if ahead > max(AHEAD, self.lag) and self.newest > self._began and place is not None:
            self._notifier.note(words.Said.FIXES_AHEAD, place, self.newest, ahead)

    def _feed(self, ahrs: "_Ahrs", event: Sample | Measurement) -> None:
        if text := ahrs.take(event):
            self._notifier.note(words.Said.AHRS_STOPPED, 0, event.t, because=text)

    def _hear(self, t: float, text: str) -> None:
        """Pass on the conditions of the AHRS; the filter itself reports on samples and fixes."""
        assert self._ahrs is not None  # whose this is
        if (said := f"{self._ahrs.made.name}: {text}") in self._notifier.events.of_ahrs:
            self._notifier.note(words.Said.AHRS_SAYS, self._notifier.events.of_ahrs.index(said), t)

    def _take_attitude(self, inner: "Stream", live: LiveRun) -> None:
        """Queue the attitude of the AHRS after its newest sample as a measurement."""
        assert self._ahrs is not None  # whose this is
        fix = self._ahrs.fix(live)
        if not inner._looking and (silent := live.t - self._ahrs.valid) > SILENT:
            name = self._ahrs.made.name
            self._notifier.note(words.Said.AHRS_SILENT, 0, live.t, silent, because=name)
        if fix is None:
            return
        self._number += 1
        if fix.t > self._late_fix:
            heappush(self._waiting, (fix.t, fix.source, self._number, fix))
        elif self._live is None:
            self._gathered.fixes.append(fix)

    def _use(self, until: float) -> None:
        samples = self._samples
        while samples and samples[0][0] <= until:
            sample = heappop(samples)[2]
            if sample[0] > self._late:
                self._use_sample(sample)
            else:
                self._drop_sample(sample[0])

    def _use_sample(self, sample: Sample) -> None:
        """Use one sample and the fixes up to its end."""
        if self._stopped:
            raise DataError(self._stopped)
        waiting, live = self._waiting, self._live
        fixes = (
            self._take_due(sample[0]) if waiting and waiting[0][0] <= sample[0] + SAME_TIME else []
        )
        if live is None:
            self._gather(sample, fixes)
        else:
            self._advance(live, sample, fixes)

    def _take_due(self, t: float) -> list[UsableFix]:
        """Return the fixes up to `t`, each once."""
        fixes, waiting = [], self._waiting
        while waiting and waiting[0][0] <= t + SAME_TIME:
            fix = heappop(waiting)[3]
            if self._is_new(fix):
                fixes.append(fix)
        return fixes

    def _is_new(self, fix: UsableFix) -> bool:
        """Return True unless a measurement repeats the one before of its source; then drop it."""
        before = self._before[fix.source]
        if before is not None and fix[:3] == before[:3]:
            self._drop_fix(fix)
            return False
        self._before[fix.source] = fix
        return True

    def _advance(self, live: LiveRun, sample: Sample, fixes: list[UsableFix]) -> None:
        """Run over a sample and fixes, and select the sources that the filter uses."""
        given = fixes
        if fixes:
            found = [(fix, self._places[fix.source]) for fix in fixes]
            fixes = [fix._replace(source=place) for fix, place in found if place is not None]
        t = sample[0]
        if self._looking:
            live.look(sample, fixes)
            if self._row is not None:
                self._row(self, live)
        else:
            overlap = self._late - t + sample[1]
            if overlap > MAX_OVERLAP * sample[1] and self._late > self._began + SAME_TIME:
                self._notifier.note(words.Said.SAMPLES_OVERLAP, 0, t, overlap)
            try:
                said = live.take(sample, fixes)
            except DataError as error:
                self._put_back([sample], given)
                self._stop(t, str(error))
            if said:
                self._notifier.add(live.new_events())
            if fixes and self._notifier.listens:
                self._notifier.notify(live.new_rejections(len(fixes)))
            if self._row is not None:
                self._row(self, live)
            if self._on_use is not None:
                self._on_use(sample, [Measurement(*fix) for fix in fixes])  # type: ignore[arg-type]  # three values
            if t >= self._look_at:
                self._compare_with_gravity(live, t)
        self._late, self._late_fix = t, t - SAME_TIME

    def _compare_with_gravity(self, live: LiveRun, t: float) -> None:
        self._look_at = self._began + next(
            seconds for seconds in LOOKS if self._began + seconds > t
        )
        for _, text in mistakes(live.samples, "increment", self._vehicle):
            self._stop(t, f"IMU: {text}")

    def _put_back(self, samples: Sequence[Sample], fixes: Sequence[UsableFix]) -> None:
        """Let data wait that a stream which stops has not used."""
        for sample in samples:
            self._number += 1
            heappush(self._samples, (sample.t, self._number, sample))
        for fix in fixes:
            self._number += 1
            heappush(self._waiting, (self._due_at(fix), fix.source, self._number, fix))

    def _stop(self, t: float, text: str) -> NoReturn:
        """Raise DataError, now and at all following samples."""
        self._stopped = text
        self._notifier.note(words.Said.STOPPED, 0, t, because=text)
        self._notifier.tell(self._event_time(self.t))
        raise DataError(text)

    @property
    def now(self) -> FilterState:
        """Return the filter state at the newest sample: a copy, propagated through the waiting
        data."""
        if self._live is None:
            return self.belief
        self._front = self._front or Front(self)
        if not self._replay:
            self._front.renew(self)
        return FilterState(*(column.copy() for column in self._front.belief))

    def _levels(self) -> list["Stream"]:
        """Return the stream and, once it has started, that of its AHRS."""
        inner = [self._ahrs.stream] if self._ahrs else []
        return [self, *(stream for stream in inner if stream._live is not None)]

    def _renew_front(self) -> None:
        """Show the newest state again after a start, a restart or the end."""
        if self._replay and self._live is not None:
            self._front = self._front or Front(self)
            self._front.renew(self)
            self.belief = self._front.belief

    def _run_ahead(self) -> "Stream":
        """Return a stream from here on, which reports nothing and keeps no history, for `Front`."""
        own = object.__new__(type(self))
        vars(own).update(vars(self))
        own._looking, own._front, own._replay = True, None, False
        if self._live is not None:
            own._live = self._live.run_ahead()
            own.belief = own._live.belief
        if self._ahrs is not None:
            own._ahrs = copy(self._ahrs)
            own._ahrs.stream = self._ahrs.stream._run_ahead()
            own._ahrs.stream._row = own._take_attitude
        return own

    def _mark(self) -> tuple[Any, ...]:
        """Return what a step changes, for `_return_to`."""
        assert self._live is not None  # `Front` asks after the start
        own, ahrs = (self._late, self._late_fix, self._stopped), self._ahrs
        of_ahrs = (ahrs._every, ahrs._count, ahrs.valid) if ahrs else ()
        return self._live.snapshot(), [*self._waiting], [*self._before], own, of_ahrs

    def _return_to(self, mark: tuple[Any, ...]) -> None:
        """Go back to where this stream, or the one that it runs ahead of, was."""
        assert self._live is not None
        arrays, waiting, before, own, of_ahrs = mark
        self._live.restore(arrays)
        self._waiting, self._before = [*waiting], [*before]
        self._late, self._late_fix, self._stopped = own
        if self._ahrs is not None:
            self._ahrs._every, self._ahrs._count, self._ahrs.valid = of_ahrs

    def finish(self) -> FilterState:
        """Use all waiting data and return the filter state; a stream that has not started does so.
        Raises DataError where no start is possible."""
        if self._ahrs is not None and not self._ahrs.stream._stopped:
            self._ahrs.stream.finish()
        self._use(inf)
        beyond = [row[-1] for row in self._waiting if self._places[row[-1].source] is not None]
        self._notifier.dropped_by[BEYOND] = len(beyond)
        for fix in beyond:
            self._compare_clocks(fix)
        if self._live is None:
            self.begin()
        if self._live is not None and self._notifier.listens:
            self._notifier.notify(self._live.new_rejections(0, over=True))
        self._renew_front()
        self._notifier.tell(self._event_time(self.t))
        return self.belief

    # ---- save and restore

    def save(self, path: File) -> None:
        """Write the state of the stream to a file, from which `restore` goes on bit for bit.

        The file holds the filter state with its covariance, the sources' states, counts and open
        waits, the samples and fixes that wait, and the events; no history. It is complete or
        absent, whenever the process ends.

        Parameters
        ----------
        path : str or Path
            File to write; an older one is replaced.

        Raises
        ------
        DataError
            If the stream has stopped, or the file cannot be written.
        """
        write_state(path, self.saved_content())

    def saved_content(self) -> dict[str, Any]:
        """Return what `save` writes. Raises DataError."""
        if self._stopped:
            raise DataError(f"{self._stopped}; there is nothing to go on from: begin a new stream")
        return {"set-up": self._set_up(), "stream": self._state()}

    def restore(self, path: File) -> FilterState:
        """Go on from a file that `save` wrote, with the same results as the stream that was saved.

        Build the stream as the saved one was built; `lag`, `history`, `every` and callbacks may
        differ. What it has done before is forgotten. The samples missed since are a gap. The
        history, and so `solution` and `verdict`, begin at the save.

        Parameters
        ----------
        path : str or Path
            File to read.

        Returns
        -------
        FilterState
            The filter state, NaN where the saved stream had not started.

        Raises
        ------
        DataError
            If the file is damaged or none that `save` wrote, or is of another version or of a
            stream with another filter, other sources or another IMU. The stream is then unchanged.
        """
        return self.put_content(path, read_state(path))

    def put_content(self, path: File, saved: Mapping[str, Any]) -> FilterState:
        """Go on from what `saved_content` returned and the file `path` holds. Raises DataError."""
        check_set_up(path, saved.get("set-up"), self._set_up())
        try:
            self._put(saved["stream"])
        except (ValueError, TypeError, KeyError, IndexError, OverflowError) as error:
            raise contradiction(path) from error
        return self.belief

    def _set_up(self) -> dict[str, str]:
        """Return by name the parts that a saved stream and this one must have in common."""
        options = (self._asked["options"] or {}).items()
        sources = [len(self._places), *(plain_source(a) for a in self._used)]
        return {
            "strapdown": __version__,
            "filter": self._filter.name,
            "options": repr(sorted((name, getattr(v, "name", v)) for name, v in options)),
            "sources": repr(sources),
            "IMU": repr((self.noise, self._spec, self._of_imu)),
            "vehicle": repr(self._vehicle),
            "AHRS": repr(self._ahrs.stream._set_up() if self._ahrs else None),
        }

    def _state(self) -> dict[str, Any]:
        """Return everything that the stream needs to go on, except the history, as `_put` takes
        it."""
        live = self._live
        return {
            "notes": [*self.notes],
            "before": [*self._before],
            "samples": [row[2] for row in self._samples],
            "waiting": [row[2:] for row in sorted(self._waiting)],
            "number": self._number,
            "times": [self.newest, self._late, self._late_fix, self._began, self._look_at],
            "dropped": {**self._notifier.dropped_by},
            "live": live.state() if live else None,
            "decided": self._decided,
            "events": None
            if live
            else self._notifier.events.state(rows(FixRow, 0), np.empty((0, 3))),
            "gathered": self._gathered.state(),
            "ahrs": self._ahrs.state() if self._ahrs else None,
        }

    def _put(self, saved: Mapping[str, Any]) -> None:
        """Go on from a `_state`; where it is none of this stream, raise ValueError, TypeError,
        KeyError, IndexError or OverflowError and leave the stream as it was."""
        before = {**vars(self)}
        try:
            self._replace_state(saved)
        except Exception:
            vars(self).update(before)
            raise

    def _replace_state(self, saved: Mapping[str, Any]) -> None:
        self._notifier = notifier = self._notifier.anew(saved["dropped"])
        self._gathered = copy(self._gathered)
        self._gathered.put(saved["gathered"])
        self._live, self._front, self._decided = None, None, dict(saved["decided"])
        self.belief = _nothing_known()
        if saved["live"] is None:
            notifier.events.put(saved["events"])
        else:
            options = (self._asked["options"] or {}) | self._decided
            begun = start_of(saved["live"]["begun"])
            live = self._new_run(begun, options, self._used, notifier.events)
            live.put(saved["live"])
            self._live, self.belief = live, live.belief
        self._stopped, self.notes = "", [str(note) for note in saved["notes"]]
        self.newest, self._late, self._late_fix, self._began, look_at = map(float, saved["times"])
        # what came before is not in the history
        self._look_at = max(look_at, self._late + LOOKS[0]) if look_at < inf else inf
        self._before = [fix and fix_of(fix) for fix in saved["before"]]
        if len(self._before) != len(self._places):
            raise ValueError("other sources")
        self._put_waiting(saved)
        if self._ahrs is not None:
            self._ahrs = copy(self._ahrs)
            self._ahrs.put(saved["ahrs"])
        self._renew_front()

    def _put_waiting(self, saved: Mapping[str, Any]) -> None:
        """Take the samples and fixes that waited, of a `_state`."""
        self._number = int(saved["number"])
        samples = [sample_of(sample) for sample in saved["samples"]]
        self._samples = [(sample.t, k, sample) for k, sample in enumerate(samples)]
        heapify(self._samples)
        self._waiting = []
        for number, fields in saved["waiting"]:
            fix = fix_of(fields)
            self._waiting.append((self._due_at(fix), fix.source, int(number), fix))
        heapify(self._waiting)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Stream":
        own = object.__new__(type(self))
        memo[id(self)] = own
        for part in ("_asked", "_spec", "_vehicle", "_sources", "_used", "_of_imu", "_meta"):
            value = getattr(self, part)  # never changes
            memo[id(value)] = value
        for callback in (self._asked["notify"], self._on_use):
            memo[id(callback)] = callback
        for name, value in vars(self).items():
            setattr(own, name, deepcopy(value, memo))
        return own

    def __copy__(self) -> NoReturn:
        raise TypeError("a copy of a Stream would share its state: use copy.deepcopy")

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError("a Stream cannot be pickled: use its methods save and restore")

    # ---- reports

    def _event_time(self, t: float) -> float:
        """Return a time for an event: `t`, or the newest one where `t` is not finite."""
        return t if isfinite(t) else self.newest if isfinite(self.newest) else 0.0

    def _drop_sample(self, t: float) -> None:
        if self._looking:
            return
        if t <= self._began + SAME_TIME:
            self._notifier.drop("before the start", 0, None, t)
        elif t == self._late:
            self._notifier.drop("twice", words.Said.SAMPLES_TWICE, 0, t)
        else:
            self._notifier.drop("late", words.Said.SAMPLES_LATE, 0, t, self._late - t)

    def _drop_fix(self, fix: UsableFix) -> None:
        if self._looking:
            return
        before, place = self._before[fix.source], self._places[fix.source]
        if fix.t <= self._began + SAME_TIME:
            self._notifier.drop("before the start", 0, None, fix.t)
        elif before is not None and fix[:3] == before[:3]:
            self._notifier.drop("twice", words.Said.FIXES_TWICE, place, fix.t)
        else:
            self._notifier.drop("late", words.Said.FIXES_LATE, place, fix.t, self._late - fix.t)

    @property
    def events(self) -> list[tuple[float, str]]:
        """[(t, text)] of the events that the user must know, as in a Solution."""
        return (self._live.all_events() if self._live else self._notifier.events).all

    @property
    def dropped_by(self) -> dict[str, int]:
        """Numbers of unused samples and fixes by reason."""
        return dict(self._notifier.dropped_by)

    @property
    def dropped(self) -> int:
        """Number of unused samples and fixes; `dropped_by` has the reasons."""
        return sum(self._notifier.dropped_by.values())

    @property
    def t(self) -> float:
        """Time of the filter state, s; NaN before the start."""
        front = self._front if self._replay else None
        return front.t if front else self._live.t if self._live else nan

    @property
    def status(self) -> int:
        """VALID, BRIDGED, INVALID or DOUBTFUL, as in a row of a Solution."""
        front = self._front if self._replay else None
        return front.status if front else self._live.status if self._live else INVALID

    def counts(self) -> list[tuple[int, int]]:
        """(accepted, rejected) per source; (0, 0) for a source that the filter cannot use."""
        if self._live is None:
            return [(0, 0)] * len(self._places)
        cursor = self._live.cursor
        counts = list(zip(cursor.books["accepted"].tolist(), cursor.books["rejected"].tolist()))
        return [(0, 0) if place is None else counts[place] for place in self._places]

    def tested_after(self, t: float, most: int = 100) -> list[TestedMeasurement]:
        """Return measurements with the results of their tests, those that the filter was given last.

        Parameters
        ----------
        t : float
            Only measurements that are later count, s.
        most : int
            Largest number of measurements to return.

        Returns
        -------
        list of TestedMeasurement
            In time order; of each the source is its index in `sources`.
        """
        found = self._live.tested_after(t, most) if self._live else []
        return [each._replace(source=self._places.index(each.source)) for each in found]

    @property
    def solution(self) -> Solution:
        """Return the Solution of the history, as from `fuse`. Raises DataError before the first
        sample is used."""
        return self._used_live().solution(self._asked["every"], {**self._meta, "notes": self.notes})

    def history(self) -> tuple[Run, int, Callable[[], bool]] | None:
        """Return the history and `every` for `solution_of`, and a function that tells whether the arrays,
        which are views, still hold it; None before the first sample is used."""
        live = self._live
        if live is None or not live.cursor.state[0].row:
            return None
        number = live.forgotten
        run = live.history({**self._meta, "notes": self.notes})
        return run, self._asked["every"], lambda: live.forgotten == number

    def _used_live(self) -> LiveRun:
        if self._live is None or not self._live.cursor.state[0].row:
            raise DataError("the stream has used no sample yet; there is no solution")
        return self._live

    @property
    def recording(self) -> Recording:
        """Return the Recording of the history: samples, and fixes of the sources that the filter
        can use. Raises DataError before the first sample is used."""
        return self._used_live().recording({**self._meta, "notes": self.notes})

    @property
    def verdict(self) -> Verdict:
        """Return the verdict on its `solution`: whether to trust the history, and the reasons."""
        return self.solution.verdict


def _rows_of(samples: Sequence[Sample]) -> Array:
    """Return samples as rows (n, 7) of time, s, and increments, rad and m/s."""
    return np.array([[t, *dtheta, *dv] for t, _, dtheta, dv in samples], float).reshape(-1, 7)


def _with_estimates(
    sources: tuple[Source, ...], estimate: Estimate | None
) -> tuple[tuple[Source, ...], OfImu]:
    """Return the sources and the IMU's parameters with those to estimate. Raises DataError."""
    return (sources, {}) if estimate is None else asked_of(sources, estimate)


def _events(
    filter: Filter, used: Sequence[Source], vehicle: Vehicle, ahrs: Filter | None
) -> Events:
    """Return the events of a stream, with the conditions of its AHRS."""
    found = Events(filter, used, vehicle)
    if ahrs:
        found.of_ahrs = tuple(f"{ahrs.name}: {c.text}" for c in ahrs.conditions)
    return found


def _meta(vehicle: Vehicle | None, of_imu: OfImu) -> RecordingMeta:
    """Return the metadata of the recording of a stream."""
    meta: RecordingMeta = {"name": "stream"}
    if vehicle:
        meta["vehicle"] = vehicle
    if of_imu:
        meta["estimate"] = of_imu
    return meta


def _check_start(start: InitialState | None, noise: Noise) -> None:
    """Refuse a start, or a part of one, that no filter can begin with. Raises DataError."""
    if start is not None:
        missing = missing_fields(start) if isinstance(start, InitialState) else ()
        check_start(start, noise, missing)


def _check(lag: float, align_within: float, history: int, covariance: bool, replay: bool) -> None:
    """Refuse arguments out of range. Raises DataError."""
    check_number(lag, "lag", "s", least=0)
    if check_flag(replay, "replay") and not lag:
        raise DataError("replay needs a lag: the s by which a fix may be late, such as lag=2")
    check_number(align_within, "align_within", "s", least=0, infinite=True)
    most = MAX_HISTORY // 5 if covariance else MAX_HISTORY
    check_number(history, "history", "samples", least=100, most=most, whole=True)


class _Ahrs:
    """The stream of an AHRS for another stream, which uses its attitudes as measurements. It is
    never behind that stream."""

    def __init__(self, stream: Stream, sources: Sequence[Source], rate: float) -> None:
        self.stream, self._rate, self._every, self._count = stream, rate, 0, 0
        filter = stream._filter
        self.valid = inf  # time of its last valid row, or of its first one
        self._taken = taken_by(filter, sources)
        self._replaced = [a for a in sources if a.kind == "attitude"]
        self._source, own = len(sources), [a for a in sources if a.kind != "attitude"]
        self._places = [next((i for i, b in enumerate(own) if b is a), None) for a in sources]
        self.made = Source(
            "attitude", np.empty(0), np.empty((0, 3)), np.empty((0, 3)), name=filter.name
        )

    @property
    def notes(self) -> list[str]:
        """Notes on the AHRS, its rate and its sources."""
        notes = notes_on(self.stream._filter, self._rate, bool(self._taken))
        notes[0] += whose(self._taken, self._replaced)
        return notes

    def has_for_itself(self, a: Source) -> bool:
        """True where only the AHRS uses this source, or its attitudes replace it."""
        return a is not self.made and (a.kind == "attitude" or any(a is b for b in self._taken))

    def take(self, event: Sample | Measurement) -> str:
        """Pass a sample or a fix of the stream to the AHRS; return a message on it, once."""
        if isinstance(event, Measurement):
            assert isinstance(event.source, int)  # the stream has resolved its name
            place = self._places[event.source]
            if place is None:
                return ""
            event = event._replace(source=place)
        if self.stream._stopped:
            return ""
        try:
            self.stream.step(event)
        except DataError as error:
            if not self.stream._stopped:
                raise
            return f"{self.made.name}: {error}; no attitude from here on"
        return ""

    def fix(self, live: LiveRun) -> UsableFix | None:
        """Return its attitude after its newest sample, when one is due."""
        if not self._every:
            own = live.rate
            if self._rate > own * 1.001:
                raise DataError(
                    f"ahrs_rate is {self._rate:g} Hz; it must be at most the IMU's {own:.4g} Hz"
                )
            self._every = round(own / self._rate)
        self._count += 1
        if live.status == VALID or self.valid == inf:
            self.valid = live.t
        if self._count % self._every or live.status != VALID:
            return None
        path = live.newest()
        y, std = attitudes(live.filter, path, bool(self._taken))
        return UsableFix(float(path.t[0]), self._source, y[0].tolist(), std[0].tolist())

    def state(self) -> dict[str, Any]:
        """Return its state as `put` takes it."""
        count, valid = self._count, self.valid
        return {
            "every": self._every,
            "count": count,
            "valid": valid,
            "stream": self.stream._state(),
        }

    def put(self, saved: Mapping[str, Any]) -> None:
        """Go on from a `state`; raises as `Stream._put`."""
        self._every, self._count = int(saved["every"]), int(saved["count"])
        self.valid = float(saved["valid"])
        self.stream._put(saved["stream"])


def _nothing_known() -> FilterState:
    def nans(*shape: int) -> Array:
        return np.full(shape, nan)

    three = (nans(3) for _ in range(7))
    lla, v, b_a, b_g, omega, f, _ = three
    return FilterState(
        lla, v, nans(3, 3), b_a, b_g, nans(STATES, STATES), omega, f, nans(0), nans(0)
    )
