"""The IMU grade that fits a recording without a stated grade, from the white noise and from the
readings of gyro and accelerometer at rest."""

from typing import NamedTuple

import numpy as np

from ...core.loop.contract import Imu
from ...core.mathematics.earth import RATE
from ...preprocessing.stationary import at_rest
from ...sensor_models.imu import imu as imu_spec
from ...typing import Array
from ...units.constants import STANDARD_GRAVITY as G
from ...units.conversion import in_units

CLASSES = ("navigation", "tactical", "industrial", "consumer")
"""Grades from best to worst; the remaining shipped grade describes one product."""
MARGIN = 1.4
"""Largest ratio of the noise of an IMU to that of its grade; the gyro noises of neighbouring grades
differ by a factor of 2.1 or more."""
SIGMAS = 3.0
"""Largest error of a reading at rest, in standard deviations of the bias."""
GRAVITY_RANGE = 0.03  # m/s^2: largest error of standard gravity at sea level
WINDOW = 50  # samples of one estimate of the noise
QUIETEST = 10.0  # percent of the windows, those with the least motion
CLUSTERS = (1, 4)
"""Samples averaged at rest, because a low-pass filter in the device hides noise between
neighbouring samples."""
MEANS, STEADY = 1.0, 5.0
"""Seconds of a mean at rest, and largest difference from the next mean in standard deviations;
without this limit, smooth motion would pass for a rest."""
THIRD = 20.0
"""Variance of the third difference of white noise of variance 1; the difference removes slow
motion."""


class ShownGrade(NamedTuple):
    """The largest white noise in the record, and the means at rest, NaN without a rest."""

    gyro: float  # rad/sqrt(s)
    accel: float  # m/s/sqrt(s)
    rate: float  # rad/s
    excess: float  # of the magnitude of specific force over gravity, m/s^2


def nearest_grade(imu: Imu) -> tuple[str, str]:
    """(name of the best grade that allows the noise and the biases of `imu`, why)."""
    seen = shown_grade(imu)
    found = next((name for name in CLASSES if _is_allowed(name, seen)), CLASSES[-1])
    gyro = in_units(seen.gyro, "rad/sqrt(s)")
    accel = in_units(seen.accel, "m/s/sqrt(s)")
    rest = f", mean rate at rest {np.degrees(seen.rate):.2g} deg/s"
    return found, (
        f"estimated from its white noise of {gyro:.2g} deg/sqrt(h) and {accel:.2g} m/s/sqrt(h)"
        + (", no rest to observe its biases" if np.isnan(seen.rate) else rest)
    )


def _is_allowed(name: str, seen: ShownGrade) -> bool:
    """Return True where a grade allows all observed values; NaN is allowed."""
    spec = imu_spec(name)
    accel_std, gyro_std = spec.bias_std()
    return not (
        seen.gyro > MARGIN * spec.gyro.noise
        or seen.accel > MARGIN * spec.accel.noise
        or seen.rate > SIGMAS * np.sqrt(3) * gyro_std + RATE
        or abs(seen.excess) > SIGMAS * accel_std + GRAVITY_RANGE
    )


def shown_grade(imu: Imu) -> ShownGrade:
    """Return the noise and biases of the samples."""
    dt = float(np.median(imu.dt))
    rate, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    gyro, accel = (np.sqrt(dt) * _deviation(each) for each in (rate, force))
    rest, many = at_rest(imu), max(1, round(MEANS / dt))
    means = [_blocks(each[rest], many).mean(axis=1) for each in (rate, force)]
    steps = [np.abs(np.diff(each, axis=0)).max(axis=1) for each in means]
    steady = np.logical_and(
        *(step < STEADY * np.sqrt(2 / MEANS) * std for step, std in zip(steps, (gyro, accel)))
    )
    if not steady.any():
        return ShownGrade(gyro, accel, np.nan, np.nan)
    rates, forces = (np.linalg.norm(each[1:][steady], axis=1) for each in means)
    return ShownGrade(gyro, accel, float(rates.min()), float(np.median(forces)) - G)


def _deviation(values: Array) -> float:
    """Return the standard deviation of a sample (n, 3) in the quietest windows, averaged over the
    axes, for the noisiest cluster length; at least that of rounding."""
    steps = np.abs(np.diff(values, axis=0))
    moved = steps[steps > 0]
    found = [
        many * np.percentile((thirds**2).mean(axis=(1, 2)), QUIETEST) / THIRD
        for many in CLUSTERS
        if len(thirds := _blocks(np.diff(_blocks(values, many).mean(axis=1), 3, axis=0), WINDOW))
    ]
    if not found or not len(moved):
        return np.inf
    # the smallest step of rounded values is their unit, that of others a hundredth of the noise
    return float(np.sqrt(max(found) + np.percentile(moved, 1.0) ** 2 / 12))


def _blocks(values: Array, many: int) -> Array:
    """(k, many, 3): the rows in blocks, without an incomplete last block."""
    return values[: len(values) // many * many].reshape(-1, many, 3)
