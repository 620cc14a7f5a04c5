"""Probabilities that correct fixes are rejected, in closed form, because scipy.special would take
0.15 s to load in every run with a rejection. Source: Abramowitz & Stegun (1964), 26.4.4, 26.4.5 and
26.4.21."""

import math


def farther(rows: int, nis: float) -> float:
    """Return the probability of the chi-square distribution that the NIS of an innovation of 1, 2
    or 3 rows exceeds `nis`; 0 for no rows."""
    half = 0.5 * nis
    if rows == 0:
        return 0.0
    if rows == 2:
        return math.exp(-half)
    odd = math.erfc(math.sqrt(half))
    return odd if rows == 1 else odd + 2 * math.sqrt(half / math.pi) * math.exp(-half)


def as_many(count: int, expected: float) -> float:
    """Return the probability of the Poisson distribution that `count` or more events happen where
    `expected` happen on average."""
    if expected == 0:
        return float(count <= 0)
    log = math.log(expected)  # powers of many expected events are no numbers
    return 1 - math.fsum(math.exp(k * log - expected - math.lgamma(k + 1)) for k in range(count))
