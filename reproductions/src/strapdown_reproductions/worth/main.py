"""Worth of a sensor in a GNSS outage: `strapdown reproduce worth`."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..common.reproduction import Asked, reproduction
from ..common.runner import ENOUGH, StudyTables, Task, collect_tables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables
from ..common.targets import Target
from . import own_states, sensors
from .sensors import MOTIONS, NONE

SEEDS, QUICK_SEEDS = 40, 2
MORE = 1.5
"""So many times the seeds for the states of sensors: 60 runs decide a band of NEES."""
RUNS, STATES = "runs", "states"
"""Tables of the outages, and of NEES."""
INTRODUCTION = (
    "A car, a flight and a ship with GNSS and one more sensor, closed loop, industrial IMU, own "
    "alignment. GNSS is lost for 30 s and for 120 s. The table has the largest horizontal error in the "
    "outage, the median of the seeds, and the same over that without the sensor.",
    "Sensors have the noise that they state. The magnetometer is not calibrated: its hard iron is a "
    "state. The wind is 5 m/s, and the filter estimates it.",
    "The last table has sensors with states of their own without an outage, from a known start, each "
    "state drawn from the filter's prior: the share of epochs whose NEES averaged over the runs lies "
    "in its 95 % band.",
)
TARGETS = {
    "worst": Target(
        "a right sensor: error of the median run over that without it, the worst", "<=", 1.1, "x"
    ),
    "consistent": Target(
        "all states, those of the sensors included: epochs with NEES in its band, the worst motion",
        ">=",
        90.0,
        "%",
    ),
}


@reproduction("quick", "runs", "seed", "workers", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write the page into the folder `out`, return the claims; quick: two seeds.
    Raises DataError."""
    seeds = asked.seeds_from(SEEDS, QUICK_SEEDS)
    more = range(seeds.start, seeds.start + round(MORE * len(seeds)))
    tasks = [
        *(Task(RUNS, sensors.rows, (name, (k,))) for name in MOTIONS for k in seeds),
        *(Task(STATES, own_states.rows, (name, (k,))) for name in own_states.MOTIONS for k in more),
    ]
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def worth_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per motion and sensor: median error in each outage, m, and over that without it."""
    medians = rows.pivot_table(
        "error", ["motion", "sensor"], "outage", aggfunc="median", sort=False
    )
    without = medians.xs(NONE, level="sensor").reindex(medians.index.get_level_values("motion"))
    ratios = medians / without.to_numpy()
    table = pd.DataFrame(
        {
            "runs": rows.groupby(["motion", "sensor"], sort=False)["seed"].nunique(),
            **{f"{seconds:.0f} s, m": medians[seconds] for seconds in medians},
            **{f"{seconds:.0f} s, over none": ratios[seconds] for seconds in medians},
        }
    )
    return table.reset_index()


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}."""
    table = worth_table(found[RUNS])
    ratios = table.loc[table["sensor"] != NONE].filter(like="over none")
    nees = own_states.nees_table(found[STATES])
    of_all = nees.loc[(nees["states"] == own_states.OF_ALL) & (nees["runs"] >= ENOUGH), "in_band_%"]
    return {"worst": float(np.nanmax(ratios.to_numpy())), "consistent": float(of_all.min())}


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    return {
        "worth": ("Largest horizontal error in an outage", worth_table(found[RUNS])),
        "states": ("NEES of the states of sensors", own_states.nees_table(found[STATES])),
    }


STUDY = ReproducedStudy(
    "What a sensor is worth in an outage", INTRODUCTION, held_against(TARGETS, figures), tables
)
