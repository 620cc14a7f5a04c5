"""Normalised estimation error squared of many rows at once: e' P^-1 e by Cholesky with the
states scaled to their standard deviations."""

import math

from ..core.jit import kernel
from ..core.signatures import reals, signature
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
    n, s = error.shape
    scale, y = work[s], work[s + 1]
    for k in range(n):
        total = 0.0
        for i in range(s):
            variance = covariance[k, i, i]
            scale[i] = 1 / math.sqrt(variance) if variance > 0 else math.nan
        for i in range(s):
            y[i] = error[k, i] * scale[i]
            for j in range(i + 1):
                value = covariance[k, i, j] * scale[i] * scale[j]
                for m in range(j):
                    value -= work[i, m] * work[j, m]
                if j < i:
                    work[i, j] = value * work[j, j]
                    y[i] -= work[i, j] * y[j]
                else:
                    # the inverse of the diagonal
                    work[i, i] = 1 / math.sqrt(value) if value > 0 else math.nan
            y[i] *= work[i, i]
            total += y[i] * y[i]
        out[k] = total
