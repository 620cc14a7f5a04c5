"""A Motion through the rows of a trajectory: a flight of another simulator, or a recorded
reference, as the truth of a simulation."""

import math
from functools import partial

import numpy as np

from ..checks import DataError
from ..data.solution import Trajectory, attitude_of
from ..geometry.geodesy import displacement
from ..typing import Array
from .analytic import Times
from .trajectory import Motion, OfTime, sample

DEGREE = 5
"""Degree of the splines: angular and linear acceleration have two continuous derivatives, so that
Gauss-Legendre quadrature keeps its order."""
STEEPEST_ROW, WIDEST_TURN = math.radians(85), math.radians(90)
"""Limits of pitch and of the rotation from row to row, rad, beyond which Euler angles do not
determine the motion between two rows."""


def spline_motion(trajectory: Trajectory, name: str = "splined motion") -> Motion:
    """The Motion whose velocity and Euler angles are quintic splines through those of a
    data.Trajectory (velocity and attitude in every row).

    Its time begins at 0 with the first row, and it begins at that row's position: its positions are
    the integral of its velocity, not the trajectory's own (`residual` says by how much they
    differ). It is no way to fly a loop: Euler angles have no spline through the vertical. Raises
    DataError for fewer than six rows, a row that is not finite or has no attitude, times that do
    not increase, pitch beyond STEEPEST_ROW or a rotation beyond WIDEST_TURN from one row to the
    next.
    """
    if trajectory.v_n is None or trajectory.q_nb is None:
        raise DataError(
            f"{name}: the trajectory has no {'velocity' if trajectory.v_n is None else 'attitude'}; "
            f"a motion needs both"
        )
    t = np.asarray(trajectory.t, float) - trajectory.t[0] if len(trajectory) else np.empty(0)
    if len(t) <= DEGREE:
        raise DataError(
            f"{name}: the trajectory has {len(t)} rows; a spline of degree {DEGREE} needs "
            f"{DEGREE + 1} or more"
        )
    bad = ~np.isfinite(np.c_[t, trajectory.lla, trajectory.v_n, trajectory.q_nb]).all(
        axis=1
    ) | ~np.any(trajectory.q_nb, axis=1)
    if bad.any():
        raise DataError(
            f"{name}: row {int(np.argmax(bad))} of the trajectory is not finite or has no attitude; "
            f"leave out unknown rows"
        )
    if np.any(np.diff(t) <= 0):
        raise DataError(
            f"{name}: the time does not increase at row {int(np.argmax(np.diff(t) <= 0)) + 1} of "
            f"the trajectory"
        )
    _refuse_turns(trajectory, name)
    return Motion(
        name,
        tuple(map(float, trajectory.lla[0])),
        _spline(t, trajectory.v_n),
        _spline(t, np.unwrap(trajectory.rph, axis=0)),
        float(t[-1]),
    )


def _refuse_turns(trajectory: Trajectory, name: str) -> None:
    """Raise DataError where splines of Euler angles would not follow the attitude."""
    assert trajectory.q_nb is not None  # `spline_motion` has checked it
    steep = np.abs(trajectory.rph[:, 1]) > STEEPEST_ROW
    if steep.any():
        raise DataError(
            f"{name}: pitch is {np.degrees(trajectory.rph[np.argmax(steep), 1]):.1f} deg at row "
            f"{int(np.argmax(steep))} of the trajectory; "
            f"splines of Euler angles hold up to {math.degrees(STEEPEST_ROW):g} deg"
        )
    q = trajectory.q_nb / np.linalg.norm(trajectory.q_nb, axis=1, keepdims=True)
    wide = np.abs((q[1:] * q[:-1]).sum(axis=1)) < math.cos(0.5 * WIDEST_TURN)
    if wide.any():
        raise DataError(
            f"{name}: it turns by more than {math.degrees(WIDEST_TURN):g} deg between rows "
            f"{int(np.argmax(wide))} and {int(np.argmax(wide)) + 1} "
            "of the trajectory; give rows closer together"
        )


def residual(motion: Motion, trajectory: Trajectory) -> tuple[Array, Array, Array]:
    """(position NED m, velocity m/s, rotation vector in n rad), (n, 3) each: the trajectory less
    the motion at its rows after the first.

    At a spline's own rows velocity and attitude agree to rounding; hold rows back to see what it
    makes of the time between them.
    """
    t = np.asarray(trajectory.t, float) - trajectory.t[0]
    made = sample(motion, t[1:])
    assert trajectory.v_n is not None and made.v_n is not None
    return (
        displacement(trajectory.lla[1:], made.lla),
        trajectory.v_n[1:] - made.v_n,
        (attitude_of(trajectory)[1:] * attitude_of(made).inv()).as_rotvec(),
    )


def _spline(t: Array, values: Array) -> OfTime:
    """t -> three values, for real and complex times: the piece is chosen by the real part, and
    is a polynomial."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(t, values, k=DEGREE)
    begins = np.unique(spline.t)[:-1]
    return partial(
        _evaluate,
        begins,
        np.stack(
            [spline(begins, power) / math.factorial(power) for power in range(DEGREE, -1, -1)]
        ),
    )


def _evaluate(begins: Array, coefficients: Array, t: Times) -> tuple[Times, Times, Times]:
    """Horner's rule on the pieces that begin at `begins`; coefficients (degree + 1, pieces, 3),
    of the highest power first."""
    t = np.asarray(t)
    piece = np.clip(np.searchsorted(begins, t.real, side="right") - 1, 0, len(begins) - 1)
    x = (t - begins[piece])[..., None]
    value = coefficients[0][piece] + 0 * x
    for power in coefficients[1:]:
        value = value * x + power[piece]
    return value[..., 0], value[..., 1], value[..., 2]
