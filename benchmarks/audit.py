"""Public data sets as their authors describe them, and what `strapdown inspect` finds in them.

    python benchmarks/audit.py        # the table of docs/reference/evidence/audit.md

Each entry builds a recording from the files with the units, axes, clocks and standard deviations that the
authors state, and runs the checks of `strapdown inspect` and, where it names one, a whole fusion over it. What
the checks say is the table; nothing is added by hand.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from ranking_cases import WALK

import strapdown as sd
from strapdown.inspection.all import check
from strapdown.io.description.logs import join, open_logs
from strapdown.io.locate import data_folder
from strapdown_reproductions.common import markdown
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/reference/evidence/audit.md"
MARK = "<!-- begin: table of python benchmarks/audit.py -->"
BUILD = ROOT / "build" / "audit"


class Entry(NamedTuple):
    """A data set with one statement of its description."""

    data: str
    source: str  # where it comes from, and its licence
    states: str  # what its authors say
    read: Callable[[], sd.Recording]


def _swisslog(course):
    """SwissLog1 with its course column read by `course`."""
    folder = data_folder(DESCRIPTIONS) / "swisslog"
    imu, gps = (pd.read_csv(folder / f"{name}.csv.xz").to_numpy(float) for name in ("imu", "gps"))
    t, speed, angle = gps[:, 0], gps[:, 4], course(gps[:, 5])
    v = np.c_[speed * np.cos(angle), speed * np.sin(angle), gps[:, 6]]
    lla = np.c_[np.radians(gps[:, 1:3]), gps[:, 3]]
    std = np.full((len(t), 3), 1.0)
    sources = sd.Source("position", t, lla, 2 * std), sd.Source("velocity", t, v, std)
    return sd.Recording.from_arrays(imu[:, 0], imu[:, 1:4], imu[:, 4:7], sources)


def _walk():
    """walk0827 with the standard deviations of its .pos file, float like fixed."""
    own = data_folder(DESCRIPTIONS) / "walk0827"
    text = join(open_logs([own / "gnss_1730_sf.pos.xz"])).text(BUILD).partition("\n\n")[2]
    stated = [line for line in text.splitlines() if not line.startswith("correlated")]
    return _described("walk0827", WALK.format(own / "imu_1730_sf.csv.xz") + "\n".join(stated))


def _described(name, text):
    BUILD.mkdir(parents=True, exist_ok=True)
    path = BUILD / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return sd.read(path)


def _changed(name, *pairs):
    """An example of this project with the authors' statements in place of what it found."""
    text = (DESCRIPTIONS / f"{name}.toml").read_text(encoding="utf-8")
    for own, theirs in pairs:
        if own not in text:
            raise ValueError(f"{name}.toml does not hold {own!r}")
        text = text.replace(own, theirs)
    text = text.replace('grade = "', f'grade = "{DESCRIPTIONS}/')
    return _described(name, text.replace('calibration = "', f'calibration = "{DESCRIPTIONS}/'))


def _drive():
    """drive0708 with its authors' clock: the IMU 0.125 s late, the velocity on time."""
    return _changed(
        "drive0708",
        ("offset = -0.20", "offset = -0.125"),
        (', offset = -0.125 }\ncolumns = ["ve"', ' }\ncolumns = ["ve"'),
    )


def _magnetometer():
    """thor75 with a magnetometer in the body's axes, as the rest of the file."""
    return _changed(
        "thor75-full",
        ('axes = "+x -y -z"\ncalibration = "thor75-magnetometer.toml"', 'axes = "FRD"'),
    )


ENTRIES = (
    Entry(
        "SwissLog1",
        "priseborough/InertialNav, BSD-3",
        "the column CourseDeg",
        lambda: _swisslog(np.radians),
    ),
    Entry(
        "SwissLog1",
        "priseborough/InertialNav, BSD-3",
        "GPS and IMU on one clock",
        lambda: _swisslog(lambda angle: angle),
    ),
    Entry(
        "drive_0708",
        "rtklibexplorer/GNSS_IMU, BSD-3",
        "0.125 s to be added to the IMU's clock, velocity and position of one time",
        _drive,
    ),
    Entry(
        "walk_0827",
        "rtklibexplorer/GNSS_IMU, BSD-3",
        "standard deviations of 0.01 m, fixed and float",
        _walk,
    ),
    Entry(
        "Thor flight 75", "UMN insgnss_tools, MIT", "magnetometer in the body's axes", _magnetometer
    ),
    Entry(
        "Thor flight 75",
        "UMN insgnss_tools, MIT",
        "indicated airspeed in m/s",
        lambda: _changed("thor75-air"),
    ),
)


def rows():
    """Lines of the table: one for each reason that the checks give."""
    for entry in ENTRIES:
        reasons = check(entry.read()).reasons
        for reason in reasons:
            yield entry.data, entry.source, entry.states, reason.cause, reason.seen
        if not reasons:
            yield entry.data, entry.source, entry.states, "–", "nothing against it"


HEAD = ("data set", "source, licence", "its description says", "cause", "found")


def main():
    """Write the table."""
    lines = [HEAD, ["---"] * len(HEAD), *rows()]
    text = "\n".join("| " + " | ".join(map(markdown.cell, line)) + " |" for line in lines) + "\n"
    markdown.insert(PAGE, text, MARK)
    print(text)


if __name__ == "__main__":
    main()
