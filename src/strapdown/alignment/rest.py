"""Standstills of a vehicle before and after an instant, and the gyro bias from them."""

from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..core.mathematics.earth import RATE
from ..data.recording import Recording
from ..preprocessing.stationary import at_rest, stretches
from ..preprocessing.unbroken import unbroken_stretches
from ..sensor_models.imu import ImuSpec
from ..typing import Array, Ints, Mask
from ..units.constants import REST_SPEED
from .first_fixes import position_and_velocity, velocities

REST_TIME = 2.0  # s: shortest rest that is averaged
SURELY = 4.0  # standard deviations of a component; noise exceeds them once in 3000 cases
TURNING = 4.0  # largest mean rate at rest, in standard deviations of the gyro bias
REST_SEARCH = 600.0  # s before and after an instant in which rests are searched


class Rests(NamedTuple):
    """The rests that lasted `REST_TIME`, as arrays of rows, in order."""

    before: list[Ints]  # that begin before the instant; the last may contain it
    after: list[Ints]

    def until(self, imu: Imu, t: float) -> float:
        """s: end of the rest that contains t; t itself where none does."""
        return max(t, float(imu.t[self.before[-1][-1]])) if self.before else t


def rests(recording: Recording, t: float) -> Rests:
    """Return the Rests within `REST_SEARCH` seconds of t, from the IMU and the surrounding
    fixes."""
    imu = recording.imu
    first, n = np.searchsorted(imu.t, [t - REST_SEARCH, t + REST_SEARCH])
    if n - first < 2:
        return Rests([], [])
    near = Imu(*(column[first:n] for column in imu))
    still = at_rest(near) & ~moves(recording, near.t)
    runs = [
        first + begin + np.arange(*run)
        for begin, end in unbroken_stretches(near)
        for run in stretches(still[begin:end])
    ]
    runs = [run for run in runs if imu.t[run[-1]] - imu.t[run[0]] >= REST_TIME]
    begun = [imu.t[run[0]] - imu.dt[run[0]] <= t + 0.1 for run in runs]
    return Rests(
        [run for run, before in zip(runs, begun) if before],
        [run for run, before in zip(runs, begun) if not before],
    )


def moves(recording: Recording, t: Array) -> Mask:
    """Return True where fixes around the times t show that the vehicle moves; to an IMU, smooth
    flight looks like rest."""
    position, velocity = position_and_velocity(recording)
    if position is None:
        return np.zeros(len(t), bool)
    t_fix, v, std = velocities(position, velocity)
    fast = np.hypot(v[:, 0], v[:, 1]) > REST_SPEED + SURELY * np.sqrt(
        np.mean(std[:, :2] ** 2, axis=1)
    )
    after = np.searchsorted(t_fix, t)
    return fast[np.clip(after - 1, 0, len(fast) - 1)] | fast[np.clip(after, 0, len(fast) - 1)]


def gyro_bias(samples: Imu, imu: ImuSpec, t: float, found: Rests) -> tuple[Array, Array, str]:
    """Return the gyro bias at t (rad/s), its standard deviation and a note, from the Rests up to t,
    else from the first one after t. At rest the Earth's rate cannot be separated from the bias, so
    rests are used only for an IMU whose turn-on bias is larger than the Earth's rate.

    The std combines the noise, the Earth's rate, the unsteadiness of the rate, and the drift of the
    bias in between.
    """
    b_g_std = imu.bias_std()[1]
    used = found.before or found.after[:1]
    if not used or b_g_std <= 2 * RATE:
        return (
            np.zeros(3),
            np.full(3, b_g_std),
            "biases smaller than the Earth's rate" if used else "biases unknown",
        )
    rows = np.concatenate(used)
    T = samples.dt[rows].sum()
    noise = samples.dtheta[rows].std(axis=0) * np.sqrt(len(rows)) / T
    age = max(0.0, t - samples.t[used[-1][-1]], samples.t[used[0][0]] - t)
    mean = samples.dtheta[rows].sum(axis=0) / T
    # the rate exceeds this IMU's bias: the body turns steadily, so this is no rest
    turning = np.where(np.abs(mean) > TURNING * b_g_std + RATE, np.abs(mean), 0.0)
    std = np.linalg.norm(
        [
            turning,
            noise,
            np.full(3, RATE),
            np.full(3, _wander(imu, age)),
            unsteadiness(samples, used),
        ],
        axis=0,
    )
    surer = (std < b_g_std) | (turning > 0)
    return (
        np.where(surer, mean, 0.0),
        np.where(surer, std, b_g_std),
        f"gyro bias from {T:.0f} s of rest" + ("" if found.before else f" {age:.0f} s later"),
    )


def _wander(imu: ImuSpec, seconds: float) -> float:
    """rad/s: change of the gyro bias after so many seconds, from the IMU's description."""
    noise = imu.noise()
    decay = noise.gyro_decay
    effective = -np.expm1(-2 * decay * seconds) / (2 * decay) if decay else seconds
    return float(noise.gyro_bias * np.sqrt(effective))


def unsteadiness(imu: Imu, rest: list[Ints]) -> Array:
    """(3,) rad/s: scatter of the mean rates of single seconds of these rests in excess of the
    sample noise. A hand that turns slowly looks like rest."""
    seconds = [
        (imu.dtheta[part].sum(axis=0) / imu.dt[part].sum(), len(part))
        for run in rest
        for part in np.array_split(run, min(len(run), max(1, int(imu.t[run[-1]] - imu.t[run[0]]))))
    ]
    rows = np.concatenate(rest)
    rate = imu.dtheta[rows] / imu.dt[rows, None]
    # differences of neighbours contain no slow motion
    white = 0.5 * np.mean(np.diff(rate, axis=0) ** 2, axis=0)
    scatter = np.var([mean for mean, _ in seconds], axis=0)
    allowed = 2.5 * white / np.mean([count for _, count in seconds])
    return np.sqrt(np.where(scatter > allowed, scatter, 0.0))
