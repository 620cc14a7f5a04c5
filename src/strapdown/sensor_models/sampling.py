"""When and where on the body a sensor measures: sample times, lever arms, the truth between its
rows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..checks import DataError, check_array, check_number, is_number
from ..data.solution import Trajectory, attitude_of
from ..geometry.geodesy import wrap
from ..geometry.rotations import RotationPath
from ..typing import Array


def interpolate_trajectory(trajectory: Trajectory, t: Array) -> Trajectory:
    """Position and velocity at times t (n,) s within the trajectory, as data.Trajectory: its rows
    at their own times, else cubic splines. Raises DataError."""
    if len(trajectory.t) < 2 or not np.all((t >= trajectory.t[0]) & (t <= trajectory.t[-1])):
        raise DataError(
            f"fixes are wanted at times outside the trajectory, which covers {trajectory.t[0]:g} to "
            f"{trajectory.t[-1]:g} s"
        )
    row = np.searchsorted(trajectory.t, t)
    if np.array_equal(trajectory.t[row], t):
        lla, v_n = trajectory.lla[row], None if trajectory.v_n is None else trajectory.v_n[row]
    else:
        from scipy.interpolate import CubicSpline

        lla = CubicSpline(
            trajectory.t,
            np.c_[trajectory.lla[:, 0], np.unwrap(trajectory.lla[:, 1]), trajectory.lla[:, 2]],
        )(t)
        v_n = None if trajectory.v_n is None else CubicSpline(trajectory.t, trajectory.v_n)(t)
    lla[:, 1] = wrap(lla[:, 1])
    return Trajectory(t, lla, v_n)


def arm_in_navigation(
    trajectory: Trajectory, t: Array, lever_arm: Sequence[float] | Array, name: str
) -> Array:
    """C_nb lever_arm, (n, 3) m NED; the attitude turns at a constant rate between samples."""
    check_lever_arm(lever_arm, name)
    if not np.any(lever_arm):
        return np.zeros((len(t), 3))
    if trajectory.q_nb is None:
        raise DataError(f"{name}: a lever arm needs the trajectory's attitude, and it has none")
    return RotationPath(trajectory.t, attitude_of(trajectory))(t).apply(lever_arm)


def fix_times(trajectory: Trajectory, times: float | Array) -> Array:
    """Times (n,) s of the fixes, at samples of the trajectory where rounding alone parts them;
    `times` is the interval between them (s; the first one interval after the start) or the times
    themselves. Raises DataError."""
    if np.ndim(times):
        t = np.asarray(times, float)
    else:
        start, stop, interval = trajectory.t[0], trajectory.t[-1], check_interval(times)
        t = start + interval * np.arange(1, int((stop - start) / interval + 1e-9) + 1)
    after = np.clip(np.searchsorted(trajectory.t, t), 1, len(trajectory.t) - 1)
    nearest = np.where(
        t - trajectory.t[after - 1] < trajectory.t[after] - t,
        trajectory.t[after - 1],
        trajectory.t[after],
    )
    return np.where(np.abs(nearest - t) < 1e-9 * (1 + np.abs(t)), nearest, t)


def sample_times(trajectory: Trajectory, rate: float | None) -> Array:
    """Times (n,) s at which a sensor of that `rate` (Hz) measures: None is with every sample."""
    return trajectory.t[1:] if rate is None else fix_times(trajectory, 1 / rate)


def check_rate(rate: float | None, most: float, what: str) -> None:
    """Raise DataError where the samples of a sensor come faster than the `most` (Hz) of the IMU."""
    if (rate or 0.0) > most * (1 + 1e-9):
        raise DataError(
            f"{what}: {rate:g} a second come faster than the IMU's samples, {most:g} a second; give "
            f"it a lower rate, or the IMU a higher one"
        )


def as_triple(value: Any) -> Any:
    """Three of one number; else what it is."""
    return (value,) * 3 if is_number(value) else value


def check_interval(seconds: float | Array) -> float:
    """The time between fixes, s. Raises DataError."""
    return check_number(seconds, "interval between fixes", "s", above=0)


def check_lever_arm(lever_arm: Sequence[float] | Array, name: str) -> None:
    """Raise DataError for a lever arm that is none."""
    check_array(lever_arm, f"{name}: lever arm", (3,), what="numbers: forward, right, down, m")
