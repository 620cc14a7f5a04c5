"""Smoothing: the best estimate at each time from the whole recording, before and after it. The
filter runs forwards, then the smoother runs backwards (core/mathematics/smoother.py).

The filter runs twice: first to the end, keeping its state every `RECORDED_ROWS` samples, then
through each such piece, the last one first, recording the data for the backward pass. Besides the
solution and these states, memory is that of one piece, however long the recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from .. import filters
from ..checks import DataError
from ..core.loop import loop
from ..core.loop.contract import (
    COMPILED,
    DOUBTFUL,
    INVALID,
    POS,
    STATES,
    VEL,
    Filter,
    Output,
    Smoother,
    address,
    compile_kernel,
    compile_together,
)
from ..core.loop.log import Code
from ..core.mathematics import solution_row
from ..core.mathematics.smoother import run_back, work_size
from ..data.recording import Recording
from ..data.solution import Separation, Solution
from ..geometry.geodesy import displacement
from ..progress import listener, with_bar
from ..typing import Array, Ints, Progress
from .batch import begin
from .events import Events
from .finish import solution
from .options import RunOptions, run_options, takes
from .prepare import Run, new_output

RECORDED_ROWS = 512 if COMPILED else 250
"""Number of IMU samples whose record is kept at once: few enough for the processor's cache, many
enough that the cost of a piece in Python is negligible."""
APART = 5.0
"""Difference of filter and smoother, over the square root of the difference of their variances,
above which a row is doubtful."""
REACH = 20.0
"""s of earlier rows that the same contradiction affects below the threshold."""


@takes(RunOptions)
@with_bar("smooth")
def smooth(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    *,
    progress: Progress | bool | None = None,
    **asked: Unpack[RunOptions],
) -> Solution:
    """Run a filter over a recording, forwards and backwards, and return the smoothed Solution.

    Its standard deviations, and covariances if kept, are those given all measurements, before and
    after. Innovations, status, events and additional columns are the filter's; rows where it and
    the smoother differ by more than `APART` standard deviations, and `REACH` s before them, are
    also DOUBTFUL, with an event.

    Parameters
    ----------
    recording : Recording
        Of an IMU and sources.
    filter : str or Filter
        One that can be smoothed (`Filter.smoother`).
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Returns
    -------
    Solution
        As from `fuse`, each row from the whole record.

    Raises
    ------
    DataError
        As `fuse`, and for a filter that cannot be smoothed.

    References
    ----------
    Bierman (1973), "Fixed interval smoothing with discrete measurements", International Journal of
    Control 18(1).

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> smoothed, filtered = sd.smooth(recording), sd.fuse(recording)
    >>> bool((smoothed.std[:, :3].mean(axis=0) < filtered.std[:, :3].mean(axis=0)).all())
    True
    """
    filter = filters.find(filter)
    if filter.smoother is None:
        able = [name for name in filters.names() if filters.find(name).smoother]
        raise DataError(f"{filter.name} cannot be smoothed; these can: {', '.join(able)}")
    given = run_options(**asked)
    run = begin(recording, filter, given)
    kernels: list[Any] = [
        run_back,
        loop.run,
        filter.smoother.adjoint_step,
        filter.smoother.save_step,
    ]
    compile_together(kernels, "the smoother", given["notify"])
    for kernel in kernels:
        compile_kernel(kernel)
    differences = both_ways(run, listener(progress))
    differences.tell(run)
    result = solution(run)
    result = replace(result, separation=differences.separation())
    result.meta["smoothed"] = True
    if ratios := differences.ratios():
        result.meta["filter_against_smoother"] = ratios
    return result


def both_ways(run: Run, report: Progress) -> Differences:
    """Fill the output of a Run that has not begun with smoothed rows, and return the differences of
    the filter from them; `report` receives the fraction done. Its kernels must be compiled."""
    state = run.cursor.state[0]
    keeping = int(state.every), int(state.phase)
    state.save_step = address(_smoother(run).save_step)
    state.phase = -1  # no rows from the forward pass: the backward pass writes them
    kept = [_stand(run)]
    for rows in run.chunks(RECORDED_ROWS):
        run.advance(rows)
        kept.append(_stand(run))
        report(run.done / 2)
    return _backwards(run, kept, keeping, report)


def _smoother(run: Run) -> Smoother:
    """Return the smoother of its filter; `smooth` has refused filters without one."""
    assert run.filter.smoother is not None
    return run.filter.smoother


class _Stand(NamedTuple):
    """The state of a filter between two samples: next sample, calls so far, and the nonzero bits of
    all its arrays except the empty log. A workspace has room for MAX_STATES, of which a run uses
    few."""

    row: int
    calls: int
    where: Ints
    bits: Ints


def _stand(run: Run) -> _Stand:
    state, bits = run.cursor.state[0], np.concatenate(_bits(run))
    where = np.flatnonzero(bits)
    return _Stand(int(state.row), int(state.recorded), where, bits[where])


def _bits(run: Run) -> list[Ints]:
    """Return the arrays of a run as flat integer views, in which -0.0 is not 0."""
    arrays = [part for part in (*run.belief, *run.cursor) if part is not run.cursor.log]
    return [part.reshape(-1).view(np.int64) for part in arrays]


def _restore(run: Run, stand: _Stand) -> None:
    arrays = _bits(run)
    ends = np.cumsum([part.size for part in arrays])
    bits = np.zeros(ends[-1], np.int64)
    bits[stand.where] = stand.bits
    for part, before in zip(arrays, np.split(bits, ends)):
        part[...] = before


def _backwards(
    run: Run, kept: Sequence[_Stand], keeping: tuple[int, int], report: Progress
) -> Differences:
    """Fill `run.out` with smoothed rows, chunk by chunk from the end; `kept` are the states before
    each chunk and after the last.

    `keeping` selects the rows: those whose number modulo the first is the second.
    """
    events = Events(run.filter, run.recording.sources, run.events.vehicle)
    run = run._replace(events=events)  # all events are already logged
    n, pairs = len(run.belief.P), list(zip(kept, kept[1:]))
    estimated = np.r_[np.array(run.filter.estimates, np.int64), STATES:n]
    k, adjoint_step, (every, phase) = (
        len(estimated),
        address(_smoother(run).adjoint_step),
        keeping,
    )
    lam, Lam, work = np.zeros(k), np.zeros((k, k)), np.zeros(work_size(k, n))
    # rows before each
    out = [(stand.row - 1 - phase) // every - (run.first - 1 - phase) // every for stand in kept]
    rows, calls = (
        max(int(n) for n in np.diff(out)),
        max(after.calls - before.calls for before, after in pairs),
    )
    room = new_output(run.filter, run.belief, rows, True, 0, max(calls, 1))._replace(
        fix=run.out.fix
    )
    differences = Differences()
    for number in range(len(pairs), 0, -1):
        (before, after), rows, whole = (
            pairs[number - 1],
            out[number] - out[number - 1],
            slice(out[number - 1], out[number]),
        )
        _restore(run, before)
        state = run.cursor.state[0]
        state.out = state.recorded = 0
        state.every, state.phase = keeping
        run.advance(after.row, room._replace(nav=run.out.nav[whole]))
        _leave_out_considered(run, room, rows, run.out.nav[whole])
        filtered = run.out.nav[whole, : solution_row.ROW_STATUS].copy()
        run_back(
            adjoint_step,
            room.record[: state.recorded],
            room.mark[:rows],
            room.covariance[:rows],
            estimated,
            lam,
            Lam,
            work,
            run.out.nav[whole],
            run.out.covariance[whole],
        )
        differences.add(filtered, run.out.nav[whole])
        report(1 - (number - 1) / len(pairs) / 2)
    _restore(run, kept[-1])
    run.cursor.state[0].out = out[-1]
    return differences


def _leave_out_considered(run: Run, room: Output, rows: int, nav: Array) -> None:
    """Remove the part without gains (considered errors) from the covariances and standard
    deviations of these rows."""
    considered = _smoother(run).considered
    if considered is None or not rows:
        return
    P = room.covariance[:rows]
    P -= considered(room.record[room.mark[:rows] - 1])  # a row follows the last of its calls
    variance = np.diagonal(P, axis1=1, axis2=2)[:, :STATES]
    nav[:, solution_row.STD : solution_row.STD + STATES] = np.sqrt(np.maximum(variance, 0.0))


class Differences:
    """Squared differences between filter and smoother over their variance, which is that of the
    filter minus that of the smoother."""

    MIN_VARIANCE = 0.05  # part of the filter's variance below which no comparison is possible

    def __init__(self) -> None:
        self.sums, self.counts = np.zeros(9), np.zeros(9)
        self._ratio: list[Array] = []  # the largest of each row
        self._parts: list[Separation] = []

    def add(self, filtered: Array, smoothed: Array) -> None:
        """Add rows of the output of the filter and of the smoother, the last rows first."""
        position = displacement(
            smoothed[:, solution_row.LLA : solution_row.V],
            filtered[:, solution_row.LLA : solution_row.V],
        )
        velocity = (
            smoothed[:, solution_row.V : solution_row.Q]
            - filtered[:, solution_row.V : solution_row.Q]
        )
        turn = _turn(
            filtered[:, solution_row.Q : solution_row.BIASES],
            smoothed[:, solution_row.Q : solution_row.BIASES],
        )
        first, last = solution_row.STD, solution_row.STD + 9
        before, after = filtered[:, first:last] ** 2, smoothed[:, first:last] ** 2
        apart = np.c_[position, velocity, turn] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = np.where(before - after > self.MIN_VARIANCE * before, before - after, np.nan)
            squares = apart / variance
        self.sums += np.nansum(squares, axis=0)
        self.counts += np.isfinite(squares).sum(axis=0)
        self._ratio.append(np.sqrt(np.nanmax(squares, axis=1, initial=0.0)))
        compared = np.where(np.isfinite(squares), apart, np.nan)
        self._parts.append(Separation(_lengths(compared), _lengths(variance)))

    def ratios(self) -> dict[str, float]:
        """Return {quantity: mean of the squares} for the compared quantities; 1 where both are
        consistent."""
        found = {}
        for what, states in (("position", POS), ("velocity", VEL)):
            if count := self.counts[states].sum():
                found[what] = float(self.sums[states].sum() / count)
        return found

    def separation(self) -> Separation:
        """Return the Separation of all rows, the first rows first."""
        return Separation(*map(np.concatenate, zip(*self._parts[::-1])))

    def tell(self, run: Run) -> None:
        """Mark the rows of a smoothed run that differ, or are less than REACH s before such a row,
        and log an event."""
        ratio = np.concatenate(self._ratio[::-1])
        rows = run.out.nav[: len(ratio)]
        t, status = rows[:, solution_row.T], rows[:, solution_row.ROW_STATUS]
        apart = np.r_[t[(ratio > APART) & (status != INVALID)], np.inf]
        near = apart[np.searchsorted(apart, t)] - t <= REACH
        status[near & (status != INVALID)] = DOUBTFUL
        run.events.tell(Code.APART, t[near], ratio[near])


def _lengths(squares: Array) -> NDArray[np.float32]:
    """Return (n, 3) from the squares (n, 9) of three vectors, over their known components; NaN
    without any."""
    parts = squares.reshape(-1, 3, 3)
    known = np.isfinite(parts).any(axis=2)
    return np.where(known, np.sqrt(np.nansum(parts, axis=2)), np.nan).astype(np.float32)


def _turn(first: Array, second: Array) -> Array:
    """Return the small rotation (n, 3), rad, in n, from one attitude (n, 4) to another."""
    w, v = first[:, :1], first[:, 1:]
    W, V = second[:, :1], second[:, 1:]
    return (
        2 * np.sign(w * W + (v * V).sum(axis=1, keepdims=True)) * (w * V - W * v - np.cross(V, v))
    )
