"""Test of a source for time-correlated errors: the likelihood with them against that without."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data.solution import Correlated
from ..typing import Array
from .fisher_scoring import Top, climb
from .likelihood import Likelihood
from .numbers import IMU, WHITE
from .unknowns import NoiseUnknown, correlation_unknowns, groups

TIMES = (3.0, 10.0, 30.0, 100.0)
"""s: the likelihood can have two maxima, so the search begins at several times and sizes."""
SIZES = (0.7, 3.0)
"""Correlated over white standard deviation where it begins."""
LESS_WHITE = np.log(0.7)
BEST, FIRST_ROUNDS = 2, 4
"""The BEST beginnings are followed for FIRST_ROUNDS steps, the best of them to its end."""


class CorrelationFound(NamedTuple):
    """The likelihood with more unknowns, its maximum, and whether the gain pays for them."""

    likelihood: Likelihood
    top: Top
    pays: bool


def with_lasting(likelihood: Likelihood, top: Top, index: int) -> CorrelationFound:
    """Maximise the likelihood with time-correlated errors of source `index`. They pay where the
    gain in log L exceeds that of the Bayesian information criterion (Schwarz 1978) for their
    numbers."""
    source, theta = likelihood.sources[index], top.point.theta
    white = [j for j, each in enumerate(likelihood.unknowns) if each.place == index]
    white = [j for j in white if likelihood.unknowns[j].what is WHITE]
    std = np.zeros(np.asarray(source.std).shape[1])
    for j, rows in zip(white, groups(source).values()):
        std[list(rows)] = np.exp(theta[j])
    more = correlation_unknowns(source, index, Correlated(tuple(std.tolist()), TIMES[2]))
    wider = likelihood.with_more(more)
    begins = _begins(wider.unknowns, theta, white, more)
    points = sorted(wider.all(begins), key=lambda point: -point.log_likelihood)[:BEST]
    free = np.arange(len(wider.unknowns))
    tops = [climb(wider, point.theta, free, FIRST_ROUNDS, point) for point in points]
    best = max(tops, key=lambda each: each.point.log_likelihood)
    best = climb(wider, best.point.theta, free, point=best.point)
    gain = best.point.log_likelihood - top.point.log_likelihood
    return CorrelationFound(wider, best, 2 * gain > len(more) * np.log(len(top.point.seen.log)))


def _begins(
    unknowns: Sequence[NoiseUnknown], theta: Array, white: list[int], more: Sequence[NoiseUnknown]
) -> list[Array]:
    """Where the search begins: times, sizes, and the noise of the IMU as found and as given, since
    without the correlated errors it may have been blamed for them."""
    of_imu = [j for j, each in enumerate(unknowns) if each.source == IMU]
    given = theta.copy()
    given[of_imu] = np.log([unknowns[j].begin for j in of_imu])
    sizes = np.log([each.begin for each in more[:-1]])
    begins = []
    for base in (theta, given):
        base = base.copy()
        base[white] += LESS_WHITE
        begins += [
            np.r_[base, sizes + np.log(size), np.log(time)] for time in TIMES for size in SIZES
        ]
    return begins
