"""Exogenous Kalman filter: a nonlinear observer gives the trajectory to linearise about, an affine
Kalman filter around it the estimate.

The observer runs by itself, as in `nlo`. Beside it the filter keeps P and delta = estimate (-)
observer. Between fixes estimate = f(observer) (+) Phi delta, with one mechanization f of the
observer's state without its injections; at a fix the innovation is y - h(observer) - H delta. Where
the observer injects, jumps or is bounded the estimate stays where it is and delta becomes what then
lies between them: the mismatch of a trajectory that is no solution of the model. docs/exogenous.md.
"""

import math
from typing import Any

from ...checks import check_choice, check_number
from ...core.contract import (
    ALTITUDE_KIND,
    ATTITUDE_KIND,
    BA,
    BG,
    CORRECT,
    COURSE_KIND,
    HEADING_KIND,
    MAGNETIC_KIND,
    POSITION_KIND,
    PREDICT,
    STATES,
    VELOCITY_KIND,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Start,
    kernel,
    matrix,
)
from ...core.earth import place
from ...core.embedded import take_over
from ...core.error_state import (
    DX,
    ERROR_STATE,
    JACOBIAN,
    WORK,
    X,
    added,
    allocate,
    bias_free,
    decay_biases,
    inject_tail,
    linearised_step,
    observed,
)
from ...core.jit import helper, inlined
from ...core.kalman import update
from ...core.mechanization import mechanize
from ...core.rotation import rotation_between, wrap
from ...typing import Array
from . import nlo
from .equations import BLOCK, CONDITION, EMBEDDED, OBSERVER, advance, embedded, follow, inject
from .gains import configure, implant, takes_options
from .own_estimate import DOUBT, LOST, OWN, TURN, carry_own, correct_own, take_heading
from .repeated_fix import FORGOTTEN, KIND, MEMORY, repeated

SLOTS = Slots(after=ERROR_STATE)
# estimate - observer
SHIFT = SLOTS.outputs(
    "observer_error_north [m]", "observer_error_east [m]", "observer_error_down [m]"
)
SAID = SLOTS.outputs(*OBSERVER.columns)  # what the observer says of itself
# whether the mean goes on by the model itself; the angle to the observer up to which it does, rad;
# whether Jacobians are then taken at the estimate
CLOSE, NEAR, ITSELF = SLOTS.numbers("CLOSE", "NEAR", "ITSELF")
INNOVATION = SLOTS.array("INNOVATION", 3)  # of the observer
# of the observer at the start of a step: accelerometer, gyro
BIAS_A, BIAS_G = SLOTS.array("BIAS_A", 3), SLOTS.array("BIAS_G", 3)
ORIGIN = SLOTS.array("ORIGIN", 9)  # attitude that delta is counted from, row by row
RECENT = SLOTS.part("RECENT", MEMORY)
MINE = SLOTS.part("MINE", OWN)
INSIDE = SLOTS.part("INSIDE", EMBEDDED)  # the observer
BACK = 0.2
"""Of NEAR, within which the affine filter gives way: P is too sure of what a lost one learnt."""
JACOBIANS = {"observer": 0.0, "estimate": 1.0}


@takes_options
def start(
    start: Start, noise: Noise, near: float = 0.5, jacobian: str = "estimate", **observer: Any
) -> Belief:
    """Belief at `start`, where the observer begins too.

    near: rad between attitudes of estimate and observer up to which the mean goes on by the model
    itself; 0 is the affine filter of Johansen & Fossen. jacobian: where Jacobians are taken then,
    at the "estimate", which also stays beyond `near` as long as no fixes speak against it, or at
    the "observer"; that and near = inf are what Alam et al. print. The other options are those of `nlo`, docs/observer.md.
    """
    check_number(near, "near", "rad", least=0, infinite=True)
    check_choice(jacobian, "jacobian", JACOBIANS)
    belief = start.belief(allocate(SLOTS))
    slots = SLOTS.named(belief.workspace)
    slots["ITSELF"][...], slots["NEAR"][...] = JACOBIANS[jacobian], near
    slots["CLOSE"][...] = known(belief.P, near) if slots["ITSELF"] else near > 0
    slots["RECENT"]["KIND"][...], slots["ORIGIN"][:] = FORGOTTEN, belief.C.ravel()
    implant(belief.workspace[INSIDE], start, noise, **observer)
    return belief


@inlined
def at(belief: Belief, state: Belief, ba: Array, bg: Array) -> Belief:
    """P, rate, force and workspace of the belief at the state of another, with these biases:
    what the linear model is taken at."""
    return Belief(
        state.lla,
        state.v,
        state.C,
        ba,
        bg,
        belief.P,
        belief.omega,
        belief.f,
        belief.workspace,
        belief.extra_states,
    )


@inlined
def compose(belief: Belief, x: Array) -> None:
    """The belief becomes belief (+) x."""
    a, g = x[BA], x[BG]
    added(belief.lla, belief.v, belief.C, x)
    for i in range(3):
        belief.ba[i] += a[i]
        belief.bg[i] += g[i]


@inlined
def relate(belief: Belief, bar: Belief) -> None:
    """delta is what lies between observer and belief, which stays wherever the observer has gone.

    Attitude: with exp(m) from the observer to where its error a was counted from, log(exp(a)
    exp(m)) = a + m + a x m / 2 + ..., cut where it would not be affine in a any more. The whole
    logarithm would wrap an error of half a turn, which the linear filter has not wrapped.
    """
    workspace, lla, shift = belief.workspace, bar.lla, belief.workspace[SHIFT]
    x, o, C = workspace[X], workspace[ORIGIN], belief.C
    _, cosine, M, N = place(lla[0], lla[2])
    x[0], x[1], x[2] = (
        (belief.lla[0] - lla[0]) * M,
        wrap(belief.lla[1] - lla[1]) * N * cosine,
        lla[2] - belief.lla[2],
    )
    if workspace[CLOSE] > 0:
        x[6], x[7], x[8] = rotation_between(
            bar.C, (C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2])
        )
    else:
        m0, m1, m2 = rotation_between(bar.C, (o[0], o[1], o[2], o[3], o[4], o[5], o[6], o[7], o[8]))
        a0, a1, a2 = x[6], x[7], x[8]
        x[6] = a0 + m0 + 0.5 * (a1 * m2 - a2 * m1)
        x[7] = a1 + m1 + 0.5 * (a2 * m0 - a0 * m2)
        x[8] = a2 + m2 + 0.5 * (a0 * m1 - a1 * m0)
    for i in range(3):
        x[3 + i], x[9 + i], x[12 + i] = (
            belief.v[i] - bar.v[i],
            belief.ba[i] - bar.ba[i],
            belief.bg[i] - bar.bg[i],
        )
        shift[i] = x[i]
        for j in range(3):
            o[3 * i + j] = bar.C[i, j]
    switch(belief, math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8]))


@inlined
def switch(belief: Belief, angle: float) -> None:
    """Whether the mean goes on by the model itself, with the observer that angle (rad) away.

    At the estimate the model is right where the tilt is known, and wherever the observer goes, as
    long as the fixes do not speak against it.
    """
    workspace, own, near = belief.workspace, belief.workspace[MINE], belief.workspace[NEAR]
    if workspace[ITSELF] == 0:
        workspace[CLOSE] = angle < near
    elif workspace[CLOSE] == 0:
        workspace[CLOSE] = angle < BACK * near and known(belief.P, near)
        own[TURN], own[DOUBT] = 0.0, 1.0
    elif angle >= near and own[DOUBT] > LOST:
        workspace[CLOSE] = 0.0


@helper
def known(P: Array, angle: float) -> bool:
    """Whether the tilt is known to that angle, rad."""
    return P[6, 6] + P[7, 7] < angle * angle


@inlined
def publish(belief: Belief, bar: Belief) -> None:
    """What the observer says of itself, among the extra columns."""
    said = belief.workspace[SAID]
    for i in range(said.size):
        said[i] = bar.workspace[i]


@inlined
def carry(belief: Belief, bar: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the belief over dt, linearised at the observer, which is left where it is:
    f(observer) (+) Phi delta."""
    workspace, affine = belief.workspace, belief.workspace[CLOSE] == 0
    ba, bg, o = workspace[BIAS_A], workspace[BIAS_G], workspace[ORIGIN]
    for i in range(3):
        ba[i], bg[i] = bar.ba[i], bar.bg[i]
    linearised_step(at(belief, bar, ba, bg), bar.C, 1.0, u, dt, noise, True)
    if affine:
        take_over(belief, bar)
    r0, r1, r2, a0, a1, a2 = bias_free(u, belief.ba, belief.bg, dt)
    mechanize(belief.lla, belief.v, belief.C, r0, r1, r2, a0, a1, a2, dt, workspace[DX], 1.0)
    decay_biases(belief.ba, belief.bg, dt, noise)
    if affine:
        for i in range(3):
            for j in range(3):
                o[3 * i + j] = belief.C[i, j]
        compose(belief, workspace[X])
    if dt > 0:
        for i in range(3):
            belief.omega[i], belief.f[i] = u[i] / dt - belief.bg[i], u[3 + i] / dt - belief.ba[i]


@inlined
def correct_around(
    belief: Belief,
    bar: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and the belief by one fix, linearised at the observer, which is left where it
    is. Returns the NIS."""
    workspace, n = belief.workspace, belief.P.shape[0]
    x, dx, H = workspace[X], workspace[DX], matrix(workspace, JACOBIAN, 3, n)
    shift_rates(belief, x, 1.0)  # to those of the observer, for the while
    rows = observed(at(belief, bar, bar.ba, bar.bg), y, observe, parameters, innovation, H)
    shift_rates(belief, x, -1.0)
    if workspace[CLOSE] > 0:
        observed(
            at(belief, belief, belief.ba, belief.bg),
            y,
            observe,
            parameters,
            innovation,
            matrix(workspace, WORK.start, 3, n),
        )
    else:
        for i in range(rows):
            for j in range(STATES):
                innovation[i] -= H[i, j] * x[j]
            if kind == HEADING_KIND or kind == COURSE_KIND or kind == ATTITUDE_KIND:
                innovation[i] = wrap(innovation[i])
    nis = update(belief.P, H, innovation, sd, rows, gate, workspace[WORK], dx)
    if nis <= gate:
        for i in range(STATES):
            x[i] += dx[i]
        take_over(belief, bar)
        compose(belief, x)
        inject_tail(belief, dx)
        shift_rates(belief, dx, -1.0)
    return nis


@inlined
def shift_rates(belief: Belief, x: Array, sign: float) -> None:
    """Rate and force of the belief less, or more, these errors of the biases."""
    a, g = x[BA], x[BG]
    for i in range(3):
        belief.f[i] += sign * a[i]
        belief.omega[i] += sign * g[i]


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the belief on, then the observer; the difference is what is between them."""
    bar, workspace = embedded(belief, INSIDE.start), belief.workspace
    at_estimate = workspace[CLOSE] * workspace[ITSELF] > 0
    if at_estimate:
        carry_own(belief, workspace[MINE], u, dt, noise)
    else:
        carry(belief, bar, u, dt, noise)
    advance(bar, u, dt, noise)
    relate(belief, bar)
    if at_estimate:
        take_heading(belief, bar, workspace[MINE])
    publish(belief, bar)
    workspace[RECENT][KIND] = FORGOTTEN


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
    """Correct P and the belief around the observer, then let that take the fix, whatever the
    gate."""
    bar, workspace = embedded(belief, INSIDE.start), belief.workspace
    if workspace[CLOSE] * workspace[ITSELF] > 0:
        own = workspace[MINE]
        nis = correct_own(belief, own, y, sd, kind, observe, parameters, gate, innovation)
    else:
        nis = correct_around(belief, bar, y, sd, kind, observe, parameters, gate, innovation)
    if (
        kind == POSITION_KIND
        or kind == VELOCITY_KIND
        or kind == ALTITUDE_KIND
        or kind == HEADING_KIND
        or kind == MAGNETIC_KIND
    ):
        if not repeated(workspace[RECENT], y, kind, gate, nis):
            inject(bar, y, sd, kind, observe, parameters, workspace[INNOVATION])
            follow(bar, belief)
    relate(belief, bar)
    publish(belief, bar)
    return nis


XKF = Filter(
    "xkf",
    "Johansen & Fossen (2017), IJC 90(2)",
    start,
    predict,
    correct,
    slots=SLOTS,
    configure=configure,
    conditions=nlo.NLO.conditions,
    condition=INSIDE.start + BLOCK.start + CONDITION,
    installation=True,
)
