"""When the geometry of a filter pays: `strapdown reproduce geometry`.

Starts far off, a vehicle at rest, the flights of Hager & Bryne and the cells of the table of consistency,
with filters on the group of extended poses beside the others. Their outages are a part of `strapdown
reproduce recordings`.
"""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..common.gnss_alone import GRADES, SCENARIOS
from ..common.reproduction import Asked, reproduction
from ..common.runner import StudyTables, Task, collect_tables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables
from ..common.targets import Target, in_docs
from .runs import KNOWN, RESTING, at_rest, cell, far_off, flights
from .worlds import FILTERS, NO_GATE, SETTINGS, SIDES, UNGATED

SEEDS, QUICK_SEEDS = 2, 1
REST_RUNS, QUICK_REST_RUNS = 30, 3
FLIGHTS = tuple(f"paper1-{number:02d}" for number in range(1, 12))
QUICK_FLIGHTS = ("paper1-02",)
FLIGHT_RUNS, QUICK_FLIGHT_RUNS = 10, 2
CELL_RUNS, QUICK_CELL_RUNS = 60, 4
QUICK_CELLS = (("hand-held", "consumer"),)
REFUSED = (("straight", "consumer"), ("car", "consumer"), ("hand-held", "consumer"))
"""Cells in which the table of consistency refuses the closed loop."""
RESTED = ("consumer", "industrial", "tactical")
LABELS = (*FILTERS, *(label + NO_GATE for label in UNGATED))
STARTS, REST, FLOWN, CELLS = "starts", "rest", "flights", "cells"
"""Tables of the StudyTables."""
HOME = 2.0
"""deg below which a start has come home."""
INTRODUCTION = (
    f"Starts far off: 27 starts a seed, the heading off by 60, 120 and 170 deg, the tilt by 0, 30 and 60 "
    f"deg, to {SIDES} random sides each, with standard deviations as large; the flight weaves with turns of "
    "130 and 150 deg, the road has corners to both sides. A start has come home if the attitude is right "
    f"to {HOME:g} deg for the last ten seconds.",
    f"At rest: {RESTING:g} s, the heading known to {KNOWN:g} deg at the start and the truth drawn from that. "
    "The claim is honest if the rms error of the heading is about the rms claim.",
    "Flights: those of Hager & Bryne with their consumer IMU; ANEES and errors are medians of runs.",
    "Cells: the scenarios of the table of consistency, with GNSS alone. Both filters have the same random "
    "numbers; ANEES are means over the runs that both survive, and `std` is the standard error of their ratio.",
)
TARGETS = {
    "home": Target(
        f"of 27 starts far off, below {HOME:g} deg at the end, `iekf`", ">=", 25, "starts"
    ),
    "beside": Target("of 27, more than the closed loop", ">=", 0, "starts"),
    "flights": Target("largest ANEES of `iekf` over that of the closed loop, flights", "<=", 1.02),
    "refused": Target("the same in cells that refuse the closed loop, at most", "<=", 1.0),
    "cells": Target("the same in all cells, less two standard errors", "<=", 1.02),
}


def home(starts: pd.DataFrame) -> pd.DataFrame:
    """A row per setting, a column per filter: of 27 starts so many come home, mean of the seeds."""
    own = starts.assign(home=starts["end_deg"] < HOME, setting=_settings(starts))
    of_seed = own.groupby(["setting", "filter", "seed"], sort=False)["home"].mean() * 27
    wide = of_seed.groupby(["setting", "filter"], sort=False).mean().unstack("filter")
    return wide[[label for label in LABELS if label in wide]].reset_index()


def _settings(rows: pd.DataFrame) -> pd.Series:
    return rows["motion"] + ", " + rows["grade"] + rows["duration"].map(", {:g} s".format)


def wrong_and_sure(starts: pd.DataFrame) -> pd.DataFrame:
    """A row per filter: starts that do not come home, and those of them that claim to be right to a fifth of
    their error."""
    own = starts.assign(lost=starts["end_deg"] >= HOME)
    own["sure"] = own["lost"] & (own["claims"] > 5)
    groups = own.groupby("filter", sort=False)
    table = groups.agg(starts=("lost", "size"), lost=("lost", "sum"), sure=("sure", "sum"))
    return table.rename(columns={"sure": "lost and five times beyond the claim"}).reset_index()


def rest(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per grade and filter: rms error and rms claim of the heading."""
    rms = lambda values: float(np.sqrt(np.mean(np.square(values))))
    table = rows.groupby(["grade", "filter"], sort=False).agg(
        runs=("seed", "size"), error=("error_deg", rms), claim=("claim_deg", rms)
    )
    table["error over claim"] = table["error"] / table["claim"]
    names = {"error": "rms error, deg", "claim": "rms claim, deg"}
    return table.rename(columns=names).reset_index()


def figures(found: StudyTables) -> dict[str, float]:
    """The figures of TARGETS."""
    counts, flown = home(found[STARTS]), found[FLOWN].set_index(["flight", "filter"])["anees"]
    ratio = flown.xs("iekf", level=1) / flown.xs("closed-loop", level=1)
    cells = found[CELLS].set_index(["scenario", "grade"])
    refused = cells.index.isin(REFUSED)
    return {
        "home": float(counts["iekf"].min()),
        "beside": float((counts["iekf"] - counts["closed-loop"]).min()),
        "flights": float(ratio.max()),
        "refused": float(cells.loc[refused, "ratio"].max()),
        "cells": float((cells["ratio"] - 2 * cells["std"]).max()),
    }


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    return {
        "home": ("Starts far off: so many of 27 come home", home(found[STARTS])),
        "sure": ("Starts that do not come home, all settings", wrong_and_sure(found[STARTS])),
        "rest": ("Heading after ten minutes at rest", rest(found[REST])),
        "flights": ("Flights of Hager & Bryne, consumer IMU", found[FLOWN]),
        "cells": ("Scenarios with GNSS alone", found[CELLS]),
    }


STUDY = ReproducedStudy(
    "When the geometry of a filter pays",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(STARTS, REST),
    texts=lambda found, claims, tables: {"table.md": in_docs(claims, tables)},
)


@reproduction("quick", "seed", "workers", "progress", usual=Asked(seed=600))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims; quick: one setting, three
    runs at rest, one flight. Raises DataError."""
    first, quick = asked.seed, asked.quick
    seeds = range(first, first + (QUICK_SEEDS if quick else SEEDS))
    settings = SETTINGS[2:3] if quick else SETTINGS
    resting = range(first, first + (QUICK_REST_RUNS if quick else REST_RUNS))
    wanted = [Task(STARTS, far_off, (setting, s)) for setting in settings for s in seeds]
    wanted += [Task(REST, at_rest, (g, s)) for g in RESTED for s in resting]
    runs = QUICK_FLIGHT_RUNS if quick else FLIGHT_RUNS
    flown = QUICK_FLIGHTS if quick else FLIGHTS
    wanted += [Task(FLOWN, flights, (name, runs, first)) for name in flown]
    in_cells = QUICK_CELLS if quick else tuple(product(SCENARIOS, GRADES))
    runs = QUICK_CELL_RUNS if quick else CELL_RUNS
    wanted += [Task(CELLS, cell, (*names, runs, first)) for names in in_cells]
    return STUDY.write(out, collect_tables(wanted, asked.workers, asked.progress))
