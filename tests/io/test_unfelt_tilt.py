"""A multicopter that tilts without feeling it: its fixes decide on the unit of its gyro, else the
vehicle does, and no two messages send the user in a circle."""

import numpy as np
import pandas as pd
import pytest
from multicopter import DEG, rocking

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.inspection import inspect
from strapdown.sensor_models.gnss import Gnss

IMU = """[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["wx", "wy", "wz"], unit = "UNIT" }
accel = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
grade = "consumer"
"""
FIXES = """
[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "h"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 1.5]

[[source]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1
"""
REFUSED = "deg/s read as rad/s.*--vehicle multicopter"


@pytest.fixture(scope="module", params=[7101, 7102, 7106])
def folder(request, tmp_path_factory):
    """Tables of 40 s of rates in rad/s and of fixes."""
    path = tmp_path_factory.mktemp("rocking")
    flight = sd.simulate(
        rocking(request.param), 40.0, "consumer", request.param, 200.0, Gnss(interval=0.2)
    )
    imu, (position, velocity) = flight.imu, flight.sources
    rates = np.c_[imu.t, np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]]
    pd.DataFrame(rates, columns="t wx wy wz fx fy fz".split()).to_csv(path / "imu.csv", index=False)
    fixes = np.c_[position.t, position.y / [DEG, DEG, 1.0], velocity.y]
    pd.DataFrame(fixes, columns="t lat lon h vn ve vd".split()).to_csv(
        path / "gnss.csv", index=False, float_format="%.10f"
    )
    return path


def described(folder, unit, fixes=FIXES, head=""):
    path = folder / "recording.toml"
    path.write_text(head + IMU.replace("UNIT", unit) + fixes)
    return path


def test_the_fixes_confirm_the_unit(folder):
    path = described(folder, "rad/s")
    assert not any("gyro" in problem for problem in inspect(path).problems)
    recording = sd.read(path)
    assert any("the fixes confirm its unit" in note for note in recording.meta["notes"])
    assert not any(reason.cause == "unit" for reason in sd.fuse(recording).verdict.reasons)


def test_the_other_unit_is_named(folder):
    path = described(folder, "deg/s")
    assert any("rad/s read as deg/s" in problem for problem in inspect(path).problems)
    reasons = sd.fuse(sd.read(path)).verdict.reasons
    assert any("rad/s read as deg/s" in reason.seen for reason in reasons), reasons


def test_without_fixes_the_vehicle_decides(folder):
    path = described(folder, "rad/s", "")
    assert any("--vehicle multicopter" in problem for problem in inspect(path).problems)
    recording = sd.read(path)
    with pytest.raises(DataError, match=REFUSED):
        sd.fuse(recording, "mahony")
    sd.fuse(recording, "mahony", vehicle="multicopter")
    sd.write_recording(recording, folder / "kept.nc")
    with pytest.raises(DataError, match=REFUSED):
        sd.fuse(sd.read(folder / "kept.nc"), "mahony")
    sd.fuse(sd.read(described(folder, "rad/s", "", 'vehicle = "multicopter"\n')), "mahony")
    with pytest.raises(DataError, match="gyro.unit"):
        sd.read(described(folder, "rad/s", "", 'vehicle = "car"\n'))


def test_the_option_works(folder, good):
    path = described(folder, "rad/s", "")
    good("fuse", path, "--filter", "mahony", "--vehicle", "multicopter", "--out", folder / "out")


def test_arrays_of_a_multicopter(folder):
    columns = pd.read_csv(folder / "imu.csv").to_numpy()
    arrays = columns[:, 0], columns[:, 1:4], columns[:, 4:]
    with pytest.raises(DataError, match=REFUSED):
        sd.Recording.from_arrays(*arrays)
    sd.Recording.from_arrays(*arrays, vehicle="multicopter")
