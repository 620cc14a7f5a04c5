"""Honest covariances: NEES and NIS over 100 flights inside their chi-square bands, for every filter whose model is the simulator's.

The truth is simulated once; sensors and the initial error (from P0) are drawn per seed. To add a filter, add a line to FILTERS.
"""
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.core.contract import STATES
from strapdown.data import Recording
from strapdown.sensors.gnss import Gnss
from strapdown.sensors.imu import ImuSpec, Triad
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion, increments, sample

pytestmark = pytest.mark.slow

SEEDS, DURATION, RATE = 100, 600, 50
BAND = 0.930, 1.073
"""chi-square quantiles 2.5 % and 97.5 % of 1500 degrees of freedom over 1500: of the mean of NEES/15 over 100 runs."""
INSIDE = 0.90
"""Least share of the epochs inside the band. The epochs of a run are correlated, so that a right filter falls below it now and then.

Measured with 600 other seeds: 1 in 170 sets of 100 seeds for MEMS, 1 in 65 for WALK, 1 in 6 for NAVIGATION, whose errors change slowest.
"""


def weaving():
    """At 40 m/s: turns of 70 deg to both sides every 35 s, banked, with climbs and a little pitch."""
    wave = lambda t, period: np.sin(2 * np.pi * t / period)
    speed, course = lambda t: 40 + 5 * wave(t, 50.0), lambda t: DEG * (30 + 70 * wave(t, 35.0) + 40 * wave(t, 90.0))
    rate = lambda t: DEG * (70 * 2 * np.pi / 35 * np.cos(2 * np.pi * t / 35) + 40 * 2 * np.pi / 90 * np.cos(2 * np.pi * t / 90))
    return Motion("weaving", (DEG * 47.0, DEG * 8.0, 800.0), lambda t: (speed(t) * np.cos(course(t)), speed(t) * np.sin(course(t)), 2 * wave(t, 60.0)),
                  lambda t: (np.arctan(speed(t) * rate(t) / 9.81), DEG * (2 + 3 * wave(t, 7.0)), course(t)))


@pytest.fixture(scope="module")
def flight():
    """(truth at the times of the fixes, IMU without errors), once for all runs."""
    t = np.arange(DURATION * RATE + 1) / RATE
    return sample(weaving(), t[::RATE]), increments(weaving(), t)


MEMS = ImuSpec("Gauss-Markov MEMS", Triad(noise=1e-3, gauss_markov=1e-3, time_constant=20.0), Triad(noise=1e-2, gauss_markov=0.05, time_constant=20.0))
WALK = ImuSpec("walking MEMS", Triad(noise=3e-4, turn_on_bias=1e-4, bias_walk=1e-4), Triad(noise=3e-3, turn_on_bias=5e-3, bias_walk=3e-3))
NAVIGATION = ImuSpec("navigation", Triad(noise=6e-7, turn_on_bias=2e-8, bias_walk=1e-9), Triad(noise=5e-5, turn_on_bias=2.5e-4, bias_walk=1e-5))
COARSE, FINE = np.radians([0.5, 0.5, 2.0]), np.radians([0.01, 0.01, 0.05])

FILTERS = [
    ("closed-loop", {}, MEMS, COARSE),
    ("closed-loop", {}, WALK, COARSE),
    ("mekf", {}, MEMS, COARSE),
    ("mekf", {}, WALK, COARSE),
    ("closed-loop-error-bias", {}, MEMS, COARSE),
    ("periodic-reset", {"interval": 10.0}, WALK, COARSE),
    ("open-loop", {}, NAVIGATION, FINE),    # with a worse IMU, or a coarse start, its INS leaves the linear model
]


def run(seed, flight, name, options, spec, attitude_sd, told=1.0):
    """(NEES, NIS, innovations) of one flight: (epochs,), (fixes,), (fixes, 3); the filter is `told` that many times the true noise."""
    truth, ideal = flight
    of_imu, of_gnss, of_start = np.random.default_rng(seed).spawn(3)
    imu, b_a, b_g = spec.corrupt(ideal, of_imu)
    accel_sd, gyro_sd = spec.bias_sd()
    start_sd = np.r_[[5.0] * 3, [0.3] * 3, attitude_sd, [accel_sd] * 3, [gyro_sd] * 3]
    start = draw_start(truth, start_sd, of_start)
    noise = spec.noise()._replace(gyro=told * spec.gyro.noise, accel=told * spec.accel.noise)
    fixes = tuple(replace(source, gate=np.inf) for source in Gnss().fixes(truth, of_gnss))
    solution = sd.fuse(Recording(imu, fixes), name, noise=noise, start=start, every=RATE, covariance=True, **options)
    e, rows = sd.errors(solution, truth), np.searchsorted(ideal.t, solution.t - 1e-6)
    error = np.c_[e.position, e.velocity, e.attitude, b_a[rows] - solution.b_a, b_g[rows] - solution.b_g]
    nees = np.einsum("ij,ij->i", error, np.linalg.solve(solution.covariance, error[:, :, None])[:, :, 0])
    return nees, solution.innovations.nis, solution.innovations.innovation


def runs(flight, line, seeds=range(SEEDS), **more):
    """NEES (runs, epochs), NIS (runs, fixes), innovations (runs, fixes, 3)."""
    with ThreadPoolExecutor(2) as pool:
        return [np.array(part) for part in zip(*pool.map(lambda seed: run(seed, flight, *line, **more), seeds))]


def share_inside(nees):
    """Share of the epochs whose mean NEES/15 over the runs is inside the band."""
    mean = nees.mean(axis=0) / STATES
    return np.mean((mean > BAND[0]) & (mean < BAND[1]))


@pytest.mark.parametrize("line", FILTERS, ids=lambda line: f"{line[0]}, {line[2].name}")
def test_errors_are_as_large_as_the_covariance_says(flight, line):
    nees, nis, innovation = runs(flight, line)
    assert nees.shape == (SEEDS, DURATION)
    assert share_inside(nees) >= INSIDE
    assert nis.mean() / 3 == pytest.approx(1, abs=3.5 * np.sqrt(2 / (3 * nis.size)))
    for source in (0, 1):       # fixes alternate: position, velocity
        settled = innovation[:, source + 120::2]
        correlation = (settled[:, 1:] * settled[:, :-1]).mean(axis=(0, 1)) / (settled ** 2).mean(axis=(0, 1))
        assert np.abs(correlation).max() < 4 / np.sqrt(settled[..., 0].size)


def test_the_band_tells_a_wrong_covariance(flight):
    for told in (0.7, 1.4):
        assert share_inside(runs(flight, FILTERS[0], told=told)[0]) < 0.8
