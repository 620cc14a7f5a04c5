"""What of an installation is found, and whether its intervals hold: `strapdown reproduce
installation`."""

from pathlib import Path
from typing import Any

from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import Task, collected
from . import drive, misses, simulated
from .cases import ALIGNED, KNOWN, MOTIONS, UNSEEN
from .summary import DRIVE, FILTER, MISSES, STUDY

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
    count = asked.count(SEEDS, QUICK_SEEDS)
    folder = Path(asked.recordings or DESCRIPTIONS)
    tasks = quick_tasks(asked.seed, count) if asked.quick else all_tasks(folder, asked.seed, count)
    return STUDY.write(out, collected(tasks, asked.workers, asked.progress))


def all_tasks(folder: Path, seed: int, count: int) -> list[Task]:
    """The recorded ones where they are, and all motions from both starts; of the filters OTHERS
    fewer seeds."""
    there = (folder / "drive0708.toml").exists()
    few = max(1, count // OTHER_PART)
    recorded = [
        *(Task(DRIVE, drive.rows, (folder, wrong)) for wrong in drive.WRONG),
        Task(MISSES, misses.rows, (folder,)),
    ]
    cells = [
        *((name, FILTER, start, count) for name in MOTIONS for start in (KNOWN, ALIGNED)),
        *((name, FILTER, ALIGNED, count) for name in UNSEEN),
        *((name, other, KNOWN, few) for name in MOTIONS for other in OTHERS),
    ]
    return [
        *(recorded if there else ()),
        *(task for *of, own in cells for task in batches(*of, seed, own)),
    ]


def quick_tasks(seed: int, count: int) -> list[Task]:
    """One simulated motion alone, from both starts."""
    starts = (KNOWN, ALIGNED)
    return [t for start in starts for t in batches(QUICK_MOTION, FILTER, start, seed, count)]


def batches(name: str, filter: str, start: str, seed: int, count: int) -> list[Task]:
    """Tasks of so many seeds, each of which fills several tables."""
    return [
        Task(
            "",
            simulated.runs,
            (name, filter, start, range(first, min(first + BATCH, seed + count))),
        )
        for first in range(seed, seed + count, BATCH)
    ]
