"""Simulated drives and flights with a receiver of known errors, and how well a solution of them does.

The filter knows IMU and receiver as they are, but for what a figure is about. Seeds are counted from
the first; none is left out.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.evaluation.metrics import errors
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec, imu as imu_spec
from strapdown.sim.synthesis import simulate
from strapdown.typing import Array

SETTLED = 60.0
"""s of a run that are not scored."""


class NoiseWorld(NamedTuple):
    """A simulated world: scenario, duration, rate, IMU grade and receiver."""

    scenario: str
    duration: float  # s
    rate: float  # Hz
    grade: str
    gnss: Gnss


RECEIVER = Gnss(1.0, (1.5, 1.5, 2.5), (0.1, 0.1, 0.15))
CAR, FLIGHT = "car", "flight"
WORLDS = {
    CAR: NoiseWorld("car", 300.0, 50.0, "consumer", RECEIVER._replace(interval=0.2)),
    FLIGHT: NoiseWorld("demo", 400.0, 50.0, "tactical", RECEIVER),
}


def record_world(name: str, seed: int, gnss: Gnss | None = None) -> Recording:
    """A run of a world, with another receiver where one is given."""
    world = WORLDS[name]
    made = simulate(
        world.scenario, world.duration, world.grade, seed, world.rate, gnss or world.gnss
    )
    return replace(made, sources=tuple(a for a in made.sources if a.kind in GNSS_KINDS))


GNSS_KINDS = ("position", "velocity")


def imu_stated(name: str, factor: float) -> ImuSpec:
    """Return the IMU of a world with its stated noise multiplied by `factor`."""
    spec = imu_spec(WORLDS[name].grade)
    return replace(
        spec, gyro=_noise_times(spec.gyro, factor), accel=_noise_times(spec.accel, factor)
    )


def _noise_times(triad: Triad, factor: float) -> Triad:
    """Scale white noise and bias drive by `factor`; constant errors stay."""
    parts = ("noise", "bias_walk", "flicker", "gauss_markov")
    return replace(triad, **{part: factor * getattr(triad, part) for part in parts})


def fixes_stated(recording: Recording, factor: float) -> Recording:
    """Return the recording with the standard deviations of its fixes multiplied by `factor`."""
    return replace(
        recording, sources=tuple(replace(a, std=a.std * factor) for a in recording.sources)
    )


class WorldScore(NamedTuple):
    """Sums of squares over the rows of a run, a row a second, m^2 of north and east."""

    rows: int
    error: float
    claimed: float


def score(solution: Solution, recording: Recording) -> WorldScore:
    """Count, and sums of squares of the horizontal error and of its claimed standard deviation, m^2."""
    found = errors(solution, recording.reference)
    second = np.abs(found.t - np.round(found.t)) < 0.25 / WORLDS[CAR].rate
    rows = second & (found.t > solution.t[0] + SETTLED)
    assert found.std is not None
    e, std = found.position[rows, :2], found.std[rows, :2]
    return WorldScore(2 * len(e), float(np.sum(e**2)), float(np.sum(std**2)))


def nis_over_expected(solution: Solution) -> Array:
    """(m,) the NIS of each fix after SETTLED over the median of its chi-square."""
    i = solution.innovations
    rows = np.isfinite(i.innovation).sum(axis=1)
    late = (i.t > solution.t[0] + SETTLED) & np.isfinite(i.nis)
    return np.asarray(i.nis[late] / chi2.median(rows[late]))
