"""One run: a filter over raw data, in batch, smoothed or live."""

from collections.abc import Iterator, Sequence
from heapq import merge
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown import filters
from strapdown.core.loop.contract import STATES, Filter, InitialState
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution, Source, Trajectory
from strapdown.engine.batch import fuse
from strapdown.engine.smoothing import smooth
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.typing import Array, Ints

from .fault import AHRS, GNSS, HEIGHT, KINDS, LIVE, MAGNETOMETER, START, Fault
from .judging import FaultOutcome
from .raw import Raw, RawFixes
from .worlds import ATTITUDE, DATE, HEAVE, NAVIGATION, FaultWorld

BATCH, SMOOTHED, STREAM = "batch", "smoothed", "live"
STREAMED = ("closed-loop", "mekf", "nlo", "attitude-mekf")
"""Filters that run live too; live and batch are the same loop for all."""
SMOOTHERS = ("closed-loop", "open-loop", "mekf", "attitude-mekf")
OPTIONS: dict[str, dict[str, Any]] = {"pkf": {"components": 50}}
"""A tenth of its components, for the time it takes."""
LAG = 0.3
"""s that a stream waits for late events."""
SLOW, SLOW_SEEDS = ("pkf", "ukf", "ckf"), 1
"""Filters that take ten times as long, and the most seeds that they run on."""
WITH_ATTITUDE = ("mekf",)
"""Filters that an attitude record is given to though they could do without."""


class FaultSubject(NamedTuple):
    """A filter and how it runs."""

    filter: str
    way: str = BATCH

    @property
    def name(self) -> str:
        """As in the tables."""
        return self.filter if self.way == BATCH else f"{self.filter} {self.way}"


def subjects(names: Sequence[str] | None = None) -> list[FaultSubject]:
    """Every filter in every way that it runs, or those of these names."""
    found = [FaultSubject(name) for name in filters.own_names()]
    found += [FaultSubject(name, SMOOTHED) for name in SMOOTHERS]
    found += [FaultSubject(name, STREAM) for name in STREAMED]
    return [one for one in found if names is None or one.name in names]


def family(filter: Filter) -> str:
    """Return what the filter estimates: NAVIGATION, ATTITUDE or HEAVE."""
    if filter.uses is None or "position" in filter.uses:
        return NAVIGATION
    return ATTITUDE if "magnetic-field" in filter.uses else HEAVE


def kinds(filter: Filter) -> tuple[str, ...]:
    """The sources that it is given."""
    if family(filter) == ATTITUDE:
        return KINDS[MAGNETOMETER]
    if family(filter) == HEAVE:
        return KINDS[HEIGHT]
    fed = "attitude" in filter.needs or filter.name in WITH_ATTITUDE
    return KINDS[GNSS] + KINDS[AHRS] * fed


def kinds_with(fault: Fault, subject: FaultSubject) -> tuple[str, ...] | None:
    """The sources of a run with a fault: a magnetometer or a second source of height come in where
    they are what fails. None where the fault does not concern the filter."""
    filter = filters.find(subject.filter)
    own = kinds(filter)
    if fault.of == LIVE:
        return own if subject.way == STREAM else None
    if fault.of == START:
        return own if family(filter) == NAVIGATION else None
    concerned = KINDS.get(fault.of, ())
    if set(concerned) <= set(own):
        return own
    may = filter.uses is None or set(concerned) <= set(filter.uses)
    if fault.of in (MAGNETOMETER, HEIGHT) and family(filter) == NAVIGATION and may:
        return own + concerned
    return None


def run(
    subject: FaultSubject, raw: Raw, world: FaultWorld, right: Recording, start: InitialState | None
) -> FaultOutcome:
    """The FaultOutcome of a run. right: the recording without the fault, by which a stream is set up;
    start: that of the run without a fault, None there. Raises DataError."""
    given = raw.start(start) if raw.start and start else None
    options = OPTIONS.get(subject.filter, {})
    if subject.way == STREAM:
        return _live(subject.filter, raw, world, right, given or start)
    way = smooth if subject.way == SMOOTHED else fuse
    recording = raw.recording(world.imu, date=DATE)
    return outcome(way(recording, subject.filter, start=given, every=world.every, options=options))


def outcome(solution: Solution) -> FaultOutcome:
    """The Outcome of a Solution."""
    notes = tuple(solution.meta["notes"])
    return FaultOutcome(
        solution.trajectory,
        solution.status,
        notes,
        solution.events,
        lambda: solution.verdict,
        solution.innovations,
    )


def start_of(subject: FaultSubject, right: Recording) -> InitialState:
    """Where the run without a fault begins."""
    solution = fuse(right, subject.filter, every=1000, options=OPTIONS.get(subject.filter, {}))
    return InitialState(**solution.meta["start"])


Arrival: TypeAlias = tuple[float, Sample | Measurement]
"""When an event comes, and the event."""


def _live(
    name: str, raw: Raw, world: FaultWorld, right: Recording, start: InitialState | None
) -> FaultOutcome:
    """A stream that gets each event when it arrives, with the stamp that it bears."""
    assert start is not None
    filter = filters.find(name)
    sources = [_describe_source(a, raw) for a in right.sources if a.kind in raw.sources]
    stream = Stream(name, start=start, imu=world.imu, sources=sources, lag=LAG)
    rows: list[Array] = []
    status: list[int] = []
    places = {a.kind: i for i, a in enumerate(sources)}
    fixes = (_fixes(source, places[source.kind]) for source in raw.sources.values())
    samples, last = 0, -np.inf
    for _, event in merge(*fixes, _samples(raw), key=itemgetter(0)):
        belief = stream.step(event)
        samples += isinstance(event, Sample)
        if samples % world.every == 0 and stream.t > last:
            last = stream.t
            std = np.sqrt(np.maximum(np.diag(belief.P)[:STATES], 0.0))
            rows.append(np.concatenate([[last], belief.lla, belief.v_n, belief.C_nb.ravel(), std]))
            status.append(stream.status)
    stream.finish()
    events = tuple(stream.events)
    table = np.array(rows).reshape(-1, 16 + STATES)
    return FaultOutcome(
        _trajectory(table, filter),
        np.array(status),
        tuple(stream.notes),
        events,
        lambda: stream.verdict,
    )


def _describe_source(a: Source, raw: Raw) -> Source:
    """The description of a source, with the parameters that the fault gives it."""
    return Source(a.kind, a.t, a.y, a.std, raw.sources[a.kind].parameters, name=a.name)


def _samples(raw: Raw) -> Iterator[Arrival]:
    """Increments as a careful logger makes them: over the usual interval where stamps are further
    apart, or not apart at all."""
    dt = np.diff(raw.t, prepend=np.nan)
    usual = np.nanmedian(dt)
    dt = np.where((dt > 0) & (dt < 1.75 * usual), dt, usual)
    order = _order(raw.arrival)
    columns = np.c_[raw.arrival, raw.t, dt, raw.gyro * dt[:, None], raw.accel * dt[:, None]][order]
    for at, t, step, *six in zip(*(column.tolist() for column in columns.T)):
        yield at, Sample(t, step, tuple(six[:3]), tuple(six[3:]))


def _fixes(source: RawFixes, place: int) -> Iterator[Arrival]:
    for i in _order(source.arrival).tolist():
        fix = Measurement(
            float(source.t[i]), place, tuple(source.y[i].tolist()), tuple(source.std[i].tolist())
        )
        yield float(source.arrival[i]), fix


def _order(arrival: Array) -> Ints:
    """Which come, in the order in which they do."""
    order = np.argsort(arrival, kind="stable")
    return order[np.isfinite(arrival[order])]


def _trajectory(rows: Array, filter: Filter) -> Trajectory:
    """Return the Trajectory of rows t, lla, v, C, std; what the filter does not estimate or claim is
    NaN, as in a Solution."""
    for first, column in ((0, 1), (3, 4)):
        rows[:, [column + i for i in range(3) if first + i not in filter.estimates]] = np.nan
    std = rows[:, 16:]
    std[:, [i for i in range(STATES) if i not in filter.states]] = np.nan
    q = Rotation.from_matrix(rows[:, 7:16].reshape(-1, 3, 3)).as_quat()[:, [3, 0, 1, 2]]
    return Trajectory(rows[:, 0], rows[:, 1:4], rows[:, 4:7], q, std)
