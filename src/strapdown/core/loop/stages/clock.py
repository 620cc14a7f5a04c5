"""The motion of the last seconds, kept so that a fix whose clock is estimated is compared with where
the belief was when it held.

A measurement stamped t holds at t + tau. It waits for `delay` seconds, so that with any probable tau
its instant s lies behind the belief, by the `age`. With S the integral of C f, and X that of S, from
s to now

    v(s) = v - (S - S(s)) - r age        p(s) = p - age v + [age S - (X - X(s))] + r age^2 / 2

where r is gravity less the Coriolis term. All is written into the source (SourceRow): the two
brackets, `force` and `lag`, and the mean force about s, in body axes now, so that they turn with its
errors. `force_then`, `rate` and `spin` are differences over sqrt(3) standard deviations of the clock
to both sides, the outer points of the three-point Gauss-Hermite rule, and `bent_position` and
`bent_velocity` are what they leave out: statistical linearisation, Gelb (1974), section 6.3. A
tangent would see more than there is: where an antenna on a rough road swings once in 0.5 s, a clock
0.2 s late is far outside its range.
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...compile.records import Table, rows
from ...mathematics.belief import STATES, FilterState
from ...mathematics.mechanization import stationary_increments
from ...mathematics.rotation import rotate_left, rotate_vector
from ...mathematics.source import Kind, SourceRow
from ..body_motion import ANGLE, ROWS, BodyMotion, S, X
from ..cursor import Cursor
from ..integrity import flag_unreliable
from ..kernels import STAGE, STEP as PREDICTED, Kernels
from ..log import Code, notify
from ..tables import Fixes

STEP = 0.0099  # s that rows are kept apart, at least
BEHIND, AHEAD = 2.5, 1.0
"""s before the belief and after it at which a fix can have held: that much is kept, and so far the
motion may be taken to go on."""
WINDOW = 0.2
"""s about the instant of a fix over which the force is averaged: vibration of single samples would
make a derivative by time too large. The rate is that of the instant, since it moves the antenna."""


def new_recent(t: float, needed: bool) -> Any:
    """Cursor.recent at time t, whose row 1 is now; without rows where nobody looks back."""
    recent = rows(BodyMotion, ROWS if needed else 0)
    recent["t"] = np.inf
    recent["t"][:2] = t
    return recent


@kernel(PREDICTED)
def keep(belief: FilterState, u: Array, dt: float, cursor: Cursor, record: Array) -> None:
    """Add the bias-free rate and force of the last prediction, which took dt seconds."""
    recent, now = cursor.recent, cursor.state[0].latest
    if recent[now].t - recent[(now - 1) % ROWS].t >= STEP:
        following = (now + 1) % ROWS
        recent[following].t = recent[now].t
        for i in range(9):
            recent[following].sums[i] = recent[now].sums[i]
        cursor.state[0].latest = now = following
    row, w, f, C = recent[now], belief.omega, belief.f, belief.C_nb
    # force in the body at the end: half a turn back
    h = 0.5 * dt
    a = f[0] - h * (w[1] * f[2] - w[2] * f[1])
    b = f[1] - h * (w[2] * f[0] - w[0] * f[2])
    c = f[2] - h * (w[0] * f[1] - w[1] * f[0])
    row.t += dt
    for i in range(3):
        change = dt * (C[i, 0] * a + C[i, 1] * b + C[i, 2] * c)
        row.sums[X + i] += dt * (row.sums[S + i] + 0.5 * change)
        row.sums[S + i] += change
        row.sums[ANGLE + i] += dt * w[i]


@helper
def _at(recent: Table[BodyMotion], now: int, t: float, column: int) -> float:
    """The value of a column at time t, not before the first row: between rows S and ANGLE are
    linear."""
    newer = older = now
    for k in range(1, ROWS):
        candidate = (now - k) % ROWS
        if not recent[candidate].t < recent[older].t:  # none was kept there yet
            break
        newer, older = older, candidate
        if recent[older].t <= t:
            break
    span = recent[newer].t - recent[older].t
    if not span > 0:
        return recent[newer].sums[column]
    share = (t - recent[older].t) / span
    value = recent[older].sums[column] + share * (
        recent[newer].sums[column] - recent[older].sums[column]
    )
    if X <= column < X + 3:  # bent by the force of the row
        gained = recent[newer].sums[column - X + S] - recent[older].sums[column - X + S]
        value -= 0.5 * share * (1.0 - share) * span * gained
    return value


@helper
def _slope(
    recent: Table[BodyMotion], now: int, begin: float, t: float, width: float, column: int
) -> float:
    """The mean derivative of a column over `width` s about t, or next to it within what was kept,
    which begins at `begin`."""
    last = min(recent[now].t, max(t + 0.5 * width, begin + width))
    first = max(begin, last - width)
    if not last > first:
        return 0.0
    change = _at(recent, now, last, column) - _at(recent, now, first, column)
    return change / (last - first)


@kernel(STAGE)
def look_back(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Write into a source whose clock is a state what happened since its measurement held, and add to
    the standard deviations what that bends. Of a clock of which it cannot be told the measurement is
    taken for one at the limit."""
    s, work = fixes.source[k], cursor.work[0]
    source = fixes.sources[s]
    if source.clock_state > 0:
        if not followed_back(belief, source, cursor):
            notify(cursor, Code.CLOCK_OFF, s, fixes.t[k], source.clock)
            flag_unreliable(cursor, fixes.t[k])
        for i in range(3):
            if source.kind == Kind.POSITION:
                work.stds[i] = math.hypot(work.stds[i], source.bent_position[i])
            elif source.kind == Kind.VELOCITY:
                work.stds[i] = math.hypot(work.stds[i], source.bent_velocity[i])
    return 0


@helper
def followed_back(belief: FilterState, source: SourceRow, cursor: Cursor) -> bool:
    """Write what happened since the measurement held; whether the clock is such that it can be
    told."""
    clock = belief.augmented[source.clock_state - STATES]
    age = max(-AHEAD, min(BEHIND, source.delay - clock))
    source.clock, source.age = clock, age
    _at_rest(belief, source, cursor.work[0].raw)
    _since(cursor.recent, cursor.state[0].latest, age, belief, source)
    _nonlinearity_std(cursor.recent, cursor.state[0].latest, age, belief, source)
    for i in range(3):
        source.bias_then[i] = belief.b_a[i]
    return age == source.delay - clock


@helper
def _at_rest(belief: FilterState, source: SourceRow, u: Array) -> None:
    """Gravity and Coriolis are what holds the velocity, the other way round; u (6) is written."""
    C = belief.C_nb
    stationary_increments(belief.lla, belief.v_n, C, 1.0, u)
    a, b, c = u[3], u[4], u[5]
    for i in range(3):
        source.gravity[i] = -(C[i, 0] * a + C[i, 1] * b + C[i, 2] * c)


@helper
def _begin(recent: Table[BodyMotion], now: int) -> float:
    """Time of the first row that was kept, s."""
    oldest = (now + 1) % ROWS
    return recent[oldest].t if recent[oldest].t < math.inf else recent[0].t


@helper
def _spread(belief: FilterState, source: SourceRow) -> float:
    """sqrt(3) standard deviations of the clock, s."""
    state = source.clock_state
    return math.sqrt(3.0 * max(belief.P[state, state], 0.0))


@helper
def _since(
    recent: Table[BodyMotion], now: int, age: float, belief: FilterState, source: SourceRow
) -> None:
    """From `force` to `turn` of the instant `age` s ago. Before the first row and behind the last
    the motion is taken to go on, by `off` s, as it was next to it."""
    t, C, begin = recent[now].t, belief.C_nb, _begin(recent, now)
    held = t - age
    s = min(max(held, begin), t)
    off, half = held - s, max(0.5 * WINDOW, _spread(belief, source))
    for j in range(3):
        source.force[j] = source.lag[j] = source.force_then[j] = 0.0
    for i in range(3):
        mean = _slope(recent, now, begin, held, 2 * half, S + i)
        gained = recent[now].sums[S + i] - _at(recent, now, s, S + i)
        way = recent[now].sums[X + i] - _at(recent, now, s, X + i)
        force = gained - mean * off
        lag = (t - s) * recent[now].sums[S + i] - way - gained * off + 0.5 * mean * off * off
        for j in range(3):
            source.force[j] += C[i, j] * force
            source.lag[j] += C[i, j] * lag
            source.force_then[j] += C[i, j] * mean
    _turned_since(recent, now, s, held, belief, source)


@helper
def _turned_since(
    recent: Table[BodyMotion],
    now: int,
    s: float,
    held: float,
    belief: FilterState,
    source: SourceRow,
) -> None:
    """`rate`, `spin` and `turn` of the instant `held`, to which s is the nearest that was kept."""
    begin, off, spread = _begin(recent, now), held - s, _spread(belief, source)
    half, angle = max(0.5 * WINDOW, spread), source.bent_position  # for a moment
    for i in range(3):
        w = _slope(recent, now, begin, held, max(STEP, 2 * spread), ANGLE + i)
        source.rate[i] = w - belief.omega[i]
        source.spin[i] = (
            _slope(recent, now, begin, held + half, STEP, ANGLE + i)
            - _slope(recent, now, begin, held - half, STEP, ANGLE + i)
        ) / (2 * half)
        angle[i] = recent[now].sums[ANGLE + i] - _at(recent, now, s, ANGLE + i) - w * off
    x, y, z = angle[0], angle[1], angle[2]
    for i in range(3):
        for j in range(3):
            source.turn[i, j] = 1.0 if i == j else 0.0
    rotate_left(-x, -y, -z, source.turn)


@helper
def _nonlinearity_std(
    recent: Table[BodyMotion], now: int, age: float, belief: FilterState, source: SourceRow
) -> None:
    """Standard deviations of what the observation of a position and of a velocity leaves out, which
    is linear in the errors of clock and lever arm, by the weights 1/6, 2/3, 1/6: with D the second
    difference of its motion, D^2/12, and the change of the rate times the error of the arm."""
    C, spread, arm, t = belief.C_nb, _spread(belief, source), 0.0, recent[now].t - age
    l, bend, turn = source.bent_position, source.bent_velocity, source.bent_position  # for a moment
    for i in range(3):
        l[i] = source.parameters[i]
        k = source.arm_state[i]
        if k > 0:
            l[i] += belief.augmented[k - STATES]
            arm += belief.P[k, k]
    x, y, z = l[0], l[1], l[2]
    begin, change = _begin(recent, now), 0.0
    for i in range(3):
        before = _slope(recent, now, begin, t - spread, STEP, ANGLE + i)
        after = _slope(recent, now, begin, t + spread, STEP, ANGLE + i)
        bend[i] = before - 2 * _slope(recent, now, begin, t, STEP, ANGLE + i) + after
        turn[i] = _second_difference(recent, now, t, spread, ANGLE + i)
        change += (after - before) * (after - before) / 12.0
    swung = rotate_vector(
        C, bend[1] * z - bend[2] * y, bend[2] * x - bend[0] * z, bend[0] * y - bend[1] * x
    )
    moved = rotate_vector(
        C, turn[1] * z - turn[2] * y, turn[2] * x - turn[0] * z, turn[0] * y - turn[1] * x
    )
    for i in range(3):
        D = _second_difference(recent, now, t, spread, X + i)
        D = D + source.gravity[i] * spread * spread + moved[i]
        source.bent_position[i] = abs(D) / math.sqrt(12.0)
        D = _second_difference(recent, now, t, spread, S + i) + swung[i]
        source.bent_velocity[i] = math.sqrt(D * D / 12.0 + change * arm)


@helper
def _second_difference(
    recent: Table[BodyMotion], now: int, t: float, step: float, column: int
) -> float:
    """That of a column about time t."""
    before, after = _at(recent, now, t - step, column), _at(recent, now, t + step, column)
    return before - 2 * _at(recent, now, t, column) + after


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a clock offset is a state."""
    return bool(cursor.recent.size)
