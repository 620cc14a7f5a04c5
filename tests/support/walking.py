"""A ground robot at walking speed: it stands, drives, and turns on the way."""

import numpy as np
import pandas as pd

import strapdown as sd
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import car
from strapdown.sim.trajectory import DEG

RTK = Gnss(interval=0.2, position_std=(0.05, 0.05, 0.05), velocity_std=None)
"""Positions alone, to 5 cm."""
TURNS = (90, -90, 45, -120, 180)


def robot(seed, gnss=RTK, top=2.0, seconds=150.0, turns=TURNS):
    """A simulated Recording of a robot that is never faster than `top` (m/s); it turns by `turns`
    (deg) one after the other."""
    rng = np.random.default_rng(seed)
    legs = [{"duration": 8.0, "speed": 0.0}]
    for k in range(round(seconds / 10)):
        speed, turn = float(rng.uniform(0.4, 1.0) * top), float(turns[k % len(turns)])
        legs += [{"duration": 3.0, "speed": speed}, {"duration": float(rng.uniform(4, 9))}]
        legs += [{"duration": 1.0 + abs(turn) / 30.0, "turn": turn * DEG}]
    motion = car((DEG * 47.2, DEG * 8.5, 450.0), float(rng.uniform(0, 2 * np.pi)), legs)
    return sd.simulate(motion, seconds, "consumer", seed, 100.0, gnss)


def tables(recording, axes, folder):
    """imu.csv in columns with the axes "FLU" or "RFU", and gnss.csv of the positions."""
    imu, position = recording.imu, next(a for a in recording.sources if a.kind == "position")
    rates = np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]
    order, sign = {"FLU": ([0, 1, 2], [1, -1, -1]), "RFU": ([1, 0, 2], [1, 1, -1])}[axes]
    columns = [rates[:, offset + k] * s for offset in (0, 3) for k, s in zip(order, sign)]
    names = ["time", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"]
    pd.DataFrame(np.c_[imu.t, np.transpose(columns)], columns=names).to_csv(
        folder / "imu.csv", index=False
    )
    names = ["time", "lat", "lon", "height_ellipsoid", "std_n", "std_e", "std_d"]
    values = np.c_[position.t, position.y / [DEG, DEG, 1.0], position.std]
    pd.DataFrame(values, columns=names).to_csv(
        folder / "gnss.csv", index=False, float_format="%.10f"
    )
    return folder / "imu.csv", folder / "gnss.csv"
