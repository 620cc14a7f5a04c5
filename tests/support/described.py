"""A simulated recording written as tables with a recording.toml."""

import numpy as np
import pandas as pd

TOML = """# A drive, with comments that must stay.
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }   # of the logger
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
mounting = { roll = 0.0, pitch = 0.0, heading = 0.0, unit = "deg" }
lever_arm = [0.0, 0.0, -0.5]
grade = "consumer"

[[source]]
kind = "position"
file = "position.csv"
time = { column = "t", unit = "s", offset = 0.0 }
columns = ["a", "b", "c"]
unit = ["rad", "rad", "m"]
std = [1.0, 1.0, 1.5]
lever_arm = [0.5, 0.2, -1.5]      # by tape

[[source]]
kind = "velocity"
file = "velocity.csv"
time = { column = "t", unit = "s" }
columns = ["a", "b", "c"]
unit = "m/s"
std = 0.1
lever_arm = [0.5, 0.2, -1.5]
"""
SPEED = """
[[source]]
kind = "speed"
file = "speed.csv"
time = { column = "t", unit = "s" }
columns = ["a"]
unit = "m/s"
std = 0.1
lever_arm = [0.0, 0.0, -0.5]
"""
CONSTRAINTS = """
# of the vehicle
[[source]]
kind = "zero-lateral-velocity"
rate = 10.0
std = 0.1
lever_arm = [0.0, 0.0, -0.5]

[[source]]
kind = "zero-vertical-velocity"
rate = 10.0
std = 0.1
lever_arm = [0.0, 0.0, -0.5]
"""


def described(recording, folder, text=TOML):
    """The path of a recording.toml in `folder` with the tables that it names, of `recording`."""
    imu = recording.imu
    rates = np.c_[imu.t, imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]]
    columns = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    pd.DataFrame(rates, columns=columns).to_csv(folder / "imu.csv", index=False)
    for a in recording.sources:
        if f"{a.kind}.csv" in text:
            columns = ["t", *"abc"[: a.y.shape[1]]]
            table = pd.DataFrame(np.c_[a.t, a.y], columns=columns)
            table.to_csv(folder / f"{a.kind}.csv", index=False)
    path = folder / "recording.toml"
    path.write_text(text)
    return path
