"""The three 30-minute workloads everything is measured on, one synthetic day, and the scoring
against their truth.

A vehicle at 20 m/s that turns, climbs, rolls and pitches, from the independent simulator of
python-ins: `A` imu100_gnss1: 100 Hz increments, 1 Hz position fixes, a tactical MEMS IMU; `B`
imu20_gnss20: the same IMU at 20 Hz, a fix at every sample; `N` nav100_gnss1: as A with a
navigation-grade IMU, for filters in open loop.

Run as `python benchmarks/workload.py [FOLDER]` to write them as .npz files; same versions of numpy
and python-ins, same bits.
"""

import os
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

FOLDER = Path(__file__).resolve().parents[1] / "build" / "workload"
SETTLED = 120.0  # s; errors are scored from here on
DEG, HOUR = np.pi / 180, 3600.0

TACTICAL = dict(
    gyro_noise=0.2 * (DEG / 60),
    accel_noise=0.05 / 60,  # rad/sqrt(s), m/s/sqrt(s): 0.2 deg/sqrt(h), 0.05 m/s/sqrt(h)
    gyro_bias_std=30 * DEG / HOUR,
    accel_bias_std=0.02,  # rad/s, m/s^2
    gyro_bias_walk=6 * DEG / HOUR / 60,
    accel_bias_walk=0.002 / 60,  # rad/s/sqrt(s), m/s^2/sqrt(s)
    gnss_std=1.0,
    pos_std=2.0,
    vel_std=0.2,
    level_std=0.5,
    azimuth_std=2.0,
)  # m, m, m/s, deg, deg
NAVIGATION = dict(
    TACTICAL,
    gyro_noise=0.002 * (DEG / 60),
    accel_noise=0.003 / 60,
    gyro_bias_std=0.01 * DEG / HOUR,
    accel_bias_std=50e-5,
    gyro_bias_walk=0.003 * DEG / HOUR / 60,
    accel_bias_walk=10e-5 / 60,
    level_std=0.02,
    azimuth_std=0.1,
)


class Recipe(NamedTuple):
    """What makes one workload."""

    name: str
    rate: int  # Hz
    fix_every: int  # samples
    seed: int
    parameters: dict


RECIPES = {
    "A": Recipe("imu100_gnss1", 100, 100, 20240, TACTICAL),
    "B": Recipe("imu20_gnss20", 20, 1, 20241, TACTICAL),
    "N": Recipe("nav100_gnss1", 100, 100, 20242, NAVIGATION),
}


class Workload(NamedTuple):
    """One workload in SI and radians. Row k of the increments is the integral over (t[k-1],
    t[k]]; row 0 is the start."""

    name: str
    dt: float
    t: np.ndarray  # (n+1,) s
    dtheta: np.ndarray  # (n+1, 3) body FRD, rad, with errors
    dv: np.ndarray  # (n+1, 3) body FRD, m/s, with errors
    lla: np.ndarray | None  # truth: rad, rad, m; None where it is not known at each sample
    v: np.ndarray | None  # truth: NED, m/s
    rph: np.ndarray | None  # truth: rad
    fix_t: np.ndarray  # (m,) s
    fix: np.ndarray  # (m, 3) rad, rad, m
    start: tuple  # perturbed initial lla, v, rph
    std: np.ndarray  # 15 initial standard deviations
    parameters: dict  # as above: SI, initial angles in deg

    def first(self, seconds):
        """The workload up to `seconds`."""
        n, m = (np.searchsorted(times, seconds + 0.5 * self.dt) for times in (self.t, self.fix_t))
        arrays = {key: getattr(self, key) for key in ("t", "dtheta", "dv", "lla", "v", "rph")}
        rows = {key: array[:n] for key, array in arrays.items() if array is not None}
        return self._replace(fix_t=self.fix_t[:m], fix=self.fix[:m], **rows)


class Rms(NamedTuple):
    """Root mean square of the length of the error vectors."""

    position: float  # m
    velocity: float  # m/s
    attitude: float  # deg

    def __str__(self):
        return f"{self.position:.4f} m {self.velocity:.4f} m/s {self.attitude:.4f} deg"


def motion(t):
    """True velocity (n, 3) in m/s NED and roll, pitch, heading (n, 3) in deg at times `t`."""

    def wave(amplitude, period):
        return amplitude * np.sin(2 * np.pi / period * t)

    def slope(amplitude, period):
        return 2 * np.pi / period * amplitude * np.cos(2 * np.pi / period * t)

    speed = 20 + wave(5, 97) + wave(2, 31)
    course = 2 * np.pi / 300 * t + wave(0.8, 60) + wave(0.3, 23)
    turn = 2 * np.pi / 300 + slope(0.8, 60) + slope(0.3, 23)
    climb = wave(0.06, 80) + wave(0.02, 19)
    level = speed * np.cos(climb)
    v = np.c_[level * np.cos(course), level * np.sin(course), -speed * np.sin(climb)]
    roll = np.rad2deg(np.arctan(speed * turn / 9.81)) + wave(2, 5.0) + wave(0.8, 1.7)
    pitch = np.rad2deg(climb) + wave(1, 3.3) + wave(0.5, 1.1)
    heading = np.rad2deg(course) + wave(1, 4.1)
    return v, np.c_[roll, pitch, (heading + 180) % 360 - 180]


def simulate(recipe, duration=1800.0):
    """Arrays of one workload as they are stored: degrees for angles of position, attitude and
    their std, else SI."""
    from pyins import inertial_sensor, sim, util

    p, rng = recipe.parameters, np.random.RandomState(recipe.seed)
    t = np.arange(round(duration * recipe.rate) + 1) / recipe.rate
    v, rph = motion(t)
    truth, ideal = sim.generate_imu(t, [45.0, 10.0, 500.0], rph, v, "increment")
    bias = {sensor: p[sensor + "_bias_std"] * rng.randn(3) for sensor in ("gyro", "accel")}
    errors = [
        inertial_sensor.Parameters(
            None, bias[sensor], p[sensor + "_noise"], p[sensor + "_bias_walk"], rng
        )
        for sensor in bias
    ]
    imu = inertial_sensor.apply_imu_parameters(ideal, "increment", *errors)
    fixes = sim.generate_position_measurements(
        truth.iloc[recipe.fix_every :: recipe.fix_every], p["gnss_std"], rng
    )
    start = sim.perturb_pva(
        truth.iloc[0],
        sim.generate_pva_error(
            *(p[key] for key in ("pos_std", "vel_std", "level_std", "azimuth_std")), rng
        ),
    )
    columns = {"lla": util.LLA_COLS, "vel": util.VEL_COLS, "rph": util.RPH_COLS}
    sensors = {"dtheta": util.GYRO_COLS, "dvel": util.ACCEL_COLS}
    return {
        "time": t,
        "rate": recipe.rate,
        **p,
        "gnss_time": fixes.index.to_numpy(float),
        "gnss_lla": fixes.to_numpy(),
        **{key: truth[names].to_numpy() for key, names in columns.items()},
        **{"init_" + key: start[names].to_numpy(float) for key, names in columns.items()},
        **{key: imu[names].to_numpy() for key, names in sensors.items()},
        **{key + "_true": ideal[names].to_numpy() for key, names in sensors.items()},
        "gyro_bias": errors[0].data_frame.to_numpy(),
        "accel_bias": errors[1].data_frame.to_numpy(),
    }


def save(path, arrays):
    """Write an .npz file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        np.savez_compressed(file, **arrays)
    os.replace(file.name, path)


def stored(name, folder=FOLDER):
    """Path of the .npz of workload "A", "B" or "N", simulated first where it is not there yet."""
    path = Path(folder) / f"{RECIPES[name].name}.npz"
    if not path.exists():
        save(path, simulate(RECIPES[name]))
    return path


def load(name, folder=FOLDER):
    """Workload "A", "B" or "N" in SI and radians."""
    with np.load(stored(name, folder)) as file:
        return from_stored(name, dict(file))


def from_stored(name, w):
    """Workload from arrays in the units of `simulate`."""
    p = {key: float(w[key]) for key in TACTICAL}
    scale = np.array([DEG, DEG, 1.0])
    std = np.repeat(
        [p["pos_std"], p["vel_std"], p["level_std"] * DEG, p["accel_bias_std"], p["gyro_bias_std"]],
        3,
    )
    std[8] = p["azimuth_std"] * DEG
    return Workload(
        name,
        1 / float(w["rate"]),
        w["time"],
        w["dtheta"],
        w["dvel"],
        w["lla"] * scale,
        w["vel"],
        w["rph"] * DEG,
        w["gnss_time"],
        w["gnss_lla"] * scale,
        (w["init_lla"] * scale, w["init_vel"], w["init_rph"] * DEG),
        std,
        p,
    )


def score(workload, t, lla, v, C):
    """Rms of an estimate at IMU times `t` (s): `lla` rad, rad, m; `v` m/s NED; `C` (n, 3, 3)
    body to navigation frame."""
    from scipy.spatial.transform import Rotation

    late = t >= SETTLED
    k = np.rint(t[late] / workload.dt).astype(int)
    if not late.any() or np.abs(workload.t[k] - t[late]).max() > 1e-6:
        raise ValueError(f"estimates to score must stand at IMU times from {SETTLED:g} s on")
    true = workload.lla[k]
    x = 1 - 6.6943799901413e-3 * np.sin(true[:, 0]) ** 2
    normal = 6378137.0 / np.sqrt(x)
    metres = np.c_[
        normal * (1 - 6.6943799901413e-3) / x + true[:, 2],
        (normal + true[:, 2]) * np.cos(true[:, 0]),
        -np.ones(len(k)),
    ]
    rotation = Rotation.from_matrix(C[late]) * Rotation.from_euler("xyz", workload.rph[k]).inv()
    errors = (
        (lla[late] - true) * metres,
        v[late] - workload.v[k],
        rotation.as_rotvec(degrees=True),
    )
    return Rms(*(float(np.sqrt((error**2).sum(axis=1).mean())) for error in errors))


def period(seconds=600, rate=100):
    """Arrays of a closed figure that repeats after `seconds`: ideal dtheta and dv; lla (rad, rad,
    m) and v_n with the start; v and rph (rad) there; rate.

    Every wave fits a whole number of times, so rounds of it join smoothly; what is left of the last
    position belongs to the next round.
    """
    from pyins import sim, util

    t = np.arange(seconds * rate + 1) / rate
    wave = lambda amplitude, times, shift=0.0: (
        amplitude * np.sin(2 * np.pi * times / seconds * t + shift)
    )
    v = np.c_[wave(15, 4), wave(15, 8, 0.3), wave(1, 6)]
    rph = np.c_[wave(20, 4) + wave(2, 120), wave(5, 6) + wave(1, 180), wave(90, 4)]
    truth, ideal = sim.generate_imu(t, [45.0, 10.0, 500.0], rph, v, "increment")
    return {
        "dtheta": ideal[util.GYRO_COLS].to_numpy()[1:],
        "dv": ideal[util.ACCEL_COLS].to_numpy()[1:],
        "lla": truth[util.LLA_COLS].to_numpy() * [DEG, DEG, 1.0],
        "v_n": v,
        "v": v[0],
        "rph": rph[0] * DEG,
        "rate": rate,
    }


def stored_period(folder=FOLDER):
    """Path of the .npz of `period`, simulated first where it is not there yet."""
    path = Path(folder) / "period.npz"
    if not path.exists():
        save(path, period())
    return path


def repeated(piece, seconds, seed=1):
    """A Workload of `seconds` that repeats `piece` (arrays of `period`) with noise, biases and 1 Hz
    fixes; it starts without error.

    Filled in place, so that building it takes no more memory than it keeps. It carries no truth:
    `round_position` has it.
    """
    rng, rate, rows, p = (
        np.random.default_rng(seed),
        int(piece["rate"]),
        len(piece["dtheta"]),
        TACTICAL,
    )
    n, increments = round(seconds * rate), {}
    t = np.arange(n + 1, dtype=float)
    t /= rate
    for name, sensor in (("dtheta", "gyro"), ("dv", "accel")):
        column = increments[name] = np.zeros((n + 1, 3))
        bias = p[sensor + "_bias_std"] * rng.standard_normal(3) / rate
        for first in range(1, n + 1, rows):
            part = column[first : first + rows]
            rng.standard_normal(out=part)
            part *= p[sensor + "_noise"] / np.sqrt(rate)
            part += piece[name][: len(part)] + bias
    fix_t = np.arange(1.0, seconds + 1)
    north, east = round_scale(piece)
    fix = round_position(piece, fix_t) + rng.standard_normal((len(fix_t), 3)) * p["gnss_std"] / [
        north,
        east,
        1.0,
    ]
    std = np.repeat(
        [p["pos_std"], p["vel_std"], p["level_std"] * DEG, p["accel_bias_std"], p["gyro_bias_std"]],
        3,
    )
    return Workload(
        "day",
        1 / rate,
        t,
        increments["dtheta"],
        increments["dv"],
        None,
        None,
        None,
        fix_t,
        fix,
        (piece["lla"][0], piece["v"], piece["rph"]),
        std,
        p,
    )


def round_position(piece, t):
    """True position (rad, rad, m) at times `t` (s) that lie on samples of a repeated `piece`."""
    rate, rows = int(piece["rate"]), len(piece["dtheta"])
    rounds, k = np.divmod(np.rint(t * rate).astype(int), rows)
    return piece["lla"][k] + rounds[:, None] * (piece["lla"][-1] - piece["lla"][0])


def round_scale(piece):
    """Metres per radian of latitude and longitude, near enough for noise and a check."""
    return 6.38e6, 6.39e6 * np.cos(piece["lla"][0, 0])


if __name__ == "__main__":
    for name in RECIPES:
        print(stored(name, *sys.argv[1:2]))
