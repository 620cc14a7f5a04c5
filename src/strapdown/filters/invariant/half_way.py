"""Jacobians of a fix half way through its correction.

On the group a measured vector is y = h + H xi -+ (H xi) x theta / 2 + ..., to second order in xi, where it is
one of the pose alone: measured in n (position, velocity, a baseline) or in the body (a magnetic field, a
body velocity). So H of the middle between estimate and corrected estimate leaves an error of third
order. With e the innovation that the correction explains:

    in n     H_theta <- H_theta - S(e) / 2
    in body  H_theta <- H_theta + S(e) C' / 2

An equivariant filter as published takes the whole innovation for e. Then noise of the fixes is in H, and
a vehicle at rest seems to tell its heading: after n fixes to 2 / sqrt(n) rad whatever the noise.

Source: van Goor, Hamel & Mahony (2023), "Equivariant filter (EqF)", IEEE TAC 68(6), output approximation.
"""

import math

from ...core.compile.jit import helper, matrix
from ...core.mathematics.belief import FilterState
from ...core.mathematics.error_state import CALL, DX, JACOBIAN, WORK, observe_innovation
from ...core.mathematics.kalman import update, used_rows
from ...core.mathematics.source import Observe, SourceRow
from ...typing import Array
from .composed import SLOTS

IN_N, IN_BODY = 1, 2
"""Axes in which a vector is measured: SourceRow.pose_axes."""
EXPLAINED = SLOTS.array("EXPLAINED", 3)  # e


@helper
def measure_half_way(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
    whole: float,
) -> float:
    """`measure` with H half way. whole: 1 where e is the whole innovation."""
    n, work = belief.P.shape[0], belief.workspace
    H, dx, e = matrix(work, JACOBIAN, 3, n), work[DX], work[EXPLAINED]
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    if rows == 3 and source.pose_axes > 0:
        for i in range(3):
            e[i] = innovation[i]
        if whole == 0:
            update(belief.P, H, innovation, std, rows, -1.0, work[WORK], dx)
            for i in range(3):
                e[i] = dot(H[i], dx[:n]) if not math.isnan(e[i]) else e[i]
        if not math.isnan(e[0] + e[1] + e[2]):
            turn_jacobian(H, e, source.pose_axes, belief.C_nb)
    nis = update(belief.P, H, innovation, std, rows, gate, work[WORK], dx)
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
    """H_theta half way: -S(e) / 2 more in n, S(e) C' / 2 in the body."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3  # row i of S(e): -e[k] in column j, e[j] in column k
        if axes == IN_BODY:
            for m in range(3):
                H[i, 6 + m] += 0.5 * (e[j] * C[m, k] - e[k] * C[m, j])
        else:
            H[i, 6 + j] += 0.5 * e[k]
            H[i, 6 + k] -= 0.5 * e[j]
