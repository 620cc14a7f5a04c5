"""Attitudes from files, as angles or quaternions in various axes, converted to roll, pitch and
heading of FRD in NED."""

from typing import Literal, TypeAlias

import numpy as np

from ..checks import DataError
from ..data.solution import Trajectory
from ..geometry.rotations import Rotation
from ..typing import Array
from .axes import BODY_AXES, NAVIGATION_AXES, axes_matrix
from .origin import Origin

QuaternionOrder: TypeAlias = Literal["wxyz", "xyzw"]
ORDERS: dict[QuaternionOrder, list[int]] = {"wxyz": [0, 1, 2, 3], "xyzw": [3, 0, 1, 2]}
"""Positions of scalar, x, y and z among the columns of a quaternion."""
UNIT_NORM = 0.01
"""Largest difference of a quaternion's norm from 1; smaller ones are rounding and are
normalised."""
MAX_PITCH, MAX_TURN = np.pi / 2 + 1e-6, 2 * np.pi * (1 + 1e-9)
"""Largest pitch and largest roll or heading that a record can hold, rad."""


def axes_of(text: str) -> tuple[Array, Array]:
    """(body, navigation) matrices (3, 3) of axes such as "FLU to ENU": from the record's axes to
    FRD and to NED; of "FLU to ECEF" to FRD and, as they are, to ECEF. Raises DataError."""
    body, to, navigation = text.partition(" to ")
    if not to:
        raise DataError(
            f"{text!r}: write the axes of the body and the reference axes of its attitude, such as "
            f'"FLU to ENU"; '
            "the default is FRD to NED"
        )
    if navigation.strip() == "ECEF":
        return axes_matrix(body.strip(), BODY_AXES), np.eye(3)
    matrices = (
        axes_matrix(body.strip(), BODY_AXES),
        axes_matrix(navigation.strip(), NAVIGATION_AXES),
    )
    if not matrices[1][2, 2]:
        raise DataError(f"{text!r}: the third navigation axis must point up or down")
    return matrices


def quaternions(
    values: Array, order: QuaternionOrder | None, axes: str | None, origin: Origin
) -> Array:
    """(n, 4) attitude of the body (FRD) in NED, scalar first, from the columns; rows with a missing
    number are NaN.

    values: (n, 3) roll, pitch, heading, rad, or (n, 4) with `order` a name of `ORDERS`; axes: text
    of `axes_of` or None. Raises DataError naming the row of an invalid quaternion.
    """
    known, found = np.all(np.isfinite(values), axis=1), np.full((len(values), 4), np.nan)
    if not known.any():
        return found
    if order is None:
        turn = Rotation.from_rph(values[known])
    else:
        turn = Rotation.from_wxyz(
            _unit(values[known][:, ORDERS[order]], origin.keep_rows(known, len(known)))
        )
    if axes is not None:
        body, navigation = map(Rotation.from_matrix, axes_of(axes))
        turn = navigation * turn * body.inv()
    found[known] = turn.as_wxyz()
    return found


def _unit(q: Array, origin: Origin) -> Array:
    norm = np.linalg.norm(q, axis=1)
    origin.refuse(
        np.abs(norm - 1) > UNIT_NORM,
        lambda row: (
            f"quaternion [{' '.join(f'{each:.6g}' for each in q[row])}] has norm {norm[row]:.4g}, not "
            f"1; "
            + (
                "empty its cells or leave the row out where the attitude is unknown"
                if not norm[row]
                else "check columns and scale"
            )
        ),
    )
    return q / norm[:, None]


def angles(values: Array, order: QuaternionOrder | None, axes: str | None, origin: Origin) -> Array:
    """(n, 3) roll, pitch, heading of the body in NED, rad, with arguments as in `quaternions`; a
    missing heading (one column less, or NaN) stays NaN.

    Raises DataError naming the row of impossible angles. The check comes before the rotation, after
    which all angles are possible.
    """
    if order is None:
        values = np.c_[
            np.where(np.isfinite(values), values, np.nan),
            np.full((len(values), 3 - values.shape[1]), np.nan),
        ]
        possible_attitude(values, origin)
        if axes is None:
            return values
    level = np.isnan(values[:, 2]) if order is None else np.zeros(len(values), bool)
    filled = (
        np.where(level[:, None] & [False, False, True], 0.0, values) if order is None else values
    )
    q = quaternions(filled, order, axes, origin)
    found = Trajectory(np.zeros(len(q)), np.empty((0, 3)), q_nb=q).rph.copy()
    found[level, 2] = np.nan
    return found


def together(y: Array) -> Array:
    """(m, 3) roll, pitch, heading, with NaN in the whole row where roll or pitch is missing."""
    return np.where(np.any(np.isnan(y[:, :2]), axis=1)[:, None], np.nan, y)


def possible_attitude(y: Array, origin: Origin) -> None:
    """Raise DataError naming the first row with an impossible roll, pitch or heading (m, 3), rad.

    Infinite ones count as missing.
    """
    for name, column, limit in zip(
        ("roll", "pitch", "heading"), y.T, (MAX_TURN, MAX_PITCH, MAX_TURN)
    ):
        origin.refuse(
            (np.abs(column) > limit) & np.isfinite(column),
            lambda row: (
                f"{name} is {np.degrees(column[row]):.6g} deg, but at most {np.degrees(limit):.0f} is "
                f"expected; "
                "check the unit (deg read as rad?) and the order of the columns, and wrap angles "
                "that exceed a turn"
            ),
        )
