"""What noise that a filter was not told of does, and what helps: `strapdown reproduce noise`."""

from pathlib import Path
from typing import Any

from strapdown.typing import File, Progress

from ..common.example_recordings import DESCRIPTIONS
from ..common.runner import Task, collected, count_of
from . import correlated, coverage, misstated, outliers
from .summary import CORRELATED, COVERAGE, MISSTATED, OUTLIERS, STUDY
from .worlds import CAR, WORLDS

SEEDS, QUICK_SEEDS = 20, 2
PLAIN = 2
"""Runs without `tune` for each with it: they take a hundredth of its time."""


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 1,
    recordings: File | None = None,
    workers: int = 0,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims.

    quick: few seeds of the car, without `tune`; runs: number of seeds; seed: the first of them;
    recordings: folder of the descriptions (default: those of the source tree, left out where they
    are not); workers: processes, the processors by default; progress: called with the fraction
    done. Raises DataError.
    """
    seeds = range(seed, seed + count_of(quick, runs, seed, SEEDS, QUICK_SEEDS))
    folder = Path(recordings) if recordings else DESCRIPTIONS
    tasks = quick_tasks(seeds) if quick else all_tasks(folder, seeds)
    return STUDY.write(out, collected(tasks, workers, progress))


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
