"""Scale and misalignment of the IMU as states: what they do to a prediction, for every filter.

A sensor reads u + M u, u being the true increments (rad, m/s; body): its scale on the diagonal of M,
its misalignment beside it. A state s is one number M[i, j] (no unit), as a row of `Coupling` says:

    u[i] <- u[i] - s u[j]                         before a prediction, by the estimate of s
    G = -C_mid[:, i] u[j]                         what an error of s moves: theta (rad) of the gyro,
                                                  v (m/s) of the accelerometer, NED
    P <- T P T',  T = I + G e_s'                  behind the prediction
    lam <- T' lam,  Lam <- T' Lam T               the way back, from a record of the loop's own

Source: Groves (2013) section 4.4.2, for the error model.
"""

from ...typing import Array
from ..compile.jit import helper
from ..compile.records import Table
from .belief import ATT, STATES, VEL, FilterState


class Coupling:
    """A state of the IMU, and which increments it acts on: 0 to 2 of the gyro, 3 to 5 of the
    accelerometer."""

    state: int  # its index
    into: int  # the component of the increments that it changes
    out_of: int  # the component that it takes of


COUPLED = -99.0
"""First number of a record of `couple`, which no filter's own begins with. Behind it the rows, and
of each its state, the first of the three states that it moves, and G (3)."""
ROW = 5


@helper
def correct_increments(
    coupled: Table[Coupling], belief: FilterState, u: Array, sign: float, raw: Array
) -> None:
    """Keep the increments u in `raw`, then take from u what the estimates say that is too much of
    them (sign -1), or add it (1)."""
    for i in range(6):
        raw[i] = u[i]
    for row in range(coupled.size):
        one = coupled[row]
        s = belief.augmented[one.state - STATES]
        u[one.into] += sign * s * raw[one.out_of]


@helper
def couple(
    coupled: Table[Coupling], belief: FilterState, raw: Array, dt: float, record: Array
) -> None:
    """P <- T P T' after a prediction over dt with increments that were read as `raw`; T goes on the
    record (0,) or (2 + ROW rows,)."""
    P, w, h = belief.P, belief.omega, 0.5 * dt
    for row in range(coupled.size):
        state, into = coupled[row].state, coupled[row].into
        first, i = (ATT.start, into) if into < 3 else (VEL.start, into - 3)
        j, k = (i + 1) % 3, (i + 2) % 3
        size = -raw[coupled[row].out_of]
        # the axis at mid-interval: half a turn back
        g0, g1, g2 = (
            size * (belief.C_nb[0, i] - h * (w[k] * belief.C_nb[0, j] - w[j] * belief.C_nb[0, k])),
            size * (belief.C_nb[1, i] - h * (w[k] * belief.C_nb[1, j] - w[j] * belief.C_nb[1, k])),
            size * (belief.C_nb[2, i] - h * (w[k] * belief.C_nb[2, j] - w[j] * belief.C_nb[2, k])),
        )
        _transform_covariance(P, state, first, (g0, g1, g2))
        if record.size > 0:
            at = 2 + ROW * row
            record[at], record[at + 1] = state, first
            record[at + 2], record[at + 3], record[at + 4] = g0, g1, g2
    if record.size > 0:
        record[0], record[1] = COUPLED, coupled.size


@helper
def _transform_covariance(P: Array, state: int, first: int, G: tuple[float, float, float]) -> None:
    """P <- T P T', symmetric to the last bit."""
    n, g0, g1, g2 = P.shape[0], G[0], G[1], G[2]
    row, r0, r1, r2 = P[state], P[first], P[first + 1], P[first + 2]
    for j in range(n):
        r0[j] += g0 * row[j]
        r1[j] += g1 * row[j]
        r2[j] += g2 * row[j]
    for i in range(3):
        for j in range(i + 1):
            P[first + i, first + j] += G[j] * P[first + i, state]
            P[first + j, first + i] = P[first + i, first + j]
    for j in range(n):
        P[j, first], P[j, first + 1], P[j, first + 2] = r0[j], r1[j], r2[j]


@helper
def uncouple(record: Array, lam: Array, Lam: Array) -> None:
    """The adjoint of `couple`: lam <- T' lam, Lam <- T' Lam T."""
    for row in range(int(record[1]) - 1, -1, -1):
        at = 2 + ROW * row
        state, first = int(record[at]), int(record[at + 1])
        g0, g1, g2 = record[at + 2], record[at + 3], record[at + 4]
        lam[state] += g0 * lam[first] + g1 * lam[first + 1] + g2 * lam[first + 2]
        for j in range(lam.size):
            Lam[state, j] += g0 * Lam[first, j] + g1 * Lam[first + 1, j] + g2 * Lam[first + 2, j]
        for j in range(lam.size):
            Lam[j, state] += g0 * Lam[j, first] + g1 * Lam[j, first + 1] + g2 * Lam[j, first + 2]
