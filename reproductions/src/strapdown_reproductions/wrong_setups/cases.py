"""The recordings of the study, each with the set-up that is taken for right: simulated motions,
one recording per seed, and recorded ones.

The simulated receiver states its true noise and the filter knows the IMU's grade, so that a right
set-up is right in everything.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown import io
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.io.locate import data_folder
from strapdown.io.readers.broad import with_positions
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.typing import Array

from ..common.example_recordings import FLIGHT, in_motion
from ..common.motions import (
    HEIGHT,
    ODOMETER,
    ON_MAST,
    ON_WING,
    RECEIVER,
    StudyMotion,
    constraints,
    simulator,
)

SKIPPED = 0.2
"""Part of a recording at its beginning that is not scored: the filter settles."""
BETTER = {"consumer": "tactical", "industrial": "navigation"}
"""Two grades up."""
TRIALS = (
    "02_undisturbed_slow_rotation_B",
    "15_undisturbed_fast_translation_A",
    "21_undisturbed_fast_combined",
)
"""Trials of BROAD: the undisturbed ones of the data folder."""
SWISSLOG_LAG = 0.22
"""s by which the GNSS of swisslog comes late."""


class SetUpCase(NamedTuple):
    """A recording with its right set-up, and where it is scored."""

    name: str
    recording: Recording
    windows: tuple[tuple[float, float], ...]  # ((start, stop), ...) in s
    true: bool  # whether the reference is the truth; else the right set-up's solution stands for it
    better: str  # grade of an IMU two grades better


MOTIONS = {
    "car": StudyMotion("car", 240.0),
    "car with odometer": StudyMotion(
        "car", 240.0, imu="consumer", sensors=ODOMETER, constrained=True
    ),
    "flight": StudyMotion("demo", 280.0, ON_WING, sensors=HEIGHT),
    "ship": StudyMotion("ship", 520.0, ON_MAST),
    "hand-held": StudyMotion(
        "hand-held",
        200.0,
        RECEIVER._replace(lever_arm=(0.1, 0.0, -0.2)),
        "consumer",
        magnetometer=Magnetometer(rate=10.0, field=(21e-6, 1.6e-6, 43.9e-6)),
    ),
}
"""{name: what is simulated}."""
BEGINS = {"ship": 250.0}
"""s from which a recording is taken: from a straight leg through a turn."""


def simulate_case(name: str, seed: int) -> SetUpCase:
    """The SetUpCase of one of MOTIONS, with the errors of a seed."""
    return case_of(name, MOTIONS[name], seed, BEGINS.get(name))


def case_of(name: str, motion: StudyMotion, seed: int, begin: float | None = None) -> SetUpCase:
    """The SetUpCase of a motion from `begin` (s) on, with the errors of a seed."""
    recording = simulator(motion).recording(motion.imu, np.random.default_rng(seed))
    if begin is not None:
        recording = recording.between(begin)
    if motion.constrained:
        recording = replace(recording, sources=(*recording.sources, *constraints(recording)))
    return SetUpCase(name, recording, _settled_window(recording), True, BETTER[motion.imu])


def _settled_window(recording: Recording) -> tuple[tuple[float, float], ...]:
    start, stop = recording.span
    return ((start + SKIPPED * (stop - start), stop),)


def recorded_cases(folder: Path) -> dict[str, Callable[[], SetUpCase]]:
    """{name: maker of its Case} of the descriptions in `folder` and of the data folder."""
    data = data_folder(folder)

    def read_case(name: str, windows: tuple[tuple[float, float], ...] = ()) -> SetUpCase:
        recording = io.read(folder / f"{name}.toml")
        return SetUpCase(name, recording, windows or _settled_window(recording), False, "tactical")

    def trial(name: str) -> SetUpCase:
        recording = in_motion(
            with_positions(io.read(data / "broad" / f"{name}.npz"), rate=5.0, std=0.1)
        )
        windows = tuple(map(tuple, recording.meta["movement"]))
        return SetUpCase(f"BROAD {name[:2]}", recording, windows, True, "tactical")

    def swiss() -> SetUpCase:
        recording = swisslog(data / "swisslog")
        return SetUpCase("swisslog", recording, _settled_window(recording), False, "tactical")

    return {
        "thor75": lambda: read_case("thor75", (FLIGHT,)),
        "drive0708": lambda: read_case("drive0708"),
        "drive0708-vehicle": lambda: read_case("drive0708-vehicle"),
        "swisslog": swiss,
        **{f"BROAD {name[:2]}": lambda name=name: trial(name) for name in TRIALS},
    }


def swisslog(folder: Path) -> Recording:
    """The Recording of swisslog with its traps known: the course is in radians in spite of its
    column's name, and GNSS comes late by SWISSLOG_LAG.

    The log states no standard deviations. The receiver smooths its velocity, which is off by up to
    5 m/s in dives: 0.8 m/s and 1 m/s vertically are the scatter of the innovations.
    """
    imu, gps = (pd.read_csv(folder / f"{name}.csv.xz") for name in ("imu", "gps"))
    columns = lambda *names: gps[list(names)].to_numpy(float)
    t = gps["GPStime"].to_numpy(float) - SWISSLOG_LAG
    lla = columns("LatDeg", "LngDeg", "Hgt") * [np.pi / 180, np.pi / 180, 1.0]
    speed, course, down = columns("GndSpd", "CourseDeg", "VelD").T
    std = lambda *values: np.tile(np.array(values), (len(t), 1))
    return Recording.from_arrays(
        imu["IMUtime"],
        imu[[f"angRate{axis}" for axis in "XYZ"]],
        imu[[f"accel{axis}" for axis in "XYZ"]],
        (
            Source("position", t, lla, std(2.0, 2.0, 3.0), name="GNSS position"),
            Source(
                "velocity",
                t,
                heading_to(speed, course, down),
                std(0.8, 0.8, 1.0),
                name="GNSS velocity",
            ),
        ),
        name="swisslog",
        grade="consumer",
    )


def heading_to(speed: Array, course: Array, down: Array) -> Array:
    """(n, 3) velocity NED of a speed over ground and a course, rad."""
    return np.c_[speed * np.cos(course), speed * np.sin(course), down]
