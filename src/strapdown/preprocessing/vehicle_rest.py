"""Standstills of a vehicle, for constraints that hold only then: from the IMU, unless wheels or
fixes show motion."""

from collections.abc import Iterable

import numpy as np

from ..core.loop.contract import Imu
from ..data.solution import Source
from ..typing import Array, Mask
from ..units.constants import REST_SPEED
from .stationary import in_all_windows, window_variance

STEP, WINDOW = 0.1, 1.0
"""s: samples are averaged over the first, which removes engine vibration and noise; the means are
tested over the second."""
FORCE, RATE, MEAN = 0.15, 0.009, 0.03
"""Limits at rest of the standard deviations of these means of specific force (m/s^2) and rate
(rad/s), three axes together: the squared ratios to them sum to less than 1; limit of the mean rate
(rad/s)."""
MAX_BIAS = 0.2  # rad/s (11 deg/s): largest gyro bias
SURELY = 4.0  # standard deviations above which a speed shows motion
HEARD = 1.5  # s for which a speed counts


def vehicle_at_rest(imu: Imu, sources: Iterable[Source] = ()) -> Mask:
    """(n,) bool: every second that contains the sample is quiet, see `FORCE`, similar to the
    likelihood ratio of Skog et al. (2010), IEEE TBME 57(11), and no wheel speed or velocity among
    the sources shows significant motion. Rates are relative to their median, which for a vehicle is
    the gyro bias."""
    seconds = float(np.median(imu.dt))
    many = max(1, round(STEP / seconds))
    width = max(2, round(WINDOW / (many * seconds)))
    first = np.arange(0, len(imu.t), many)
    if len(first) < width:
        return np.zeros(len(imu.t), bool)
    middle = np.median(imu.dtheta / imu.dt[:, None], axis=0)
    bias = np.where(np.abs(middle) < MAX_BIAS, middle, 0.0)
    dt, dtheta, dv = (np.add.reduceat(column, first) for column in imu[1:])
    force, _ = window_variance(dv, dt, width)
    rate, mean = window_variance(dtheta - bias * dt[:, None], dt, width)
    quiet = (force / FORCE**2 + rate / RATE**2 < 1) & (mean < MEAN**2)
    still = np.repeat(in_all_windows(quiet, width), many)[: len(imu.t)]
    return still & ~is_moving(sources, imu.t)


def is_moving(sources: Iterable[Source], t: Array) -> Mask:
    """Return True where a wheel speed or velocity shortly before or after the times t (n,), s, is
    significantly above rest (n,)."""
    found = np.zeros(len(t), bool)
    for a in sources:
        if a.kind not in ("speed", "velocity") or not len(a.t):
            continue
        y, std = (
            np.where(np.isnan(a.y), 0.0, part) for part in (a.y, a.std)
        )  # missing values count as 0
        speed, std = np.linalg.norm(y, axis=1), np.linalg.norm(std, axis=1)
        fast = speed > REST_SPEED + SURELY * std
        after = np.searchsorted(a.t, t)
        for near in (np.maximum(after - 1, 0), np.minimum(after, len(a.t) - 1)):
            found |= fast[near] & (np.abs(a.t[near] - t) <= HEARD)
    return found
