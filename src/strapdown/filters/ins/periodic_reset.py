"""Between open and closed loop: the error is estimated beside the INS and injected into it at the
first fix after every `interval` seconds.

Interval 0 is the closed loop, an infinite one the open loop.
"""

from ...checks import check_number
from ...core.compile.selection import any_of, where
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    SourceRow,
    kernel,
    matrix,
)
from ...core.mathematics.adjoint import SMOOTHER
from ...core.mathematics.error_state import X
from ...typing import Array
from . import open_loop
from .open_loop import (
    BIAS,
    CONDITION,
    CONDITIONS,
    INS_ERROR,
    LLA,
    C,
    V,
    beside,
    correct_beside,
    predict_beside,
)

SLOTS = Slots(after=open_loop.SLOTS)
INTERVAL = SLOTS.number("INTERVAL")  # s between resets
ELAPSED = SLOTS.number("ELAPSED")  # s since the last
ROUNDING = 1e-6  # s: of a sum of steps


def start(
    start: InitialState,
    noise: Noise,
    interval: float = 60.0,
    error_model: str = "corrected",
    kinematics: str = "second-order",
) -> FilterState:
    """The filter state at `start`. interval: seconds between resets, 0 to inf; error_model and kinematics
    as for the open loop."""
    check_number(interval, "interval", "s", least=0, infinite=True)
    belief = beside(start, SLOTS, error_model, kinematics)
    belief.workspace[INTERVAL] = interval
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """As the open loop, counting the seconds since the last reset."""
    belief.workspace[ELAPSED] += dt
    predict_beside(belief, u, dt, noise)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """As the open loop; once the interval has passed the INS takes over the belief and the error
    is zero again."""
    workspace = belief.workspace
    nis = correct_beside(belief, y, std, observe, source, gate, innovation)
    due = (nis <= gate) & (workspace[ELAPSED] >= workspace[INTERVAL] - ROUNDING)
    if any_of(due):
        workspace[ELAPSED] = where(due, 0.0, workspace[ELAPSED])
        lla, v, raw, b, x, out = (
            workspace[LLA],
            workspace[V],
            matrix(workspace, C, 3, 3),
            workspace[BIAS],
            workspace[X],
            workspace[INS_ERROR],
        )
        for i in range(3):
            out[i] = where(due, 0.0, out[i])
            lla[i], v[i] = where(due, belief.lla[i], lla[i]), where(due, belief.v_n[i], v[i])
            b[i], b[3 + i] = where(due, belief.b_a[i], b[i]), where(due, belief.b_g[i], b[3 + i])
            for j in range(3):
                raw[i, j] = where(due, belief.C_nb[i, j], raw[i, j])
        for i in range(x.size):
            x[i] = where(due, 0.0, x[i])
    return nis


PERIODIC_RESET = Filter(
    "periodic-reset",
    "Hager & Bryne, section VI (occasional resets)",
    start,
    predict,
    correct,
    slots=SLOTS,
    conditions=CONDITIONS,
    condition=CONDITION,
    smoother=SMOOTHER,
    installation=True,
    lanes=True,
    bias=DECAYING,
    good_for="comparing resets between open and closed loop",
    poor_for="IMUs moved by hand: it can diverge",
)
