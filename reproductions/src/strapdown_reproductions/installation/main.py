"""Share of an installation's errors that is found, and coverage of the intervals:
`strapdown reproduce installation`."""

from pathlib import Path
from typing import Any

from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import Task, collect_tables
from . import commands, drive, misses, simulated
from .cases import ALIGNED, KNOWN, MOTIONS, UNSEEN
from .summary import COMMANDS, DRIVE, FILTER, MISSES, STUDY

SEEDS, QUICK_SEEDS = 100, 3
OTHERS, OTHER_PART = ("mekf", "ukf"), 5
"""Filters beside the closed loop, which get this part of the seeds."""
BATCH = 5
"""Seeds of a task."""
QUICK_MOTION = "car with odometer"


@reproduction("quick", "runs", "seed", "recordings", "workers", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims; quick: few seeds of one
    motion; the recordings are left out where they are not. Raises DataError."""
    seeds, folder = asked.seeds_from(SEEDS, QUICK_SEEDS), Path(asked.recordings or DESCRIPTIONS)
    tasks = quick_tasks(seeds) if asked.quick else all_tasks(folder, seeds)
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def all_tasks(folder: Path, seeds: range) -> list[Task]:
    """The recorded ones where they are, and all motions from both starts; of the filters OTHERS
    fewer seeds."""
    there = (folder / "drive0708.toml").exists()
    few = seeds[: max(1, len(seeds) // OTHER_PART)]
    recorded = [
        *(Task(DRIVE, drive.rows, (folder, wrong)) for wrong in drive.WRONG),
        Task(MISSES, misses.rows, (folder,)),
    ]
    cells = [
        *((name, FILTER, start, seeds) for name in MOTIONS for start in (KNOWN, ALIGNED)),
        *((name, FILTER, ALIGNED, seeds) for name in UNSEEN),
        *((name, other, KNOWN, few) for name in MOTIONS for other in OTHERS),
    ]
    return [
        *(recorded if there else ()),
        *(task for cell in cells for task in batches(*cell)),
        *(
            Task(COMMANDS, commands.rows, (name, seeds[first : first + BATCH]))
            for name in MOTIONS
            for first in range(0, len(seeds), BATCH)
        ),
    ]


def quick_tasks(seeds: range) -> list[Task]:
    """One simulated motion alone, from both starts."""
    starts = (KNOWN, ALIGNED)
    return [t for start in starts for t in batches(QUICK_MOTION, FILTER, start, seeds)]


def batches(name: str, filter: str, start: str, seeds: range) -> list[Task]:
    """Tasks of a few of the seeds, each of which fills several tables."""
    return [
        Task("", simulated.runs, (name, filter, start, seeds[first : first + BATCH]))
        for first in range(0, len(seeds), BATCH)
    ]
