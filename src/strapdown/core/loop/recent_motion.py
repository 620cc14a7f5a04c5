"""The motion of the last seconds, kept so that a fix whose clock is estimated is compared with where
the belief was when it held.

A fix stamped t holds at t + tau. It waits DELAY seconds, so that with any probable tau its instant
s lies behind the belief, by AGE. With S the integral of C f, and X that of S, from s to now

    v(s) = v - (S - S(s)) - r AGE        p(s) = p - AGE v + [AGE S - (X - X(s))] + r AGE^2 / 2

where r is gravity less the Coriolis term. All is written into the parameters of the source: the two
brackets FORCE and LAG, and the mean force MEAN about s, in body axes now, so that they turn with
its errors; REST, r in n; RATE, the angular rate about s less the present one; TURN (3, 3), which
takes vectors from body axes at s to body axes now. BIAS_AT is the accelerometer bias that the forces
are without; SPIN the angular acceleration about s. MEAN, RATE and SPIN are differences over one
standard deviation of the clock to both sides, and BEND is what they leave out: statistical
linearisation, Gelb (1974), section 6.3.
"""

import math

import numpy as np

from ...typing import Array
from ..compile.jit import helper, matrix
from ..mathematics.mechanization import stationary_increments
from ..mathematics.rotation import rotate_left, turned
from .contract import (
    AGE,
    ARM_STATE,
    BEND,
    BIAS_AT,
    CLOCK_AT,
    CLOCK_STATE,
    DELAY,
    FORCE,
    LAG,
    MEAN,
    RATE,
    REST,
    SPIN,
    STATES,
    TURN,
    Belief,
    Cursor,
)
from .cursor import LATEST

T, S, X, ANGLE, WIDTH = 0, 1, 4, 7, 10
"""Columns of Cursor.recent: time (s) and the integrals, of force (m/s, n), of that (m) and of the
angular rate (rad, body)."""
ROWS, STEP = 256, 0.0099  # kept at least so many s apart
BEHIND, AHEAD = 2.5, 1.0
"""s before the belief and after it at which a fix can have held: that much is kept, and so far the
motion may be taken to go on."""
WINDOW = 0.2
"""s about the instant of a fix over which the force is averaged: vibration of single samples would
make a derivative by time too large. The rate is that of the instant, since it moves the antenna."""


def new_recent(t: float, needed: bool) -> Array:
    """Cursor.recent at time t, whose row 1 is now; without rows where nobody looks back."""
    recent = np.zeros((ROWS if needed else 0, WIDTH))
    recent[:, T] = np.inf
    recent[:2, T] = t
    return recent


@helper
def keep(cursor: Cursor, belief: Belief, dt: float) -> None:
    """Add the bias-free rate and force of the last prediction, which took dt seconds."""
    recent, now = cursor.recent, cursor.at[LATEST]
    if recent[now, T] - recent[(now - 1) % ROWS, T] >= STEP:
        following = (now + 1) % ROWS
        for i in range(WIDTH):
            recent[following, i] = recent[now, i]
        cursor.at[LATEST] = now = following
    row, w, f, C = recent[now], belief.omega, belief.f, belief.C
    # force in the body at the end: half a turn back
    h = 0.5 * dt
    a = f[0] - h * (w[1] * f[2] - w[2] * f[1])
    b = f[1] - h * (w[2] * f[0] - w[0] * f[2])
    c = f[2] - h * (w[0] * f[1] - w[1] * f[0])
    row[T] += dt
    for i in range(3):
        change = dt * (C[i, 0] * a + C[i, 1] * b + C[i, 2] * c)
        row[X + i] += dt * (row[S + i] + 0.5 * change)
        row[S + i] += change
        row[ANGLE + i] += dt * w[i]


@helper
def _at(recent: Array, now: int, t: float, column: int) -> float:
    """The value of a column at time t, not before the first row: between rows S and ANGLE are
    linear."""
    newer = older = now
    for k in range(1, ROWS):
        candidate = (now - k) % ROWS
        if not recent[candidate, T] < recent[older, T]:  # none was kept there yet
            break
        newer, older = older, candidate
        if recent[older, T] <= t:
            break
    span = recent[newer, T] - recent[older, T]
    if not span > 0:
        return recent[newer, column]
    share = (t - recent[older, T]) / span
    value = recent[older, column] + share * (recent[newer, column] - recent[older, column])
    if X <= column < X + 3:  # bent by the force of the row
        gained = recent[newer, column - X + S] - recent[older, column - X + S]
        value -= 0.5 * share * (1.0 - share) * span * gained
    return value


@helper
def _slope(recent: Array, now: int, begin: float, t: float, width: float, column: int) -> float:
    """The mean derivative of a column over `width` s about t, or next to it within what was kept,
    which begins at `begin`."""
    last = min(recent[now, T], max(t + 0.5 * width, begin + width))
    first = max(begin, last - width)
    if not last > first:
        return 0.0
    change = _at(recent, now, last, column) - _at(recent, now, first, column)
    return change / (last - first)


@helper
def look_back(cursor: Cursor, belief: Belief, parameters: Array) -> bool:
    """Write what happened since the fix of a source whose clock is a state held; whether the clock
    is such that it can be told, else the fix is taken for one at the limit."""
    clock = belief.extra_states[int(parameters[CLOCK_STATE]) - STATES]
    age = max(-AHEAD, min(BEHIND, parameters[DELAY] - clock))
    parameters[CLOCK_AT], parameters[AGE] = clock, age
    _at_rest(belief, parameters)
    _since(cursor.recent, cursor.at[LATEST], age, belief, parameters)
    _bent(cursor.recent, cursor.at[LATEST], age, belief, parameters)
    for i in range(3):
        parameters[BIAS_AT + i] = belief.ba[i]
    return age == parameters[DELAY] - clock


@helper
def _at_rest(belief: Belief, parameters: Array) -> None:
    """REST: gravity and Coriolis are what holds the velocity, the other way round."""
    C = belief.C
    stationary_increments(belief.lla, belief.v, C, 1.0, parameters[FORCE : FORCE + 6])
    a, b, c = parameters[FORCE + 3], parameters[FORCE + 4], parameters[FORCE + 5]
    for i in range(3):
        parameters[REST + i] = -(C[i, 0] * a + C[i, 1] * b + C[i, 2] * c)


@helper
def _since(recent: Array, now: int, age: float, belief: Belief, parameters: Array) -> None:
    """FORCE to TURN of the instant `age` s ago. Before the first row and behind the last the motion
    is taken to go on, by `off` s, as it was next to it."""
    t, C, oldest = recent[now, T], belief.C, (now + 1) % ROWS
    begin = recent[oldest, T] if recent[oldest, T] < math.inf else recent[0, T]
    held = t - age
    s = min(max(held, begin), t)
    off = held - s
    angle = parameters[TURN : TURN + 3]  # for a moment
    state = int(parameters[CLOCK_STATE])
    sigma = math.sqrt(max(belief.P[state, state], 0.0))
    half = max(0.5 * WINDOW, sigma)
    for j in range(3):
        parameters[FORCE + j] = parameters[LAG + j] = parameters[MEAN + j] = 0.0
    for i in range(3):
        mean = _slope(recent, now, begin, held, 2 * half, S + i)
        gained = recent[now, S + i] - _at(recent, now, s, S + i)
        way = recent[now, X + i] - _at(recent, now, s, X + i)
        force = gained - mean * off
        lag = (t - s) * recent[now, S + i] - way - gained * off + 0.5 * mean * off * off
        for j in range(3):
            parameters[FORCE + j] += C[i, j] * force
            parameters[LAG + j] += C[i, j] * lag
            parameters[MEAN + j] += C[i, j] * mean
        w = _slope(recent, now, begin, held, max(STEP, 2 * sigma), ANGLE + i)
        parameters[RATE + i] = w - belief.omega[i]
        parameters[SPIN + i] = (
            _slope(recent, now, begin, held + half, STEP, ANGLE + i)
            - _slope(recent, now, begin, held - half, STEP, ANGLE + i)
        ) / (2 * half)
        angle[i] = recent[now, ANGLE + i] - _at(recent, now, s, ANGLE + i) - w * off
    x, y, z = angle[0], angle[1], angle[2]
    turn = matrix(parameters, TURN, 3, 3)
    for i in range(3):
        for j in range(3):
            turn[i, j] = 1.0 if i == j else 0.0
    rotate_left(-x, -y, -z, turn)


@helper
def _bent(recent: Array, now: int, age: float, belief: Belief, parameters: Array) -> None:
    """BEND: standard deviations of what the observation of a position (3) and of a velocity (3)
    leaves out, which is linear in the errors of clock and lever arm: with D the second difference
    of its motion over one standard deviation of the clock, D^2/4 times the mean fourth power of a
    normal error, and the change of the rate in that time times the error of the arm."""
    state, C, P = int(parameters[CLOCK_STATE]), belief.C, belief.P
    sigma, arm, t = math.sqrt(max(P[state, state], 0.0)), 0.0, recent[now, T] - age
    oldest = (now + 1) % ROWS
    begin = recent[oldest, T] if recent[oldest, T] < math.inf else recent[0, T]
    later, earlier = t + sigma, t - sigma
    l = parameters[BEND : BEND + 3]  # for a moment
    for i in range(3):
        l[i] = parameters[i]
        k = int(parameters[ARM_STATE + i])
        if k > 0:
            l[i] += belief.extra_states[k - STATES]
            arm += P[k, k]
    x, y, z = l[0], l[1], l[2]
    bend, turn = parameters[BEND + 3 : BEND + 6], parameters[BEND : BEND + 3]
    change = 0.0
    for i in range(3):
        before = _slope(recent, now, begin, earlier, STEP, ANGLE + i)
        after = _slope(recent, now, begin, later, STEP, ANGLE + i)
        bend[i] = before - 2 * _slope(recent, now, begin, t, STEP, ANGLE + i) + after
        turn[i] = (
            _at(recent, now, earlier, ANGLE + i)
            - 2 * _at(recent, now, t, ANGLE + i)
            + _at(recent, now, later, ANGLE + i)
        )
        change += 0.25 * (after - before) * (after - before)
    swung = turned(
        C, bend[1] * z - bend[2] * y, bend[2] * x - bend[0] * z, bend[0] * y - bend[1] * x
    )
    moved = turned(
        C, turn[1] * z - turn[2] * y, turn[2] * x - turn[0] * z, turn[0] * y - turn[1] * x
    )
    for i in range(3):
        D = (
            _at(recent, now, earlier, X + i)
            - 2 * _at(recent, now, t, X + i)
            + _at(recent, now, later, X + i)
            + parameters[REST + i] * sigma * sigma
            + moved[i]
        )
        parameters[BEND + i] = math.sqrt(0.75) * abs(D)
        D = (
            _at(recent, now, earlier, S + i)
            - 2 * _at(recent, now, t, S + i)
            + _at(recent, now, later, S + i)
            + swung[i]
        )
        parameters[BEND + 3 + i] = math.sqrt(0.75 * D * D + change * arm)
