"""Transfer of measurements between points of a rigid body: an IMU to another point, fixes of an
antenna to the IMU.

With l the lever arm from a point to another in body axes, C the attitude and w the angular rate of
the body:

    specific force   f_P = f + dw/dt x l + w x (w x l)          angular rate   the same everywhere
    position         p_P = p + C l                              velocity       v_P = v + C (w x l)

Source: Fossen (2021) section 14.1 (IMU off the centre) and 14.2.2 (vertical reference unit). A
solution moves with `Trajectory.displaced`.
"""

from dataclasses import replace

import numpy as np

from ..checks import DataError, check_array
from ..core.loop.contract import Imu
from ..data.solution import Source, Trajectory, attitude_of
from ..geometry.geodesy import displace_lla
from ..geometry.rotations import Rotation, RotationPath
from ..typing import Array, ArrayLike

ARM, METRES = "lever arm", "numbers, m forward, right, down"
CONTIGUOUS = 0.5
"""Largest gap between two samples, as a part of a sample, across which their rates are differenced,
as in the loop."""


def lever_arm_of(source: Source) -> Array:
    """Return the lever arm (3,) of a source, m, body; zeros where it has none."""
    return np.array((*source.parameters, 0.0, 0.0, 0.0)[:3], float)


def specific_force_at(
    f: ArrayLike, omega: ArrayLike, omega_dot: ArrayLike, lever_arm: ArrayLike
) -> Array:
    """Return the specific force (m/s^2) at the point `lever_arm` (m, body) of a body with specific
    force f at its origin.

    f, omega (rad/s, against inertial space), omega_dot (rad/s^2): (3,) or (n, 3), body. Exact for a
    rigid body.
    """
    f, omega, omega_dot, lever_arm = (
        np.asarray(values, float) for values in (f, omega, omega_dot, lever_arm)
    )
    return f + np.cross(omega_dot, lever_arm) + np.cross(omega, np.cross(omega, lever_arm))


def imu_at(imu: Imu, lever_arm: ArrayLike) -> Imu:
    """Return the samples of an IMU with parallel axes at `lever_arm` (3,) m, body, from this one.

    Over a sample the tangential part is the change of the rate times the lever arm, between rates
    at the sample's edges that are interpolated linearly from the mean rates on both sides (central
    differences); the centripetal part is exact for a rate that changes linearly. At a frequency f,
    the tangential part is too small by (2 pi f dt)^2/6: 1.6 % at 5 Hz and 100 Hz. Gyro noise of N
    rad/sqrt(s) adds some N |l| / sqrt(dt) to the velocity, which does not grow with time. At gaps
    and at the ends, the rate is extrapolated linearly. Raises DataError.
    """
    lever_arm = check_array(lever_arm, ARM, (3,), what=METRES)
    rate = imu.dtheta / imu.dt[:, None]
    before, after = _edges(imu, rate)
    change = after - before

    def centripetal(w: Array) -> Array:
        return np.cross(w, np.cross(w, lever_arm))

    dv = (
        imu.dv
        + np.cross(change, lever_arm)
        + imu.dt[:, None] * (centripetal(rate) + centripetal(change) / 12)
    )
    return Imu(imu.t, imu.dt, imu.dtheta, dv)


def _edges(imu: Imu, rate: Array) -> tuple[Array, Array]:
    """Angular rates (n, 3) at the beginning and at the end of each sample."""
    n = len(imu.t)
    if n < 2:
        return rate.copy(), rate.copy()
    dt = imu.dt[:, None]
    joined = (np.diff(imu.t) - imu.dt[1:] < CONTIGUOUS * imu.dt[1:])[:, None]
    between = (rate[:-1] * dt[1:] + rate[1:] * dt[:-1]) / (dt[:-1] + dt[1:])
    before, after = np.full_like(rate, np.nan), np.full_like(rate, np.nan)
    before[1:], after[:-1] = np.where(joined, between, np.nan), np.where(joined, between, np.nan)
    alone = np.isnan(before) & np.isnan(after)
    before, after = (
        np.where(np.isnan(before), 2 * rate - after, before),
        np.where(np.isnan(after), 2 * rate - before, after),
    )
    return np.where(alone, rate, before), np.where(alone, rate, after)


def gnss_at(
    fixes: Source,
    attitude: Trajectory | tuple[ArrayLike, ArrayLike],
    imu: Imu | None = None,
    lever_arm: ArrayLike | None = None,
    attitude_std: ArrayLike | None = None,
    rate_std: float = 0.0,
) -> Source:
    """A Source of "position" or "velocity" moved from the antenna to the IMU: p - C l, v - C (w x
    l); its parameters become zero.

    attitude: a Trajectory with attitude (a solution's, a reference), or (t, rph) in s and rad, of a
    vertical reference unit with a compass; between its rows the body rotates uniformly. imu: Imu
    samples, whose mean rate over the sample at the fix is w, for velocities. lever_arm: (3,) m,
    body, from the IMU to the antenna, by default the fixes' own. attitude_std: (3,) rad, of the
    rotation about north, east and down, by default the trajectory's, else 0; rate_std: rad/s, of w.
    Their effect through the lever arm is added to the standard deviations. The filters of this
    library correct for the lever arm with their own attitude; use this function for other software.
    Raises DataError.
    """
    own = lever_arm_of(fixes) if lever_arm is None else lever_arm
    lever_arm = check_array(own, ARM, (3,), what=METRES)
    if fixes.kind not in ("position", "velocity"):
        raise DataError(
            f"fixes of kind {fixes.kind!r} cannot be moved; only position and velocity can"
        )
    t, turns, deviations = _attitude(attitude)
    outside = int(((fixes.t < t[0]) | (fixes.t > t[-1])).sum())
    if outside:
        raise DataError(
            f"{outside} of {len(fixes.t)} fixes are outside the attitude record ({t[0]:.3f} to "
            f"{t[-1]:.3f} s); use fixes.between(...) first"
        )
    turn = RotationPath(t, turns)(fixes.t)
    between = np.stack([np.interp(fixes.t, t, column) for column in deviations.T], axis=1)
    std = np.broadcast_to(between if attitude_std is None else attitude_std, (len(fixes.t), 3))
    if fixes.kind == "position":
        arm = turn.apply(np.array(lever_arm, float))
        return replace(
            fixes,
            y=displace_lla(fixes.y, -arm),
            std=lever_arm_std(fixes.std, arm, std),
            parameters=(0.0, 0.0, 0.0),
        )
    swing = turn.apply(np.cross(_rates(imu, fixes.t), lever_arm))
    grown = np.hypot(lever_arm_std(fixes.std, swing, std), rate_std * np.linalg.norm(lever_arm))
    return replace(fixes, y=fixes.y - swing, std=grown, parameters=(0.0, 0.0, 0.0))


def _attitude(
    attitude: Trajectory | tuple[ArrayLike, ArrayLike],
) -> tuple[Array, Rotation, Array]:
    """Times (n,), Rotations body to navigation and standard deviations (n, 3) rad of a
    Trajectory or of (t, rph). Raises DataError."""
    if isinstance(attitude, Trajectory):
        if attitude.q_nb is None:
            raise DataError("the trajectory has no attitude; give (t, rph)")
        std = (
            attitude.std[:, 6:9]
            if attitude.std is not None and attitude.std.shape[1] >= 9
            else np.zeros((len(attitude), 3))
        )
        t, turns = attitude.t, attitude_of(attitude)
    else:
        t, rph = (np.asarray(part, float) for part in attitude)
        turns, std = Rotation.from_rph(rph), np.zeros((len(t), 3))
    known = np.all(np.isfinite(turns.as_wxyz()), axis=1)
    if known.sum() < 2:
        raise DataError(
            "the attitude has fewer than two rows; fixes between its rows cannot be moved"
        )
    t = t[known]
    if not (np.diff(t) > 0).all():
        row = int(np.argmin(np.diff(t) > 0))
        raise DataError(
            f"the times of the attitude do not increase: {t[row]:.6g} s is followed by "
            f"{t[row + 1]:.6g} s; "
            "sort its rows and leave out repeated times"
        )
    return t, turns[known], np.nan_to_num(std[known])


def _rates(imu: Imu | None, at: Array) -> Array:
    """Mean angular rate (m, 3) of the samples that hold these times. Raises DataError."""
    if imu is None:
        raise DataError("to move velocities, give imu=, the samples with the angular rate")
    rows = np.searchsorted(imu.t, at)
    outside = int(((rows == len(imu.t)) | (at < imu.t[0] - imu.dt[0])).sum())
    if outside:
        raise DataError(
            f"{outside} of {len(at)} fixes are outside the IMU record ({imu.t[0] - imu.dt[0]:.3f} to "
            f"{imu.t[-1]:.3f} s); "
            "use fixes.between(...) first"
        )
    return imu.dtheta[rows] / imu.dt[rows, None]


def lever_arm_std(std: Array, arm: Array, attitude_std: Array) -> Array:
    """Return standard deviations (n, 3) or (3,) increased by the effect of a rotation error of
    `attitude_std`, about north, east, down, on `arm` in n, of the same shape."""
    north, east, down = arm.T
    a, b, c = attitude_std.T
    added = [
        (b * down) ** 2 + (c * east) ** 2,
        (a * down) ** 2 + (c * north) ** 2,
        (a * east) ** 2 + (b * north) ** 2,
    ]
    return np.sqrt(std**2 + np.stack(added, axis=-1))
