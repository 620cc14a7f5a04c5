"""A run of a filter that also computes the sensitivity of its innovations to unknown constants, and
the normal equations of a least-squares estimate of these (core/mathematics/sensitivity.py).

The run proceeds in pieces of `RECORDED_ROWS` samples, each with a record of its calls, so that
besides the solution it needs the memory of one piece.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from .. import filters
from ..checks import DataError
from ..core.compile.records import Table
from ..core.loop import loop
from ..core.loop.contract import (
    COMPILED,
    Filter,
    Imu,
    Use,
    address,
    compile_kernel,
    compile_together,
)
from ..core.loop.gaps import MAX_HOLD, MAX_STEP
from ..core.loop.tables import FixRow
from ..core.mathematics.adjoint import INNOVATION, SMOOTHER, width
from ..core.mathematics.error_state import PREDICTED
from ..core.mathematics.sensitivity import (
    BEHIND,
    LANES,
    MOVED,
    REJECTED,
    V_SIZE,
    run_sensitivity,
    save_step,
)
from ..core.mathematics.time_correlated import FADED
from ..data.recording import Recording
from ..typing import Array, Ints, Progress
from .batch import begin
from .options import RunOptions
from .prepare import Run

RECORDED_ROWS = 4096 if COMPILED else 250
"""IMU samples whose record is kept at once."""
WINDOW = 0.2
"""s over which specific force is averaged for the acceleration at a fix; the vibration of single
samples would make time derivatives too large."""
BLOCKS = 20
"""Number of time blocks with separate sums, which show the scatter of an estimate."""
MAX_NIS = 30.0
"""Upper limit of the NIS of a fix in `fit`."""


class Corrections(NamedTuple):
    """The k calls of `correct` in a piece of a run: time, source and filter state."""

    t: Array  # (k,) s
    source: Ints  # (k,)
    v: Array  # (k, 3) m/s, NED
    C: Array  # (k, 3, 3) body to n
    omega: Array  # (k, 3) bias-free rate, rad/s, body
    f: Array  # (k, 3) bias-free specific force around the fix, m/s^2, body
    innovation: Array  # (k, 3) whitened; 0 where nothing was measured
    expected: Array  # (k, 3) of the measurement, as the filter predicts it; 0 likewise


Derivatives: TypeAlias = Callable[[Corrections], Array]
"""Function that returns h (k, 3, m), the derivatives of these corrections' measurements by m
constants."""


class Sums(NamedTuple):
    """Normal equations for m constants theta, over blocks of time: information theta = score."""

    information: Array  # (BLOCKS, m, m)
    score: Array  # (BLOCKS, m)

    def map_basis(self, basis: Array) -> "Sums":
        """Return the sums for fewer constants phi, theta = basis (m, q) phi."""
        return Sums(basis.T @ self.information @ basis, self.score @ basis)

    def shift(self, step: Array) -> "Sums":
        """Return the sums for the remainder of the constants after a step of theta by `step`
        (m,)."""
        return Sums(self.information, self.score - self.information @ step)


def check_sensitive(filter: Filter) -> None:
    """Refuse a filter without a sensitivity analysis. Raises DataError."""
    if filter.smoother is not SMOOTHER:
        able = [name for name in filters.names() if filters.find(name).smoother is SMOOTHER]
        raise DataError(
            f"{filter.name} cannot be used to diagnose an installation; these can: {', '.join(able)}"
        )


def begin_sensitive(recording: Recording, filter: Filter, asked: RunOptions) -> Run:
    """Return the Run of `fuse` with the kernels that `pieces` needs, and without installation
    parameters as states. Raises DataError."""
    check_sensitive(filter)
    run = begin(recording, filter, {**asked, "estimate": {}})
    kernels: list[Any] = [loop.run, save_step, run_sensitivity]
    compile_together(kernels, "the diagnosis", asked["notify"])
    for kernel in kernels:
        compile_kernel(kernel)
    return run


def sums(run: Run, derivatives: Derivatives, V: Array, progress: Progress | None = None) -> Sums:
    """Run to the end after `begin_sensitive`; V (n, m) is the derivative of the initial error by
    the m constants."""
    m = V.shape[1]
    found = Sums(np.zeros((BLOCKS, m, m)), np.zeros((BLOCKS, m)))
    last = run.samples.t[-1] + loop.SAME_TIME
    edges = np.linspace(run.start.t, last, BLOCKS + 1)[1:-1]
    for corrections, J in pieces(run, derivatives, V):
        block = np.searchsorted(edges, corrections.t)
        for b in np.unique(block):
            rows = J[block == b].reshape(-1, m)
            found.information[b] += rows.T @ rows
            found.score[b] += corrections.innovation[block == b].ravel() @ rows
        if progress:
            progress(run.done)
    return found


def pieces(run: Run, derivatives: Derivatives, V: Array) -> Iterator[tuple[Corrections, Array]]:
    """Run to the end; yield for each piece its Corrections and J (k, 3, m), the derivatives of
    their whitened innovations."""
    (n, m), state = V.shape, run.cursor.state[0]
    if m > LANES:
        raise DataError(
            f"there are {m} constants to estimate, but at most {LANES} are possible: leave sources out"
        )
    columns = np.zeros(V_SIZE)
    columns[:MOVED].reshape(-1, LANES)[:n, :m] = V
    state.save_step, forces = address(save_step), _Forces(run.samples)
    room = np.empty((0, width(n) + BEHIND))
    for stop in run.chunks(RECORDED_ROWS):
        before, state.recorded = int(state.fix), 0
        if len(room) < (needed := most_calls(run, stop)):
            room = np.empty((needed, width(n) + BEHIND))
        run.advance(stop, run.out._replace(record=room))
        record = room[: state.recorded]
        used = slice(before, state.fix)
        corrections = _corrections(run.out.fix[used], run.fixes.y[used], record, n, forces)
        h, J = (np.zeros((len(corrections.t), 3, LANES)) for _ in range(2))
        h[:, :, :m] = derivatives(corrections)
        run_sensitivity(n, record, h, columns, J)
        yield corrections, J[:, :, :m]


def most_calls(run: Run, stop: int) -> int:
    """Return an upper bound of the calls on the record before row `stop`: a fix splits a sample,
    propagates correlated errors and is tried at most twice, and a gap has its steps."""
    row, k = run.cursor.state[0].row, run.cursor.state[0].fix
    t, dt = run.samples.t[row:stop], run.samples.dt[row:stop]
    gaps = t - dt - np.r_[run.cursor.state[0].t, t[:-1]]
    steps = np.ceil(np.clip(gaps, 0.0, MAX_HOLD) / MAX_STEP) + 1
    fixes = np.searchsorted(run.fixes.t, t[-1] + 2 * loop.SAME_TIME, side="right") - k
    return int(len(t) + 4 * fixes + steps[gaps > 0].sum())


def _corrections(
    fix: Table[FixRow], y: Array, record: Array, n: int, forces: "_Forces"
) -> Corrections:
    """Return the Corrections on a record with the loop rows `fix` of measurements y (k, 3). A fix whose gate is opened has
    two, of which the first is marked so that it does not count; a fix that the filter did not
    process has none."""
    calls = np.flatnonzero((record[:, 0] != PREDICTED) & (record[:, 0] != FADED))
    use = fix["use"]
    asked = np.where(use == Use.NOT_ASKED, 0, 1 + (use == Use.REACQUIRED))
    row = np.repeat(np.arange(len(fix)), asked)
    record[calls[:-1][row[1:] == row[:-1]], 0] = 0.0
    kept, t = record[calls], fix["t"][row]
    rows = kept[:, 0] % REJECTED
    measured = np.arange(3) < rows[:, None]
    belief = np.where(rows[:, None] > 0, kept[:, width(n) :], 0.0)
    return Corrections(
        t,
        fix["source"][row].astype(int),
        belief[:, 0:3],
        belief[:, 3:12].reshape(-1, 3, 3),
        belief[:, 12:15],
        forces.mean(t) - belief[:, 15:18],
        np.where(measured, kept[:, INNOVATION : INNOVATION + 3], 0.0),
        np.nan_to_num(y[row] - fix["innovation"][row]),
    )


class _Forces:
    """Specific force of the samples, averaged over `WINDOW`, or two samples, around a time."""

    def __init__(self, imu: Imu) -> None:
        self.edges = np.r_[imu.t[0] - imu.dt[0], imu.t]
        self.integral = np.vstack([np.zeros(3), np.cumsum(imu.dv, axis=0)])
        self.half = max(0.5 * WINDOW, float(np.median(imu.dt)))

    def mean(self, t: Array) -> Array:
        """(k, 3) m/s^2, body, at the times t (k,)."""
        first, last = (
            np.clip(t + side * self.half, self.edges[0], self.edges[-1]) for side in (-1, 1)
        )
        first = np.minimum(first, self.edges[-1] - self.half)
        last = np.maximum(last, self.edges[0] + self.half)
        return np.stack(
            [
                (np.interp(last, self.edges, x) - np.interp(first, self.edges, x)) / (last - first)
                for x in self.integral.T
            ],
            axis=1,
        )


class SensitivityFit(NamedTuple):
    """The fit of a Run to its fixes."""

    cost: float  # mean of their NIS, `MAX_NIS` at most each; that of a run that broke off
    fixes: int  # number of measured fixes
    expected: float  # mean NIS of a consistent filter: the number of measured components

    @property
    def misfit(self) -> float:
        """Ratio of the cost to the expected one: about 1 for a consistent filter, less where the
        stated standard deviations are too large."""
        return self.cost / self.expected


def fit(run: Run) -> SensitivityFit:
    """Return the fit of a Run that has ended or stopped early."""
    fix = run.out.fix[: run.cursor.state[0].fix]
    fix = fix[np.isfinite(fix["nis"])]
    if not len(fix):
        return SensitivityFit(0.0, 0, 1.0)
    rows = np.isfinite(fix["innovation"]).sum(axis=1)
    whole = not run.cursor.state[0].fault
    cost = np.minimum(fix["nis"], MAX_NIS).mean() if whole else MAX_NIS
    return SensitivityFit(float(cost), len(fix), float(rows.mean()))


def acceleration_at(run: Run, t: float) -> Array:
    """Return the specific force (3,) around a time, m/s^2, body, without the initial biases."""
    return _Forces(run.samples).mean(np.array([t]))[0] - np.asarray(run.start.b_a)
