"""A simulated nine-axis log as tables and its recording.toml, which tests bend."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from strapdown.sensor_models.geomagnetism import geomagnetic_field

PLACE = (np.radians(47.0), np.radians(8.0), 500.0)
EARTH = geomagnetic_field("2024-05-01", *PLACE)
COLUMNS = ["mx", "my", "mz"]
TOML = """date = "2024-05-01"
place = { latitude = 47.0, longitude = 8.0, height = 500.0, unit = "deg" }

[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }

[[source]]
kind = "magnetic-field"
file = "mag.csv"
time = { column = "t", unit = "s" }
columns = ["mx", "my", "mz"]
unit = "uT"
std = 0.5
"""


def attitude(t):
    """A hand that tilts and turns slowly, to about 50 deg of roll and pitch and all around."""
    return Rotation.from_euler(
        "ZYX", np.c_[0.2 * t, 0.8 * np.sin(0.21 * t), 0.9 * np.sin(0.17 * t + 0.3)]
    )


def tables():
    """(IMU, magnetometer) of 100 s: 50 Hz and 10 Hz, body FRD, with a little noise."""
    rng = np.random.default_rng(8)
    t = 0.02 * np.arange(1, 5001)
    rate = (attitude(t - 0.02).inv() * attitude(t)).as_rotvec() / 0.02
    force = attitude(t - 0.01).inv().apply([0, 0, -9.807])
    imu = pd.DataFrame(
        np.c_[t, rate, force + rng.normal(0, 0.02, force.shape)],
        columns=["t", "gx", "gy", "gz", "ax", "ay", "az"],
    )
    t = t[::5]
    field = attitude(t).inv().apply(np.array(EARTH.field) * 1e6) + rng.normal(0, 0.05, (len(t), 3))
    return imu, pd.DataFrame(np.c_[t, field], columns=["t", *COLUMNS])


@pytest.fixture
def build(tmp_path):
    """Function (mag=change, toml=change, imu=change) -> path of recording.toml."""

    def build(mag=None, toml=None, imu=None):
        for name, frame, change in zip(("imu", "mag"), tables(), (imu, mag)):
            (change(frame) if change else frame).to_csv(tmp_path / f"{name}.csv", index=False)
        path = tmp_path / "recording.toml"
        path.write_text(toml(TOML) if toml else TOML, encoding="utf-8")
        return path

    return build


def added(line):
    return lambda text: text + line + "\n"


def without(line):
    return lambda text: (
        "\n".join(each for each in text.splitlines() if not each.startswith(line)) + "\n"
    )


def turned(C):
    """The magnetometer's columns in sensor axes, where C takes them to the body."""
    return lambda frame: frame.assign(
        **dict(zip(COLUMNS, (frame[COLUMNS].to_numpy() @ np.array(C, float)).T))
    )
