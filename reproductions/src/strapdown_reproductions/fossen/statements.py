"""Statements of the chapter besides its case studies: the static attitude in a turn, stability of the
attitude observer and of the fixed-gain observer, the covariance of a unit quaternion, what an observer
costs, and the observer with a reference by GNSS velocity on a recorded flight.

Each is a table of its own, with a row for each trial; the rules are in claims.py.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TypeAlias

import numpy as np
import pandas as pd
from scipy.linalg import expm

from strapdown import io
from strapdown.alignment.static_attitude import static_attitude
from strapdown.checks import DataError
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors
from strapdown.filters.ahrs_aided.fixed_gain import fastest_turn
from strapdown.sim.trajectory import Motion, records
from strapdown.typing import Array

from ..common.example_recordings import DESCRIPTIONS
from . import cases, signals
from .force_observer import FORCE_OBSERVER

Tables: TypeAlias = dict[str, pd.DataFrame]
STATIC, STABILITY, GAINS, QUATERNION, COST, FLIGHT = (
    "static",
    "stability",
    "gains",
    "quaternion",
    "cost",
    "flight",
)
"""Names of the tables."""
DEGREES = float(np.degrees(1.0))
EVERY = 20
"""Samples from one static attitude to the next."""
SPEED, RATE = 30.0, 0.2
"""m/s and rad/s of a coordinated turn: 6 m/s^2 across, banked by 31 deg."""
STARTS = (30.0, 90.0, 150.0, 170.0)
"""deg: how far off, about a random axis, the attitude observer begins."""
FIELDS = ("projected", "whole")
"""The field as a reference vector: across the vertical, as in the slides, or as in quatObserver.m."""
SETTLING = 300.0
"""s that the fixed-gain observer has."""
OBSERVED, STEP = 600.0, 0.1
"""s that the attitude observer has, and of a step: ten time constants of its slowest pole, which is that
about the axis between the vertical and a field that dips by 75 deg."""
GAIN_SETS = 40
"""Random sets of gains of the fixed-gain observer for each seed."""
REPEATS, TIMED = 15, 300.0
"""Pairs of timed runs, and s of each."""
RECORDED = (200.0, 600.0)
"""s of the recorded flight, thor75, from before the launch to behind the landing."""
BLOCK = 20.0
"""s of it that count as one trial."""
REFERENCES = ("gnss", "gravity")


def all_tables(seeds: Sequence[int], folder: Path | None = None) -> Tables:
    """{name: table} of all; folder: of the descriptions of recordings, that of the source tree by
    default. The table of a flight that is not there is empty."""
    return {
        STATIC: static(),
        STABILITY: stability(seeds),
        GAINS: gains(seeds),
        QUATERNION: quaternion(seeds),
        COST: cost(),
        FLIGHT: flight(folder),
    }


def turn() -> Motion:
    """A coordinated turn of SPEED and RATE."""
    bank = float(np.arctan(SPEED * RATE / 9.82))
    return Motion(
        "coordinated turn",
        signals.TRONDHEIM,
        lambda t: (SPEED * np.cos(RATE * t), SPEED * np.sin(RATE * t), 0 * t),
        lambda t: (bank + 0 * t, 0 * t, RATE * t),
    )


def static() -> pd.DataFrame:
    """A row per motion: rms acceleration (m/s^2) and rms error of roll and pitch (deg) that the static
    mapping makes of the specific force of an ideal accelerometer."""
    motions = {
        name: signals.ideal(name, 100.0, 60.0) for name in ("at rest", "steady", *signals.SIGNALS)
    }
    motions["coordinated turn"] = signals.Ideal(*records(turn(), np.arange(6001) / 100.0))
    rows = []
    for name, (truth, imu) in motions.items():
        found = np.array([static_attitude(f)[:2] for f in (imu.dv / imu.dt[:, None])[::EVERY]])
        off = found - 0.5 * (truth.rph[1:, :2] + truth.rph[:-1, :2])[::EVERY]
        acceleration = np.diff(truth.v_n, axis=0) / imu.dt[:, None]
        rows.append((name, _rms(acceleration), _rms(off) * DEGREES))
    return pd.DataFrame(rows, columns=["motion", "acceleration_m_s2", "tilt_deg"])


def _rms(vectors: Array) -> float:
    """Root of the mean square of the lengths of vectors (n, k)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def stability(seeds: Sequence[int]) -> pd.DataFrame:
    """A row per field, start and seed: how far off (deg) the printed attitude observer (14.2.3,
    quatObserver.m) is after OBSERVED, of a body at rest without noise, from a start that is off by STARTS
    about a random axis and with the gyro bias of the case study unknown."""
    g = np.array([0.0, 0.0, -1.0])
    axes = np.array([np.random.default_rng([seed, 14]).standard_normal(3) for seed in seeds])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    rows = []
    for field in FIELDS:
        m = np.array(signals.FIELD)
        m = m - (m @ g) * g if field == "projected" else m
        for start in STARTS:
            off = observer(_exp(axes * start / DEGREES), m / np.linalg.norm(m))
            rows += [(field, start, seed, each) for seed, each in zip(seeds, off)]
    return pd.DataFrame(rows, columns=["field", "start_deg", "seed", "off_deg"])


def observer(C: Array, m: Array) -> Array:
    """(n,) deg: how far off the observer is from starts C (n, 3, 3), where the truth is the identity;
    m: reference vector of the field."""
    gain = cases.OBSERVER_GAINS
    true, bias = np.array(signals.GYRO_BIAS), np.zeros((len(C), 3))
    for _ in range(round(OBSERVED / STEP)):
        sigma = sum(
            k * np.cross(v, np.einsum("nji,j->ni", C, v))
            for k, v in ((gain["k1"], np.array([0.0, 0.0, -1.0])), (gain["k2"], m))
        )
        C = C @ _exp(STEP * (true - bias + sigma))
        bias = bias - STEP * gain["ki"] * sigma
    cosine = np.clip(0.5 * (np.trace(C, axis1=1, axis2=2) - 1), -1.0, 1.0)
    return np.arccos(cosine) * DEGREES


def _exp(a: Array) -> Array:
    """(n, 3, 3) rotation matrices of rotation vectors (n, 3)."""
    angle = np.maximum(np.linalg.norm(a, axis=1), 1e-12)[:, None, None]
    S = np.cross(np.eye(3), a[:, None, :])
    return np.eye(3) + np.sin(angle) / angle * S + (1 - np.cos(angle)) / angle**2 * S @ S


def gains(seeds: Sequence[int]) -> pd.DataFrame:
    """A row per seed and random set of gains (k1, k2, k3 of an axis, each over three decades) of the
    fixed-gain observer: whether F is Hurwitz, which part of an error is left after SETTLING, and the
    largest real part (1/s) of the poles in a steady turn twice as fast as `fastest_turn` allows."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 15])
        for own in np.exp(rng.uniform(np.log(1e-3), 0.0, (GAIN_SETS, 3))):
            k1, k2, k3 = map(float, own)
            # settled within the run, or surely not
            F = error_dynamics(k1, k2, k3)
            poles = np.linalg.eigvals(F).real.max()
            if abs(poles) * SETTLING < 10:
                continue
            begun = rng.standard_normal(3) * (1.0, 0.1, 0.01)
            left = np.linalg.norm(expm(F * SETTLING) @ begun) / np.linalg.norm(begun)
            turning = np.nan
            if poles < 0:
                turned = error_dynamics(k1, k2, k3, 2 * fastest_turn(k1, k2, k3))
                turning = np.linalg.eigvals(turned).real.max()
            rows.append((seed, poles < 0, left, turning))
    return pd.DataFrame(rows, columns=["seed", "hurwitz", "left", "turning_1_s"])


def error_dynamics(k1: float, k2: float, k3: float, turn_rate: float = 0.0) -> Array:
    """F of the errors of position, velocity and bias of the fixed-gain observer (14.3.1): of one axis
    (3, 3), or in a steady turn of both horizontal ones as one complex axis, seen from the body."""
    F = np.array([[-k1, 1, 0], [-k2, 0, -1], [k3, 0, 0]], complex if turn_rate else float)
    if turn_rate:  # position and velocity turn against the body, the bias with it
        F[0, 0] -= 1j * turn_rate
        F[1, 1] -= 1j * turn_rate
    return F


def quaternion(seeds: Sequence[int]) -> pd.DataFrame:
    """A row per seed: smallest eigenvalue of the covariance of a unit quaternion over its largest, and
    how far the length leaves 1 by adding a correction of 0.1 rad to it."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 16])
        w, x, y, z = q = rng.standard_normal(4)
        q, size = q / np.linalg.norm(q), np.linalg.norm(q)
        Xi = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / size
        L = rng.standard_normal((3, 3))
        eigenvalues = np.linalg.eigvalsh(0.25 * Xi @ L @ L.T @ Xi.T)
        axis = rng.standard_normal(3)
        added = q + 0.5 * Xi @ (0.1 * axis / np.linalg.norm(axis))
        rows.append((seed, abs(eigenvalues[0]) / eigenvalues[-1], abs(np.linalg.norm(added) - 1)))
    return pd.DataFrame(rows, columns=["seed", "smallest", "length"]).assign(all="all")


def cost() -> pd.DataFrame:
    """A row per pair of runs, one after the other: µs for a sample that the MEKF and the attitude
    observer take on the same field at 100 Hz and fixes at 5 Hz, and the ratio of the two."""
    recording = signals.recording("signal 1", 0, duration=TIMED)
    of = {case.name: case for case in cases.CASES}
    pair = of["mekf, position + field"], of["observer, reference by gravity"]
    begin, used = (
        cases.start(recording, cases.RIGHT, 0),
        [cases.select_sources(recording, case, cases.RIGHT) for case in pair],
    )
    rows = []
    for repeat in range(REPEATS + 1):
        times = []
        for case, own in zip(pair, used):
            begun, noise = perf_counter(), cases.noise(case, cases.RIGHT, "signal 1")
            fuse(own, case.value, start=begin, noise=noise, every=100, options=dict(case.options))
            times.append((perf_counter() - begun) / len(recording.imu.t) * 1e6)
        if repeat:  # the first pair compiles
            rows.append((repeat, *times, times[0] / times[1]))
    return pd.DataFrame(rows, columns=["repeat", "mekf_us", "observer_us", "ratio"]).assign(
        all="all"
    )


def flight(folder: Path | None = None) -> pd.DataFrame:
    """A row per second of thor75 from RECORDED that its reference covers: how far the attitude
    observer is off in tilt, by either reference vector (deg, root of the mean of the squares of both
    axes), at the gains that it has by default. Empty where the recording is not there."""
    try:
        whole = io.read((folder or DESCRIPTIONS) / "thor75-full.toml")
    except DataError:
        return pd.DataFrame()
    recording, found = whole.between(*RECORDED), dict[str, Array]()
    for reference in REFERENCES:
        solution = fuse(recording, FORCE_OBSERVER, options={"reference": reference})
        e = errors(solution, recording.reference)
        found["t"], found[reference] = e.t, np.sum(e.attitude[:, :2] ** 2, axis=1) / 2
    squares = pd.DataFrame(found).dropna()
    seconds = squares.groupby(np.floor(squares["t"]).astype(int)).mean()
    return pd.DataFrame(
        {
            "second": seconds.index,
            "block": (seconds.index // BLOCK).astype(int),
            **{f"{name}_deg": np.sqrt(seconds[name].to_numpy()) * DEGREES for name in REFERENCES},
        }
    )


def flight_rms(table: pd.DataFrame) -> Mapping[str, float]:
    """{reference vector: rms tilt over the flight, deg}; NaN without one."""
    return {
        name: float(np.sqrt(np.mean(table[f"{name}_deg"] ** 2))) if len(table) else np.nan
        for name in REFERENCES
    }
