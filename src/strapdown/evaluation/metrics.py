"""How far a trajectory is from a reference: errors in metres, m/s and radians, and their root mean
squares.

Errors are true - estimate, as everywhere: position in metres NED, attitude as the rotation vector
of `q_true (x) q_est*` in n.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeGuard

import numpy as np

from ..checks import DataError, brief
from ..core.mathematics.rotation import quaternion_to_euler
from ..data.solution import Solution, Trajectory
from ..data.value import Value
from ..geometry.geodesy import displacement, radii, wrap
from ..geometry.rotation_products import slerp, turns_between, unit
from ..typing import Array, Ints, Mask

NED_AXES, EULER = ("north", "east", "down"), ("roll", "pitch", "heading")
"""Names of the columns of errors."""


@dataclass(frozen=True, eq=False)
class Errors(Value):
    """true - estimate at times `t`. What the reference or the estimate nowhere knows is None, or
    where it is a component NaN; so are rows in gaps."""

    t: Array  # (n,) s
    position: Array | None  # (n, 3) m NED
    velocity: Array | None  # (n, 3) m/s NED
    attitude: Array | None  # (n, 3) rotation vector in n, rad
    rph: Array | None  # (n, 3) of roll, pitch and heading, wrapped to [-pi, pi), rad
    sd: Array | None  # (n, k) the trajectory's own standard deviations, m, m/s and rad
    rows: slice  # of the trajectory, which these errors belong to

    @property
    def horizontal(self) -> Array | None:
        """(n,) horizontal position error, m; NaN where only the height is known, None where not
        even that is."""
        return None if self.position is None else np.hypot(self.position[:, 0], self.position[:, 1])

    def rms(self, window: tuple[float, float] | None = None) -> Rms:
        """Return their root mean square over window = (start, stop) in s, both included, or over all
        of them."""
        return rms(self, window)

    def inside(self, window: tuple[float, float] | None) -> Mask:
        """(n,) which rows are in the window (start, stop) s, both included; all without one."""
        start, stop = (-np.inf, np.inf) if window is None else window
        return (self.t >= start) & (self.t <= stop)


class Rms(NamedTuple):
    """Root mean square of errors per axis; None where the errors are, NaN where they cover no
    time asked for or not that component."""

    position: Array | None  # (3,) m NED
    velocity: Array | None  # (3,) m/s NED
    attitude: Array | None  # (3,) rad, rotation vector
    rph: Array | None  # (3,) rad, roll, pitch, heading
    angles: Array | None  # (3,) rad, total, inclination and heading angle as in `attitude_angles`


def errors(trajectory: Trajectory | Solution, reference: Trajectory) -> Errors:
    """Errors of a Trajectory (or Solution) against a reference at the trajectory's own times inside
    the reference's span.

    The reference is interpolated: position by a cubic through its positions and velocities (linear
    without velocities), velocity linearly, attitude along the shortest rotation. Its gaps
    (intervals beyond 1 s and three usual intervals) are not bridged. A reference or a solution of
    attitude alone, whose positions are NaN, is scored on attitude alone, one that knows its height
    on that too. Raises DataError where the two do not overlap.
    """
    estimate = trajectory.trajectory if isinstance(trajectory, Solution) else trajectory
    _check_trajectory(estimate, "trajectory", "a Trajectory or a Solution")
    _check_trajectory(reference, "reference", "a Trajectory, such as recording.reference")
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
    position = velocity = attitude = rph = None
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
        None if estimate.sd is None else estimate.sd[rows],
        rows,
    )


def _check_trajectory(value: object, name: str, wanted: str) -> None:
    """Refuse what is no Trajectory. Raises DataError."""
    if not isinstance(value, Trajectory):
        raise DataError(f"errors: {name} is {brief(value)}; it must be {wanted}")


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
    """How far an attitude is off, as angles without sign, rad, (n,) each; NaN where the errors
    are."""

    total: Array  # of the whole rotation, [0, pi]
    inclination: Array  # between true and estimated vertical, [0, pi]
    # of the turn about the vertical that is left once the verticals are brought together, [0, pi]
    heading: Array


def attitude_angles(errors: Errors) -> AttitudeAngles | None:
    """AttitudeAngles of `errors`, None where they have no attitude.

    With q = q_true (x) q_est* in n: inclination 2 acos(sqrt(w^2 + z^2)), heading 2 atan2(|z|, |w|);
    q is their product, so that cos(total/2) = cos(inclination/2) cos(heading/2). Unlike roll and
    pitch these have no singular attitude. Laidig et al. (2021), BROAD.
    """
    if errors.attitude is None:
        return None
    total = np.linalg.norm(errors.attitude, axis=1)
    x, y, z = (
        errors.attitude * (np.sinc(total / (2 * np.pi)) / 2)[:, None]
    ).T  # sin(total/2) along the axis
    w = np.cos(total / 2)
    return AttitudeAngles(
        total, 2 * np.arctan2(np.hypot(x, y), np.hypot(w, z)), 2 * np.arctan2(np.abs(z), np.abs(w))
    )


def rms(errors: Errors, window: tuple[float, float] | None = None) -> Rms:
    """Root mean square of `errors` over window = (start, stop) in s, both included, or over all
    of them: an Rms."""
    inside, angles = errors.inside(window), attitude_angles(errors)
    columns = None if angles is None else np.column_stack(angles)
    parts = (errors.position, errors.velocity, errors.attitude, errors.rph, columns)
    return Rms(*(None if part is None else _rms(part[inside]) for part in parts))


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
    from scipy.interpolate import CubicHermiteSpline

    rows, left = _brackets(reference.t, known & _known_rows(reference.v_n), t)
    out, inside = _linear(reference.t, lla, t), left >= 0
    if inside.any():
        R_M, R_N = radii(lla[rows, 0])
        h, v = lla[rows, 2], reference.v_n[rows]
        rates = np.c_[v[:, 0] / (R_M + h), v[:, 1] / ((R_N + h) * np.cos(lla[rows, 0])), -v[:, 2]]
        out[inside] = CubicHermiteSpline(reference.t[rows], lla[rows], rates)(t[inside])
    return out


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
    """How far a solution went from the reference while its fixes were withheld."""

    start: float  # s
    stop: float  # s
    horizontal_max: float  # m, largest horizontal error within
    horizontal_end: float  # m, at the end
    down_max: float  # m, largest vertical error within
    rms: Array  # (3,) m NED


def outages(
    solution: Trajectory | Solution, reference: Trajectory, windows: Iterable[tuple[float, float]]
) -> list[Outage]:
    """An Outage for each (start, stop) window in s, both included, of a solution whose fixes were
    withheld there (`Recording.hidden`).

    Scored at the solution's own times against the reference, without any alignment of the two.
    Raises DataError where one covers no time of the other.
    """
    return outages_of(errors(solution, reference), windows)


def outages_of(e: Errors, windows: Iterable[tuple[float, float]]) -> list[Outage]:
    """As `outages`, of the Errors of a solution."""
    if e.position is None or not any_known(e.horizontal):
        raise DataError(
            "outages are scored by position, which solution and reference have not both; choose "
            "another filter"
        )
    scores = []
    for start, stop in windows:
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
    reference: Trajectory, count: int, length: float, every: float, after: float, speed: float
) -> list[tuple[float, float]]:
    """`count` windows of `length` s, one `every` s, the first `after` s past the first time that
    the reference is faster than `speed` m/s."""
    if not any_known(reference.v_n):
        raise DataError("the reference has no velocity: windows after a speed cannot be chosen")
    fast = np.hypot(reference.v_n[:, 0], reference.v_n[:, 1]) >= speed
    if not fast.any():
        raise DataError(f"the reference is never faster than {speed:g} m/s; choose a lower speed")
    first = float(reference.t[np.argmax(fast)]) + after
    return [(first + k * every, first + k * every + length) for k in range(count)]
