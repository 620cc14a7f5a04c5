"""Consistency of the filters at every grade: `strapdown reproduce consistency`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from strapdown.checks import check_choice

from ..common.gnss_alone import GRADES, SCENARIOS
from ..common.reproduction import Asked, reproduction
from ..common.runner import StudyTables, campaigns, on_threads, part_of
from . import runs
from .summary import PICTURE, STUDY, size
from .twin import SETS, right
from .worlds import FILTERS, check_filter, is_fed

RUNS, QUICK_RUNS = 60, 10
QUICK_FILTERS, QUICK_SCENARIOS = ("closed-loop",), ("straight", "hand-held")
OF_RUNS = 0.9
"""Part of the time that the runs take; the rest are the twins."""


@reproduction(
    "quick", "runs", "seed", "workers", "filter", "scenario", "progress", usual=Asked(seed=0)
)
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run every cell, write the page into the folder `out`, return the claims.

    What the folder has of the same runs is not run again, so that the table can be made in parts.
    quick: the closed loop in two scenarios, few runs; workers: processes of a Dask cluster here, else
    a thread per processor; filter: labels as of a study (default: FILTERS); scenario: names (default:
    SCENARIOS). Raises DataError.
    """
    count = asked.count(RUNS, QUICK_RUNS, least=2)
    labels = tuple(asked.filter) or (QUICK_FILTERS if asked.quick else FILTERS)
    names = tuple(asked.scenario) or (QUICK_SCENARIOS if asked.quick else SCENARIOS)
    for label in labels:
        check_filter(label)
    for name in names:
        check_choice(name, "scenario", SCENARIOS)
    rows = table(out, labels, names, count, asked)
    links = [("every cell in one figure", PICTURE)]
    return STUDY.write(out, StudyTables(cells=rows), [size(rows)], links=links)


def table(
    out: Path,
    labels: Sequence[str],
    names: Sequence[str],
    count: int,
    asked: Asked,
) -> pd.DataFrame:
    """A row per cell."""
    cells = runs.cells(labels, names, GRADES)
    studies = {cell: runs.study(cell, count, asked.seed) for cell in cells}
    found = campaigns(
        studies,
        lambda cell: runs.folder(out, cell),
        part_of(asked.progress, 0.0, OF_RUNS),
        workers=asked.workers,
    )
    worlds = dict.fromkeys((cell.scenario, cell.grade, is_fed(cell.filter)) for cell in cells)
    twins = dict(
        zip(
            worlds,
            on_threads(
                lambda world: right(*world, count, SETS),
                list(worlds),
                progress=part_of(asked.progress, OF_RUNS, 1.0),
            ),
        )
    )
    return pd.DataFrame(
        [
            runs.row(campaign, cell, twins[cell.scenario, cell.grade, is_fed(cell.filter)])
            for cell, campaign in found.items()
        ]
    )
