"""Scale and misalignment of the IMU as states (core/mathematics/coupling.py has the equations)."""

from ....typing import Array
from ...compile.jit import kernel
from ...mathematics.belief import FilterState
from ...mathematics.coupling import correct_increments, couple
from ..cursor import Cursor
from ..kernels import STEP


@kernel(STEP)
def remove_imu_errors(
    belief: FilterState, u: Array, dt: float, cursor: Cursor, record: Array
) -> None:
    """Take the estimated errors out of increments before a prediction."""
    correct_increments(cursor.coupled, belief, u, -1.0, cursor.work[0].raw)


@kernel(STEP)
def add_imu_errors(belief: FilterState, u: Array, dt: float, cursor: Cursor, record: Array) -> None:
    """Add the estimated errors to increments that are made up, as the IMU would."""
    correct_increments(cursor.coupled, belief, u, 1.0, cursor.work[0].raw)


@kernel(STEP)
def couple_prediction(
    belief: FilterState, u: Array, dt: float, cursor: Cursor, record: Array
) -> None:
    """Apply the states of the IMU to a prediction: a call of its own to the smoother."""
    couple(cursor.coupled, belief, cursor.work[0].raw, dt, record)
    cursor.state[0].recorded += 1
