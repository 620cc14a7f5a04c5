"""Simulated motions with a wrong installation: each run draws clocks, lever arms, mounting and scale
from the priors, which are those of the filter too.

The receiver states its true noise and the filter knows the IMU's grade. The constraints of the car
err by what they state, as the ground makes them: so the filter's model is the simulator's.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording
from strapdown.experiments.monte_carlo.wrong_installation import (
    Installation,
    draw_installation,
    start_of,
)

from ..common.motions import (
    HEIGHT,
    ODOMETER,
    ON_MAST,
    ON_WING,
    RECEIVER,
    StudyMotion,
    constraints,
    simulator,
)

CLOCK, ARM, SCALE, TWO_DEG = 0.1, 0.5, 0.02, float(np.radians(2.0))
"""Priors: s, m, of 1, rad."""
PRIORS: Installation = {"clock": CLOCK, "lever-arm": ARM}
KNOWN, ALIGNED = "known start", "own alignment"
"""Where a filter begins: at the truth less an error drawn from what the InitialState states, or as `fuse`
finds it from the wrongly installed recording itself."""


class Simulation(NamedTuple):
    """A motion, and what is wrong with its installation."""

    motion: StudyMotion
    priors: Installation = PRIORS
    # of these parameters the motion shows nothing: beginnings of their columns
    hidden: tuple[str, ...] = ()


OF_CAR: Installation = {**PRIORS, "mounting": (0.0, TWO_DEG, TWO_DEG), "scale": SCALE}
WITH_ODOMETER = StudyMotion("car", 330.0, sensors=ODOMETER, constrained=True)
MOTIONS = {
    "car": Simulation(StudyMotion("car", 330.0)),
    "car with odometer": Simulation(WITH_ODOMETER, OF_CAR),
    "flight": Simulation(StudyMotion("demo", 400.0, ON_WING, sensors=HEIGHT)),
    "ship": Simulation(StudyMotion("ship", 620.0, ON_MAST)),
}
"""Motions that show what is asked of them."""
UNSEEN = {
    "straight flight": Simulation(
        StudyMotion("straight", 300.0, RECEIVER._replace(interval=1.0)),
        hidden=("clock", "lever arm"),
    ),
    "car, roll of the mounting": Simulation(
        WITH_ODOMETER, {**OF_CAR, "mounting": (TWO_DEG,) * 3}, hidden=("mounting roll",)
    ),
}
"""Motions with parameters that nothing in them shows, as long as nobody knows where they begin."""


class InstallationCase(NamedTuple):
    """A run."""

    recording: Recording  # wrongly installed
    right: Recording  # as it is
    start: InitialState | None  # None: the filter's own alignment
    right_start: InitialState | None
    true: dict[str, float]  # {column of a Solution: true value}
    priors: Installation


def simulation(name: str) -> Simulation:
    """The Simulation of that name."""
    return (MOTIONS | UNSEEN)[name]


def case(name: str, seed: int, start: str) -> InstallationCase:
    """The InstallationCase of a motion and a seed; start: KNOWN or ALIGNED."""
    motion, priors, _ = simulation(name)
    right, at = simulator(motion).run(motion.imu, np.random.SeedSequence(seed))
    rng = np.random.default_rng([seed, 1])
    if motion.constrained:
        right = replace(right, sources=(*right.sources, *constraints(right, rng)))
    installed = draw_installation(right, priors, np.random.default_rng([seed, 2]))
    known = start == KNOWN
    return InstallationCase(
        installed.recording,
        right,
        start_of(installed, at) if known else None,
        at if known else None,
        installed.true,
        priors,
    )
