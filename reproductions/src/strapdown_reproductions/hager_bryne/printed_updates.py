"""The loops with the update and the prediction of the error state as Hager & Bryne print them.

Equation (15), dx = W (y - h), has no prior: what a state of error was before the fix is dropped. The
closed loop resets all of it but the biases, so that it loses its biases at each fix; the open loop
resets nothing and loses everything. Section IV-B also says that after the reset the prediction (19)
is "evaluating to zero". Taken as it stands no bias ever reaches the INS, and (15) is right as
printed.
"""

from strapdown import register
from strapdown.checks import DataError, check_choice
from strapdown.core.compile.selection import any_of, where
from strapdown.core.loop.contract import (
    ATT,
    BA,
    BG,
    CORRECT,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    SourceRow,
    kernel,
)
from strapdown.core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    HEIGHT,
    X,
    add_error,
    allocate,
    inject,
    inject_tail,
    linearised_step,
    measure,
    turn_half,
)
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.filters.ins import open_loop
from strapdown.typing import Array

SLOTS = Slots(after=ERROR_STATE)
PREDICTS = SLOTS.number("PREDICTS")  # 1 where (19) takes the biases into the INS, else 0
WITHOUT_PRIOR, ZERO_PREDICTION = READINGS = ("without-prior", "zero-prediction")
"""The update (15) as printed, after a prediction (19) that the biases drive; and a prediction (19) of
zero."""
ONLY_CLOSED = (
    "open-loop-as-printed: reading is 'zero-prediction', which is what the reset of a closed loop "
    "leaves; an open loop has none, leave the option out"
)


def start(
    start: InitialState, noise: Noise, reading: str = WITHOUT_PRIOR, error_model: str = "corrected"
) -> FilterState:
    """The filter state at `start`. reading: one of READINGS; error_model as for the closed loop."""
    check_choice(reading, "reading", READINGS)
    belief = start.belief(allocate(SLOTS, error_model))
    belief.workspace[PREDICTS] = reading == WITHOUT_PRIOR
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P and the INS on the raw increments; the biases do to it what (19) is read to say."""
    workspace, keep = belief.workspace, belief.workspace[PREDICTS]
    x = workspace[X]
    for i in range(9):
        x[i] = 0.0
    xa, xg = x[BA], x[BG]
    for i in range(3):
        xa[i], xg[i] = keep * belief.b_a[i], keep * belief.b_g[i]
    linearised_step(belief, belief.C_nb, 1.0, u, dt, noise, True)
    mechanize(
        belief.lla,
        belief.v_n,
        belief.C_nb,
        (u[0], u[1], u[2]),
        (u[3], u[4], u[5]),
        dt,
        workspace[DX],
        workspace[HEIGHT],
    )
    add_error(belief.lla, belief.v_n, belief.C_nb, x)
    for i in range(3):
        belief.b_a[i], belief.b_g[i] = xa[i], xg[i]


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
    """Correct P; inject the kinematic errors; the biases are the correction alone."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    taken = nis <= gate
    if any_of(taken):
        dx = belief.workspace[DX]
        theta, a, g = dx[ATT], dx[BA], dx[BG]
        inject(belief.lla, belief.v_n, belief.C_nb, dx)
        inject_tail(belief, dx)
        for i in range(3):
            belief.b_a[i] = where(taken, a[i], belief.b_a[i])
            belief.b_g[i] = where(taken, g[i], belief.b_g[i])
        turn_half(belief.P, theta[0], theta[1], theta[2])
    return nis


CLOSED_LOOP = Filter(
    "closed-loop-as-printed",
    "Hager & Bryne, equations (15), (19) and (24)-(26) as printed",
    start,
    predict,
    correct,
    slots=SLOTS,
    lanes=True,
)


def start_open(
    start: InitialState,
    noise: Noise,
    reading: str = WITHOUT_PRIOR,
    error_model: str = "corrected",
    kinematics: str = "second-order",
) -> FilterState:
    """The filter state at `start` as for the open loop, whose only reading is "without-prior"."""
    if check_choice(reading, "reading", READINGS) == ZERO_PREDICTION:
        raise DataError(ONLY_CLOSED)
    return open_loop.start(start, noise, error_model, kinematics)


@kernel(CORRECT)
def correct_open(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P; the error beside the INS is the correction alone."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    taken = nis <= gate
    if any_of(taken):
        x, dx = belief.workspace[X], belief.workspace[DX]
        for i in range(x.size):
            x[i] = where(taken, dx[i], x[i])
        inject_tail(belief, dx)
        open_loop.compose(belief)
        theta = dx[ATT]
        turn_half(belief.P, theta[0], theta[1], theta[2])
    return nis


OPEN_LOOP = Filter(
    "open-loop-as-printed",
    "Hager & Bryne, equations (15) and (19)-(23) as printed",
    start_open,
    open_loop.predict,
    correct_open,
    slots=open_loop.SLOTS,
    conditions=open_loop.CONDITIONS,
    condition=open_loop.CONDITION,
    lanes=True,
)


def make_known() -> None:
    """Have studies, comparisons and `fuse` find the two by their names, in worker processes too."""
    register(CLOSED_LOOP, OPEN_LOOP)
