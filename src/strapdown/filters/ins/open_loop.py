"""Open loop (feed-forward): the INS runs raw and alone; its error is estimated beside it and never
reset. The belief is INS (+) error.

The error is propagated by a linear model, which is what separates an open loop from a closed one
once the INS has drifted. Of what it neglects, the products of position and velocity errors are the
largest and depend on the coordinates of the position error; see `KINEMATICS`.
"""

import math

from ...checks import check_choice
from ...core.compile.selection import any_of, where
from ...core.loop.contract import (
    ATT,
    BA,
    BG,
    CORRECT,
    DECAYING,
    PREDICT,
    Condition,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.adjoint import SMOOTHER
from ...core.mathematics.earth import FAR_HEIGHT
from ...core.mathematics.error_dynamics import TV
from ...core.mathematics.error_state import (
    BLOCK,
    DX,
    ERROR_STATE,
    HEIGHT,
    X,
    add_error,
    allocate,
    bias_free,
    decay_biases,
    inject_tail,
    linearised_step,
    measure,
    turn_half,
)
from ...core.mathematics.mechanization import mechanize
from ...typing import Array

BESIDE = Slots(after=ERROR_STATE)
# of the raw INS
LLA = BESIDE.array("LLA", 3)
V = BESIDE.array("V", 3)
C = BESIDE.matrix("C", 3, 3)
BIAS = BESIDE.array("BIAS", 6)  # what it takes off its IMU: accelerometer, gyro
CONDITION = BESIDE.number("CONDITION")  # which of CONDITIONS holds, counted from 1
MODE = BESIDE.number("MODE")  # which of:
SECOND_ORDER, METRES, GEODETIC = range(3)
KINEMATICS = {"second-order": SECOND_ORDER, "metres": METRES, "geodetic": GEODETIC}
"""Kinematics of the position error: exact to second order; linear in metres NED at the belief;
linear in latitude, longitude and height as Hager & Bryne, to second order (5 % of its own error
at 50 km of drift, 7 % at 160 km; beyond 500 km it is another filter)."""
SLOTS = Slots(after=BESIDE)
# true - raw INS, as estimated
INS_ERROR = SLOTS.outputs("ins_error_north [m]", "ins_error_east [m]", "ins_error_down [m]")
LEFT_MODEL = "the raw INS left the model"
CONDITIONS = (
    Condition(f"{LEFT_MODEL}: its height is beyond {FAR_HEIGHT / 1e3:.0f} km, use closed-loop"),
    Condition(
        "the raw INS is tilted so far that its linear error model no longer holds: use closed-loop, "
        "or a better start"
    ),
)
TOO_HIGH, TOO_TILTED = 1.0, 2.0
GRAVITY = 9.81  # m/s^2
COVERED = 20.0  # standard deviations of the vertical bias; more shows in vertical velocities


def start(
    start: InitialState,
    noise: Noise,
    error_model: str = "corrected",
    kinematics: str = "second-order",
) -> FilterState:
    """The filter state at `start`: the INS begins there, and only the initial biases of `start` are taken off
    its IMU (decaying as the model says).

    error_model: "corrected", or a name of core.mathematics.error_dynamics.MODELS: what Hager & Bryne print,
    whole or in part. kinematics: propagation of the position error, "second-order" (exact to second
    order), "metres" (linear, in metres NED) or "geodetic" (linear in latitude, longitude and
    height, as Hager & Bryne).
    """
    return beside(start, SLOTS, error_model, kinematics)


def beside(
    start: InitialState,
    slots: Slots,
    error_model: str = "corrected",
    kinematics: str = "second-order",
) -> FilterState:
    """The filter state at `start` of a filter with an INS and an error beside it; its slots continue
    BESIDE."""
    check_choice(kinematics, "kinematics", KINEMATICS)
    belief = start.belief(allocate(slots, error_model))
    raw = BESIDE.views(belief.workspace)
    raw["LLA"][:], raw["V"][:], raw["C"][:] = belief.lla, belief.v_n, belief.C_nb
    belief.workspace[BIAS] = *belief.b_a, *belief.b_g
    belief.workspace[MODE] = KINEMATICS[kinematics]
    return belief


@helper
def predict_beside(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """One step of the raw INS and of the error beside it; the belief is composed of both."""
    workspace = belief.workspace
    b = workspace[BIAS]
    linearised_step(belief, belief.C_nb, 1.0, u, dt, noise, True)
    mode = int(workspace[MODE])
    if mode != METRES:
        products(workspace[X], workspace[BLOCK], belief.lla[0], mode == GEODETIC, dt)
    r, a = bias_free(u, b[0:3], b[3:6], dt)
    mechanize(
        workspace[LLA],
        workspace[V],
        matrix(workspace, C, 3, 3),
        r,
        a,
        dt,
        workspace[DX],
        workspace[HEIGHT],
    )
    decay_biases(b[0:3], b[3:6], dt, noise)
    compose(belief)
    workspace[CONDITION] = beyond_model(belief)


@helper
def beyond_model(belief: FilterState) -> float:
    """Which of CONDITIONS holds: gravity is no series any more at the height of the raw INS, or its
    tilt theta takes more of gravity from the vertical, g theta^2 / 2, than the bias covers."""
    workspace, x = belief.workspace, belief.workspace[X]
    left_out = 0.5 * GRAVITY * (x[6] * x[6] + x[7] * x[7])
    tilted = left_out * left_out > COVERED * COVERED * belief.P[11, 11]
    within = abs(workspace[LLA][2]) <= FAR_HEIGHT
    return where(within, where(tilted, TOO_TILTED, 0.0), TOO_HIGH)


@helper
def products(x: Array, blocks: Array, lat: float, geodetic: bool, dt: float) -> None:
    """Products of position and velocity errors that the linear position kinematics in metres at the
    belief leave out.

    x is in metres at the INS, whose scale changes with the velocity of the INS and not with that of
    the belief. In geodetic coordinates that scale is no matter, but the velocity error is divided
    by the radius at the wrong height and latitude: these products are put in.
    """
    # 1/M, 1/N, tan/N, whatever their printed signs
    m, n, tan = (
        abs(blocks[TV + 3]),
        abs(blocks[TV + 1]),
        math.copysign(abs(blocks[TV + 7]), lat),
    )
    north = m * x[5] * x[0]
    east = (n * x[5] + tan * x[3]) * x[1]
    if geodetic:
        north += m * x[3] * x[2]
        east += (n * x[2] + tan * x[0]) * x[4]
    x[0] += dt * north
    x[1] += dt * east


@helper
def compose(belief: FilterState) -> None:
    """belief = INS (+) error: equations (20)-(23) of the paper."""
    workspace = belief.workspace
    x, b, raw, out = (
        workspace[X],
        workspace[BIAS],
        matrix(workspace, C, 3, 3),
        workspace[INS_ERROR],
    )
    lla, v, xa, xg = workspace[LLA], workspace[V], x[BA], x[BG]
    for i in range(3):
        belief.lla[i], belief.v_n[i], out[i] = lla[i], v[i], x[i]
        belief.b_a[i], belief.b_g[i] = b[i] + xa[i], b[3 + i] + xg[i]
        for j in range(3):
            belief.C_nb[i, j] = raw[i, j]
    add_error(belief.lla, belief.v_n, belief.C_nb, x)


@helper
def correct_beside(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct the error beside the INS: its prior is kept and the correction added to it."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    if any_of(nis <= gate):
        x, dx = belief.workspace[X], belief.workspace[DX]
        for i in range(x.size):
            x[i] += dx[i]
        inject_tail(belief, dx)
        compose(belief)
        theta = dx[ATT]
        turn_half(belief.P, theta[0], theta[1], theta[2])
    return nis


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P, the raw INS and the error beside it."""
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
    """Correct P and the error beside the INS."""
    return correct_beside(belief, y, std, observe, source, gate, innovation)


OPEN_LOOP = Filter(
    "open-loop",
    "Hager & Bryne, section IV-A, equations (19)-(23)",
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
    good_for="an INS that must not be corrected, tactical or better",
    poor_for="consumer IMUs, or hours: the INS leaves its linear model",
)
