"""Sensor faults, one at a time: `strapdown reproduce faults`.

Each fault is made with simulated recordings; every filter that it concerns runs over them in batch,
some smoothed and live too, and what each says is held against how wrong it is.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pandas as pd

from strapdown import filters
from strapdown.checks import DataError, check_choice, check_number
from strapdown.typing import File, Progress

from ..common import markdown
from ..common.pages import write_page
from . import jumps, summary
from .cells import Task, cells
from .runs import SLOW, SLOW_SEEDS, Subject, family, subjects
from .worlds import GENTLE, MOTIONS

SEEDS, QUICK_SEEDS = 5, 1
QUICK = ("closed-loop", "closed-loop live", "closed-loop smoothed")
"""What runs in the reduced form, in the gentle motion alone."""
TRIALS, QUICK_TRIALS = 200, 4
"""Flights of `jumps` for each seed of the table."""


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 1,
    workers: int = 0,
    filter: Sequence[str] = (),
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run every cell and the jumps, write the page into the folder `out`, return the claims.

    quick: one seed, the gentle motion, few filters and jumps; runs: number of seeds; seed: the first
    of them; workers: processes, the processors by default; filter: what runs, as in the table
    ("closed-loop", "closed-loop live", ..., default: all); progress: called with the fraction done. Raises
    DataError.
    """
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    matrix = tasks(chosen(filter or (QUICK if quick else ())), seed, count, quick)
    if not matrix:
        raise DataError(
            f"{', '.join(filter)}: runs in no motion of the reduced form; leave out --quick"
        )
    flights = range(seed, seed + count * (QUICK_TRIALS if quick else TRIALS))
    rows: list[dict[str, Any]] = []
    trials: list[dict[str, Any]] = []
    total, done = len(matrix) + len(flights), 0
    with ProcessPoolExecutor(workers or os.cpu_count(), get_context("spawn")) as pool:
        for into, made in (
            (rows, pool.map(cells, matrix)),
            (trials, pool.map(jumps.trial, flights, chunksize=4)),
        ):
            for found in made:
                into.extend(found)
                done += 1
                if progress:
                    progress(done / total)
    return write(Path(out), pd.DataFrame(rows), pd.DataFrame(trials, columns=jumps.COLUMNS))


def chosen(names: Sequence[str]) -> list[Subject]:
    """The subjects of these names, without any all. Raises DataError."""
    known = {one.name: one for one in subjects()}
    for name in names:
        check_choice(name, "what runs", tuple(known))
    return [one for name, one in known.items() if not names or name in names]


def tasks(subjects: Sequence[Subject], seed: int, count: int, quick: bool = False) -> list[Task]:
    """Every motion that suits a filter, with `count` seeds from `seed` on; the slow ones with fewer."""
    return [
        Task(motion, subject, s)
        for s in range(seed, seed + count)
        for subject in subjects
        if subject.filter not in SLOW or s < seed + SLOW_SEEDS
        for motion, world in MOTIONS.items()
        if family(filters.find(subject.filter)) in world.families
        and (not quick or motion == GENTLE)
    ]


def write(out: Path, rows: pd.DataFrame, trials: pd.DataFrame) -> list[dict[str, Any]]:
    """Write page and tables of finished cells and trials into the folder `out`; return the
    claims."""
    claims = summary.claims(rows, trials)
    tables = summary.tables(rows, trials)
    write_page(
        out,
        summary.TITLE,
        summary.INTRODUCTION,
        claims,
        {"cells": (None, rows), "trials": (None, trials), **tables},
        texts={
            "table.md": summary.in_docs(claims, tables),
            "each.md": markdown.tables([("### Each fault", tables["by-fault"][1])]),
        },
    )
    return claims
