"""Whether starts are as good as they say: `python tests/support/start_honesty.py [SEEDS]` prints a table
of normalised start errors of simulated cars, walkers and flights.

The constants of the alignment were chosen on seeds from 1000 on.
"""

import sys
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import strapdown as sd
from strapdown.engine.heading_hypotheses import align_start
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion, ramp, static

LLA = (DEG * 50, DEG * 7, 150.0)
PARTS = {
    "velocity": slice(3, 6),
    "roll, pitch": slice(6, 8),
    "heading": slice(8, 9),
    "gyro bias": slice(12, 15),
}
FALSE_ALARMS = 1e-3  # share of the entries of the table that exceed their bound by chance


class Case(NamedTuple):
    """A simulated motion of random course, and what is expected of its start."""

    says: str  # what its note must say
    seconds: float
    motion: object  # random generator -> Motion
    gnss: Gnss
    imu: str = "industrial"
    at: float | None = None


def car(rng, speed, stands=0.0, crab=0.0, stops=None):
    """Stands, leaves, winds along; its nose points `crab` (standard deviation, rad) off its course."""
    course, off, phase = rng.uniform(0, 2 * np.pi), crab * rng.normal(), rng.uniform(0, 6)
    tilt = 0.04 * rng.normal(size=2)
    v = lambda t: (
        speed
        * (ramp(t, stands + 3, 1.0) if stands else 1.0)
        * (1 - ramp(t, stops, 1.0) if stops else 1.0)
        * (1 + 0.15 * np.sin(0.4 * t + phase))
    )
    psi = lambda t: course + 40 * DEG * np.sin(0.16 * (t - stands)) * ramp(t, stands + 6, 2.0)
    return Motion(
        "car",
        LLA,
        lambda t: (v(t) * np.cos(psi(t)), v(t) * np.sin(psi(t)), 0 * t),
        lambda t: (tilt[0] + 0 * t, tilt[1] + 0 * t, psi(t) + off),
    )


def walker(rng, stands=0.0):
    """Carries the IMU in a hand, at any heading to where it goes."""
    course, off, phase = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi), rng.uniform(0, 6, 6)
    begun = (lambda t: ramp(t, stands + 1, 0.4)) if stands else (lambda t: 1.0 + 0 * t)
    psi = lambda t: course + 0.7 * np.sin(0.11 * t + phase[0]) * begun(t)
    v = lambda t: begun(t) * (1.3 + 0.2 * np.sin(2 * np.pi * 1.9 * t + phase[1]))
    sway = lambda t: begun(t) * 0.15 * np.sin(2 * np.pi * 0.95 * t + phase[2])
    return Motion(
        "walker",
        LLA,
        lambda t: (
            v(t) * np.cos(psi(t)) - sway(t) * np.sin(psi(t)),
            v(t) * np.sin(psi(t)) + sway(t) * np.cos(psi(t)),
            begun(t) * 0.3 * np.sin(2 * np.pi * 1.9 * t + phase[3]),
        ),
        lambda t: (
            0.3 + begun(t) * 0.1 * np.sin(2 * np.pi * 0.95 * t + phase[4]),
            0.5 + begun(t) * 0.1 * np.sin(2 * np.pi * 0.4 * t + phase[5]),
            psi(t) + off + begun(t) * 0.1 * np.sin(2 * np.pi * 0.95 * t),
        ),
    )


def rest(rng):
    """Stands, at any heading."""
    return static(LLA, (0.02, 0.03, rng.uniform(0, 2 * np.pi)))


def straight(rng):
    """1 m/s straight on, without anything that tells the heading but the course."""
    course, off = rng.uniform(0, 2 * np.pi), 15 * DEG * rng.normal()
    return Motion(
        "straight",
        LLA,
        lambda t: (np.cos(course) + 0 * t, np.sin(course) + 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, course + off + 0 * t),
    )


def hovering(rng):
    """A multicopter that drifts to and fro, its nose anywhere."""
    off, phase = rng.uniform(0, 2 * np.pi), rng.uniform(0, 6, 5)
    return Motion(
        "hovering",
        LLA,
        lambda t: (
            1.5 * np.sin(0.5 * t + phase[0]),
            1.2 * np.sin(0.37 * t + phase[1]),
            0.3 * np.sin(0.6 * t + phase[2]),
        ),
        lambda t: (
            -0.1 * np.sin(0.5 * t + phase[3]),
            0.1 * np.sin(0.37 * t + phase[4]),
            off + 0.3 * np.sin(0.2 * t),
        ),
    )


def flight(rng):
    """Turns at 25 m/s, with a crab of 15 deg."""
    course, crab, phase = rng.uniform(0, 2 * np.pi), 15 * DEG * rng.normal(), rng.uniform(0, 6)
    psi = lambda t: course + 0.8 * np.sin(0.12 * t + phase)
    bank = lambda t: np.arctan(25 * 0.8 * 0.12 / 9.81 * np.cos(0.12 * t + phase))
    return Motion(
        "flight",
        LLA,
        lambda t: (25 * np.cos(psi(t)), 25 * np.sin(psi(t)), 0.5 * np.sin(0.3 * t)),
        lambda t: (bank(t), 0.05 + 0 * t, psi(t) + crab),
    )


FINE, COARSE = Gnss(0.2, 1.5, 0.1), Gnss(1.0, 2.0, None)
CASES = {
    "car, fast": Case("course", 60.0, lambda rng: car(rng, 15.0, 12.0, 5 * DEG), FINE),
    "car, positions alone": Case("course", 60.0, lambda rng: car(rng, 15.0, 12.0, 5 * DEG), COARSE),
    "car, 2 m/s": Case("trying", 80.0, lambda rng: car(rng, 2.0, 12.0, 5 * DEG), FINE),
    "car, from rest": Case("course", 80.0, lambda rng: car(rng, 8.0, 25.0, 5 * DEG), FINE, at=5.0),
    "car, rest later": Case(
        "later", 60.0, lambda rng: car(rng, 12.0, 0.0, 5 * DEG, stops=35.0), FINE, at=10.0
    ),
    "walker": Case("trying", 80.0, walker, FINE),
    "walker, after rest": Case("trying", 80.0, lambda rng: walker(rng, 10.0), FINE),
    "walker, positions alone": Case("headings", 80.0, lambda rng: walker(rng, 10.0), COARSE),
    "hovering": Case("trying", 80.0, hovering, FINE),
    "hovering, RTK": Case("trying", 80.0, hovering, Gnss(0.2, 0.02, 0.03)),
    "hovering, latency 0.1 s": Case("trying", 80.0, hovering, Gnss(0.2, 1.5, 0.1, latency=0.1)),
    "hovering, consumer": Case("trying", 80.0, hovering, FINE, "consumer"),
    "straight, 1 m/s": Case("headings", 80.0, straight, FINE),
    "turning on the spot": Case("headings", 80.0, lambda rng: car(rng, 0.0), Gnss(0.2, 10.0, None)),
    "rest, noisy positions": Case("heading unknown", 80.0, rest, Gnss(0.2, 10.0, None)),
    "flight": Case("course", 60.0, flight, FINE),
    "flight, consumer": Case("course", 60.0, flight, FINE, "consumer"),
}


def normalised(case, seed):
    """(15,) errors of the start of that seed in its own standard deviations, its note, and its std."""
    motion = case.motion(np.random.default_rng([seed, 77]))
    recording = sd.simulate(motion, case.seconds, case.imu, seed, 50.0, case.gnss)
    seen = recording if case.at is None else recording.between(case.at)
    start = align_start(seen, sd.imu(case.imu))
    truth = recording.reference
    row = int(np.argmin(np.abs(truth.t - start.t)))
    turn = truth.rotation[row] * Rotation.from_euler("ZYX", start.rph[::-1]).inv()
    error = np.concatenate(
        [
            displacement(truth.lla[row], np.array(start.lla)),
            truth.v_n[row] - start.v_n,
            turn.as_rotvec(),
            recording.meta["b_a"][max(row - 1, 0)] - start.b_a,
            recording.meta["b_g"][max(row - 1, 0)] - start.b_g,
        ]
    )
    return error / start.std, start.note, start.std


def bound(seeds):
    """The mean square of so many independent errors that honest standard deviations let pass but
    once in 1 / FALSE_ALARMS.

    Those of one start may all hang together: each seed counts as one.
    """
    return float(chi2.ppf(1 - FALSE_ALARMS, seeds) / seeds)


def table(names, seeds):
    """{case: ({part: mean square}, share of notes that say what they should, median std of heading
    in deg)}."""
    rows = {}
    for name in names:
        z, notes, stds = zip(*(normalised(CASES[name], seed) for seed in seeds))
        rows[name] = (
            {part: float(np.mean(np.array(z)[:, columns] ** 2)) for part, columns in PARTS.items()},
            float(np.mean([CASES[name].says in note for note in notes])),
            float(np.degrees(np.median([each[8] for each in stds]))),
        )
    return rows


if __name__ == "__main__":
    seeds = range(1, 1 + (int(sys.argv[1]) if len(sys.argv) > 1 else 100))
    print(f"mean squares of normalised errors over {len(seeds)} seeds")
    print(f"{'':24}" + "".join(f"{part:>13}" for part in PARTS) + "   note  std of heading, deg")
    for name in sys.argv[2:] or CASES:
        squares, says, heading_std = table([name], seeds)[name]
        line = "".join(f"{value:13.2f}" for value in squares.values())
        print(f"{name:24}{line}{says:7.0%}{heading_std:9.1f}", flush=True)
    print(f"honest ones stay below {bound(len(seeds)):.2f} but for one in {1 / FALSE_ALARMS:.0f}")
