"""Batches of eight runs of a study: simulated block by block, run through each filter that supports
batches, and scored immediately. No array has the size of a recording."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...aiding import find
from ...core.compile.c_calls import aligned_zeros
from ...core.compile.signatures import LANES
from ...core.loop import lane_loop
from ...core.loop.contract import Filter, InitialState, bind_kernel
from ...core.loop.loop import SAME_TIME
from ...data.recording import Recording
from ...engine.batch import begin
from ...engine.options import run_options
from ...engine.prepare import Run
from ...engine.run_batch import Keeper, RunBatch, alongside, kernels, why_alone
from ...evaluation.consistency import LossLimits
from ...filters.ins.open_loop import LEFT_MODEL
from ...sensor_models.imu import ImuSpec
from ...sensor_models.imu_errors import RATES, Own, Shared, simulate_errors_in_lanes
from ...sensor_models.streams import RandomStream
from ...sim.synthesis import OF_IMU, OF_START, Simulator
from ...typing import Array
from ..filter_label import Labelled
from . import batch_scoring
from .scoring import Epochs, FixRows, Scored, ScoredRows, score_runs

SAMPLES = 512
"""Number of samples that are simulated at once: with the filter's data they fit a core's
second-level cache."""


class Lanes:
    """Runs of a scenario with an IMU, eight at a time, through filters."""

    def __init__(
        self,
        wanted: Sequence[Labelled],
        made: Simulator,
        imu: ImuSpec,
        at: Epochs,
        limits: LossLimits,
    ) -> None:
        self.wanted, self.made, self.imu, self.at, self.limits = wanted, made, imu, at, limits
        self._shared = imu.shared_errors(made.ideal_samples(imu))
        self._true = batch_scoring.truth_array(at)
        self._first: list[Run | None] = []  # by filter, without numbers of its own; None: no lanes

    def run(self, streams: Sequence[RandomStream]) -> tuple[list[list[Scored | None]], Array]:
        """(Scored by filter and run, None of what must be run alone; true biases (runs, epochs, 6),
        m/s^2 and rad/s) of at most LANES runs, each from its stream."""
        runs = len(streams)
        full = [*streams, *[streams[-1]] * (LANES - runs)]
        simulated = SimulatedSamples(self.made, self.imu, self._shared, full, self.at)
        recordings = [
            self.made.sources(self.imu, stream, b_a, b_g)
            for stream, (b_a, b_g) in zip(full, simulated.first_biases())
        ]
        starts = [
            self.made.start(stream.child(OF_START), self.imu, recording)
            for stream, recording in zip(full, recordings)
        ]
        if not self._first:
            self._first = [
                self._begin_lane(label, recordings[0], starts[0]) for label in self.wanted
            ]
        sides = [
            first
            and RunBatch(
                first,
                starts,
                recordings,
                Keeper(
                    batch_scoring.keep_errors_in_lanes,
                    self._true,
                    simulated.biases,
                    batch_scoring.SCRATCH,
                    batch_scoring.NUMBERS,
                ),
            )
            for first in self._first
        ]
        advance = [each.calls(simulated.increments) for each in sides if each]
        for first_row, stop in simulated.blocks():
            for go in advance:
                go(first_row, stop)
        none: list[Scored | None] = [None] * runs
        scores = [
            _score_lanes(each, runs, self.at, self.limits) if each else none for each in sides
        ]
        return scores, np.moveaxis(simulated.biases[..., :runs], 2, 0)

    def _begin_lane(self, label: Labelled, recording: Recording, start: InitialState) -> Run | None:
        filter, options, estimate = label
        if not filter.lanes or estimate is not None:
            return None
        first = begin(
            recording,
            filter,
            run_options(options=options, imu=self.imu, start=start, every=self.at.every),
        )
        return None if why_alone(first) else first


def kernels_in_lanes(filter: Filter, kinds: Sequence[str]) -> list[Any]:
    """Those that a filter needs on sources of these kinds, as far as they have lanes."""
    wide = [kind for kind in kinds if find(kind).lanes]
    return [*kernels(filter, wide, batch_scoring.keep_errors_in_lanes), simulate_errors_in_lanes]


class SimulatedSamples:
    """The IMU samples of LANES runs, block after block."""

    def __init__(
        self,
        made: Simulator,
        imu: ImuSpec,
        shared: Shared,
        streams: Sequence[RandomStream],
        at: Epochs,
    ) -> None:
        """`shared` by all runs, as `imu` has it of what it feels. Each run has its stream; `at` are
        the epochs at which the true biases are kept."""
        self.increments = aligned_zeros(SAMPLES, 6, LANES)
        """Those of the present block: rotations, rad, velocity increments, m/s."""
        self.biases = aligned_zeros(len(at.rows), 6, LANES)
        """True ones at the epochs: accelerometer, m/s^2, gyro, rad/s."""
        self._bias = aligned_zeros(SAMPLES, 6, LANES)  # at the samples of the block, gyro first
        self._at, self._rows = at, np.zeros(2, np.int64)
        self._count = len(shared.dt)
        self._offset = np.broadcast_to(made.offset(imu), (self._count, 3))
        drawn = [imu.draw_constants(stream.child(OF_IMU)) for stream in streams]
        self._own = Own(*(alongside(parts) for parts in zip(*drawn)))
        self._next = bind_kernel(
            simulate_errors_in_lanes,
            self._rows,
            shared,
            self._own,
            np.zeros(RATES),
            self.increments,
            self._bias,
        )

    def first_biases(self) -> Iterator[tuple[Array, Array]]:
        """True biases (1, 3) of accelerometer and gyro of each run at the first sample."""
        before, self._rows[:] = self._own.state.copy(), (0, 1)
        self._next()
        self._own.state[:] = before
        for lane in range(LANES):
            b_g, b_a = self._bias[:1, :3, lane], self._bias[:1, 3:, lane]
            yield b_a + self._offset[:1], b_g.copy()

    def blocks(self) -> Iterator[tuple[int, int]]:
        """Simulate blocks one after the other: the first row of each and that behind its last."""
        for first in range(0, self._count, SAMPLES):
            stop = min(first + SAMPLES, self._count)
            self._rows[:] = first, stop
            self._next()
            inside = slice(*np.searchsorted(self._at.rows, (first, stop)))
            rows = self._at.rows[inside]
            self.biases[inside, :3] = self._bias[rows - first, 3:] + self._offset[rows, :, None]
            self.biases[inside, 3:] = self._bias[rows - first, :3]
            yield first, stop


def _score_lanes(side: RunBatch, runs: int, at: Epochs, limits: LossLimits) -> list[Scored | None]:
    """Scored of the first runs of a filter, None of those that left the lanes."""
    cursor, ended = side.cursor, side.ended[:runs]
    kept, fix = (
        np.ascontiguousarray(np.moveaxis(part[..., :runs], -1, 0))
        for part in (side.out.kept, side.out.fix)
    )
    kept[at.truth.t >= ended[:, None]] = np.nan
    rows = ScoredRows(
        kept[..., batch_scoring.ERROR],
        kept[..., batch_scoring.RPH],
        kept[..., batch_scoring.STD],
        kept[..., batch_scoring.NEES],
    )
    fixes = FixRows(
        side.fixes.t,
        side.fixes.source,
        fix[..., lane_loop.INNOVATION :],
        fix[..., lane_loop.NIS],
        fix[..., lane_loop.USED] > 0,
        np.searchsorted(
            side.fixes.t, np.minimum(ended, cursor.state[0].t) + SAME_TIME, side="right"
        ),
    )
    held = np.where(cursor.conditions[:, :runs] < ended, cursor.conditions[:, :runs], np.inf)
    left = [_left_model(side.filter, held[:, lane]) for lane in range(runs)]
    found = score_runs(rows, fixes, left, at, limits)
    return [each if np.isinf(t) else None for each, t in zip(found, side.left)]


def _left_model(filter: Filter, first_held: Array) -> float:
    """When the raw INS of an open loop left its model, s; NaN where it did not, or there is
    none."""
    held = [
        float(t)
        for condition, t in zip(filter.conditions, first_held)
        if condition.text.startswith(LEFT_MODEL) and np.isfinite(t)
    ]
    return min(held, default=np.nan)
