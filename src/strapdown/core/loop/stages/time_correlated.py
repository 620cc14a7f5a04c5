"""Time-correlated errors of a source: what becomes of them up to its next measurement, and how much they
add to what is not estimated of them (core/mathematics/time_correlated.py has the equations)."""

from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import kernel
from ...mathematics.belief import FilterState
from ...mathematics.time_correlated import fade, widen
from ..cursor import Cursor
from ..kernels import STAGE, Kernels
from ..tables import Fixes


@kernel(STAGE)
def fade_errors(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Bring the correlated errors of a source to the time of its measurement: a call of its own to
    the smoother."""
    s, work = fixes.source[k], cursor.work[0]
    source = fixes.sources[s]
    if work.believable and source.correlation_time > 0:
        seconds = fixes.t[k] - cursor.books[s].last
        fade(belief.P, belief.augmented, source, seconds, record)
        cursor.state[0].recorded += 1
        widen(work.stds, source)
    return 0


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: the errors of a source are time-correlated."""
    return bool(np.any(sources["correlation_time"] > 0))
