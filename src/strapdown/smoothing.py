"""Offline: the best estimate at each time from the whole recording, before and after it. Forwards with the filter, then backwards (core/backward.py).

The filter runs twice: once to its end, keeping its state every `CHUNK` samples, and once more through each chunk, the last one first, leaving on a tape
what the way back needs. So memory is that of a chunk, however long the recording.
"""
from typing import NamedTuple

import numpy as np

from . import filters
from .core import loop
from .core.backward import run_back
from .core.contract import ATT, BA, BG, COMPILED, POS, VEL, address, compile_kernel
from .data import DataError
from .engine import begin, found, new_output, solution
from .geodesy import displaced

CHUNK = 8192 if COMPILED else 500
"""IMU samples whose tape is kept at once."""


def smooth(recording, filter="attitude-mekf", imu=None, start=None, noise=None, every=1, covariance=False, say=None, progress=None, **options):
    """The smoothed Solution of a recording: arguments and result as of `fuse`, for a filter that can be smoothed (`Filter.smoother`).

    Its standard deviations, and covariances where they are kept (of the states that the filter estimates), are those given all measurements.
    Innovations, events and extra columns are the filter's. Raises DataError.
    """
    filter = found(filters.find, filter)
    if filter.smoother is None:
        able = [name for name in filters.names() if filters.find(name).smoother]
        raise DataError(f"{filter.name} cannot be smoothed; these can: {', '.join(able)}")
    run = begin(recording, filter, imu, start, noise, every, covariance, say, options)
    compile_kernel(run_back)
    compile_kernel(filter.smoother.back)
    kept, report = [], progress or (lambda done: None)
    for rows in run.chunks(CHUNK):
        kept.append(_Kept(*(int(run.cursor.at[i]) for i in (loop.ROW, loop.OUT, loop.TAPED)), _arrays(run)))
        run.advance(rows)
        report(run.done / 2)
    _backwards(run, kept, report)
    result = solution(run)
    result.meta["smoothed"] = True
    return result


class _Kept(NamedTuple):
    """Where the filter stood before a chunk: next sample, next row of the output, calls so far, and all its arrays."""
    row: int
    out: int
    calls: int
    arrays: list


def _arrays(run):
    return [part.copy() for each in (run.belief, run.cursor) for part in each]


def _restore(run, arrays):
    for array, before in zip((*run.belief, *run.cursor), arrays):
        array[...] = before


def _backwards(run, kept, report):
    """Replace the rows of `run.out` by smoothed ones, chunk after chunk from the end."""
    at, estimated = run.cursor.at, np.array(run.filter.estimates)
    k, end = len(estimated), _Kept(*(int(at[i]) for i in (loop.ROW, loop.OUT, loop.TAPED)), _arrays(run))
    lam, Lam, work = np.zeros(k), np.zeros((k, k)), np.zeros(k * (k + 2))
    for number, (chunk, after) in enumerate(zip(reversed(kept), [end, *reversed(kept)])):
        _restore(run, chunk.arrays)
        rows = after.out - chunk.out
        out = new_output(run.filter, run.belief, rows, True, 0, max(after.calls - chunk.calls, 1))._replace(fix=run.out.fix)
        at[loop.OUT] = at[loop.TAPED] = 0
        run.advance(after.row, out)
        error, covariance = np.zeros((rows, k)), np.zeros((rows, k, k))
        run_back(address(run.filter.smoother.back), out.tape[:at[loop.TAPED]], out.mark, out.covariance, estimated, lam, Lam, work, error, covariance)
        _replace(run, slice(chunk.out, after.out), error, covariance)
        report(0.5 + (number + 1) / len(kept) / 2)
    _restore(run, end.arrays)


def _replace(run, rows, error, covariance):
    """Compose the errors (rows, k) into these rows of the output, and put their covariances (rows, k, k) in place of the filter's."""
    nav, estimated = run.out.nav[rows], list(run.filter.estimates)
    of = lambda states: np.stack([error[:, estimated.index(i)] if i in estimated else np.zeros(len(error)) for i in range(states.start, states.stop)], axis=1)
    nav[:, loop.LLA:loop.V] = displaced(nav[:, loop.LLA:loop.V], of(POS))
    nav[:, loop.V:loop.Q] += of(VEL)
    nav[:, loop.Q:loop.BIASES] = _turned(nav[:, loop.Q:loop.BIASES], of(ATT))
    nav[:, loop.BIASES:loop.SD] += np.hstack([of(BA), of(BG)])
    nav[:, [loop.SD + i for i in estimated]] = np.sqrt(np.maximum(np.einsum("ijj->ij", covariance), 0.0))
    if len(run.out.covariance):
        run.out.covariance[rows][:, np.array(estimated)[:, None], estimated] = covariance


def _turned(q_nb, theta):
    """Scalar-first quaternions turned by rotation vectors in n, rad; the scalar is not negative."""
    from scipy.spatial.transform import Rotation
    x, y, z, w = (Rotation.from_rotvec(theta) * Rotation.from_quat(q_nb[:, [1, 2, 3, 0]])).as_quat().T
    return np.stack([w, x, y, z], axis=1) * np.where(w < 0, -1.0, 1.0)[:, None]
