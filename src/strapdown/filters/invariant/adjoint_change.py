"""The calls of a filter on the group undone: as `core/mathematics/adjoint.py`, with the change M of P
after a correction in place of its turn by half."""

from ...core.compile.jit import helper, kernel, matrix
from ...core.mathematics import adjoint
from ...core.mathematics.adjoint import adjoint_propagate, adjoint_update, save_step_rows
from ...core.mathematics.belief import STATES, FilterState
from ...core.mathematics.error_state import PREDICTED
from ...core.mathematics.tape import ADJOINT_STEP, SAVE_STEP, Smoother
from ...typing import Array
from .composed import CHANGE
from .group_errors import multiply, turn_covariance


def width(n: int) -> int:
    """Numbers of a record of one call, with n states: M behind those of the error-state filters."""
    return adjoint.width(n) + STATES * STATES


@kernel(SAVE_STEP)
def save_step(belief: FilterState, record: Array) -> None:
    """Save from workspace the last step, with M' if it was a correction."""
    save_step_rows(belief, record)
    if record[0] > 0:
        first = record.size - STATES * STATES
        for i in range(STATES):
            for j in range(STATES):
                record[first + STATES * j + i] = belief.workspace[CHANGE + STATES * i + j]


@kernel(ADJOINT_STEP)
def adjoint_step(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of the call in a record of `save_step`."""
    if call[0] == PREDICTED:
        adjoint_propagate(call, lam, Lam, work)
    elif call[0] > 0:
        undo_change(call, lam, Lam, work)
        adjoint_update(call, lam, Lam, work)


@helper
def undo_change(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """lam <- A' lam and Lam <- A' Lam A, A = diag(M, I)."""
    back = matrix(call, call.size - STATES * STATES, STATES, STATES)
    multiply(back, lam, work)
    turn_covariance(Lam, back, work)


SMOOTHER = Smoother(width, save_step, adjoint_step)
