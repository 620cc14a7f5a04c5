"""The motion of the last seconds, kept so that a fix whose clock is estimated is compared with where
the belief was when it held.

A fix stamped t holds at t + tau. It waits DELAY seconds, so that with any probable tau its instant
s lies behind the belief, by AGE. With S the integral of C f, and X that of S, from s to now

    v(s) = v - (S - S(s)) - r AGE        p(s) = p - AGE v + [AGE S - (X - X(s))] + r AGE^2 / 2

where r is gravity less the Coriolis term. All is written into the parameters of the source: the two
brackets FORCE and LAG, and the mean force MEAN about s, in body axes now, so that they turn with
its errors; REST, r in n; RATE, the angular rate about s less the present one; TURN (3, 3), which
takes vectors from body axes at s to body axes now.
"""

import numpy as np

from ..typing import Array
from .contract import (
    AGE,
    CLOCK_AT,
    CLOCK_STATE,
    DELAY,
    FORCE,
    LAG,
    MEAN,
    RATE,
    REST,
    STATES,
    TURN,
    Belief,
    Cursor,
)
from .cursor import LATEST
from .jit import helper
from .mechanization import stationary_increments

T, S, X, ANGLE, WIDTH = 0, 1, 4, 7, 10
"""Columns of Cursor.recent: time (s) and the integrals, of force (m/s, n), of that (m) and of the
angular rate (rad, body)."""
ROWS, STEP = 256, 0.0099  # kept at least so many s apart
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
    """The value of a column at time t, linear between rows and before the first."""
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
    return recent[older, column] + share * (recent[newer, column] - recent[older, column])


@helper
def look_back(cursor: Cursor, belief: Belief, parameters: Array) -> None:
    """Write what happened since the fix of a source whose clock is a state held."""
    recent, now, C = cursor.recent, cursor.at[LATEST], belief.C
    clock = belief.extra_states[int(parameters[CLOCK_STATE]) - STATES]
    age = parameters[DELAY] - clock
    parameters[CLOCK_AT], parameters[AGE] = clock, age
    # gravity and Coriolis: what holds the velocity, the other way round
    stationary_increments(belief.lla, belief.v, C, 1.0, parameters[FORCE : FORCE + 6])
    a, b, c = parameters[FORCE + 3], parameters[FORCE + 4], parameters[FORCE + 5]
    for i in range(3):
        parameters[REST + i] = -(C[i, 0] * a + C[i, 1] * b + C[i, 2] * c)
    t = recent[now, T]
    last = min(t, t - age + 0.5 * WINDOW)
    first, end = last - WINDOW, min(t, t - age + 0.5 * STEP)
    s = min(t - age, t)  # what has not happened yet goes on as the last did
    beyond = t - age - s
    turn = parameters[TURN : TURN + 3]  # for a moment the rotation vector
    for i in range(3):
        mean = (_at(recent, now, last, S + i) - _at(recent, now, first, S + i)) / WINDOW
        force = recent[now, S + i] - _at(recent, now, s, S + i) - mean * beyond
        lag = (
            (t - s) * recent[now, S + i]
            - (recent[now, X + i] - _at(recent, now, s, X + i))
            + 0.5 * mean * beyond * beyond
        )
        for j in range(3):
            if i == 0:
                parameters[FORCE + j] = parameters[LAG + j] = parameters[MEAN + j] = 0.0
            parameters[FORCE + j] += C[i, j] * force
            parameters[LAG + j] += C[i, j] * lag
            parameters[MEAN + j] += C[i, j] * mean
        w = (_at(recent, now, end, ANGLE + i) - _at(recent, now, end - STEP, ANGLE + i)) / STEP
        parameters[RATE + i] = w - belief.omega[i]
        turn[i] = recent[now, ANGLE + i] - _at(recent, now, s, ANGLE + i) - w * beyond
    x, y, z = turn[0], turn[1], turn[2]
    xx, yy, zz = 0.5 * x * x, 0.5 * y * y, 0.5 * z * z
    turn[0] = 1.0 - yy - zz
    parameters[TURN + 1], parameters[TURN + 3] = 0.5 * x * y + z, 0.5 * x * y - z
    parameters[TURN + 2], parameters[TURN + 6] = 0.5 * x * z - y, 0.5 * x * z + y
    parameters[TURN + 5], parameters[TURN + 7] = 0.5 * y * z + x, 0.5 * y * z - x
    parameters[TURN + 4], parameters[TURN + 8] = 1.0 - xx - zz, 1.0 - xx - yy
