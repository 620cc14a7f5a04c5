"""Simulated recordings with one fault each, and the cause that their rejected fixes are given.

`python tests/support/refused_fixes.py` prints the confusion table of docs/reference/status.md: of 20 seeds, with
which no threshold was chosen, the cause of most rejected fixes of the faulty source. Thresholds were
chosen on seeds 0 to 5.
"""

import sys
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator

RECEIVER = Gnss(0.2, (1.0, 1.0, 1.5), (0.1, 0.1, 0.1), (0.5, 0.2, -1.0))
ODOMETER = (Simulated("speed", 0.1, 10.0),)
MOTIONS = {
    "car": ("car", "consumer", 240.0, RECEIVER, ()),
    "car with odometer": ("car", "consumer", 240.0, RECEIVER, ODOMETER),
    "flight": ("demo", "industrial", 280.0, RECEIVER._replace(interval=1.0), ()),
}
"""{name: scenario, IMU, seconds, receiver, other sensors}."""
FIRST_SEED = 3000  # of the table


@cache
def _simulator(name):
    motion, imu, seconds, gnss, sensors = MOTIONS[name]
    made = scenario(motion).replace(duration=seconds, imu=imu, gnss=gnss, sensors=sensors)
    return Simulator(made)


def simulated(name, seed):
    """A Recording without a fault."""
    recording = _simulator(name).recording(MOTIONS[name][1], np.random.default_rng(seed))
    recording.meta["seed"] = seed
    return recording


def changed(recording, kind, change):
    """The recording with every source of a kind changed."""
    sources = (change(a) if a.kind == kind else a for a in recording.sources)
    return replace(recording, sources=tuple(sources))


def _moved(a, by):
    return replace(a, y=displace_lla(a.y, by))


def _sideways(rng):
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def jumping(recording, rng, stays=True):
    """Positions jump by 5 to 30 of their standard deviations, and return after 2 to 20 s or not."""
    d, begin = _sideways(rng) * rng.uniform(5, 30), rng.uniform(80, 200)
    end = np.inf if stays else begin + rng.uniform(2, 20)
    inside = lambda a: ((a.t >= begin) & (a.t < end))[:, None]
    return changed(recording, "position", lambda a: _moved(a, inside(a) * d))


def drifting(recording, rng):
    """Positions drift by 0.05 to 0.5 m/s."""
    rate, begin = _sideways(rng) * rng.uniform(0.05, 0.5), rng.uniform(60, 120)
    since = lambda a: np.maximum(a.t - begin, 0.0)[:, None]
    return changed(recording, "position", lambda a: _moved(a, since(a) * rate))


def mistimed(recording, rng, step=True):
    """The clock of the receiver is 0.1 to 1 s off, from some time on or always."""
    tau = rng.uniform(0.1, 1.0) * rng.choice([-1, 1])
    begin, truth = rng.uniform(60, 150) if step else -1.0, recording.reference

    def change(a):
        at = np.clip(np.where(a.t >= begin, a.t + tau, a.t), truth.t[0], truth.t[-1])
        of = truth.lla if a.kind == "position" else truth.v_n
        moved = [np.interp(at, truth.t, x) - np.interp(a.t, truth.t, x) for x in of.T]
        return replace(a, y=a.y + np.column_stack(moved))

    for kind in ("position", "velocity"):
        recording = changed(recording, kind, change)
    return recording


def overconfident(recording, rng, kind):
    """Standard deviations are stated 3 to 5 times too small."""
    factor = rng.uniform(3, 5)
    return changed(recording, kind, lambda a: replace(a, std=a.std / factor))


def lying_odometer(recording, rng):
    """The odometer is 3 to 10 % off."""
    scale = 1 + rng.uniform(0.03, 0.1) * rng.choice([-1, 1])
    return changed(recording, "speed", lambda a: replace(a, y=a.y * scale))


def lying_velocity(recording, rng):
    """The velocity is 0.3 to 1 m/s off."""
    bias = _sideways(rng) * rng.uniform(0.3, 1.0)
    return changed(recording, "velocity", lambda a: replace(a, y=a.y + bias))


def with_outliers(recording, rng, share=0.02):
    """So many positions are 10 to 30 standard deviations off."""

    def change(a):
        bad = rng.uniform(size=len(a.t)) < share
        errors = rng.standard_normal((len(a.t), 3)) * a.std * rng.uniform(10, 30)
        return _moved(a, errors * bad[:, None])

    return changed(recording, "position", change)


GNSS = ("GNSS position", "GNSS velocity")
FAULTS = {
    "none": (lambda recording, rng: recording, (*GNSS, "speed"), "none"),
    "jump that stays": (jumping, GNSS[:1], "jump"),
    "jump that returns": (lambda r, rng: jumping(r, rng, False), GNSS[:1], "jump"),
    "drift": (drifting, GNSS[:1], "drift"),
    "clock that steps": (mistimed, GNSS, "clock"),
    "clock off": (lambda r, rng: mistimed(r, rng, False), GNSS, "clock"),
    "std of position small": (
        lambda r, rng: overconfident(r, rng, "position"),
        GNSS[:1],
        "noise too small",
    ),
    "std of velocity small": (
        lambda r, rng: overconfident(r, rng, "velocity"),
        GNSS[1:],
        "noise too small",
    ),
    "odometer scale": (lying_odometer, (*GNSS, "speed"), "other sources disagree"),
    "velocity bias": (lying_velocity, (*GNSS, "speed"), "other sources disagree"),
    "2 % outliers": (with_outliers, GNSS[:1], "single outliers"),
}
"""{fault: what makes it, the sources that show it, the right cause}."""


def solved(name, fault, seed):
    """The Solution of a motion with a fault."""
    made = FAULTS[fault][0](simulated(name, seed), np.random.default_rng([seed, 7]))
    return sd.fuse(made)


def cause(solution, sources):
    """The cause of most rejected fixes of these sources; "none" where none were."""
    found = Counter()
    for run in solution.rejected:
        if run.source in sources:
            found[run.cause] += run.number
    return found.most_common(1)[0][0] if found else "none"


def main(first=FIRST_SEED, seeds=20):
    """Print the confusion table."""
    print("| fault | motion | right | others |\n|---|---|---|---|")
    for fault, (_, sources, right) in FAULTS.items():
        for name in MOTIONS:
            if fault == "odometer scale" and "odometer" not in name:
                continue
            found = Counter(
                cause(solved(name, fault, seed), sources) for seed in range(first, first + seeds)
            )
            good = found.pop(right, 0)
            others = ", ".join(f"{many} {what}" for what, many in found.most_common())
            print(f"| {fault} | {name} | {good} | {others} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
