"""Multiplicative EKF for aided INS: its attitude error is twice the Gibbs vector of an error
quaternion in body axes, q_true = q_est (x) dq(a).

dq(a) = [2, a]/sqrt(4 + a'a). The library keeps errors in the navigation frame, theta = C a: P_n = A
P_b A' with A = diag(I, I, C, I, I), and rows of measurements H_b = H_n A. So prediction, gain and
every kind of aiding are those of the closed loop, and two things are the filter's own: a correction
of the attitude is composed as a 2 x Gibbs vector, not as a rotation vector; and P_b stays as it is
when the quaternion takes the correction over, so that P_n turns with C. The Gibbs vector of half a
turn is infinite, but only that of a correction is ever used, as the other way round: every vector
makes a rotation of less than half a turn.
"""

import math

from ...core import adjoint
from ...core.contract import (
    ADJOINT_STEP,
    ATT,
    CORRECT,
    SAVE_STEP,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Smoother,
    Start,
    helper,
    kernel,
    matrix,
)
from ...core.error_state import DX, ERROR_STATE, allocate, inject_all, measure
from ...core.rotation import rotate_left, turned
from ...typing import Array
from .closed_loop import predict

SLOTS = Slots(after=ERROR_STATE)
TURN = SLOTS.matrix("TURN", 3, 3)  # the rotation of the last correction


def start(start: Start, noise: Noise, error_model: str = "corrected") -> Belief:
    """Belief at `start`. error_model: as for the closed loop."""
    return start.belief(allocate(SLOTS, error_model))


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P; inject the errors into INS and biases, that of the attitude as a 2 x Gibbs
    vector, and turn P with the attitude."""
    nis = measure(belief, y, sd, observe, parameters, gate, innovation)
    if nis <= gate:
        dx = belief.workspace[DX]
        rotation_vector(dx[ATT])
        inject_all(belief, dx)
        theta = dx[ATT]
        turn_covariance(
            belief.P, theta[0], theta[1], theta[2], matrix(belief.workspace, TURN, 3, 3)
        )
    return nis


@helper
def rotation_vector(a: Array) -> None:
    """From twice a Gibbs vector, a (3,), to the rotation vector (rad) of the same rotation, in
    place: tan(angle/2) = |a|/2."""
    half = 0.5 * math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    if half > 0:
        scale = math.atan(half) / half
        for i in range(3):
            a[i] *= scale


@helper
def turn_covariance(P: Array, x: float, y: float, z: float, R: Array) -> None:
    """P <- A P A' with A = diag(I, I, R, I, ...) and R (3, 3) that of the rotation vector (x, y,
    z), rad, symmetric to the last bit."""
    n = P.shape[0]
    for i in range(3):
        for j in range(3):
            R[i, j] = 1.0 if i == j else 0.0
    rotate_left(x, y, z, R)
    for j in range(n):
        P[6, j], P[7, j], P[8, j] = turned(R, P[6, j], P[7, j], P[8, j])
    for i in range(3):
        P[6 + i, 6], P[6 + i, 7], P[6 + i, 8] = turned(R, P[6 + i, 6], P[6 + i, 7], P[6 + i, 8])
    for i in range(3):
        for j in range(n):
            P[j, 6 + i] = P[6 + i, j]


@kernel(SAVE_STEP)
def save_step(belief: Belief, record: Array) -> None:
    """What the calls of the closed loop leave, and, last, the rotation vector of a correction."""
    adjoint.kept(belief, record)
    theta = belief.workspace[DX][ATT]
    for i in range(3):
        record[record.size - 3 + i] = theta[i]


@kernel(ADJOINT_STEP)
def adjoint_step(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of the call in a record of `save_step`: of a correction first that of its
    turn, lam <- A' lam and Lam <- A' Lam A."""
    if call[0] > 0:
        theta, R = call[call.size - 3 :], matrix(work, 0, 3, 3)
        turn_covariance(Lam, -theta[0], -theta[1], -theta[2], R)
        lam[6], lam[7], lam[8] = turned(R, lam[6], lam[7], lam[8])
    adjoint.undone(call, lam, Lam, work)


MEKF = Filter(
    "mekf",
    "Markley (2003), J. Guidance 26(2); Fossen (2021) section 14.4.3",
    start,
    predict,
    correct,
    slots=SLOTS,
    smoother=Smoother(lambda n: adjoint.width(n) + 3, save_step, adjoint_step),
    installation=True,
)
