"""When the estimate of a bias should decay, in closed form.

A bias b is a Gauss-Markov process of the time constant T. Its estimate at the last fix, b_0, is what
the fixes told; t later the mean of b is b_0 exp(-t/T), a filter that takes it for a process of the time
constant A has b_0 exp(-t/A), and one that holds it has b_0. After an outage of the length L without
tilt the position is off by b_0 times the difference of the double integrals

    g(T) = T L - T^2 (1 - exp(-L/T)), g(inf) = L^2 / 2,

beside what no estimate could know. So held estimates are the better ones where g(T) lies nearer to
L^2 / 2 than to g(A).
"""

import numpy as np
from scipy.optimize import brentq


def displacement(time: float, length: float) -> float:
    """g, s^2: position after `length` s by an acceleration that begins as 1 and decays with `time` (s,
    inf for one that lasts)."""
    x = length / time
    if x < 1e-3:  # the series, where the difference is lost in rounding
        return length**2 * (0.5 - x / 6 + x * x / 24)
    return float(time * length + time**2 * np.expm1(-x))


def held_is_better(true: float, assumed: float, length: float) -> bool:
    """True where held bias estimates predict the position better than decaying ones, with time
    constants `true` and `assumed`, s, after `length` s."""
    right, held = displacement(true, length), displacement(np.inf, length)
    return abs(right - held) < abs(right - displacement(assumed, length))


def boundary(length: float) -> float:
    """The true time constant from which on held estimates are better, over the assumed one, after an
    outage of `length` assumed time constants: 2 after short ones, 0.39 of the outage after long ones."""
    middle = 0.5 * (displacement(np.inf, length) + displacement(1.0, length))
    return float(brentq(lambda true: displacement(true, length) - middle, 1.0, 10.0 + length))
