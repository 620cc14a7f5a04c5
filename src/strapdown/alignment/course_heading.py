"""The course over ground as a heading: the direction of the velocity that fixes measure, where that
velocity is significantly above its noise.

The forward axis is assumed to point along the velocity. The error of this assumption is the
sideslip, the drift in wind or current, half a turn in reverse, and any angle for a device carried
by hand. The standard deviation covers the first two.
"""

from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..data.solution import Source
from ..geometry.geodesy import displacement
from ..preprocessing.stationary import at_rest
from ..preprocessing.unbroken import is_unbroken, unbroken_stretches
from ..typing import Array
from .first_fixes import velocities
from .initial_heading import UNKNOWN_STD, HeadingFound

COURSE_STD = np.radians(15.0)  # sideslip, and the crab angle of a fast vehicle in wind
DRIFT = 0.5  # m/s across the forward axis: wind, current, a step aside
SURE = 5.0
"""Standard deviations that a speed must exceed to have a course; noise alone exceeds them once in
3e5 cases."""
SURE_AT_REST = 15.0
"""The same where the IMU measures no motion. Two cases look alike then: smooth travel, and fixes
whose errors exceed their standard deviations."""
MOVING = 5.0  # m/s: speed of a course that the start waits for
WAIT = 300.0  # s that it waits, from the first course on
ENOUGH = 0.06  # rad of noise: no more fixes are averaged
MAX_SPAN = 10.0  # s that the fixes of one course may span
UNSEEN_TURN = 1e3  # rad: stands for an unknown turn in a gap between samples


class Courses(NamedTuple):
    """Mean velocities up to each fix, over as many fixes as the course needs to be significant."""

    t: Array  # (n,) s
    v: Array  # (n, 2) m/s, north and east
    std: Array  # (n,) m/s, of either
    turned: Array  # (n,) rad: rotation of the body during these fixes

    @property
    def speed(self) -> Array:
        """(n,) m/s."""
        return np.hypot(self.v[:, 0], self.v[:, 1])

    @property
    def noise(self) -> Array:
        """(n,) rad: standard deviation of the course as the heading at its fix, without drift."""
        return np.hypot(self.std / np.maximum(self.speed, 1e-9), 0.5 * self.turned)


def courses(imu: Imu, position: Source, velocity: Source | None) -> Courses:
    """Return the Courses of a velocity source, or without one of displacements between positions.
    Each is a mean over 1, 2, 4, ... intervals within `MAX_SPAN` seconds."""
    t, v, std = velocities(position, velocity)
    angle = np.cumsum(_turns(imu, t), axis=0)
    best = Courses(t.copy(), v[:, :2].copy(), _rms(std), np.zeros(len(t)))
    for several in 2 ** np.arange(1, max(1, len(t).bit_length())):
        last = slice(int(several) - 1, None)
        first = slice(None, len(t) - int(several) + 1)
        span = t[last] - t[first]
        if not (span <= MAX_SPAN).any():
            break
        if velocity is None:
            mean = _displacement_rate(position, int(several))
        else:
            mean = _mean(velocity, int(several), span)
        turned = np.linalg.norm(angle[last] - angle[first], axis=1)
        found, here = Courses(t[last], *mean, turned), Courses(*(column[last] for column in best))
        surer = (here.noise > ENOUGH) & (found.noise < here.noise) & (span <= MAX_SPAN)
        for column, better in zip(here, found):
            column[surer] = better[surer]
    return best


def _mean(velocity: Source, several: int, span: Array) -> tuple[Array, Array]:
    """Return means (k, 2) of `several` consecutive velocities, over `span` (s), and their std (k,).
    All velocities within one second count as one, because their errors are correlated."""
    v = np.cumsum(np.vstack([np.zeros(2), velocity.y[:, :2]]), axis=0)
    variance = np.cumsum(np.r_[0.0, _rms(velocity.std) ** 2])
    independent = np.clip(span + 1.0, 1.0, several)
    return (
        (v[several:] - v[:-several]) / several,
        np.sqrt((variance[several:] - variance[:-several]) / several / independent),
    )


def _displacement_rate(position: Source, several: int) -> tuple[Array, Array]:
    """Return displacements over `several` intervals divided by their duration, m/s (k, 2), and
    their std (k,)."""
    seconds = position.t[several:] - position.t[:-several]
    moved = displacement(position.y[several:], position.y[:-several])[:, :2]
    return moved / seconds[:, None], np.hypot(
        _rms(position.std[several:]), _rms(position.std[:-several])
    ) / seconds


def _rms(std: Array) -> Array:
    return np.sqrt(np.mean(std[:, :2] ** 2, axis=1))


def _turns(imu: Imu, t: Array) -> Array:
    """(n, 3) rad: the integrated gyro rate between each of these times and the one before."""
    rows = np.minimum(np.searchsorted(imu.t, t, side="right"), len(imu.t) - 1)
    dtheta = imu.dtheta.copy()
    dtheta[unbroken_stretches(imu)[1:, 0], 2] += UNSEEN_TURN
    sums = np.add.reduceat(dtheta, rows, axis=0)
    sums[:-1][rows[1:] == rows[:-1]] = 0.0  # where no sample lies between
    return np.vstack([np.zeros(3), sums[:-1]])


def heading_of(courses: Courses, imu: Imu, t: float) -> HeadingFound | None:
    """Return the HeadingFound at t from the courses before and after; None where neither is
    significant."""
    after = int(np.searchsorted(courses.t, t))
    near = [
        k
        for k in (after - 1, after)
        if 0 <= k < len(courses.t)
        and is_sure(courses, imu, k)
        and is_unbroken(imu, courses.t[k], t)
    ]
    if not near:
        return None
    k = min(near, key=lambda k: abs(courses.t[k] - t))
    v = courses.v[k]
    if len(near) == 2:
        share = (t - courses.t[near[0]]) / (courses.t[near[1]] - courses.t[near[0]])
        v = (1 - share) * courses.v[near[0]] + share * courses.v[near[1]]
    away = np.linalg.norm(_turns(imu, np.sort([courses.t[k], t]))[1])
    speed = np.hypot(*v)
    std = np.linalg.norm([COURSE_STD, DRIFT / speed, courses.noise[k], away])
    return HeadingFound(
        float(np.arctan2(v[1], v[0])),
        float(min(std, UNKNOWN_STD)),
        f"heading from the course at {speed:.1f} m/s",
    )


def is_sure(courses: Courses, imu: Imu, k: int) -> bool:
    """True where velocity k has a course: its speed is significantly above its noise."""
    if not courses.speed[k] > SURE * courses.std[k]:
        return False
    return bool(courses.speed[k] > SURE_AT_REST * courses.std[k]) or not _still(imu, courses.t[k])


def _still(imu: Imu, t: float) -> bool:
    """True where the IMU is at rest at t."""
    rows = slice(*np.searchsorted(imu.t, [t - 1.5, t + 1.5]))
    still = at_rest(Imu(*(column[rows] for column in imu)))
    return bool(len(still)) and bool(
        still[min(int(np.searchsorted(imu.t[rows], t)), len(still) - 1)]
    )


def best_instant(courses: Courses, imu: Imu) -> int | None:
    """Return the index of the course to start at: the first one faster than `MOVING` if it comes
    within `WAIT` seconds of the first course, else the first course; None without any."""
    first = None
    for k in np.flatnonzero(courses.speed > SURE * courses.std):
        if first is not None and courses.t[k] > courses.t[first] + WAIT:
            break
        if (first is None or courses.speed[k] > MOVING) and is_sure(courses, imu, int(k)):
            if courses.speed[k] > MOVING:
                return int(k)
            first = int(k)
    return first
