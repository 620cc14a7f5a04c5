"""What noise that a filter was not told of does, and what helps: `strapdown reproduce noise`."""

from collections.abc import Iterator
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
from . import correlated, coverage, misstated, outliers, summary
from .summary import Evidence
from .worlds import CAR, WORLDS

SEEDS, QUICK_SEEDS = 20, 2
PLAIN = 2
"""Runs without `tune` for each with it: they take a hundredth of its time."""
Task: TypeAlias = tuple[str, tuple[Any, ...]]
"""Name of a table of Evidence, and the arguments of its rows."""


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
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    folder = Path(recordings) if recordings else DESCRIPTIONS
    seeds = range(seed, seed + count)
    tasks = quick_tasks(seeds) if quick else all_tasks(folder, seeds)
    found: dict[str, list[pd.DataFrame]] = {}
    for done, (name, table) in enumerate(on_processes(partial(work, folder), tasks, workers), 1):
        found.setdefault(name, []).append(table)
        if progress:
            progress(done / len(tasks))
    return write(Path(out), evidence(found))


def all_tasks(folder: Path, seeds: range) -> list[Task]:
    """The recorded ones where they are, then the simulated ones, a seed each."""
    there = [name for name in coverage.SCORED if (folder / f"{name}.toml").exists()]
    more = range(seeds.start, seeds.start + PLAIN * len(seeds))
    return [
        *(("coverage", (name,)) for name in there),
        *(("misstated", (world, (k,))) for world in WORLDS for k in seeds),
        *(
            ("correlated", (world, time, (k,), k in seeds))
            for world in WORLDS
            for time in correlated.TIMES
            for k in more
        ),
        *(("outliers", (world, (k,))) for world in WORLDS for k in more),
    ]


def quick_tasks(seeds: range) -> list[Task]:
    """The car alone, without `tune`."""
    return [("correlated", (CAR, time, seeds, False)) for time in correlated.TIMES] + [
        ("outliers", (CAR, seeds))
    ]


def work(folder: Path, task: Task) -> tuple[str, pd.DataFrame]:
    """(name, rows) of a task."""
    name, given = task
    rows: Iterator[dict[str, Any]]
    if name == "coverage":
        rows = coverage.rows(folder, *given)
    elif name == "misstated":
        rows = misstated.rows(*given)
    elif name == "correlated":
        rows = correlated.rows(*given)
    else:
        rows = outliers.rows(*given)
    return name, pd.DataFrame(list(rows))


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
        tables,
        texts={"table.md": in_docs(claims, tables)},
    )
    return claims
