"""Attitude convergence from large errors: a minute of turning flight with an initial error of 170
deg about a random axis and a gyro bias error, over seeds.

The rule: a start converges when the total attitude error falls below 10 deg within 60 s and stays
there to their end. The number of starts that were below at some time is reported too, because the
error of an observer may oscillate.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording
from strapdown.data.solution import Trajectory
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import attitude_angles, errors
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import flight
from strapdown.sim.scenario import Scenario
from strapdown.sim.synthesis import Simulator
from strapdown.sim.trajectory import DEG
from strapdown.typing import Array

from ..common.runner import on_threads
from .readings import NORM
from .runs import ABLATIONS, FILTERS, STABILISED
from .xkf_as_printed import make_known

OFF, GYRO_BIAS, BELOW, WITHIN = 170 * DEG, 0.05, 10.0, 60.0
"""rad of attitude and rad/s of gyro bias at the start, each about a random direction; deg and s
of the rule."""
IMU, RATE, FIXES = "dmu10", 100.0, 0.2
"""Grade and Hz of the IMU, s between fixes."""
SEEDS = range(100)
ROWS = 10
"""Every so many samples are scored: 10 Hz."""
LATE = 30.0
"""s from which the share of the epochs below the bound is reported, which is stricter than the
state at WITHIN."""
_PLACE = (49.72 * DEG, 14.10 * DEG, 800.0)
_LEGS = (
    {"duration": 4.0},
    {"duration": 12.0, "turn": 150 * DEG},
    {"duration": 4.0, "climb": 2.0},
    {"duration": 14.0, "turn": -160 * DEG},
    {"duration": 5.0, "climb": -2.0},
    {"duration": 12.0, "turn": -120 * DEG},
    {"duration": 14.0, "turn": 150 * DEG},
)
_FIELD = (20.0e-6, 1.5e-6, 44.8e-6)  # T NED, near there
_STREAM = 170  # of the starts' directions, apart from the sensors'


class ConvergenceCase(NamedTuple):
    """A filter with its options, and whether the recording has a magnetometer."""

    filter: str
    options: dict[str, Any] = {}
    magnetometer: bool = False


CASES = {
    "NLO, magnetometer": ConvergenceCase("nlo", NORM, True),
    "NLO, library's law": ConvergenceCase("nlo"),
    **{
        label: ConvergenceCase(*each)
        for label, each in (FILTERS | ABLATIONS).items()
        if not label.endswith((STABILISED, "no course", "course frozen"))
    },
}
"""The filters that are compared, by label."""


@lru_cache(maxsize=4)
def simulator(magnetometer: bool = False, interval: float = FIXES) -> Simulator:
    """The Simulator of the flight: 45 m/s, turns of up to 50 deg of bank to both sides, a climb
    and a descent; fixes of a u-blox-class receiver."""
    motion = flight(_PLACE, 40 * DEG, 45.0, _LEGS, smoothing=1.5)
    gnss = Gnss(interval, (2.1, 2.1, 3.5), (0.1, 0.1, 0.15))
    compass = Magnetometer(rate=10.0, std=(0.5e-6,) * 3, field=_FIELD) if magnetometer else None
    return Simulator(Scenario("170 deg off", motion, WITHIN, RATE, gnss, IMU, magnetometer=compass))


def run(
    seed: int, magnetometer: bool = False, interval: float = FIXES
) -> tuple[Recording, InitialState]:
    """(Recording, InitialState) of a seed: position and velocity at the truth, attitude and gyro
    bias with errors, and standard deviations that cover them."""
    recording = simulator(magnetometer, interval).recording(IMU, np.random.default_rng(seed))
    rng, truth = np.random.default_rng([seed, _STREAM]), recording.reference
    axis, direction = (vector / np.linalg.norm(vector) for vector in rng.standard_normal((2, 3)))
    heading, pitch, roll = (Rotation.from_rotvec(OFF * axis) * truth.rotation[0]).as_euler("ZYX")
    bias = recording.meta["b_g"][0] + GYRO_BIAS * direction
    accel_std, gyro_std = imu_spec(IMU).bias_std()
    std = (
        2.1,
        2.1,
        3.5,
        0.1,
        0.1,
        0.15,
        *[OFF / 3**0.5] * 3,
        *[accel_std] * 3,
        *[float(np.hypot(gyro_std, GYRO_BIAS / 3**0.5))] * 3,
    )
    numbers = lambda values: tuple(map(float, values))
    return recording, InitialState(
        0.0,
        numbers(truth.lla[0]),
        numbers(truth.v_n[0]),
        numbers((roll, pitch, heading % (2 * np.pi))),
        (0.0,) * 3,
        numbers(bias),
        std,
        "170 deg off about a random axis",
    )


def outcome(
    case: ConvergenceCase, seed: int, interval: float = FIXES
) -> tuple[float, float, float, str, float]:
    """(s from which the attitude error stayed below the bound, inf where it did not; s at which it
    was first below; its last value in deg; said; share of the epochs from LATE on below it).

    The first three are inf for a run that stopped or cannot begin, and the fourth gives the reason;
    else it is "".
    """
    recording, start = run(seed, case.magnetometer, interval)
    try:
        solution = fuse(
            recording, case.filter, start=start, every=ROWS, estimate=[], options=case.options
        )
    except DataError as error:
        return np.inf, np.inf, np.inf, str(error), 0.0
    truth = recording.reference
    e = errors(
        solution,
        Trajectory(truth.t[::ROWS], truth.lla[::ROWS], truth.v_n[::ROWS], truth.q_nb[::ROWS]),
    )
    total = np.degrees(attitude_angles(e).total)
    if solution.meta.get("stopped") or not len(total) or not np.isfinite(total[-1]):
        return np.inf, np.inf, np.inf, solution.meta.get("stopped") or "no estimate", 0.0
    below = np.flatnonzero(total < BELOW)
    first = float(e.t[below[0]]) if len(below) else np.inf
    return settling_time(e.t, total), first, float(total[-1]), "", late_share(e.t, total)


def settling_time(t: Array, total: Array) -> float:
    """s from which the angle `total` (deg) stays below the bound to the end; inf where it does
    not."""
    above = np.flatnonzero(~(total < BELOW))
    if not len(above):
        return float(t[0])
    return float(t[above[-1] + 1]) if above[-1] + 1 < len(total) else np.inf


def late_share(t: Array, total: Array) -> float:
    """Share of the epochs from LATE on whose angle `total` (deg) is below the bound, 0 of none."""
    below = total[t > LATE] < BELOW
    return float(below.mean()) if below.size else 0.0


def study(
    cases: Mapping[str, ConvergenceCase | tuple[Any, ...]] | None = None,
    seeds: Sequence[int] = SEEDS,
    threads: int | None = None,
    interval: float = FIXES,
) -> pd.DataFrame:
    """DataFrame with a row per case and seed: case, seed, since_s, first_s, last_deg, what was
    `said` of a run that has none, and late_share."""
    known = {
        label: ConvergenceCase(*case) for label, case in (CASES if cases is None else cases).items()
    }
    rows: list[tuple[str, int, float, float, float, str, float]] = []
    make_known()
    for label, case in known.items():
        of_seed = lambda seed, case=case: outcome(case, seed, interval)
        of_seed(min(seeds))  # compiles before the threads
        found = zip(seeds, on_threads(of_seed, seeds, threads))
        rows += [(label, seed, *each) for seed, each in found]
    columns = ["case", "seed", "since_s", "first_s", "last_deg", "said", "late_share"]
    return pd.DataFrame(rows, columns=columns)


def shares(
    cases: Mapping[str, ConvergenceCase | tuple[Any, ...]] | None = None,
    seeds: Sequence[int] = SEEDS,
    threads: int | None = None,
    interval: float = FIXES,
) -> dict[str, int]:
    """{label: number of `seeds` that converge} of Cases, or tuples (filter, options,
    magnetometer), by label (default: CASES)."""
    found = study(cases, seeds, threads, interval)
    return {
        label: int(np.isfinite(part["since_s"]).sum())
        for label, part in found.groupby("case", sort=False)
    }
