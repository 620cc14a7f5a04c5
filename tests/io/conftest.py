"""A small recording on disk that tests bend in one place at a time: 20 s of IMU at 100 Hz, fixes
at 1 Hz, a description."""

import numpy as np
import pandas as pd
import pytest

TOML = """date = "2024-05-01"

[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
kind = "rate"
axes = "FRD"
gyro = { columns = ["gx", "gy", "gz"], unit = "deg/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }

[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = ["std", "std", "std"]

[[source]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1
"""


def imu_frame(n=2000, dt=0.01):
    """A body nearly at rest with noise of a MEMS IMU and a turn-on bias: t in s, rates in deg/s,
    specific force in m/s^2."""
    rng = np.random.default_rng(5)
    gyro = rng.normal(0, 0.1, (n, 3)) + [1.0, -0.6, 0.4]
    accel = rng.normal(0, 0.05, (n, 3)) + [0.1, -0.2, -9.8]
    return pd.DataFrame(
        np.c_[10 + dt * np.arange(1, n + 1), gyro, accel].round(6),
        columns=["t", "gx", "gy", "gz", "ax", "ay", "az"],
    )


def gnss_frame(n=20):
    """Fixes of a point that drifts north."""
    k = np.arange(n)
    return pd.DataFrame(
        {
            "t": 10.5 + k,
            "lat": 45 + 1e-6 * k,
            "lon": 7.0 - 1e-6 * k,
            "alt": 250.0 + 0.1 * k,
            "vn": 0.11,
            "ve": -0.08,
            "vd": -0.1,
            "std": 1.5,
        }
    )


@pytest.fixture
def build(tmp_path):
    """Function (imu=change, gnss=change, toml=change) -> path of recording.toml; each change
    takes and returns a frame or the text."""

    def build(imu=None, gnss=None, toml=None):
        for name, frame, change in (("imu", imu_frame(), imu), ("gnss", gnss_frame(), gnss)):
            frame = change(frame) if change else frame
            frame.to_csv(tmp_path / f"{name}.csv", index=False)
        path = tmp_path / "recording.toml"
        path.write_text(toml(TOML) if toml else TOML, encoding="utf-8")
        return path

    return build
