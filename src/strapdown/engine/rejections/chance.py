"""Probabilities that correct fixes look wrong, in closed form: scipy.special would take 0.15 s to
load in every run that rejects a fix. Source: Abramowitz & Stegun (1964), 26.4.4, 26.4.5 and
26.4.21."""

import math


def farther(rows: int, nis: float) -> float:
    """Probability that the NIS of an innovation of 1, 2 or 3 rows is above `nis`: of the chi-square
    distribution; 0 of no rows."""
    half = 0.5 * nis
    if rows == 0:
        return 0.0
    if rows == 2:
        return math.exp(-half)
    odd = math.erfc(math.sqrt(half))
    return odd if rows == 1 else odd + 2 * math.sqrt(half / math.pi) * math.exp(-half)


def as_many(count: int, expected: float) -> float:
    """Probability that `count` or more events happen where `expected` do on average: of the Poisson
    distribution."""
    if expected == 0:
        return float(count <= 0)
    log = math.log(expected)  # powers of many expected events are no numbers
    return 1 - math.fsum(math.exp(k * log - expected - math.lgamma(k + 1)) for k in range(count))
