"""The table of a solution, in the units of `UNITS`, and back: what its files have in common."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...data import BIAS_COLUMNS, NAV_COLUMNS, SD_COLUMNS, SD_SCALE, Solution, Trajectory
from ...typing import Array

if TYPE_CHECKING:
    import pandas as pd


def table_of(solution: Solution) -> "pd.DataFrame":
    """The table of a solution, with NaN in the columns of what its trajectory does not have."""
    names = [*NAV_COLUMNS, *BIAS_COLUMNS, *SD_COLUMNS, *solution.columns, "status"]
    return solution.table().reindex(columns=names)


def state_of(
    t: Array, table: Callable[[list[str]], Array], q_nb: Array | None
) -> tuple[Trajectory, Array, Array]:
    """Trajectory, b_a and b_g in SI from `table(names)`, which is in the units of `UNITS`."""
    lla = table(NAV_COLUMNS[:3]) * [np.pi / 180, np.pi / 180, 1]
    b_a, b_g = np.hsplit(table(BIAS_COLUMNS) / SD_SCALE[9:], 2)
    return Trajectory(t, lla, table(NAV_COLUMNS[3:6]), q_nb, table(SD_COLUMNS) / SD_SCALE), b_a, b_g
