"""The fixes of a source against the noise that is stated of them."""

import numpy as np

from ..core.loop.stages.adaptive import LASTING as UNEXPLAINED
from ..data.solution import Innovations
from ..typing import Array, Mask

CLIPPED = 4.0
"""Standard deviations that count of a whitened innovation where their correlation is taken."""
MEDIANS = {1: 0.4549, 2: 1.3863, 3: 2.3660}
"""Of chi-square, by its degrees of freedom."""


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


def correlation(whitened: Array) -> float:
    """Return the lag-1 correlation of the whitened innovations (m, 3) of a source: that of
    its row with the largest magnitude."""
    w = np.clip(whitened, -CLIPPED, CLIPPED)
    found = [0.0]
    for row in w.T:
        both = np.isfinite(row[1:]) & np.isfinite(row[:-1])
        square = np.nansum(row**2)
        if both.sum() > 2 and square > 0:
            found.append(float((row[1:][both] * row[:-1][both]).sum() / square))
    return max(found, key=abs)
