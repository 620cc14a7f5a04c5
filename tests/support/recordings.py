"""Short recordings for the tests of the loop: a turning flight of a few hundred samples, and one
whose increments are all alike."""

from dataclasses import replace
from functools import cache

import numpy as np

import strapdown as sd
from strapdown import filters
from strapdown.core.compile.jit import COMPILED
from strapdown.core.loop.contract import Imu, InitialState
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine.stream import Measurement, Sample
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion

STD = (2.0, 2.0, 2.0, 0.2, 0.2, 0.2, 0.005, 0.005, 0.02, 0.01, 0.01, 0.01, 3e-5, 3e-5, 3e-5)
"""Standard deviations of the starts."""
OPTIONS = {"pkf": {"components": 3}}
"""Options of filters in the tests that run all of them: few components where the default number
would take a minute without the compiler."""

SWIFT = [name for name in filters.names() if COMPILED or name not in ("ukf", "ckf")]
"""Filters for the tests that run all of them: without the compiler not those whose steps then
take 5 ms, which tests/filters/sigma_point/test_ukf.py runs."""


def turning(lla=(DEG * 47.0, DEG * 8.0, 500.0)):
    """A banked turn of 4 deg/s at 30 m/s with a slow climb."""
    course = lambda t: DEG * (80 + 4 * t)
    bank = np.arctan(30 * DEG * 4 / 9.81)
    return Motion(
        "turning",
        lla,
        lambda t: (30 * np.cos(course(t)), 30 * np.sin(course(t)), -1.0 + 0 * t),
        lambda t: (bank + 0 * t, 0.03 + 0 * t, course(t)),
    )


@cache
def flight(
    seconds=20.0,
    rate=20.0,
    seed=3,
    gnss=Gnss(lever_arm=(0.3, -0.2, -0.5)),
    lla=(DEG * 47.0, DEG * 8.0, 500.0),
):
    """A simulated Recording with position and velocity fixes once a second; 400 samples by
    default."""
    return sd.simulate(turning(lla), seconds, "tactical", seed, rate, gnss)


def start(recording, t=0.0):
    """An InitialState at the truth of a simulated flight, a little off."""
    truth = recording.reference
    row = int(np.argmin(np.abs(truth.t - t)))
    roll, pitch, heading = truth.rph[row]
    return InitialState(
        float(truth.t[row]),
        tuple(truth.lla[row] + [1e-7, -1e-7, 1.0]),
        tuple(truth.v_n[row] + [0.1, -0.1, 0.1]),
        (roll + 0.003, pitch - 0.003, heading + 0.01),
        (0.0,) * 3,
        (0.0,) * 3,
        STD,
    )


@cache
def alike(seconds=10.0, rate=20.0):
    """(Recording without fixes, Start): every sample the same rotation and force, so that a
    sample split by hand is exactly a part of one."""
    n, dt = round(seconds * rate), 1 / rate
    imu = Imu(
        dt * np.arange(1, n + 1),
        np.full(n, dt),
        np.tile([0.002, -0.001, 0.005], (n, 1)),
        np.tile([0.01, 0.02, -9.8 * dt], (n, 1)),
    )
    return Recording(imu, meta={"grade": "tactical"}), InitialState(
        0.0, (0.8, 0.2, 300.0), (10.0, 5.0, 0.0), (0.05, 0.02, 1.0), (0.0,) * 3, (0.0,) * 3, STD
    )


def position(t, lla=(0.8, 0.2, 300.0), deviation=1.0, gate=np.inf, **more):
    """Position fixes at the times `t`, all at `lla` or each at its row of it, without a gate."""
    t = np.atleast_1d(np.asarray(t, float))
    return Source(
        "position",
        t,
        np.tile(lla, (len(t), 1)) if np.ndim(lla) == 1 else np.array(lla),
        np.full((len(t), 3), deviation),
        gate=gate,
        **more,
    )


def at_rest(seconds=40.0, rate=20.0):
    """A level IMU that stands for so long, with position fixes and nothing that tells its heading."""
    n = round(seconds * rate)
    t, f = np.arange(1, n + 1) / rate, np.tile([0.0, 0.0, -9.81 / rate], (n, 1))
    noise = 1e-4 * np.random.default_rng(1004).standard_normal((2, n, 3))
    imu = Imu(t, np.full(n, 1 / rate), 1e-2 * noise[0], f + noise[1])
    moments = np.arange(1.0, seconds)
    y = np.tile([0.8, 0.2, 300.0], (len(moments), 1))
    fixes = Source("position", moments, y, np.ones_like(y))
    return Recording(imu, (fixes,), meta={"grade": "tactical"})


def ahrs(truth, rate=1.0, deviation=(0.2, 0.2, 0.5), seed=7, **more):
    """Attitude records of a Trajectory at `rate` (Hz) with white errors about forward, right and
    down (deg); seed: number or numpy Generator."""
    made = Ahrs(rate, tuple(np.radians(deviation))).measure(truth, np.random.default_rng(seed))
    return replace(made, name="ahrs", **more)


def without_samples(recording, *windows):
    """The recording whose samples that end within a window (start, stop] (s) are missing."""
    imu = recording.imu
    keep = np.ones(len(imu.t), bool)
    for begin, end in windows:
        keep &= (imu.t <= begin + 1e-9) | (imu.t > end + 1e-9)
    return replace(recording, imu=Imu(*(column[keep] for column in imu)))


def events_of(recording):
    """All samples and fixes in time order, a fix before the sample that ends with it."""
    imu = recording.imu
    samples = [
        Sample(t, dt, tuple(a), tuple(b))
        for t, dt, a, b in zip(
            imu.t.tolist(), imu.dt.tolist(), imu.dtheta.tolist(), imu.dv.tolist()
        )
    ]
    fixes = [
        Measurement(t, k, tuple(y), tuple(d))
        for k, a in enumerate(recording.sources)
        for t, y, d in zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
    ]
    return sorted(samples + fixes, key=lambda event: (event.t, type(event) is Sample))


def split(recording, row, share):
    """The recording whose sample `row` is given as two, of `share` and 1 - share of it."""
    imu = recording.imu
    parts = [
        np.concatenate(
            [column[:row], [share * column[row], (1 - share) * column[row]], column[row + 1 :]]
        )
        for column in imu[1:]
    ]
    cut = imu.t[row] - (1 - share) * imu.dt[row]
    return replace(recording, imu=Imu(np.concatenate([imu.t[:row], [cut], imu.t[row:]]), *parts))


def rows(solution):
    """Everything a Solution says of its rows, as one table."""
    path = solution.trajectory
    return np.c_[
        path.t,
        path.lla,
        path.v_n,
        path.q_nb,
        solution.b_a,
        solution.b_g,
        path.std,
        solution.status,
        *solution.columns.values(),
    ]


def said(solution, *words):
    """[(t, text)] of the events that hold one of these words."""
    return [(t, text) for t, text in solution.events if any(word in text for word in words)]


def same(first, second):
    """Whether two Solutions are equal bit for bit."""
    a, b = (
        [getattr(s.innovations, name) for name in ("t", "source", "innovation", "nis", "accepted")]
        for s in (first, second)
    )
    return first.events == second.events and all(
        np.array_equal(x, y, equal_nan=True) for x, y in zip([rows(first), *a], [rows(second), *b])
    )
