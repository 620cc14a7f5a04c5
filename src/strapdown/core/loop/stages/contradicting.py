"""Sensors beside GNSS that contradict it are left out, until they have agreed with it for some time.

While positions and velocities are used, a filter that were wrong would contradict these too. So a
sensor that fails the running tests of its innovations then (core/loop/integrity.py), or whose fixes are
rejected for so long that their gate would be opened, is the one that errs: its unit, sign, scale or
clock is wrong, it is stuck, or what it looks at is disturbed. One that is more precise than GNSS draws
the belief to itself, and then position and velocity fail their tests together: all such sensors that
were used are left out, and come back by themselves where they are right.

P grows, so that what the sensor has done to the belief is undone.

- Without states of its own, a sensor that is left out is compared on, and used again once it agrees.
- States that sensors share, the wind of velocities through the air, take up what a wrong one is off.
  Sensors that share them are left out together and tried again, with states that are as unknown as at
  the start.
- Without GNSS nothing contradicts a sensor: it is used only if it has agreed for as long as it was left
  out. One with states that holds its value is left out too.
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ....units.constants import FROZEN_ROWS, FROZEN_TIME, LIVELY
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.time_correlated import forget_states
from ..cursor import Books, Cursor
from ..integrity import (
    HEARD,
    exclude_contradicting,
    fails,
    forget,
    gnss_contradicts_since,
    is_gnss,
    last_gnss,
    make_room_for_gnss,
    share_states,
    was_used,
)
from ..kernels import STAGE, Kernels
from ..log import Code, notify
from ..tables import Fixes

ASK_FIRST = -1.0
"""The gate with which a filter says what it makes of a measurement, and no more."""


@kernel(STAGE)
def judge_beside_gnss(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Let the filter be asked of a measurement, and not corrected by it, while its source is left out."""
    s, t, work = fixes.source[k], fixes.t[k], cursor.work[0]
    source, books = fixes.sources[s], cursor.books[s]
    if not work.believable:
        return 0
    if is_gnss(source.kind):
        since = gnss_contradicts_since(fixes, t, cursor)
        if since < math.inf:
            _exclude_used(belief.P, fixes, since, t, cursor)
    if source.beside_gnss == 0:
        return 0
    last = last_gnss(fixes, cursor)
    checked = t - last <= HEARD
    if checked and books.contradicts == 0 and fails(books):
        if exclude_contradicting(fixes, s, t, cursor):
            make_room_for_gnss(belief.P)
    elif checked and books.contradicts > 0 and t > books.barred:
        if source.states > 0 or not fails(books):
            _use_again(belief, fixes, s, t, cursor, record)
    if books.contradicts > 0:
        work.gate = ASK_FIRST
        notify(cursor, Code.CONTRADICTS, s, t, 0.0)
    elif not checked and last < books.proven:
        _exclude(Code.UNCHECKED, s, t, t - last, cursor)
    if source.states > 0 and _is_frozen(books, fixes.y[k, 0], t):
        _exclude(Code.FROZEN, s, t, t - books.held_since, cursor)
    return 0


@helper
def _exclude_used(P: Array, fixes: Fixes, since: float, t: float, cursor: Cursor) -> None:
    """Leave out all sensors beside GNSS that were used lately, and when GNSS began to contradict. One that brings states along is not more
    precise than GNSS: these take up what it says beside."""
    grows = False
    for s in range(fixes.sources.size):
        source, books = fixes.sources[s], cursor.books[s]
        judged = source.beside_gnss > 0 and source.states == 0
        if judged and books.contradicts == 0 and was_used(books, t) and books.used_since < since:
            grows |= exclude_contradicting(fixes, s, t, cursor)
    if grows:
        make_room_for_gnss(P)


@helper
def _use_again(
    belief: FilterState, fixes: Fixes, s: int, t: float, cursor: Cursor, record: Array
) -> None:
    """Use a source again, with all that share its states: these are as unknown as at the start then, a call
    of its own to the smoother, and tests begin anew."""
    source = fixes.sources[s]
    for i in range(fixes.sources.size):
        if i == s or share_states(source, fixes.sources[i]):
            books = cursor.books[i]
            books.contradicts = 0
            notify(cursor, Code.AGREES_AGAIN, i, t, 0.0)
            if source.states > 0:
                forget(books)
                books.in_a_row = books.lifts = books.lifted_at = 0
    if source.states > 0:
        count = min(source.states, 2)  # a vertical wind is no way out
        forget_states(
            belief.P, belief.augmented, source.first_state, count, source.state_std, record
        )
        cursor.state[0].recorded += 1


@helper
def _is_frozen(books: Books, value: float, t: float) -> bool:
    """True where a reading has held its value too long, of a source that usually changes it."""
    books.values += 1
    if value != books.value:
        books.value, books.held_since, books.held = value, t, 0
        books.changes += 1
    else:
        books.held += 1
    others = books.values - books.held
    return (
        books.held >= FROZEN_ROWS
        and t - books.held_since > FROZEN_TIME
        and books.changes > LIVELY * others
    )


@helper
def _exclude(code: int, s: int, t: float, value: float, cursor: Cursor) -> None:
    """Keep a measurement from the filter, which is not asked of it either."""
    work = cursor.work[0]
    work.believable = 0
    for i in range(12):
        work.innovation[i] = math.nan
    notify(cursor, code, s, t, value)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source is judged by GNSS, and the filter has a position."""
    return bool(cursor.state[0].positioned > 0 and np.any(sources["beside_gnss"] > 0))
