"""A filter's InitialState from the first seconds of a Recording: position and velocity from fixes,
roll and pitch from specific force, heading from the best source available.

The start is the first position fix. Where the heading can only come from the course, it is the fix
with the best course (course_heading.py). An attitude filter needs no fix and starts with the
record. `InitialState.note` states how each part was found, and `InitialState._replace` overrides
it. Source: Groves (2013) section 5.6.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu, InitialState
from ..core.mathematics.earth import GRAVITY_EQUATOR, gravity
from ..core.mathematics.rotation import matrix_to_euler
from ..data.recording import Recording, check_recording
from ..data.solution import Source
from ..data.vehicle import find as find_vehicle
from ..geometry.geodesy import displace_lla, displacement
from ..geometry.rotation_products import running_matrices
from ..preprocessing.lever_arm import lever_arm_std
from ..preprocessing.unbroken import is_covered, is_unbroken, nearest_felt
from ..sensor_models.imu import GivenImu, ImuSpec, required_imu
from ..typing import Array, Ints
from .course_heading import SURE, best_instant, courses, heading_of
from .first_fixes import UNKNOWN_SPEED, position_and_velocity, source, velocities
from .initial_heading import (
    LEVEL_STD_MOVING,
    LEVEL_STD_REST,
    UNKNOWN_STD,
    HeadingFound,
    MeanForce,
    baseline_heading,
    earth_rate_heading,
    magnetic_heading,
    mean_force,
)
from .location import place_of
from .rest import gyro_bias, moves, rests, unsteadiness
from .static_attitude import body_to_navigation, level

LEVEL_STD_GUESSED = np.radians(15.0)
UNKNOWN_ACCELERATION = 3.0  # m/s^2: acceleration that is possible between fixes
RECORD_AGE = 1.0  # s: largest distance of an attitude record from the start
REST_AGE = 30.0  # s for which the gyros propagate the level found at a rest
EARTH_RADIUS = 6.4e6  # m: standard deviation of an unknown position
GYRO_SCALE = 0.01  # of the angle turned: scale and misalignment error of a MEMS gyro
SWAYING = 0.01  # rad/s: at rest, the mean rates of single seconds scatter by less
MIN_LINE = 0.25  # s: the slope of a shorter line is noise, 8 times that over half a second
UNFELT = 0.5  # m/s^2: steady acceleration that the samples of smooth motion do not show
BACKWARDS_SPEED, BACKWARDS_FIXES, BACKWARDS = 3.0, 30, 0.9
"""m/s from which a course counts, and fixes of two antennas, nearly all of which point backwards."""
WEIGHTLESS = 0.8  # of gravity: a mean specific force that differs by more gives no level

Level: TypeAlias = tuple[float, float, float | Array, str]
"""Roll and pitch (rad), their standard deviation (rad; one, or about north and east), a note."""


def align(
    recording: Recording,
    imu: GivenImu | None = None,
    *,
    heading: float | None = None,
    heading_std: float = np.radians(2.0),
    at: float | None = None,
    position: bool = True,
) -> InitialState:
    """Return the initial state of a filter on a recording: position, velocity, attitude and their
    standard deviations.

    Parameters
    ----------
    recording : Recording
        IMU samples and, unless `position` is False, position fixes.
    imu : ImuSpec, str, path or dict, optional
        Errors of its IMU, or the name of its grade, as for `imu`; default: the IMU that the
        recording names.
    heading, heading_std : float
        rad, clockwise from true north, if you know it; otherwise `align` finds it from the
        recording.
    at : float, optional
        Time of the start, s; default: the first suitable one. The nearest fixes are used.
    position : bool
        False for an attitude filter, which starts with the record and needs no fix.

    Returns
    -------
    InitialState
        Its `note` says how each part was found.

    Raises
    ------
    DataError
        If no position fix or no specific force is available for the start, or neither `imu` nor the
        recording names the IMU.

    References
    ----------
    Groves (2013), section 5.6.

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> start = sd.align(recording, "tactical")
    >>> len(start.lla), len(start.std)
    (3, 15)
    """
    check_recording(recording)
    spec = required_imu(recording.meta.get("grade") if imu is None else imu)
    if at is not None and not recording.span[0] <= at < recording.span[1]:
        raise DataError(
            f"cannot start at {at:g} s; the IMU record covers {recording.span[0]:.3f} to "
            f"{recording.span[1]:.3f} s"
        )
    if at is not None and not is_covered(recording.imu, np.array([at])).all():
        raise DataError(
            f"cannot start at {at:g} s, in a gap of the IMU record; the nearest time with samples is "
            f"{nearest_felt(recording.imu, at)[1]:.3f} s"
        )
    given = (
        None
        if heading is None
        else HeadingFound(float(heading), float(heading_std), "heading given")
    )
    if not position:
        return _attitude_start(recording, spec, given, recording.span[0] if at is None else at)
    fixes, velocity = position_and_velocity(recording)
    if fixes is None:
        names = [a.name or a.kind for a in recording.sources if a.kind == "position"]
        raise DataError(
            f"no position fix to start from: none that can be used came from {', '.join(names)}"
            if names
            else "no position fix to start from: add a source of positions, or give start= (in "
            "Python), or choose an attitude filter (attitude-mekf, mahony, vru)"
        )
    if at is None:
        first = _first_felt(recording, fixes.t)
        heading_known = _heading(recording, spec, first, given, np.zeros(3), fixes.y[0]).known
        at = first if heading_known else _instant(recording, fixes, velocity)
    moment = _moment(recording, spec, fixes, velocity, at)
    found = _heading(recording, spec, at, given, moment.b_g, fixes.y[moment.nearest])
    return _start_heading(recording, moment, _or_course(found, recording, fixes, velocity, at))


def starts_around(
    recording: Recording, imu: ImuSpec, t: float, headings: Iterable[HeadingFound]
) -> list[InitialState]:
    """Return initial states at t (s), one for each of these headings."""
    fixes, velocity = position_and_velocity(recording)
    assert fixes is not None  # the caller has an InitialState, and so a fix
    moment = _moment(recording, imu, fixes, velocity, t)
    return [_start_heading(recording, moment, heading) for heading in headings]


class _Felt(NamedTuple):
    """Means over the same seconds around an instant."""

    f: Array  # (3,) specific force, m/s^2, in the body axes of that instant
    acceleration: Array  # (3,) m/s^2, NED, from the fixes
    std: float  # rad, of the level that both give


class _Moment(NamedTuple):
    """Data of an instant that give its heading and its level."""

    t: float  # s
    fixes: Source  # positions
    nearest: int  # row of them
    velocity: Source | None
    v: Array  # m/s NED
    v_std: Array  # m/s
    rest: list[Ints]  # that begin before t
    omega: Array  # rad/s, body
    f: Array  # m/s^2, body
    spin: Array  # rad/s^2, body
    b_g: Array  # rad/s, gyro bias
    bias_std: Array  # m/s^2 and rad/s, of both biases
    force: MeanForce | None
    felt: _Felt | None  # None where a rest gives the level, or fixes are too few
    note: str  # on the gyro bias

    def gives_level(self, imu: Imu) -> bool:
        """True where a rest gives the level."""
        return _age(imu, self.rest, self.t) < REST_AGE


def _moment(
    recording: Recording, imu: ImuSpec, fixes: Source, velocity: Source | None, t: float
) -> _Moment:
    rest = rests(recording, t)
    b_g, bg_std, note = gyro_bias(recording.imu, imu, t, rest)
    b_a_std = imu.bias_std()[0]
    moment = _Moment(
        t,
        fixes,
        int(np.argmin(np.abs(fixes.t - t))),
        velocity,
        *_velocity(fixes, velocity, t),
        rest.before,
        *_rates(recording, t, b_g),
        b_g,
        np.r_[np.full(3, b_a_std), bg_std],
        mean_force(recording, t, b_g),
        None,
        note,
    )
    return moment._replace(felt=_mean_force(recording, moment))


def _start_heading(recording: Recording, moment: _Moment, heading: HeadingFound) -> InitialState:
    """The InitialState at that moment and heading."""
    t, fixes, k = moment.t, moment.fixes, moment.nearest
    psi = heading.heading
    roll, pitch, level_std, level_note = (
        _level_at_rest(moment.force, moment.bias_std[0], _sways(recording.imu, moment.rest))
        if heading.at_rest and moment.force
        else _level(recording, moment, heading)
    )
    if record := _recorded_attitude(recording, t, moment.b_g):
        roll, pitch, level_std, level_note = _level_recorded(record, psi)
    C = body_to_navigation(roll, pitch, psi)
    arm, swinging = C @ _arm(fixes), _arm(moment.velocity)
    swing = C @ np.cross(moment.omega, swinging)
    v = moment.v - swing
    lla = displace_lla(fixes.y[k], v * (t - fixes.t[k]) - arm)
    attitude_std = np.r_[np.broadcast_to(level_std, 2), heading.std]
    # effect of attitude and rate errors through the lever arms
    v_std = np.hypot(
        lever_arm_std(moment.v_std, swing, attitude_std),
        np.linalg.norm(moment.bias_std[3:]) * np.linalg.norm(swinging),
    )
    lla_std = lever_arm_std(np.hypot(fixes.std[k], abs(t - fixes.t[k]) * v_std), arm, attitude_std)
    std = [*lla_std, *v_std, *attitude_std, *moment.bias_std]
    return _start(
        t,
        lla,
        v,
        (roll, pitch, psi),
        moment.b_g,
        std,
        f"position and velocity at {t:.2f} s, {heading.note}, {level_note}, {moment.note}",
    )._replace(motion=_motion(moment, C, lla, v))


def _motion(moment: _Moment, C: Array, lla: Array, v: Array) -> tuple[float, ...]:
    """`InitialState.motion`."""
    down, omega = np.array([0.0, 0.0, gravity(np.sin(lla[0]), lla[2])]), moment.omega
    swing = np.cross(omega, _arm(moment.fixes))
    arm = _arm(moment.velocity)
    whirl = np.cross(omega, np.cross(omega, arm)) + np.cross(moment.spin, arm)
    return tuple(np.r_[omega, v + C @ swing, C @ (moment.f + whirl) + down].tolist())


def _start(
    t: float,
    lla: Array,
    v: Array,
    rph: tuple[float, float, float],
    b_g: Array,
    std: Iterable[float],
    note: str,
) -> InitialState:

    def numbers(values: Iterable[float]) -> tuple[float, ...]:
        return tuple(float(value) for value in values)

    return InitialState(
        float(t),
        numbers(lla),
        numbers(v),
        numbers(rph),
        (0.0, 0.0, 0.0),
        numbers(b_g),
        numbers(std),
        note,
    )


def _attitude_start(
    recording: Recording, imu: ImuSpec, given: HeadingFound | None, t: float
) -> InitialState:
    """Return an InitialState for an attitude filter: level from a rest or else the mean specific
    force; position and velocity where they are known."""
    fixes, velocity = position_and_velocity(recording)
    lla, lla_std, place_note = _place(recording, fixes, t)
    v, v_std = np.zeros(3), np.full(3, UNKNOWN_SPEED)
    if fixes is not None and fixes.t[0] - 1 <= t <= fixes.t[-1] + 1:
        v, v_std = _velocity(fixes, velocity, t)
    b_a_std = imu.bias_std()[0]
    found = rests(recording, t)
    rest = found.before
    b_g, bg_std, bias_note = gyro_bias(recording.imu, imu, t, found)
    place = lla if np.isfinite(lla_std).all() else None
    psi, psi_std, psi_note, still = _or_course(
        _heading(recording, imu, t, given, b_g, place), recording, fixes, velocity, t
    )
    force = mean_force(recording, t, b_g)
    assert force is not None  # samples reach to t
    age = _age(recording.imu, rest, t)
    record = _recorded_attitude(recording, t, b_g)
    if force.off > WEIGHTLESS and not record:
        raise DataError(
            f"cannot level: the mean specific force at {t:.2f} s is {np.linalg.norm(force.f):.3g} "
            f"m/s^2, far from gravity; "
            "start at another time, or give start= (in Python)"
        )
    levelled: Level
    if record:
        levelled = _level_recorded(record, psi)
    elif still or age <= 0:
        levelled = _level_at_rest(force, b_a_std, _sways(recording.imu, rest))
    else:
        levelled = min(
            _levels_in_motion(recording, t, rest, age, force, b_a_std, b_g),
            key=lambda found: found[2],
        )
    roll, pitch, level_std, level_note = levelled
    lla_std = np.where(np.isfinite(lla_std), lla_std, EARTH_RADIUS)
    std = [*lla_std, *v_std, *np.broadcast_to(level_std, 2), psi_std, *[b_a_std] * 3, *bg_std]
    when = 0.0 if abs(t) < 0.005 else t
    return _start(
        t,
        lla,
        v,
        (roll, pitch, psi),
        b_g,
        std,
        f"attitude at {when:.2f} s, {psi_note}, {level_note}, {bias_note}, {place_note}",
    )


def _levels_in_motion(
    recording: Recording,
    t: float,
    rest: list[Ints],
    age: float,
    force: MeanForce,
    b_a_std: float,
    b_g: Array,
) -> list[tuple[float, float, float, str]]:
    """Return [(roll, pitch, std, note)] from the MeanForce and, where a rest ended `age` (s) ago,
    from that rest and the gyros with their scale error."""
    found = [
        (
            *level(force.f),
            float(np.linalg.norm([LEVEL_STD_MOVING, b_a_std / GRAVITY_EQUATOR, force.off])),
            "level from specific force alone",
        )
    ]
    if age < REST_AGE:
        roll, pitch, std, note = _level_from_rest(recording, t, rest, b_g, b_a_std)
        turned = np.linalg.norm(
            recording.imu.dtheta[slice(*np.searchsorted(recording.imu.t, [t - age, t]))], axis=1
        ).sum()
        found.append((roll, pitch, np.hypot(std, GYRO_SCALE * turned), note))
    return found


class AlignmentRecord(NamedTuple):
    """Roll, pitch, heading (rad, NaN where it has none), standard deviations forward, right and
    down (rad), and the source's name."""

    rph: tuple[float, float, float]
    std: Array
    name: str


def _recorded_attitude(recording: Recording, t: float, b_g: Array) -> AlignmentRecord | None:
    """Return the AlignmentRecord of the attitude nearest to t, propagated to t with the gyro rate
    less the bias b_g (rad/s); None without one within `RECORD_AGE`."""
    imu = recording.imu
    for a in recording.sources:
        near: Ints = (
            np.flatnonzero(np.isfinite(a.y[:, :2]).all(axis=1) & (np.abs(a.t - t) <= RECORD_AGE))
            if a.kind == "attitude"
            else np.empty(0, int)
        )
        k = near[np.argmin(np.abs(a.t[near] - t))] if len(near) else -1
        if len(near) and is_unbroken(imu, a.t[k], t):
            between = slice(*np.searchsorted(imu.t, sorted((a.t[k], t)), side="right"))
            turns = imu.dtheta[between] - b_g * imu.dt[between, None]
            rph = _rotate_attitude(a.y[k], turns, t < a.t[k])
            return AlignmentRecord(
                rph,
                np.hypot(a.std[k], GYRO_SCALE * np.linalg.norm(turns, axis=1).sum()),
                a.name or a.kind,
            )
    return None


def _rotate_attitude(
    rph: tuple[float, float, float], dtheta: Array, back: bool
) -> tuple[float, float, float]:
    """Return roll, pitch, heading (rad; a NaN stays NaN) after the rotation increments dtheta (n,
    3), rad, or before them."""
    turn = running_matrices(np.vstack([np.zeros(3), dtheta]))[-1]
    C = body_to_navigation(rph[0], rph[1], np.nan_to_num(rph[2])) @ (turn.T if back else turn)
    roll, pitch, heading = matrix_to_euler(C)
    return roll, pitch, heading if np.isfinite(rph[2]) else np.nan


def _level_recorded(record: AlignmentRecord, psi: float) -> tuple[float, float, Array, str]:
    """Return roll, pitch, their standard deviations about north and east, and a note, from an
    AlignmentRecord at the heading psi (rad)."""
    c, s, (forward, right, _) = np.cos(psi), np.sin(psi), record.std
    return (
        *record.rph[:2],
        np.hypot([c * forward, s * forward], [s * right, c * right]),
        f"roll and pitch from {record.name}",
    )


def _place(recording: Recording, fixes: Source | None, t: float) -> tuple[Array, Array, str]:
    """Return the position (rad, rad, m), its standard deviation (m) and a note: the recording's
    place, else the fix nearest to t, else the equator with an infinite std."""
    found = place_of(recording.meta, [fixes] if fixes is not None else [], t)
    return found or (
        np.zeros(3),
        np.full(3, np.inf),
        "place unknown: 0 deg latitude assumed; give place",
    )


def _arm(source: Source | None) -> Array:
    """Lever arm from the IMU to the antenna of a source, m, body."""
    return np.array((tuple(source.parameters) if source is not None else ()) + (0.0, 0.0, 0.0))[:3]


def _rates(recording: Recording, t: float, b_g: Array) -> tuple[Array, Array, Array]:
    """Return the angular rate at t (rad/s, less the gyro bias), the mean specific force (m/s^2) and
    the angular acceleration (rad/s^2).

    A straight line is fitted to the rates of half a second before and after t without a gap. Its
    slope is the angular acceleration, or 0 where the samples span less than `MIN_LINE`.
    """
    imu, (near, _) = recording.imu, nearest_felt(recording.imu, t)
    rows = slice(
        *np.clip(
            np.searchsorted(imu.t, [t - 0.5, t + 0.5 + 1e-9]),
            [near.start, near.start + 1],
            [near.stop - 1, near.stop],
        )
    )
    dt = imu.dt[rows]
    seconds, after = dt.sum(), imu.t[rows] - 0.5 * dt - t
    mean, rate = after @ dt / seconds, imu.dtheta[rows].sum(axis=0) / seconds
    away = after - mean
    slope = away @ imu.dtheta[rows] / max(away**2 @ dt, 1e-9) * (seconds > MIN_LINE)
    return rate - mean * slope - b_g, imu.dv[rows].sum(axis=0) / seconds, slope


def _instant(recording: Recording, position: Source, velocity: Source | None) -> float:
    """Return the time to start at where the heading can only come from the course: that of the best
    course, else that of the first fix."""
    found = courses(recording.imu, position, velocity)
    best = best_instant(found, recording.imu) if not _by_thrust(recording) else None
    return _first_felt(recording, found.t if best is None else found.t[best:])


def _first_felt(recording: Recording, t: Array) -> float:
    """Return the first of the fix times t that lies outside all gaps of the samples; where none
    does, the time with samples nearest to the first."""
    inside = t[is_covered(recording.imu, t)]
    return float(inside[0]) if len(inside) else nearest_felt(recording.imu, float(t[0]))[1]


def _age(imu: Imu, rest: list[Ints], t: float) -> float:
    """s from the end of the last rest to t; inf without a rest or with missing samples in
    between."""
    end = float(imu.t[rest[-1][-1]]) if rest else t
    return t - end if rest and is_unbroken(imu, end, t) else np.inf


def _by_thrust(recording: Recording) -> bool:
    """True where the vehicle's course is not its heading, as for a multicopter."""
    return find_vehicle(recording.meta.get("vehicle")).by_thrust


def _velocity(position: Source, velocity: Source | None, at: float) -> tuple[Array, Array]:
    """Return the velocity (m/s) at an instant, interpolated between fixes, and its standard
    deviation."""
    t, v, std = velocities(position, velocity)
    k = int(np.argmin(np.abs(t - at)))
    return (
        np.array([np.interp(at, t, column) for column in v.T]),
        np.hypot(std[k], UNKNOWN_ACCELERATION * abs(at - t[k])),
    )


def _heading(
    recording: Recording,
    imu: ImuSpec,
    t: float,
    given: HeadingFound | None,
    b_g: Array,
    place: Sequence[float] | Array | None,
) -> HeadingFound:
    """Return the HeadingFound at t without the course: given, from an attitude record, measured, or
    from the magnetic field or the Earth's rate, whichever has the smaller standard deviation."""
    if given is not None:
        return given
    record = _recorded_attitude(recording, t, b_g)
    if record and record.std[2] < UNKNOWN_STD and np.isfinite(record.rph[2]):
        return HeadingFound(record.rph[2], float(record.std[2]), f"heading from {record.name}")
    compass = source(recording, "heading")
    if compass is not None:
        k = int(np.argmin(np.abs(compass.t - t)))
        away = np.linalg.norm(_rates(recording, t, b_g)[0]) * (t - compass.t[k])
        return HeadingFound(
            float(compass.y[k, 0]), float(np.hypot(compass.std[k, 0], away)), "heading measured"
        )
    pair = source(recording, "baseline")
    by_antennas = baseline_heading(recording, pair, t, b_g, LEVEL_STD_MOVING)
    if by_antennas is not None and by_antennas.known:
        if pair is None or not _is_reversed(recording, pair):
            return by_antennas
    field, b_a_std = source(recording, "magnetic-field"), imu.bias_std()[0]
    rest = rests(recording, t).before if field is not None else []
    tilt_std = LEVEL_STD_REST if _age(recording.imu, rest, t) < 1.0 else LEVEL_STD_MOVING
    found = [
        magnetic_heading(recording, field, t, b_g, np.hypot(tilt_std, b_a_std / GRAVITY_EQUATOR)),
        earth_rate_heading(recording, imu, t, place, lambda t: moves(recording, t)),
    ]
    return min(
        (each for each in found if each),
        key=lambda each: each.std,
        default=HeadingFound(0.0, UNKNOWN_STD, ""),
    )


def _is_reversed(recording: Recording, pair: Source) -> bool:
    """True where the vector between two antennas points backwards while the vehicle moves: they are
    swapped, and tell no heading to start from."""
    _, velocity = position_and_velocity(recording)
    if velocity is None or not find_vehicle(recording.meta.get("vehicle")).points_ahead:
        return False
    at = np.searchsorted(velocity.t, pair.t).clip(0, len(velocity.t) - 1)
    v, l, y = velocity.y[at], pair.parameters, pair.y
    fast = np.hypot(v[:, 0], v[:, 1]) > BACKWARDS_SPEED
    off = np.arctan2(y[:, 1], y[:, 0]) - np.arctan2(l[1], l[0]) - np.arctan2(v[:, 1], v[:, 0])
    back = np.cos(off[fast & np.isfinite(off)]) < 0
    return bool(len(back) >= BACKWARDS_FIXES and back.mean() > BACKWARDS)


def _or_course(
    found: HeadingFound,
    recording: Recording,
    position: Source | None,
    velocity: Source | None,
    t: float,
) -> HeadingFound:
    """Return the HeadingFound, else the heading from the course, else an unknown heading. The note
    gives the reason why an earlier one is missing."""
    if found.known:
        return found
    why = found.note and f" ({found.note})"
    if _by_thrust(recording):
        return HeadingFound(
            0.0, UNKNOWN_STD, f"heading unknown{why or ' (a multicopter has no course)'}"
        )
    if position is not None:
        course = heading_of(courses(recording.imu, position, velocity), recording.imu, t)
        if course is not None:
            return course._replace(note=course.note + why)
        why = why or f" (no speed beyond {SURE:g} standard deviations there)"
    return HeadingFound(0.0, UNKNOWN_STD, f"heading unknown{why}")


def _level(recording: Recording, moment: _Moment, heading: HeadingFound) -> Level:
    """Return roll, pitch, their standard deviation and a note: from the last rest, propagated to t
    with the gyros, else from specific force less the acceleration."""
    v, psi, felt = moment.v, heading.heading, moment.felt
    if moment.gives_level(recording.imu):
        return _level_from_rest(recording, moment.t, moment.rest, moment.b_g, moment.bias_std[0])
    if not heading.known:
        return *level(moment.f), LEVEL_STD_GUESSED, "level from specific force alone"
    if felt:
        return *level(felt.f, felt.acceleration, psi), felt.std, "level in motion"
    c, s = np.cos(psi), np.sin(psi)
    v_b = np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], 0.0])
    return (
        *level(moment.f - np.cross(moment.omega, v_b)),
        LEVEL_STD_GUESSED,
        "level in motion, without the change of speed",
    )


def _mean_force(recording: Recording, moment: _Moment) -> _Felt | None:
    """Return the mean force and acceleration from the surrounding velocity fixes, or without them
    from positions; None where a rest gives the level or there are too few fixes."""
    if moment.gives_level(recording.imu):
        return None
    velocity = moment.velocity
    between = _around(velocity.t, moment.t) if velocity is not None else None
    if velocity is None or between is None:
        return _felt_by_positions(recording, moment)
    t, v, std = (column[list(between)] for column in (velocity.t, velocity.y, velocity.std))
    noise = np.hypot(*std[:, :2]).max() / (t[1] - t[0])
    force = mean_force(recording, moment.t, moment.b_g, (t[0], t[1]))
    return force and _Felt(
        force.f,
        (v[1] - v[0]) / (t[1] - t[0]),
        float(np.hypot(LEVEL_STD_MOVING, noise / GRAVITY_EQUATOR)),
    )


def _felt_by_positions(recording: Recording, moment: _Moment) -> _Felt | None:
    """Return the mean force and acceleration from the second difference of three surrounding
    positions; their spacing balances position noise against gyro errors. None without three."""
    found = []
    for apart in (1.0, 2.0, 4.0):
        if (rows := _three(moment.fixes.t, moment.t, apart)) is None:
            continue
        t, y, std = (column[rows] for column in (moment.fixes.t, moment.fixes.y, moment.fixes.std))
        before, after = np.diff(t)
        weights = np.array([1 / before, -1 / before - 1 / after, 1 / after]) * 2 / (before + after)
        errors = [
            LEVEL_STD_MOVING,
            np.linalg.norm(weights * std[:, :2].max(axis=1)) / GRAVITY_EQUATOR,
            apart * moment.bias_std[3:].max(),
        ]
        found.append((float(np.linalg.norm(errors)), t, weights @ displacement(y, y[1])))
    found = [each for each in found if each[0] < LEVEL_STD_GUESSED]
    if not found:
        return None
    level_std, t, acceleration = min(found, key=lambda each: each[0])
    force = mean_force(recording, moment.t, moment.b_g, (t[0], t[2]), t[1])
    return force and _Felt(force.f, acceleration, level_std)


def _three(t: Array, at: float, apart: float) -> Ints | None:
    """Return the indices of three of these times (n,) around an instant, at least `apart` s from
    each other and not much more; None without them."""
    first = max(int(np.searchsorted(t, at - apart, side="right")) - 1, 0)
    middle = int(np.searchsorted(t, t[first] + apart - 1e-6))
    last = int(np.searchsorted(t, t[min(middle, len(t) - 1)] + apart - 1e-6))
    held = last < len(t) and t[first] <= at <= t[last] <= t[first] + 3 * apart
    return np.array([first, middle, last]) if held else None


def _around(t: Array, at: float) -> tuple[int, int] | None:
    """Return the indices of two of these times (n,) around an instant, one to two seconds apart;
    None without them."""
    if len(t) < 2:
        return None
    first = int(np.clip(np.searchsorted(t, at - 0.5, side="right") - 1, 0, len(t) - 2))
    last = int(np.clip(np.searchsorted(t, t[first] + 1.0 - 1e-6), first + 1, len(t) - 1))
    held = t[first] <= at <= t[last] and t[last] - t[first] <= 2.0
    return (first, last) if held else None


def _level_from_rest(
    recording: Recording, t: float, rest: list[Ints], b_g: Array, b_a_std: float
) -> tuple[float, float, float, str]:
    """Return roll, pitch, their standard deviation and a note from the last rest, propagated to t
    with the gyro rate less the bias b_g (rad/s)."""
    imu, last = recording.imu, rest[-1]
    roll, pitch = level(imu.dv[last].sum(axis=0) / imu.dt[last].sum())
    since = slice(last[-1] + 1, int(np.searchsorted(imu.t, t)))
    roll, pitch = _carry_level(roll, pitch, imu.dtheta[since] - b_g * imu.dt[since, None])
    age = max(0.0, t - imu.t[last[-1]])
    return (
        roll,
        pitch,
        np.hypot(LEVEL_STD_REST, b_a_std / GRAVITY_EQUATOR) + np.radians(0.05) * age,
        f"level from the standstill {age:.0f} s before",
    )


def _level_at_rest(
    force: MeanForce, b_a_std: float, sways: bool
) -> tuple[float, float, float, str]:
    """Return roll, pitch, their standard deviation and a note from the MeanForce of a body at rest.
    The standard deviation grows with the difference of the force from gravity, and where the body
    `sways`."""
    unfelt = UNFELT / GRAVITY_EQUATOR if sways else 0.0
    return (
        *level(force.f),
        float(np.linalg.norm([LEVEL_STD_REST, b_a_std / GRAVITY_EQUATOR, force.off, unfelt])),
        "level in smooth motion" if sways else "level at rest",
    )


def _sways(imu: Imu, rest: list[Ints]) -> bool:
    """True where a body that seems at rest rocks, as in smooth flight or on water."""
    return bool(rest) and bool(np.linalg.norm(unsteadiness(imu, rest)) > SWAYING)


def _carry_level(roll: float, pitch: float, dtheta: Array) -> tuple[float, float]:
    """Return roll and pitch after the rotation increments dtheta (n, 3), rad, which rotate the
    direction of specific force in the body."""
    turn = running_matrices(np.vstack([np.zeros(3), dtheta]))[-1]
    return level(turn.T @ body_to_navigation(roll, pitch, 0.0).T @ [0.0, 0.0, -GRAVITY_EQUATOR])
