"""Between open and closed loop: the error is estimated beside the INS and injected into it at the
first fix after every `interval` seconds.

Interval 0 is the closed loop, an infinite one the open loop.
"""

from ...checks import check_number
from ...core.adjoint import SMOOTHER
from ...core.contract import (
    CORRECT,
    PREDICT,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Start,
    kernel,
    matrix,
)
from ...core.error_state import X
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
    start: Start,
    noise: Noise,
    interval: float = 60.0,
    error_model: str = "corrected",
    kinematics: str = "second-order",
) -> Belief:
    """Belief at `start`. interval: seconds between resets, 0 to inf; error_model and kinematics
    as for the open loop."""
    check_number(interval, "interval", "s", least=0, infinite=True)
    belief = beside(start, SLOTS, error_model, kinematics)
    belief.workspace[INTERVAL] = interval
    return belief


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """As the open loop, counting the seconds since the last reset."""
    belief.workspace[ELAPSED] += dt
    predict_beside(belief, u, dt, noise)


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """As the open loop; once the interval has passed the INS takes over the belief and the error
    is zero again."""
    workspace = belief.workspace
    nis = correct_beside(belief, y, sd, observe, parameters, gate, innovation)
    if nis <= gate and workspace[ELAPSED] >= workspace[INTERVAL] - ROUNDING:
        workspace[ELAPSED] = 0.0
        lla, v, raw, b, x, out = (
            workspace[LLA],
            workspace[V],
            matrix(workspace, C, 3, 3),
            workspace[BIAS],
            workspace[X],
            workspace[INS_ERROR],
        )
        for i in range(3):
            out[i] = 0.0
            lla[i], v[i], b[i], b[3 + i] = belief.lla[i], belief.v[i], belief.ba[i], belief.bg[i]
            for j in range(3):
                raw[i, j] = belief.C[i, j]
        for i in range(x.size):
            x[i] = 0.0
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
)
