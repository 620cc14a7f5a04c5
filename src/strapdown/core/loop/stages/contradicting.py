"""Sensors beside GNSS that contradict it are left out, also while GNSS is lost later, until they have
agreed with it for some time.

While positions and velocities are used, a filter that were wrong would contradict these too. So a
sensor that fails the running tests of its innovations then (core/loop/integrity.py), or whose fixes are
rejected for so long that their gate would be opened, is the one that errs: its unit, sign, scale or
clock is wrong, it is stuck, or what it looks at is disturbed. What it has done to the belief before
it was found is made good by the growth of P.
"""

from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import kernel
from ...mathematics.belief import FilterState
from ..cursor import Cursor
from ..integrity import exclude_contradicting, fails, gnss_is_used
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
    if not work.believable or fixes.sources[s].beside_gnss == 0:
        return 0
    if gnss_is_used(fixes, t, cursor):
        if books.contradicts == 0 and fails(books):
            exclude_contradicting(belief.P, s, t, cursor)
        elif books.contradicts > 0 and not fails(books):
            books.contradicts = 0
            notify(cursor, Code.AGREES_AGAIN, s, t, 0.0)
    if books.contradicts > 0:
        work.gate = ASK_FIRST
    return 0


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source is judged by GNSS, and the filter has a position."""
    return bool(cursor.state[0].positioned > 0 and np.any(sources["beside_gnss"] > 0))
