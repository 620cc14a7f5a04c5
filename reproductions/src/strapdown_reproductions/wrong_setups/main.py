"""Set-ups with a known mistake: `strapdown reproduce wrong-setups`.

Each mistake is made on each recording; the solution says how much harm it does, `inspect` and the
verdict whether anyone notices, and the first reason whether the cause is named.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import Task, collect_tables
from . import diagnosed
from .cases import MOTIONS, recorded_cases, simulate_case
from .cells import cells, right_row
from .summary import CELLS, DIAGNOSES, STUDY

SEEDS, QUICK_SEEDS = 20, 1
RIGHT_SEEDS, RIGHT_FIRST = 25, 101
"""Right set-ups: seeds of each of RIGHT_MOTIONS, and the first of them."""
RIGHT_MOTIONS = ("car", "flight", "ship", "hand-held")


@reproduction("quick", "runs", "seed", "recordings", "workers", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run every cell, write the page into the folder `out`, return the claims; quick: one seed, one
    simulated motion; the recordings are left out where they are not. Raises DataError."""
    seeds = asked.seeds_from(SEEDS, QUICK_SEEDS)
    if asked.quick:
        tasks = list(of_motions([next(iter(MOTIONS))], seeds))
    else:
        tasks = all_tasks(Path(asked.recordings or DESCRIPTIONS), seeds)
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def all_tasks(folder: Path, seeds: range) -> list[Task]:
    """The recorded cases, the simulated ones, and right set-ups with other seeds."""
    rights = max(1, round(len(seeds) * RIGHT_SEEDS / SEEDS))
    first = RIGHT_FIRST + seeds.start - 1
    return [
        *(Task(CELLS, of_recorded, (folder, name)) for name in recorded_cases(folder)),
        *of_motions(MOTIONS, seeds),
        *(Task(DIAGNOSES, diagnoses, (name, seeds.start)) for name in MOTIONS),
        *(
            Task(CELLS, of_right, (name, s))
            for s in range(first, first + rights)
            for name in RIGHT_MOTIONS
        ),
    ]


def of_motions(names: Iterable[str], seeds: range) -> Iterator[Task]:
    """Yields a task for each simulated motion and seed."""
    return (Task(CELLS, of_simulated, (name, s)) for s in seeds for name in names)


def of_recorded(folder: Path, name: str) -> list[dict[str, Any]]:
    """Rows of the mistakes in a recorded case."""
    return cells(recorded_cases(folder)[name](), 0)


def of_simulated(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of the mistakes in a simulated case."""
    return cells(simulate_case(name, seed), seed)


def of_right(name: str, seed: int) -> list[dict[str, Any]]:
    """The row of a simulated case as it is."""
    return [right_row(simulate_case(name, seed), seed)]


def diagnoses(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of what is diagnosed of a simulated case."""
    return diagnosed.diagnoses(simulate_case(name, seed), seed)
