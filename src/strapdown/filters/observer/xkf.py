"""Exogenous Kalman filter: a nonlinear observer gives the trajectory to linearise about, an affine
Kalman filter around it the estimate.

The observer runs by itself, as in `nlo`. Beside it the filter keeps P and delta = estimate (-)
observer. Between fixes estimate = f(observer) (+) Phi delta, with one mechanization f of the
observer's state without its injections; at a fix the innovation is y - h(observer) - H delta. Where
the observer injects, jumps or is bounded the estimate stays where it is and delta becomes what then
lies between them: the mismatch of a trajectory that is no solution of the model. docs/explanation/exogenous.md.
"""

import math
from typing import Any

from ...checks import check_choice, check_number
from ...core.compile.jit import helper, inline
from ...core.compile.selection import any_of, where
from ...core.loop.contract import (
    BA,
    BG,
    CORRECT,
    DECAYING,
    PREDICT,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    kernel,
    matrix,
)
from ...core.mathematics.earth import place
from ...core.mathematics.embedded import NAVIGATION, copy_motion, navigation
from ...core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    JACOBIAN,
    WORK,
    X,
    add_error,
    allocate,
    bias_free,
    decay_biases,
    inject_tail,
    linearised_step,
    observe_innovation,
    turn_half,
)
from ...core.mathematics.kalman import update, used_rows
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import orthonormalise, rotation_between, wrap
from ...typing import Array
from . import nlo
from .equations import (
    BLOCK,
    CONDITION,
    EMBEDDED,
    OBSERVER,
    advance,
    embedded_observer,
    follow,
    inject,
)
from .gains import configure, implant, takes_options
from .own_estimate import (
    DOUBT,
    LOST,
    MAX_NIS,
    OWN,
    SHARE,
    TURN,
    rotate_plane,
    take_heading,
    turn_heading,
    turn_tilts,
)
from .repeated_fix import FORGOTTEN, KIND, MEMORY, is_repeated

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
POINT = SLOTS.part("POINT", NAVIGATION)  # where the model is taken
ORIGIN = SLOTS.array("ORIGIN", 9)  # attitude that delta is counted from, row by row
RECENT = SLOTS.part("RECENT", MEMORY)
MINE = SLOTS.part("MINE", OWN)
INSIDE = SLOTS.part("INSIDE", EMBEDDED)  # the observer
BACK = 0.2
"""Share of NEAR within which the affine filter gives way: P is too sure of what a lost one learnt."""
JACOBIANS = {"observer": 0.0, "estimate": 1.0}


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    near: float = 0.5,
    jacobian: str = "estimate",
    **observer: Any,
) -> FilterState:
    """The filter state at `start`, where the observer begins too.

    near: rad between attitudes of estimate and observer up to which the nonlinear model propagates
    the mean; 0 is the affine filter of Johansen & Fossen. jacobian: where Jacobians are evaluated
    then, at the "estimate", which stays in use beyond `near` as long as no fixes contradict it, or
    at the "observer"; the latter with near = inf is the form that Alam et al. print. The other
    options are those of `nlo`, docs/explanation/observer.md.
    """
    check_number(near, "near", "rad", least=0, infinite=True)
    check_choice(jacobian, "jacobian", JACOBIANS)
    belief = start.belief(allocate(SLOTS))
    slots = SLOTS.views(belief.workspace)
    slots["ITSELF"][...], slots["NEAR"][...] = JACOBIANS[jacobian], near
    slots["CLOSE"][...] = is_tilt_known(belief.P, near) if slots["ITSELF"] else near > 0
    slots["RECENT"]["KIND"][...], slots["ORIGIN"][:] = FORGOTTEN, belief.C_nb.ravel()
    implant(belief.workspace[INSIDE], start, noise, **observer)
    return belief


@inline
def at(belief: FilterState, state: FilterState) -> FilterState:
    """P, rate, force and workspace of the belief at the state of another."""
    return FilterState(
        state.lla,
        state.v_n,
        state.C_nb,
        state.b_a,
        state.b_g,
        belief.P,
        belief.omega,
        belief.f,
        belief.workspace,
        belief.augmented,
    )


@inline
def at_estimate(belief: FilterState) -> bool:
    """True where the model is linearised at the estimate, as filters/observer/own_estimate.py says,
    rather than at the observer."""
    return belief.workspace[CLOSE] * belief.workspace[ITSELF] > 0


@inline
def model_point(belief: FilterState, bar: FilterState, itself: bool, z: float) -> FilterState:
    """Return the linearisation point of the model: the observer, or the estimate `itself`, turned
    back by z (rad). Its state is in POINT."""
    numbers = belief.workspace[POINT]
    point = at(belief, navigation(numbers, belief.P, belief.workspace, belief.augmented))
    copy_motion(point, bar)
    copy_motion(point, belief, itself)
    turn_heading(point.C_nb, -z)
    return point


@inline
def compose(belief: FilterState, x: Array) -> None:
    """The belief becomes belief (+) x."""
    a, g = x[BA], x[BG]
    add_error(belief.lla, belief.v_n, belief.C_nb, x)
    for i in range(3):
        belief.b_a[i] += a[i]
        belief.b_g[i] += g[i]


@inline
def relate(belief: FilterState, bar: FilterState) -> None:
    """delta is what lies between observer and belief, which stays wherever the observer has gone.

    Attitude: with exp(m) from the observer to where its error a was counted from, log(exp(a)
    exp(m)) = a + m + a x m / 2 + ..., cut where it would not be affine in a any more. The whole
    logarithm would wrap an error of half a turn, which the linear filter has not wrapped.
    """
    workspace, lla, shift = belief.workspace, bar.lla, belief.workspace[SHIFT]
    x, o, C = workspace[X], workspace[ORIGIN], belief.C_nb
    _, cosine, M, N = place(lla[0], lla[2])
    x[0], x[1], x[2] = (
        (belief.lla[0] - lla[0]) * M,
        wrap(belief.lla[1] - lla[1]) * N * cosine,
        lla[2] - belief.lla[2],
    )
    close = workspace[CLOSE] > 0
    m0, m1, m2 = rotation_between(
        bar.C_nb,
        (
            where(close, C[0, 0], o[0]),
            where(close, C[0, 1], o[1]),
            where(close, C[0, 2], o[2]),
            where(close, C[1, 0], o[3]),
            where(close, C[1, 1], o[4]),
            where(close, C[1, 2], o[5]),
            where(close, C[2, 0], o[6]),
            where(close, C[2, 1], o[7]),
            where(close, C[2, 2], o[8]),
        ),
    )
    a0, a1, a2 = where(close, 0.0, x[6]), where(close, 0.0, x[7]), where(close, 0.0, x[8])
    x[6] = a0 + m0 + 0.5 * (a1 * m2 - a2 * m1)
    x[7] = a1 + m1 + 0.5 * (a2 * m0 - a0 * m2)
    x[8] = a2 + m2 + 0.5 * (a0 * m1 - a1 * m0)
    for i in range(3):
        x[3 + i], x[9 + i], x[12 + i] = (
            belief.v_n[i] - bar.v_n[i],
            belief.b_a[i] - bar.b_a[i],
            belief.b_g[i] - bar.b_g[i],
        )
        shift[i] = x[i]
        for j in range(3):
            o[3 * i + j] = bar.C_nb[i, j]
    switch(belief, math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8]))


@inline
def switch(belief: FilterState, angle: float) -> None:
    """Decide whether the mean is propagated by the model at the estimate, with the observer that
    angle (rad) away.

    At the estimate the model is right where the tilt is known, and wherever the observer goes, as
    long as the fixes do not speak against it.
    """
    workspace, own, near = belief.workspace, belief.workspace[MINE], belief.workspace[NEAR]
    close = workspace[CLOSE] > 0
    if int(workspace[ITSELF]) == 0:
        workspace[CLOSE] = where(angle < near, 1.0, 0.0)
        return
    stays = close & ((angle < near) | (own[DOUBT] <= LOST))
    back = (not close) & (angle < BACK * near) & is_tilt_known(belief.P, near)
    workspace[CLOSE] = where(stays | back, 1.0, 0.0)
    own[TURN], own[DOUBT] = where(close, own[TURN], 0.0), where(close, own[DOUBT], 1.0)


@helper
def is_tilt_known(P: Array, angle: float) -> bool:
    """True where the standard deviation of the tilt is below that angle, rad."""
    return P[6, 6] + P[7, 7] < angle * angle


@inline
def publish(belief: FilterState, bar: FilterState) -> None:
    """Copy the observer's output into the extra columns."""
    said = belief.workspace[SAID]
    for i in range(said.size):
        said[i] = bar.workspace[i]


@inline
def carry(belief: FilterState, bar: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the belief over dt, by the model at an observer that is left where it is:
    f(observer) (+) Phi delta, or by the model at the estimate itself."""
    workspace, x, o = belief.workspace, belief.workspace[X], belief.workspace[ORIGIN]
    itself, affine = at_estimate(belief), workspace[CLOSE] == 0
    z = where(itself, workspace[MINE][TURN], 0.0)
    point, moved = model_point(belief, bar, itself, z), any_of(affine | (z != 0))
    if moved:
        turn_tilts(belief.P, -z)
        copy_motion(belief, point, affine | itself)
        for i in range(STATES):
            x[i] = where(affine, x[i], 0.0)
        x[8] += z
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    linearised_step(point, point.C_nb, 1.0, u, dt, noise, moved)
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, workspace[DX], 1.0)
    decay_biases(belief.b_a, belief.b_g, dt, noise)
    if moved:
        for i in range(3):
            for j in range(3):
                o[3 * i + j] = where(affine, belief.C_nb[i, j], o[3 * i + j])
        x[8] -= z
        compose(belief, x)
        turn_heading(belief.C_nb, z)
        turn_tilts(belief.P, z)
    if dt > 0:
        for i in range(3):
            belief.omega[i], belief.f[i] = u[i] / dt - belief.b_g[i], u[3 + i] / dt - belief.b_a[i]


@inline
def correct_around(
    belief: FilterState,
    bar: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and the belief by one fix, linearised where the model is, and the doubt about the
    belief; the observer is left where it is. Returns the NIS."""
    workspace, n, itself = belief.workspace, belief.P.shape[0], at_estimate(belief)
    x, dx, H = workspace[X], workspace[DX], matrix(workspace, JACOBIAN, 3, n)
    z = where(itself, workspace[MINE][TURN], 0.0)
    point = model_point(belief, bar, itself, z)
    for i in range(STATES):
        x[i] = where(itself, 0.0, x[i])
    x[8] += z
    shift_rates(belief, x, 1.0)  # to those of the point, for the while
    rows = observe_innovation(point, y, observe, source, innovation, H)
    shift_rates(belief, x, -1.0)
    for i in range(rows):
        for j in range(STATES):
            innovation[i] -= H[i, j] * x[j]
        if kind == Kind.HEADING or kind == Kind.COURSE or kind == Kind.ATTITUDE:
            innovation[i] = wrap(innovation[i])
        if any_of(z != 0):
            H[i, 6], H[i, 7] = rotate_plane(H[i, 6], H[i, 7], 0.5 * z)
    if int(workspace[ITSELF]) == 0:
        seen, unused = workspace[INNOVATION], matrix(workspace, WORK.start, 3, n)
        observe_innovation(belief, y, observe, source, seen, unused)
        for i in range(rows):
            innovation[i] = where(workspace[CLOSE] > 0, seen[i], innovation[i])
    nis = update(belief.P, H, innovation, std, rows, gate, workspace[WORK], dx)
    if gate >= 0:  # not where it is only asked
        wonder(workspace, nis, n)
    taken = nis <= gate
    if any_of(taken):
        move(belief, point, itself, z, taken)
    return nis


@helper
def wonder(workspace: Array, nis: float, n: int) -> None:
    """The doubt about an estimate of n states after a fix of that NIS."""
    doubt, rows = workspace[MINE][DOUBT], workspace[WORK.start + used_rows(n)]
    by_rows = min(nis / max(rows, 1.0), MAX_NIS)
    workspace[MINE][DOUBT] = where(nis == nis, doubt + SHARE * (by_rows - doubt), doubt)


@inline
def move(belief: FilterState, point: FilterState, itself: bool, z: float, taken: bool) -> None:
    """Compose a correction, which is zero where it was not taken, into delta, and the belief from
    point (+) delta, where a turn by z comes last."""
    workspace, P, mine = belief.workspace, belief.P, belief.workspace[MINE]
    x, dx, ahead = workspace[X], workspace[DX], z != 0
    if any_of(ahead):
        dx[6], dx[7] = rotate_plane(dx[6], dx[7], -0.5 * z)
        mine[TURN] += where(ahead, dx[8], 0.0)
    if any_of(itself):
        level = itself & (not ahead)
        theta = where(level, dx[6], 0.0), where(level, dx[7], 0.0), where(itself, dx[8], 0.0)
        turn_half(P, theta[0], theta[1], theta[2])
    x[8] -= z
    for i in range(STATES):
        x[i] += dx[i]
    compose(point, x)
    orthonormalise(point.C_nb)
    turn_heading(point.C_nb, z)
    copy_motion(belief, point, taken)
    inject_tail(belief, dx)
    shift_rates(belief, dx, where(itself, 0.0, -1.0))


@inline
def shift_rates(belief: FilterState, x: Array, sign: float) -> None:
    """Rate and force of the belief more, or less, these errors of the biases."""
    a, g = x[BA], x[BG]
    for i in range(3):
        belief.f[i] += sign * a[i]
        belief.omega[i] += sign * g[i]


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the belief on, then the observer; the difference is what is between them."""
    bar, itself = embedded_observer(belief, INSIDE.start), at_estimate(belief)
    carry(belief, bar, u, dt, noise)
    advance(bar, u, dt, noise)
    relate(belief, bar)
    take_heading(belief, bar, belief.workspace[MINE], itself)
    publish(belief, bar)
    belief.workspace[RECENT][KIND] = FORGOTTEN


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
    """Correct P and the belief around the observer, then let that take the fix, whatever the
    gate."""
    bar, workspace = embedded_observer(belief, INSIDE.start), belief.workspace
    nis = correct_around(belief, bar, y, std, kind, observe, source, gate, innovation)
    if (
        kind == Kind.POSITION
        or kind == Kind.VELOCITY
        or kind == Kind.ALTITUDE
        or kind == Kind.HEADING
        or kind == Kind.MAGNETIC_FIELD
    ):
        new = not is_repeated(workspace[RECENT], y, kind, gate, nis)
        if any_of(new):
            inject(bar, y, std, kind, observe, source, workspace[INNOVATION], new)
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
    lanes=True,
    bias=DECAYING,
    good_for="large initial errors; then as accurate as closed-loop",
    poor_for="vehicles whose course differs from their heading",
)
