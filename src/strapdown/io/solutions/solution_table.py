"""The table of a solution, in the units of `UNITS`, and back: what its files have in common."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...data import BIAS_COLUMNS, NAV_COLUMNS, SD_COLUMNS, SD_SCALE, Solution, Trajectory
from ...typing import Array


def columns_of(solution: Solution) -> dict[str, Any]:
    """The columns of a solution's table by name, (n,) each, NaN where its trajectory does not have
    them; without pandas, which takes 0.3 s to load."""
    known, none = solution.as_columns(), np.full(len(solution.t), np.nan)
    names = [*NAV_COLUMNS, *BIAS_COLUMNS, *SD_COLUMNS, *solution.columns, "status"]
    return {name: known.get(name, none) for name in names}


def state_of(
    t: Array, table: Callable[[list[str]], Array], q_nb: Array | None
) -> tuple[Trajectory, Array, Array]:
    """Trajectory, b_a and b_g in SI from `table(names)`, which is in the units of `UNITS`."""
    lla = table(NAV_COLUMNS[:3]) * [np.pi / 180, np.pi / 180, 1]
    b_a, b_g = np.hsplit(table(BIAS_COLUMNS) / SD_SCALE[9:], 2)
    return Trajectory(t, lla, table(NAV_COLUMNS[3:6]), q_nb, table(SD_COLUMNS) / SD_SCALE), b_a, b_g
