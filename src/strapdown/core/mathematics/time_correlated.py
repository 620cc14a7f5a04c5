"""Errors of a source that last, as states: what becomes of them between its fixes, and what its fixes
see of them.

Each is a first-order Gauss-Markov process c' = -c / T + w of stationary standard deviation sigma that
adds to a row of the source. Over dt it keeps the share phi = exp(-dt / T) and gains the variance
sigma^2 (1 - phi^2). Nothing but fixes of its source sees it, so all this waits for the next one, and
c stands still meanwhile. Source: Gelb (1974), Applied Optimal Estimation, section 3.8.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from .belief import STATES
from .kalman import decay
from .source import SourceRow

FADED = -98.0
"""First number of a record of `fade`, which no filter's own begins with. Behind it phi, and of each
row its state, or 0."""


@helper
def fade(P: Array, states: Array, source: SourceRow, seconds: float, record: Array) -> None:
    """The correlated errors of a source, among the states beyond the fifteenth, `seconds` after its
    fix before: c <- phi c, P <- Phi P Phi' + Q. Phi goes on the record (0,) or (5,)."""
    keep = decay(seconds / source.correlation_time)
    source.kept = keep
    if record.size > 0:
        record[0], record[1] = FADED, keep
    for i in range(3):
        k, std = source.correlated_state[i], source.correlated_std[i]
        if record.size > 0:
            record[2 + i] = k
        if k > 0:
            fade_state(P, states, k, keep, std * std * (1 - keep * keep))


@helper
def fade_state(P: Array, states: Array, k: int, keep: float, variance: float) -> None:
    """c <- phi c of the state k, which gains a variance."""
    states[k - STATES] *= keep
    for j in range(P.shape[0]):
        P[k, j] *= keep
        P[j, k] *= keep
    P[k, k] += variance


@helper
def forget_states(
    P: Array, states: Array, first: int, count: int, std: float, record: Array
) -> None:
    """`count` states, 3 at most, from `first` on become 0 +- std again, whatever was known of them: a
    `fade` of which nothing is left. Phi goes on the record (0,) or (5,)."""
    if record.size > 0:
        record[0], record[1] = FADED, 0.0
        for i in range(3):
            record[2 + i] = first + i if i < count else 0
    for i in range(count):
        fade_state(P, states, first + i, 0.0, std * std)


@helper
def unfade(record: Array, lam: Array, Lam: Array) -> None:
    """The adjoint of `fade`: lam <- Phi' lam, Lam <- Phi' Lam Phi."""
    for i in range(3):
        k = int(record[2 + i])
        if k > 0:
            lam[k] *= record[1]
            for j in range(lam.size):
                Lam[k, j] *= record[1]
                Lam[j, k] *= record[1]


@helper
def see(states: Array, source: SourceRow, innovation: Array, H: Array) -> None:
    """Add to what a source observes its correlated errors as they are estimated: innovation and
    H."""
    for i in range(3):
        k = source.correlated_state[i]
        if k > 0:
            innovation[i] -= states[k - STATES]
            H[i, k] = 1.0


@helper
def widen(std: Array, source: SourceRow) -> None:
    """Add to the standard deviations those of the correlated errors that are no states."""
    for i in range(3):
        more = source.correlated_std[i] if source.correlated_state[i] == 0 else 0.0
        std[i] = math.hypot(std[i], more)
