"""The record that the loop writes for the smoother, where there is one."""

from ...typing import Array
from ..compile.jit import caller, flatten, helper
from ..mathematics.belief import FilterState
from ..mathematics.tape import SAVE_STEP
from .cursor import Cursor, LoopState
from .kernels import Kernels, stage_at, step_at
from .tables import Fixes

save_step_at = caller(SAVE_STEP)


@helper
def save_step(belief: FilterState, state: LoopState, record: Array) -> None:
    """Record the last call, where there is a record; count it anyway, so that one can be made
    for the next time."""
    if record.shape[0] > 0:
        save_step_at(state.save_step)(belief, record[state.recorded])
    state.recorded += 1


@helper
def call_stage(
    stage: int,
    kernels: Kernels,
    belief: FilterState,
    fixes: Fixes,
    k: int,
    cursor: Cursor,
    record: Array,
) -> int:
    """The stage at an address, with the row on which it may record what it does."""
    first = cursor.state[0].recorded * record.shape[1]
    row = flatten(record)[first : first + record.shape[1]]  # (0,) where there is no record
    return stage_at(stage)(kernels, belief, fixes, k, cursor, row)


@helper
def call_step(
    step: int, belief: FilterState, u: Array, dt: float, cursor: Cursor, record: Array
) -> None:
    """The same of a stage of a prediction."""
    first = cursor.state[0].recorded * record.shape[1]
    row = flatten(record)[first : first + record.shape[1]]
    step_at(step)(belief, u, dt, cursor, row)
