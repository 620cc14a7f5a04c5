"""What the loop writes for the smoother, where there is one."""

from typing import Any

from ...typing import Array
from ..compile.jit import caller, helper
from ..mathematics.belief import Belief
from ..mathematics.tape import SAVE_STEP
from .cursor import LoopState

save_step_at = caller(SAVE_STEP)


@helper
def save_step(belief: Belief, state: LoopState, record: Array) -> None:
    """Record the last call, where there is a record; count it anyway, so that one can be made
    for the next time."""
    # a constant of the type: without a record nothing of this is compiled, which is worth 5 % of
    # a fix
    if record.ndim == 2:
        save_step_at(state.save_step)(belief, record[state.recorded])
    state.recorded += 1


@helper
def row_of_record(record: Array, state: LoopState) -> Any:
    """The row in which a stage may record what it does, or (0,) without a record."""
    if record.ndim == 2:
        return record[state.recorded]
    return record
