"""Join a gyro and an accelerometer that were logged separately, at different rates and times, to
one IMU."""

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..typing import Array
from ..units.wording import count_text
from .imu_samples import GAP_MEDIANS

MIN_COVERED = 0.99
"""Part of a gyro interval that the accelerometer must cover: all of it except rounding of the
times."""


def join_imu(gyro: Imu, accel: Imu) -> tuple[Imu, list[str]]:
    """(Imu with the samples of the gyro, notes): dtheta of `gyro` and dv of `accel`, each as
    `increments` makes it.

    The accelerometer is integrated over each interval of the gyro, so that a faster one is
    averaged, a slower one divided, and neither is shifted. A single lost accelerometer sample is
    bridged; samples in longer gaps are dropped. Raises DataError where no sample remains.
    """
    over, covered = forces_over(accel, gyro.t, gyro.dt)
    keep = covered >= MIN_COVERED
    if keep.sum() < 2:
        raise DataError(
            f"gyro and accelerometer have no time in common: gyro {gyro.t[0]:.3f} to "
            f"{gyro.t[-1]:.3f} s, accelerometer {accel.t[0]:.3f} to {accel.t[-1]:.3f} s; add "
            f"`offset` to the `time` of one, or check the units of time"
        )
    notes = [
        f"gyro and accelerometer have different times ({1 / np.median(gyro.dt):.4g} and "
        f"{1 / np.median(accel.dt):.4g} Hz); joined at the times of the gyro"
    ]
    if not keep.all():
        notes.append(
            f"{count_text(int((~keep).sum()), 'sample')} of the gyro dropped, because the "
            f"accelerometer has none there"
        )
    dv = over[keep] / covered[keep, None]
    return Imu(gyro.t[keep], gyro.dt[keep], gyro.dtheta[keep], dv), notes


def forces_over(accel: Imu, t: Array, dt: Array) -> tuple[Array, Array]:
    """(Sums of dv of an accelerometer over the parts that it covers of the intervals of dt (n,) s that end
    at t (n,) (n, 3), these parts of the intervals (n,))."""
    apart = np.diff(accel.t, prepend=accel.t[0] - accel.dt[0])
    held = np.where(apart <= 2 * GAP_MEDIANS * np.median(accel.dt), apart, accel.dt)
    gaps = np.flatnonzero(held < apart)  # the sum restarts before these samples
    steps = np.c_[accel.dv * (held / accel.dt)[:, None], held]
    sums = np.vstack([np.zeros(4), np.cumsum(steps, axis=0)])
    knots = np.insert(accel.t, np.r_[0, gaps], np.r_[accel.t[0] - held[0], (accel.t - held)[gaps]])
    sums = np.insert(sums, gaps + 1, sums[gaps], axis=0)
    over = _between(knots, sums, t) - _between(knots, sums, t - dt)
    return over[:, :3], over[:, 3] / dt


def _between(knots: Array, sums: Array, t: Array) -> Array:
    """Interpolate the sums (m, 4) linearly between knots (m,) to the times t, (n, 4); constant
    beyond."""
    before = np.clip(np.searchsorted(knots, t, "right") - 1, 0, len(knots) - 2)
    share = (t - knots[before]) / (knots[before + 1] - knots[before])
    return sums[before] + np.clip(share, 0.0, 1.0)[:, None] * (sums[before + 1] - sums[before])
