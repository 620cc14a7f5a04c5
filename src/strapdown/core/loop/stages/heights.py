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
from typing import Any

from ....typing import Array
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.source import Kind
from ..cursor import Cursor
from ..integrity import HEARD, flag_unreliable, forget
from ..kernels import STAGE, Kernels
from ..log import Code, notify
from ..observation import observed_alone
from ..reacquisition import is_height, row_of_height
from ..tables import Fixes

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
NOBODY = -1


@kernel(STAGE)
def compare_heights(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Withhold the height of measurement k from the filter while it is left out, else leave out the
    one that pulls the belief away from it."""
    work, s = cursor.work[0], fixes.source[k]
    if work.believable:
        if _follow_level(kernels, belief, fixes, k, cursor):
            work.withheld = row_of_height(fixes.sources[s].kind)
            work.height = fixes.y[k, work.withheld]
            fixes.y[k, work.withheld] = math.nan
        else:
            _exclude_pulling(belief, fixes, s, fixes.t[k], cursor)
    return 0


@kernel(STAGE)
def exclude_contradicting(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Leave out the wrong one of the height of measurement k, whose source has long been rejected for
    its height alone, and that in use. Returns whether that is its own."""
    s, t = fixes.source[k], fixes.t[k]
    wrong, right, told, _ = _contradiction(fixes, s, t, cursor)
    if wrong >= 0:
        _exclude(wrong, right, told, t, cursor)
        if wrong != s:
            _make_room(belief.P, right, t, cursor)
    return 1 if wrong == s else 0


@helper
def _follow_level(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor
) -> bool:
    """Take fix `k` into the level of its source, or into the vertical velocity of all. Returns
    whether its height is to be left out."""
    s, t = fixes.source[k], fixes.t[k]
    kind, books, state = fixes.sources[s].kind, cursor.books[s], cursor.state[0]
    row = row_of_height(kind)
    if row < 0:
        return False
    observed_alone(kernels, belief, fixes, k, cursor)
    e = cursor.work[0].other[row]
    if math.isnan(e):
        return False
    if kind == Kind.VELOCITY:
        if books.suspended == 0:
            _climb(e, fixes.std[k, row], t, cursor)
        return books.suspended > 0
    r = state.corrected + state.climb - e
    elapsed, since = t - books.level_at, max(books.level_since, state.climb_since)
    books.level_at = t
    white = fixes.std[k, row] * math.sqrt(min(max(elapsed, 1.0) / RECENT, 1.0))
    books.level_std = math.hypot(white, fixes.sources[s].correlated_std[row])
    if elapsed > HEARD or state.climb_since > t - elapsed:
        books.level, books.moved, books.level_since = r, 0.0, t
    else:
        age, before = t - since, books.level - books.moved
        before += elapsed / (age if age < RECENT else MEMORY) * (r - before)
        books.level += elapsed / min(age, RECENT) * (r - books.level)
        books.moved = books.level - before
    if books.suspended > 0 and _agrees(belief, fixes, k, row, cursor):
        books.suspended = 0
        notify(cursor, Code.HEIGHT_AGAIN, s, t, 0.0)
    elif books.suspended > 0:
        _tell(s, t, cursor)
    return books.suspended > 0


@helper
def _climb(e: float, std: float, t: float, cursor: Cursor) -> None:
    """Integrate the innovation of a vertical velocity; after a silence the levels begin anew."""
    state = cursor.state[0]
    elapsed = t - state.climb_at
    if elapsed > HEARD:
        state.climb_since = t
    else:
        state.climb += 0.5 * (e + state.climb_off) * elapsed
    state.climb_at, state.climb_off, state.climb_std = t, e, std


@helper
def _agrees(belief: FilterState, fixes: Fixes, k: int, row: int, cursor: Cursor) -> bool:
    """True where the level of a source is inside its gate again, while another source measures the
    height."""
    s, t, std = fixes.source[k], fixes.t[k], fixes.std[k, row]
    off = cursor.state[0].corrected + cursor.state[0].climb - cursor.books[s].level
    return _farthest(fixes, s, t, cursor) >= 0 and off * off <= AGREE * fixes.sources[s].gate * (
        std * std + belief.P[2, 2]
    )


@helper
def _farthest(fixes: Fixes, s: int, t: float, cursor: Cursor) -> int:
    """Return the other source, of recently used height, whose level is farthest from that of source
    `s`, or NOBODY."""
    books, found, most = cursor.books, NOBODY, -1.0
    for o in range(books.size):
        if o != s and is_height(fixes.sources[o].kind) and books[o].suspended == 0:
            off = abs(books[o].level - books[s].level)
            if t - books[o].last_used <= HEARD and t - books[o].level_at <= HEARD and off > most:
                found, most = o, off
    return found


@helper
def _exclude_pulling(belief: FilterState, fixes: Fixes, s: int, t: float, cursor: Cursor) -> None:
    """Leave out the height that pulls the belief away from source `s`, whose innovations have long
    been off on average, where the data tell which it is or the two are FAR apart."""
    fails, row = cursor.books[s].fails, row_of_height(fixes.sources[s].kind)
    if row >= 0 and fails[row] + fails[3 + row] > 0:
        wrong, right, told, apart = _contradiction(fixes, s, t, cursor)
        if wrong >= 0 and wrong != s and (told or apart > FAR):
            _exclude(wrong, right, told, t, cursor)
            _make_room(belief.P, right, t, cursor)


@helper
def _contradiction(fixes: Fixes, s: int, t: float, cursor: Cursor) -> tuple[int, int, bool, float]:
    """Find two heights in use that contradict each other, one of them that of source `s` unless `s`
    measures a velocity. Returns the wrong source, the other, whether the data decide which is
    wrong, and by how many standard deviations they differ; NOBODY where there is no
    contradiction."""
    books, velocity = cursor.books, fixes.sources[s].kind == Kind.VELOCITY
    one = _mover(fixes, t, cursor) if velocity else s
    other = NOBODY if one < 0 else _farthest(fixes, one, t, cursor)
    if other < 0:
        return NOBODY, NOBODY, False, 0.0
    apart = abs(books[one].level - books[other].level)
    apart /= math.hypot(books[one].level_std, books[other].level_std)
    better = _compare_heights(fixes, one, other, LIKELY if velocity else CLEARLY, t, cursor)
    told = better != 0
    if not told:  # a position is preferred, then what is in use
        only_one = (
            fixes.sources[one].kind == Kind.POSITION and fixes.sources[other].kind != Kind.POSITION
        )
        better = 1 if only_one else -1
    wrong, right = (other, one) if better > 0 else (one, other)
    if not (apart > SEPARATE and fixes.sources[wrong].gate < math.inf):
        return NOBODY, NOBODY, False, 0.0
    return wrong, right, told, apart


@helper
def _exclude(wrong: int, right: int, told: bool, t: float, cursor: Cursor) -> None:
    """Leave out the height of a source that that of another contradicts."""
    books = cursor.books
    which = 2 * (wrong * books.size + right) + told
    books[wrong].suspended, books[wrong].rejecting = 1 + which, 0
    forget(books[wrong])
    flag_unreliable(cursor, t)
    _tell(wrong, t, cursor)


@helper
def _tell(wrong: int, t: float, cursor: Cursor) -> None:
    """Say how far the height of a source that is left out is from that of the one it contradicts."""
    books, which = cursor.books, cursor.books[wrong].suspended - 1
    right = which // 2 % books.size
    if t - books[right].level_at <= HEARD:
        off = books[wrong].level - books[right].level
        notify(cursor, Code.HEIGHT_APART, which, t, off)


@helper
def _make_room(P: Array, right: int, t: float, cursor: Cursor) -> None:
    """Let height and vertical velocity go back to where source `right` and GNSS see them: what has
    pulled them away bent nothing else yet."""
    state = cursor.state[0]
    off = state.corrected + state.climb - cursor.books[right].level
    for s in range(cursor.books.size):
        forget(cursor.books[s])
    P[2, 2] += off * off
    if t - state.climb_at <= HEARD:
        P[5, 5] += state.climb_off * state.climb_off + state.climb_std * state.climb_std


@helper
def _compare_heights(fixes: Fixes, s: int, o: int, clearly: float, t: float, cursor: Cursor) -> int:
    """1 where the height of source `s` is better than that of `o`, -1 where it is worse, 0 where
    nothing tells: by what moved against the vertical velocity, then by what third sources say."""
    books = cursor.books
    apart = abs(books[s].level - books[o].level)
    own, its, state = abs(books[s].moved), abs(books[o].moved), cursor.state[0]
    if t - state.climb_at <= HEARD and max(own, its) > PART * apart:
        since = max(books[s].level_since, books[o].level_since, state.climb_since)
        walked = state.climb_std * math.sqrt(min(t - since, 0.5 * MEMORY))  # by white noise at 1 Hz
        own /= math.hypot(math.sqrt(2) * books[s].level_std, walked)
        its /= math.hypot(math.sqrt(2) * books[o].level_std, walked)
        if max(own, its) > clearly * max(min(own, its), 1.0):
            return 1 if its > own else -1
    votes = 0
    for k in range(books.size):
        if (
            k != s
            and k != o
            and is_height(fixes.sources[k].kind)
            and t - books[k].level_at <= HEARD
        ):
            mine = abs(books[k].level - books[s].level)
            votes += 1 if mine < abs(books[k].level - books[o].level) else -1
    return min(max(votes, -1), 1)


@helper
def _mover(fixes: Fixes, t: float, cursor: Cursor) -> int:
    """Return the source, of recently used height, whose level moved most, or NOBODY."""
    books, found = cursor.books, NOBODY
    for k in range(books.size):
        if is_height(fixes.sources[k].kind) and books[k].suspended == 0:
            heard = t - max(books[k].level_at, books[k].last_used) <= HEARD
            if heard and (found < 0 or abs(books[k].moved) > abs(books[found].moved)):
                found = k
    return found


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: several sources measure the height."""
    return bool(cursor.state[0].heights > 1)
