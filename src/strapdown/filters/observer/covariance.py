"""First-order covariance of the observer's errors: its 15 error states, states of the installation,
xi, the angle between course and heading and the noise of the fix at hand, under the gains that it
really uses.

The errors are true - estimate. xi makes up for what the estimated specific force lacks, so its true
value is zero, and the error of xi is what moves the others between fixes:
    v' = INS + e_xi,  sigma = -k1 f x e_xi / |f|^2,  theta' = INS - sigma,  b_g' = ki C' sigma,
    e_xi' = sigma x f,  b_a' = -adaptation f f' e_xi / |f|^2 (f in b and n).
A fix multiplies the errors by I - K H, whatever K came from, and a turn of the attitude by a share
of an angle is such a K. filters/observer/equations.py leaves both in the workspace. The angle
between course and heading is no white noise but lasts until the vehicle has turned in the wind: a
Gauss-Markov process that is never estimated, which the heading takes on. The noise of a fix is a
state because several corrections share it: a velocity turns the heading, moves position, velocity and
xi, and tells of biases. The square of the accelerometer bias (theta0) counts as known. States of the
installation have no gain in the observer: theirs is that of least variance.
"""

from ...core.compile.jit import helper, inline, matrix
from ...core.compile.selection import any_of, where
from ...core.compile.workspace import MAX_STATES
from ...core.loop.contract import STATES, FilterState, Kind, Noise, Observe, Slots, SourceRow
from ...core.mathematics.error_state import observe_innovation
from ...core.mathematics.joseph import (
    FORCE,
    JOSEPH,
    NOISE,
    SECONDS,
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
from . import adaptive_law
from .equations import (
    ACROSS,
    ADAPTATION,
    ADAPTIVE,
    BY_NORM,
    BY_XI,
    FADE,
    FIELD,
    GAIN,
    JACOBIAN,
    K1,
    KI,
    LAW,
    LEARNT,
    OBSERVER,
    SHARE,
    TOLD,
    XI as XI_VALUE,
    gain,
    has_estimated_errors,
    outage,
)

AUXILIARY = 7
"""States behind those of the filter."""
XI, CRAB, NOW = 0, 3, 4
"""Places among them: the error of xi, the angle between course and heading, the noise of the fix at
hand."""
SLOTS = Slots(after=OBSERVER)
FULL = SLOTS.matrix("FULL", MAX_STATES, MAX_STATES)  # covariance of all
CRAB_STD = SLOTS.number("CRAB_STD")  # of the angle between course and heading, rad
H = SLOTS.matrix("H", 3, MAX_STATES)  # of the fix at hand, with its noise
A = SLOTS.matrix("A", 3, MAX_STATES)  # of core.mathematics.joseph.joseph_update
B = SLOTS.matrix("B", 3, MAX_STATES)
R = SLOTS.matrix("R", 3, 3)
NO_NOISE = SLOTS.array("NO_NOISE", 3)
DX = SLOTS.array("DX", MAX_STATES)
OWN = SLOTS.part("OWN", JOSEPH)
MIN_SPEED = 0.1  # m/s, at which a velocity has a course
CRAB_TIME = 30.0  # s: time constant of that angle, that of turns in the wind


@helper
def all_states(belief: FilterState) -> int:
    """Number of states of the covariance, with the auxiliary ones."""
    return belief.P.shape[0] + AUXILIARY


@helper
def copy_leading(source: Array, target: Array, n: int) -> None:
    """The first n states of one covariance into another."""
    for i in range(n):
        for j in range(n):
            target[i, j] = source[i, j]


@helper
def clear(workspace: Array) -> None:
    """A, B and R, which lie one behind the other, are zero."""
    for i in range(A, R + 9):
        workspace[i] = 0.0


@inline
def after_sample(belief: FilterState, dt: float, noise: Noise) -> None:
    """A sample that the observer took, for the next step of P."""
    own = belief.workspace[OWN]
    if has_new_noise(own, noise):
        step(belief)
    if await_step(own, belief.omega, belief.f, dt, noise):
        step(belief)


@helper
def step(belief: FilterState) -> None:
    """P over the samples since its last step: by the INS, then by what xi has moved."""
    workspace, own, C = belief.workspace, belief.workspace[OWN], belief.C_nb
    n, m = belief.P.shape[0], all_states(belief)
    if float(own[SECONDS]) <= 0:
        return
    f, made_up = own[FORCE], float(own[NOISE][1]) > float(workspace[TOLD])
    P, a, b, r = (
        matrix(workspace, FULL, m, m),
        matrix(workspace, A, 3, m),
        matrix(workspace, B, 3, m),
        matrix(workspace, R, 3, 3),
    )
    copy_leading(belief.P, P, n)  # the loop may have changed it
    dt = carry(P, own, belief.lla, belief.v_n, C)
    keep, std, crab = decay(dt / CRAB_TIME), workspace[CRAB_STD], n + CRAB
    for j in range(m):
        P[crab, j] = P[j, crab] = keep * P[j, crab]
    P[crab, crab] = keep * P[crab, crab] + (1 - keep * keep) * std * std
    clear(workspace)
    for i in range(3):
        b[i, n + XI + i], a[i, 3 + i], a[i, i] = 1.0, dt, 0.5 * dt * dt
    square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
    acts = (square > 0) & (not outage(workspace))
    if any_of(acts) and not made_up:
        square, ki = where(acts, square, 1.0), gain(workspace, KI)
        k = where(acts, (1 - decay(gain(workspace, K1) * dt)) / square, 0.0)
        adapted = workspace[ADAPTATION] * (1 - min(workspace[FADE], 1.0)) * dt / square
        adapted = where(acts & (workspace[LAW] == BY_NORM), adapted, 0.0)
        f0, f1, f2 = rotate_vector(C, f[0], f[1], f[2])
        # sigma = -k f x e_xi, a column for each component of e_xi
        turn(a, 0, C, (f0, f1, f2), (0.0, -k * f2, k * f1), ki)
        turn(a, 1, C, (f0, f1, f2), (k * f2, 0.0, -k * f0), ki)
        turn(a, 2, C, (f0, f1, f2), (-k * f1, k * f0, 0.0), ki)
        for j in range(3):
            a[0, 9 + j], a[1, 9 + j], a[2, 9 + j] = (
                -adapted * f0 * f[j],
                -adapted * f1 * f[j],
                -adapted * f2 * f[j],
            )
    joseph_update(P, workspace[OWN], a, b, r)
    copy_leading(P, belief.P, n)


@helper
def turn(
    a: Array,
    row: int,
    C: Array,
    f: Three,
    sigma: Three,
    ki: float,
) -> None:
    """Add to a[row] what a turn of the estimate by sigma (rad, n) does to the errors; f is the
    specific force in n."""
    xi = a.shape[1] - AUXILIARY + XI
    f0, f1, f2 = f
    s0, s1, s2 = sigma
    a[row, 6] -= s0
    a[row, 7] -= s1
    a[row, 8] -= s2
    for j in range(3):
        a[row, 12 + j] += ki * (C[0, j] * s0 + C[1, j] * s1 + C[2, j] * s2)
    a[row, xi] += s1 * f2 - s2 * f1
    a[row, xi + 1] += s2 * f0 - s0 * f2
    a[row, xi + 2] += s0 * f1 - s1 * f0


@inline
def foresee(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
) -> float:
    """The NIS of a fix. Its H (3, n), with its noise as states, stays in the workspace."""
    workspace, n, m = belief.workspace, belief.P.shape[0], all_states(belief)
    P, h, own = (
        matrix(workspace, FULL, m, m),
        matrix(workspace, H, 3, m),
        matrix(workspace, JACOBIAN, 3, n),
    )
    step(belief)
    copy_leading(belief.P, P, n)
    rows = observe_innovation(belief, y, observe, source, innovation, own)
    for i in range(3):
        for j in range(n):
            h[i, j] = own[i, j]
        for j in range(n, m):
            h[i, j] = 0.0
        for j in range(m):
            P[n + NOW + i, j] = P[j, n + NOW + i] = 0.0
        h[i, n + NOW + i] = 1.0
    for i in range(rows):
        P[n + NOW + i, n + NOW + i] = std[i] * std[i]
    return update(
        P, h, innovation, workspace[NO_NOISE], rows, -1.0, workspace[OWN][WORK], workspace[DX]
    )


@inline
def learn_installation(belief: FilterState, taken: bool) -> None:
    """Correct the states of the installation by what `foresee` has left, where the fix is taken."""
    workspace, m = belief.workspace, all_states(belief)
    P = matrix(workspace, FULL, m, m)
    learn_beyond(P, workspace[OWN], workspace[DX], belief.augmented, belief.P.shape[0], taken)


@inline
def after_fix(belief: FilterState, std: Array, kind: int, source: SourceRow) -> None:
    """P by what the observer has changed at the fix of `foresee`."""
    workspace, n, m = belief.workspace, belief.P.shape[0], all_states(belief)
    P, a, b, r, h = (
        matrix(workspace, FULL, m, m),
        matrix(workspace, A, 3, m),
        matrix(workspace, B, 3, m),
        matrix(workspace, R, 3, 3),
        matrix(workspace, H, 3, m),
    )
    if any_of(workspace[SHARE] != 0):
        clear(workspace)
        if kind == Kind.MAGNETIC_FIELD:
            _field(belief, std, source, a, b, r)
        else:
            _heading(belief, kind == Kind.VELOCITY, a, b)
        joseph_update(P, workspace[OWN], a, b, r)
    K = workspace[GAIN]
    clear(workspace)
    used = False
    for row in range(3):
        axis = 2 if kind == Kind.ALTITUDE else row
        if any_of((K[3 * row] != 0) | (K[3 * row + 1] != 0) | (K[3 * row + 2] != 0)):
            used = True
            a[row, axis], a[row, 3 + axis], a[row, n + XI + axis] = (
                -K[3 * row],
                -K[3 * row + 1],
                -K[3 * row + 2],
            )
    if used:
        joseph_update(P, workspace[OWN], a, h, r)
        if int(workspace[LAW]) == BY_XI and kind != Kind.ALTITUDE:
            _learnt(belief, P, a, b, r)
    copy_leading(P, belief.P, n)


@inline
def _learnt(belief: FilterState, P: Array, a: Array, b: Array, r: Array) -> None:
    """P by what the adaptive part has learnt of the course, and then of xi."""
    workspace, n, C = belief.workspace, belief.P.shape[0], belief.C_nb
    own, K = workspace[ADAPTIVE], workspace[ADAPTIVE][adaptive_law.CHANGE]
    clear(workspace)
    left = 1 / (1 - workspace[SHARE])
    for i in range(adaptive_law.COUNT):
        K[i] = own[adaptive_law.COURSE][i]
    adaptive_law.solve(own, K)
    _move(own, C, a, 0)
    b[0, 8] = left
    _course_of(belief, b, left)
    joseph_update(P, workspace[OWN], a, b, r)
    clear(workspace)
    x = matrix(own, adaptive_law.U_XI, 3, adaptive_law.COUNT)
    for row in range(3):
        for i in range(adaptive_law.COUNT):
            K[i] = -own[adaptive_law.WEIGHT] * x[row, i]
        adaptive_law.solve(own, K)
        _move(own, C, a, row)
        b[row, n + XI + row] = 1.0
    joseph_update(P, workspace[OWN], a, b, r)


@helper
def _move(own: Array, C: Array, a: Array, row: int) -> None:
    """a[row] of a change of what the adaptive part knows, in CHANGE."""
    for i in range(3):
        a[row, i] = -adaptive_law.answer(own, adaptive_law.U_P, i)
        a[row, 3 + i] = -adaptive_law.answer(own, adaptive_law.U_V, i)
        a[row, 6 + i] = -adaptive_law.answer(own, adaptive_law.U_TILT, i)
        a[row, 9 + i] = -own[adaptive_law.SCALE][i] * own[adaptive_law.CHANGE][i]
        a[row, 12 + i] = -adaptive_law.answer(own, adaptive_law.U_GYRO, i)
        a[row, a.shape[1] - AUXILIARY + XI + i] = adaptive_law.answer(own, adaptive_law.U_XI, i)


@helper
def _heading(belief: FilterState, course: bool, a: Array, b: Array) -> None:
    """A turn about the vertical by a share of a heading's angle, or a course's."""
    workspace, C, f = belief.workspace, belief.C_nb, belief.f
    share = workspace[SHARE]
    horizontal = max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], 1e-2)
    b[0, 6], b[0, 7], b[0, 8] = (
        -C[2, 0] * C[0, 0] / horizontal,
        -C[2, 0] * C[1, 0] / horizontal,
        1.0,
    )
    if course:
        _course_of(belief, b, 1.0)
    else:
        b[0, belief.P.shape[0] + NOW] = 1.0
    turn(a, 0, C, rotate_vector(C, f[0], f[1], f[2]), (0.0, 0.0, share), workspace[LEARNT])


@helper
def _course_of(belief: FilterState, b: Array, size: float) -> None:
    """In b[0] `size` times what the course of the velocity at hand errs by: the angle to the
    heading, and the noise across over the speed."""
    n, v = belief.P.shape[0], belief.v_n
    square = max(v[0] * v[0] + v[1] * v[1], MIN_SPEED * MIN_SPEED)
    b[0, n + CRAB] = size
    b[0, n + NOW], b[0, n + NOW + 1] = -size * v[1] / square, size * v[0] / square


@helper
def _field(
    belief: FilterState, std: Array, source: SourceRow, a: Array, b: Array, r: Array
) -> None:
    """A turn by a share of the angle between the fields (T) as measured and as known, or between
    what of them is across the specific force.

    With h the force as the observer has it, u = h x m and noise n of the field, the angle of the
    latter is (h ((m x u)' theta - u' n) + m u' e_xi) / |u|^2, and that of the fields (theta without
    its part along m) - m x n / |m|^2. Where errors of the magnetometer are states, n is what they and
    the noise of the fix at hand, which has corrected them, do by the columns of H.
    """
    errs = has_estimated_errors(belief, source)
    workspace, C, f, xi = belief.workspace, belief.C_nb, belief.f, belief.workspace[XI_VALUE]
    m, share, ki = (
        (source.parameters[0], source.parameters[1], source.parameters[2]),
        workspace[SHARE],
        workspace[LEARNT],
    )
    force = rotate_vector(C, f[0], f[1], f[2])
    variance = (std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / 3
    if int(workspace[FIELD]) == ACROSS:
        h = (force[0] + xi[0], force[1] + xi[1], force[2] + xi[2])
        u = cross(h, m)
        square, along = dot(u, u), cross(m, u)
        each = share / where(square > 0, square, 1.0)
        xi = belief.P.shape[0] + XI
        for j in range(3):
            b[0, 6 + j], b[1, xi + j] = along[j], u[j]
        if errs:
            _field_errors(belief, u, b[0])
        else:
            r[0, 0] = variance * square
        turn(a, 0, C, force, scale_vector(each, h), ki)
        turn(a, 1, C, force, scale_vector(each, m), ki)
    else:
        square = dot(m, m)
        for i in range(3):
            for j in range(3):
                b[i, 6 + j] = (1.0 if i == j else 0.0) - m[i] * m[j] / square
                if not errs:
                    r[i, j] = variance / square * b[i, 6 + j]
            if errs:
                unit = (1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2))
                _field_errors(belief, scale_vector(1 / square, cross(unit, m)), b[i])
            x, y, z = (
                where(i == 0, share, 0.0),
                where(i == 1, share, 0.0),
                where(i == 2, share, 0.0),
            )
            turn(a, i, C, force, (x, y, z), ki)


@helper
def _field_errors(belief: FilterState, u: Three, row: Array) -> None:
    """- u' n (u in n) in the columns of states that make n: those of the magnetometer's errors and the noise
    of the fix at hand."""
    h, C = matrix(belief.workspace, H, 3, row.size), belief.C_nb
    for k in range(STATES, row.size):
        x, y, z = rotate_vector(C, h[0, k], h[1, k], h[2, k])
        row[k] -= u[0] * x + u[1] * y + u[2] * z


@helper
def scale_vector(k: float, a: Three) -> Three:
    """k a."""
    return k * a[0], k * a[1], k * a[2]
