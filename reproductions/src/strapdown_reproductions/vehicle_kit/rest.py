"""Rates at which the detector of rest misses a rest, and takes motion for one."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.io import read
from strapdown.preprocessing.vehicle_rest import vehicle_at_rest

from .drives import drive, wheel_of

STILL, MOVING, CREEPING = 0.02, 0.1, 1.5
"""m/s: below the first it stands, above the second it moves, below the third it creeps."""
SMOOTH = {"roughness": 0.1, "engine": 0.0}  # motion feels like rest there
NOISE = 0.05  # m/s: the least that an RTK velocity tells from rest
COLUMNS = (
    "drive",
    "judged by",
    "at rest, s",
    "missed, %",
    "in motion, s",
    "false, s per hour",
    "of them creeping, %",
)


def simulate_rates(seeds: Sequence[int], grade: str, smooth: bool = False) -> pd.DataFrame:
    """Rates on simulated drives of 300 s, by the IMU alone and with wheel speed; `smooth`: of an
    electric car on a very smooth road."""
    road = SMOOTH if smooth else {}
    drives = [drive(seed, 300.0, grade, **road) for seed in seeds]
    name = f"simulated, {grade}" + (", no engine, smooth road" if smooth else "")
    rows = [
        (name, "IMU", *_rates(drives, [()] * len(drives), STILL)),
        (name, "IMU, wheels", *_rates(drives, [(wheel_of(r),) for r in drives], STILL)),
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def recorded_rates(folder: Path) -> pd.DataFrame:
    """Rates on the recorded drive, against the speed of its reference."""
    recording = read(folder / "drive0708-kit.toml")
    velocity = tuple(a for a in recording.sources if a.kind == "velocity")
    rows = [
        ("drive0708", judged, *_rates([recording], [sources], NOISE))
        for judged, sources in (("IMU", ()), ("IMU, GNSS", velocity))
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _rates(
    drives: Iterable[Recording], sources: Iterable[Iterable[Source]], still: float
) -> tuple[float, float, float, float, float]:
    """(s at rest, % of it missed, s in motion, s of false rest per hour of it, % of them creeping)."""
    rest = missed = motion = false = creeping = 0.0
    for recording, beside in zip(drives, sources):
        imu, truth = recording.imu, recording.reference
        speed = np.interp(imu.t, truth.t, np.linalg.norm(truth.v_n, axis=1))
        found, stands, moves = vehicle_at_rest(imu, beside), speed < still, speed > MOVING
        rest += imu.dt[stands].sum()
        missed += imu.dt[stands & ~found].sum()
        motion += imu.dt[moves].sum()
        false += imu.dt[moves & found].sum()
        creeping += imu.dt[moves & found & (speed < CREEPING)].sum()
    share = 100 * creeping / false if false else np.nan
    return rest, 100 * missed / rest, motion, 3600 * false / motion, share
