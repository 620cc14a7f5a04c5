"""The work of a campaign: the cells and chunks of a study, and the chunk function.

A chunk is some runs of a cell with all filters on the same records; its results depend only on the
study and the numbers of its runs.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ... import aiding, filters
from ...checks import DataError
from ...core.compile.signatures import LANES
from ...core.loop.contract import STATES, Filter, InitialState, compile_kernel, compile_together
from ...data.recording import Recording
from ...engine.batch import fuse
from ...engine.installation import StateParameter
from ...engine.prepare import kernels_of, prepare
from ...evaluation.cramer_rao import cramer_rao
from ...plugins import Plugin
from ...sensor_models.imu import ImuSpec, imu as imu_spec
from ...sensor_models.streams import RandomStream
from ...sim.scenario import Scenario, scenario
from ...sim.synthesis import Simulator
from ...typing import Array, Notify
from ...units.quantities import REGISTRY as QUANTITIES
from ..filter_label import Labelled, parse_label
from .run_batch import Lanes, kernels_in_lanes
from .scoring import (
    ERROR_GROUPS,
    PARAMETER_SCALARS,
    QUARANTINED,
    Epochs,
    Scored,
    epochs,
    score,
    score_parameters,
)
from .wrong_installation import Installation, Installed, draw_installation, parameters_of, start_of

if TYPE_CHECKING:
    from .study import Study

Arrays: TypeAlias = dict[str, NDArray[Any]]
"""Results by name: rows as 32-bit numbers, sums and numbers of runs as 64-bit ones, row numbers."""
SCALARS = (
    "rows",
    "reason",
    "lasted",
    "left_model",
    "censored",
    "nees",
    "nees_inside",
    "nis",
    "correlation",
    "accepted",
    "rejected",
)
"""Numbers of each run and filter, beside `mean_square` and `coverage`."""


class Cell(NamedTuple):
    """A scenario with an IMU."""

    scenario: Scenario
    imu: ImuSpec

    @property
    def name(self) -> str:
        """Names a folder of chunk files."""
        return re.sub(r'[\s/\\:*?"<>|]', "-", f"{self.scenario.name}--{self.imu.name}")


class Chunk(NamedTuple):
    """Runs `first` to `stop` of the cell of that number."""

    cell: int
    first: int
    stop: int


@lru_cache(maxsize=8)
def cells(
    scenarios: tuple[str | Scenario, ...], imus: tuple[str | ImuSpec, ...]
) -> tuple[Cell, ...]:
    """All scenarios with all IMUs; no IMU stands for each scenario's own."""
    known = [s if isinstance(s, Scenario) else scenario(s) for s in scenarios]
    return tuple(Cell(s, imu_spec(imu)) for s in known for imu in (imus or (s.imu,)))


def seeds(study: Study, cell: Cell, run: int) -> RandomStream:
    """The random stream of a run: the same for every IMU and every set of filters, its own for
    every scenario."""
    return RandomStream.of(study.seed).child(cell.scenario.name).numbered_child(run)


_simulators: dict[tuple[Any, ...], tuple[threading.Lock, list[Simulator]]] = {}
_making = threading.Lock()


def simulator(cell: Cell) -> Simulator:
    """The Simulator of a cell's scenario; the last two are kept."""
    # a worker gets a new copy of the scenario with every chunk
    observed = [sensor.measurement.observe for sensor in cell.scenario.sensors]
    key = (cell.scenario.describe()["fingerprint"], *observed)
    with _making:
        if key not in _simulators:
            while len(_simulators) > 1:
                _simulators.pop(next(iter(_simulators)))
            _simulators[key] = threading.Lock(), []
        one_at_a_time, made = _simulators[key]
    with one_at_a_time:  # another thread may make one at the same time
        if not made:
            made.append(Simulator(cell.scenario))
    return made[0]


def run_chunk(study: Study, chunk: Chunk, skip: Collection[int] = ()) -> Arrays:
    """The chunk function: simulate, fuse and score the runs of a chunk; a dict of arrays by
    name. Runs in `skip` are marked as quarantined."""
    cell = study.cells[chunk.cell]
    made = simulator(cell)
    at = epochs(made.truth, max(1, round(study.epoch * cell.scenario.rate)))
    wanted = [parse_label(label) for label in study.filters]
    arrays = _empty(study, chunk, at, parameters_of(made.ideal_recording(), study.installation))
    arrays["reason"][:, [run - chunk.first for run in skip if run in range(*chunk[1:])]] = (
        QUARANTINED
    )
    runs = [run for run in range(chunk.first, chunk.stop) if run not in skip]
    lanes = Lanes(wanted, made, cell.imu, at, study.limits) if study.side_by_side else None
    for group in (runs[i : i + LANES] for i in range(0, len(runs), LANES)):
        records = [RunRecord(study, cell, made, at, run) for run in group]
        scores: list[list[Scored | None]] = [[None] * len(group)] * len(wanted)
        biases = None
        if lanes:
            scores, biases = lanes.run([record.stream for record in records])
        for i, record in enumerate(records):
            place = record.run - chunk.first
            for number, label in enumerate(wanted):
                _keep(arrays, number, place, scores[number][i] or record.score(label))
            own = record.biases if biases is None else biases[i]
            arrays["bias"][place] = own[arrays["kept"]]
    if chunk.first == 0:
        arrays["bound"] = _cramer_rao_bound(made, cell, at)[arrays["kept"]]
    return arrays


class RunRecord:
    """A single simulated run, as a user would make it; simulated on first use."""

    def __init__(self, study: Study, cell: Cell, made: Simulator, at: Epochs, run: int) -> None:
        self.study, self.cell, self.made, self.run = study, cell, made, run
        self._at, self.stream = at, seeds(study, cell, run)

    @cached_property
    def _drawn(self) -> tuple[Installed, InitialState, Epochs]:
        """(recording with its installation errors, start, truth in its axes)."""
        recording, start = self.made.run(self.cell.imu, self.stream)
        installed = wrongly_installed(self.study, self.cell, self.run, recording)
        if not installed.parameters:
            return installed, start, self._at
        reference = installed.recording.reference
        assert reference is not None
        truth = reference.take(self._at.rows + 1)
        return installed, start_of(installed, start), self._at._replace(truth=truth)

    @cached_property
    def biases(self) -> Array:
        """(n, 6) true biases at the epochs: accelerometer, m/s^2, gyro, rad/s."""
        meta = self._drawn[0].recording.meta
        return np.c_[meta["b_a"][self._at.rows], meta["b_g"][self._at.rows]]

    def score(self, label: Labelled) -> Scored:
        """Scored of a filter on it."""
        installed, start, at = self._drawn
        filter, options, _ = label
        solution = fuse(
            installed.recording,
            filter,
            imu=self.cell.imu,
            start=start,
            options=options,
            every=at.every,
            covariance=True,
            estimate=estimated_parameters(self.study.installation, label),
        )
        scored = score(solution, at, self.biases[:, :3], self.biases[:, 3:], self.study.limits)
        if installed.parameters:
            scored.numbers.update(score_parameters(solution, scored, installed.true))
        return scored


def estimated_parameters(installation: Installation, label: Labelled) -> Installation | None:
    """Return the parameters that a filter estimates, as `fuse` takes them: those that its label
    names, with the standard deviations from which they are drawn."""
    if label.estimate is None:
        return None
    return {name: installation.get(name) for name in label.estimate}


def wrongly_installed(study: Study, cell: Cell, run: int, recording: Recording) -> Installed:
    """Return the recording of a run with installation errors drawn from a separate stream: the same
    for every IMU and every set of filters."""
    if not study.installation:
        return Installed(recording, (), np.empty(0))
    stream = seeds(study, cell, run).child("installation")
    return draw_installation(recording, study.installation, stream)


def _cramer_rao_bound(made: Simulator, cell: Cell, at: Epochs) -> Array:
    """Posterior Cramer-Rao bound at the scored epochs as variances (n, 15); NaN where the
    filters' Earth is not the scenario's."""
    try:
        return (
            cramer_rao(
                made.ideal_recording(), made.exact_start(cell.imu), cell.imu.noise(), every=at.every
            ).std
            ** 2
        )
    except DataError:
        return np.full((len(at.rows), STATES), np.nan)


def _empty(study: Study, chunk: Chunk, at: Epochs, parameters: Sequence[StateParameter]) -> Arrays:
    """Arrays for the results of a chunk: runs at the stored epochs, sums over its runs, numbers
    of each run."""
    M, N, kept = (
        len(study.filters),
        chunk.stop - chunk.first,
        np.arange(len(at.rows) - 1, -1, -study.keep)[::-1],
    )
    n = len(kept)

    def small(*shape: int) -> NDArray[np.float32]:
        return np.full(shape, np.nan, np.float32)

    numbers = {name: np.full((M, N), np.nan) for name in SCALARS}
    numbers |= {
        "mean_square": np.full((M, N, len(ERROR_GROUPS)), np.nan),
        "coverage": np.full((M, N, 3), np.nan),
    }
    sums = {name: np.zeros((M, n, STATES)) for name in ("squares", "variances")} | {
        name: np.zeros((M, n)) for name in ("nees_sum", "alive")
    }
    if parameters:
        numbers |= {name: np.full((M, N), np.nan) for name in PARAMETER_SCALARS}
        numbers |= {
            name: np.full((M, N, len(parameters)), np.nan)
            for name in ("parameter_error", "parameter_std")
        }
        numbers["parameter"] = np.array([each.name for each in parameters], object)
    return {
        "t": at.truth.t[kept],
        "kept": kept,
        "error": small(M, N, n, STATES),
        "std": small(M, N, n, STATES),
        "nees_rows": small(M, N, n),
        "bias": small(N, n, 6),
        **sums,
        **numbers,
    }


def _keep(arrays: Arrays, number: int, place: int, scored: Scored) -> None:
    kept = arrays["kept"]
    alive = kept < scored.rows
    error, std, nees = scored.error[kept], scored.std[kept], scored.nees[kept]
    (
        arrays["error"][number, place],
        arrays["std"][number, place],
        arrays["nees_rows"][number, place],
    ) = error, std, nees
    arrays["squares"][number, alive] += error[alive] ** 2
    arrays["variances"][number, alive] += std[alive] ** 2
    arrays["nees_sum"][number, alive] += nees[alive]
    arrays["alive"][number] += alive
    for name, value in scored.numbers.items():
        arrays[name][number, place] = value


def plugins_of(study: Study) -> list[Plugin]:
    """The plugins that bring its filters, the kinds of its sensors and their quantities."""
    kinds = _kinds(study)
    found = [
        *(QUANTITIES.brought_by(q) for kind in kinds for q in aiding.find(kind).quantities),
        *(aiding.REGISTRY.brought_by(kind) for kind in kinds),
        *(filters.REGISTRY.brought_by(parse_label(label)[0].name) for label in study.filters),
    ]
    return list({plugin.where: plugin for plugin in found if plugin}.values())


def _kinds(study: Study) -> list[str]:
    """Kinds of measurement that its recordings can have."""
    sensors = [sensor for cell in study.cells for sensor in cell.scenario.sensors]
    return list(dict.fromkeys([*aiding.own_names(), *(sensor.kind for sensor in sensors)]))


def compile_for(study: Study, notify: Notify | None = None) -> None:
    """Compile the kernels that a study needs, before several threads want them."""
    kinds = _kinds(study)
    compile_together(kernels_for(study), "the filters of the study", notify)
    for label in study.filters:
        filter = parse_label(label)[0]
        prepare(filter, kinds, notify)
        for kernel in _wide_kernels(study, filter):
            compile_kernel(kernel)


def kernels_for(study: Study) -> list[Any]:
    """The kernels that `compile_for` compiles."""
    kinds, found = _kinds(study), []
    for label in study.filters:
        filter = parse_label(label)[0]
        found += [*kernels_of(filter, kinds), *_wide_kernels(study, filter)]
    return found


def _wide_kernels(study: Study, filter: Filter) -> list[Any]:
    """Those of a filter for several runs at once."""
    return kernels_in_lanes(filter, _kinds(study)) if study.side_by_side and filter.lanes else []
