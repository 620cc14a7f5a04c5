"""Distance of a trajectory from a reference: errors in metres, m/s and radians, and their root mean
squares.

Errors are true - estimate, as everywhere: position in metres NED, attitude as the rotation vector
of `q_true (x) q_est*` in n.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeGuard

import numpy as np

from ..checks import DataError, check_type, check_window
from ..core.mathematics.rotation import quaternion_to_euler
from ..data.recording import Recording
from ..data.solution import Solution, Trajectory
from ..data.value import Value
from ..geometry.geodesy import displacement, radii, wrap
from ..geometry.rotation_products import slerp, turns_between, unit
from ..typing import Array, Ints, Mask

NED_AXES, EULER = ("north", "east", "down"), ("roll", "pitch", "heading")
"""Names of the columns of errors."""


@dataclass(frozen=True, eq=False)
class Errors(Value):
    """true - estimate at times `t`; NaN where reference or estimate does not know it, and in gaps of
    the reference.

    Attributes
    ----------
    t : (n,) array
        Times, s.
    position : (n, 3) array
        m, north, east, down.
    velocity : (n, 3) array
        m/s, north, east, down.
    attitude : (n, 3) array
        Rotation vector in the navigation frame, rad.
    rph : (n, 3) array
        Roll, pitch and heading, wrapped to [-pi, pi), rad.
    std : (n, k) array or None
        The trajectory's own standard deviations, m, m/s and rad.
    rows : slice
        Rows of the trajectory that these errors belong to.
    """

    t: Array
    position: Array
    velocity: Array
    attitude: Array
    rph: Array
    std: Array | None
    rows: slice

    @property
    def horizontal(self) -> Array:
        """(n,) horizontal position error, m; NaN where it is not known."""
        return np.hypot(self.position[:, 0], self.position[:, 1])

    def rms(self, window: tuple[float, float] | None = None) -> Rms:
        """Return their root mean square over window = (start, stop) in s, both included, or over all
        of them."""
        return rms(self, window)

    def outages(self, windows: Iterable[tuple[float, float]]) -> list[Outage]:
        """Return an Outage for each window (start, stop) in s, both included, as `strapdown.outages`.
        Raises DataError."""
        return outages_of(self, windows)

    def inside(self, window: tuple[float, float] | None) -> Mask:
        """(n,) which rows are in the window (start, stop) s, both included; all without one."""
        start, stop = (-np.inf, np.inf) if window is None else check_window(window)
        return (self.t >= start) & (self.t <= stop)


@dataclass(frozen=True, eq=False)
class Rms(Value):
    """Root mean square of errors per axis; NaN where no error is known in the time asked for.

    Attributes
    ----------
    position : (3,) array
        m, north, east, down.
    velocity : (3,) array
        m/s, north, east, down.
    attitude : (3,) array
        Rotation vector, rad.
    rph : (3,) array
        Roll, pitch and heading, rad.
    angles : (3,) array
        Total, inclination and heading angle as in `attitude_angles`, rad.
    """

    position: Array
    velocity: Array
    attitude: Array
    rph: Array
    angles: Array


def errors(trajectory: Trajectory | Solution, reference: Trajectory) -> Errors:
    """Return true minus estimated position, velocity and attitude, at the times of the estimate
    inside the span of the reference.

    The reference is interpolated: position by a cubic through its positions and velocities (linear
    without velocities), velocity linearly, attitude along the shortest rotation. Its gaps (intervals
    beyond 1 s and three usual intervals) are not bridged. A reference or a solution of attitude alone,
    whose positions are NaN, is scored on attitude alone, one that knows its height on that too.

    Parameters
    ----------
    trajectory : Trajectory or Solution
        The estimate.
    reference : Trajectory
        The truth, such as `recording.reference`.

    Returns
    -------
    Errors
        (n, 3) each: position m and velocity m/s in NED, attitude as a rotation vector in NED, rad, and
        as roll, pitch and heading, rad.

    Raises
    ------
    DataError
        Where the two do not overlap in time.

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> errors = sd.errors(sd.fuse(recording), recording.reference)
    >>> errors.position.shape[1]
    3
    """
    estimate = trajectory.trajectory if isinstance(trajectory, Solution) else trajectory
    check_type(estimate, "errors: trajectory", Trajectory, "a Trajectory or a Solution")
    check_type(
        reference, "errors: reference", Trajectory, "a Trajectory, such as recording.reference"
    )
    first, last = (
        np.searchsorted(estimate.t, reference.t[[0, -1]]) if len(reference.t) > 1 else (0, 0)
    )
    last += last < len(estimate) and len(reference.t) > 1 and estimate.t[last] == reference.t[-1]
    if last <= first:
        raise DataError(
            f"the reference ({reference!r}) covers no time of the solution ({estimate!r}); check "
            f"the time base of both"
        )
    rows = slice(int(first), int(last))
    t = estimate.t[rows]
    position = velocity = attitude = rph = np.full((len(t), 3), np.nan)
    if any_known(reference.lla) and any_known(estimate.lla):
        position = displacement(_position(reference, t), estimate.lla[rows])
    if any_known(reference.v_n) and any_known(estimate.v_n):
        velocity = _linear(reference.t, reference.v_n, t) - estimate.v_n[rows]
    if any_known(reference.q_nb) and any_known(estimate.q_nb):
        attitude, rph = _attitude(reference.t, reference.q_nb, t, estimate.q_nb[rows])
    return Errors(
        t,
        position,
        velocity,
        attitude,
        rph,
        None if estimate.std is None else estimate.std[rows],
        rows,
    )


def interpolate_reference(reference: Trajectory, t: Array) -> Trajectory:
    """The Trajectory of a reference at times t (n,), s, interpolated as for `errors`: NaN
    outside its span and in its gaps, None where nothing is known."""
    v_n = _linear(reference.t, reference.v_n, t) if any_known(reference.v_n) else None
    q_nb = (
        _interpolate_attitude(reference.t, reference.q_nb, t) if any_known(reference.q_nb) else None
    )
    return Trajectory(t, _position(reference, t), v_n, q_nb)


def any_known(values: Array | None) -> TypeGuard[Array]:
    """True where an array has a finite number; it may be None, or NaN where nothing is known."""
    return values is not None and bool(np.isfinite(values).any())


class AttitudeAngles(NamedTuple):
    """Attitude errors as angles without sign, rad, (n,) each; NaN where the errors
    are."""

    total: Array  # of the whole rotation, [0, pi]
    inclination: Array  # between true and estimated vertical, [0, pi]
    # of the turn about the vertical that is left once the verticals are brought together, [0, pi]
    heading: Array


def attitude_angles(errors: Errors) -> AttitudeAngles:
    """AttitudeAngles of `errors`.

    With q = q_true (x) q_est* in n: inclination 2 acos(sqrt(w^2 + z^2)), heading 2 atan2(|z|, |w|);
    q is their product, so that cos(total/2) = cos(inclination/2) cos(heading/2). Unlike roll and
    pitch these have no singular attitude. Laidig et al. (2021), BROAD.
    """
    total = np.linalg.norm(errors.attitude, axis=1)
    x, y, z = (
        errors.attitude * (np.sinc(total / (2 * np.pi)) / 2)[:, None]
    ).T  # sin(total/2) along the axis
    w = np.cos(total / 2)
    return AttitudeAngles(
        total, 2 * np.arctan2(np.hypot(x, y), np.hypot(w, z)), 2 * np.arctan2(np.abs(z), np.abs(w))
    )


def rms(errors: Errors, window: tuple[float, float] | None = None) -> Rms:
    """Return the root mean square of errors per axis.

    Parameters
    ----------
    errors : Errors
        As `errors` gives them.
    window : (float, float), optional
        Start and stop, s, both included; by default all of them.

    Returns
    -------
    Rms
        (3,) each: position m and velocity m/s in NED, attitude rad; NaN where no error is known.

    Raises
    ------
    DataError
        Where `errors` is no Errors, or the window is not (start, stop).

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> errors = sd.errors(sd.fuse(recording), recording.reference)
    >>> sd.rms(errors, (30.0, 60.0)).position.shape
    (3,)
    """
    check_type(errors, "errors", Errors, "Errors, such as sd.errors gives")
    inside, angles = errors.inside(window), attitude_angles(errors)
    parts = (errors.position, errors.velocity, errors.attitude, errors.rph, np.column_stack(angles))
    return Rms(*(_rms(part[inside]) for part in parts))


def _known_rows(values: Array) -> Mask:
    """(n,) which rows of values (n, k) are finite in all columns."""
    known: Mask = np.all(np.isfinite(values), axis=1)
    return known


def _rms(values: Array) -> Array:
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.sqrt((np.where(known, values, 0.0) ** 2).sum(axis=0) / np.where(count, count, np.nan))


def _brackets(t_ref: Array, known: Mask, t: Array) -> tuple[Ints, Ints]:
    """The rows of the reference that are known and advance in time, and where each time falls
    among them: left index, or -1 in a gap."""
    rows = np.flatnonzero(known)
    rows = rows[np.r_[True, t_ref[rows][1:] > np.maximum.accumulate(t_ref[rows])[:-1]][: len(rows)]]
    if len(rows) < 2:
        return rows, np.full(len(t), -1)
    times = t_ref[rows]
    left = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(rows) - 2)
    steps = np.diff(times)
    usable = (
        (t >= times[0])
        & (t <= times[-1])
        & ((steps <= max(1.0, 3 * np.median(steps)))[left] | np.isin(t, times))
    )
    return rows, np.where(usable, left, -1)


def _linear(t_ref: Array, values: Array, t: Array) -> Array:
    """The columns of `values` at times t; one that is nowhere known is NaN and does not keep the
    others from being known."""
    columns = np.flatnonzero(np.isfinite(values).any(axis=0))
    rows, left = _brackets(t_ref, _known_rows(values[:, columns]), t)
    out = np.full((len(t), values.shape[1]), np.nan)
    inside = left >= 0
    for i in columns if inside.any() else ():
        out[inside, i] = np.interp(t[inside], t_ref[rows], values[rows, i])
    return out


def _position(reference: Trajectory, t: Array) -> Array:
    """The reference's latitude, longitude and height at times t; its longitude is unwrapped
    first."""
    lla = reference.lla.copy()
    known = _known_rows(lla)
    lla[known, 1] = np.unwrap(lla[known, 1])
    if reference.v_n is None:
        return _linear(reference.t, lla, t)
    rows, left = _brackets(reference.t, known & _known_rows(reference.v_n), t)
    out, inside = _linear(reference.t, lla, t), left >= 0
    if inside.any():
        R_M, R_N = radii(lla[rows, 0])
        h, v = lla[rows, 2], reference.v_n[rows]
        rates = np.c_[v[:, 0] / (R_M + h), v[:, 1] / ((R_N + h) * np.cos(lla[rows, 0])), -v[:, 2]]
        out[inside] = _hermite(reference.t[rows], lla[rows], rates, left[inside], t[inside])
    return out


def _hermite(t_ref: Array, values: Array, rates: Array, left: Ints, t: Array) -> Array:
    """(m, k) values at times t (m,) between the rows `left` (m,) and the next, by the cubic with the
    values and rates (n, k) of both."""
    step = (t_ref[left + 1] - t_ref[left])[:, None]
    x = (t - t_ref[left])[:, None] / step
    y = 1 - x
    return np.asarray(
        y * y * ((1 + 2 * x) * values[left] + x * step * rates[left])
        + x * x * ((1 + 2 * y) * values[left + 1] - y * step * rates[left + 1])
    )


def _interpolate_attitude(t_ref: Array, q_ref: Array, t: Array) -> Array:
    """(n, 4) the attitude of the reference at times t, NaN where it is not known."""
    rows, left = _brackets(t_ref, _known_rows(q_ref), t)
    out, inside = np.full((len(t), 4), np.nan), left >= 0
    if inside.any():
        left, times = left[inside], t_ref[rows]
        share = (t[inside] - times[left]) / (times[left + 1] - times[left])
        out[inside] = slerp(unit(q_ref[rows]), left, share)
    return out


def _attitude(t_ref: Array, q_ref: Array, t: Array, q_nb: Array) -> tuple[Array, Array]:
    """Rotation vector and errors of roll, pitch and heading (n, 3), rad, at times t (n,), of an
    estimate q_nb (n, 4); NaN where either attitude is not known."""
    true, estimate = _interpolate_attitude(t_ref, q_ref, t), unit(q_nb)
    angles = quaternion_to_euler(true) - quaternion_to_euler(estimate)
    return turns_between(true, estimate), wrap(angles)


class Outage(NamedTuple):
    """Error that a solution reached while its fixes were withheld."""

    start: float  # s
    stop: float  # s
    horizontal_max: float  # m, largest horizontal error within
    horizontal_end: float  # m, at the end
    down_max: float  # m, largest vertical error within
    rms: Array  # (3,) m NED


def outages(
    solution: Trajectory | Solution, reference: Trajectory, windows: Iterable[tuple[float, float]]
) -> list[Outage]:
    """Return the errors that a solution reached while its fixes were withheld, window by window.

    It is scored at its own times against the reference, without any alignment of the two.

    Parameters
    ----------
    solution : Trajectory or Solution
        Of a recording whose fixes were withheld there (`Recording.hidden`).
    reference : Trajectory
        The truth.
    windows : iterable of (float, float)
        Start and stop of each, s, both included.

    Returns
    -------
    list of Outage
        One for each window.

    Raises
    ------
    DataError
        Where a window covers no time of solution or reference.

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> solution = sd.fuse(recording.hidden([(30.0, 50.0)]))
    >>> len(sd.outages(solution, recording.reference, [(30.0, 50.0)]))
    1
    """
    check_type(solution, "solution", Trajectory | Solution, "a Solution or a Trajectory")
    return outages_of(errors(solution, reference), windows)


def outages_of(e: Errors, windows: Iterable[tuple[float, float]]) -> list[Outage]:
    """As `outages`, of the Errors of a solution."""
    if not any_known(e.horizontal):
        raise DataError(
            "outages are scored by position, which solution and reference have not both; choose "
            "another filter"
        )
    check_type(windows, "windows", Iterable, "an iterable of (start, stop) in s")
    scores = []
    for start, stop in (check_window(each, "one of windows") for each in windows):
        inside = (e.t >= start) & (e.t <= stop) & np.isfinite(e.position).all(axis=1)
        if not inside.any():
            raise DataError(
                f"outage {start:g}-{stop:g} s: solution and reference have no time in common there; "
                f"choose another window"
            )
        horizontal, p = e.horizontal[inside], e.position[inside]
        scores.append(
            Outage(
                float(start),
                float(stop),
                float(horizontal.max()),
                float(horizontal[-1]),
                float(abs(p[:, 2]).max()),
                _rms(p),
            )
        )
    return scores


def moving_windows(
    of: Recording | Trajectory, count: int, length: float, every: float, after: float, speed: float
) -> list[tuple[float, float]]:
    """`count` windows of `length` s, one `every` s, the first `after` s past the first time that
    the reference, that of a Recording, is faster than `speed` m/s. Raises DataError."""
    reference = of.reference if isinstance(of, Recording) else of
    if reference is None or not any_known(reference.v_n):
        raise DataError("the reference has no velocity: windows after a speed cannot be chosen")
    fast = np.hypot(reference.v_n[:, 0], reference.v_n[:, 1]) >= speed
    if not fast.any():
        raise DataError(f"the reference is never faster than {speed:g} m/s; choose a lower speed")
    first = float(reference.t[np.argmax(fast)]) + after
    return [(first + k * every, first + k * every + length) for k in range(count)]
