"""Kits of vehicles: appended to a description as they are, or with their sensors uncommented, they are read."""

import re

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.description.messages import load

HEAD = """{vehicle}
[imu]
file = "imu.csv"
time = {{ column = "t", unit = "s" }}
gyro = {{ columns = ["gx", "gy", "gz"], unit = "rad/s" }}
accel = {{ columns = ["ax", "ay", "az"], unit = "m/s^2" }}

[[source]]
kind = "position"
file = "gnss.csv"
time = {{ column = "t", unit = "s" }}
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.5, 1.5, 3.0]

{kit}
"""
KINDS = {
    "car": [
        "zero-lateral-velocity",
        "zero-vertical-velocity",
        "zero-velocity",
        "zero-angular-rate",
    ],
    "rail": [
        "zero-lateral-velocity",
        "zero-vertical-velocity",
        "zero-velocity",
        "zero-angular-rate",
    ],
    "fixed-wing": ["zero-side-slip"],
    "multicopter": [],
    "boat": ["zero-sea-level", "zero-lateral-velocity"],
    "underwater": [],
}


def described(name, folder, uncommented=False):
    """The path of a description with that kit, and the vehicle that it asks for."""
    kit = sd.vehicle_kit(name)
    vehicle = re.search(r"vehicle = .*$", kit, re.M)
    if uncommented:
        kit = re.sub(r"^# (\[\[|\w+ = )", r"\1", kit, flags=re.M)
    path = folder / "recording.toml"
    path.write_text(HEAD.format(vehicle=vehicle.group() if vehicle else "", kit=kit))
    return path


@pytest.mark.parametrize("name", KINDS)
def test_a_kit_is_read(name, tmp_path):
    t = np.arange(1, 2001) / 100
    imu = pd.DataFrame({"t": t, "gx": 1e-4 * np.sin(t), "gy": 0.0, "gz": 1e-4 * np.cos(3 * t)})
    pd.concat(
        [imu, pd.DataFrame({"ax": 1e-3 * np.sin(5 * t), "ay": 0.0, "az": -9.81})], axis=1
    ).to_csv(tmp_path / "imu.csv", index=False)
    fixes = {"t": np.arange(1, 20), "lat": 48.0, "lon": 11.0, "alt": 500.0}
    pd.DataFrame(fixes).to_csv(tmp_path / "gnss.csv", index=False)
    recording = sd.read(described(name, tmp_path))
    assert [a.kind for a in recording.sources[1:]] == KINDS[name]


@pytest.mark.parametrize("name", ["multicopter", "underwater"])
def test_sensors_of_a_kit_are_described_as_they_are_read(name, tmp_path):
    parts = load(described(name, tmp_path, uncommented=True)).source
    assert len(parts) == 1 + sd.vehicle_kit(name).count("[[source]]") > 1


def test_every_kit_is_listed():
    assert sd.vehicle_kits() == sorted(KINDS)
    with pytest.raises(DataError, match=r"name of a vehicle kit is 'cra'.*car"):
        sd.vehicle_kit("cra")
