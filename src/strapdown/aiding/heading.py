"""Heading of the body's x axis, clockwise from true north: y = rad. The Jacobian is exact at
every heading (the published compass row is not)."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.elementary import arctangent2
from ..core.mathematics.rotation import wrap
from ..typing import Array
from . import augmented


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row: y - heading, wrapped, rad."""
    if augmented.any_of(belief, source):
        innovation[0] = wrap(y[0] - augmented.heading(belief, source, H))
        return 1
    C = belief.C_nb
    # zero where the x axis points up or down
    horizontal = max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], 1e-12)
    innovation[0] = wrap(y[0] - arctangent2(C[1, 0], C[0, 0]))
    H[0, 6] = -C[2, 0] * C[0, 0] / horizontal
    H[0, 7] = -C[2, 0] * C[1, 0] / horizontal
    H[0, 8] = 1.0
    return 1


MEASUREMENT = MeasurementModel(
    "heading",
    observe,
    ("angle",),
    calibration_parameters=("mounting",),
    reference="derivative of atan2(C21, C11); Fossen (2021) eq. 14.254 corrected",
    lanes=True,
)
