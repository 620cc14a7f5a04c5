"""Sources of height that contradict each other: which one is wrong, and what is left out of it.

With h the belief's height and e the innovation (down) of a height, the source measured h - e. Dead
reckoning by the INS, corrected by nothing but the vertical velocity of GNSS, gives h - G - B: G is the
sum of the corrections of h, B the integral of the innovation of vertical velocity. The level

    r = G + B - e

of a source is their difference. It is constant, apart from noise, while the source has a constant
error, whatever the filter believes. So of two levels that separate, the one that moves belongs to the
source that drifts or jumps. Two levels that have always been apart tell of two zeros, such as the
geoid and the ellipsoid: then the majority of sources decides, or else a position is preferred.

Only the height of a source is left out. The horizontal part of a position stays in use.
"""

import math

from ...typing import Array, Ints
from ..compile.jit import helper, matrix
from .contract import (
    ALTITUDE_KIND,
    CORRELATED_SD,
    MOST_STATES,
    POSITION_KIND,
    VELOCITY_KIND,
    Belief,
    Cursor,
    Fixes,
)
from .cursor import (
    CLIMB,
    CLIMB_AT,
    CLIMB_OFF,
    CLIMB_SD,
    CLIMB_SINCE,
    CORRECTED,
    FAILS,
    HEIGHT_AGAIN,
    HEIGHT_APART,
    LAST_USED,
    LEVEL,
    LEVEL_AT,
    LEVEL_SD,
    LEVEL_SINCE,
    MOVED,
    REJECTING,
    SUSPENDED,
    say,
)
from .heavy_tails import OTHER, WIDENED, observe_at
from .integrity import HEARD, doubt, forget

JACOBIAN = slice(WIDENED.stop, WIDENED.stop + 3 * MOST_STATES)  # of Cursor.work
RECENT, MEMORY = 3.0, 60.0  # s over which a level is averaged: the present one, and that before
PART = 0.25
"""Part of the difference of two levels that one of them must have moved by. Half of it is reached by
a steady drift, none by a constant difference."""
CLEARLY, LIKELY = 2.0, 1.5
"""Standard deviations that one level must have moved, and times as many as the other; the same where
the vertical velocity itself contradicts the belief, so that some level must have moved."""
SEPARATE, FAR = 3.5, 7.0
"""Standard deviations of both from which two levels contradict each other, and from which that is so
without rejected fixes too."""
AGREE = 0.25  # part of the gate inside which a height that was left out agrees again
HORIZONTAL_GATE = 13.816  # chi-square of two rows, 0.1 %
NOBODY = -1


@helper
def row_of_height(kind: int) -> int:
    """The row of y in which a source measures height or vertical velocity, -1 where it has none."""
    if kind == POSITION_KIND or kind == VELOCITY_KIND:
        return 2
    return 0 if kind == ALTITUDE_KIND else -1


@helper
def is_height(kind: int) -> bool:
    """Whether a source measures the height above the ellipsoid."""
    return kind == POSITION_KIND or kind == ALTITUDE_KIND


@helper
def follow_level(observers: Ints, belief: Belief, fixes: Fixes, k: int, cursor: Cursor) -> bool:
    """Take fix `k` into the level of its source, or into the vertical velocity of all. Returns
    whether its height is to be left out."""
    s, t = fixes.source[k], fixes.t[k]
    kind, tests, now, row = fixes.kind[s], cursor.tests[s], cursor.now, row_of_height(fixes.kind[s])
    if row < 0:
        return False
    observe_fix(observers, belief, fixes, k, cursor)
    e = cursor.work[OTHER][row]
    if math.isnan(e):
        return False
    if kind == VELOCITY_KIND:
        if tests[SUSPENDED] == 0:
            _climb(e, fixes.sd[k, row], t, cursor)
        return tests[SUSPENDED] > 0
    r = now[CORRECTED] + now[CLIMB] - e
    elapsed, since = t - tests[LEVEL_AT], max(tests[LEVEL_SINCE], now[CLIMB_SINCE])
    tests[LEVEL_AT] = t
    white = fixes.sd[k, row] * math.sqrt(min(max(elapsed, 1.0) / RECENT, 1.0))
    tests[LEVEL_SD] = math.hypot(white, fixes.parameters[s, CORRELATED_SD + row])
    if elapsed > HEARD or now[CLIMB_SINCE] > t - elapsed:
        tests[LEVEL], tests[MOVED], tests[LEVEL_SINCE] = r, 0.0, t
    else:
        age, before = t - since, tests[LEVEL] - tests[MOVED]
        before += elapsed / (age if age < RECENT else MEMORY) * (r - before)
        tests[LEVEL] += elapsed / min(age, RECENT) * (r - tests[LEVEL])
        tests[MOVED] = tests[LEVEL] - before
    if tests[SUSPENDED] > 0 and _agrees(belief, fixes, k, row, cursor):
        tests[SUSPENDED] = 0.0
        say(cursor, HEIGHT_AGAIN, s, t, 0.0)
    elif tests[SUSPENDED] > 0:
        _tell(s, t, cursor)
    return tests[SUSPENDED] > 0


@helper
def observe_fix(observers: Ints, belief: Belief, fixes: Fixes, k: int, cursor: Cursor) -> None:
    """The innovation of fix `k` as its kind observes it, without the estimates of errors that last,
    in work[OTHER], and its H (3, n) in work[JACOBIAN]."""
    s, e, n = fixes.source[k], cursor.work[OTHER][0:3], belief.P.shape[0]
    H = matrix(cursor.work, JACOBIAN.start, 3, n)
    for i in range(3):
        e[i] = math.nan
        for j in range(n):
            H[i, j] = 0.0
    observe_at(observers[fixes.kind[s]])(belief, fixes.y[k], fixes.parameters[s], e, H)


@helper
def _climb(e: float, sd: float, t: float, cursor: Cursor) -> None:
    """Integrate the innovation of a vertical velocity; after a silence the levels begin anew."""
    now = cursor.now
    elapsed = t - now[CLIMB_AT]
    if elapsed > HEARD:
        now[CLIMB_SINCE] = t
    else:
        now[CLIMB] += 0.5 * (e + now[CLIMB_OFF]) * elapsed
    now[CLIMB_AT], now[CLIMB_OFF], now[CLIMB_SD] = t, e, sd


@helper
def _agrees(belief: Belief, fixes: Fixes, k: int, row: int, cursor: Cursor) -> bool:
    """Whether the level of a source is inside its gate again, while another tells the height."""
    s, t, sd = fixes.source[k], fixes.t[k], fixes.sd[k, row]
    off = cursor.now[CORRECTED] + cursor.now[CLIMB] - cursor.tests[s, LEVEL]
    return farthest(fixes, s, t, cursor) >= 0 and off * off <= AGREE * fixes.gate[s] * (
        sd * sd + belief.P[2, 2]
    )


@helper
def farthest(fixes: Fixes, s: int, t: float, cursor: Cursor) -> int:
    """Of the other sources whose height was used lately the one whose level is farthest from that of
    source `s`, or NOBODY."""
    tests, found, most = cursor.tests, NOBODY, -1.0
    for o in range(tests.shape[0]):
        if o != s and is_height(fixes.kind[o]) and tests[o, SUSPENDED] == 0:
            off = abs(tests[o, LEVEL] - tests[s, LEVEL])
            if t - tests[o, LAST_USED] <= HEARD and t - tests[o, LEVEL_AT] <= HEARD and off > most:
                found, most = o, off
    return found


@helper
def height_alone(kind: int, innovation: Array) -> bool:
    """Whether a fix that is beyond its gate is so for its height alone."""
    if kind == ALTITUDE_KIND:
        return True
    if kind != POSITION_KIND and kind != VELOCITY_KIND:
        return False
    north, east = innovation[3], innovation[4]
    return not north * north + east * east > HORIZONTAL_GATE


@helper
def leave_out_pulling(belief: Belief, fixes: Fixes, s: int, t: float, cursor: Cursor) -> None:
    """Leave out the height that pulls the belief away from source `s`, whose innovations have long
    been off on average, where the data tell which it is or the two are FAR apart."""
    fails, row = cursor.tests[s, FAILS], row_of_height(fixes.kind[s])
    if row >= 0 and fails[row] + fails[3 + row] > 0:
        wrong, right, told, apart = _contradiction(fixes, s, t, cursor)
        if wrong >= 0 and wrong != s and (told or apart > FAR):
            _leave_out(wrong, right, told, t, cursor)
            _make_room(belief.P, right, t, cursor)


@helper
def leave_out_wrong(belief: Belief, fixes: Fixes, s: int, t: float, cursor: Cursor) -> bool:
    """Leave out the wrong one of the height of source `s`, whose fixes have long been rejected for
    their height alone, and that in use. Returns whether that is `s`."""
    wrong, right, told, _ = _contradiction(fixes, s, t, cursor)
    if wrong >= 0:
        _leave_out(wrong, right, told, t, cursor)
        if wrong != s:
            _make_room(belief.P, right, t, cursor)
    return wrong == s


@helper
def _contradiction(fixes: Fixes, s: int, t: float, cursor: Cursor) -> tuple[int, int, bool, float]:
    """Of the height of source `s` and that of another in use that contradict each other, or of two
    in use where `s` measures a velocity: the wrong one, the other, whether the data tell so, and by
    how many standard deviations they differ. NOBODY where there is no contradiction."""
    tests, velocity = cursor.tests, fixes.kind[s] == VELOCITY_KIND
    one = _mover(fixes, t, cursor) if velocity else s
    other = NOBODY if one < 0 else farthest(fixes, one, t, cursor)
    if other < 0:
        return NOBODY, NOBODY, False, 0.0
    apart = abs(tests[one, LEVEL] - tests[other, LEVEL])
    apart /= math.hypot(tests[one, LEVEL_SD], tests[other, LEVEL_SD])
    better = _compared(fixes, one, other, LIKELY if velocity else CLEARLY, t, cursor)
    told = better != 0
    if not told:  # a position is preferred, then what is in use
        only_one = fixes.kind[one] == POSITION_KIND and fixes.kind[other] != POSITION_KIND
        better = 1 if only_one else -1
    wrong, right = (other, one) if better > 0 else (one, other)
    if not (apart > SEPARATE and fixes.gate[wrong] < math.inf):
        return NOBODY, NOBODY, False, 0.0
    return wrong, right, told, apart


@helper
def _leave_out(wrong: int, right: int, told: bool, t: float, cursor: Cursor) -> None:
    """Leave out the height of a source that that of another contradicts."""
    tests = cursor.tests
    which = 2 * (wrong * tests.shape[0] + right) + told
    tests[wrong, SUSPENDED], tests[wrong, REJECTING] = 1.0 + which, 0.0
    forget(tests[wrong])
    doubt(cursor, t)
    _tell(wrong, t, cursor)


@helper
def _tell(wrong: int, t: float, cursor: Cursor) -> None:
    """Say how far the height of a source that is left out is from that of the one it contradicts."""
    tests, which = cursor.tests, int(cursor.tests[wrong, SUSPENDED]) - 1
    right = which // 2 % tests.shape[0]
    if t - tests[right, LEVEL_AT] <= HEARD:
        off = tests[wrong, LEVEL] - tests[right, LEVEL]
        say(cursor, HEIGHT_APART, which, t, off)


@helper
def _make_room(P: Array, right: int, t: float, cursor: Cursor) -> None:
    """Let height and vertical velocity go back to where source `right` and GNSS see them: what has
    pulled them away bent nothing else yet."""
    now = cursor.now
    off = now[CORRECTED] + now[CLIMB] - cursor.tests[right, LEVEL]
    for s in range(cursor.tests.shape[0]):
        forget(cursor.tests[s])
    P[2, 2] += off * off
    if t - now[CLIMB_AT] <= HEARD:
        P[5, 5] += now[CLIMB_OFF] * now[CLIMB_OFF] + now[CLIMB_SD] * now[CLIMB_SD]


@helper
def _compared(fixes: Fixes, s: int, o: int, clearly: float, t: float, cursor: Cursor) -> int:
    """1 where the height of source `s` is better than that of `o`, -1 where it is worse, 0 where
    nothing tells: by what moved against the vertical velocity, then by what third sources say."""
    tests = cursor.tests
    apart = abs(tests[s, LEVEL] - tests[o, LEVEL])
    own, its, now = abs(tests[s, MOVED]), abs(tests[o, MOVED]), cursor.now
    if t - now[CLIMB_AT] <= HEARD and max(own, its) > PART * apart:
        since = max(tests[s, LEVEL_SINCE], tests[o, LEVEL_SINCE], now[CLIMB_SINCE])
        walked = now[CLIMB_SD] * math.sqrt(min(t - since, 0.5 * MEMORY))  # by white noise at 1 Hz
        own /= math.hypot(math.sqrt(2) * tests[s, LEVEL_SD], walked)
        its /= math.hypot(math.sqrt(2) * tests[o, LEVEL_SD], walked)
        if max(own, its) > clearly * max(min(own, its), 1.0):
            return 1 if its > own else -1
    votes = 0
    for k in range(tests.shape[0]):
        if k != s and k != o and is_height(fixes.kind[k]) and t - tests[k, LEVEL_AT] <= HEARD:
            mine = abs(tests[k, LEVEL] - tests[s, LEVEL])
            votes += 1 if mine < abs(tests[k, LEVEL] - tests[o, LEVEL]) else -1
    return min(max(votes, -1), 1)


@helper
def _mover(fixes: Fixes, t: float, cursor: Cursor) -> int:
    """Of the sources whose height was used lately that whose level moved most, or NOBODY."""
    tests, found = cursor.tests, NOBODY
    for k in range(tests.shape[0]):
        if is_height(fixes.kind[k]) and tests[k, SUSPENDED] == 0:
            heard = t - max(tests[k, LEVEL_AT], tests[k, LAST_USED]) <= HEARD
            if heard and (found < 0 or abs(tests[k, MOVED]) > abs(tests[found, MOVED])):
                found = k
    return found
