"""The constants of an installation that a filter does not know: clock offset of each GNSS source and of an
odometer, lever arm of the antenna, mounting of the IMU, scale of an odometer, a Doppler log, an airspeed or ranges. What each does to the
measurements, and a recording with them changed.

A constant is true less assumed: clock, s to add to the time stamps of a source; lever arm, m forward, right, down;
mounting, rad, the rotation vector exp(mu x) of the body axes of the IMU, of which forward motion
shows pitch and heading; scale, by which a measured speed or distance is too large. The bias of a range is no
constant here: it is a state of every filter.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..core.mathematics.earth import gravity
from ..core.mathematics.error_dynamics import cross_matrix
from ..core.mathematics.rotation_vectors import exponentials
from ..data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE, CalibrationParameter
from ..data.recording import Recording
from ..data.solution import GNSS, Source
from ..engine.installation import errors_of_start
from ..engine.prepare import Run
from ..engine.sensitivity import Corrections, acceleration_at
from ..geometry.rotations import Rotation
from ..preprocessing.axes import rotation_matrix
from ..preprocessing.lever_arm import lever_arm_of
from ..preprocessing.rotated_imu import with_the_imu
from ..typing import Array, Ints

CONSTRAINED = {"speed": 0, "zero-lateral-velocity": 1, "zero-vertical-velocity": 2}
"""{kind of measurement: body axis along which it sees the velocity of the vehicle}."""
VECTOR, BEAM = "body-velocity", "beam-velocity"
"""Kinds of measurement that see it along all body axes, and along a direction of their own."""
OF_BODY = (*CONSTRAINED, VECTOR, BEAM)
READ = ("true-airspeed", "indicated-airspeed", "range")
"""Kinds of measurement whose scale alone is sought, by what the filter expects of them."""
SCALED = ("speed", VECTOR, BEAM, *READ)
"""Kinds of measurement that have a scale."""
HEADING = "heading"
"""Kind of measurement that sees the x axis of the vehicle."""
SHOWN_BY = {1: "zero-vertical-velocity", 2: "zero-lateral-velocity"}
"""{axis of the mounting: the constraint that shows it}."""


class Constant(NamedTuple):
    """One unknown number of an installation."""

    of: CalibrationParameter
    sources: tuple[int, ...]  # of the recording, whose measurements it changes
    axis: int = 0  # 0, 1, 2 of a lever arm or a mounting


def constants(sources: Sequence[Source]) -> tuple[Constant, ...]:
    """The constants that a recording with these sources has."""
    kinds = [a.kind for a in sources]
    gnss = tuple(i for i, kind in enumerate(kinds) if kind in GNSS)
    clocks: dict[object, list[int]] = {}
    for i in gnss:  # the classes of a receiver have one
        a = sources[i]
        clocks.setdefault((a.kind, a.receiver) if a.receiver else i, []).append(i)
    found = [Constant(CLOCK, tuple(own)) for own in clocks.values()]
    antennas: dict[tuple[float, ...], list[int]] = {}
    for i in gnss:
        antennas.setdefault(tuple(lever_arm_of(sources[i])), []).append(i)
    for own in antennas.values():
        found += [Constant(LEVER_ARM, tuple(own), axis) for axis in range(3)]
    seen = tuple(i for i, kind in enumerate(kinds) if kind in (*OF_BODY, HEADING))
    found += [
        Constant(MOUNTING, (*gnss, *seen), axis)
        for axis, shown_by in SHOWN_BY.items()
        if shown_by in kinds or VECTOR in kinds
    ]
    found += [Constant(CLOCK, (i,)) for i, kind in enumerate(kinds) if kind == "speed"]
    found += [Constant(SCALE, (i,)) for i, kind in enumerate(kinds) if kind in SCALED]
    return tuple(found)


def apply_constants(recording: Recording, found: Sequence[Constant], theta: Array) -> Recording:
    """The recording set up with these constants changed by theta (m,)."""
    sources, turn = list(recording.sources), np.zeros(3)
    for constant, value in zip(found, theta):
        if constant.of is MOUNTING:
            turn[constant.axis] = value
            continue
        for i in constant.sources:
            a = sources[i]
            if constant.of is CLOCK:
                sources[i] = replace(a, t=a.t + value)
            elif constant.of is LEVER_ARM:
                arm = lever_arm_of(a)
                arm[constant.axis] += value
                sources[i] = replace(a, parameters=tuple(map(float, arm)))
            else:
                sources[i] = replace(a, y=a.y / (1 + value))
    imu = recording.imu
    if turn.any():
        R = rotation(turn)
        imu = Imu(imu.t, imu.dt, imu.dtheta @ R.T, imu.dv @ R.T)
        sources = [with_the_imu(a, Rotation.from_rotvec(turn)) for a in sources]
    made = replace(recording, imu=imu, sources=tuple(sources))
    # it is no longer as its file has it
    return made.without_meta("installed") if np.any(theta) else made


def rotation(turn: Array) -> Array:
    """(3, 3) exp(turn x)."""
    matrix: Array = exponentials(turn[None])[0]
    return matrix


class InstallationModel:
    """Sensitivity of a Run to the constants: `derivatives` of the measurements at its fixes, and
    `start` (n, m), the derivative of its error at the start."""

    def __init__(self, run: Run, found: Sequence[Constant], aligned: bool) -> None:
        """aligned: whether the start was made of the first fixes, and errs with them."""
        self.found, sources = tuple(found), run.recording.sources
        self.kinds = np.array([a.kind for a in sources])
        self.arms = np.array([lever_arm_of(a) for a in sources])
        self.directions = [_directions(a) for a in sources]
        # what the turning Earth adds to an acceleration, 0.015 m/s^2 at 100 m/s, is left out
        latitude, height = run.start.lla[0], run.start.lla[2]
        self.g = np.array([0.0, 0.0, gravity(np.sin(latitude), height)])
        self.start = np.zeros((len(run.belief.P), len(self.found)))
        if aligned:
            self._start(run)

    def _start(self, run: Run) -> None:
        start, V = run.start, self.start
        C = rotation_matrix(*start.rph)
        acceleration = C @ acceleration_at(run, start.t) + self.g
        # over half a second to both sides, as in the alignment
        first, last = np.searchsorted(run.samples.t, [start.t - 0.5, start.t + 0.5])
        near = slice(first, max(last, first + 1))
        seconds = run.samples.dt[near].sum()
        rate = run.samples.dtheta[near].sum(axis=0) / seconds - np.asarray(start.b_g)
        by_clock, by_arm = errors_of_start(np.asarray(start.v_n), C, rate, acceleration)
        for j, constant in enumerate(self.found):
            kinds = self.kinds[list(constant.sources)]
            if constant.of is CLOCK:
                V[0:3, j] = by_clock[:3] * ("position" in kinds)
                V[3:6, j] = by_clock[3:] * ("velocity" in kinds)
            elif constant.of is LEVER_ARM:
                V[0:6, j] = by_arm[:, constant.axis]

    def derivatives(self, at: Corrections) -> Array:
        """h (k, 3, m) at these corrections."""
        h, all_kinds = np.zeros((len(at.t), 3, len(self.found))), list(self.kinds)
        for s in np.unique(at.source):
            rows = np.flatnonzero(at.source == s)
            kind, C = all_kinds[s], at.C[rows]
            if kind in GNSS:
                h[rows] = self._of_antenna(at, rows, s)
            elif kind in OF_BODY:
                for k, direction in enumerate(self.directions[s]):
                    h[rows, k] = self._of_body(at, rows, direction, s)
            elif kind == HEADING:
                h[rows, 0] = self._of_heading(C, s)
            elif kind in READ:
                h[rows, :1] = self._columns({SCALE: at.expected[rows, :1, None]}, s)
        return h

    def _of_antenna(self, at: Corrections, rows: Ints, s: int) -> Array:
        """Return the derivatives of positions or velocities of the source s."""
        C, omega, arm = at.C[rows], at.omega[rows], self.arms[s]
        swing = cross(omega, arm)
        by_time = (
            at.v[rows] + rotate_stack(C, swing)
            if self.kinds[s] == "position"
            else rotate_stack(C, at.f[rows] + cross(omega, swing)) + self.g
        )
        by_arm = C if self.kinds[s] == "position" else C @ cross_matrices(omega)
        by = {CLOCK: by_time[:, :, None], LEVER_ARM: by_arm, MOUNTING: by_arm @ cross_matrix(arm)}
        return self._columns(by, s)

    def _of_body(self, at: Corrections, rows: Ints, direction: Array, s: int) -> Array:
        """Return the derivatives of a velocity along a direction (3,) of the body, of the source s. The
        arm does not turn with the IMU."""
        to_body, omega = at.C[rows].transpose(0, 2, 1), at.omega[rows]
        body, swung = rotate_stack(to_body, at.v[rows]), np.cross(self.arms[s], direction)
        changing = at.f[rows] + rotate_stack(to_body, self.g) - cross(omega, body)
        along = body @ direction + omega @ swung
        turned = cross(body, direction) + cross(omega, swung)
        by = {
            CLOCK: (changing @ direction)[:, None, None],
            SCALE: along[:, None, None],
            MOUNTING: turned[:, None],
        }
        return self._columns(by, s)[:, 0]

    def _of_heading(self, C: Array, s: int) -> Array:
        """Return the derivatives of the heading of the vehicle's x axis, of the source s."""
        n, e, turn = C[:, :1, 0], C[:, 1:2, 0], C @ cross_matrix(np.eye(3)[0])
        by = (n * turn[:, 1] - e * turn[:, 0]) / np.maximum(n * n + e * e, 1e-12)
        return self._columns({MOUNTING: by[:, None]}, s)[:, 0]

    def _columns(self, by: dict[CalibrationParameter, Array], s: int) -> Array:
        """(k, rows, m) from the derivatives (k, rows, axes) by each kind of constant, of source s;
        arms are given in axes of the vehicle, so that they turn with the mounting."""
        some = next(iter(by.values()))
        nothing = np.zeros(some.shape[:2])
        return np.stack(
            [
                by[one.of][:, :, one.axis] if s in one.sources and one.of in by else nothing
                for one in self.found
            ],
            axis=2,
        )


def _directions(source: Source) -> Array:
    """(rows, 3) unit vectors in the body along which a source sees the velocity of the vehicle; none of
    others."""
    if source.kind == VECTOR:
        return np.eye(3)
    if source.kind == BEAM:
        return np.array([source.parameters[3:6]])
    axis = CONSTRAINED.get(source.kind)
    return np.empty((0, 3)) if axis is None else np.eye(3)[[axis]]


def rotate_stack(C: Array, vectors: Array) -> Array:
    """(k, 3) C (k, 3, 3) times vectors (k, 3) or (3,)."""
    rotated: Array = (C @ vectors[..., None])[..., 0]
    return rotated


def cross(a: Array, b: Array) -> Array:
    """(k, 3) a (k, 3) x b (k, 3) or (3,)."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def cross_matrices(a: Array) -> Array:
    """(k, 3, 3) S(a) with S(a) b = a x b."""
    S = np.zeros((len(a), 3, 3))
    S[:, 2, 1], S[:, 0, 2], S[:, 1, 0] = a.T
    return S - S.transpose(0, 2, 1)
