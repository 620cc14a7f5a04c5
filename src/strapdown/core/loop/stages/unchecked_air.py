"""Velocities through the air, whose own motion is a state: the wind takes up what a wrong one is off, and
once positions and velocities are missing nothing contradicts it.

- One that contradicts positions or velocities is left out, with all that see the same wind, and is tried
  again REMEMBERED s later with a wind that is as unknown as at the start.
- While no position or velocity checks it, it is left out unless it has agreed with them as long again.
- A reading that holds its value is left out.
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ....units.constants import FROZEN_ROWS, FROZEN_TIME, LIVELY
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.source import SourceRow
from ...mathematics.time_correlated import forget_states
from ..cursor import Books, Cursor
from ..integrity import fails, forget, is_gnss
from ..kernels import STAGE, Kernels
from ..log import Code, notify
from ..tables import Fixes

MISSING = 3.0
"""s without a position or a velocity from which nothing checks the wind."""
REMEMBERED = 60.0
"""s of agreement that outweigh a contradiction: a turn or two, which are what shows it. An airspeed with a
wrong scale flies straight without one."""


@kernel(STAGE)
def exclude_unchecked_air(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Keep a velocity through the air from the filter that nothing would contradict, or that is frozen."""
    s, t = fixes.source[k], fixes.t[k]
    books = cursor.books[s]
    if not books.through_air > 0 or not cursor.work[0].believable:
        return 0
    frozen = _is_frozen(books, fixes.y[k, 0], t)
    last = _last_check(fixes, cursor)
    checked = t - last <= MISSING
    if checked and books.suspected == 0 and _is_contradicted(cursor):
        _suspect(cursor, t)
    agreed = min(t, last) - books.contradicted_at
    if frozen:
        _exclude(Code.FROZEN, s, t, t - books.held_since, cursor)
    elif agreed <= (REMEMBERED if checked else 2 * REMEMBERED):
        _exclude(Code.UNCHECKED, s, t, t - books.contradicted_at, cursor)
    elif books.suspected > 0:
        _try_again(belief, fixes.sources[s], cursor, record)
    return 0


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
def _last_check(fixes: Fixes, cursor: Cursor) -> float:
    """When a position or a velocity was used last, s."""
    last = -math.inf
    for s in range(fixes.sources.size):
        if is_gnss(fixes.sources[s].kind):
            last = max(last, cursor.books[s].last_used)
    return last


@helper
def _is_contradicted(cursor: Cursor) -> bool:
    """True where the tests of any velocity through the air fail, or its gate had to be opened."""
    contradicted = False
    for s in range(cursor.books.size):
        books = cursor.books[s]
        if books.through_air > 0:
            contradicted |= fails(books) or books.rejecting != 0
    return contradicted


@helper
def _suspect(cursor: Cursor, t: float) -> None:
    """Every velocity through the air may be wrong, or rest on a wind that is: their tests begin anew."""
    for s in range(cursor.books.size):
        books = cursor.books[s]
        if books.through_air > 0:
            forget(books)
            books.suspected, books.contradicted_at = 1, t
            books.rejecting = books.in_a_row = books.lifts = books.lifted_at = 0


@helper
def _try_again(belief: FilterState, source: SourceRow, cursor: Cursor, record: Array) -> None:
    """Use the velocities through the air again, with a wind that is as unknown as at the start: a call of
    its own to the smoother."""
    std = 0.0
    for s in range(cursor.books.size):
        cursor.books[s].suspected = 0
        std = max(std, cursor.books[s].through_air)
    first, count = source.first_state, min(source.states, 2)  # a vertical wind is no way out
    forget_states(belief.P, belief.augmented, first, count, std, record)
    cursor.state[0].recorded += 1


@helper
def _exclude(code: int, s: int, t: float, value: float, cursor: Cursor) -> None:
    work = cursor.work[0]
    work.believable = 0
    for i in range(12):
        work.innovation[i] = math.nan
    notify(cursor, code, s, t, value)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: it has a velocity through the air."""
    return bool(np.any(cursor.books["through_air"] > 0))
