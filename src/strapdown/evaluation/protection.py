"""Protection levels: how far off position and heading may be, at a stated risk of misleading
information.

What the filter claims bounds its random errors, and what the verdict could have shown bounds an error of
the set-up that it did not. One such error at a time is counted, as integrity monitoring of GNSS counts one
faulty satellite.
"""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from ..checks import DataError, check_number
from ..core.loop.contract import ATT, DOUBTFUL
from ..data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING
from ..data.solution import Solution, Trajectory
from ..data.value import Value
from ..data.verdict import HEADING, HEIGHT, POSITION, RISK, SetUpBound
from ..typing import Array

COVERED = (POSITION, HEIGHT, HEADING)
COLUMNS = ("protection horizontal [m]", "protection vertical [m]", "protection heading [deg]")
"""Columns of a table."""


@dataclass(frozen=True, eq=False)
class ProtectionLevels(Value):
    """Protection levels of a solution, a row each.

    Attributes
    ----------
    t : (n,) array
        s.
    horizontal, vertical : (n,) array
        m: radius of a circle, and half of an interval, around the position; NaN where the row or the
        solution is doubted, or the filter claims nothing.
    heading : (n,) array
        rad.
    risk : float
        Risk that the error is larger than its level while the solution is trusted.
    uncovered : tuple of str
        Quantities that rest on what was not tested, whose levels hold only if that is right.
    """

    t: Array
    horizontal: Array
    vertical: Array
    heading: Array
    risk: float
    uncovered: tuple[str, ...]

    def as_columns(self) -> dict[str, Array]:
        """{column of a table: (n,)}."""
        values = (self.horizontal, self.vertical, np.degrees(self.heading))
        return dict(zip(COLUMNS, values))

    def __str__(self) -> str:
        levels = (
            ("horizontal", self.horizontal, "m"),
            ("vertical", self.vertical, "m"),
            ("heading", np.degrees(self.heading), "deg"),
        )
        known = [
            f"{name} {np.nanmedian(level):.2g} {unit}"
            for name, level, unit in levels
            if np.isfinite(level).any()
        ]
        text = f"protection levels at a risk of {self.risk:g}, median: {', '.join(known) or 'none'}"
        rest = f"; {' and '.join(self.uncovered)} only if what was not tested is right"
        return text + (rest if self.uncovered else "")


def protection_levels(solution: Solution, risk: float = RISK) -> ProtectionLevels:
    """Bound the errors of position and heading at a stated risk.

    The radius is k sigma of the largest horizontal axis, with k = sqrt(-2 ln(risk)); vertical and heading
    have the two-sided quantile of the normal distribution. To each the largest shift is added that one
    error of the set-up below the verdict's bounds would bring: a clock times the speed, or the rate of
    turn; a lever arm; a mounting.

    Parameters
    ----------
    solution : Solution
        With standard deviations.
    risk : float
        Of misleading information, above 0 and below 1.

    Returns
    -------
    ProtectionLevels

    Raises
    ------
    DataError
        Where the risk is none, or the filter claims no standard deviations.

    Examples
    --------
    >>> import strapdown as sd
    >>> levels = sd.fuse(sd.simulate("car", 120.0, seed=1)).protection()
    >>> bool(levels.horizontal[-1] < 5.0)
    True
    """
    check_number(risk, "risk", above=0, below=1)
    made = solution.trajectory
    if made.std is None:
        raise DataError("no protection levels: the filter claims no standard deviations")
    verdict = solution.verdict
    circle, line = float(np.sqrt(-2 * np.log(risk))), NormalDist().inv_cdf(1 - risk / 2)
    shifts = _shifts(solution, verdict.bounds)
    usable = (solution.status != DOUBTFUL) & verdict.trusted
    radius, half, angle = (
        np.where(usable, level, np.nan)
        for level in (
            circle * _horizontal_std(solution) + shifts[0],
            line * made.std[:, 2] + shifts[1],
            np.minimum(line * made.std[:, ATT.stop - 1] + shifts[2], np.pi),
        )
    )
    rests = {quantity for each in verdict.untested for quantity in each.rests}
    uncovered = tuple(each for each in COVERED if each in rests)
    return ProtectionLevels(solution.t, radius, half, angle, risk, uncovered)


def _horizontal_std(solution: Solution) -> Array:
    """(n,) m: the largest standard deviation of the horizontal position; without a covariance what it is
    at most."""
    if solution.covariance is None:
        assert solution.trajectory.std is not None
        return np.hypot(solution.trajectory.std[:, 0], solution.trajectory.std[:, 1])
    north, east = solution.covariance[:, 0, 0], solution.covariance[:, 1, 1]
    both = solution.covariance[:, 0, 1]
    return np.sqrt((north + east) / 2 + np.hypot((north - east) / 2, both))


def _shifts(solution: Solution, bounds: tuple[SetUpBound, ...]) -> tuple[Array, Array, Array]:
    """(horizontal m, vertical m, heading rad), (n,) each: the largest shift by one error of the set-up
    that would not have shown."""
    made = solution.trajectory
    none = np.zeros(len(made.t))
    shifts = [none, none.copy(), none.copy()]
    speed = none if made.v_n is None else np.nan_to_num(np.hypot(made.v_n[:, 0], made.v_n[:, 1]))
    climb = none if made.v_n is None else np.nan_to_num(np.abs(made.v_n[:, 2]))
    turn = none if made.q_nb is None else _turn_rate(made)
    for each in bounds:
        if each.cause == CLOCK.cause:
            effects: tuple[Any, Any, Any] = (speed * each.size, climb * each.size, turn * each.size)
        elif each.cause == LEVER_ARM.cause:
            down = each.component == LEVER_ARM.components[2]
            effects = (each.size * (not down), each.size * down, 0.0)
        elif each.cause == MOUNTING.cause:
            heading = each.component == MOUNTING.components[2]
            effects = (0.0, 0.0, np.radians(each.size) * heading)
        else:
            continue
        shifts = [np.maximum(shift, effect) for shift, effect in zip(shifts, effects)]
    return shifts[0], shifts[1], shifts[2]


def _turn_rate(made: Trajectory) -> Array:
    """(n,) rad/s: how fast the heading turns."""
    heading = np.unwrap(np.nan_to_num(made.rph[:, 2]))
    if len(heading) < 2:
        return np.zeros(len(heading))
    return np.abs(np.gradient(heading, made.t))
