"""Studies: N runs of M filters on the same simulated data, over scenarios and IMU grades, as a
campaign of chunk files that can be resumed.

A cell is a scenario with an IMU; a chunk is some runs of a cell with all filters on the same
records. How runs are cut into chunks depends on the study alone and every run has its own random
stream, so neither workers nor order nor an interruption changes a result.
"""

import threading
import zlib
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import lru_cache
from os import cpu_count
from typing import NamedTuple

import numpy as np

from ... import aiding
from ...core.contract import STATES
from ...data import DataError
from ...engine.batch import fuse, prepare
from ...evaluation.consistency import Limits
from ...evaluation.cramer_rao import cramer_rao
from ...sensor_models.imu import ImuSpec, grade
from ...sim.scenario import Scenario, scenario
from ...sim.synthesis import Simulator
from ..filter_label import parsed
from .scoring import GROUPS, QUARANTINED, epochs, score

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
    def name(self):
        """Names a folder of chunk files."""
        return f"{self.scenario.name}--{self.imu.name}".replace("/", "-").replace(" ", "-")


class Chunk(NamedTuple):
    """Runs `first` to `stop` of the cell of that number."""

    cell: int
    first: int
    stop: int


@dataclass(frozen=True)
class Study:
    """What is simulated, which filters run on it, and how often. Raises DataError.

    scenarios: Scenario values, built-in names or TOML files; filters: names, with options as
    "periodic-reset:interval=60"; imus: grades, files or ImuSpec, each with every scenario (default:
    the scenario's own).
    """

    scenarios: tuple
    filters: tuple = ("closed-loop", "open-loop")
    imus: tuple = ()
    runs: int = 50
    seed: int = 0
    epoch: float = 1.0  # s between scored rows
    keep: int = 5  # every keep-th scored row is stored and part of the curves
    limits: Limits = field(default_factory=Limits)
    # filter steps in a chunk, about: seconds of work, which is what an interruption loses
    chunk_steps: int = 3_000_000

    def __post_init__(self):
        for name in ("scenarios", "filters", "imus"):
            value = getattr(self, name)
            object.__setattr__(
                self,
                name,
                (value,) if isinstance(value, (str, Scenario, ImuSpec)) else tuple(value),
            )
        for name, least in (("runs", 1), ("keep", 1), ("seed", 0), ("chunk_steps", 1)):
            if (
                not isinstance(getattr(self, name), (int, np.integer))
                or getattr(self, name) < least
            ):
                raise DataError(
                    f"study: {name} is {getattr(self, name)!r}; it must be a whole number, {least} or more"
                )
        if not self.epoch > 0:
            raise DataError(f"study: epoch is {self.epoch!r} s; it must be larger than 0")
        if not self.scenarios or not self.filters:
            raise DataError("study: it needs a scenario and a filter at least")
        for label in self.filters:
            parsed(label)
        names = [cell.name for cell in self.cells]
        for values, what in ((names, "cells (scenario and IMU)"), (self.filters, "filters")):
            if len(set(values)) < len(values):
                twice = next(v for v in values if list(values).count(v) > 1)
                raise DataError(
                    f"study: two {what} have the name {twice!r}; give them different names"
                )
        for label in self.filters:
            self._check_attitude(parsed(label)[0])

    def _check_attitude(self, filter):
        """Raise DataError where `filter` needs an attitude and a scenario has neither an AHRS
        nor what one can be run from."""
        bare = [
            cell.scenario.name
            for cell in self.cells
            if cell.scenario.attitude is None and cell.scenario.magnetometer is None
        ]
        if "attitude" in filter.needs and bare:
            raise DataError(
                f"study: {filter.name} needs attitude aiding, and the scenario {bare[0]!r} has none: give it an AHRS, "
                "section [attitude] of its file, or a [magnetometer], from which attitude-mekf makes an attitude"
            )

    @property
    def cells(self):
        """All scenarios with all IMUs."""
        return _cells(self.scenarios, self.imus)

    def chunks(self):
        """All chunks, in the order of the cells."""
        return [
            Chunk(number, first, min(first + size, self.runs))
            for number, cell in enumerate(self.cells)
            for size in [self._chunk_runs(cell)]
            for first in range(0, self.runs, size)
        ]

    def _chunk_runs(self, cell):
        steps = cell.scenario.duration * cell.scenario.rate * len(self.filters)
        return min(self.runs, max(1, round(self.chunk_steps / steps)))

    def steps(self, chunk=None):
        """Filter steps (IMU samples through a filter) of a chunk, or of the whole study."""
        parts = self.chunks() if chunk is None else [chunk]
        length = lambda cell: round(
            self.cells[cell].scenario.duration * self.cells[cell].scenario.rate
        )
        return sum(
            (part.stop - part.first) * length(part.cell) * len(self.filters) for part in parts
        )

    def run(self, out=None, threads=None, workers=0, scheduler=None, say=None, progress=None):
        """Run what is missing of the campaign in folder `out` (default: a temporary one) and return
        it as a campaign.Campaign.

        threads: in this process (default: one per core); workers: processes of a Dask cluster on
        this machine instead; scheduler: the address of a Dask scheduler whose workers see the same
        folder. Ctrl-C or a kill loses the chunks in work only. Raises DataError.
        """
        from .campaign import Campaign

        for name, count in (("threads", threads or 0), ("workers", workers)):
            if count < 0:
                raise DataError(f"{name} is {count}; it must be 1 or more")
        if scheduler is not None and (workers or not scheduler.strip()):
            remedy = (
                f" beside {workers} workers here; give one of the two"
                if workers
                else "; give tcp://HOST:PORT, or leave it out"
            )
            raise DataError(f"scheduler is {scheduler!r}{remedy}")
        campaign = Campaign.begin(self, out)
        with campaign.locked():
            campaign.check()
            missing = campaign.missing()
            done, total = self.steps() - sum(map(self.steps, missing)), self.steps()
            results = (
                _distributed(campaign, missing, workers, scheduler, say)
                if workers or scheduler
                else _threaded(campaign, missing, threads, say)
            )
            for chunk in results:
                done += self.steps(chunk)
                if progress:
                    progress(done / total)
            campaign.finish()
        return campaign


@lru_cache(maxsize=8)
def _cells(scenarios, imus):
    known = [s if isinstance(s, Scenario) else scenario(s) for s in scenarios]
    return tuple(Cell(s, grade(imu)) for s in known for imu in (imus or (s.imu,)))


def seeds(study, cell, run):
    """The random stream of a run: the same for every IMU and every set of filters, its own for
    every scenario."""
    return np.random.SeedSequence(
        study.seed, spawn_key=(zlib.crc32(cell.scenario.name.encode()), run)
    )


_simulators, _making = {}, threading.Lock()


def simulator(cell):
    """The Simulator of a cell's scenario; the last two are kept."""
    key = cell.scenario.describe()[
        "fingerprint"
    ]  # a worker gets a new copy of the scenario with every chunk
    with _making:
        if key not in _simulators:
            while len(_simulators) > 1:
                _simulators.pop(next(iter(_simulators)))
            _simulators[key] = threading.Lock(), []
        one_at_a_time, made = _simulators[key]
    with one_at_a_time:  # another thread may make another one meanwhile
        if not made:
            made.append(Simulator(cell.scenario))
    return made[0]


def run_chunk(study, chunk, skip=()):
    """The chunk function: simulate, fuse and score the runs of a chunk; a dict of arrays by
    name. Runs in `skip` are marked as quarantined."""
    cell = study.cells[chunk.cell]
    made = simulator(cell)
    at = epochs(made.truth, max(1, round(study.epoch * cell.scenario.rate)))
    arrays, wanted = _empty(study, chunk, at), [parsed(label) for label in study.filters]
    for place, run in enumerate(range(chunk.first, chunk.stop)):
        if run in skip:
            arrays["reason"][:, place] = QUARANTINED
            continue
        recording, start = made.run(cell.imu, seeds(study, cell, run))
        b_a, b_g = recording.meta["b_a"][at.rows], recording.meta["b_g"][at.rows]
        arrays["bias"][place] = np.c_[b_a, b_g][arrays["kept"]]
        for number, (filter, options) in enumerate(wanted):
            solution = fuse(
                recording,
                filter,
                start=start,
                noise=cell.imu.noise(),
                every=at.every,
                covariance=True,
                **options,
            )
            _keep(arrays, number, place, score(solution, at, b_a, b_g, study.limits))
    if chunk.first == 0:
        arrays["bound"] = _bound(made, cell, at)[arrays["kept"]]
    return arrays


def _bound(made, cell, at):
    """Posterior Cramer-Rao bound at the scored epochs as variances (n, 15); NaN where the
    filters' Earth is not the scenario's."""
    try:
        return (
            cramer_rao(
                made.ideal_recording(), made.exact_start(cell.imu), cell.imu.noise(), every=at.every
            ).sd
            ** 2
        )
    except DataError:
        return np.full((len(at.rows), STATES), np.nan)


def _empty(study, chunk, at):
    """Arrays for the results of a chunk: runs at the stored epochs, sums over its runs, numbers
    of each run."""
    M, N, kept = (
        len(study.filters),
        chunk.stop - chunk.first,
        np.arange(len(at.rows) - 1, -1, -study.keep)[::-1],
    )
    n = len(kept)
    small = lambda *shape: np.full(shape, np.nan, np.float32)
    numbers = {name: np.full((M, N), np.nan) for name in SCALARS}
    numbers |= {
        "mean_square": np.full((M, N, len(GROUPS)), np.nan),
        "coverage": np.full((M, N, 3), np.nan),
    }
    sums = {name: np.zeros((M, n, STATES)) for name in ("squares", "variances")} | {
        name: np.zeros((M, n)) for name in ("nees_sum", "alive")
    }
    return {
        "t": at.truth.t[kept],
        "kept": kept,
        "error": small(M, N, n, STATES),
        "sd": small(M, N, n, STATES),
        "nees_rows": small(M, N, n),
        "bias": small(N, n, 6),
        **sums,
        **numbers,
    }


def _keep(arrays, number, place, scored):
    kept = arrays["kept"]
    alive = kept < scored.rows
    error, sd, nees = scored.error[kept], scored.sd[kept], scored.nees[kept]
    (
        arrays["error"][number, place],
        arrays["sd"][number, place],
        arrays["nees_rows"][number, place],
    ) = error, sd, nees
    arrays["squares"][number, alive] += error[alive] ** 2
    arrays["variances"][number, alive] += sd[alive] ** 2
    arrays["nees_sum"][number, alive] += nees[alive]
    arrays["alive"][number] += alive
    for name, value in scored.numbers.items():
        arrays[name][number, place] = value


def _threaded(campaign, missing, threads, say):
    """Run chunks on threads of this process, yielding each when its file is there."""
    if not missing:
        return
    compile_for(campaign.study, say)
    pool = ThreadPoolExecutor(threads or cpu_count())
    try:
        waiting = {pool.submit(campaign.work, chunk): chunk for chunk in missing}
        for future in as_completed(waiting):
            future.result()
            yield waiting[future]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _distributed(campaign, missing, workers, scheduler, say):
    from .distributed import run

    return run(campaign, missing, workers, scheduler, say)


def compile_for(study, say=None):
    """Compile the kernels that a study needs, before several threads want them."""
    for label in study.filters:
        prepare(parsed(label)[0], aiding.names(), say)
