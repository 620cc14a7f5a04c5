"""A fix to second order: its Jacobian with the output approximation of equivariant filters, and as noise
what a linear model leaves out.

On the group a vector that is measured in n (position, velocity, a baseline) or in the body (a magnetic
field, a body velocity) is, to second order in the error xi = (.., theta),

    y = h + e + theta x e / 2 + ...,  e = H xi          in n; - theta x e / 2 in the body

- With e of the correction, H_theta <- H_theta - S(e) / 2 in n and H_theta + S(e) C' / 2 in the body, C' to
  the axes of the fix, leave an error of third order. e is that of the pose alone: biases, iron, a clock
  or noise that lasts do not turn with it.
- Until the correction is known, theta x e / 2 is an error of the fix as any other. Without it the gate
  refuses what a filter far off cannot predict.

An equivariant filter as published takes the whole innovation for e. Then noise of the fixes is in H, and
a vehicle at rest seems to tell its heading: after n fixes to sqrt(2 / n) rad whatever the noise.

Source: van Goor, Hamel & Mahony (2023), "Equivariant filter (EqF)", IEEE TAC 68(6), output approximation;
second moments as in Gelb (1974), "Applied Optimal Estimation", section 6.1, second-order filter.
"""

import math

from ...core.compile.jit import helper, matrix
from ...core.mathematics.belief import FilterState
from ...core.mathematics.error_state import CALL, DX, JACOBIAN, WORK, observe_innovation
from ...core.mathematics.kalman import update, used_rows
from ...core.mathematics.source import IN_BODY, Observe, SourceRow
from ...typing import Array
from .composed import SLOTS
from .group_errors import turn_back

POSE = 9
"""As many errors turn with the pose: those of biases, sensors and noise that lasts do not."""
EXPLAINED = SLOTS.array("EXPLAINED", 3)  # e
STDS = SLOTS.array("STDS", 3)  # of the rows, with what the second order adds
SPREAD = SLOTS.matrix("SPREAD", 3, POSE)  # H P
SEEN = SLOTS.matrix("SEEN", 3, 3)  # H P H'
TURN = SLOTS.matrix("TURN", 3, 3)  # covariance of the attitude's error, in the axes of the fix


@helper
def measure_to_second_order(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
    whole: float,
) -> float:
    """`measure` to second order. whole: 1 where e is the whole innovation, and nothing else is done."""
    n, work = belief.P.shape[0], belief.workspace
    H, dx, e = matrix(work, JACOBIAN, 3, n), work[DX], work[EXPLAINED]
    rows, stds = observe_innovation(belief, y, observe, source, innovation, H), work[STDS]
    for i in range(3):
        stds[i], e[i] = std[i], innovation[i]
    if rows == 3 and source.pose_axes > 0:
        if whole == 0:
            widen(belief, H, source.pose_axes, stds)
            update(belief.P, H, innovation, stds, rows, -1.0, work[WORK], dx)
            for i in range(3):
                e[i] = dot(H[i], dx[:POSE])
            turn_jacobian(H, e, source.pose_axes, belief.C_nb)
        elif not math.isnan(e[0] + e[1] + e[2]):
            turn_jacobian(H, e, source.pose_axes, belief.C_nb)
    nis = update(belief.P, H, innovation, stds, rows, gate, work[WORK], dx)
    work[CALL] = work[WORK.start + used_rows(n)] if nis <= gate else 0.0
    return nis


@helper
def dot(h: Array, x: Array) -> float:
    """h x."""
    total = 0.0
    for j in range(x.size):
        total += h[j] * x[j]
    return total


@helper
def turn_jacobian(H: Array, e: Array, axes: int, C: Array) -> None:
    """H_theta of the second order: -S(e) / 2 more in n, S(e) C' / 2 in the body."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3  # row i of S(e): -e[k] in column j, e[j] in column k
        if axes == IN_BODY:
            for m in range(3):
                H[i, 6 + m] += 0.5 * (e[j] * C[m, k] - e[k] * C[m, j])
        else:
            H[i, 6 + j] += 0.5 * e[k]
            H[i, 6 + k] -= 0.5 * e[j]


@helper
def widen(belief: FilterState, H: Array, axes: int, stds: Array) -> None:
    """Standard deviations of the rows with those of theta x e / 2, the covariances of theta and of the
    part of e that is of the pose being A and B. For independent ones the trace of its covariance is

        E|theta x e|^2 / 4 = (tr A tr B - tr A B) / 4

    which two directions share, those across theta, whatever the axes of n. What theta and e have in common,
    which a heading that is far off makes large, would give up to twice that.
    """
    work = belief.workspace
    A, B = matrix(work, TURN, 3, 3), matrix(work, SEEN, 3, 3)
    spread_of_turn(belief, axes, A)
    spread_of_rows(H, belief.P, matrix(work, SPREAD, 3, POSE), B)
    a, b, both = A[0, 0] + A[1, 1] + A[2, 2], B[0, 0] + B[1, 1] + B[2, 2], 0.0
    for i in range(3):
        both += dot(A[i], B[i])
    more = 0.125 * max(a * b - both, 0.0)
    for i in range(3):
        stds[i] = math.sqrt(stds[i] * stds[i] + more)


@helper
def spread_of_turn(belief: FilterState, axes: int, A: Array) -> None:
    """A, of the attitude's error in the axes of the fix."""
    P, C = belief.P, belief.C_nb
    for i in range(3):
        for j in range(3):
            A[i, j] = P[6 + i, 6 + j]
    if axes == IN_BODY:
        for i in range(3):
            turn_back(C, A[i])
        for j in range(3):
            turn_back(C, A[:, j])


@helper
def spread_of_rows(H: Array, P: Array, U: Array, B: Array) -> None:
    """B = H P H' of the errors of the pose, by way of U = H P."""
    for i in range(3):
        for j in range(POSE):
            U[i, j] = dot(H[i], P[j, :POSE])
        for j in range(3):
            B[i, j] = dot(H[j], U[i, :POSE])
