"""Closed loop of Hager & Bryne: kinematic errors are injected and reset, biases stay in the error
state and never enter the INS.

The INS runs on the uncorrected IMU; after the reset the error state is [0, 0, 0, b], its prediction
Phi [0, b] is not zero in position, velocity and attitude, and that part is composed into the
nominal state at each step.
"""

from ...core.loop.contract import BA, BG, DECAYING, PREDICT, Filter, FilterState, Noise, kernel
from ...core.mathematics.adjoint import SMOOTHER
from ...core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    HEIGHT,
    X,
    add_error,
    linearised_step,
)
from ...core.mathematics.mechanization import mechanize
from ...typing import Array
from .closed_loop import correct, start


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P and the error state [0, b]; run the INS on the raw increments and inject what
    the biases did to it."""
    x = belief.workspace[X]
    for i in range(9):
        x[i] = 0.0
    xa, xg = x[BA], x[BG]
    for i in range(3):
        xa[i], xg[i] = belief.b_a[i], belief.b_g[i]
    linearised_step(belief, belief.C_nb, 1.0, u, dt, noise, True)
    mechanize(
        belief.lla,
        belief.v_n,
        belief.C_nb,
        (u[0], u[1], u[2]),
        (u[3], u[4], u[5]),
        dt,
        belief.workspace[DX],
        belief.workspace[HEIGHT],
    )
    add_error(belief.lla, belief.v_n, belief.C_nb, x)


CLOSED_LOOP_ERROR_BIAS = Filter(
    "closed-loop-error-bias",
    "Hager & Bryne, section IV-B, equations (24)-(26)",
    start,
    predict,
    correct,
    slots=ERROR_STATE,
    smoother=SMOOTHER,
    installation=True,
    lanes=True,
    bias=DECAYING,
    good_for="comparing where biases are kept; errors as closed-loop",
    poor_for="other uses: closed-loop gives the same result",
)
