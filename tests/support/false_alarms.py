"""How often the tests of innovations fail where the filter is right: run lengths of their cumulative
sums by a Markov chain (Brook and Evans 1972). `python tests/support/false_alarms.py` prints them."""

import numpy as np
from scipy import stats

from strapdown.core.loop.integrity import (
    MAX_NIS,
    MAX_WHITENED,
    MEAN_ALARM,
    MEAN_ALLOWED,
    NIS_ALARM,
    NIS_ALLOWED,
)

CELLS = 1500


def run_length(cdf, bound):
    """Mean number of terms until a cumulative sum, held above 0, exceeds `bound`; cdf: that of a
    term."""
    step = bound / CELLS
    middle = (np.arange(CELLS) + 0.5) * step
    middle[0] = 0.0  # most of the time the sum is 0
    edges = np.arange(1, CELLS + 1) * step
    below = cdf(edges[None, :] - middle[:, None])
    stay = np.diff(below, axis=1, prepend=0.0)
    return float(np.linalg.solve(np.eye(CELLS) - stay, np.ones(CELLS))[0])


def of_mean():
    """Seconds between false alarms of one side of one component."""

    def cdf(x):
        largest = MAX_WHITENED - MEAN_ALLOWED
        return np.where(x >= largest, 1.0, stats.norm.cdf(x + MEAN_ALLOWED))

    return run_length(cdf, MEAN_ALARM)


def of_nis(rows):
    """Seconds between false alarms of the NIS of a source with so many rows."""

    def cdf(x):
        largest = MAX_NIS - NIS_ALLOWED
        return np.where(x >= largest, 1.0, stats.chi2.cdf((x + NIS_ALLOWED) * rows, rows))

    return run_length(cdf, NIS_ALARM / rows)


if __name__ == "__main__":
    print(f"mean, one component, both sides: one in {of_mean() / 2 / 3600:.0f} h")
    for rows in (1, 2, 3):
        print(f"NIS, {rows} rows: one in {of_nis(rows) / 3600:.0f} h")
