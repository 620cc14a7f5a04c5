"""Random sequences of sensor errors that last: Gauss-Markov, with its exact discrete law, and the
flicker (1/f) that a sum of them makes."""

import math

import numpy as np

from ..core.compile.jit import helper, kernel
from ..core.compile.signatures import reals, signature
from ..core.mathematics.elementary import exponential
from ..typing import Array, ArrayLike
from .streams import RandomStream, SeedLike

FLICKER_TIMES = 10.0 ** np.arange(-1, 6)
"""Time constants of the Gauss-Markov processes that make up flicker, s: a decade apart, so that
the sum is 1/f from about 0.01 mHz to 1 Hz."""
FLICKER_VARIANCE = np.log(10) / np.pi
"""Variance of each of them for a bias instability of 1.

The two-sided spectrum of one is 2 s^2 T / (1 + (2 pi f T)^2). Processes of every T, one per decade
(d ln T = ln 10), integrate to s^2 / (2 ln(10) f), which equals B^2 / (2 pi f), the flicker of IEEE
Std 952, where s^2 = B^2 ln(10) / pi. At steps of a decade the sum ripples by 3 % around it.
"""
FLICKER_FLOOR = np.sqrt(2 * np.log(2) / np.pi)
"""Allan deviation of flicker of bias instability 1: the 0.664 of IEEE Std 952-1997, C.1.3."""


@helper
def gauss_markov_step(step: float) -> tuple[float, float]:
    """(share of a Gauss-Markov process of unit variance that is left after a step, standard
    deviation of what is new); `step` in time constants, inf where it begins."""
    keep = exponential(-step)
    # of the rounded share, so that the variance stays 1
    return keep, math.sqrt((1.0 - keep) * (1.0 + keep))


def even_steps(step: Array) -> Array:
    """Steps that rounding alone tells apart, made the same: what follows of them is then computed
    once. (n,), of which the first may be inf."""
    rest = step[np.isfinite(step)]
    if len(rest) and np.ptp(rest) < 1e-6 * rest[0]:
        return np.where(np.isfinite(step), rest.mean(), step)
    return step


def gauss_markov(step: Array, seed: SeedLike) -> Array:
    """Stationary first-order Gauss-Markov sequence of unit variance, (len(step) + 1, 3); `step`
    is in time constants."""
    x = RandomStream.of(seed).standard_normal((len(step) + 1, 3))
    _gauss_markov(np.ascontiguousarray(even_steps(step), float), x)
    return x


@kernel(signature("gauss_markov", step=reals("steps"), x=reals("rows", 3)))
def _gauss_markov(step: Array, x: Array) -> None:
    """From white normals to the sequence, in place."""
    keep = drive = 0.0
    for k in range(step.shape[0]):
        if k == 0 or step[k] != step[k - 1]:
            keep, drive = gauss_markov_step(step[k])
        for c in range(3):
            x[k + 1, c] = keep * x[k, c] + drive * x[k + 1, c]


def gauss_markov_variance(tau: ArrayLike, time_constant: float) -> Array:
    """Allan variance at cluster times `tau` of a Gauss-Markov process of unit variance; IEEE Std
    952-1997, C.1.6, with q^2 = 2 s^2 / T."""
    x = np.asarray(tau, float) / time_constant
    small = x < 1e-2  # the difference of nearly equal numbers below: its series
    x_ = np.where(small, 1.0, x)
    return np.where(
        small,
        2 * x / 3 - x * x / 2,
        2 / x_ * (1 + (4 * np.expm1(-x_) - np.expm1(-2 * x_)) / (2 * x_)),
    )
