"""The fixes of a source against the noise that is stated of them."""

import numpy as np

from ..core.loop.stages.adaptive import LASTING as UNEXPLAINED
from ..data.solution import Innovations
from ..typing import Array, Mask

CLIPPED = 4.0
"""Standard deviations that count of a whitened innovation where their correlation is taken."""
MEDIANS = {1: 0.4549, 2: 1.3863, 3: 2.3660}
"""Medians of chi-square, by its degrees of freedom."""


def lasts(correlation: float) -> bool:
    """True where innovations one fix apart are correlated for reasons that the model lacks, so that
    their size says nothing of the noise: no smaller standard deviation follows from it."""
    return abs(correlation) > UNEXPLAINED


def counts(i: Innovations, name: str, first: float, last: float) -> tuple[float, float, float]:
    """(median NIS over its expectation, correlation one fix apart, share rejected) of a source."""
    rows: Mask = (i.source == i.names.index(name)) & (i.t > first) & (i.t <= last)
    rows &= np.isfinite(i.nis)
    if not rows.any() or i.whitened is None:
        return np.nan, np.nan, np.nan
    degrees = np.isfinite(i.innovation[rows]).sum(axis=1)
    expected = np.array([MEDIANS[k] for k in degrees])
    nis = float(np.median(i.nis[rows] / expected))
    return nis, correlation(i.whitened[rows]), float(np.mean(~i.accepted[rows]))


def correlation(whitened: Array, lags: int = 1) -> float:
    """Return the correlation of the whitened innovations (m, 3) of a source, its mean over the first
    `lags` fixes: that of its row with the largest magnitude."""
    w = np.clip(whitened, -CLIPPED, CLIPPED)
    found = [0.0]
    for row in w.T:
        square = np.nansum(row**2)
        if square > 0:
            found.append(
                float(np.mean([_products(row, lag) / square for lag in range(1, lags + 1)]))
            )
    return max(found, key=abs)


def _products(row: Array, lag: int) -> float:
    """Sum of the products of values (m,) `lag` apart; 0 of fewer than three."""
    both = np.isfinite(row[lag:]) & np.isfinite(row[:-lag])
    return float((row[lag:][both] * row[:-lag][both]).sum()) if both.sum() > 2 else 0.0
