"""Indirect filter with the attitude of an AHRS, feed-forward: the INS runs raw, its error is
estimated beside it. The belief is INS (+) error.

Of the attitude only the sum of INS and error is kept: it has no part in the velocity, and a raw one
beside a small-angle error would be over with the first tens of degrees that uncorrected gyros
drift.
"""

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
from ...core.mathematics.error_state import BLOCK, DV, TRANSPORT, X, decay_biases, linearised_step
from ...core.mathematics.rotation import orthonormalise, rotate_left, rotate_right
from ...typing import Array
from ..ins import open_loop
from ..ins.open_loop import (
    BIAS,
    CONDITION,
    CONDITIONS,
    LLA,
    C,
    V,
    beside,
    beyond_model,
    compose,
    correct_beside,
    products,
)
from .known_attitude import (
    KNOWN,
    KNOWN_ATTITUDE,
    fade_shared,
    inflate_attitude_noise,
    know,
    learn_from_fix,
    move,
)

SLOTS = Slots(after=KNOWN_ATTITUDE)
SLOTS.outputs(*open_loop.SLOTS.columns)  # which `compose` writes


def start(
    start: InitialState,
    noise: Noise,
    correlation: float = 0.0,
    attitude_error: str = "considered",
) -> FilterState:
    """The filter state at `start`: the INS begins there, only the initial biases of `start` are taken off its
    IMU. correlation: time constant (s) of the errors of the AHRS; attitude_error: considered or
    neglected in the velocity.
    """
    return know(beside(start, SLOTS), correlation, attitude_error)


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P, the raw INS and the error beside it: velocity with the known attitude,
    attitudes with corrected gyros."""
    workspace, b_g = belief.workspace, belief.b_g
    x, b, attitude = workspace[X], workspace[BIAS], matrix(workspace, C, 3, 3)
    r0, r1, r2 = u[0] - b_g[0] * dt, u[1] - b_g[1] * dt, u[2] - b_g[2] * dt
    linearised_step(belief, matrix(workspace, KNOWN, 3, 3), 0.0, u, dt, noise, True)
    products(x, workspace[BLOCK], belief.lla[0], False, dt)
    move(
        belief,
        workspace[LLA],
        workspace[V],
        (r0, r1, r2),
        (u[3] - b[0] * dt, u[4] - b[1] * dt, u[5] - b[2] * dt),
        dt,
        noise,
    )
    w = workspace[TRANSPORT]
    x[6] = x[7] = x[8] = 0.0
    rotate_right(attitude, r0, r1, r2)
    rotate_left(-w[0], -w[1], -w[2], attitude)
    decay_biases(b[0:3], b[3:6], dt, noise)
    compose(belief)
    workspace[CONDITION] = beyond_model(belief)


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
    """Correct P and the error beside the INS. A measured attitude also is the known one from now
    on."""
    fade_shared(belief, source)
    inflate_attitude_noise(belief, std, kind)
    nis = correct_beside(belief, y, belief.workspace[DV], observe, source, gate, innovation)
    if nis <= gate:
        x, attitude = belief.workspace[X], matrix(belief.workspace, C, 3, 3)
        rotate_left(x[6], x[7], x[8], attitude)
        orthonormalise(attitude)
        x[6] = x[7] = x[8] = 0.0
        learn_from_fix(belief, y, std, kind)
    return nis


INDIRECT_AHRS_OPEN = Filter(
    "indirect-ahrs-open",
    "Fossen (2021) section 14.4.2, feed-forward",
    start,
    predict,
    correct,
    needs=("attitude",),
    slots=SLOTS,
    conditions=CONDITIONS,
    condition=CONDITION,
    installation=True,
    bias=DECAYING,
    good_for="an AHRS, and an INS that must not be corrected",
    poor_for="consumer IMUs: the INS leaves its linear model",
)
