"""Barometric height of a point of the body: from pressure (Pa) in the ICAO standard atmosphere, or
as a height (m) whose zero is unknown.

Weather and the undulation of the geoid put it off the ellipsoidal height by up to some hundred
metres, and drift. So each source brings a bias along, in m: what the barometer reads too high.
"""

import math
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
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from .altitude import height

P_0, T_0, LAPSE = 101325.0, 288.15, 6.5e-3  # Pa, K, K/m at mean sea level
GAS = 287.05287  # of dry air, J/(kg K)
EXPONENT = GAS * LAPSE / STANDARD_GRAVITY  # of p / p_0 in the troposphere
# tropopause, m and Pa
TROPOPAUSE, P_TOP = (
    11000.0,
    P_0 * (1 - 11000.0 * LAPSE / T_0) ** (1 / EXPONENT),
)
SCALE_TOP = GAS * (T_0 - LAPSE * TROPOPAUSE) / STANDARD_GRAVITY  # scale height above it, m


@helper
def pressure_altitude(p: float) -> float:
    """Geopotential height in the standard atmosphere, m, up to 20 km; ICAO Doc 7488. NaN where p
    is not above zero."""
    if not p > 0:
        return math.nan
    if p < P_TOP:
        return TROPOPAUSE - SCALE_TOP * math.log(p / P_TOP)
    return T_0 / LAPSE * (1 - (p / P_0) ** EXPONENT)


@helper
def biased_height(
    belief: FilterState, measured: float, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row, down: estimated height of the point + bias - measured, m."""
    bias = source.first_state
    H[0, bias] = -1.0
    return height(belief, measured - belief.augmented[bias - STATES], source, innovation, H)


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row from y = pressure, Pa."""
    return biased_height(belief, pressure_altitude(y[0]), source, innovation, H)


@kernel(OBSERVE)
def observe_altitude(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row from y = barometric height, m."""
    return biased_height(belief, y[0], source, innovation, H)


# the walk: 6 m an hour, where 1 hPa of weather is 8 m
BAROMETER_BIAS: dict[str, Any] = dict(states=("bias [m]",), state_std=150.0, state_walk=0.1)
MEASUREMENT = MeasurementModel(
    "pressure",
    observe,
    ("pressure",),
    pose_axes="n",
    parameters="antenna",
    reference="ICAO Doc 7488; Groves (2013) section 6.2.1",
    **BAROMETER_BIAS,
)
ALTITUDE = MeasurementModel(
    "pressure-altitude",
    observe_altitude,
    ("length",),
    pose_axes="n",
    parameters="antenna",
    reference="Groves (2013) section 6.2.1",
    **BAROMETER_BIAS,
)
