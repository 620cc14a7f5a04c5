"""Air data: airspeed of a pitot tube, the angles of vanes, and the constraint of a fixed wing that its
air comes from ahead. The wind, two horizontal states, is common to all sources of a recording.

With the air velocity a = v - w (NED, w = (north, east, 0)) and its components u, v, w in the body:

    true airspeed = |a|,  indicated = |a| sqrt(rho / rho_0),  side slip = atan(v / u),
    angle of attack = atan(w / u),  lateral air velocity = v

A vane turns about an axis of the body and so measures atan(v / u), not asin(v / |a|). A slow vehicle has
no direction of its air, and near its zero a pitot tube reads noise. So nothing is measured where the
estimated air velocity along the nose is below `MIN_AIRSPEED`.
"""

import math
from typing import Any

from ..core.compile.selection import where
from ..core.loop.contract import (
    OBSERVE,
    STATES,
    FilterState,
    MeasurementModel,
    SourceRow,
    helper,
    kernel,
)
from ..core.mathematics.elementary import arctangent2, exponential, logarithm
from ..core.mathematics.rotation import wrap
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from .augmented import Three, cross, dot, error
from .pressure import GAS, LAPSE, P_0, T_0, TROPOPAUSE

MIN_AIRSPEED = 5.0  # m/s
DENSITY = P_0 / (GAS * T_0)  # kg/m^3 at mean sea level, to which airspeed indicators are made
THINNING = STANDARD_GRAVITY / (GAS * LAPSE) - 1  # exponent of the density in the troposphere


@helper
def relative_density(height: float, source: SourceRow) -> tuple[float, float]:
    """Air density at a height (m) over that at mean sea level, and the slope of its logarithm, 1/m: in
    the atmosphere of a pressure (Pa) and a temperature (K) at a height (m), which are
    `source.parameters[0:3]`, or in the ICAO atmosphere where that pressure is 0. The lapse rate is
    ICAO's; Doc 7488."""
    given = source.parameters[0] > 0.0
    p = source.parameters[0] if given else P_0
    T = source.parameters[1] if given else T_0
    base = source.parameters[2] if given else 0.0
    below = where(height < TROPOPAUSE, height, TROPOPAUSE)
    at = T - LAPSE * (below - base)
    slope = where(height < TROPOPAUSE, -THINNING * LAPSE / at, -STANDARD_GRAVITY / (GAS * at))
    above = -STANDARD_GRAVITY / (GAS * at) * (height - below)
    return p / (GAS * T) / DENSITY * exponential(THINNING * logarithm(at / T) + above), slope


@helper
def air_velocity(belief: FilterState, source: SourceRow) -> Three:
    """Velocity through the air, m/s, NED."""
    v, wind = belief.v_n, source.first_state - STATES
    return v[0] - belief.augmented[wind], v[1] - belief.augmented[wind + 1], v[2]


@helper
def body_axis(C: Array, k: int) -> Three:
    """The unit vector along axis k of the body, NED."""
    return C[0, k], C[1, k], C[2, k]


@helper
def unless_slow(belief: FilterState, air: Three, innovation: float) -> float:
    """An innovation, or NaN where the air does not come from ahead fast enough."""
    ahead = dot(body_axis(belief.C_nb, 0), air)
    return where(ahead < MIN_AIRSPEED, math.nan, innovation)


@helper
def by_air_velocity(H: Array, source: SourceRow, air: Three, along: Three) -> None:
    """The row of H of what changes with the air velocity: by `along`, its derivative by that
    velocity in n while the body keeps its attitude, and by that attitude."""
    turned = cross(along, air)
    for i in range(3):
        H[0, 3 + i], H[0, 6 + i] = along[i], turned[i]
    H[0, source.first_state], H[0, source.first_state + 1] = -along[0], -along[1]


@helper
def airspeed_row(
    belief: FilterState,
    measured: float,
    factor: float,
    source: SourceRow,
    innovation: Array,
    H: Array,
) -> float:
    """One row: measured - true airspeed times `factor` and 1 + scale, m/s. Returns what is
    expected."""
    air = air_velocity(belief, source)
    speed = math.sqrt(dot(air, air))
    speed = where(speed < MIN_AIRSPEED, MIN_AIRSPEED, speed)
    scale = factor * (1.0 + error(belief, source.scale_state))
    innovation[0] = unless_slow(belief, air, measured - scale * speed)
    by = scale / speed
    H[0, 3], H[0, 4], H[0, 5] = by * air[0], by * air[1], by * air[2]
    H[0, source.first_state], H[0, source.first_state + 1] = -by * air[0], -by * air[1]
    if source.scale_state > 0:
        H[0, source.scale_state] = factor * speed
    return scale * speed


@kernel(OBSERVE)
def observe_true(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: true airspeed, m/s."""
    airspeed_row(belief, y[0], 1.0, source, innovation, H)
    return 1


@kernel(OBSERVE)
def observe_indicated(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: indicated airspeed, m/s."""
    ratio, slope = relative_density(belief.lla[2], source)
    expected = airspeed_row(belief, y[0], math.sqrt(ratio), source, innovation, H)
    H[0, 2] = -0.5 * slope * expected
    return 1


@helper
def vane(
    axis: int, belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: angle of the air velocity from the nose towards body axis 1 or 2, rad."""
    air, nose, side = (
        air_velocity(belief, source),
        body_axis(belief.C_nb, 0),
        body_axis(belief.C_nb, axis),
    )
    ahead, across = dot(nose, air), dot(side, air)
    innovation[0] = unless_slow(belief, air, wrap(y[0] - arctangent2(across, ahead)))
    square = ahead * ahead + across * across
    square = where(square < 1.0, 1.0, square)
    a, b = ahead / square, across / square
    by_air_velocity(
        H,
        source,
        air,
        (a * side[0] - b * nose[0], a * side[1] - b * nose[1], a * side[2] - b * nose[2]),
    )
    return 1


@kernel(OBSERVE)
def observe_side_slip(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: side slip, positive where the air comes from the right, rad."""
    return vane(1, belief, y, source, innovation, H)


@kernel(OBSERVE)
def observe_angle_of_attack(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: angle of attack, positive where the air comes from below, rad."""
    return vane(2, belief, y, source, innovation, H)


@kernel(OBSERVE)
def observe_lateral(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: air velocity to the right, m/s."""
    air, side = air_velocity(belief, source), body_axis(belief.C_nb, 1)
    innovation[0] = unless_slow(belief, air, y[0] - dot(side, air))
    by_air_velocity(H, source, air, side)
    return 1


# the walk: 1 m/s in 100 s; ArduPilot's EKF3 has the same (EK3_WIND_P_NSE)
WIND: dict[str, Any] = dict(
    states=("north [m/s]", "east [m/s]"), state_std=10.0, state_walk=0.1, shared="wind"
)
TRUE = MeasurementModel(
    "true-airspeed",
    observe_true,
    ("speed",),
    calibration_parameters=("scale",),
    reference="Beard & McLain (2012) section 2.4",
    **WIND,
)
INDICATED = MeasurementModel(
    "indicated-airspeed",
    observe_indicated,
    ("speed",),
    parameters="atmosphere",
    calibration_parameters=("scale",),
    reference="incompressible: Beard & McLain (2012) section 7.2; ICAO Doc 7488",
    **WIND,
)
SIDE_SLIP = MeasurementModel(
    "side-slip",
    observe_side_slip,
    ("angle",),
    reference="Beard & McLain (2012) section 2.3, of a vane",
    **WIND,
)
ANGLE_OF_ATTACK = MeasurementModel(
    "angle-of-attack",
    observe_angle_of_attack,
    ("angle",),
    reference="Beard & McLain (2012) section 2.3",
    **WIND,
)
LATERAL = MeasurementModel(
    "zero-side-slip",
    observe_lateral,
    ("speed",),
    recorded=False,
    reference="lateral air velocity of a fixed wing",
    **WIND,
)
