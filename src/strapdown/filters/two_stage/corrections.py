"""Corrections of the two-stage model: fixes through their observers, each in its stage; gravity
and course, which stage 1 makes itself.

`bar` is where the model is linearised, as in filters/two_stage/model.py: innovation and H are taken
there, and the estimate's distance from it counts by H.
"""

import math

from ...core.compile.jit import helper, inline, matrix
from ...core.loop.contract import STATES, FilterState, Kind, Noise, Observe, SourceRow
from ...core.mathematics.earth import RATE, gravity
from ...core.mathematics.error_state import DV, DX, JACOBIAN, WORK, observe_innovation
from ...core.mathematics.kalman import COUNT, update_fifteen, used_rows, whiten_rows
from ...core.mathematics.rotation import wrap
from ...typing import Array
from ..attitude import attitude_error_state
from ..observer.equations import LONG_HELD, too_slow
from .model import (
    ACCELERATION,
    CENTRIFUGAL,
    CONDITION,
    CORRELATION,
    COURSE,
    COURSE_GAIN,
    CRAB,
    DEVIATION,
    DOWN,
    ERROR,
    FAR_COURSES,
    FAR_VECTORS,
    FIX_GAIN,
    FORCE,
    HELD,
    INNOVATION,
    INVERSE,
    KNOWN,
    LEVEL_GAIN,
    LEVEL_SECONDS,
    MAX_BANK,
    MAX_WITHOUT_VELOCITY,
    MIN_COSINE,
    MIN_SPEED,
    RAW,
    SECONDS,
    SINCE_HEADING,
    SINCE_VELOCITY,
    SLOW,
    TRUSTED,
    VELOCITY_THEN,
    WINDOW,
    to_body,
)

FAR_SCALAR, FAR_VECTOR = 10.828, 16.266
"""NIS of a course and of a gravity vector beyond which their variance is multiplied by how far
they are beyond."""
MANY_FAR, MAX_GROWTH = 5, 9.0
"""So many beyond in a row let P of stage 1 grow instead, by so much at most: the rule of the
loop."""


@inline
def gather(
    belief: FilterState,
    bar: FilterState,
    b: Array,
    u: Array,
    r0: float,
    r1: float,
    r2: float,
    dt: float,
    made_up: bool,
) -> None:
    """Take a sample, whose rotation is r, into the means of specific force, free of the
    accelerometer bias b (m/s^2), and anti-centrifugal acceleration omega x v_b.

    The gyros carry both along. Over a gap the loop makes samples up: then the means begin anew.
    """
    workspace, C, v = belief.workspace, bar.C_nb, bar.v_n
    workspace[SINCE_VELOCITY] += dt
    workspace[SINCE_HEADING] += dt
    if made_up:
        restart(workspace)
        return
    x, y, z = to_body(C, v[0], v[1], v[2])
    share, free = dt / (workspace[SECONDS] + dt), dt * (1 - workspace[RAW])
    force = (0.0, 0.0, 0.0, u[3] - free * b[0], u[4] - free * b[1], u[5] - free * b[2])
    attitude_error_state.carry(workspace[FORCE], force, r0, r1, r2, dt, share)
    attitude_error_state.carry(
        workspace[CENTRIFUGAL],
        (0.0, 0.0, 0.0, r1 * z - r2 * y, r2 * x - r0 * z, r0 * y - r1 * x),
        r0,
        r1,
        r2,
        dt,
        share,
    )
    workspace[SECONDS] += dt


@helper
def restart(workspace: Array) -> None:
    """A new window, which begins without a velocity fix."""
    workspace[SECONDS] = workspace[KNOWN] = 0.0


@inline
def level_alone(belief: FilterState, bar: FilterState, noise: Noise) -> int:
    """Where no velocity fix tells the change of v_b, once a window: rows of the specific force less
    the anti-centrifugal acceleration.

    Returns how many. What the velocity is uncertain by times the rate, and what is left that
    differs from gravity in size, counts as noise.
    """
    workspace, P, w, T = belief.workspace, belief.P, bar.omega, belief.workspace[SECONDS]
    if workspace[SINCE_VELOCITY] < MAX_WITHOUT_VELOCITY or T < workspace[WINDOW]:
        return 0
    f, a = workspace[FORCE], workspace[CENTRIFUGAL]
    swing = (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (P[3, 3] + P[4, 4] + P[5, 5])
    _level(
        belief,
        bar,
        f[0] - a[0],
        f[1] - a[1],
        f[2] - a[2],
        (workspace[ACCELERATION] + noise.accel * noise.accel) / T + swing,
    )
    workspace[LEVEL_SECONDS] = -T
    restart(workspace)
    return 3


@inline
def level_by_velocity(
    belief: FilterState, bar: FilterState, v0: float, v1: float, v2: float, variance: float
) -> int:
    """At a velocity fix: rows of the mean specific force since the one that the window began with,
    less the change of velocity. Returns how many.

    v is the velocity at the IMU as the fix has it, m/s NED, `variance` that of one of its
    components. Begins a new window.
    """
    workspace, P, C, f, then, T = (
        belief.workspace,
        belief.P,
        bar.C_nb,
        belief.workspace[FORCE],
        belief.workspace[VELOCITY_THEN],
        belief.workspace[SECONDS],
    )
    workspace[SINCE_VELOCITY] = 0.0
    known = workspace[KNOWN] > 0
    if known and T < 0.9 * workspace[WINDOW]:
        return 0
    if known:
        lat = bar.lla[0]
        w0, w2 = 2 * RATE * math.cos(lat), -2 * RATE * math.sin(lat)
        a0, a1, a2 = (
            (v0 - then[0]) / T - w2 * v1,
            (v1 - then[1]) / T + w2 * v0 - w0 * v2,
            (v2 - then[2]) / T + w0 * v1,
        )
        b0, b1, b2 = to_body(C, a0, a1, a2)
        turned = (a0 * a0 + a1 * a1) * P[8, 8]
        _level(
            belief,
            bar,
            f[0] - b0,
            f[1] - b1,
            f[2] - b2,
            workspace[ACCELERATION] / T + 2 * variance / (T * T) + turned,
        )
    workspace[LEVEL_SECONDS] = T
    workspace[SECONDS], workspace[KNOWN], then[0], then[1], then[2] = 0.0, 1.0, v0, v1, v2
    return 3 if known else 0


@inline
def _level(
    belief: FilterState, bar: FilterState, z0: float, z1: float, z2: float, variance: float
) -> None:
    """Rows of the specific force z against gravity (m/s^2, body): f = g [sin theta, -cos theta
    sin phi, -cos theta cos phi]."""
    workspace, n, C = belief.workspace, belief.P.shape[0], bar.C_nb
    H, e, deviation = (
        matrix(workspace, JACOBIAN, 3, n),
        workspace[INNOVATION],
        workspace[DEVIATION],
    )
    g = gravity(math.sin(bar.lla[0]), bar.lla[2])
    of_bias = 1 - workspace[RAW]
    excess = math.sqrt(z0 * z0 + z1 * z1 + z2 * z2) - g
    z = (z0, z1, z2)
    for i in range(3):
        for j in range(n):
            H[i, j] = 0.0
        H[i, 6], H[i, 7] = -g * C[1, i], g * C[0, i]
        e[i], deviation[i] = (
            z[i] + g * C[2, i],
            math.sqrt(variance + excess * excess + of_bias * belief.P[9 + i, 9 + i]),
        )
    _less_known(workspace, H, e, 3)


@inline
def course(
    belief: FilterState, bar: FilterState, v0: float, v1: float, std: float, since: float
) -> int:
    """A row of the course of a velocity fix (m/s north, east, at the IMU, with std m/s), `since` s
    after the one before. Returns how many.

    Not near standstill nor in a bank; then the heading is held and the time counted. The angle
    between course and heading lasts: its standard deviation is so much larger that independent
    errors have the low-frequency power of lasting ones.
    """
    workspace, n, C = belief.workspace, belief.P.shape[0], bar.C_nb
    speed, bank = math.hypot(v0, v1), math.atan2(C[2, 1], C[2, 2])
    if workspace[COURSE] == 0 or workspace[SINCE_HEADING] < TRUSTED:
        return 0
    if too_slow(speed, std, workspace[MIN_SPEED]) or abs(bank) > workspace[MAX_BANK]:
        held = min(since, MAX_WITHOUT_VELOCITY)
        workspace[HELD] += held
        workspace[SLOW] += held
        workspace[CONDITION] = 1.0 if workspace[SLOW] >= LONG_HELD else 0.0
        return 0
    workspace[SLOW] = workspace[CONDITION] = 0.0
    H, e, deviation = (
        matrix(workspace, JACOBIAN, 3, n),
        workspace[INNOVATION],
        workspace[DEVIATION],
    )
    horizontal = max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], MIN_COSINE * MIN_COSINE)
    for j in range(n):
        H[0, j] = 0.0
    H[0, 6], H[0, 7], H[0, 8] = (
        -C[2, 0] * C[0, 0] / horizontal,
        -C[2, 0] * C[1, 0] / horizontal,
        1.0,
    )
    e[0] = math.atan2(v1, v0) - math.atan2(C[1, 0], C[0, 0])
    _less_known(workspace, H, e, 1)
    e[0] = wrap(e[0])
    lasting = max(2 * workspace[CORRELATION] / max(since, 1e-3), 1.0)
    deviation[0] = math.sqrt(
        std * std / (speed * speed) + workspace[CRAB] * workspace[CRAB] * lasting
    )
    return 1


@helper
def correct_rows(
    P: Array, workspace: Array, innovation: Array, std: Array, rows: int, gate: float, bound: float
) -> float:
    """Correct P and workspace[ERROR] by rows whose H is ready, unless NIS > gate. Returns the NIS.

    Nothing else may call `update`: compilers copy it each time.

    Rows of stage 1's own, with a finite `bound`: further off than that (NIS) they count for less,
    never for nothing. Where so many in a row were, P of stage 1 is too small: it grows as the loop
    lets it grow when it lifts a gate.
    """
    x, dx, n = workspace[ERROR], workspace[DX], P.shape[0]
    H, own, far = (
        matrix(workspace, JACOBIAN, 3, n),
        bound < math.inf,
        FAR_COURSES if rows == 1 else FAR_VECTORS,
    )
    gain = FIX_GAIN if not own else (COURSE_GAIN if rows == 1 else LEVEL_GAIN)
    while True:
        nis = update_fifteen(
            P, H, innovation, std, rows, -1.0 if own else gate, workspace[WORK], dx
        )
        if not own:
            break
        own, excess = False, nis / bound
        workspace[far] = workspace[far] + 1 if excess > 1 else 0.0
        if workspace[far] >= MANY_FAR:
            _grow(P, min(excess, MAX_GROWTH))
        elif excess > 1:
            for i in range(rows):
                std[i] *= math.sqrt(excess)
    if nis <= gate:
        for j in range(15):
            x[j] += dx[j]
    _keep_gain(workspace, matrix(workspace, gain, STATES, 3), nis <= gate)
    return nis


@helper
def _keep_gain(workspace: Array, K: Array, taken: bool) -> None:
    """K = U' L^-1 of the correction that `update` has just made, zero unless it was taken."""
    work = workspace[WORK]
    U, left = matrix(work, 0, 3, STATES), matrix(workspace, INVERSE, 3, 3)
    for i in range(3):
        for j in range(3):
            left[i, j] = 1.0 if i == j else 0.0
    whiten_rows(left, work, used_rows(STATES))
    count = int(work[used_rows(STATES) + COUNT]) if taken else 0
    for j in range(STATES):
        for i in range(3):
            K[j, i] = 0.0
            for k in range(count):
                K[j, i] += U[k, j] * left[k, i]


@helper
def _grow(P: Array, factor: float) -> None:
    """P of stage 1 times `factor`."""
    for first in (6, 12):
        for second in (6, 12):
            for i in range(3):
                for j in range(3):
                    P[first + i, second + j] *= factor


@helper
def _less_known(workspace: Array, H: Array, innovation: Array, rows: int) -> None:
    """Innovations at the estimate, affine, from those at `bar`."""
    x = workspace[ERROR]
    for i in range(rows):
        for j in range(15):
            innovation[i] -= H[i, j] * x[j]


@inline
def see(
    belief: FilterState,
    bar: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
) -> int:
    """Innovation at the estimate and H of a fix, in its own stage alone, and the standard
    deviations of its rows in workspace[DV]. Returns the rows.

    Attitude and gyro bias are known to stage 2: their columns, lever arms included, are zero there.
    """
    workspace, n, C, used = (
        belief.workspace,
        belief.P.shape[0],
        bar.C_nb,
        belief.workspace[DV],
    )
    H = matrix(workspace, JACOBIAN, 3, n)
    rows = observe_innovation(bar, y, observe, source, innovation, H)
    for i in range(rows):
        used[i] = std[i]
        if not is_stage_one(kind):
            for j in range(3):
                H[i, 6 + j] = H[i, 12 + j] = 0.0
    if kind == Kind.VELOCITY and workspace[DOWN] > 0:  # the third component of C' (y - v)
        innovation[0] = C[0, 2] * innovation[0] + C[1, 2] * innovation[1] + C[2, 2] * innovation[2]
        used[0] = math.sqrt(
            (C[0, 2] * std[0]) ** 2 + (C[1, 2] * std[1]) ** 2 + (C[2, 2] * std[2]) ** 2
        )
        H[0, 3], H[0, 4], H[0, 5], rows = C[0, 2], C[1, 2], C[2, 2], 1
        innovation[1] = innovation[2] = math.nan
    _less_known(workspace, H, innovation, rows)
    if kind == Kind.HEADING:
        innovation[0] = wrap(innovation[0])
    return rows


@inline
def is_stage_one(kind: int) -> bool:
    """True where a kind of measurement belongs to stage 1."""
    return kind == Kind.HEADING or kind == Kind.MAGNETIC_FIELD


@helper
def note_fix_used(workspace: Array, kind: int) -> None:
    """A fix of that kind was used."""
    if is_stage_one(kind):
        workspace[SINCE_HEADING] = workspace[SLOW] = workspace[CONDITION] = 0.0


@inline
def steer(
    belief: FilterState,
    bar: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
) -> None:
    """Correct stage 1 by a velocity: the direction of gravity by the change of velocity, and the
    course. Writes the innovation at `bar`."""
    workspace, n = belief.workspace, belief.P.shape[0]
    observe_innovation(bar, y, observe, source, innovation, matrix(workspace, JACOBIAN, 3, n))
    v0, v1, v2, since = (
        bar.v_n[0] + innovation[0],
        bar.v_n[1] + innovation[1],
        bar.v_n[2] + innovation[2],
        workspace[SINCE_VELOCITY],
    )
    seen = v0 + v1 + v2 == v0 + v1 + v2
    if (
        seen
        and level_by_velocity(
            belief, bar, v0, v1, v2, (std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / 3
        )
        > 0
    ):
        correct_rows(
            belief.P,
            workspace,
            workspace[INNOVATION],
            workspace[DEVIATION],
            3,
            math.inf,
            FAR_VECTOR,
        )
    if (
        v0 + v1 == v0 + v1
        and course(belief, bar, v0, v1, math.hypot(std[0], std[1]) * math.sqrt(0.5), since) > 0
    ):
        correct_rows(
            belief.P,
            workspace,
            workspace[INNOVATION],
            workspace[DEVIATION],
            1,
            math.inf,
            FAR_SCALAR,
        )
