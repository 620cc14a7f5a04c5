"""Side slip of tyres: as an angle it grows with the lateral acceleration, which is taken as yaw rate
times speed. That is smooth, where the accelerometers feel the engine and the road.

    std_slip = slip |omega_z| |v|^2        added to the standard deviations of a constraint
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import kernel
from ...mathematics.belief import FilterState
from ..cursor import Cursor
from ..kernels import STAGE, Kernels
from ..tables import Fixes


@kernel(STAGE)
def inflate_side_slip(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Widen the standard deviations of a constraint across the wheels."""
    v, std, slip = belief.v_n, cursor.work[0].stds, fixes.sources[fixes.source[k]].slip
    if slip > 0:
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        for i in range(3):
            std[i] = math.hypot(std[i], slip * belief.omega[2] * square)
    return 0


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: a source has side slip."""
    return bool(np.any(sources["slip"] > 0))
