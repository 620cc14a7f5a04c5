"""A solution at any instants and at any point of the body, with the covariance there.

Between rows positions follow a cubic through positions and velocities, velocities a line, attitudes
the shortest rotation, and covariances a line, which keeps them positive. Over a lever arm l the errors
of position, velocity, attitude and gyro bias go together: with r = C l and u = C (omega x l), all in n,

    dp' = dp - [r x] dtheta,   dv' = dv - [u x] dtheta + C [l x] db_g.
"""

from dataclasses import dataclass

import numpy as np

from ..checks import DataError, check_array
from ..core.mathematics.error_dynamics import cross_matrix
from ..data.solution import Solution, Trajectory, attitude_of
from ..data.value import Value
from ..typing import Array, ArrayLike, Mask
from ..units.time_scales import seconds_to
from .metrics import interpolate_reference

MOTION = 9
"""Errors of position, velocity and attitude: the first of the error state."""


@dataclass(frozen=True, eq=False)
class Instants(Value):
    """A solution at other instants, perhaps of another point of the body."""

    # with the standard deviations of position, velocity and attitude; NaN in gaps
    trajectory: Trajectory
    # (n, 9, 9) of these errors, SI, NaN where a filter claims none; diagonal where the solution kept
    # no covariance
    covariance: Array


def at(solution: Solution, times: ArrayLike, lever_arm: ArrayLike = (0.0, 0.0, 0.0)) -> Instants:
    """Return a solution at any instants, of a point that is a lever arm away.

    Parameters
    ----------
    solution : Solution
        With `covariance=True` the covariance is whole, else that of its standard deviations alone.
    times : array_like, shape (n,)
        s, or dates where the clock is absolute; within the span of the solution.
    lever_arm : array_like, shape (3,)
        From the point of the solution to the other one, m, body axes. It needs the angular rate, so
        the recording: a solution read from a file has none.

    Returns
    -------
    Instants
        Position, velocity and attitude (`trajectory`), and their covariance.

    Raises
    ------
    DataError
        Where a time is outside, or the lever arm cannot be applied.
    """
    t = _times(solution, times)
    arm = check_array(lever_arm, "lever_arm", (3,))
    path = interpolate_reference(solution.trajectory, t)
    if len(solution.t) < 2:
        raise DataError("times: the solution has one row, between which nothing lies")
    covariance = _interpolate_rows(solution.t, _covariance(solution), t)
    covariance[~np.isfinite(path.lla).any(axis=1) & _has_no_attitude(path)] = np.nan  # in a gap
    if arm.any():
        path, covariance = _move_to_point(solution, path, covariance, arm)
    variances = np.diagonal(covariance, axis1=1, axis2=2)[:, :MOTION]
    path = Trajectory(path.t, path.lla, path.v_n, path.q_nb, np.sqrt(variances))
    return Instants(path, covariance[:, :MOTION, :MOTION])


def _times(solution: Solution, times: ArrayLike) -> Array:
    """The instants as s (n,). Raises DataError."""
    given = np.atleast_1d(np.asarray(times))
    if given.dtype.kind not in "fiu":
        epoch = solution.meta.get("epoch")
        given = np.array([seconds_to(each, epoch, "times") for each in given])
    t = check_array(given, "times", (len(given),))
    first, last = solution.t[0], solution.t[-1]
    if outside := [each for each in t.tolist() if not first <= each <= last]:
        raise DataError(
            f"times: {outside[0]:.6g} s is outside the solution, which covers {first:.3f} to "
            f"{last:.3f} s"
        )
    return t


def _has_no_attitude(path: Trajectory) -> Mask:
    """(n,) True where no attitude is known."""
    if path.q_nb is None:
        return np.ones(len(path), bool)
    missing: Mask = np.any(np.isnan(path.q_nb), axis=1)
    return missing


def _covariance(solution: Solution) -> Array:
    """(n, 15, 15) of the rows: as it was kept, or of the standard deviations alone."""
    if solution.covariance is not None:
        return solution.covariance[:, :15, :15]
    assert solution.trajectory.std is not None  # every solution has them
    return solution.trajectory.std[:, :, None] ** 2 * np.eye(15)


def _interpolate_rows(rows: Array, values: Array, t: Array) -> Array:
    """The values (n, ...) of rows at times t, linear between them."""
    right = np.clip(np.searchsorted(rows, t), 1, len(rows) - 1)
    share = (t - rows[right - 1]) / (rows[right] - rows[right - 1])
    weight = share.reshape(-1, *[1] * (values.ndim - 1))
    return (1 - weight) * values[right - 1] + weight * values[right]


def _move_to_point(
    solution: Solution, path: Trajectory, covariance: Array, arm: Array
) -> tuple[Trajectory, Array]:
    """The trajectory and covariance (n, 15, 15) of the point at the end of a lever arm. Raises
    DataError."""
    if solution.recording is None:
        raise DataError(
            "lever_arm: the solution has no recording, so its angular rate is not known; fuse the "
            "recording again, or leave the lever arm out"
        )
    if path.q_nb is None or path.v_n is None:
        raise DataError("lever_arm: the solution has no attitude or no velocity to apply it with")
    imu = solution.recording.imu
    sample = np.clip(np.searchsorted(imu.t, path.t), 0, len(imu.t) - 1)
    omega = imu.dtheta[sample] / imu.dt[sample, None]
    omega -= np.nan_to_num(_interpolate_rows(solution.t, solution.b_g, path.t))
    C = attitude_of(path).as_matrix()
    J = np.tile(np.eye(15), (len(path.t), 1, 1))
    J[:, :3, 6:9] = [-cross_matrix(each) for each in C @ arm]
    J[:, 3:6, 6:9] = [
        -cross_matrix(each) for each in np.einsum("nij,nj->ni", C, np.cross(omega, arm))
    ]
    J[:, 3:6, 12:15] = C @ cross_matrix(arm)
    # what depends on a state that the filter claims nothing of is not claimed either
    unclaimed = np.isnan(np.diagonal(covariance, axis1=1, axis2=2))
    unclaimed = np.einsum("nij,nj->ni", (J != 0).astype(float), unclaimed.astype(float)) > 0
    covariance = J @ np.nan_to_num(covariance) @ J.transpose(0, 2, 1)
    covariance[unclaimed[:, :, None] | unclaimed[:, None, :]] = np.nan
    # white noise of the gyros, which the rate is measured with
    L = J[:, 3:6, 12:15]
    density = solution.meta.get("noise", {}).get("gyro", 0.0)
    covariance[:, 3:6, 3:6] += L @ L.transpose(0, 2, 1) * (density**2 / imu.dt[sample, None, None])
    return path.displaced(arm, omega), covariance
