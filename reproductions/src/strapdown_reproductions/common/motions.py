"""Simulated motions with their sensors, which several studies set up wrongly; and the constraints of
a car."""

from functools import cache
from typing import NamedTuple

import numpy as np

from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator

RECEIVER = Gnss(0.2, (1.0, 1.0, 1.5), (0.1, 0.1, 0.1), (0.5, 0.2, -1.0))
ON_WING = RECEIVER._replace(interval=1.0, lever_arm=(0.4, 0.0, -1.1))
ON_MAST = RECEIVER._replace(interval=1.0, lever_arm=(-5.0, 0.5, -12.0))
ODOMETER = (Simulated("speed", 0.1, 10.0),)
HEIGHT = (Simulated("altitude", 2.0, 1.0),)
CONSTRAINTS, CONSTRAINT_STD, CONSTRAINT_RATE = (
    ("zero-lateral-velocity", "zero-vertical-velocity"),
    0.1,  # m/s
    10.0,  # Hz
)


class StudyMotion(NamedTuple):
    """A simulated motion: a scenario to `stop` with an IMU and other sensors."""

    scenario: str
    stop: float  # s
    gnss: Gnss = RECEIVER
    imu: str = "industrial"
    sensors: tuple[Simulated, ...] = ()
    magnetometer: Magnetometer | None = None
    constrained: bool = False


@cache
def simulator(motion: StudyMotion) -> Simulator:
    """The Simulator of a motion; without a magnetometer of its own it has the scenario's."""
    given = {"imu": motion.imu, "gnss": motion.gnss, "sensors": motion.sensors}
    if motion.magnetometer is not None:
        given["magnetometer"] = motion.magnetometer
    return Simulator(scenario(motion.scenario).replace(duration=motion.stop, **given))


def constraints(recording: Recording, rng: np.random.Generator | None = None) -> list[Source]:
    """Zero lateral and vertical velocity of a car; with `rng` it slips and rocks by what it
    states."""
    t = np.arange(recording.span[0] + 1.0, recording.span[1], 1 / CONSTRAINT_RATE)
    std = np.full((len(t), 1), CONSTRAINT_STD)
    slip = lambda: np.zeros_like(std) if rng is None else std * rng.standard_normal(std.shape)
    return [Source(kind, t, slip(), std, (0.0, 0.0, 0.0)) for kind in CONSTRAINTS]
