"""Limits of samples, measurements and states of a run, from the IMU's description and the
vehicle."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import aiding
from ..core.compile.records import rows
from ..core.loop.contract import Noise
from ..core.loop.cursor import Limits
from ..data.solution import Source
from ..data.vehicle import Vehicle
from ..sensor_models.imu import ImuSpec
from ..typing import Array
from ..units import quantities
from ..units.constants import COMMON_GYRO_RANGE, STANDARD_GRAVITY

BEYOND = 1.05  # of a stated full scale: a larger reading is a fault
AT_FULL_SCALE = 0.999


def limits(spec: ImuSpec | None, noise: Noise, vehicle: Vehicle) -> Any:
    """Cursor.limits of a run with this IMU (None: not described) on this vehicle."""
    (found,) = table = rows(Limits, 1)
    gyro, accel = (spec.gyro.saturation, spec.accel.saturation) if spec else (0.0, 0.0)
    found.gyro_range = max(COMMON_GYRO_RANGE, BEYOND * gyro)
    found.accel_range = vehicle.acceleration + STANDARD_GRAVITY
    found.gyro_full_scale = AT_FULL_SCALE * gyro if gyro else math.inf
    found.accel_full_scale = AT_FULL_SCALE * accel if accel else math.inf
    found.gyro_noise, found.accel_noise = noise.gyro, noise.accel
    found.speed = vehicle.speed
    found.lowest, found.highest = vehicle.lowest, vehicle.highest
    return table


def floors(sources: Sequence[Source]) -> Array:
    """Return the smallest accepted standard deviations (sources, 3) of the rows of each source."""
    found = np.zeros((len(sources), 3))
    for row, a in zip(found, sources):
        least = [quantities.REGISTRY.find(q).min_std for q in aiding.find(a.kind).quantities]
        row[: len(least)] = least
    return found
