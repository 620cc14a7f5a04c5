"""Random sequences of sensor errors: Gauss-Markov, random walk and flicker (1/f), with exact
discrete laws and fast recursions.

The recursions are `scipy.signal.lfilter`, which releases the interpreter lock (numpy's cumulative
sum does not), so that threads run beside each other.
"""

import numpy as np

from ..typing import Array, ArrayLike

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


def recursion(keep: float, x: Array) -> Array:
    """y[k] = keep y[k-1] + x[k] along the first axis of (n, 3) `x`, y[0] = x[0]."""
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -keep], x, axis=0)


def gauss_markov(step: Array, rng: np.random.Generator) -> Array:
    """Stationary first-order Gauss-Markov sequence of unit variance, (len(step) + 1, 3); `step`
    is in time constants."""
    keep, drive = np.exp(-step), np.sqrt(-np.expm1(-2 * step))
    x = rng.standard_normal((len(step) + 1, 3))
    x[1:] *= drive[:, None]
    if len(step) and np.ptp(step) < 1e-6 * step[0]:
        return recursion(keep.mean(), x)
    for k in range(len(step)):
        x[k + 1] += keep[k] * x[k]
    return x


def random_walk(drive: Array, rng: np.random.Generator) -> Array:
    """Random walk from 0, (len(drive) + 1, 3); `drive` is the standard deviation of each step."""
    x = np.zeros((len(drive) + 1, 3))
    x[1:] = rng.standard_normal((len(drive), 3)) * drive[:, None]
    return recursion(1.0, x)


def flicker(step: Array, rng: np.random.Generator) -> Array:
    """Flicker of bias instability 1, (len(step) + 1, 3): the sum of stationary Gauss-Markov
    sequences of `FLICKER_TIMES`, each with its stream."""
    streams = zip(FLICKER_TIMES, rng.spawn(len(FLICKER_TIMES)))
    return np.sqrt(FLICKER_VARIANCE) * sum(
        gauss_markov(step / time, stream) for time, stream in streams
    )


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
