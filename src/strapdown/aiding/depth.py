"""Depth of a point of the body below the sea, as a length or from the pressure of the water.

Tide, the air above and the undulation of the geoid put the surface off the ellipsoid by up to some
hundred metres. So each source brings a bias along, in m: what the sensor reads too deep.
"""

from typing import Any

from ..core.loop.contract import (
    OBSERVE,
    STATES,
    FilterState,
    MeasurementModel,
    SourceRow,
    helper,
    kernel,
)
from ..core.mathematics.earth import gravity, sine_of_latitude
from ..typing import Array
from .altitude import height
from .pressure import P_0

SEAWATER = 1025.0
"""Density, kg/m^3."""


@helper
def biased_depth(
    belief: FilterState, measured: float, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row, down: measured - bias - estimated depth of the point, m."""
    bias = source.first_state
    H[0, bias] = 1.0
    return height(belief, belief.augmented[bias - STATES] - measured, source, innovation, H)


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row from y = depth, m, positive down."""
    return biased_depth(belief, y[0], source, innovation, H)


@kernel(OBSERVE)
def observe_pressure(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row from y = absolute pressure, Pa."""
    g = gravity(sine_of_latitude(belief.lla[0]), 0.0)
    return biased_depth(belief, (y[0] - P_0) / (SEAWATER * g), source, innovation, H)


# the geoid is 30 m off the ellipsoid in the mean of the Earth; the walk: 1.2 m of tide an hour
SEA_BIAS: dict[str, Any] = dict(states=("bias [m]",), state_std=50.0, state_walk=0.02)
MEASUREMENT = MeasurementModel(
    "depth",
    observe,
    ("length",),
    pose_axes="n",
    parameters="antenna",
    reference="height of a point of the body below a surface whose own is a state",
    **SEA_BIAS,
)
PRESSURE = MeasurementModel(
    "water-pressure",
    observe_pressure,
    ("water pressure",),
    pose_axes="n",
    parameters="antenna",
    reference="hydrostatic pressure of sea water",
    **SEA_BIAS,
)
