"""Closed loop: errors are injected into the INS at each fix, biases are corrected inside the
INS. The default filter."""

from ...core.compile.selection import any_of
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
from ...core.mathematics.adjoint import SMOOTHER
from ...core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    HEIGHT,
    allocate,
    bias_free,
    inject_and_reset,
    linearised_step,
    measure,
)
from ...core.mathematics.mechanization import mechanize
from ...typing import Array


def start(start: InitialState, noise: Noise, error_model: str = "corrected") -> FilterState:
    """The filter state at `start`. error_model: "corrected", or a name of core.mathematics.error_dynamics.MODELS: what
    Hager & Bryne print, whole or in part."""
    return start.belief(allocate(ERROR_STATE, error_model))


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P, linearised at the belief, and the INS with bias-corrected increments."""
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    linearised_step(belief, belief.C_nb, 1.0, u, dt, noise, False)
    mechanize(
        belief.lla,
        belief.v_n,
        belief.C_nb,
        r,
        a,
        dt,
        belief.workspace[DX],
        belief.workspace[HEIGHT],
    )


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
    """Correct P; inject the errors into INS and biases."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    if any_of(nis <= gate):
        inject_and_reset(belief, belief.workspace[DX])
    return nis


CLOSED_LOOP = Filter(
    "closed-loop",
    "Groves (2013) section 14.1.1; Hager & Bryne, section IV-B",
    start,
    predict,
    correct,
    slots=ERROR_STATE,
    smoother=SMOOTHER,
    installation=True,
    lanes=True,
    bias=DECAYING,
    good_for="first choice: GNSS and an IMU of any grade",
    poor_for="consumer IMUs whose heading is not observable",
)
