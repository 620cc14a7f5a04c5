"""The motion of the last seconds, kept so that a fix whose clock is estimated is compared with where
the belief was when it held.

A measurement stamped t holds at t + tau. It waits for `delay` seconds, so that with any probable tau
its instant s lies behind the belief, by the `age`. With S the integral of C f, and X that of S, from
s to now

    v(s) = v - (S - S(s)) - r age        p(s) = p - age v + [age S - (X - X(s))] + r age^2 / 2

where r is gravity less the Coriolis term. All is written into the source (SourceRow): the two
brackets, `force` and `lag`, and the mean force about s, in body axes now, so that they turn with its
errors. `force_then`, `rate` and `spin` are of lines through the motion about the instant, weighted
over the moments at which the measurement can have held, and `bent_position` and `bent_velocity` are
what these lines leave: statistical linearisation, Gelb (1974), section 6.3. A tangent would see more
than there is: where an antenna on a rough road swings once in 0.5 s, a clock 0.2 s late is far
outside its range.
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...compile.records import Table, rows
from ...mathematics.belief import STATES, FilterState
from ...mathematics.mechanization import stationary_increments
from ...mathematics.rotation import Three, axis, rotate_left
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
RANGE = 2.0
"""Weights of a line have this many standard deviations of the clock. They reach over all moments at
which a fix can have held, so that of a swing that repeats within them nothing is left in the line:
by its slope the clock would settle at another of the swings. Of 360 simulated cars on a rough road
19 did with weights of 1, 12 with the three points of Gauss and Hermite, and none with 2."""
SMOOTH = 0.05
"""s: standard deviation of the weights of slopes, at least: vibration of single samples would make
a derivative by time too large. The rate is that of the instant, since it moves the antenna."""


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
def _fit(
    n: float, u1: float, u2: float, y1: float, uy: float, y2: float
) -> tuple[float, float, float]:
    """(value at u = 0, slope, mean square of what is left) of a line y(u) by weighted sums of 1, u,
    u^2, y, u y and y^2."""
    if not n > 0:
        return 0.0, 0.0, 0.0
    u, y = u1 / n, y1 / n
    spread, slope = u2 / n - u * u, 0.0
    if spread > 1e-12:
        slope = (uy / n - u * y) / spread
    return y - slope * u, slope, max(y2 / n - y * y - slope * slope * spread, 0.0)


@helper
def _line(
    recent: Table[BodyMotion],
    now: int,
    held: float,
    given: float,
    column: int,
    gravity: float,
    by_rate: Three,
) -> tuple[float, float, float, float]:
    """A line through a velocity, its rows weighted by a normal density about the time `held` of the
    standard deviation `given` (s): value there, slope, mean square of what is left, and that of the
    way.

    The velocity is the change since `held` of a column (none where negative), plus `gravity` times
    the time since, plus `by_rate` times the angular rate.
    """
    width = max(given, recent[(now - 1) % ROWS].t - recent[(now - 2) % ROWS].t)
    first = _at(recent, now, held, column) if column >= 0 else 0.0
    n = u1 = u2 = v1 = uv = v2 = p1 = up = p2 = p = there = 0.0
    newer = now
    for _ in range(1, ROWS):
        older = (newer - 1) % ROWS
        dt = recent[newer].t - recent[older].t
        u = recent[newer].t - 0.5 * dt - held
        if not (dt > 0 and u > -3.0 * width):  # none was kept there yet, or too far
            break
        v = gravity * u + _mean_velocity(recent[newer], recent[older], dt, column, first, by_rate)
        way, w = p - 0.5 * v * dt, math.exp(-0.5 * (u / width) ** 2)
        n, u1, u2 = n + w, u1 + w * u, u2 + w * u * u
        v1, uv, v2 = v1 + w * v, uv + w * u * v, v2 + w * v * v
        p1, up, p2 = p1 + w * way, up + w * u * way, p2 + w * way * way
        if u + 0.5 * dt >= 0.0:
            there = way - u * v
        p, newer = p - v * dt, older
    value, slope, left = _fit(n, u1, u2, v1, uv, v2)
    way, _, off = _fit(n, u1, u2, p1, up, p2)
    return value, slope, left, off + (way - there) ** 2


@helper
def _mean_velocity(
    newer: BodyMotion,
    older: BodyMotion,
    dt: float,
    column: int,
    first: float,
    by_rate: Three,
) -> float:
    """Between two rows, dt apart: the column less what it was `first`, and by the rate."""
    new, old = newer.sums, older.sums
    v = 0.5 * (new[column] + old[column]) - first if column >= 0 else 0.0
    for i in range(3):
        v += by_rate[i] * (new[ANGLE + i] - old[ANGLE + i]) / dt
    return v


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
    if source.kind == Kind.POSITION or source.kind == Kind.VELOCITY:
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
def _range(belief: FilterState, source: SourceRow) -> float:
    """Standard deviation of the weights of lines, s."""
    state = source.clock_state
    return RANGE * math.sqrt(max(belief.P[state, state], 0.0))


@helper
def _since(
    recent: Table[BodyMotion], now: int, age: float, belief: FilterState, source: SourceRow
) -> None:
    """From `force` to `turn` of the instant `age` s ago. Before the first row and behind the last
    the motion is taken to go on, by `off` s, as it was next to it."""
    t, C, begin = recent[now].t, belief.C_nb, _begin(recent, now)
    held = t - age
    s = min(max(held, begin), t)
    off, width = held - s, max(SMOOTH, _range(belief, source))
    for j in range(3):
        source.force[j] = source.lag[j] = source.force_then[j] = 0.0
    for i in range(3):
        _, mean, _, _ = _line(recent, now, s, width, S + i, 0.0, (0.0, 0.0, 0.0))
        gained = recent[now].sums[S + i] - _at(recent, now, s, S + i)
        way = recent[now].sums[X + i] - _at(recent, now, s, X + i)
        force = gained - mean * off
        lag = (t - s) * recent[now].sums[S + i] - way - gained * off + 0.5 * mean * off * off
        for j in range(3):
            source.force[j] += C[i, j] * force
            source.lag[j] += C[i, j] * lag
            source.force_then[j] += C[i, j] * mean
    _turned_since(recent, now, s, off, belief, source)


@helper
def _turned_since(
    recent: Table[BodyMotion],
    now: int,
    s: float,
    off: float,
    belief: FilterState,
    source: SourceRow,
) -> None:
    """`rate`, `spin` and `turn` of the instant s, and of one `off` s later."""
    width, angle = _range(belief, source), source.bent_position  # for a moment
    for i in range(3):
        w, _, _, _ = _line(recent, now, s, width, -1, 0.0, axis(i))
        _, source.spin[i], _, _ = _line(recent, now, s, max(SMOOTH, width), -1, 0.0, axis(i))
        source.rate[i] = w - belief.omega[i]
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
    is linear in the errors of clock and lever arm: how far the motion of the antenna is from its
    line, and the change of the rate times the error of the arm."""
    C, l, arm = belief.C_nb, source.bent_position, 0.0  # for a moment
    for i in range(3):
        l[i] = source.parameters[i]
        k = source.arm_state[i]
        if k > 0:
            l[i] += belief.augmented[k - STATES]
            arm += belief.P[k, k]
    x, y, z = l[0], l[1], l[2]
    s = min(max(recent[now].t - age, _begin(recent, now)), recent[now].t)
    width, variance = _range(belief, source), belief.P[source.clock_state, source.clock_state]
    change = 0.0
    for i in range(3):
        _, spin, left, _ = _line(recent, now, s, width, -1, 0.0, axis(i))
        change += left + spin * spin * max(variance, 0.0)
    for i in range(3):
        swing = (  # C (w x l) by w
            C[i, 2] * y - C[i, 1] * z,
            C[i, 0] * z - C[i, 2] * x,
            C[i, 1] * x - C[i, 0] * y,
        )
        _, _, fast, far = _line(recent, now, s, width, S + i, source.gravity[i], swing)
        source.bent_position[i] = math.sqrt(far)
        source.bent_velocity[i] = math.sqrt(fast + change * arm)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a clock offset is a state."""
    return bool(cursor.recent.size)
