"""The covariance S of an innovation and the noise R in it, and what they make of the innovation, in
numbers of three rows."""

import math

from ...typing import Array
from ..compile.jit import helper


@helper
def moments(innovation: Array, wider: Array, S: Array, R: Array) -> bool:
    """S and R (6 each, lower triangles by rows) of a fix, from its innovation (12, of the contract)
    and from that with standard deviations twice as large. False where the filter has none.

    Only the filter knows what the standard deviations of a field do to the angle that it makes of
    it. A row that is not measured becomes that of the unit matrix, without noise.
    """
    found = False
    for i in range(3):
        for j in range(i + 1):
            at = i * (i + 1) // 2 + j
            S[at], R[at] = 1.0 if i == j else 0.0, 0.0
            if math.isnan(innovation[i]) or math.isnan(innovation[j]):
                continue
            S[at], other = _product(innovation, i, j), _product(wider, i, j)
            R[at] = (other - S[at]) / 3
            if i == j:
                found = True
                if not (S[at] > 0 and R[at] > 0):
                    return False
    return found


@helper
def _product(innovation: Array, i: int, j: int) -> float:
    """An element of L L'."""
    total = 0.0
    for k in range(j + 1):
        total += innovation[6 + i * (i + 1) // 2 + k] * innovation[6 + j * (j + 1) // 2 + k]
    return total


@helper
def solve_innovation(
    S: Array, R: Array, f: float, e0: float, e1: float, e2: float
) -> tuple[float, float, float, float, float]:
    """With A = S + (f - 1) R: A^-1 e (3 numbers), e' A^-1 e and the logarithm of det A. NaN where A
    is no covariance."""
    g = f - 1
    d0, a1, a2 = S[0] + g * R[0], S[1] + g * R[1], S[3] + g * R[3]
    b, c = a1 / d0, a2 / d0
    d1, a3 = S[2] + g * R[2] - b * a1, S[4] + g * R[4] - b * a2
    h = a3 / d1
    d2 = S[5] + g * R[5] - c * a2 - h * a3
    if not (d0 > 0 and d1 > 0 and d2 > 0):
        return math.nan, math.nan, math.nan, math.nan, math.nan
    y1 = e1 - b * e0
    y2 = e2 - c * e0 - h * y1
    x2 = y2 / d2
    x1 = y1 / d1 - h * x2
    x0 = e0 / d0 - b * x1 - c * x2
    nis = e0 * e0 / d0 + y1 * y1 / d1 + y2 * y2 / d2
    return x0, x1, x2, nis, math.log(d0) + math.log(d1) + math.log(d2)


@helper
def zero_if_missing(x: float) -> float:
    """A component of an innovation, 0 of one that is not measured."""
    return 0.0 if math.isnan(x) else x
