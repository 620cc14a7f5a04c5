"""strapdown beside the states that PX4's EKF2 publishes for its two replays.

The replays (test/replay_data of PX4/PX4-ECL, a simulated quadrotor of half a minute) are the samples that the
tests of EKF2 run on, and test/change_indication holds the states that it must find: ten times a second
attitude, velocity, position from the start, biases, the field and their variances. Here the closed loop runs on the same
samples with the noise that EKF2 assumes.

    STRAPDOWN_PEERS=folder python benchmarks/px4_replays.py      # a folder with a clone of PX4/PX4-ECL
"""

import csv
import os
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.geometry.geodesy import displacement

REPLAYS = ("iris_gps", "ekf_gsf_reset")
STEP = 0.01
"""s of a step of EKF2, on which its noises are."""
NOISE = sd.Noise(*(np.sqrt(STEP) * np.array([1.5e-2, 0.35, 1e-3, 3e-3])), 0.0, 0.0)
"""Defaults of EKF2 as densities: gyro rad/s, accelerometer m/s^2, walks of their biases."""
STD = {"position": (0.5, 0.5, 1.0), "velocity": (0.3, 0.3, 0.3), "magnetic-field": (5e-6,) * 3}
"""Defaults of EKF2: m, m/s, T."""
DATE = "2021-07-01"
SETTLED = 15.0
"""s after the start from which on both know their heading."""


def folder():
    """The tests of PX4-ECL, or None where STRAPDOWN_PEERS has no clone."""
    found = Path(os.environ.get("STRAPDOWN_PEERS", "")) / "PX4-ECL" / "test"
    return found if found.is_dir() else None


def samples(path):
    """{sensor: (n, 1 + values) with the time in s first} of a replay."""
    found = {}
    with open(path, newline="", encoding="utf-8") as file:
        for stamp, sensor, *values in csv.reader(file):
            found.setdefault(sensor, []).append([int(stamp) * 1e-6, *map(float, values)])
    return {sensor: np.array(rows) for sensor, rows in found.items()}


def recording(found):
    """The Recording of a replay: IMU, fixes of position and velocity, magnetometer."""
    imu, gps, mag = (found[sensor] for sensor in ("imu", "gps", "mag"))
    lla = np.c_[np.deg2rad(gps[:, [3, 2]] * 1e-7), gps[:, 1] * 1e-3]
    tesla = mag[:, 1:4] * 1e-4
    changed = np.r_[True, np.any(np.diff(tesla, axis=0) != 0, axis=1)]  # it repeats its readings
    source = lambda kind, t, y, **more: sd.Source(
        kind, t, y, np.tile(STD[kind], (len(t), 1)), **more
    )
    field = sd.geomagnetic_field(DATE, *lla[0])
    return sd.Recording.from_arrays(
        imu[:, 0],
        imu[:, 4:7],
        imu[:, 1:4],
        sources=[
            source("position", gps[:, 0], lla),
            source("velocity", gps[:, 0], gps[:, 4:7]),
            source(
                "magnetic-field", mag[changed, 0], tesla[changed], parameters=tuple(field.field)
            ),
        ],
        kind="rate",
        date=DATE,
    )


def published(path, last):
    """Rows of what EKF2 must find between SETTLED and the last sample: behind it, it falls freely."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = np.array([[float(x) for x in row] for row in list(csv.reader(file))[1:]])
    t = rows[:, 0] * 1e-6
    return rows[(t > SETTLED) & (t <= last)]


def _declinations(log, rows):
    """(n, 1) that of EKF2's estimated field less that of the model, deg."""
    (north, east, _) = next(a.parameters for a in log.sources if a.kind == "magnetic-field")
    theirs = np.arctan2(rows[:, 18], rows[:, 17])
    return np.rad2deg(theirs - np.arctan2(east, north))[:, None]


def compared(name):
    """{quantity: (unit, rms of the difference, claimed by strapdown, claimed by EKF2)} of one replay."""
    from scipy.spatial.transform import Rotation

    tests = folder()
    log = recording(samples(tests / "replay_data" / f"{name}.csv"))
    path = sd.fuse(log, "closed-loop", imu="consumer", noise=NOISE).trajectory
    rows = published(tests / "change_indication" / f"{name}.csv", path.t[-1])
    at = np.searchsorted(path.t, rows[:, 0] * 1e-6)
    rotation = Rotation.from_quat(rows[:, [2, 3, 4, 1]])
    turned = (rotation * path.rotation[at].inv()).as_rotvec(degrees=True)
    own = displacement(path.lla[at], path.lla[at[0]])
    size = lambda error: float(np.sqrt((error**2).sum(axis=1).mean()))
    claimed, theirs = path.std[at], np.sqrt(rows[:, 25:49])
    moved = (rows[:, 8:11] - rows[0, 8:11]) - own
    degrees = np.rad2deg(claimed[:, 6:9])
    return {
        "velocity": (
            "m/s",
            size(rows[:, 5:8] - path.v_n[at]),
            size(claimed[:, 3:6]),
            size(theirs[:, 4:7]),
        ),
        "change of position": ("m", size(moved), size(claimed[:, :3]), size(theirs[:, 7:10])),
        "roll and pitch": ("deg", size(turned[:, :2]), size(degrees[:, :2]), None),
        "heading": ("deg", size(turned[:, 2:]), size(degrees[:, 2:]), None),
        "declination of the field": ("deg", size(_declinations(log, rows)), None, None),
    }


if __name__ == "__main__":
    for name in REPLAYS:
        for quantity, figures in compared(name).items():
            print(name, quantity, *figures)
