"""The vehicle kit, measured: `strapdown reproduce vehicle-kit`."""

from pathlib import Path
from typing import Any

from ..common import markdown
from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import StudyTables, Task, collect_tables, part_of
from ..common.study import Claims, ReproducedStudy
from ..common.tables import Tables
from ..common.targets import claim
from . import on_drive, rest, slips
from .slips import ALARMS, SCALES, SLIP, WORTH

SEEDS, FEW = range(1, 21), range(1, 4)
GRADES = ("consumer", "tactical", "navigation")
OUTAGES, REST = "drive0708-outages", "rest"
"""Tables of the Evidence, beside those of `slips`."""
MEDIAN = 1.2  # m, in the published outages
INTRODUCTION = (
    "Rest, side slip, wheel slip and what they are worth, on simulated drives of the seeds 1 to 20 and "
    "on drive0708. Thresholds were chosen on other seeds, from 1000 on, and other windows.",
)


@reproduction("quick", "recordings", "notify", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Measure the kit, write the page into the folder `out`, return the claims; quick: three seeds
    in place of 20. Raises DataError."""
    wanted = stages(Path(asked.recordings or DESCRIPTIONS), FEW if asked.quick else SEEDS)
    found = StudyTables()
    for place, (name, tasks) in enumerate(wanted.items()):
        if asked.notify:
            asked.notify(name)
        part = part_of(asked.progress, place / len(wanted), (place + 1) / len(wanted))
        found |= collect_tables(tasks, progress=part)
    return STUDY.write(out, found)


def stages(folder: Path, seeds: range) -> dict[str, list[Task]]:
    """{what is measured: tasks}."""
    return {
        "drive0708: outages": [Task(OUTAGES, on_drive.outage_errors, (folder,))],
        "rest": [
            *(Task(REST, rest.simulate_rates, (seeds, grade)) for grade in GRADES),
            Task(REST, rest.simulate_rates, (seeds, GRADES[0], True)),
            Task(REST, rest.recorded_rates, (folder,)),
        ],
        "wheel slip": [Task("", slips.rates, (seeds,))],
        "what it is worth": [Task("", slips.measure_worth, (seed,)) for seed in seeds],
    }


def claims(found: StudyTables) -> list[dict[str, Any]]:
    """The claims on the drive, on false alarms and on the scale."""
    medians = on_drive.summary(found[OUTAGES]).set_index(["windows", "set-up"])["median, m"]
    gain = slips.medians(found[SCALES], found[WORTH]).set_index("wheel speed")
    return [
        claim(
            "drive0708 with the vehicle kit: median of the largest horizontal error in the published "
            "nine 15 s outages",
            medians["evidence", "kit"],
            MEDIAN,
            "m",
        ),
        claim(
            "wheel slip: false alarms per hour of simulated driving",
            found[ALARMS].iloc[0]["per hour"],
            1.0,
            "per hour",
        ),
        claim(
            "odometer scale after 210 s, median error",
            gain.loc["with slip, tested", "error of the scale, %"],
            0.1,
            "%",
        ),
    ]


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    return {
        "drive0708": (
            "drive0708: largest horizontal error in outages of 15 s",
            on_drive.summary(found[OUTAGES]),
        ),
        REST: ("Rest: what is missed, and what is taken for it", found[REST]),
        SLIP: ("Wheel slip, 0.5 to 5 s, above 3 m/s", found[SLIP]),
        ALARMS: ("Wheel speed without slip that is left out", found[ALARMS]),
        WORTH: (
            "Simulated drives with GNSS outages of 30 s",
            slips.medians(found[SCALES], found[WORTH]),
        ),
    }


def texts(found: StudyTables, claims: Claims, tables: Tables) -> dict[str, str]:
    """{name: text} of the tables, for docs/how-to/vehicle.md."""
    headed = [(f"**{caption}**", table) for caption, table in tables.values()]
    return {"table.md": markdown.tables(headed, _cell)}


def _cell(value: Any) -> str:
    if not isinstance(value, float):
        return str(value)
    return "–" if value != value else f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


STUDY = ReproducedStudy("The vehicle kit", INTRODUCTION, claims, tables, (OUTAGES,), texts)
