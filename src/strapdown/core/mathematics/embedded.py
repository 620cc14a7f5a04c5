"""A FilterState inside another one: an observer beside a filter, a sigma point, a component of a mixture.

Its state is a row of numbers of the workspace, seen as arrays; its P, workspace and extra states
are given, its own or those of the belief that it is inside of.
"""

import numpy as np

from ...typing import Array
from ..compile.jit import inline, matrix
from ..compile.selection import where
from ..compile.workspace import Slots
from .belief import FilterState

NAVIGATION = Slots()
"""The state of a FilterState, as there."""
LLA = NAVIGATION.array("LLA", 3)
V = NAVIGATION.array("V", 3)
C = NAVIGATION.matrix("C", 3, 3)
BA = NAVIGATION.array("BA", 3)
BG = NAVIGATION.array("BG", 3)
OMEGA = NAVIGATION.array("OMEGA", 3)
F = NAVIGATION.array("F", 3)


@inline
def navigation(numbers: Array, P: Array, workspace: Array, augmented: Array) -> FilterState:
    """The FilterState whose state is the first of `numbers` (of NAVIGATION)."""
    return FilterState(
        numbers[LLA],
        numbers[V],
        matrix(numbers, C, 3, 3),
        numbers[BA],
        numbers[BG],
        P,
        numbers[OMEGA],
        numbers[F],
        workspace,
        augmented,
    )


@inline
def copy_motion(belief: FilterState, other: FilterState, wanted: bool = True) -> None:
    """Position, velocity, attitude and biases of the belief become those of another, where that is
    wanted."""
    for i in range(3):
        belief.lla[i] = where(wanted, other.lla[i], belief.lla[i])
        belief.v_n[i] = where(wanted, other.v_n[i], belief.v_n[i])
        belief.b_a[i] = where(wanted, other.b_a[i], belief.b_a[i])
        belief.b_g[i] = where(wanted, other.b_g[i], belief.b_g[i])
        for j in range(3):
            belief.C_nb[i, j] = where(wanted, other.C_nb[i, j], belief.C_nb[i, j])


def as_numbers(belief: FilterState) -> Array:
    """The state of a FilterState as numbers of NAVIGATION."""
    return np.concatenate([part.ravel() for part in (*belief[:5], belief.omega, belief.f)])
