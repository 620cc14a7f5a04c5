"""Indirect filter with the attitude of an AHRS, feedback: the estimated error of the INS is
reset into it at each fix."""

from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceRow,
    kernel,
)
from ...core.mathematics.error_state import DV, DX, TRANSPORT, allocate, inject_all, measure
from ...core.mathematics.rotation import rotate_left, rotate_right
from ...typing import Array
from .known_attitude import (
    KNOWN_ATTITUDE,
    fade_shared,
    inflate_attitude_noise,
    know,
    learn_from_fix,
    predict_fed,
)


def start(
    start: InitialState,
    noise: Noise,
    correlation: float = 0.0,
    attitude_error: str = "considered",
) -> FilterState:
    """The filter state at `start`. correlation: time constant (s) of the errors of the AHRS;
    attitude_error: considered or neglected in the velocity."""
    return know(start.belief(allocate(KNOWN_ATTITUDE)), correlation, attitude_error)


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P and the INS: velocity with the known attitude, the attitude by the gyros alone."""
    r0, r1, r2 = predict_fed(belief, u, dt, noise)
    w = belief.workspace[TRANSPORT]
    rotate_right(belief.C_nb, r0, r1, r2)
    rotate_left(-w[0], -w[1], -w[2], belief.C_nb)


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
    """Correct P; inject the errors into INS and biases. A measured attitude also is the known
    one from now on."""
    fade_shared(belief, source)
    inflate_attitude_noise(belief, std, kind)
    nis = measure(belief, y, belief.workspace[DV], observe, source, gate, innovation)
    if nis <= gate:
        inject_all(belief, belief.workspace[DX])
        learn_from_fix(belief, y, std, kind)
    return nis


INDIRECT_AHRS_CLOSED = Filter(
    "indirect-ahrs-closed",
    "Fossen (2021) section 14.4.2, feedback",
    start,
    predict,
    correct,
    slots=KNOWN_ATTITUDE,
    needs=("attitude",),
    installation=True,
    bias=DECAYING,
    good_for="an AHRS in a disturbed field, with any IMU",
    poor_for="circling aircraft: it takes over the tilt error of the AHRS",
)
