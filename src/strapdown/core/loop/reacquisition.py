"""Room in P for a measurement whose source was rejected for long: a filter that rejects everything is too
sure of itself."""

import math

from ...typing import Array
from ..compile.jit import helper, matrix
from ..mathematics.source import Kind, SourceRow
from .cursor import Work

DOUBT = 9.0  # largest growth of P at once
HORIZONTAL_GATE = 13.816  # chi-square of two rows, 0.1 %


@helper
def make_room(P: Array, source: SourceRow, vertical: bool, work: Work) -> None:
    """Let P grow for a measurement of a source, which only its height contradicts where that is
    `vertical`."""
    if vertical:
        _of_height(P, source.kind, work.innovation)
    elif work.alone > 0:
        _of_velocity(P, work)
    elif source.states > 0:
        _of_own_states(P, source, work)
    else:
        _of_all(P, work.nis / source.gate, source.kind == Kind.POSITION, work.innovation)


@helper
def _of_all(P: Array, excess: float, position: bool, innovation: Array) -> None:
    """Room for a measurement whose NIS is `excess` times its gate.

    P grows as a whole, so that attitude and biases can turn too. A position that is further off than
    that explains has jumped: it shall move the position and bend nothing else.
    """
    factor = min(excess, DOUBT)
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] *= factor
    if position and excess > DOUBT:
        for i in range(3):
            if not math.isnan(innovation[i]):
                P[i, i] += innovation[i] * innovation[i]


@helper
def _of_own_states(P: Array, source: SourceRow, work: Work) -> None:
    """Room for the states that a source brings along, such as wind or the bias of a barometer, with
    the innovation and H in the work: they have jumped, and all else stays as it is."""
    H = matrix(work.jacobian, 0, 3, P.shape[0])
    first, end = source.first_state, source.first_state + source.states
    for row in range(3):
        e, square = work.innovation[row], 0.0
        for i in range(first, end):
            square += H[row, i] * H[row, i]
        if square > 0 and not math.isnan(e):
            for i in range(first, end):
                P[i, i] += e * e / square


@helper
def _of_velocity(P: Array, work: Work) -> None:
    """Room along the velocities that a measurement in the body sees, with the innovation and H that
    stages/dead_reckoning.py has left: all else stays as it is."""
    H = matrix(work.jacobian, 0, 3, P.shape[0])
    for row in range(3):
        h, e = H[row, 3:6], work.other[row]
        square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
        if square > 0 and not math.isnan(e):
            for i in range(3):
                for j in range(3):
                    P[3 + i, 3 + j] += h[i] * h[j] * (e / square) ** 2


@helper
def _of_height(P: Array, kind: int, innovation: Array) -> None:
    """Room for the height, or the vertical velocity: it shall move that and bend nothing else, least
    of all attitude and biases."""
    row, state = row_of_height(kind), 5 if kind == Kind.VELOCITY else 2
    if not math.isnan(innovation[row]):
        P[state, state] += innovation[row] * innovation[row]


# ---- heights


@helper
def row_of_height(kind: int) -> int:
    """The row of y in which a source measures height or vertical velocity, -1 where it has none."""
    if kind == Kind.POSITION or kind == Kind.VELOCITY:
        return 2
    return 0 if kind == Kind.ALTITUDE else -1


@helper
def is_height(kind: int) -> bool:
    """True where a source measures the height above the ellipsoid."""
    return kind == Kind.POSITION or kind == Kind.ALTITUDE


@helper
def height_alone(kind: int, innovation: Array) -> bool:
    """True where a measurement is beyond its gate for its height alone."""
    if kind == Kind.ALTITUDE:
        return True
    if kind != Kind.POSITION and kind != Kind.VELOCITY:
        return False
    north, east = innovation[3], innovation[4]
    return not north * north + east * east > HORIZONTAL_GATE
