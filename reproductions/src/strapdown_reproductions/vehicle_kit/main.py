"""The vehicle kit, measured: `strapdown reproduce vehicle-kit`."""

from pathlib import Path
from typing import Any

import pandas as pd

from strapdown.io import read
from strapdown.typing import File, Progress, Say

from ..common import markdown
from ..common.example_recordings import DESCRIPTIONS
from ..common.pages import write_page
from ..common.targets import claim
from .drives import drive
from .on_drive import outage_errors
from .rest import recorded, simulated
from .slips import detection, quiet, worth

SEEDS, FEW = range(1, 21), range(1, 4)
GRADES = ("consumer", "tactical", "navigation")
MEDIAN = 1.2  # m, in the outages of the README
INTRODUCTION = (
    "Rest, side slip, wheel slip and what they are worth, on simulated drives of the seeds 1 to 20 and "
    "on drive0708. Thresholds were chosen on other seeds, from 1000 on, and other windows.",
)


def reproduce(
    out: Path,
    quick: bool = False,
    recordings: File | None = None,
    say: Say | None = None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Measure the kit, write the page into the folder `out`, return the claims. `quick`: three seeds;
    progress: called with the fraction done. Raises DataError."""
    seeds = FEW if quick else SEEDS
    folder = Path(recordings) if recordings else DESCRIPTIONS

    def tell(text: str, done: float) -> None:
        if say:
            say(text)
        if progress:
            progress(done)

    tell("drive0708: outages", 0.0)
    each, drive0708 = outage_errors(folder)
    tell("rest", 0.25)
    rest = pd.concat(
        [
            *(simulated(seeds, grade) for grade in GRADES),
            simulated(seeds, GRADES[0], smooth=True),
            recorded(read(folder / "drive0708-kit.toml")),
        ]
    )
    tell("wheel slip", 0.5)
    drives = [drive(seed) for seed in seeds]
    rough = [drive(seed, roughness=3.0, engine=0.45) for seed in seeds]
    found, alarms = detection(drives, seeds), quiet(drives, rough)
    tell("what it is worth", 0.75)
    gain = worth(seeds)
    readme = drive0708.set_index(["windows", "set-up"]).loc[("README", "kit"), "median, m"]
    claims = [
        claim(
            "drive0708 with the vehicle kit: median of the largest horizontal error in the README's "
            "nine 15 s outages",
            readme,
            MEDIAN,
            "m",
        ),
        claim(
            "wheel slip: false alarms per hour of simulated driving",
            alarms.iloc[0]["per hour"],
            1.0,
            "per hour",
        ),
        claim(
            "odometer scale after 210 s, median error",
            gain.set_index("wheel speed").loc["with slip, tested", "error of the scale, %"],
            0.1,
            "%",
        ),
    ]
    tables = {
        "drive0708": ("drive0708: largest horizontal error in outages of 15 s", drive0708),
        "rest": ("Rest: what is missed, and what is taken for it", rest),
        "slip": ("Wheel slip, 0.5 to 5 s, above 3 m/s", found),
        "false-alarms": ("Wheel speed without slip that is left out", alarms),
        "worth": ("Simulated drives with GNSS outages of 30 s", gain),
    }
    headed = [(f"**{caption}**", table) for caption, table in tables.values()]
    texts = {"table.md": markdown.tables(headed, _cell)}
    page = tables | {"drive0708-outages": (None, each)}
    write_page(out, "The vehicle kit", INTRODUCTION, claims, page, texts=texts)
    return claims


def _cell(value: Any) -> str:
    if not isinstance(value, float):
        return str(value)
    return "–" if value != value else f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
