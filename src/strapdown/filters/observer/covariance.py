"""First-order covariance of the observer's errors: its 15 error states, xi and the angle between
course and heading, under the gains that it really uses.

The errors are true - estimate. xi makes up for what the estimated specific force lacks, so its true
value is zero, and the error of xi is what moves the others between fixes:
    v' = INS + e_xi,  sigma = -k1 f x e_xi / |f|^2,  theta' = INS - sigma,  bg' = ki C' sigma,
    e_xi' = sigma x f,  ba' = -adaptation f f' e_xi / |f|^2 (f in b and n).
A fix multiplies the errors by I - K H, whatever K came from, and a turn of the attitude by a share
of an angle is such a K. filters/observer/equations.py leaves both in the workspace. The angle
between course and heading is no white noise but lasts until the vehicle has turned in the wind: a
Gauss-Markov process that is never estimated, which the heading takes on. The square of the accelerometer bias (theta0) counts as known.
"""

from typing import TypeAlias

from ...core.compile.jit import helper, inlined, matrix
from ...core.compile.selection import any_of, where
from ...core.loop.contract import FilterState, Kind, Noise, Slots, SourceRow
from ...core.mathematics.joseph import (
    FORCE,
    JOSEPH,
    NOISE,
    SECONDS,
    await_step,
    carry,
    has_new_noise,
    joseph_update,
)
from ...core.mathematics.kalman import decay
from ...core.mathematics.rotation import rotate_vector
from ...typing import Array
from . import adaptive_law
from .equations import (
    ACROSS,
    ADAPTATION,
    ADAPTIVE,
    BY_NORM,
    BY_XI,
    COURSE_SD,
    FADE,
    FIELD,
    GAIN,
    K1,
    KI,
    LAW,
    LEARNT,
    OBSERVER,
    SHARE,
    TOLD,
    XI as XI_VALUE,
    gain,
    outage,
)

STATES, XI, CRAB = 19, 15, 18
"""How many, and where the error of xi and the angle between course and heading stand, behind the 15
of the library."""
SLOTS = Slots(after=OBSERVER)
FULL = SLOTS.matrix("FULL", STATES, STATES)  # their covariance
CRAB_SD = SLOTS.number("CRAB_SD")  # of the angle between course and heading, rad
A = SLOTS.matrix("A", 3, STATES)  # of core.mathematics.joseph.spread
B = SLOTS.matrix("B", 3, STATES)
R = SLOTS.matrix("R", 3, 3)
OWN = SLOTS.part("OWN", JOSEPH)
CRAB_TIME = 30.0  # s: time constant of that angle, that of turns in the wind
Three: TypeAlias = tuple[float, float, float]


@helper
def copy_leading(source: Array, target: Array) -> None:
    """The first 15 states of one covariance into another."""
    for i in range(15):
        for j in range(15):
            target[i, j] = source[i, j]


@helper
def clear(workspace: Array) -> None:
    """A, B and R, which lie one behind the other, are zero."""
    for i in range(A, R + 9):
        workspace[i] = 0.0


@inlined
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
    workspace, own, C = belief.workspace, belief.workspace[OWN], belief.C
    if float(own[SECONDS]) <= 0:
        return
    f, made_up = own[FORCE], float(own[NOISE][1]) > float(workspace[TOLD])
    P, a, b, r = (
        matrix(workspace, FULL, STATES, STATES),
        matrix(workspace, A, 3, STATES),
        matrix(workspace, B, 3, STATES),
        matrix(workspace, R, 3, 3),
    )
    copy_leading(belief.P, P)  # the loop may have changed it
    dt = carry(P, own, belief.lla, belief.v, C)
    keep, sd = decay(dt / CRAB_TIME), workspace[CRAB_SD]
    for j in range(STATES):
        P[CRAB, j] = P[j, CRAB] = keep * P[j, CRAB]
    P[CRAB, CRAB] = keep * P[CRAB, CRAB] + (1 - keep * keep) * sd * sd
    clear(workspace)
    for i in range(3):
        b[i, XI + i], a[i, 3 + i], a[i, i] = 1.0, dt, 0.5 * dt * dt
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
    copy_leading(P, belief.P)


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
    f0, f1, f2 = f
    s0, s1, s2 = sigma
    a[row, 6] -= s0
    a[row, 7] -= s1
    a[row, 8] -= s2
    for j in range(3):
        a[row, 12 + j] += ki * (C[0, j] * s0 + C[1, j] * s1 + C[2, j] * s2)
    a[row, XI] += s1 * f2 - s2 * f1
    a[row, XI + 1] += s2 * f0 - s0 * f2
    a[row, XI + 2] += s0 * f1 - s1 * f0


@inlined
def after_fix(belief: FilterState, sd: Array, kind: int, source: SourceRow, H: Array) -> None:
    """P by what the observer has changed at a fix; H (3, 15) of its innovation."""
    workspace = belief.workspace
    P, a, b, r = (
        matrix(workspace, FULL, STATES, STATES),
        matrix(workspace, A, 3, STATES),
        matrix(workspace, B, 3, STATES),
        matrix(workspace, R, 3, 3),
    )
    copy_leading(belief.P, P)
    if any_of(workspace[SHARE] != 0):
        clear(workspace)
        if kind == Kind.MAGNETIC_FIELD:
            _field(belief, sd, source, a, b, r)
        else:
            _heading(belief, sd[0], kind == Kind.VELOCITY, a, b, r)
        joseph_update(P, workspace[OWN], a, b, r)
    K = workspace[GAIN]
    clear(workspace)
    used = False
    for row in range(3):
        axis = 2 if kind == Kind.ALTITUDE else row
        if any_of((K[3 * row] != 0) | (K[3 * row + 1] != 0) | (K[3 * row + 2] != 0)):
            used = True
            a[row, axis], a[row, 3 + axis], a[row, XI + axis] = (
                -K[3 * row],
                -K[3 * row + 1],
                -K[3 * row + 2],
            )
            r[row, row] = sd[row] * sd[row]
            for j in range(15):
                b[row, j] = H[row, j]
    if used:
        joseph_update(P, workspace[OWN], a, b, r)
        if int(workspace[LAW]) == BY_XI and kind != Kind.ALTITUDE:
            _learnt(belief, P, a, b, r)
    copy_leading(P, belief.P)


@inlined
def _learnt(belief: FilterState, P: Array, a: Array, b: Array, r: Array) -> None:
    """P by what the adaptive part has learnt of the course, and then of xi."""
    workspace, C = belief.workspace, belief.C
    own, K = workspace[ADAPTIVE], workspace[ADAPTIVE][adaptive_law.CHANGE]
    clear(workspace)
    left = 1 / (1 - workspace[SHARE])
    for i in range(adaptive_law.COUNT):
        K[i] = own[adaptive_law.COURSE][i]
    adaptive_law.solve(own, K)
    _move(own, C, a, 0)
    b[0, 8], b[0, CRAB] = left, left
    r[0, 0] = left * left * workspace[COURSE_SD] * workspace[COURSE_SD]
    joseph_update(P, workspace[OWN], a, b, r)
    clear(workspace)
    x = matrix(own, adaptive_law.U_XI, 3, adaptive_law.COUNT)
    for row in range(3):
        for i in range(adaptive_law.COUNT):
            K[i] = -own[adaptive_law.WEIGHT] * x[row, i]
        adaptive_law.solve(own, K)
        _move(own, C, a, row)
        b[row, XI + row] = 1.0
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
        a[row, XI + i] = adaptive_law.answer(own, adaptive_law.U_XI, i)


@helper
def _heading(belief: FilterState, sd: float, course: bool, a: Array, b: Array, r: Array) -> None:
    """A turn about the vertical by a share of a heading's angle, or a course's."""
    workspace, C, f = belief.workspace, belief.C, belief.f
    share = workspace[SHARE]
    horizontal = max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], 1e-2)
    b[0, 6], b[0, 7], b[0, 8] = (
        -C[2, 0] * C[0, 0] / horizontal,
        -C[2, 0] * C[1, 0] / horizontal,
        1.0,
    )
    r[0, 0] = sd * sd
    if course:
        r[0, 0], b[0, CRAB] = workspace[COURSE_SD] * workspace[COURSE_SD], 1.0
    turn(a, 0, C, rotate_vector(C, f[0], f[1], f[2]), (0.0, 0.0, share), workspace[LEARNT])


@helper
def _field(belief: FilterState, sd: Array, source: SourceRow, a: Array, b: Array, r: Array) -> None:
    """A turn by a share of the angle between the fields (T) as measured and as known, or between
    what of them is across the specific force.

    With h the force as the observer has it, u = h x m and noise n of the field, the angle of the
    latter is (h ((m x u)' theta - u' n) + m u' e_xi) / |u|^2.
    """
    workspace, C, f, xi = belief.workspace, belief.C, belief.f, belief.workspace[XI_VALUE]
    m, share, ki = (
        (source.parameters[0], source.parameters[1], source.parameters[2]),
        workspace[SHARE],
        workspace[LEARNT],
    )
    force = rotate_vector(C, f[0], f[1], f[2])
    variance = (sd[0] * sd[0] + sd[1] * sd[1] + sd[2] * sd[2]) / 3
    if int(workspace[FIELD]) == ACROSS:
        h = (force[0] + xi[0], force[1] + xi[1], force[2] + xi[2])
        u = cross(h, m)
        square, along = dot(u, u), cross(m, u)
        each = share / where(square > 0, square, 1.0)
        for j in range(3):
            b[0, 6 + j], b[1, XI + j] = along[j], u[j]
        r[0, 0] = variance * square
        turn(a, 0, C, force, scale_vector(each, h), ki)
        turn(a, 1, C, force, scale_vector(each, m), ki)
    else:
        square = dot(m, m)
        for i in range(3):
            for j in range(3):
                b[i, 6 + j] = (1.0 if i == j else 0.0) - m[i] * m[j] / square
                r[i, j] = variance / square * b[i, 6 + j]
            x, y, z = (
                where(i == 0, share, 0.0),
                where(i == 1, share, 0.0),
                where(i == 2, share, 0.0),
            )
            turn(a, i, C, force, (x, y, z), ki)


@helper
def cross(a: Three, b: Three) -> Three:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@helper
def dot(a: Three, b: Three) -> float:
    """a' b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def scale_vector(k: float, a: Three) -> Three:
    """k a."""
    return k * a[0], k * a[1], k * a[2]
