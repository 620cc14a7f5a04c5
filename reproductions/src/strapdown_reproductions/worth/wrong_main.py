"""Sensors beside GNSS with a mistake: `strapdown reproduce wrong-sensors`."""

from pathlib import Path
from typing import Any

import pandas as pd

from ..common.reproduction import Asked, reproduction
from ..common.runner import StudyTables, Task, collect_tables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables
from ..common.targets import Target
from . import wrong_sensors
from .sensors import WITH_DIVE
from .wrong_sensors import RIGHT

SEEDS, QUICK_SEEDS = 3, 1
RUNS = "runs"
"""The table of the runs."""
ALLOWED = 1.5
"""Error over that without the sensor."""
INTRODUCTION = (
    "A car, a flight, a ship and an underwater vehicle with GNSS and one more sensor, closed loop, "
    "industrial IMU, own alignment. The sensor has one mistake: it is said if `inspect` reports a "
    "problem or the verdict is not `trusted`, and named if a reason against this sensor has the true "
    "cause. Errors are over those of the same run without the sensor: with GNSS the rms of position, "
    "velocity and heading after the first fifth, the worst of the three; and the largest horizontal "
    "error in 30 s without GNSS, which begin after 170 to 400 s. shown_std: standard deviations by which the "
    "mistake shifts the innovations of all fixes together, the most that any test of them could see.",
)
TARGETS = {
    "right": Target("right sensors: not trusted", "<=", 0.0, "%"),
    "said": Target("mistakes: said", ">=", 100.0, "%"),
    "named": Target("of them: the true cause is named", ">=", 100.0, "%"),
    "with GNSS": Target(
        "errors with GNSS at most 1.5 times those without the sensor", ">=", 100.0, "%"
    ),
    "in the outage": Target("the same in 30 s without GNSS", ">=", 100.0, "%"),
}


@reproduction("quick", "runs", "seed", "workers", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims; quick: one seed.
    Raises DataError."""
    seeds = asked.seeds_from(SEEDS, QUICK_SEEDS)
    tasks = [Task(RUNS, wrong_sensors.rows, (name, (k,))) for name in WITH_DIVE for k in seeds]
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def mistakes_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per motion, sensor and mistake: in how many runs it is said and named, and medians of what the
    innovations show of it and of the errors over those without the sensor."""
    groups = rows.groupby(["motion", "sensor", "mistake"], sort=False)
    return groups.agg(
        runs=("seed", "nunique"),
        said=("said", "sum"),
        named=("named", "sum"),
        shown_std=("shown", "median"),
        with_gnss=("worse", "median"),
        in_outage=("worse_in_outage", "median"),
    ).reset_index()


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}, %."""
    table = mistakes_table(found[RUNS])
    right, wrong = table[table["mistake"] == RIGHT], table[table["mistake"] != RIGHT]
    runs, said = wrong["runs"].sum(), wrong["said"].sum()
    # a run that is refused has no error
    below = lambda column: 100.0 * float((wrong[column].dropna() <= ALLOWED).mean())
    return {
        "right": 100.0 * float(right["said"].sum() / right["runs"].sum()),
        "said": 100.0 * float(said / runs),
        "named": 100.0 * float(wrong["named"].sum() / max(said, 1)),
        "with GNSS": below("with_gnss"),
        "in the outage": below("in_outage"),
    }


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    return {"mistakes": ("Mistakes of sensors beside GNSS", mistakes_table(found[RUNS]))}


STUDY = ReproducedStudy(
    "Wrong sensors beside GNSS: which are said, and what becomes of the solution",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(RUNS,),
)
