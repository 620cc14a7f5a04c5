"""Vehicles: their names, bounds of one's own, how recordings and runs take them."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import flight, said, start

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import DOUBTFUL
from strapdown.data.vehicle import VEHICLES, Vehicle, find
from strapdown.io.readers.netcdf import read_recording, write_recording

pytestmark = pytest.mark.short


def test_found_by_name_as_itself_and_from_its_fields():
    assert find(None) is VEHICLES["any"] and find("car") is VEHICLES["car"]
    own = Vehicle("rover", speed=3.0, highest=2000.0)
    assert find(own) is own and find(vars(own)) == own


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("cra", "vehicle is 'cra' .did you mean 'car'.*any, pedestrian, car, ship"),
        (7, "vehicle is 7; it must be one of"),
        ({"speeed": 3.0}, "vehicle: the limit is 'speeed' .did you mean 'speed'"),
        ({"speed": 0.0}, "vehicle speed"),
        ({"lowest": 5.0, "highest": 4.0}, "lowest is 5 m and highest 4 m"),
        ({"acceleration": float("nan")}, "vehicle acceleration"),
        ({}, "vehicle: it has no limit; give some of speed, acceleration, lowest, highest"),
        ({"name": None}, "vehicle name is None; it must be text"),
    ],
)
def test_others_are_refused_in_one_line(wrong, words):
    with pytest.raises(DataError, match=words) as raised:
        find(wrong)
    assert "\n" not in str(raised.value)


def test_a_bound_below_what_was_flown_is_named_with_its_vehicle():
    """The flight is at 30 m/s and 500 m."""
    recording, slow = flight(), Vehicle("rover", speed=20.0, highest=490.0)
    solution = sd.fuse(recording, start=start(recording), vehicle=slow)
    rover = "vehicle 'rover'"
    (velocity,) = said(solution, f"is more than the 20 m/s of {rover}: left out")
    assert velocity[0] == 1.0 and velocity[1].startswith("GNSS velocity: 3")
    (height,) = said(solution, f"is beyond the -12000 to 490 m of {rover}: left out")
    assert height[1].startswith("GNSS position: a height of 5")
    assert len(said(solution, "the filter's speed", "the filter's height")) == 2
    assert (solution.status == DOUBTFUL).all()
    assert solution.counts() == {"GNSS position": (0, 0), "GNSS velocity": (0, 0)}
    assert solution.meta["vehicle"] == "rover"


def test_a_sample_beyond_it_is_named_with_its_vehicle():
    recording = flight()
    dv = recording.imu.dv.copy()
    dv[100, 2] += 100.0 * recording.imu.dt[100]
    shaken = replace(recording, imu=recording.imu._replace(dv=dv))
    assert not said(sd.fuse(shaken, start=start(recording), vehicle="car"), "which is out of range")
    calm = Vehicle("glider", acceleration=50.0)
    ((t, text),) = said(sd.fuse(shaken, start=start(recording), vehicle=calm), "accelerometer")
    assert t == recording.imu.t[100] and text.startswith("accelerometer z reads ")
    assert text.endswith(
        "which is out of range: more than the 50 m/s^2 of vehicle 'glider': bridged"
    )


def test_the_recordings_own_is_used_and_given_up_for_another(tmp_path):
    recording = flight()
    known = replace(recording, meta=recording.meta | {"vehicle": Vehicle("rover", speed=20.0)})
    write_recording(known, tmp_path / "rover.nc")
    for each in (known, read_recording(tmp_path / "rover.nc")):
        assert said(sd.fuse(each, start=start(each)), "vehicle 'rover'")
        assert not sd.fuse(each, start=start(each), vehicle="aircraft").events
    solution = sd.fuse(recording, start=start(recording), vehicle="aircraft")
    assert find(solution.recording.meta["vehicle"]) == VEHICLES["aircraft"]


TABLE = "t,wx,wy,wz,fx,fy,fz\n" + "".join(f"{k / 10},0,0,0,0,0,-9.8\n" for k in range(50))
IMU = """
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
accel = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
"""


def described(folder, text):
    (folder / "imu.csv").write_text(TABLE)
    (folder / "recording.toml").write_text(text + IMU)
    return sd.read(folder / "recording.toml")


def test_a_description_names_one_or_has_bounds_with_units(tmp_path):
    assert described(tmp_path, 'vehicle = "car"').meta["vehicle"] == "car"
    text = 'vehicle = { speed = 36, speed_unit = "km/h", lowest = -1, highest = 2, highest_unit = "km" }'
    own = described(tmp_path, text).meta["vehicle"]
    assert own.speed == pytest.approx(10.0)
    assert own == Vehicle("own", speed=own.speed, lowest=-1.0, highest=2000.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('vehicle = "cra"', "recording.toml: vehicle: vehicle is 'cra' .did you mean 'car'"),
        ("vehicle = {}", "vehicle: it has no limit; give some of speed"),
        ("vehicle = { sped = 3 }", "recording.toml: .vehicle.*unknown key 'sped'"),
        ('vehicle = { speed = 3, speed_unit = "kg" }', "speed: unknown unit 'kg'"),
        ("vehicle = { highest = -20000 }", "lowest is -12000 m and highest -20000 m"),
    ],
)
def test_a_description_with_another_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(DataError, match=words) as raised:
        described(tmp_path, text)
    assert "\n" not in str(raised.value)


def test_all_bounds_are_possible():
    assert all(np.isfinite([v.speed, v.acceleration, v.highest]).all() for v in VEHICLES.values())
