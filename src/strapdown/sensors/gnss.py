"""Error model of a GNSS receiver: fixes of position and velocity at the antenna with white noise, as Aiding."""
from typing import NamedTuple

import numpy as np

from ..data import Aiding, DataError, Trajectory
from ..geodesy import displaced, wrap


class Gnss(NamedTuple):
    """A receiver: time between fixes, and standard deviations north, east, down; None means that it does not measure this."""
    interval: float = 1.0                   # s
    position_sd: tuple = (1.0, 1.0, 1.5)    # m
    velocity_sd: tuple = (0.1, 0.1, 0.1)    # m/s
    lever_arm: tuple = (0.0, 0.0, 0.0)      # from the IMU to the antenna, m, body

    def fixes(self, trajectory, rng):
        """The aidings of a flight, position and velocity each from a random stream of its own."""
        position, velocity = rng.spawn(2)
        made = []
        if self.position_sd is not None:
            made.append(position_fixes(trajectory, self.interval, self.position_sd, position, self.lever_arm))
        if self.velocity_sd is not None:
            made.append(velocity_fixes(trajectory, self.interval, self.velocity_sd, velocity, self.lever_arm))
        return tuple(made)


def position_fixes(trajectory, times, sd, rng, lever_arm=(0.0, 0.0, 0.0), name="GNSS position"):
    """Aiding of antenna positions (latitude rad, longitude rad, height m) with white noise of `sd` (3,) m north, east, down.

    `times` is the interval between fixes in s (the first one interval after the start) or the times themselves. The antenna is at
    p + C_nb lever_arm. Raises DataError.
    """
    t, sd = _times(trajectory, times), _deviations(sd, name)
    offset = _antenna(trajectory, t, lever_arm, name) + sd * rng.standard_normal((len(t), 3))
    y = displaced(interpolated(trajectory, t).lla, offset)
    return Aiding("position", t, y, np.tile(sd, (len(t), 1)), tuple(map(float, lever_arm)), name=name)


def velocity_fixes(trajectory, times, sd, rng, lever_arm=(0.0, 0.0, 0.0), name="GNSS velocity"):
    """Aiding of antenna velocities (m/s, NED) with white noise of `sd` (3,) m/s; arguments as in `position_fixes`.

    The antenna moves with v + C_nb (omega_nb_b x lever_arm); the rate comes from the change of attitude between neighbouring samples
    (the turning of the navigation frame, v/R, stays below 2e-5 m/s per metre of lever arm at 100 m/s and is left out).
    """
    if trajectory.v_n is None:
        raise DataError(f"{name}: the trajectory has no velocity")
    t, sd = _times(trajectory, times), _deviations(sd, name)
    velocity = interpolated(trajectory, t).v_n
    if np.any(lever_arm):
        half = 0.5 * float(np.median(np.diff(trajectory.t)))
        early, late = np.clip([t - half, t + half], trajectory.t[0], trajectory.t[-1])
        moved = _antenna(trajectory, late, lever_arm, name) - _antenna(trajectory, early, lever_arm, name)
        velocity = velocity + moved / (late - early)[:, None]
    y = velocity + sd * rng.standard_normal((len(t), 3))
    return Aiding("velocity", t, y, np.tile(sd, (len(t), 1)), tuple(map(float, lever_arm)), name=name)


def interpolated(trajectory, t):
    """Position and velocity at times within the trajectory, by cubic splines, as data.Trajectory. Raises DataError."""
    from scipy.interpolate import CubicSpline
    if len(trajectory.t) < 2 or not np.all((t >= trajectory.t[0]) & (t <= trajectory.t[-1])):
        raise DataError(f"fixes are wanted at times outside the trajectory, which covers {trajectory.t[0]:g} to {trajectory.t[-1]:g} s")
    lla = CubicSpline(trajectory.t, np.c_[trajectory.lla[:, 0], np.unwrap(trajectory.lla[:, 1]), trajectory.lla[:, 2]])(t)
    lla[:, 1] = wrap(lla[:, 1])
    return Trajectory(t, lla, None if trajectory.v_n is None else CubicSpline(trajectory.t, trajectory.v_n)(t))


def _antenna(trajectory, t, lever_arm, name):
    """C_nb lever_arm, (n, 3) m NED; the attitude turns at a constant rate between samples."""
    if np.shape(lever_arm) != (3,) or not np.all(np.isfinite(lever_arm)):
        raise DataError(f"{name}: lever arm is {lever_arm!r}; it must be three numbers: forward, right, down, m")
    if not np.any(lever_arm):
        return np.zeros((len(t), 3))
    if trajectory.q_nb is None:
        raise DataError(f"{name}: a lever arm needs the trajectory's attitude, and it has none")
    from scipy.spatial.transform import Slerp
    return Slerp(trajectory.t, trajectory.rotation)(t).apply(lever_arm)


def _times(trajectory, times):
    """Times of the fixes, at samples of the trajectory where rounding alone parts them."""
    if np.ndim(times):
        t = np.asarray(times, float)
    elif 0 < times < np.inf:
        start, stop = trajectory.t[0], trajectory.t[-1]
        t = start + times * np.arange(1, int((stop - start) / times + 1e-9) + 1)
    else:
        raise DataError(f"interval between fixes is {times!r} s; it must be larger than 0")
    after = np.clip(np.searchsorted(trajectory.t, t), 1, len(trajectory.t) - 1)
    nearest = np.where(t - trajectory.t[after - 1] < trajectory.t[after] - t, trajectory.t[after - 1], trajectory.t[after])
    return np.where(np.abs(nearest - t) < 1e-9 * (1 + np.abs(t)), nearest, t)


def _deviations(sd, name):
    sd = np.broadcast_to(np.asarray(sd, float), (3,))
    if not np.all((sd > 0) & np.isfinite(sd)):
        raise DataError(f"{name}: standard deviations are {sd.tolist()}; they must be larger than 0")
    return sd
