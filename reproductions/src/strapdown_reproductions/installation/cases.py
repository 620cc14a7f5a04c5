"""Simulated motions with a wrong installation: each run draws clocks, lever arms, mounting and scale
from the priors, which are those of the filter too.

The receiver states its true noise and the filter knows the IMU's grade. The constraints of the car
err by what they state, as the ground makes them: so the filter's model is the simulator's.
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from strapdown.core.loop.contract import Start
from strapdown.data import Aiding
from strapdown.experiments.monte_carlo.wrong_installation import Installation, drawn, start_of
from strapdown.recording import Recording
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.simulated import Simulated
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator

CLOCK, ARM, SCALE, TWO_DEG = 0.1, 0.5, 0.02, float(np.radians(2.0))
"""Priors: s, m, of 1, rad."""
PRIORS: Installation = {"clock": CLOCK, "lever-arm": ARM}
CONSTRAINTS, CONSTRAINT_SD, CONSTRAINT_RATE = (
    ("zero-lateral-velocity", "zero-vertical-velocity"),
    0.1,  # m/s
    10.0,  # Hz
)
KNOWN, ALIGNED = "known start", "own alignment"
"""Where a filter begins: at the truth less an error drawn from what the Start states, or as `fuse`
finds it from the wrongly installed recording itself."""


class Simulation(NamedTuple):
    """What is simulated, and what is wrong with it."""

    scenario: str
    stop: float  # s
    gnss: Gnss
    priors: Installation = PRIORS
    sensors: tuple[Simulated, ...] = ()
    constrained: bool = False
    # of these parameters the motion shows nothing: beginnings of their columns
    hidden: tuple[str, ...] = ()


RECEIVER = Gnss(0.2, (1.0, 1.0, 1.5), (0.1, 0.1, 0.1), (0.5, 0.2, -1.0))
ODOMETER = (Simulated("speed", 0.1, 10.0),)
OF_CAR: Installation = {**PRIORS, "mounting": (0.0, TWO_DEG, TWO_DEG), "scale": SCALE}
MOTIONS = {
    "car": Simulation("car", 330.0, RECEIVER),
    "car with odometer": Simulation("car", 330.0, RECEIVER, OF_CAR, ODOMETER, True),
    "flight": Simulation(
        "demo",
        400.0,
        RECEIVER._replace(interval=1.0, lever_arm=(0.4, 0.0, -1.1)),
        sensors=(Simulated("altitude", 2.0, 1.0),),
    ),
    "ship": Simulation(
        "ship", 620.0, RECEIVER._replace(interval=1.0, lever_arm=(-5.0, 0.5, -12.0))
    ),
}
"""Motions that show what is asked of them."""
UNSEEN = {
    "straight flight": Simulation(
        "straight", 300.0, RECEIVER._replace(interval=1.0), hidden=("clock", "lever arm")
    ),
    "car, roll of the mounting": Simulation(
        "car",
        330.0,
        RECEIVER,
        {**OF_CAR, "mounting": (TWO_DEG,) * 3},
        ODOMETER,
        True,
        hidden=("mounting roll",),
    ),
}
"""Motions with parameters that nothing in them shows, as long as nobody knows where they begin."""
IMU = "industrial"


class Case(NamedTuple):
    """A run."""

    recording: Recording  # wrongly installed
    right: Recording  # as it is
    start: Start | None  # None: the filter's own alignment
    right_start: Start | None
    true: dict[str, float]  # {column of a Solution: true value}
    priors: Installation


def simulation(name: str) -> Simulation:
    """The Simulation of that name."""
    return (MOTIONS | UNSEEN)[name]


@cache
def _simulator(name: str) -> Simulator:
    motion = simulation(name)
    return Simulator(
        scenario(motion.scenario).replace(
            duration=motion.stop, imu=IMU, gnss=motion.gnss, sensors=motion.sensors
        )
    )


def case(name: str, seed: int, start: str) -> Case:
    """The Case of a motion and a seed; start: KNOWN or ALIGNED."""
    motion, sequence = simulation(name), np.random.SeedSequence(seed)
    right, at = _simulator(name).run(IMU, sequence)
    rng = np.random.default_rng([seed, 1])
    if motion.constrained:
        right = replace(right, aidings=(*right.aidings, *constraints(right, rng)))
    installed = drawn(right, motion.priors, np.random.default_rng([seed, 2]))
    known = start == KNOWN
    return Case(
        installed.recording,
        right,
        start_of(installed, at) if known else None,
        at if known else None,
        installed.true,
        motion.priors,
    )


def constraints(recording: Recording, rng: np.random.Generator) -> list[Aiding]:
    """Lateral and vertical velocity of a car, which slips and rocks by what it states."""
    t = np.arange(recording.span[0] + 1.0, recording.span[1], 1 / CONSTRAINT_RATE)
    sd = np.full((len(t), 1), CONSTRAINT_SD)
    return [
        Aiding(kind, t, sd * rng.standard_normal(sd.shape), sd, (0.0, 0.0, 0.0))
        for kind in CONSTRAINTS
    ]
