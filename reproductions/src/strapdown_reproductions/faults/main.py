"""Sensor faults, one at a time: `strapdown reproduce faults`.

Each fault is made with simulated recordings; every filter that it concerns runs over them in batch,
some smoothed and live too, and what each says is held against how wrong it is.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from strapdown import filters
from strapdown.checks import check_number
from strapdown.typing import File, Progress

from ..common.pages import write_page
from . import jumps, summary
from .cells import Task, cells
from .runs import BATCH, SLOW, SLOW_SEEDS, family, subjects
from .worlds import GENTLE, MOTIONS

SEEDS, QUICK_SEEDS = 5, 1
QUICK = ("closed-loop", "open-loop", "mekf", "nlo", "attitude-mekf", "closed-loop live")
"""Filters of the reduced form."""

Job = TypeVar("Job")
Made = TypeVar("Made")


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 1,
    workers: int = 0,
    names: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run every cell and the jumps, write the page into the folder `out`, return the claims.

    quick: one seed of the gentle motion, few filters, few jumps; runs: number of seeds; seed: the
    first of them; workers: processes, the processors by default; names: of the filters, as in the
    table ("closed-loop", "closed-loop live", ...); progress: called with the fraction done. Raises
    DataError.
    """
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    matrix = tasks(QUICK if quick and names is None else names, seed, count, quick)
    series = jumps.tasks(count if not quick else 0, seed)
    rows: list[dict[str, Any]] = []
    trials: list[dict[str, Any]] = []
    total = len(matrix) + len(series)
    with pooled(workers) as run:
        for done, found in enumerate(run(cells, matrix), 1):
            rows.extend(found)
            if progress:
                progress(done / total)
        for done, trial in enumerate(run(jumps.trial, series), len(matrix) + 1):
            trials.append(trial)
            if progress:
                progress(done / total)
    return write(Path(out), pd.DataFrame(rows), pd.DataFrame(trials, columns=jumps.COLUMNS))
