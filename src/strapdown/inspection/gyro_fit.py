"""Readings of the gyro against each other, by the accelerations of the fixes: in axes that the gyro
holds still, the specific force is the acceleration less gravity. A gyro in a wrong unit or of a wrong
sign does not hold them. No course is needed, so that it tells of a multicopter or a hand too.
"""

import numpy as np

from ..core.loop.contract import Imu
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from .clock_offsets import left_over
from .finding import MIN_FIXES
from .motion import Felt, InspectedRecording, Moved, imu_motion, source_velocity

STRETCH = 3.0
"""Seconds over which axes are held: short, because biases turn them."""
HALVES = (0.3, 1.0)
"""Half the windows of an acceleration, s, of quick and of slow motion; of positions twice that."""
LAGS = np.arange(-0.5, 0.51, 0.1)
"""s between the clocks that are tried."""
CHANGES = 4.0
"""Variance that accelerations must have, over that of their claimed noise."""
EVIDENCE = 10.0
"""Logarithm of a likelihood ratio that decides: on 80 simulated flights
and drives it was up to 5 for the wrong unit, with the biases of a consumer IMU."""


def likelier(subject: InspectedRecording, gyro: Array | float) -> float:
    """The logarithm of the likelihood of increments of the gyro multiplied by `gyro` (a number, or one
    for each axis) over that of those as read, by the source and window that tell most; 0 where none
    tells."""
    as_read = _motions(subject.recording.imu, 1.0)
    other = _motions(subject.recording.imu, gyro)
    found = [0.0]
    for source in subject.sources("velocity", "position"):
        fixes = source_velocity(source)
        if fixes is None:
            continue
        for half in sorted(
            {max(half, fixes.interval) * (2 if fixes.span else 1) for half in HALVES}
        ):
            left, count = min(_misfit(fixes, each, half) for each in as_read)
            changed, _ = min(_misfit(fixes, each, half) for each in other)
            found.append(count / 2 * float(np.log(left / changed)) if count else 0.0)
    return max(found, key=abs)


def _motions(imu: Imu, gyro: Array | float) -> tuple[Felt, Felt]:
    """Return the motion by the IMU with its gyro multiplied by `gyro`, and the same without its
    mean rate, which may be a bias or a turn."""
    turns = imu.dtheta * gyro
    mean = turns.sum(axis=0) / imu.dt.sum()
    return (
        imu_motion(Imu(imu.t, imu.dt, turns, imu.dv)),
        imu_motion(Imu(imu.t, imu.dt, turns - mean * imu.dt[:, None], imu.dv)),
    )


def _misfit(fixes: Moved, motion: Felt, half: float) -> tuple[float, float]:
    """(sum of squares that is left of the accelerations over +- `half` s at the best lag, how many of
    them are independent); 0 of them where there are too few."""
    a = (fixes.at(fixes.t + half) - fixes.at(fixes.t - half)) / (2 * half)
    a -= [0.0, 0.0, STANDARD_GRAVITY]
    reach = half - LAGS[0]
    inside = (fixes.t - reach > motion.t[0]) & (fixes.t + reach < motion.t[-1])
    use = np.isfinite(a).all(axis=1) & inside
    if use.sum() < MIN_FIXES:
        return 1.0, 0.0
    t, a = fixes.t[use], a[use]
    if a.var(axis=0).sum() < CHANGES * 3 * fixes.acceleration_noise(half):
        return 1.0, 0.0
    _, edges = np.unique(np.floor(t / STRETCH), return_index=True)
    integral = motion.at_antenna(fixes.arm)
    left = [left_over(a, motion.mean(integral, t + lag, half), edges).sum() for lag in LAGS]
    return max(float(min(left)), 1e-12), 3 * len(t) * fixes.interval / (2 * half)
