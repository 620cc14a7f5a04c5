"""The files of their own that users name in the command lines of README, tutorials and help, made of
simulated recordings. A table counts in GPS time where a receiver's log stands beside it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import written_dataflash
import written_ubx
import written_ulog
from described import TOML, described
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.core.loop.contract import Imu
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import hand_held

SECONDS, AT_ONCE = 100.0, Gnss(interval=0.2)
UNIX = written_ubx.GPS / 1e3 + 315964800 - 18
"""Of the first second of the tables."""
PLACE = (0.84, 0.20, 560.0)
FILTER = '''"""A filter of one's own: the closed loop by another name."""
from strapdown.filters.ins.closed_loop import CLOSED_LOOP

MINE = CLOSED_LOOP._replace(name="mine")
'''
SCENARIO = """duration_s = 30

[motion]
kind = "demo"
"""
HERE = """date = "2024-05-17"
place = { latitude = 0.84, longitude = 0.20, height = 560.0, unit = "rad" }
"""
FIELD = """[[source]]
kind = "magnetic-field"
file = "magnetic-field.csv"
time = { column = "t", unit = "s" }
columns = ["a", "b", "c"]
unit = "T"
std = 3e-7
"""


@cache
def car():
    """A drive with fixes at 5 Hz."""
    return sd.simulate("car", SECONDS, "industrial", seed=5, gnss=AT_ONCE)


def imu_table(imu, path, zero=0.0):
    """A table of samples; times count from `zero`, s."""
    columns = ["time [s]", *(f"gyro {axis} [deg/s]" for axis in "xyz")]
    columns += [f"acc {axis} [m/s2]" for axis in "xyz"]
    rates = np.degrees(imu.dtheta) / imu.dt[:, None], imu.dv / imu.dt[:, None]
    pd.DataFrame(np.c_[zero + imu.t, *rates], columns=columns).to_csv(path, index=False)


def gnss_table(recording, path):
    """A table of positions and velocities, in Unix time."""
    position, velocity = recording.sources
    fixes = np.c_[UNIX + position.t, np.degrees(position.y[:, :2]), position.y[:, 2], velocity.y]
    columns = ["time [s]", "lat [deg]", "lon [deg]", "height [m]"]
    columns += ["vn [m/s]", "ve [m/s]", "vd [m/s]"]
    pd.DataFrame(fixes, columns=columns).to_csv(path, index=False)


def ubx(recording, path):
    """NAV-PVT of the same fixes."""
    position, velocity = recording.sources
    fixes = {
        "lon": np.round(np.degrees(position.y[:, 1]) * 1e7),
        "lat": np.round(np.degrees(position.y[:, 0]) * 1e7),
        "height": np.round(position.y[:, 2] * 1e3),
        "velN": np.round(velocity.y[:, 0] * 1e3),
        "velE": np.round(velocity.y[:, 1] * 1e3),
        "velD": np.round(velocity.y[:, 2] * 1e3),
    }
    moments = written_ubx.GPS + np.round(position.t * 1e3).astype(int)
    path.write_bytes(written_ubx.pvt(moments, **fixes).tobytes())


def two_imus(path):
    """An ArduPilot log of two IMUs."""
    messages = written_dataflash.messages_of(car(), later=0.2, instances=2)
    columns = messages["IMU"][1]
    alike = {name: columns[name] / (1 + 0.1 * columns["I"]) for name in columns if len(name) == 4}
    messages["IMU"] = messages["IMU"][0], columns | alike
    path.write_bytes(written_dataflash.dataflash(messages))


def magnetic(path):
    """A recording.toml with a magnetometer that is turned by hand for ten minutes."""
    iron = Magnetometer(
        rate=10.0, std=0.3e-6, hard_iron=(3e-6, -2e-6, 4e-6), field=(21e-6, 1.6e-6, 43.9e-6)
    )
    none = Gnss(position_std=None, velocity_std=None)
    made = sd.simulate(
        hand_held(PLACE), 600.0, "consumer", 1, rate=25.0, gnss=none, magnetometer=iron
    )
    described(made, path.parent, HERE + TOML.partition("[[source]]")[0] + FIELD)


def attitudes(path):
    """A trial of the BROAD data set: at rest, then turning about x."""
    t = np.arange(3000) / 100.0
    turn = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1]) * Rotation.from_rotvec(
        np.outer(0.6 * np.clip(t - 3.0, 0.0, None), [1.0, 0.0, 0.0])
    )
    np.savez(
        path,
        fs=np.array(100.0),
        gyr=np.where(t[:, None] > 3.0, [0.6, 0, 0], 0.0).astype(np.float32),
        acc=turn.inv().apply([0.0, 0.0, 9.81]).astype(np.float32),
        mag=turn.inv().apply([0.0, 18.0, -45.0]).astype(np.float32),
        quat_wxyz_enu=turn.as_quat()[:, [3, 0, 1, 2]].astype(np.float32),
        pos_enu=np.zeros((len(t), 3), np.float32),
        movement=t > 3.5,
    )


def rests(path):
    """A table of an IMU that rests on each side, upright and upside down."""
    rng, forces, rates = np.random.default_rng(2), [], []
    for force in np.vstack([np.eye(3), -np.eye(3)]) * 9.81:
        forces += [np.tile(force, (300, 1)), rng.normal(0, 5, (20, 3)) + force]
        rates += [np.zeros((300, 3)), np.full((20, 3), 2.0)]
    f = np.concatenate(forces)
    f += 0.02 * rng.standard_normal(f.shape)
    k = len(f)
    imu_table(
        Imu(np.arange(1, k + 1) / 50, np.full(k, 0.02), np.concatenate(rates) / 50, f / 50), path
    )


def parked(path):
    """Ten minutes of an IMU on a bench."""
    made = sd.simulate("static", 600.0, "consumer", seed=1, rate=25.0)
    if path.suffix == ".csv":
        imu_table(made.imu, path)
    else:
        sd.write_recording(made, path)


def flight(path):
    """Ten minutes of flight."""
    sd.write_recording(sd.simulate("demo", 600.0, "tactical", seed=1, rate=25.0), path)


def drive(path):
    """A longer drive, named as its file is."""
    made = sd.simulate("car", 200.0, seed=5)
    sd.write_recording(replace(made, meta={**made.meta, "name": path.stem}), path)


def vehicle(path):
    """A configuration of `strapdown live` that replays a flight at once."""
    flight(path.with_name("flight.nc"))
    text = '[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = inf\n'
    path.write_text(text, encoding="utf-8")


GIVEN = {
    "vehicle.toml": vehicle,
    "flight.ulg": lambda path: written_ulog.write(path, car()),
    "YOUR.ulg": lambda path: written_ulog.write(path, car()),
    "flight.bin": two_imus,
    "imu.csv": lambda path: imu_table(car().imu, path, UNIX),
    "gnss.csv": lambda path: gnss_table(car(), path),
    "gnss.ubx": lambda path: ubx(car(), path),
    "recording.toml": lambda path: described(car(), path.parent),
    "calibrate recording.toml": magnetic,
    "drive.nc": drive,
    "flight.nc": flight,
    "hand.npz": attitudes,
    "parked.nc": parked,
    "parked.csv": parked,
    "rests.csv": rests,
    "climb.toml": lambda path: path.write_text(SCENARIO),
    "my_filter.py": lambda path: path.write_text(FILTER),
}
"""{name in a command line, of one command alone with its name before: writes that file}."""
