"""Summaries of a comparison: paired differences with intervals, growth of the error, the table of
the paper."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from ...evaluation.consistency import Paired, paired_comparison
from ...evaluation.metrics import EULER, NED_AXES
from ...typing import Array, Ints
from .protocols import ROUNDING
from .scores import ErrorTrack

GRID = 61
"""Points of a growth curve."""
CURVE_GAP = 2.5
"""Largest gap in an ErrorTrack, in median steps of its thinned rows, across which it is
interpolated, and beyond its ends."""
MEANS = tuple(f"coverage_{k}" for k in (1, 2, 3)) + tuple(f"down_coverage_{k}" for k in (1, 2, 3))
MEDIANS = tuple(f"{part}_rmse_deg" for part in EULER) + (
    "velocity_rmse_m_s",
    "velocity_end_m_s",
)
PAIR_COLUMNS = [
    "a",
    "b",
    "length_s",
    "axis",
    "ratio",
    "low",
    "high",
    "wins_a",
    "wins_b",
    "n",
    "blocks",
]


def pool_scores(own: pd.DataFrame) -> dict[str, Any]:
    """A row of the summary, of the scores of one filter; see `Comparison.summary`."""
    got = own[np.isfinite(own["horizontal_rmse_m"])]
    row = {"n": len(got), "failures": len(own) - len(got)}
    row |= {
        f"{part}_rmse_{what}_m": getattr(got[f"{part}_rmse_m"], what)()
        for part in (*NED_AXES, "horizontal")
        for what in ("mean", "median")
    }
    ends = {"horizontal": got["horizontal_end_m"], "down": got["down_end_m"].abs()}
    for part, values in ends.items():
        row |= {
            f"{part}_end_median_m": values.median(),
            f"{part}_end_p90_m": values.quantile(0.9),
            f"{part}_end_max_m": values.max(),
        }
    row |= {
        "horizontal_max_m": got["horizontal_max_m"].max(),
        "drift_median_percent": got["drift_percent"].median(),
        **{
            name.replace("_rmse_", "_rmse_median_").replace("_end_", "_end_median_"): got[
                name
            ].median()
            for name in MEDIANS
        },
        **{name: got[name].mean() for name in MEANS},
    }
    return row | {"said": "; ".join(dict.fromkeys(text for text in own["said"] if text))}


def blocks(starts: Iterable[float], lengths: Iterable[float]) -> Ints:
    """Return the block number (n,) of each window, in order of start: a window belongs to a block
    if it begins before the first one of the block ends."""
    found, number, until = [], -1, -np.inf
    for start, length in zip(starts, lengths):
        if start >= until - ROUNDING:
            number, until = number + 1, start + length
        found.append(number)
    return np.array(found, int)


def ratio(a: Array, b: Array, starts: Array, lengths: Array) -> dict[str, float]:
    """Geometric mean of a / b with its 95 % interval, and how often each is the smaller, over
    windows where both are known and larger than 0.

    starts, lengths: of the windows, s, in order. Log-ratios are averaged within each block, for
    windows that overlap are not independent; the mean is that of the blocks, Student's t is over
    them, widened for what neighbours share; with fewer than two blocks the interval is NaN.
    """
    known = np.isfinite(a) & np.isfinite(b) & (np.nan_to_num(a) > 0) & (np.nan_to_num(b) > 0)
    a, b, starts, lengths = a[known], b[known], starts[known], lengths[known]
    block = blocks(starts, lengths)
    found = over_blocks(np.log(a / b), block, overlap_factor(starts, lengths, block))
    return {
        "ratio": float(np.exp(found.difference)),
        "low": float(np.exp(found.low)),
        "high": float(np.exp(found.high)),
        "wins_a": int((a < b).sum()),
        "wins_b": int((b < a).sum()),
        "n": len(a),
        "blocks": found.count,
    }


def over_blocks(
    values: Array, block: Ints, wider: float = 1.0, probability: float = 0.95
) -> Paired:
    """Paired of the mean of `values` (n,), averaged within each `block` (n,) first: Student's t
    over the blocks, its half width times `wider`."""
    means = np.array([values[block == number].mean() for number in np.unique(block)])
    found = paired_comparison(means, np.zeros(len(means)), probability)
    low, high = (
        found.difference + wider * (end - found.difference) for end in (found.low, found.high)
    )
    return found._replace(low=float(low), high=float(high))


def overlap_factor(starts: Array, lengths: Array, block: Ints) -> float:
    """Factor by which the interval of Student's t over blocks is too narrow, because windows of one
    block overlap some of the next; 1 where none do.

    As for windows that average one white noise: with C the covariance of the means of the blocks,
    which is tridiagonal, their mean has the variance 1'C1 / n^2 and their sample variance expects
    (tr C - 1'C1 / n) / (n - 1).
    """
    parts = [(starts[block == number], lengths[block == number]) for number in np.unique(block)]
    n = len(parts)
    if n < 2:
        return 1.0
    own, shared = (
        sum(_covariance(part, part) for part in parts),
        sum(_covariance(*pair) for pair in zip(parts, parts[1:])),
    )
    total = own + 2 * shared
    return float(np.sqrt(total / n / ((own - total / n) / (n - 1))))


def _covariance(one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the covariance of the means over two blocks (starts, lengths) of window averages of
    white noise of density 1."""
    (a, la), (b, lb) = one, other
    overlap = np.minimum.outer(a + la, b + lb) - np.maximum.outer(a, b)
    return float((np.clip(overlap, 0.0, None) / np.multiply.outer(la, lb)).mean())


def curves(own: Iterable[tuple[ErrorTrack, float]], length: float) -> dict[str, Any]:
    """Columns of the growth of the error over outages, [(Track, its length s)], on one grid of
    times; see `Comparison.growth`."""
    grid = np.linspace(0.0, length, GRID)
    found: dict[str, Any] = {"since_s": grid}
    sizes = {
        "horizontal": [_on(grid, t, np.hypot(*t.error[:, :2].T), each) for t, each in own],
        "vertical": [_on(grid, t, np.abs(t.error[:, 2]), each) for t, each in own],
    }
    for part, rows in sizes.items():
        values = np.array(rows).reshape(-1, GRID)
        known = np.isfinite(values).any(axis=0)
        for name, share in (("median", 0.5), ("p10", 0.1), ("p90", 0.9)):
            found[f"{part}_{name}_m"] = np.full(GRID, np.nan)
            found[f"{part}_{name}_m"][known] = np.nanquantile(values[:, known], share, axis=0)
        found["n"] = np.isfinite(values).sum(axis=0)
    return found


def _on(grid: Array, track: ErrorTrack, values: Array, length: float) -> Array:
    """Values of a ErrorTrack at the times `grid` since the start of its outage of this length; NaN
    where it has no rows: before, behind and in gaps."""
    since, steps = track.since, np.diff(track.since)
    wide = CURVE_GAP * float(np.median(steps)) if len(steps) else ROUNDING
    known = (grid >= since[0] - wide) & (grid <= min(since[-1] + wide, length + ROUNDING))
    for row in np.flatnonzero(steps > max(wide, grid[1])):
        known &= (grid <= since[row]) | (grid >= since[row + 1])
    return np.where(known, np.interp(grid, since, values), np.nan)
