"""Studies: N runs of M filters on the same simulated data, over scenarios and IMU grades, as a
campaign of chunk files that can be resumed.

A cell is a scenario with an IMU; a chunk is some runs of a cell with all filters on the same
records. How runs are cut into chunks depends on the study alone and every run has its own random
stream, so neither workers nor order nor an interruption changes a result.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from os import PathLike, cpu_count
from typing import Any, TypedDict, Unpack

from ...checks import DataError, brief, check_number
from ...core.compile.signatures import LANES
from ...core.loop.contract import COMPILED, Filter
from ...engine.options import OPTIONS, Option, takes
from ...evaluation.consistency import LossLimits
from ...progress import listener, with_bar
from ...sensor_models.imu import ImuSpec
from ...sim.scenario import Scenario
from ...typing import File, Notify, Progress
from ..filter_label import parse_label
from . import distributed
from .campaign import Campaign
from .chunks import SCALARS, Cell, Chunk, cells, compile_for, run_chunk, seeds, simulator
from .wrong_installation import Installation, check_installation

__all__ = ["SCALARS", "Cell", "Chunk", "Study", "parse_label", "run_chunk", "seeds", "simulator"]


MANY_STEPS = 400_000
"""Filter steps from which on a study goes through lanes."""


class CampaignOptions(TypedDict, total=False):
    """Options by which the runs of a study are made."""

    threads: int | None
    workers: int
    scheduler: str | None
    notify: Notify | None


CAMPAIGN_OPTIONS = {
    "threads": Option(None, "int", "At a time in this process; default: one per core."),
    "workers": Option(0, "int", "Processes of a Dask cluster on this machine instead."),
    "scheduler": Option(
        None, "str", "Address of a Dask scheduler whose workers see the same folder."
    ),
    "notify": OPTIONS["notify"],
}
"""Defaults and meanings, by name."""


@dataclass(frozen=True, init=False)
class Study:
    """A study: scenarios, the filters that run on them, and the number of runs.

    Parameters
    ----------
    scenarios : str, Scenario or several
        Scenario values, built-in names or TOML files; as an attribute a tuple, as filters and imus.
    filters : str or several
        Names, with options as "periodic-reset:interval=60".
    imus : str, ImuSpec or several
        Grades, files or ImuSpec, each with every scenario; default: the scenario's own.
    runs : int
        Number of runs of each filter in each cell, a scenario with an IMU.
    seed : int
        Seed of all random numbers.
    epoch : float
        s between scored rows.
    keep : int
        Every keep-th scored row is stored and part of the curves.
    limits : LossLimits
        Bounds beyond which a run is lost.
    chunk_steps : int
        Approximate filter steps in a chunk: seconds of work, the loss from an interruption.
    installation : dict
        {parameter: standard deviation} from which each run draws its installation errors, SI, named
        as in `fuse(estimate=)`. A filter estimates them if its label says so, as
        "closed-loop:estimate=clock+lever-arm", with these standard deviations as its priors.

    Raises
    ------
    DataError
        If an argument is out of range or unknown.
    """

    scenarios: tuple[str | Scenario, ...]
    filters: tuple[str, ...]
    imus: tuple[str | ImuSpec, ...]
    runs: int
    seed: int
    epoch: float
    keep: int
    limits: LossLimits
    chunk_steps: int
    installation: Installation

    def __init__(
        self,
        scenarios: str | Scenario | Iterable[str | Scenario],
        filters: str | Iterable[str] = ("closed-loop", "open-loop"),
        imus: str | ImuSpec | Iterable[str | ImuSpec] = (),
        runs: int = 50,
        seed: int = 0,
        epoch: float = 1.0,
        keep: int = 5,
        limits: LossLimits | None = None,
        chunk_steps: int = 3_000_000,
        installation: Installation | None = None,
    ) -> None:
        vars(self).update(
            scenarios=_several(scenarios, "scenarios", Scenario),
            filters=_several(filters, "filters", str),
            imus=_several(imus, "imus", ImuSpec),
            runs=runs,
            seed=seed,
            epoch=epoch,
            keep=keep,
            limits=LossLimits() if limits is None else limits,
            chunk_steps=chunk_steps,
            installation={} if installation is None else installation,
        )
        self._check()

    def _check(self) -> None:
        """Raise DataError where a value is out of range or a name is not known."""
        for name, least in (("runs", 1), ("keep", 1), ("seed", 0), ("chunk_steps", 1)):
            check_number(getattr(self, name), f"study: {name}", least=least, whole=True)
        check_number(self.epoch, "study: epoch", "s", above=0)
        vars(self)["installation"] = check_installation(self.installation)
        if not self.scenarios or not self.filters:
            raise DataError("study: it needs at least a scenario and a filter")
        for label in self.filters:
            parse_label(label)
        names = [cell.name for cell in self.cells]
        for values, what in ((names, "cells (scenario and IMU)"), (self.filters, "filters")):
            if len(set(values)) < len(values):
                twice = next(v for v in values if list(values).count(v) > 1)
                raise DataError(
                    f"study: two {what} have the name {twice!r}; give them different names"
                )
        for label in self.filters:
            self._check_attitude(parse_label(label)[0])

    def _check_attitude(self, filter: Filter) -> None:
        """Raise DataError where `filter` needs an attitude and a scenario has neither an AHRS
        nor what one can be run from."""
        bare = [
            cell.scenario.name
            for cell in self.cells
            if cell.scenario.attitude is None and cell.scenario.magnetometer is None
        ]
        if "attitude" in filter.needs and bare:
            raise DataError(
                f"study: {filter.name} needs attitude aiding, but the scenario {bare[0]!r} has "
                f"none: give it an AHRS, "
                "section [attitude] of its file, or a [magnetometer], from which attitude-mekf "
                "computes an attitude"
            )

    @property
    def cells(self) -> tuple[Cell, ...]:
        """All scenarios with all IMUs."""
        return cells(self.scenarios, self.imus)

    @property
    def side_by_side(self) -> bool:
        """True where filters that support it process runs in batches of eight. A study of a second
        or so runs them one by one, without waiting for other kernels."""
        lanes = any(parse_label(label)[0].lanes for label in self.filters)
        return COMPILED and lanes and not self.installation and self.steps() >= MANY_STEPS

    def chunks(self) -> list[Chunk]:
        """All chunks, in the order of the cells."""
        found = []
        for number, cell in enumerate(self.cells):
            steps = cell.scenario.duration * cell.scenario.rate * len(self.filters)
            together = LANES if self.side_by_side else 1
            size = min(self.runs, together * max(1, round(self.chunk_steps / steps / together)))
            found += [
                Chunk(number, first, min(first + size, self.runs))
                for first in range(0, self.runs, size)
            ]
        return found

    def steps(self, chunk: Chunk | None = None) -> int:
        """Filter steps (IMU samples through a filter) of a chunk, or of the whole study."""

        def length(cell: Cell) -> int:
            return round(cell.scenario.duration * cell.scenario.rate)

        if chunk is None:
            return self.runs * sum(map(length, self.cells)) * len(self.filters)
        return (chunk.stop - chunk.first) * length(self.cells[chunk.cell]) * len(self.filters)

    @with_bar("study")
    @takes(CampaignOptions, CAMPAIGN_OPTIONS)
    def run(
        self,
        out: File | None = None,
        *,
        progress: Progress | bool | None = None,
        **how: Unpack[CampaignOptions],
    ) -> Campaign:
        """Run the missing chunks of the campaign in a folder and return the Campaign.

        Ctrl-C or a kill loses only the chunks in progress.

        Parameters
        ----------
        out : path
            The folder; default: a temporary one.
        progress : bool or callable
            Called with the fraction done; True shows a bar.

        Raises
        ------
        DataError
            If the folder belongs to another study, or an option is out of range.
        """
        threads, workers = how.get("threads"), how.get("workers", 0)
        scheduler, notify = how.get("scheduler"), how.get("notify")
        check_number(threads or 0, "threads", least=0, whole=True)
        check_number(workers, "workers", least=0, whole=True)
        if scheduler is not None and (workers or not scheduler.strip()):
            remedy = (
                f" beside {workers} workers here; give one of the two"
                if workers
                else "; give tcp://HOST:PORT, or leave it out"
            )
            raise DataError(f"scheduler is {scheduler!r}{remedy}")
        tell = listener(progress)
        campaign = Campaign.begin(self, out)
        with campaign.lock():
            campaign.check()
            missing = campaign.missing_chunks()
            done, total = self.steps() - sum(map(self.steps, missing)), self.steps()
            results = (
                distributed.run(campaign, missing, workers, scheduler, notify)
                if workers or scheduler
                else _run_threads(campaign, missing, threads, notify)
            )
            for chunk in results:
                done += self.steps(chunk)
                tell(done / total)
            campaign.finish()
        return campaign


def _several(given: Any, name: str, kind: type) -> tuple[Any, ...]:
    """One value or several as a tuple. Raises DataError where one is neither text, a path nor a
    `kind`."""
    fitting = (str, PathLike, kind)
    values = (given,) if isinstance(given, fitting) or not isinstance(given, Iterable) else given
    known = tuple(values)
    for value in known:
        if not isinstance(value, fitting):
            wanted = "a name" if kind is str else f"a name or a {kind.__name__}"
            raise DataError(f"study: {name} has {brief(value)}; each must be {wanted}")
    return known


def _run_threads(
    campaign: Campaign, missing: list[Chunk], threads: int | None, notify: Notify | None
) -> Iterator[Chunk]:
    """Run chunks on threads of this process, yielding each when its file is there."""
    if not missing:
        return
    assert campaign.study is not None  # it began this campaign
    compile_for(campaign.study, notify)
    pool = ThreadPoolExecutor(threads or cpu_count())
    try:
        waiting = {pool.submit(campaign.work, chunk): chunk for chunk in missing}
        for future in as_completed(waiting):
            future.result()
            yield waiting[future]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
