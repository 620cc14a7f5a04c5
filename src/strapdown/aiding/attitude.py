"""Attitude from elsewhere, such as an AHRS: y = roll, pitch, heading, rad. Roll and pitch come
together; a heading that is not measured is NaN.

The innovation is the rotation from the estimated to the measured attitude, about the horizontal
forward and right axes and the vertical, so that the three standard deviations are those of roll,
pitch and heading of a body that is not steep, and no pitch is singular.
"""

import math

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.rotation import euler_terms, measured_heading, rotation_between
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: rotation vector forward, right, down, rad."""
    heading = measured_heading(y, belief.C_nb)
    ch, sh = math.cos(heading), math.sin(heading)
    north, east, down = rotation_between(belief.C_nb, euler_terms(y[0], y[1], heading))
    innovation[0], innovation[1], innovation[2] = (
        ch * north + sh * east,
        ch * east - sh * north,
        math.nan if math.isnan(y[2]) else down,
    )
    H[0, 6], H[0, 7] = ch, sh
    H[1, 6], H[1, 7] = -sh, ch
    H[2, 8] = 1.0
    return 3


MEASUREMENT = MeasurementModel(
    "attitude",
    observe,
    ("angle", "angle", "angle"),
    reference="AHRS measurement of Fossen (2021) section 14.3.2",
)
