"""What samples, fixes and states of a run never exceed, from the IMU's description and the
vehicle."""

import math
from collections.abc import Sequence

import numpy as np

from .. import aiding, quantities
from ..core.loop import cursor
from ..core.loop.contract import Noise
from ..data import Aiding
from ..sensor_models.imu import ImuSpec
from ..typing import Array
from ..vehicle import STANDARD_GRAVITY, Vehicle

GYRO_RANGE = 35.0
"""rad/s (2000 deg/s) that the common gyros read at most, where no full scale is described."""
BEYOND = 1.05  # of a described full scale: what reads more is broken
AT_FULL_SCALE = 0.999


def limits(spec: ImuSpec | None, noise: Noise, vehicle: Vehicle) -> Array:
    """Cursor.limits of a run with this IMU (None: not described) on this vehicle."""
    found = np.empty(cursor.LIMITS)
    gyro, accel = (spec.gyro.saturation, spec.accel.saturation) if spec else (0.0, 0.0)
    found[cursor.GYRO_RANGE] = max(GYRO_RANGE, BEYOND * gyro)
    found[cursor.ACCEL_RANGE] = vehicle.acceleration + STANDARD_GRAVITY
    found[cursor.GYRO_FULL_SCALE] = AT_FULL_SCALE * gyro if gyro else math.inf
    found[cursor.ACCEL_FULL_SCALE] = AT_FULL_SCALE * accel if accel else math.inf
    found[cursor.GYRO_NOISE], found[cursor.ACCEL_NOISE] = noise.gyro, noise.accel
    found[cursor.SPEED] = vehicle.speed
    found[cursor.LOWEST], found[cursor.HIGHEST] = vehicle.lowest, vehicle.highest
    return found


def floors(aidings: Sequence[Aiding]) -> Array:
    """Cursor.floor: least standard deviations (sources, 3) of the rows of each source."""
    found = np.zeros((len(aidings), 3))
    for row, a in zip(found, aidings):
        least = [quantities.REGISTRY.find(q).least_sd for q in aiding.find(a.kind).quantities]
        row[: len(least)] = least
    return found
