"""Standstills of the vehicle, from the IMU alone."""

from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..core.mathematics.earth import RATE
from ..typing import Array, Ints, Mask

REST_ACCEL, REST_RATE, REST_MEAN = 0.25, 0.1, 0.1
"""Limits at rest of the standard deviations of specific force (m/s^2) and rate (rad/s), three axes
together, and of the mean rate (rad/s).

Measured with one-second windows: a car at rest with its engine running and a MEMS IMU 0.10-0.16
m/s^2, the slowest driving 0.37 m/s^2. The mean rate leaves room for an uncalibrated MEMS gyro (5.7
deg/s).
"""


def at_rest(imu: Imu, window: float = 1.0) -> Mask:
    """(n,) bool: the vehicle stands still, from the IMU alone, in every `window` (s) that contains
    the sample; see `REST_ACCEL`.

    Smooth straight motion looks the same to an IMU: use this for vehicles that stop now and then,
    or together with the speed of fixes.
    """
    n = len(imu.t)
    width = max(2, round(window / float(np.median(imu.dt)))) if n else 1
    if n < width:
        return np.zeros(n, bool)
    force, _ = window_variance(imu.dv, imu.dt, width)
    rate, mean = window_variance(imu.dtheta, imu.dt, width)
    quiet = (force < REST_ACCEL**2) & (rate < REST_RATE**2) & (mean < REST_MEAN**2)
    return in_all_windows(quiet, width)


def in_all_windows(quiet: Mask, width: int) -> Mask:
    """(n,) bool: every window of `width` samples that contains the sample is quiet. `quiet` (n -
    width + 1,) has the window beginning at each sample."""
    # window k covers samples k ... k + width - 1, so sample i is in windows i - width + 1 ... i
    moving = np.r_[0, np.cumsum(~quiet)]
    i = np.arange(len(quiet) + width - 1)
    return moving[np.minimum(i + 1, len(quiet))] == moving[np.maximum(i - width + 1, 0)]


def rate_at_rest(imu: Imu) -> Array | None:
    """(3,) rad/s: the mean gyro reading at rest, None without a rest."""
    rest = at_rest(imu)
    return imu.dtheta[rest].sum(axis=0) / imu.dt[rest].sum() if rest.any() else None


def without_bias(imu: Imu) -> Array:
    """(n, 3) rad: rotation increments without their mean at rest."""
    bias = rate_at_rest(imu)
    return imu.dtheta if bias is None else imu.dtheta - bias * imu.dt[:, None]


def stretches(mask: Mask) -> Ints:
    """(k, 2) int: the first row and the row after the last of each stretch with a true mask (n,),
    in order."""
    return np.flatnonzero(np.diff(np.r_[False, mask, False])).reshape(-1, 2)


def window_variance(columns: Array, dt: Array, width: int) -> tuple[Array, Array]:
    """Variance and squared mean of columns / dt over every window of `width` samples, summed
    over the axes."""
    variance, square = np.zeros((2, len(dt) - width + 1))
    for column in columns.T:
        values = column / dt
        centre = values.mean()
        values -= centre
        mean = _moving_sum(values, width) / width
        variance += np.maximum(_moving_sum(values * values, width) / width - mean * mean, 0)
        square += (mean + centre) ** 2
    return variance, square


def _moving_sum(values: Array, width: int) -> Array:
    total = np.r_[0.0, np.cumsum(values)]
    return total[width:] - total[:-width]


REST_STEP, STEPS_BEFORE, STEPS_AFTER, STEPS_MIN = 10.0, 60, 360, 3
"""A long rest is detected from means over steps of `REST_STEP` seconds, at most so many before and
after an instant, and at least so many."""
MAX_PARTS = 10
MAX_TURN_RATE, MAX_TILT = 20 * RATE, np.radians(1.0)
"""Limits in a long rest of the rate (rad/s) of a step and of its tilt (rad) from the step at the
instant, which allow for boarding, settling springs and engine vibration."""


class Motionless(NamedTuple):
    """Means over a long rest."""

    rate: Array  # (3,) angular rate, rad/s
    # its std, rad/s: scatter over up to `MAX_PARTS` parts of the rest, the largest of the axes, and
    # the mean rate of tilt
    rate_std: float
    force: Array  # (3,) specific force, m/s^2
    tilt_std: float  # rad, scatter of the steps about the mean tilt
    start: float  # s
    stop: float  # s


def motionless(imu: Imu, t: float) -> Motionless | None:
    """Return the `Motionless` around t (s): the unbroken steps before and after it in which the
    body neither turns nor tilts. None for too few.

    Unlike `at_rest` it tolerates vibration, but it needs gyros with a bias below the Earth's rate.
    """
    steps = np.arange(-STEPS_BEFORE, STEPS_AFTER + 1)
    edges = np.searchsorted(imu.t, t + REST_STEP * steps + 1e-6)
    sums = [
        [column[a:b].sum(axis=0) for column in (imu.dt, imu.dtheta, imu.dv)]
        for a, b in zip(edges[:-1], edges[1:])
    ]
    seconds, dtheta, dv = (np.array(column) for column in zip(*sums))
    full = np.abs(seconds - REST_STEP) < 0.1 * REST_STEP
    rate, force = (
        dtheta / np.where(full, seconds, np.inf)[:, None],
        dv / np.where(full, seconds, np.inf)[:, None],
    )
    turning = ~full | (np.linalg.norm(rate, axis=1) >= MAX_TURN_RATE)
    anchors = STEPS_BEFORE - 1, STEPS_BEFORE  # t may end it or begin it
    runs = [
        _run(turning | (_angle(force, force[anchor]) >= MAX_TILT), anchor) for anchor in anchors
    ]
    first, last = max(runs, key=lambda run: run[1] - run[0])
    if last - first < STEPS_MIN:
        return None
    rows = slice(first, last)
    mean_rate, mean_force = (
        dtheta[rows].sum(axis=0) / seconds[rows].sum(),
        dv[rows].sum(axis=0) / seconds[rows].sum(),
    )
    # long ones: rocking averages out
    parts = np.array(
        [part.mean(axis=0) for part in np.array_split(rate[rows], min(MAX_PARTS, last - first))]
    )
    scatter = parts.std(axis=0, ddof=1).max() / np.sqrt(len(parts))
    tilts = _angle(force[rows], mean_force)
    # settling springs, which affect all parts alike
    drift = _angle(force[first : first + 1], force[last - 1])[0] / (REST_STEP * (last - first - 1))
    return Motionless(
        mean_rate,
        float(np.hypot(scatter, drift)),
        mean_force,
        float(np.sqrt(np.mean(tilts**2))),
        t + REST_STEP * steps[first],
        t + REST_STEP * steps[last],
    )


def _run(moving: Mask, anchor: int) -> tuple[int, int]:
    """(first, last + 1) of the steps around `anchor` without motion; empty where it moves."""
    breaks = np.flatnonzero(moving)
    return int(np.r_[-1, breaks[breaks <= anchor]][-1]) + 1, int(
        np.r_[breaks[breaks >= anchor], len(moving)][0]
    )


def _angle(vectors: Array, other: Array) -> Array:
    """(n,) angle between rows and another vector, rad; 180 deg where either is zero."""
    size = np.linalg.norm(vectors, axis=1) * np.linalg.norm(other)
    cosine = np.divide(vectors @ other, size, out=np.full(len(vectors), -1.0), where=size > 0)
    return np.arccos(np.clip(cosine, -1, 1))
