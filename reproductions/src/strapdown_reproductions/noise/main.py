"""Effect of noise that a filter does not model, and the remedies: `strapdown reproduce noise`."""

from pathlib import Path
from typing import Any

from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import Task, collect_tables
from . import correlated, coverage, misstated, outliers
from .summary import CORRELATED, COVERAGE, MISSTATED, OUTLIERS, STUDY
from .worlds import CAR, WORLDS

SEEDS, QUICK_SEEDS = 20, 2
PLAIN = 2
"""Runs without `tune` for each with it: they take a hundredth of its time."""


@reproduction("quick", "runs", "seed", "recordings", "workers", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims; quick: few seeds of the
    car, without `tune`; the recordings are left out where they are not. Raises DataError."""
    seeds = asked.seeds_from(SEEDS, QUICK_SEEDS)
    tasks = (
        quick_tasks(seeds)
        if asked.quick
        else all_tasks(Path(asked.recordings or DESCRIPTIONS), seeds)
    )
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def all_tasks(folder: Path, seeds: range) -> list[Task]:
    """The recorded ones where they are, then the simulated ones, a seed each."""
    there = [name for name in coverage.SCORED if (folder / f"{name}.toml").exists()]
    more = range(seeds.start, seeds.start + PLAIN * len(seeds))
    return [
        *(Task(COVERAGE, coverage.rows, (folder, name)) for name in there),
        *(Task(MISSTATED, misstated.rows, (world, (k,))) for world in WORLDS for k in seeds),
        *(
            Task(CORRELATED, correlated.rows, (world, time, (k,), k in seeds))
            for world in WORLDS
            for time in correlated.TIMES
            for k in more
        ),
        *(Task(OUTLIERS, outliers.rows, (world, (k,))) for world in WORLDS for k in more),
    ]


def quick_tasks(seeds: range) -> list[Task]:
    """The car alone, without `tune`."""
    return [
        *(
            Task(CORRELATED, correlated.rows, (CAR, time, seeds, False))
            for time in correlated.TIMES
        ),
        Task(OUTLIERS, outliers.rows, (CAR, seeds)),
    ]
