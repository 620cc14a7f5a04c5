"""Stretches of IMU samples without a gap. The motion in a gap is unknown, so no mean, rest or turn
extends across it."""

import numpy as np

from ..core.loop.contract import Imu
from ..typing import Array, Ints, Mask

UNSEEN = 0.5
"""s without samples that end a stretch; single lost samples do not."""


def unbroken_stretches(imu: Imu) -> Ints:
    """(k, 2): the first row and the row after the last of each stretch, in order."""
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    inner = np.flatnonzero(missing > UNSEEN) + 1
    return np.stack([np.r_[0, inner], np.r_[inner, len(imu.t)]], axis=1)


def nearest_felt(imu: Imu, t: float) -> tuple[slice, float]:
    """(rows of the stretch that contains t or is nearest to it, the time in it nearest to t)."""
    found = unbroken_stretches(imu)
    begin, end = imu.t[found[:, 0]] - imu.dt[found[:, 0]], imu.t[found[:, 1] - 1]
    inside = np.clip(t, begin, end)
    nearest = int(np.argmin(np.abs(inside - t)))
    return slice(*found[nearest].tolist()), float(inside[nearest])


def is_covered(imu: Imu, t: Array) -> Mask:
    """Return True where the times t (n,) lie in a stretch (n,)."""
    after = np.searchsorted(imu.t, t)
    begin, end = np.r_[imu.t - imu.dt, np.inf][after], np.r_[-np.inf, imu.t][after]
    return (t >= begin) | (t <= end) | (begin - end <= UNSEEN)


def is_unbroken(imu: Imu, a: float, b: float) -> bool:
    """Return True where no gap lies between the times a and b."""
    return nearest_felt(imu, a)[0] == nearest_felt(imu, b)[0]


def sum_samples(imu: Imu, begins: Mask) -> Imu:
    """Samples summed to longer ones, each of which begins where `begins` (n,) is true, and behind a
    gap: nothing is summed across one."""
    gap = imu.t[1:] - imu.dt[1:] - imu.t[:-1] > 0.5 * imu.dt[1:]
    first = np.flatnonzero(np.r_[True, begins[1:] | gap])
    last = np.r_[first[1:], len(imu.t)] - 1
    return Imu(imu.t[last], *(np.add.reduceat(column, first) for column in imu[1:]))
