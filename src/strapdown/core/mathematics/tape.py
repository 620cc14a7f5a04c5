"""The record of a call of predict or correct for the backward pass, and its adjoint."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from ...typing import Array
from ..compile.signatures import reals, signature
from .belief import BELIEF, FilterState

SAVE_STEP = signature("save_step", belief=BELIEF, record=reals("width"))
ADJOINT_STEP = signature(
    "adjoint_step", call=reals("width"), lam=reals("k"), Lam=reals("k", "k"), work=reals("work")
)

SaveStep: TypeAlias = Callable[[FilterState, Array], None]
"""(belief, record (width,)): what the adjoint of the last call of predict or correct needs, also
where it did nothing."""
AdjointStep: TypeAlias = Callable[[Array, Array, Array, Array], None]
"""(record, lam (k,), Lam (k, k), work: core.smoother.work_size): the adjoint of that call, on the
states that the filter estimates and the tail."""


class Smoother(NamedTuple):
    """The kernels that undo the calls of a filter, last one first."""

    width: Callable[[int], int]  # n -> numbers of a record of one call, with n states
    save_step: SaveStep
    adjoint_step: AdjointStep
    # (calls, width) -> (calls, n, n): what P holds after each call that made no gains, such as
    # biases that are no states; the way back leaves it out
    considered: Callable[[Array], Array] | None = None
