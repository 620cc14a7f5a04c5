"""Offline: the best estimate at each time from the whole recording, before and after it. Forwards with the filter, then backwards (core/backward.py).

The filter runs twice: once to its end, keeping its state every `CHUNK` samples, and once more through each chunk, the last one first, leaving
on a tape what the way back needs. So beside the solution and these states memory is that of a chunk, however long the recording.
"""
from typing import NamedTuple

import numpy as np

from . import filters
from .core import loop
from .core.backward import run_back
from .core.contract import COMPILED, STATES, address, compile_kernel
from .data import DataError
from .engine import begin, found, new_output, solution

CHUNK = 2048 if COMPILED else 500
"""IMU samples whose tape is kept at once: few enough for the processor's cache."""


def smooth(recording, filter="closed-loop", imu=None, start=None, noise=None, every=1, covariance=False, say=None, progress=None,
           ahrs=None, ahrs_rate=10.0, **options):
    """The smoothed Solution of a recording: arguments and result as of `fuse`, for a filter that can be smoothed (`Filter.smoother`).

    Its standard deviations, and covariances where they are kept, are those given all measurements, before and after.
    Innovations, status, events and the filter's own columns are the filter's. Raises DataError.
    """
    filter = found(filters.find, filter)
    if filter.smoother is None:
        able = [name for name in filters.names() if filters.find(name).smoother]
        raise DataError(f"{filter.name} cannot be smoothed; these can: {', '.join(able)}")
    run = begin(recording, filter, imu, start, noise, every, covariance, say, options, ahrs, ahrs_rate)
    compile_kernel(run_back)
    compile_kernel(filter.smoother.back)
    compile_kernel(filter.smoother.keep)
    run.cursor.at[loop.TAPE] = address(filter.smoother.keep)
    kept, report = [_stand(run)], progress or (lambda done: None)
    for rows in run.chunks(CHUNK):
        run.advance(rows)
        kept.append(_stand(run))
        report(run.done / 2)
    _backwards(run, kept, report)
    result = solution(run)
    result.meta["smoothed"] = True
    return result


class _Stand(NamedTuple):
    """Where a filter stands between two samples: next sample, next row of the output, calls so far, and all its arrays."""
    row: int
    out: int
    calls: int
    arrays: list


def _stand(run):
    at = run.cursor.at
    return _Stand(int(at[loop.ROW]), int(at[loop.OUT]), int(at[loop.TAPED]), [part.copy() for each in (run.belief, run.cursor) for part in each])


def _restore(run, stand):
    for array, before in zip((*run.belief, *run.cursor), stand.arrays):
        array[...] = before


def _backwards(run, kept, report):
    """Replace the rows of `run.out` by smoothed ones, chunk after chunk from the end; `kept` are the stands before each chunk and after the last."""
    n, pairs = len(run.belief.P), list(zip(kept, kept[1:]))
    estimated = np.r_[np.array(run.filter.estimates, np.int64), STATES:n]
    k, back = len(estimated), address(run.filter.smoother.back)
    lam, Lam, work = np.zeros(k), np.zeros((k, k)), np.zeros(2 * k * k + n)
    rows, calls = (max(after[i] - before[i] for before, after in pairs) for i in (1, 2))
    room = new_output(run.filter, run.belief, rows, True, 0, max(calls, 1))._replace(fix=run.out.fix)
    for number, (before, after) in enumerate(reversed(pairs), 1):
        _restore(run, before)
        run.cursor.at[loop.OUT] = run.cursor.at[loop.TAPED] = 0
        run.advance(after.row, room)
        rows, whole = after.out - before.out, slice(before.out, after.out)
        run_back(back, room.tape[:run.cursor.at[loop.TAPED]], room.mark[:rows], room.covariance[:rows], estimated, lam, Lam, work, run.out.nav[whole])
        if len(run.out.covariance):
            run.out.covariance[whole] = room.covariance[:rows]
        report(0.5 + number / len(pairs) / 2)
    _restore(run, kept[-1])
