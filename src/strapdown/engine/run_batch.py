"""Eight simultaneous runs of one filter, on recordings that differ only in numbers: the times,
sources and options are the same. Runs that leave the batch are reported and must be run alone."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import aiding
from ..core.compile.c_calls import aligned_zeros
from ..core.compile.records import rows
from ..core.compile.signatures import LANES
from ..core.loop import lane_loop
from ..core.loop.contract import COMPILED, Filter, FilterState, InitialState, address, side_by_side
from ..core.loop.lane_loop import LaneCursor, LaneOutput, LaneState
from ..core.loop.loop import SAME_TIME
from ..data.recording import Recording
from ..typing import Array
from .prepare import Run, augmented_states, rows_of, usable, used_in_order

NOT_IN_LANES = {
    "estimated": "parameters of the installation are estimated",
    "correlation_time": "errors of a source are correlated",
    "slip": "the side slip of a constraint is allowed for",
    "robust": "a source is robust",
    "memory": "a source is adaptive",
}
"""Fields of a source that a batch does not support."""


def why_alone(run: Run) -> str:
    """Return the reason why such runs must run one by one; "" where a batch can run them."""
    kinds = [aiding.find(a.kind) for a in run.recording.sources]
    alone = [sensor.name for sensor in kinds if not sensor.lanes]
    if not COMPILED:
        return "kernels are not compiled"
    if not run.filter.lanes:
        return f"{run.filter.name} has no lanes"
    if alone:
        return f"{alone[0]} has no lanes"
    for field, why in NOT_IN_LANES.items():
        if run.fixes.sources[field].any():
            return why
    if run.cursor.coupled.size or run.cursor.recent.size:
        return NOT_IN_LANES["estimated"]
    t, dt = run.samples.t[run.first :], run.samples.dt[run.first :]
    begins = np.r_[run.start.t, t[:-1]]
    if (np.abs(t - dt - begins) > SAME_TIME).any():
        return "there are gaps between samples, or the start is inside one"
    return ""


class Keeper(NamedTuple):
    """A kernel of core.loop.lane_loop.KEEP_LANES, which keeps rows, and its arguments."""

    kernel: Any
    true: Array  # (rows, ...), the true values of each row
    biases: Array  # (rows, 6, LANES)
    scratch: int  # size of its scratch memory in numbers
    numbers: int  # numbers that it writes per row


class RunBatch:
    """Runs of one filter in lanes. `left` has the time until which each of them is valid."""

    def __init__(
        self,
        first: Run,
        starts: Sequence[InitialState],
        recordings: Sequence[Recording],
        keep: Keeper,
    ) -> None:
        """first: a Run like those of the LANES `starts` and `recordings`, for which `why_alone` is
        "". Raises ValueError where the fixes of the recordings differ in more than the measured
        values."""
        filter, cursor, fixes = first.filter, first.cursor, first.fixes
        own = tuple(each.std for each in augmented_states(first.recording.sources))
        beliefs = [
            filter.begin(start._replace(std=(*start.std, *own)), first.noise, **first.options)
            for start in starts
        ]
        self.filter = filter
        self.belief = FilterState(*(alongside(parts) for parts in zip(*beliefs)))
        y = alongside(_readings(filter, recordings, first))
        std = np.maximum(fixes.std, cursor.books["floor"][fixes.source])
        self.fixes = fixes._replace(y=y, std=std)
        self.noise, self._samples = first.noise, first.samples
        (state,) = table = rows(LaneState, 1)
        before = cursor.state[0]
        state.row, state.fixes, state.t = first.first, len(fixes.t), first.start.t
        state.every, state.phase, state.condition = before.every, before.phase, before.condition
        sources = fixes.sources.size
        self.cursor = LaneCursor(
            table,
            np.full(sources, first.start.t),
            np.full(sources, -np.inf),
            cursor.limits,
            aligned_zeros(7, LANES),
            aligned_zeros(lane_loop.WORK, LANES),
            aligned_zeros(sources, lane_loop.BOOKS, LANES),
            aligned_zeros(len(filter.conditions), LANES),
            aligned_zeros(2, LANES),
        )
        self.cursor.conditions[:] = self.cursor.left[:] = np.inf
        self.out = LaneOutput(
            aligned_zeros(len(fixes.t), lane_loop.FIX_NUMBERS, LANES),
            aligned_zeros(len(keep.true), keep.numbers, LANES),
        )
        self.out.kept[:] = np.nan
        self._kernels = _addresses(filter, first, keep.kernel)
        self._given = keep.true, keep.biases, aligned_zeros(keep.scratch, LANES)

    def calls(self, increments: Array) -> Callable[[int, int], None]:
        """Return a function (first, stop) that processes the IMU rows from `first` to before
        `stop`; `increments` (block, 6, LANES) has those from `first` on, and is filled anew for
        each call."""
        predict, correct, observers, keep = self._kernels
        go = lane_loop.run_lanes.bind(  # type: ignore[attr-defined]
            predict,
            correct,
            observers,
            keep,
            self._samples.t,
            self._samples.dt,
            self.belief,
            self.fixes,
            increments,
            self.noise,
            *self._given,
            self.cursor,
            self.out,
        )
        state = self.cursor.state[0]

        def advance(row: int, stop: int) -> None:
            state.first_row, state.stop = row, stop
            if self._park():
                go()

        return advance

    @property
    def left(self) -> Array:
        """(LANES,) time from which a run must continue alone, s; inf where it need not."""
        left, ended = self.cursor.left
        return np.where(left <= ended, left, np.inf)

    @property
    def ended(self) -> Array:
        """(LANES,) time of the sample at which the filter state of a run became invalid, s; inf for
        runs that reached the end."""
        return self.cursor.left[lane_loop.ENDED]

    def _park(self) -> bool:
        """Overwrite abandoned runs with a valid one, because NaN would send all runs through slow
        branches. Return False where no run is left."""
        gone = np.isfinite(self.cursor.left).any(axis=0)
        if gone.all():
            return False
        if gone.any():
            sound = int(np.argmin(gone))
            for part in (*self.belief, self.cursor.books):
                part[..., gone] = part[..., [sound]]
        return True


def kernels(filter: Filter, kinds: Sequence[str], keep: Any) -> list[Any]:
    """Return the kernels, with the loop, that lanes of `filter` on sources of these kinds need."""
    own = [filter.predict, filter.correct, *(aiding.find(kind).observe for kind in kinds)]
    return [*map(side_by_side, own), keep, lane_loop.run_lanes]


def _addresses(filter: Filter, first: Run, keep: Any) -> tuple[int, int, Any, int]:
    kinds = [a.kind for a in first.recording.sources]
    predict, correct, *observe, keep, _ = map(address, kernels(filter, kinds, keep))
    observers = np.zeros_like(first.kernels.observers)
    observers[[aiding.number(kind) for kind in kinds]] = observe
    return predict, correct, observers, keep


def _readings(filter: Filter, recordings: Sequence[Recording], first: Run) -> list[Array]:
    """Return y of the fixes of each recording in the order of the first run. Raises ValueError
    where the fixes differ."""
    mine, after = first.recording.sources, first.start.t + SAME_TIME
    _, order = used_in_order(mine, after, first.fixes.sources["delay"])
    found = []
    for recording in recordings:
        sources = usable(filter, recording.sources)[0]
        if [a.kind for a in sources] != [b.kind for b in mine] or not all(
            np.array_equal(a.t, b.t) and np.array_equal(a.std, b.std) for a, b in zip(sources, mine)
        ):
            raise ValueError("runs side by side need fixes of the same times and deviations")
        found.append(rows_of(sources, "y")[order])
    return found


def alongside(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return arrays of one shape and type as lanes."""
    made = aligned_zeros(*parts[0].shape, len(parts), dtype=parts[0].dtype.type)
    for lane, part in enumerate(parts):
        made[..., lane] = part
    return made
