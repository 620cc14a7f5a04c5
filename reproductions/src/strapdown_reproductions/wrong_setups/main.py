"""Set-ups with a known mistake: `strapdown reproduce wrong-setups`.

Each mistake is made on each recording; the solution says how much harm it does, `inspect` and the
verdict whether anyone notices, and the first reason whether the cause is named.
"""

from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from strapdown.checks import check_number
from strapdown.typing import File, Progress

from ..common.example_recordings import DESCRIPTIONS
from ..common.pages import write_page
from ..common.processes import on_processes
from . import diagnosed, summary
from .cases import MOTIONS, recorded, simulated
from .cells import cells, right_row, table

SEEDS, QUICK_SEEDS = 20, 1
RIGHT_SEEDS, RIGHT_FIRST = 25, 101
"""Right set-ups: seeds of each of RIGHT_MOTIONS, and the first of them."""
RIGHT_MOTIONS = ("car", "flight", "ship", "hand-held")
Task: TypeAlias = tuple[str, str, int]
"""What is run (SIMULATED, RECORDED, ALONE or DIAGNOSED), recording, seed."""
SIMULATED, RECORDED, ALONE = "simulated", "recorded", "right set-up alone"
DIAGNOSED = "diagnosed"


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 1,
    recordings: File | None = None,
    workers: int = 0,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run every cell, write the page into the folder `out`, return the claims.

    quick: one seed, one simulated motion; runs: number of seeds; seed: the first of them;
    recordings: folder of the descriptions (default: those of the source tree, left out where they
    are not); workers: processes, the processors by default; progress: called with the fraction
    done. Raises DataError.
    """
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    folder = Path(recordings) if recordings else DESCRIPTIONS
    tasks = quick_tasks(seed, count) if quick else all_tasks(folder, seed, count)
    rows: dict[str, list[dict[str, Any]]] = {}
    made = on_processes(partial(work, folder), tasks, workers)
    for done, (task, found) in enumerate(zip(tasks, made), 1):
        rows.setdefault(DIAGNOSED if task[0] == DIAGNOSED else SIMULATED, []).extend(found)
        if progress:
            progress(done / len(tasks))
    return write(Path(out), table(rows[SIMULATED]), diagnosed.table(rows.get(DIAGNOSED, [])))


def all_tasks(folder: Path, seed: int, count: int) -> list[Task]:
    """The recorded cases, `count` seeds of the simulated ones from `seed` on, and right set-ups
    with other seeds."""
    rights = max(1, round(count * RIGHT_SEEDS / SEEDS))
    first = RIGHT_FIRST + seed - 1
    return [
        *((RECORDED, name, 0) for name in recorded(folder)),
        *((SIMULATED, name, s) for s in range(seed, seed + count) for name in MOTIONS),
        *((DIAGNOSED, name, seed) for name in MOTIONS),
        *((ALONE, name, s) for s in range(first, first + rights) for name in RIGHT_MOTIONS),
    ]


def quick_tasks(seed: int, count: int) -> list[Task]:
    """One simulated motion alone."""
    return [(SIMULATED, next(iter(MOTIONS)), s) for s in range(seed, seed + count)]


def work(folder: Path, task: Task) -> list[dict[str, Any]]:
    """Rows of a task."""
    what, name, seed = task
    if what == RECORDED:
        return cells(recorded(folder)[name](), seed)
    case = simulated(name, seed)
    if what == DIAGNOSED:
        return diagnosed.diagnoses(case, seed)
    return [right_row(case, seed)] if what == ALONE else cells(case, seed)


def write(out: Path, rows: pd.DataFrame, diagnoses: pd.DataFrame) -> list[dict[str, Any]]:
    """Write page and tables of finished cells and diagnoses into the folder `out`; return the
    claims."""
    claims = summary.claims(rows, diagnoses)
    tables = summary.tables(rows, diagnoses)
    write_page(
        out,
        summary.TITLE,
        summary.INTRODUCTION,
        claims,
        {"cells": (None, rows), **tables},
        texts={"table.md": summary.in_docs(claims, tables)},
    )
    return claims
