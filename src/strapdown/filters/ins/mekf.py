"""Multiplicative EKF for aided INS: its attitude error is twice the Gibbs vector of an error
quaternion in body axes, q_true = q_est (x) dq(a).

dq(a) = [2, a]/sqrt(4 + a'a). The library keeps errors in the navigation frame, theta = C a: P_n = A
P_b A' with A = diag(I, I, C, I, I), and rows of measurements H_b = H_n A. So prediction, gain and
every kind of measurement are those of the closed loop, and one thing is the filter's own: a correction
of the attitude is composed as a 2 x Gibbs vector, not as a rotation vector. The Gibbs vector of half
a turn is infinite, but only that of a correction is ever used, as the other way round: every vector
makes a rotation of less than half a turn.

Many books let P_b stay as it is when the quaternion takes the correction over. To second order in
the errors it turns back by half of the correction, and P_n forward by as much (`turn_half`).
"""

import math

from ...core.compile.selection import any_of
from ...core.loop.contract import (
    ATT,
    CORRECT,
    DECAYING,
    Filter,
    FilterState,
    Observe,
    SourceRow,
    helper,
    kernel,
)
from ...core.mathematics.adjoint import SMOOTHER
from ...core.mathematics.elementary import arctangent
from ...core.mathematics.error_state import DX, ERROR_STATE, inject_and_reset, measure
from ...typing import Array
from .closed_loop import predict, start

TINY = 1e-100  # of what is divided by it nothing is left anyway


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P; inject the errors into INS and biases, that of the attitude as a 2 x Gibbs
    vector."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    if any_of(nis <= gate):
        dx = belief.workspace[DX]
        rotation_vector(dx[ATT])
        inject_and_reset(belief, dx)
    return nis


@helper
def rotation_vector(a: Array) -> None:
    """From twice a Gibbs vector, a (3,), to the rotation vector (rad) of the same rotation, in
    place: tan(angle/2) = |a|/2."""
    half = 0.5 * math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    scale = arctangent(half) / max(half, TINY)
    for i in range(3):
        a[i] *= scale


MEKF = Filter(
    "mekf",
    "Markley (2003), J. Guidance 26(2); Fossen (2021) section 14.4.3",
    start,
    predict,
    correct,
    slots=ERROR_STATE,
    smoother=SMOOTHER,
    installation=True,
    lanes=True,
    bias=DECAYING,
    good_for="like closed-loop, with a Gibbs vector for attitude",
    poor_for="consumer IMUs whose heading is not observable",
)
