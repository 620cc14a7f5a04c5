"""What of an installation is found, and whether its intervals hold: `strapdown reproduce
installation`."""

from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from strapdown.checks import check_number
from strapdown.typing import File, Progress

from ..common.example_recordings import DESCRIPTIONS
from ..common.pages import write_page
from ..common.processes import on_processes
from ..common.targets import in_docs
from . import drive, misses, simulated, summary
from .cases import ALIGNED, KNOWN, MOTIONS, UNSEEN
from .summary import FILTER, Evidence

SEEDS, QUICK_SEEDS = 100, 3
OTHERS, OTHER_PART = ("mekf", "ukf"), 5
"""Filters beside the closed loop, which get this part of the seeds."""
BATCH = 5
"""Seeds of a task."""
QUICK_MOTION = "car with odometer"
SIMULATED, DRIVE, MISSES = "simulated", "drive", "misses"
Task: TypeAlias = tuple[str, tuple[Any, ...]]
"""What is run, and with which arguments."""


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

    quick: few seeds of one motion; runs: number of seeds; seed: the first of them; recordings:
    folder of the descriptions (default: those of the source tree, left out where they are not);
    workers: processes, the processors by default; progress: called with the fraction done. Raises
    DataError.
    """
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    folder = Path(recordings) if recordings else DESCRIPTIONS
    tasks = quick_tasks(seed, count) if quick else all_tasks(folder, seed, count)
    found: dict[str, list[pd.DataFrame]] = {}
    for done, made in enumerate(on_processes(partial(work, folder), tasks, workers), 1):
        for name, table in made.items():
            found.setdefault(name, []).append(table)
        if progress:
            progress(done / len(tasks))
    return write(Path(out), evidence(found))


def all_tasks(folder: Path, seed: int, count: int) -> list[Task]:
    """The recorded ones where they are, and all motions from both starts; of the filters OTHERS
    fewer seeds."""
    there = (folder / "drive0708.toml").exists()
    few = max(1, count // OTHER_PART)
    return [
        *((DRIVE, (wrong,)) for wrong in drive.WRONG if there),
        *((MISSES, ()) for _ in range(there)),
        *(
            task
            for name in MOTIONS
            for start in (KNOWN, ALIGNED)
            for task in batches(name, FILTER, start, seed, count)
        ),
        *(task for name in UNSEEN for task in batches(name, FILTER, ALIGNED, seed, count)),
        *(
            task
            for name in MOTIONS
            for other in OTHERS
            for task in batches(name, other, KNOWN, seed, few)
        ),
    ]


def quick_tasks(seed: int, count: int) -> list[Task]:
    """One simulated motion alone, from both starts."""
    starts = (KNOWN, ALIGNED)
    return [t for start in starts for t in batches(QUICK_MOTION, FILTER, start, seed, count)]


def batches(name: str, filter: str, start: str, seed: int, count: int) -> list[Task]:
    """Tasks of so many seeds."""
    return [
        (SIMULATED, (name, filter, start, range(first, min(first + BATCH, seed + count))))
        for first in range(seed, seed + count, BATCH)
    ]


def work(folder: Path, task: Task) -> dict[str, pd.DataFrame]:
    """{name of a table of Evidence: its rows} of a task."""
    what, given = task
    if what == DRIVE:
        return {"drive": pd.DataFrame(drive.rows(folder, *given))}
    if what == MISSES:
        return {"misses": pd.DataFrame(misses.rows(folder))}
    *of, seeds = given
    each = [simulated.runs(*of, seed) for seed in seeds]
    return {
        name: pd.concat([getattr(one, name) for one in each]) for name in simulated.Runs._fields
    }


def evidence(found: dict[str, list[pd.DataFrame]]) -> Evidence:
    """The tables of all tasks."""
    empty = pd.DataFrame()
    return Evidence(
        *(
            pd.concat(found[name], ignore_index=True) if name in found else empty
            for name in Evidence._fields
        )
    )


def write(out: Path, found: Evidence) -> list[dict[str, Any]]:
    """Write page and tables into the folder `out`; return the claims."""
    claims, tables = summary.claims(found), summary.tables(found)
    write_page(
        out,
        summary.TITLE,
        summary.INTRODUCTION,
        claims,
        {"runs": (None, found.parameters), **tables},
        texts={"table.md": in_docs(claims, tables)},
    )
    return claims
