"""Runs of rejections of several sources at the same time: which runs explain the others, and which
only show that the sources contradict each other."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from .causes import (
    ALWAYS,
    CLOCK,
    DISAGREE,
    DRIFT,
    JUMP,
    NOISE,
    OFFSET,
    OUTLIERS,
    SCALE,
    START,
    UNKNOWN,
    CauseFound,
)

BY_THEMSELVES = (OUTLIERS, START)
"""Shapes that do not concern other sources."""
CHAIN = 30.0  # s within which rejections may have one cause
MIN_EXPLAINED = 0.5  # part of the total that one run must explain to be the cause of the others


class RejectedRun(NamedTuple):
    """Rejected fixes of a source and their cause."""

    source: int
    start: float  # s, of the first and of the last of them
    stop: float
    number: int  # rejected
    of: int  # fixes of the source meanwhile
    largest: float  # how far off, standard deviations
    found: CauseFound
    others: tuple[int, ...] = ()  # sources that were rejected at the same time
    silent: float = 0.0  # s since the fix before its cause; inf for the first fix
    receiver: str = ""  # of which the source is a class


def plain_run(run: RejectedRun) -> list[Any]:
    """Return a run as lists, numbers and text, for `run_of_plain`."""
    found = run.found._replace(size=run.found.size.tolist())
    return [*run._replace(found=[*found], others=[*run.others])]  # type: ignore[arg-type]  # for JSON


def run_of_plain(fields: Sequence[Any]) -> RejectedRun:
    """Return the run of these fields."""
    run = RejectedRun(*fields)
    shape, size, *rest = fields[RejectedRun._fields.index("found")]
    found = CauseFound(shape, np.array(size, float), *map(float, rest))
    return run._replace(found=found, others=tuple(run.others))


def assign_blame(runs: list[RejectedRun]) -> list[RejectedRun]:
    """Return the runs in time order. Of simultaneous runs some keep their own cause; the others of
    each source become one run that contradicts other sources."""
    alone = [run for run in runs if run.found.shape in BY_THEMSELVES]
    for together in _together([run for run in runs if run.found.shape not in BY_THEMSELVES]):
        alone += _judge_runs(together)
    return sorted(alone, key=lambda run: (run.start, run.source))


def _together(runs: list[RejectedRun]) -> Iterator[list[RejectedRun]]:
    gathered: list[RejectedRun] = []
    for run in runs:
        if gathered and run.start > max(each.stop for each in gathered) + CHAIN:
            yield gathered
            gathered = []
        gathered.append(run)
    yield gathered


def _judge_runs(runs: list[RejectedRun]) -> list[RejectedRun]:
    sources = {run.source for run in runs}
    # classes of a receiver have no fix at the same time, and so contradict nothing
    if len({run.receiver or run.source for run in runs}) < 2:
        return runs
    gain, count = sum(run.found.gain for run in runs), sum(run.number for run in runs)
    best = max((run.found for run in runs), key=lambda found: found.gain)
    shaped = sum(run.number for run in runs if run.found.shape not in (NOISE, UNKNOWN))

    def explains(run: RejectedRun) -> bool:
        shape = run.found.shape
        if shape == CLOCK:  # which both position and velocity show
            return best.shape == CLOCK
        if shape == NOISE:  # of each source by itself
            return run.number > MIN_EXPLAINED * (shaped + run.number)
        if shape in (OFFSET, SCALE, ALWAYS):
            return run.number > MIN_EXPLAINED * count
        return shape in (JUMP, DRIFT) and run.found.gain > MIN_EXPLAINED * gain

    kept = list[RejectedRun]()
    for s in sources:
        others, own = tuple(sorted(sources - {s})), [run for run in runs if run.source == s]
        kept += [run._replace(others=others) for run in own if explains(run)]
        if rest := [run for run in own if not explains(run)]:
            kept.append(_one(rest, others))
    return kept


def _one(runs: list[RejectedRun], others: tuple[int, ...]) -> RejectedRun:
    """Merge runs of a source that only show that it and others contradict each other."""
    biggest = max(runs, key=lambda run: run.number)
    return merge_runs(runs)._replace(found=biggest.found._replace(shape=DISAGREE), others=others)


def merge_runs(runs: list[RejectedRun]) -> RejectedRun:
    """Merge runs of a source, in time order, into one with the cause of the first."""
    spans = [(run.of - 1) / (run.stop - run.start) for run in runs if run.stop > run.start]
    start, stop = runs[0].start, max(run.stop for run in runs)
    count, of = sum(run.number for run in runs), sum(run.of for run in runs)
    if len(runs) > 1 and spans:  # the fixes between them were accepted
        of = max(of, round(float(np.median(spans)) * (stop - start)) + 1)
    return runs[0]._replace(
        stop=stop, number=count, of=of, largest=max(run.largest for run in runs)
    )
