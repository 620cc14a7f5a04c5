"""Stuck samples of any sensor: they keep one value while the body turns."""

import numpy as np

from ..core.loop.contract import Imu
from ..typing import Array, Ints, Mask
from .stationary import without_bias

STUCK_TIME, STUCK_TURN = 2.0, np.radians(10)
"""Samples are stuck where they do not change for longer than STUCK_TIME (s) while the gyro turns by
more than STUCK_TURN (rad)."""


def stuck_samples(t: Array, raw: Array, imu: Imu, axes: slice = slice(0, 3)) -> Mask:
    """(m,) bool: constant for STUCK_TIME or longer while the body turned by STUCK_TURN about one of
    `axes`; the first sample of each such run counts as good."""
    held = np.zeros(len(t), bool)
    changed = (
        np.flatnonzero(np.r_[True, (raw[1:] != raw[:-1]).any(axis=1), True])
        if len(t)
        else np.zeros(1, int)
    )
    first, last = changed[:-1], changed[1:] - 1
    with np.errstate(invalid="ignore"):
        long: Ints = (
            np.flatnonzero((t[last] - t[first] > STUCK_TIME) & np.isfinite(raw[first]).all(axis=1))
            if len(first)
            else np.zeros(0, int)
        )
    if not len(long):
        return held
    angle = integrated_gyro(imu)
    for run in long:
        begin, end = np.searchsorted(imu.t, (t[first[run]], t[last[run]]))
        if np.ptp(angle[begin : end + 1, axes], axis=0).max() > STUCK_TURN:
            held[first[run] + 1 : last[run] + 1] = True
    return held


def integrated_gyro(imu: Imu) -> Array:
    """(n + 1, 3) rad: the gyro summed up about each axis, without its mean at rest."""
    return np.vstack([np.zeros(3), np.cumsum(without_bias(imu), axis=0)])
