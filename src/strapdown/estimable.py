"""What of an installation can be estimated with the states of a filter, and how far from what was
given it may be."""

import math
from typing import NamedTuple


class Estimable(NamedTuple):
    """A parameter of one or more components, each of which becomes a state where its prior standard
    deviation is above zero. A state is true - given, as errors are."""

    name: str  # as `estimate` has it
    components: tuple[str, ...]  # "" of the only one
    unit: str  # of tables; "" for none
    factor: float  # from SI to it
    sd: tuple[float, ...]  # prior, SI, by component; 0: no state
    most: float  # SI: what is further off than this is no error of an installation


AXES, ANGLES = ("forward", "right", "down"), ("roll", "pitch", "heading")
MISALIGNED = ("xy", "xz", "yz", "yx", "zx", "zy")
"""Of axes x, y, z: how much of the second gets into the first; the first three are those of a
triad that defines the axes itself."""

CLOCK = Estimable("clock", ("",), "s", 1.0, (0.1,), 2.0)
"""s to add to the time stamps of a source."""
LEVER_ARM = Estimable("lever-arm", AXES, "m", 1.0, (0.5,) * 3, 20.0)
MOUNTING = Estimable(
    "mounting", ANGLES, "deg", math.degrees(1), (0.0, *[math.radians(2.0)] * 2), math.radians(45)
)
"""Rotation vector exp(mu x) from the body axes as described to those of the vehicle. Forward motion
shows pitch and heading; roll is a state where its prior is given."""
SCALE = Estimable("scale", ("",), "", 1.0, (0.02,), 0.3)
"""By which an odometer reads too much."""
GYRO_SCALE = Estimable("gyro-scale", AXES, "", 1.0, (0.01,) * 3, 0.1)
ACCEL_SCALE = Estimable("accel-scale", AXES, "", 1.0, (0.01,) * 3, 0.1)
"""By which a sensor reads too much."""
GYRO_MISALIGNMENT = Estimable(
    "gyro-misalignment", MISALIGNED, "deg", math.degrees(1), (0.01,) * 6, math.radians(10)
)
ACCEL_MISALIGNMENT = Estimable(
    "accel-misalignment",
    MISALIGNED[:3],
    "deg",
    math.degrees(1),
    (0.01,) * 3,
    math.radians(10),
)

OF_SOURCE = {each.name: each for each in (CLOCK, LEVER_ARM, SCALE)}
OF_IMU = {
    each.name: each
    for each in (MOUNTING, GYRO_SCALE, ACCEL_SCALE, GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT)
}
