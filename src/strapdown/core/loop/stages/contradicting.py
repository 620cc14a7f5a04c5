"""Sensors beside GNSS that contradict it are left out, also while GNSS is lost later, until they have
agreed with it for some time.

While positions and velocities are used, a filter that were wrong would contradict these too. So a
sensor that fails the running tests of its innovations then (core/loop/integrity.py), or whose fixes are
rejected for so long that their gate would be opened, is the one that errs: its unit, sign, scale or
clock is wrong, it is stuck, or what it looks at is disturbed. One that is more precise than GNSS draws
the belief to itself, and then position and velocity fail their tests together: all such sensors that
were used are left out, and come back by themselves where they are right. P grows, so that what the
sensor has done to the belief is undone.
"""

from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ..cursor import Cursor
from ..integrity import (
    exclude_contradicting,
    fails,
    gnss_contradicts,
    gnss_is_used,
    is_gnss,
    make_room_for_gnss,
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
    books = cursor.books[s]
    if not work.believable:
        return 0
    if is_gnss(fixes.sources[s].kind) and gnss_contradicts(fixes, t, cursor):
        _exclude_used(belief.P, fixes, t, cursor)
    if fixes.sources[s].beside_gnss == 0:
        return 0
    if gnss_is_used(fixes, t, cursor):
        if books.contradicts == 0 and fails(books):
            exclude_contradicting(s, t, cursor)
            if was_used(books, t):
                make_room_for_gnss(belief.P)
        elif books.contradicts > 0 and not fails(books) and t > books.barred:
            books.contradicts = 0
            notify(cursor, Code.AGREES_AGAIN, s, t, 0.0)
    if books.contradicts > 0:
        work.gate = ASK_FIRST
    return 0


@helper
def _exclude_used(P: Array, fixes: Fixes, t: float, cursor: Cursor) -> None:
    """Leave out all sensors beside GNSS that were used lately."""
    found = False
    for s in range(fixes.sources.size):
        books = cursor.books[s]
        if fixes.sources[s].beside_gnss > 0 and books.contradicts == 0 and was_used(books, t):
            exclude_contradicting(s, t, cursor)
            found = True
    if found:
        make_room_for_gnss(P)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source is judged by GNSS, and the filter has a position."""
    return bool(cursor.state[0].positioned > 0 and np.any(sources["beside_gnss"] > 0))
