"""Velocities in the body that nothing else helps: wheels and constraints of a vehicle that has for long
used neither a position nor a velocity. Nothing that the filter knows contradicts such a source, so its
gate opens while its innovations fail their tests: the filter shall not lose its only aid."""

from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel, matrix
from ...mathematics.belief import FilterState
from ...mathematics.source import Kind
from ..cursor import Cursor
from ..integrity import HEARD, fails
from ..kernels import STAGE, Kernels
from ..observation import observed_alone
from ..tables import Fixes

OPENED = 100.0  # factor on the gate: a measurement ten times as far off as the gate has it is wild


@kernel(STAGE)
def alone(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Mark a measurement that is the filter's only aid, and open its gate; its innovation and H are
    then in the work."""
    s, work = fixes.source[k], cursor.work[0]
    source = fixes.sources[s]
    if work.believable and work.gate >= 0 and _carries_alone(kernels, belief, fixes, k, cursor):
        work.alone = 1
        if source.robust == 0 and not source.memory > 0 and fails(cursor.books[s]):
            work.gate *= OPENED
    return 0


@helper
def _carries_alone(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor
) -> bool:
    """True where measurement k is a velocity in the body over ground, and the filter has used
    neither a position nor a velocity for HEARD seconds. Through air, whose own motion is a state,
    a wrong one would be taken for wind."""
    source, t = fixes.sources[fixes.source[k]], fixes.t[k]
    own = source.kind
    if cursor.state[0].positioned == 0 or own == Kind.POSITION or own == Kind.VELOCITY:
        return False
    if source.states > 0:
        return False
    for s in range(fixes.sources.size):
        kind = fixes.sources[s].kind
        if kind == Kind.POSITION or kind == Kind.VELOCITY:
            if t - cursor.books[s].last_used <= HEARD:
                return False
    observed_alone(kernels, belief, fixes, k, cursor)
    H = matrix(cursor.work[0].jacobian, 0, 3, belief.P.shape[0])
    return H[0, 3] != 0 or H[0, 4] != 0 or H[0, 5] != 0


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source measures neither position nor velocity."""
    return bool(np.any(sources["kind"] > Kind.VELOCITY))
