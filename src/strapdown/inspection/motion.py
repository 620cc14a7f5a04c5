"""The motion of a recording as its fixes tell it and as its IMU feels it, for the checks that
compare the two without knowing the attitude."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..data.recording import Recording
from ..data.solution import Source
from ..data.value import Value
from ..geometry.geodesy import displacement, wrap
from ..geometry.rotation_products import running_matrices
from ..preprocessing.stationary import rate_at_rest
from ..typing import Array
from ..units.constants import REST_SPEED
from .finding import MIN_FIXES, label

STEP = 0.05
"""Seconds between the instants at which the IMU's integrals are kept."""
FAST, SURE = 3.0, 5.0
"""m/s from which a course is known at any standard deviation of the velocity, and below which none
is: a receiver at rest and a lever arm that swings reach that speed. Between them the speed must be
SURE standard deviations: the course is then known to 11 deg."""
PAUSE_INTERVALS = 3
"""A pause of the fixes of more than this many intervals is not bridged."""


@dataclass(frozen=True, eq=False)
class InspectedRecording(Value):
    """A recording under check, with what several checks need of it."""

    recording: Recording
    apart: bool = False  # whether positions and velocities are known to differ in time

    @cached_property
    def felt(self) -> Felt:
        """The motion by its IMU."""
        return imu_motion(self.recording.imu)

    @cached_property
    def mirrored(self) -> Felt:
        """The motion by its IMU with the opposite sign of the y axis."""
        y = np.array([1.0, -1.0, 1.0])
        imu = self.recording.imu
        return imu_motion(imu._replace(dtheta=imu.dtheta * y, dv=imu.dv * y))

    def sources(self, *kinds: str) -> list[Source]:
        """Its sources of these kinds, in the order of the kinds."""
        return [a for kind in kinds for a in self.recording.sources if a.kind == kind]


class Moved(NamedTuple):
    """Velocities of one source of fixes."""

    name: str
    t: Array  # (n,) s
    v: Array  # (n, 3) m/s NED; a vertical part that is not measured is 0
    interval: float  # s, the median one
    arm: Array  # (3,) m, body, from the IMU to the antenna
    std: float  # m/s, the median claimed one of a horizontal component
    span: float  # s over which each is a mean: 0 of a velocity

    @property
    def fast(self) -> float:
        """Speed in m/s from which its course is known."""
        return float(np.clip(SURE * self.std, REST_SPEED, FAST))

    def acceleration_noise(self, half: float) -> float:
        """Variance (m^2/s^4) that the claimed noise gives a component of the acceleration over +-
        `half` s; two means of velocity share the position between them."""
        return (3 if self.span else 2) * (self.std / (2 * half)) ** 2

    def at(self, t: Array) -> Array:
        """(k, 3) velocities at times `t`, straight between the fixes; NaN outside and in pauses."""
        v = np.stack([np.interp(t, self.t, column) for column in self.v.T], axis=1)
        k = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        pause = self.t[k] - self.t[k - 1] > PAUSE_INTERVALS * self.interval + 0.1
        v[(t < self.t[0]) | (t > self.t[-1]) | pause] = np.nan
        return v


def source_velocity(source: Source, least: float = 2.0) -> Moved | None:
    """The velocities of a source of velocity; of positions from differences over at least `least`
    s. None where there are too few."""
    t, first = np.unique(source.t, return_index=True)
    y = source.y[first]
    use = np.isfinite(t) & np.isfinite(y[:, :2]).all(axis=1)
    t, y = t[use], np.where(np.isfinite(y[use]), y[use], 0.0)
    if len(t) < MIN_FIXES:
        return None
    interval, span = float(np.median(np.diff(t))), 0.0
    std = float(np.median(np.broadcast_to(source.std, source.y.shape)[:, :2]))
    if source.kind == "position":
        step = max(1, round(least / interval))
        span = step * interval
        std *= np.sqrt(2) / span
        seconds = t[step:] - t[:-step]
        v = displacement(y[step:], y[:-step]) / seconds[:, None]
        whole = seconds < (step + PAUSE_INTERVALS) * interval + 0.1
        t, y = (0.5 * (t[step:] + t[:-step]))[whole], v[whole]
        if len(t) < MIN_FIXES:
            return None
    arm = np.array(source.parameters[:3], float) if len(source.parameters) >= 3 else np.zeros(3)
    return Moved(label(source), t, y, interval, arm, std, span)


class Felt(NamedTuple):
    """Motion by the IMU, in axes that do not rotate with the body: those it had at the beginning.
    The integrals of row k are those up to t[k]."""

    t: Array  # (n,) s, STEP apart
    v: Array  # (n, 3) m/s, integral of the specific force
    turn: Array  # (n, 3) rad, integral of the angular rate
    body_v: Array  # (n, 3) m/s, integral of the specific force in the body's own axes
    body_turn: Array  # (n, 3) rad, integral of the angular rate in the body's own axes
    attitude: Array  # (n, 3, 3) from the body to the axes of the beginning
    coning: Array  # (n, 3) rad^2, integral of half of `body_turn` x angular rate

    def rotation_vectors(self, begin: Array, end: Array) -> Array:
        """(k, 3) rad: rotation vectors of the body from the times `begin` to `end` (k,), of turns whose
        axis wanders a little (Bortz 1971, to the second order)."""
        first, last = (
            np.stack([np.interp(t, self.t, column) for column in self.body_turn.T], axis=1)
            for t in (begin, end)
        )
        coning = np.stack(
            [np.interp(end, self.t, c) - np.interp(begin, self.t, c) for c in self.coning.T], axis=1
        )
        return last - first + coning - 0.5 * np.cross(first, last)

    def at_antenna(self, arm: Array) -> Array:
        """(n, 3) m/s: what `v` is at a point of the body, `arm` (3,) m from the IMU."""
        if not arm.any() or len(self.t) < 2:
            return self.v
        rate = np.gradient(self.body_turn, STEP, axis=0)
        return self.v + rotate_vectors(self.attitude, np.cross(rate, arm))

    def mean(self, integral: Array, at: Array, half: float) -> Array:
        """(k, 3) mean over +- `half` s around the times `at` (k,); NaN outside."""
        found = np.stack(
            [
                np.interp(at + half, self.t, column) - np.interp(at - half, self.t, column)
                for column in integral.T
            ],
            axis=1,
        ) / (2 * half)
        found[(at - half < self.t[0]) | (at + half > self.t[-1])] = np.nan
        return found


def imu_motion(imu: Imu) -> Felt:
    """The Felt of an IMU record; the gyros without their mean at rest, what is missing in gaps as
    in the sample after it."""
    before = np.r_[imu.t[0] - imu.dt[0], imu.t]
    grid = np.arange(before[0], before[-1], STEP)
    bias = rate_at_rest(imu)
    rate = imu.dtheta / imu.dt[:, None] - (0.0 if bias is None else bias)
    whole = np.diff(before)[:, None]
    dtheta, dv = (
        np.diff(_sum_on_grid(values * whole, before, grid), axis=0)
        for values in (rate, imu.dv / imu.dt[:, None])
    )
    zero, attitude = np.zeros((1, 3)), np.eye(3)[None]
    if len(dtheta):
        attitude = np.concatenate([attitude, running_matrices(dtheta)])
    v, turn = (
        np.cumsum(np.vstack([zero, rotate_vectors(attitude[: len(column)], column)]), axis=0)
        for column in (dv + np.cross(dtheta, dv) / 2, dtheta)
    )
    body_v, body_turn = (np.cumsum(np.vstack([zero, column]), axis=0) for column in (dv, dtheta))
    half = 0.5 * np.cross(body_turn[:-1], dtheta)  # the half steps between are parallel to dtheta
    coning = np.cumsum(np.vstack([zero, half]), axis=0)
    return Felt(grid, v, turn, body_v, body_turn, attitude, coning)


def rotate_vectors(C: Array, vectors: Array) -> Array:
    """(n, 3) vectors (n, 3) or (3,), each by its matrix of C (n, 3, 3)."""
    return np.asarray((C * vectors[..., None, :]).sum(axis=-1))


def _sum_on_grid(increments: Array, t: Array, grid: Array) -> Array:
    """(k, 3) the sum of increments (n, 3) over the intervals between `t` (n + 1,), at the grid."""
    total = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])
    return np.stack([np.interp(grid, t, column) for column in total.T], axis=1)


def course_rate(fixes: Moved, half: float, fast: float = FAST) -> Array:
    """(n,) rad/s: the rate of the course over ground at the fixes, over +- `half` s; NaN where
    the speed is below `fast` (m/s)."""
    first, last = fixes.at(fixes.t - half), fixes.at(fixes.t + half)
    courses = np.arctan2(first[:, 1], first[:, 0]), np.arctan2(last[:, 1], last[:, 0])
    rate = wrap(courses[1] - courses[0]) / (2 * half)
    with np.errstate(invalid="ignore"):
        slow = ~(np.minimum(*(np.hypot(v[:, 0], v[:, 1]) for v in (first, last))) > fast)
    rate[slow] = np.nan
    return np.asarray(rate)
