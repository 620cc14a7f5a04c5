"""Distance from a point of the body to a beacon whose place is known: y = m.

With u the unit vector from the point to the beacon and x the lever arm, both NED, the distance falls
by u for each metre of the point; with true C = exp(theta) C its derivative by theta is u x x.
Travel time and the speed of sound put it off, so each source brings a bias along, in m.
"""

import math

from ..core.loop.contract import (
    OBSERVE,
    STATES,
    FilterState,
    MeasurementModel,
    SourceRow,
    kernel,
)
from ..core.mathematics.earth import vector_to
from ..core.mathematics.rotation import cross, rotate_vector
from ..typing import Array

BESIDE = 1e-3
"""m: closer than this to the beacon, no direction is known, and u is shorter than 1."""


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row: y - distance to the beacon at source.parameters[3:6] (rad, rad, m above the ellipsoid) -
    bias, m."""
    place, bias = source.parameters, source.first_state
    n, e, d = vector_to(belief.lla, place[3], place[4], place[5])
    x = rotate_vector(belief.C_nb, place[0], place[1], place[2])
    n, e, d = n - x[0], e - x[1], d - x[2]
    distance = math.sqrt(n * n + e * e + d * d)
    far = max(distance, BESIDE)
    u = n / far, e / far, d / far
    innovation[0] = y[0] - distance - belief.augmented[bias - STATES]
    H[0, 0], H[0, 1], H[0, 2] = -u[0], -u[1], -u[2]
    H[0, 6], H[0, 7], H[0, 8] = cross(u, x)
    H[0, bias] = 1.0
    return 1


MEASUREMENT = MeasurementModel(
    "range",
    observe,
    ("length",),
    parameters="antenna",
    more_parameters="beacon",
    reference="aid by a hydroacoustic positioning reference, Fossen (2021) section 14.1",
    states=("bias [m]",),
    state_std=1.0,
)
