"""The runs of a comparison.

A protocol of one run withholds its fixes from a single run of each filter. In a sweep each window
has a separate run with all fixes before it, and windows may overlap: the filter runs once with all
fixes, its complete state is kept just before the first withheld fix of each window, and each window
continues from there without its fixes. This equals, bit for bit, the run of `fuse` on
`recording.hidden([window], kinds)`.
"""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ...checks import DataError
from ...core.loop import loop
from ...core.loop.contract import DOUBTFUL, Cursor, Filter, FilterState, Imu, InitialState
from ...data.recording import Recording
from ...data.solution import Source
from ...data.verdict import Verdict
from ...engine.batch import begin
from ...engine.events import Events
from ...engine.finish import solution
from ...engine.options import RunOptions
from ...engine.prepare import Run, new_output
from ...typing import Progress
from .scores import ErrorTrack, ScoredOutage, score_outage

KEPT_INTERVAL = 1.0
"""s between the rows that are kept of a filter's way, for its verdict."""

Stand: TypeAlias = tuple[FilterState, Cursor]
"""A filter on its way, copied before an IMU row."""
Result: TypeAlias = tuple[dict[str, float], ErrorTrack, Sequence[tuple[float, str]]] | str
"""Scores, errors and events of a filter in an outage, or why there are none."""


class Common(NamedTuple):
    """The inputs that all filters of a comparison share."""

    recording: Recording  # with all its fixes
    hidden: Recording  # without those of any outage
    sweep: bool
    outages: list[ScoredOutage]
    kinds: tuple[str, ...]
    given: (
        RunOptions  # as it was given, with the start of all; its AHRS is of filters that need one
    )

    @property
    def start(self) -> InitialState:
        """The InitialState of all."""
        start = self.given["start"]
        assert start is not None  # it was found before the runs
        return start


class Entrant(NamedTuple):
    """One filter of a comparison."""

    label: str
    filter: Filter
    options: dict[str, Any]
    estimate: tuple[str, ...] | None = None  # None: what the recording has


class FilterWay(NamedTuple):
    """The run of one filter up to the outages."""

    run: Run | None  # that it made; None where it cannot run at all
    stands: dict[int, Stand]  # {IMU row: (Belief, Cursor) before it}
    # each outage needs a separate run from the start, because its input depends on what is
    # withheld
    alone: bool
    said: str  # why it cannot run, or stopped
    verdict: Verdict | None = None  # on its run to the end of the recording
    doubtful: float = 0.0  # s of that


def through(
    common: Common, entrants: list[Entrant], threads: int | None, report: Progress
) -> tuple[list[FilterWay], list[list[Result]]]:
    """([Way], per filter and outage (row, Track, events) or text): first every filter's way to
    the outages, then all outages of all filters."""
    weights = [each.last - each.branch for each in common.outages]
    before = len(common.recording.imu.t)
    total, done = len(entrants) * (before + sum(weights)), 0
    pool = ThreadPoolExecutor(threads)
    try:
        going = {pool.submit(_way, common, entrant): i for i, entrant in enumerate(entrants)}
        for future in as_completed(going):
            future.result()
            done += before
            report(done / total)
        ways = [future.result() for future in going]
        pairs = [(i, k) for k in range(len(common.outages)) for i in range(len(entrants))]
        inside = {
            pool.submit(_in_outage, common, entrants[i], ways[i], common.outages[k]): (i, k)
            for i, k in pairs
        }
        for ended in as_completed(inside):
            ended.result()
            done += weights[inside[ended][1]]
            report(done / total)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    results = {place: ended.result() for ended, place in inside.items()}
    return ways, [[results[i, k] for k in range(len(common.outages))] for i in range(len(entrants))]


def _begin_run(common: Common, entrant: Entrant, recording: Recording) -> Run:
    """The Run of a filter on `recording`, which keeps a row per second on the way."""
    asked: RunOptions = {
        **common.given,
        "options": entrant.options,
        "estimate": entrant.estimate,
        "every": max(1, round(KEPT_INTERVAL / float(np.median(recording.imu.dt)))),
        "ahrs": common.given["ahrs"] if "attitude" in entrant.filter.needs else None,
    }
    return begin(recording, entrant.filter, asked)


def _way(common: Common, entrant: Entrant) -> FilterWay:
    """The Way of a filter."""
    base = common.recording if common.sweep else common.hidden
    try:
        run = _begin_run(common, entrant, base)
    except DataError as error:
        return FilterWay(None, {}, False, str(error))
    if common.sweep and not _fed_alike(common, entrant, _ahrs_sources(run, base)):
        return FilterWay(run, {}, True, "", *_judge_run(run))
    stands = _stands(run, {each.branch for each in common.outages})
    return FilterWay(run, stands, False, _stop_reason(run), *_judge_run(run))


def _judge_run(run: Run) -> tuple[Verdict | None, float]:
    """(the Verdict on a run, which goes on to its end, s of doubtful rows); (None, 0) where it has
    no solution."""
    run.complete()
    try:
        made = solution(run)
    except DataError:
        return None, 0.0
    return made.verdict, made.seconds(DOUBTFUL)


def _fed_alike(common: Common, entrant: Entrant, fed: list[Source]) -> bool:
    """True where the AHRS attitudes `fed` to a filter stay the same in a run without the fixes of
    any outage."""
    try:
        other = (
            _ahrs_sources(_begin_run(common, entrant, common.hidden), common.hidden) if fed else []
        )
    except DataError:
        return False
    return len(fed) == len(other) and all(
        np.array_equal(getattr(a, part), getattr(b, part), equal_nan=True)
        for a, b in zip(fed, other)
        for part in ("t", "y", "std")
    )


def _ahrs_sources(run: Run, recording: Recording) -> list[Source]:
    """The sources of a Run that are none of the recording's: the attitude of an AHRS that ran
    first."""
    return [a for a in run.recording.sources if not _is_of(a, recording)]


def _is_of(a: Source, recording: Recording) -> bool:
    """True where the source is one of the recording's, perhaps with other parameters as states."""
    return any(a.y is own.y for own in recording.sources)


def _copy_stand(belief: FilterState, cursor: Cursor) -> Stand:
    """The same with arrays of their own, so that a run that goes on does not change them."""
    return (
        FilterState._make(part.copy() for part in belief),
        Cursor._make(part.copy() for part in cursor),
    )


def _stands(run: Run, rows: Iterable[int]) -> dict[int, Stand]:
    """{row: (Belief, Cursor)} copied before these IMU rows on the way of `run`, as far as it
    gets."""
    stands: dict[int, Stand] = {}
    for row in sorted(rows):
        run.advance(row)
        if run.cursor.state[0].fault:
            break
        stands[row] = _copy_stand(run.belief, run.cursor)
    return stands


def _stop_reason(run: Run) -> str:
    """Why `run` stopped, "" where it did not."""
    if not run.cursor.state[0].fault:
        return ""
    try:
        return solution(run).meta["stopped"]
    except DataError as error:
        return str(error)


def _in_outage(common: Common, entrant: Entrant, way: FilterWay, outage: ScoredOutage) -> Result:
    """(scores, Track, events) of a filter in an outage, or why there are none."""
    run, stands, said = way.run, way.stands, way.said
    if run is None:
        return said
    try:
        if way.alone:
            run = _begin_run(common, entrant, common.recording.hidden([outage[:2]], common.kinds))
            stands, said = _stands(run, {outage.branch}), _stop_reason(run)
        if outage.branch not in stands:
            return said
        made = solution(
            _run_branch(run, stands[outage.branch], outage, _withheld_sources(common, run))
        )
        if "stopped" in made.meta:
            return made.meta["stopped"]
        return *score_outage(made, outage), made.events
    except DataError as error:
        return str(error)


def _withheld_sources(common: Common, run: Run) -> list[int]:
    """Numbers of the sources of `run` whose fixes are still to be withheld: the recording's own,
    whole, of such a kind."""
    return [
        s
        for s, a in enumerate(run.recording.sources)
        if a.kind in common.kinds and _is_of(a, common.recording)
    ]


def _run_branch(run: Run, stand: Stand, outage: ScoredOutage, sources: list[int]) -> Run:
    """The Run of an outage to its end: from where it branches off, without its fixes; only its
    scored rows are kept."""
    belief, cursor = _copy_stand(*stand)
    rows, fixes = slice(outage.branch, outage.last), run.fixes
    samples = Imu(*(column[rows] for column in run.samples))
    near = slice(
        int(cursor.state[0].fix),
        int(np.searchsorted(fixes.t, samples.t[-1] + loop.SAME_TIME, side="right")),
    )
    t, source = fixes.t[near], fixes.source[near]
    # a fix whose clock is a state is used after its time stamp
    waited = fixes.sources["delay"][source]
    stamp = np.where(waited > 0, np.round(t - waited, 9), t)
    keep = ~((stamp >= outage.start) & (stamp < outage.stop) & np.isin(source, sources))
    fixes = fixes._replace(
        t=t[keep],
        source=source[keep],
        y=fixes.y[near][keep],
        std=fixes.std[near][keep],
        sources=fixes.sources.copy(),  # the loop writes there, and outages run at a time
    )
    state, unscored = cursor.state[0], outage.first - outage.branch
    state.row = state.fix = state.out = 0
    state.fixes, state.every, state.phase = keep.sum(), 1, -1
    out = new_output(run.filter, belief, len(samples.t) - unscored, False, len(fixes.t))
    start = run.start._replace(t=float(cursor.state[0].t))
    events = Events(run.filter, run.recording.sources, run.events.vehicle)
    branched = run._replace(
        samples=samples,
        start=start,
        belief=belief,
        fixes=fixes,
        cursor=cursor,
        out=out,
        first=0,
        events=events,
    )
    branched.advance(unscored)
    if not state.fault:
        state.phase = 0
        branched.advance(len(samples.t))
    return branched
