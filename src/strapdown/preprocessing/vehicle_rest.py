"""When a vehicle stands still, for constraints that hold only then: by the IMU, unless wheels or
fixes say that it moves."""

from collections.abc import Iterable

import numpy as np

from ..core.contract import Imu
from ..data import Aiding
from ..typing import Array, Mask
from .stationary import at_rest

STEP = (
    0.01  # s: shorter samples are averaged over it, so that their noise does not look like motion
)
MOST_BIAS = 0.2  # rad/s (11 deg/s): what turns on faster is no gyro bias
FASTEST, SURELY = 0.3, 4.0  # m/s, and standard deviations, that a speed is above at rest
HEARD = 1.5  # s for which a speed counts


def vehicle_at_rest(imu: Imu, aidings: Iterable[Aiding] = ()) -> Mask:
    """(n,) bool: `at_rest` at 100 Hz at most, of rates less their median, which of a vehicle is the
    bias of its gyro; and no wheel speed or velocity among the aidings surely says that it moves."""
    middle = np.median(imu.dtheta / imu.dt[:, None], axis=0)
    bias = np.where(np.abs(middle) < MOST_BIAS, middle, 0.0)
    many = max(1, round(STEP / float(np.median(imu.dt))))
    first = np.arange(0, len(imu.t), many)
    dt = np.add.reduceat(imu.dt, first)
    coarse = Imu(
        imu.t[np.r_[first[1:] - 1, len(imu.t) - 1]],
        dt,
        np.add.reduceat(imu.dtheta, first) - bias * dt[:, None],
        np.add.reduceat(imu.dv, first),
    )
    still = np.repeat(at_rest(coarse), many)[: len(imu.t)]
    return still & ~moving(aidings, imu.t)


def moving(aidings: Iterable[Aiding], t: Array) -> Mask:
    """Whether a wheel speed or velocity before or after the times t (n,), s, surely says so."""
    found = np.zeros(len(t), bool)
    for a in aidings:
        if a.kind not in ("speed", "velocity") or not len(a.t):
            continue
        speed, sd = np.linalg.norm(a.y, axis=1), np.linalg.norm(a.sd, axis=1)
        fast = speed > FASTEST + SURELY * sd
        after = np.searchsorted(a.t, t)
        for near in (np.maximum(after - 1, 0), np.minimum(after, len(a.t) - 1)):
            found |= fast[near] & (np.abs(a.t[near] - t) <= HEARD)
    return found
