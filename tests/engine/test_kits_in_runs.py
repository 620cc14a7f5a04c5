"""Each vehicle kit on a simulated recording of its vehicle: appended to the description as it is, with
the sensors that it names, the run is trusted or the verdict says why not."""

import re

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer

HEAD = """vehicle = {vehicle}
[imu]
file = "imu.csv"
time = {{ column = "t", unit = "s" }}
gyro = {{ columns = ["gx", "gy", "gz"], unit = "rad/s" }}
accel = {{ columns = ["ax", "ay", "az"], unit = "m/s^2" }}
{more}
[[source]]
kind = "position"
file = "gnss.csv"
time = {{ column = "t", unit = "s" }}
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 1.5]

[[source]]
kind = "velocity"
file = "gnss.csv"
time = {{ column = "t", unit = "s" }}
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1

{kit}
"""
RECEIVER = Gnss(1.0, (1.0, 1.0, 1.5), (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
FIELD = (21e-6, 1.5e-6, 43e-6)
AUV = '{ name = "auv", speed = 5.0, lowest = -6000.0, highest = 100.0 }'
ROAD = 'estimate = ["mounting"]'
KITS = {
    "car": ("car", 200.0, '"car"', ROAD),
    "rail": ("car", 200.0, '"car"', ROAD),
    "fixed-wing": ("demo", 200.0, '"aircraft"', ""),
    "multicopter": ("multicopter", 150.0, '"multicopter"', ""),
    "boat": ("ship", 400.0, '"ship"', ""),
    "underwater": ("underwater", 250.0, AUV, ""),
}
"""{kit: scenario, seconds, vehicle, more of [imu]}."""
SEA = 47.0  # m, height of the ship above the ellipsoid
BEACON = (300.0, 200.0, 60.0)  # m NED from the start


def simulated(kit):
    name, seconds, _, _ = KITS[kit]
    sensors, compass = [], None
    if kit == "underwater":
        place = sd.simulate(name, 2.0, "tactical", seed=1).reference.lla[0]
        beacon = (0.0, 0.0, 0.0, *displace_lla(place, np.array(BEACON)))
        sensors = [
            Simulated("body-velocity", 0.02, 5.0, (0.0, 0.0, 0.5)),
            Simulated("depth", 0.1, 2.0, states=(1.5,)),
            Simulated("range", 0.5, 1.0, beacon),
        ]
    if kit == "multicopter":
        compass = Magnetometer(rate=10.0, std=1e-6, field=FIELD, hard_iron=(15e-6, -10e-6, 20e-6))
    return sd.simulate(
        name, seconds, "tactical", seed=4, gnss=RECEIVER, sensors=sensors, magnetometer=compass
    )


def write_table(path, t, columns, values):
    pd.DataFrame({"t": t} | dict(zip(columns, values.T))).to_csv(path, index=False)


def write(kit, folder):
    """The path of the description of a simulated recording, with the kit behind it."""
    made, text = simulated(kit), sd.vehicle_kit(kit)
    imu, (position, velocity, *others) = made.imu, made.sources
    rates = np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]
    write_table(folder / "imu.csv", imu.t, ["gx", "gy", "gz", "ax", "ay", "az"], rates)
    lla = position.y * [180 / np.pi, 180 / np.pi, 1.0]
    columns = ["lat", "lon", "alt", "vn", "ve", "vd"]
    write_table(folder / "gnss.csv", position.t, columns, np.c_[lla, velocity.y])
    for a, (file, columns, factor) in zip(others, SENSORS.get(kit, ())):
        write_table(folder / file, a.t, columns, a.y * factor)
    if kit in SENSORS:
        text = re.sub(r"^# (\[\[|\w+ = )", r"\1", text, flags=re.M)
        text = re.sub(r"^vehicle = .*$", "", text, flags=re.M)
    if kit == "multicopter":
        # the simulated one has no rotors that drag
        text = text.replace('"imu.csv"', '"mag.csv"').partition("# Its rotors drag")[0]
        text += 'field = { north = 21.0, east = 1.5, down = 43.0, unit = "uT" }\n'
    if kit == "underwater":
        north, east, down = displace_lla(made.reference.lla[0], np.array(BEACON))
        place = f"{{ lat = {np.degrees(north):.9f}, lon = {np.degrees(east):.9f}, height = {down:.3f} }}"
        text = re.sub(r"beacon = \{.*\}", f"beacon = {place}", text)
    text = text.replace("level = 0.0", f"level = {SEA}")
    path = folder / "recording.toml"
    _, _, vehicle, more = KITS[kit]
    path.write_text(HEAD.format(vehicle=vehicle, more=more, kit=text))
    return path


SENSORS = {
    "multicopter": (("mag.csv", ["mx", "my", "mz"], 1e6),),
    "underwater": (
        ("dvl.csv", ["vx", "vy", "vz"], 1.0),
        ("depth.csv", ["depth"], 1.0),
        ("usbl.csv", ["range"], 1.0),
    ),
}
"""{kit: file, columns and factor of each of its sensors}."""


@pytest.mark.parametrize("kit", KITS)
def test_a_kit_runs_and_is_trusted_or_says_why(kit, tmp_path):
    recording = sd.read(write(kit, tmp_path))
    solution = sd.fuse(recording, imu="tactical")
    verdict = solution.verdict
    assert verdict.trusted, str(verdict)
    for name, (used, rejected) in solution.counts().items():
        assert used > 20 and rejected < 0.05 * (used + rejected), name
