"""Normalised estimation error squared of many rows at once: e' P^-1 e by Cholesky with the
states scaled to their standard deviations."""

import math

from ..core.compile.jit import helper, kernel
from ..core.compile.selection import where
from ..core.compile.signatures import reals, signature
from ..typing import Array

NORMALISED_ROWS = signature(
    "normalised_rows",
    error=reals("rows", "s"),
    covariance=reals("rows", "n", "n"),
    work=reals("lines", "s"),
    out=reals("rows"),
)


@kernel(NORMALISED_ROWS)
def normalised_rows(error: Array, covariance: Array, work: Array, out: Array) -> None:
    """out[k] = e_k' P_k^-1 e_k of errors (rows, s) and covariances (rows, n, n) of their states and
    others behind them; NaN where P is not positive definite. `work` is (s + 2, s)."""
    for k in range(error.shape[0]):
        out[k] = normalised_error(error[k], covariance[k], work)


@helper
def normalised_error(error: Array, P: Array, work: Array) -> float:
    """e' P^-1 e of an error (s,), as `normalised_rows` has it of many."""
    s, total = error.size, 0.0
    scale, y = work[s], work[s + 1]
    for i in range(s):
        scale[i] = _inverse_root(P[i, i])
        y[i] = error[i] * scale[i]
        for j in range(i + 1):
            value = P[i, j] * scale[i] * scale[j]
            for m in range(j):
                value -= work[i, m] * work[j, m]
            if j < i:
                work[i, j] = value * work[j, j]
                y[i] -= work[i, j] * y[j]
            else:
                work[i, i] = _inverse_root(value)  # the inverse of the diagonal
        y[i] *= work[i, i]
        total += y[i] * y[i]
    return total


@helper
def _inverse_root(x: float) -> float:
    """1/sqrt(x), NaN where x is not above 0."""
    above = x > 0
    return 1 / math.sqrt(where(above, x, 1.0)) + where(above, 0.0, math.nan)
