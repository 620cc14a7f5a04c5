"""Course over ground of an antenna, clockwise from true north: y = rad. It is the direction of the
velocity, not of the body: side slip and leeway are no error of it.

A slow vehicle has no course, and around one that is hardly known no derivative holds. So nothing is
measured where the estimated horizontal speed is below `MIN_SPEED`, or below `SURELY` of its own
standard deviations.
"""

import math

from ..core.compile.selection import all_of, where
from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.elementary import arctangent2
from ..core.mathematics.rotation import rotate_vector, wrap
from ..typing import Array

MIN_SPEED, SURELY = 1.0, 3.0  # m/s; standard deviations


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row: y - course, wrapped, rad; NaN where there is none."""
    C, w = belief.C_nb, belief.omega
    l0, l1, l2 = source.parameters[0], source.parameters[1], source.parameters[2]
    by_turning = rotate_vector(
        C, w[1] * l2 - w[2] * l1, w[2] * l0 - w[0] * l2, w[0] * l1 - w[1] * l0
    )
    north, east = belief.v_n[0] + by_turning[0], belief.v_n[1] + by_turning[1]
    square = north * north + east * east
    doubt = SURELY * SURELY * max(belief.P[3, 3], belief.P[4, 4])
    least = max(MIN_SPEED * MIN_SPEED, doubt)
    slow = square < least
    if all_of(slow):
        innovation[0] = math.nan
        return 1
    square = max(square, least)
    innovation[0] = where(slow, math.nan, wrap(y[0] - arctangent2(east, north)))
    of_north, of_east = -east / square, north / square
    H[0, 3], H[0, 4] = of_north, of_east
    H[0, 6], H[0, 7] = -of_east * by_turning[2], of_north * by_turning[2]
    H[0, 8] = of_east * by_turning[0] - of_north * by_turning[1]
    for i, by in ((0, of_north), (1, of_east)):
        H[0, 12] += by * (C[i, 1] * l2 - C[i, 2] * l1)
        H[0, 13] += by * (C[i, 2] * l0 - C[i, 0] * l2)
        H[0, 14] += by * (C[i, 0] * l1 - C[i, 1] * l0)
    return 1


MEASUREMENT = MeasurementModel(
    "course",
    observe,
    ("angle",),
    parameters="antenna",
    reference="derivative of atan2 of the velocity fix, Groves (2013) eq. 14.111",
    lanes=True,
)
