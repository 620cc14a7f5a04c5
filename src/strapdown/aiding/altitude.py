"""Ellipsoidal height of a point of the body: y = m."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, helper, kernel
from ..core.mathematics.rotation import rotate_vector
from ..typing import Array


@helper
def height(
    belief: FilterState, measured: float, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row, down: estimated height of the point at the lever arm source.parameters[0:3] (m, body) -
    measured, m."""
    north, east, down = rotate_vector(
        belief.C_nb, source.parameters[0], source.parameters[1], source.parameters[2]
    )
    innovation[0] = belief.lla[2] - measured - down
    H[0, 2] = 1.0
    H[0, 6], H[0, 7] = east, -north
    return 1


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row from y = height above the ellipsoid, m."""
    return height(belief, y[0], source, innovation, H)


MEASUREMENT = MeasurementModel(
    "altitude",
    observe,
    ("length",),
    pose_axes="n",
    parameters="antenna",
    reference="down component of the position fix",
    lanes=True,
)
