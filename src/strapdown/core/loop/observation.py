"""The innovation and H of a measurement alone, without the filter's correction."""

import math

from ..compile.jit import helper, matrix
from ..mathematics.belief import FilterState
from .cursor import Cursor
from .kernels import Kernels, observe_at
from .tables import Fixes


@helper
def observed_alone(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor
) -> None:
    """The innovation of measurement k as its kind observes it, without the estimates of correlated
    errors, in work.other, and its H (3, n) in work.jacobian."""
    work, n = cursor.work[0], belief.P.shape[0]
    source, e, H = fixes.sources[fixes.source[k]], work.other[0:3], matrix(work.jacobian, 0, 3, n)
    for i in range(3):
        e[i] = math.nan
        for j in range(n):
            H[i, j] = 0.0
    observe_at(kernels.observers[source.kind])(belief, fixes.y[k], source, e, H)
