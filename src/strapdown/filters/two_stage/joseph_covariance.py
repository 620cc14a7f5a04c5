"""First-order covariance of the errors that the two stages leave, under the gains that they really
use: those of the published equations, whose own covariance is kept apart.

The errors are true - estimate. Between corrections they are those of an INS, since the mean of each
stage goes on by the whole model. A correction multiplies them by I - K H, with K as published and H
of all states:
    fix           y - h = H e + n
    gravity       f - C' dv/T + C' [0 0 g] = C' [f_n x] (theta + T/2 C b_g) + b_a - C' (w + n - n_then) / T
    alone         f - omega x v_b + C' [0 0 g]: likewise, and v_b x b_g + omega x dv_b
    course        chi - psi = theta_psi + crab + n_across / speed
Each turn of the attitude turns the velocity along. What several corrections have in common is a
state that is never estimated: the noise n of the fix at hand and that of the velocity fix which the window
of the specific force began with, n_then; the noise w of the accelerometers since; the angle between
course and heading, a Gauss-Markov process. What is known to move the estimate, but is not taken off
it, counts as an error of its size: stage 2 of the exogenous filter goes on with the observer's
attitude, and how far that is from the one of stage 1 is no secret. States of the installation have
no published gain: theirs is that of least variance.
"""

import math

from ...checks import check_choice
from ...core.compile.jit import helper, inline, matrix
from ...core.compile.workspace import MAX_STATES, Slots
from ...core.loop.contract import BG, STATES, FilterState, Kind, Noise, Observe, SourceRow
from ...core.mathematics.earth import gravity
from ...core.mathematics.error_state import DX, JACOBIAN, observe_innovation
from ...core.mathematics.joseph import (
    JOSEPH,
    NOISE,
    SECONDS as WAITED,
    WORK,
    await_step,
    carry,
    has_new_noise,
    joseph_update,
    learn_beyond,
)
from ...core.mathematics.kalman import decay, update
from ...core.mathematics.rotation import Three, cross, dot, rotate_vector
from ...typing import Array
from ..observer.covariance import CRAB_TIME, copy_leading
from .model import (
    ACCELERATION,
    COURSE_GAIN,
    CRAB,
    DOWN,
    FIX_GAIN,
    FORCE,
    KNOWN,
    LEVEL_GAIN,
    LEVEL_SECONDS,
    MIN_COSINE,
    RAW,
    SECONDS,
    TWO_STAGE,
)

AUXILIARY = 11
"""States behind those of the filter: see the offsets below."""
CRAB_STATE, NOW, THEN, DRIVEN, SHIFTED = 0, 1, 4, 7, 10
"""Places among them: the angle between course and heading; the noise of the fix at hand, of the
velocity fix that the window began with, and of the accelerometers since (in n); what is known."""
MIN_GROWTH = 0.01
"""Share of a variance from which its growth is one that the loop has made."""
SLOTS = Slots(after=TWO_STAGE)
IN_JOSEPH_FORM = SLOTS.number(
    "IN_JOSEPH_FORM"
)  # 1: P of the filter is that of the errors; 0: the published one
PUBLISHED = SLOTS.matrix(
    "PUBLISHED", MAX_STATES, MAX_STATES
)  # of the gains; but for the fifteen zero
FULL = SLOTS.matrix("FULL", MAX_STATES, MAX_STATES)  # covariance of all states, with the auxiliary
H = SLOTS.matrix("H", 3, MAX_STATES)  # of the fix at hand, with its noise
A = SLOTS.matrix("A", 3, MAX_STATES)  # of core.mathematics.joseph.joseph_update
B = SLOTS.matrix("B", 3, MAX_STATES)
R = SLOTS.matrix("R", 3, 3)
SEEN = SLOTS.array("SEEN", 12)  # innovation of the stages
TURNS = SLOTS.number("TURNS")  # 1: a correction of the attitude turns the velocity along
SHIFT = SLOTS.array("SHIFT", 3)  # known changes of the error of velocity since the last step, m/s
NO_NOISE = SLOTS.array("NO_NOISE", 3)
BEHIND = SLOTS.array("BEHIND", 7)  # variances when the filter was last left
OWN = SLOTS.part("OWN", JOSEPH)


def begin(belief: FilterState, covariance: str, turns: bool = True) -> None:
    """The published covariance and that of the errors are alike at the start. Raises ValueError for
    an unknown word and for too many states."""
    check_choice(covariance, "covariance", ("joseph", "published"))
    n = len(belief.P)
    if n > STATES and covariance == "published":
        raise ValueError(
            f"covariance='published' has no gain for the {n - STATES} states that sources bring along; use "
            "covariance='joseph', or leave `estimate` and `correlated` of the sources out"
        )
    if n + AUXILIARY > MAX_STATES:
        raise ValueError(
            f"{n - STATES} states of the installation are too many beside the two stages; at most "
            f"{MAX_STATES - STATES - AUXILIARY}"
        )
    belief.workspace[TURNS], belief.workspace[IN_JOSEPH_FORM] = turns, covariance == "joseph"
    of_stages(belief).P[:STATES, :STATES] = belief.P[:STATES, :STATES]
    m = all_states(belief)
    P = matrix(belief.workspace, FULL, m, m)
    P[:n, :n] = belief.P
    note_variances(belief)
    P[n + CRAB_STATE, n + CRAB_STATE], P[n + SHIFTED, n + SHIFTED] = (
        belief.workspace[CRAB] ** 2,
        1.0,
    )


@inline
def of_stages(belief: FilterState) -> FilterState:
    """The belief with the published covariance, by which the stages are corrected."""
    return FilterState(
        belief.lla,
        belief.v_n,
        belief.C_nb,
        belief.b_a,
        belief.b_g,
        matrix(belief.workspace, PUBLISHED, belief.P.shape[0], belief.P.shape[0]),
        belief.omega,
        belief.f,
        belief.workspace,
        belief.augmented,
    )


@helper
def all_states(belief: FilterState) -> int:
    """Number of states of the covariance, with the auxiliary ones."""
    return belief.P.shape[0] + AUXILIARY


@helper
def publish(belief: FilterState) -> None:
    """P of the filter is that of the errors, or the published one."""
    m = all_states(belief)
    if belief.workspace[IN_JOSEPH_FORM] > 0:
        copy_leading(matrix(belief.workspace, FULL, m, m), belief.P, belief.P.shape[0])
    else:
        n = belief.P.shape[0]
        copy_leading(matrix(belief.workspace, PUBLISHED, n, n), belief.P, STATES)


@inline
def clear(workspace: Array) -> None:
    """A, B and R, which lie one behind the other, are zero."""
    for i in range(A, R + 9):
        workspace[i] = 0.0


# ---- between corrections


@inline
def after_sample(belief: FilterState, dt: float, noise: Noise) -> None:
    """A sample, for the next step of the covariance."""
    workspace = belief.workspace
    own = workspace[OWN]
    if workspace[IN_JOSEPH_FORM] == 0:
        publish(belief)
        return
    if has_new_noise(own, noise):
        step(belief)
    if await_step(own, belief.omega, belief.f, dt, noise):
        step(belief)
    if _is_used(workspace, LEVEL_GAIN):
        step(belief)
        after_level(belief)
        publish(belief)


@helper
def step(belief: FilterState) -> None:
    """The covariance over the samples since its last step."""
    workspace, own, n, m = (
        belief.workspace,
        belief.workspace[OWN],
        belief.P.shape[0],
        all_states(belief),
    )
    P = matrix(workspace, FULL, m, m)
    if float(own[WAITED]) <= 0:
        return
    copy_leading(belief.P, P, n)  # the loop may have changed it
    noise = float(own[NOISE][1])
    dt = carry(P, own, belief.lla, belief.v_n, belief.C_nb)
    keep, std, crab = decay(dt / CRAB_TIME), workspace[CRAB], n + CRAB_STATE
    for j in range(m):
        P[crab, j] = P[j, crab] = keep * P[j, crab]
    P[crab, crab] = keep * P[crab, crab] + (1 - keep * keep) * std * std
    for i in range(3):
        driven, shared = n + DRIVEN + i, noise * noise * dt
        P[driven, driven] += shared
        P[driven, 3 + i] += shared
        P[3 + i, driven] = P[driven, 3 + i]
    _shift(workspace, P, n)
    publish(belief)


@inline
def _shift(workspace: Array, P: Array, n: int) -> None:
    """The covariance by the known changes of the error of velocity."""
    shift, m = workspace[SHIFT], P.shape[0]
    if shift[0] != 0 or shift[1] != 0 or shift[2] != 0:
        clear(workspace)
        a, b = matrix(workspace, A, 3, m), matrix(workspace, B, 3, m)
        b[0, n + SHIFTED] = 1.0
        for i in range(3):
            a[0, 3 + i], shift[i] = shift[i], 0.0
        joseph_update(P, workspace[OWN], a, b, matrix(workspace, R, 3, 3))


@helper
def forget(P: Array, first: int) -> None:
    """Three states from `first` become zero."""
    for i in range(3):
        for j in range(P.shape[0]):
            P[first + i, j] = P[j, first + i] = 0.0


@helper
def begin_window(P: Array, n: int) -> None:
    """The window of the specific force begins with the velocity fix at hand."""
    now, then = n + NOW, n + THEN
    for i in range(3):
        for j in range(P.shape[0]):
            P[then + i, j] = P[now + i, j]
    for i in range(3):
        for j in range(P.shape[0]):
            P[j, then + i] = P[j, now + i]
    forget(P, n + DRIVEN)


# ---- corrections


@helper
def _use(belief: FilterState, gain: int, row: int) -> None:
    """A[row] of a row of measurement, from the column of its gain, which becomes zero: -K, and the
    velocity turned along with the attitude."""
    workspace, v = belief.workspace, belief.v_n
    K, a = matrix(workspace, gain, STATES, 3), matrix(workspace, A, 3, all_states(belief))
    turned = cross((K[6, row], K[7, row], K[8, row]), (v[0], v[1], v[2]))
    for i in range(STATES):
        a[row, i] = -K[i, row]
        K[i, row] = 0.0
    _add(a, row, 3, -workspace[TURNS], turned)


@inline
def _add(M: Array, row: int, column: int, factor: float, values: Three) -> None:
    """Add three values, times a factor, to a row from `column` on. By constant indices: a tuple taken at
    an index that runs leaves an exception in the kernel, which a library of kernels cannot hold."""
    M[row, column] += factor * values[0]
    M[row, column + 1] += factor * values[1]
    M[row, column + 2] += factor * values[2]


@helper
def _is_used(workspace: Array, gain: int) -> bool:
    """True where a gain is not zero."""
    K = matrix(workspace, gain, STATES, 3)
    for i in range(STATES):
        if K[i, 0] != 0 or K[i, 1] != 0 or K[i, 2] != 0:
            return True
    return False


@helper
def after_level(belief: FilterState) -> None:
    """The covariance by the last correction by gravity, if there was one."""
    workspace, n, m, C = belief.workspace, belief.P.shape[0], all_states(belief), belief.C_nb
    if not _is_used(workspace, LEVEL_GAIN):
        return
    clear(workspace)
    b, r, own = matrix(workspace, B, 3, m), matrix(workspace, R, 3, 3), workspace[OWN]
    seconds, by_velocity = abs(workspace[LEVEL_SECONDS]), workspace[LEVEL_SECONDS] > 0
    force, b_a = workspace[FORCE], belief.b_a
    f = rotate_vector(C, force[0], force[1], force[2])
    for i in range(3):
        axis = (C[0, i], C[1, i], C[2, i])
        if by_velocity:
            _by_velocity(b, i, n, axis, f, seconds, C)
            r[i, i] = own[NOISE][0] ** 2 * seconds / 3 * dot(f, f)
        else:
            _by_gravity(belief, b, i, axis, seconds)
            r[i, i] = (workspace[ACCELERATION] + own[NOISE][1] ** 2) / seconds
        b[i, 9 + i] += 1 - workspace[RAW]
        r[i, i] += workspace[RAW] * (b_a[i] * b_a[i] + belief.P[9 + i, 9 + i])
        _use(belief, LEVEL_GAIN, i)
    joseph_update(matrix(workspace, FULL, m, m), own, matrix(workspace, A, 3, m), b, r)


@helper
def _by_velocity(
    b: Array, row: int, n: int, axis: Three, f: Three, seconds: float, C: Array
) -> None:
    """b[row] of the specific force less the change of velocity between fixes, along an axis of the
    body; f: the mean specific force (n). The gyros have carried it for half of the window."""
    by_turn = cross(axis, f)
    for j in range(3):
        b[row, 12 + j] = (
            0.5 * seconds * (by_turn[0] * C[0, j] + by_turn[1] * C[1, j] + by_turn[2] * C[2, j])
        )
    along = (axis[0] / seconds, axis[1] / seconds, axis[2] / seconds)
    _add(b, row, 6, 1.0, by_turn)
    _add(b, row, n + DRIVEN, -1.0, along)
    _add(b, row, n + NOW, -1.0, along)
    _add(b, row, n + THEN, 1.0, along)


@helper
def _by_gravity(belief: FilterState, b: Array, row: int, axis: Three, seconds: float) -> None:
    """b[row] of the specific force less omega x v_b along an axis of the body."""
    w, C, v = belief.omega, belief.C_nb, belief.v_n
    down = (0.0, 0.0, -gravity(math.sin(belief.lla[0]), belief.lla[2]))
    by_turn, velocity = cross(axis, down), (v[0], v[1], v[2])
    j, k = (row + 1) % 3, (row + 2) % 3
    swing = (
        w[j] * C[0, k] - w[k] * C[0, j],
        w[j] * C[1, k] - w[k] * C[1, j],
        w[j] * C[2, k] - w[k] * C[2, j],
    )
    by_swing = cross(swing, velocity)
    _add(b, row, 3, 1.0, swing)
    _add(b, row, 6, 1.0, by_turn)
    _add(b, row, 6, 1.0, by_swing)
    for i in range(3):
        b[row, 12 + i] = 0.5 * seconds * dot(by_turn, (C[0, i], C[1, i], C[2, i]))
    b[row, 12 + j] -= dot((C[0, k], C[1, k], C[2, k]), velocity)
    b[row, 12 + k] += dot((C[0, j], C[1, j], C[2, j]), velocity)


@helper
def after_course(belief: FilterState) -> None:
    """The covariance by the last correction by a course, if there was one."""
    workspace, n, m, C, v = (
        belief.workspace,
        belief.P.shape[0],
        all_states(belief),
        belief.C_nb,
        belief.v_n,
    )
    if not _is_used(workspace, COURSE_GAIN):
        return
    clear(workspace)
    a, b, r = matrix(workspace, A, 3, m), matrix(workspace, B, 3, m), matrix(workspace, R, 3, 3)
    horizontal = max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], MIN_COSINE * MIN_COSINE)
    square = max(v[0] * v[0] + v[1] * v[1], 1e-6)
    b[0, 6], b[0, 7] = -C[2, 0] * C[0, 0] / horizontal, -C[2, 0] * C[1, 0] / horizontal
    b[0, 8] = b[0, n + CRAB_STATE] = 1.0
    b[0, n + NOW], b[0, n + NOW + 1] = -v[1] / square, v[0] / square
    _use(belief, COURSE_GAIN, 0)
    joseph_update(matrix(workspace, FULL, m, m), workspace[OWN], a, b, r)


@inline
def foresee(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
) -> float:
    """The NIS of a fix under the covariance of the errors. H (3, n) of it, with its noise as
    states, stays in the workspace."""
    workspace, n, m = belief.workspace, belief.P.shape[0], all_states(belief)
    P, h = matrix(workspace, FULL, m, m), matrix(workspace, H, 3, m)
    step(belief)
    copy_leading(belief.P, P, n)
    forget(P, n + NOW)
    own = matrix(workspace, JACOBIAN, 3, n)
    rows = observe_innovation(belief, y, observe, source, innovation, own)
    for i in range(3):
        for j in range(m):
            h[i, j] = own[i, j] if j < n else 0.0
        h[i, n + NOW + i] = 1.0
    for i in range(rows):
        P[n + NOW + i, n + NOW + i] = std[i] * std[i]
    if kind == Kind.VELOCITY and workspace[DOWN] > 0:
        _leave_down(belief.C_nb, innovation, h)
    return update(
        P, h, innovation, workspace[NO_NOISE], rows, -1.0, workspace[OWN][WORK], workspace[DX]
    )


@helper
def _leave_down(C: Array, innovation: Array, h: Array) -> None:
    """Leave of a velocity only the component along the body's z axis."""
    innovation[0] = C[0, 2] * innovation[0] + C[1, 2] * innovation[1] + C[2, 2] * innovation[2]
    innovation[1] = innovation[2] = math.nan
    for j in range(h.shape[1]):
        h[0, j] = C[0, 2] * h[0, j] + C[1, 2] * h[1, j] + C[2, 2] * h[2, j]


@inline
def learn_installation(belief: FilterState) -> None:
    """Correct the states of the installation by what `foresee` has left."""
    workspace, m = belief.workspace, all_states(belief)
    P = matrix(workspace, FULL, m, m)
    learn_beyond(P, workspace[OWN], workspace[DX], belief.augmented, belief.P.shape[0], True)


@helper
def after_fix(belief: FilterState) -> None:
    """The covariance by the correction of a stage by the fix of `foresee`."""
    workspace, m = belief.workspace, all_states(belief)
    a, h, r = matrix(workspace, A, 3, m), matrix(workspace, H, 3, m), matrix(workspace, R, 3, 3)
    clear(workspace)
    for row in range(3):
        _use(belief, FIX_GAIN, row)
    joseph_update(matrix(workspace, FULL, m, m), workspace[OWN], a, h, r)


@inline
def after_corrections(belief: FilterState, kind: int) -> None:
    """The covariance by all corrections that the stages have made of a fix."""
    workspace, n, m = belief.workspace, belief.P.shape[0], all_states(belief)
    after_level(belief)
    after_course(belief)
    after_fix(belief)
    if kind == Kind.VELOCITY and workspace[SECONDS] == 0 and workspace[KNOWN] > 0:
        begin_window(matrix(workspace, FULL, m, m), n)


# ---- the loop


@inline
def note_variances(belief: FilterState) -> None:
    """The variances that the filter leaves to the loop, which may let them grow: of position and
    velocity, and of a gyro bias, which nothing else that the loop does has an effect on."""
    behind = belief.workspace[BEHIND]
    for i in range(6):
        behind[i] = belief.P[i, i]
    behind[6] = belief.P[BG.start, BG.start]


@inline
def grow_along(belief: FilterState) -> None:
    """The published covariance grows as the loop has let P grow since the filter left it: as a
    whole, or along axes of position and velocity, where what scale factors add does not count."""
    P, n, behind = belief.P, belief.P.shape[0], belief.workspace[BEHIND]
    own = matrix(belief.workspace, PUBLISHED, n, n)
    factor = P[BG.start, BG.start] / behind[6] if behind[6] > 0 else 1.0
    if factor > 1:
        for i in range(STATES):
            for j in range(STATES):
                own[i, j] *= factor
    for i in range(6):
        more = P[i, i] - factor * behind[i]
        if more > MIN_GROWTH * P[i, i]:
            own[i, i] += more
