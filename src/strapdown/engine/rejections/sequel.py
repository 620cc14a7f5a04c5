"""The time after a jump or a drift that the IMU did not measure, and between two failures of the same
test. The filter follows the displaced fixes and its gates accept them again, but the data do not show
whether the fixes before or after are correct."""

from collections.abc import Iterable, Sequence

import numpy as np

from ...core.loop.integrity import HEARD
from ...typing import Array
from .causes import DRIFT, JUMP
from .contradictions import RejectedRun

SOON = 60.0
"""s within which the mean of a source's innovations is off again for the same reason."""
RETURNED = 0.3
"""Part of its largest displacement that a returned source may keep."""


def unresolved_spans(
    runs: Sequence[RejectedRun], sources: Iterable[int]
) -> list[tuple[float, float]]:
    """[(from, to)] s: times when one of these sources contradicts its earlier fixes, or the IMU, by
    a lasting jump or drift, until it returns or to the end (inf). A jump after HEARD seconds
    without a fix is not a contradiction, because the filter may have drifted."""
    found = []
    for s in sources:
        found += _of_source([run for run in runs if run.source == s and run.silent < HEARD])
    return found


def repeated_spans(events: Iterable[tuple[int, float, float]]) -> list[tuple[float, float]]:
    """[(from, to)] s of the events (source, from, to in s), of means of innovations that are off; those of a
    source that follow each other within SOON are one: what contradicts again was there meanwhile, and
    showed as little as a clock that is off does between two turns."""
    of_source: dict[int, list[tuple[float, float]]] = {}
    for s, start, stop in sorted(events, key=lambda each: each[1]):
        own = of_source.setdefault(s, [])
        if own and start - own[-1][1] < SOON:
            own[-1] = own[-1][0], max(own[-1][1], stop)
        else:
            own.append((start, stop))
    return [span for own in of_source.values() for span in own]


def _of_source(runs: list[RejectedRun]) -> list[tuple[float, float]]:
    found, since = list[tuple[float, float]](), np.inf
    off, largest = np.zeros(3), 0.0
    for run in runs:
        cause = run.found
        if cause.shape == DRIFT and np.isinf(since):
            since = cause.since
        elif cause.shape == JUMP and np.isinf(cause.until):
            off = off + _sum_of_steps(cause.size)
            largest = max(largest, float(np.linalg.norm(off)))
            if np.isinf(since):
                since = cause.since
            elif np.linalg.norm(off) < RETURNED * largest:
                found.append((since, cause.since))
                since, off, largest = np.inf, np.zeros(3), 0.0
    return [*found, (since, np.inf)] if np.isfinite(since) else found


def _sum_of_steps(size: Array) -> Array:
    """Return the sum (3,) of the steps (3 k,) of a jump."""
    return np.asarray(size).reshape(-1, 3).sum(axis=0)
