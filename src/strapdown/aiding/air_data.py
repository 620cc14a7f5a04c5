"""Air data: airspeed of a pitot tube, the angles of vanes, the constraint of a fixed wing that its air comes
from ahead, and the drag of rotors. The wind, two horizontal states and on request a vertical one, is
common to all sources of a recording.

With the velocity of the sensor through the air a = (u, v, w), body, of lever arm l:

    a = C' (v - wind) + omega x l
    true airspeed = |a|,  indicated = |a| sqrt(rho / rho_0),  side slip = atan(v / u),
    angle of attack = atan(w / u),  lateral air velocity = v,
    specific force of rotors = -k (u, v) across their axis

A vane turns about an axis of the body and so measures atan(v / u), not asin(v / |a|). A slow vehicle has
no direction of its air, and near its zero a pitot tube reads noise. So nothing is measured where the
estimated air velocity along the nose is below `MIN_AIRSPEED`. Drag holds at any speed.

The specific force is the IMU's own. Its white noise is then also in the prediction, which a filter takes
for independent: averaged over a step it is some hundredth of the drag's own error, 0.5 m/s^2.
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
from ..core.mathematics.rotation import Three, axis, cross, dot, wrap
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from . import augmented
from .augmented import error
from .pressure import GAS, LAPSE, P_0, T_0, TROPOPAUSE

MIN_AIRSPEED = 5.0  # m/s
DENSITY = P_0 / (GAS * T_0)  # kg/m^3 at mean sea level, to which airspeed indicators are made
THINNING = STANDARD_GRAVITY / (GAS * LAPSE) - 1  # exponent of the density in the troposphere


@helper
def relative_density(height: float, source: SourceRow) -> tuple[float, float]:
    """Air density at a height (m) over that at mean sea level, and the slope of its logarithm, 1/m: in
    the atmosphere of a pressure (Pa) and a temperature (K) at a height (m), which are
    `source.parameters[3:6]`, or in the ICAO atmosphere where that pressure is 0. The lapse rate is
    ICAO's; Doc 7488."""
    given = source.parameters[3] > 0.0
    p = source.parameters[3] if given else P_0
    T = source.parameters[4] if given else T_0
    base = source.parameters[5] if given else 0.0
    below = where(height < TROPOPAUSE, height, TROPOPAUSE)
    at = T - LAPSE * (below - base)
    slope = where(height < TROPOPAUSE, -THINNING * LAPSE / at, -STANDARD_GRAVITY / (GAS * at))
    above = -STANDARD_GRAVITY / (GAS * at) * (height - below)
    return p / (GAS * T) / DENSITY * exponential(THINNING * logarithm(at / T) + above), slope


@helper
def air_velocity(belief: FilterState, arm: Three, source: SourceRow, H: Array) -> Three:
    """Velocity of a point of the body through the air, m/s, along the axes of the body (those of the
    vehicle, where the mounting is a state), with its derivatives in the rows of H."""
    wind, v = source.first_state - STATES, belief.v_n
    down = belief.augmented[wind + 2] if source.states > 2 else 0.0
    a = v[0] - belief.augmented[wind], v[1] - belief.augmented[wind + 1], v[2] - down
    found = along(0, a, belief, arm, source, H), along(1, a, belief, arm, source, H)
    last = along(2, a, belief, arm, source, H)
    for row in range(3):
        for k in range(3 if source.states > 2 else 2):
            H[row, source.first_state + k] = -H[row, 3 + k]
    return found[0], found[1], last


@helper
def along(k: int, a: Three, belief: FilterState, arm: Three, source: SourceRow, H: Array) -> float:
    """Component k of the velocity through the air, of an IMU whose own is a in n, and its row of H."""
    d = axis(k)
    if augmented.any_of(belief, source):
        return augmented.speed_along(d, arm, k, a, 1.0, belief, source, H)
    C, w = belief.C_nb, belief.omega
    c = C[0, k], C[1, k], C[2, k]
    by_bias = cross(d, arm)
    H[k, 3], H[k, 4], H[k, 5] = c
    H[k, 6], H[k, 7], H[k, 8] = cross(c, a)
    H[k, 12], H[k, 13], H[k, 14] = by_bias
    return dot(c, a) - (w[0] * by_bias[0] + w[1] * by_bias[1] + w[2] * by_bias[2])


@helper
def arm_of(source: SourceRow) -> Three:
    """The lever arm, m, body."""
    return source.parameters[0], source.parameters[1], source.parameters[2]


@helper
def one_row(H: Array, by: Three) -> None:
    """The first row of H, of what changes with the components of the air velocity by `by`; the others
    vanish."""
    for i in range(H.shape[1]):
        H[0, i] = by[0] * H[0, i] + by[1] * H[1, i] + by[2] * H[2, i]
        H[1, i] = H[2, i] = 0.0


@helper
def unless_slow(air: Three, innovation: float) -> float:
    """An innovation, or NaN where the air does not come from ahead fast enough."""
    return math.nan if air[0] < MIN_AIRSPEED else innovation


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
    air = air_velocity(belief, arm_of(source), source, H)
    speed = max(math.sqrt(dot(air, air)), MIN_AIRSPEED)
    scale = factor * (1.0 + error(belief, source.scale_state))
    innovation[0] = unless_slow(air, measured - scale * speed)
    by = scale / speed
    one_row(H, (by * air[0], by * air[1], by * air[2]))
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
    air = air_velocity(belief, arm_of(source), source, H)
    ahead, across = air[0], air[axis]
    innovation[0] = unless_slow(air, wrap(y[0] - arctangent2(across, ahead)))
    square = max(ahead * ahead + across * across, 1.0)
    by = ahead / square
    one_row(H, (-across / square, by if axis == 1 else 0.0, by if axis == 2 else 0.0))
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
    air = air_velocity(belief, arm_of(source), source, H)
    innovation[0] = unless_slow(air, y[0] - air[1])
    one_row(H, (0.0, 1.0, 0.0))
    return 1


@kernel(OBSERVE)
def observe_drag(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """Two rows: specific force forward and to the right, across the axis of the rotors, m/s^2;
    source.parameters[0:2] are their drag coefficients, 1/s."""
    air = air_velocity(belief, (0.0, 0.0, 0.0), source, H)
    scale = 1.0 + error(belief, source.scale_state)
    for i in range(2):
        k = source.parameters[i]
        innovation[i] = y[i] - belief.b_a[i] + k * scale * air[i]
        for j in range(H.shape[1]):
            H[i, j] *= -k * scale
        H[i, 9 + i] += 1.0
        if source.scale_state > 0:
            H[i, source.scale_state] = -k * air[i]
    for j in range(H.shape[1]):
        H[2, j] = 0.0
    return 2


# the walk: 1 m/s in 100 s; ArduPilot's EKF3 has the same (EK3_WIND_P_NSE)
WIND: dict[str, Any] = dict(
    states=("north [m/s]", "east [m/s]"),
    more_states=("down [m/s]",),
    state_std=10.0,
    state_walk=0.1,
    shared="wind",
)
TRUE = MeasurementModel(
    "true-airspeed",
    observe_true,
    ("speed",),
    pose_axes="b",
    parameters="antenna",
    calibration_parameters=("clock", "scale", "vertical-wind"),
    reference="Beard & McLain (2012) section 2.4",
    **WIND,
)
INDICATED = MeasurementModel(
    "indicated-airspeed",
    observe_indicated,
    ("speed",),
    pose_axes="b",
    parameters="antenna",
    more_parameters="atmosphere",
    calibration_parameters=("clock", "scale", "vertical-wind"),
    reference="incompressible: Beard & McLain (2012) section 7.2; ICAO Doc 7488",
    **WIND,
)
SIDE_SLIP = MeasurementModel(
    "side-slip",
    observe_side_slip,
    ("angle",),
    pose_axes="b",
    parameters="antenna",
    calibration_parameters=("clock", "mounting", "vertical-wind"),
    reference="Beard & McLain (2012) section 2.3, of a vane",
    **WIND,
)
ANGLE_OF_ATTACK = MeasurementModel(
    "angle-of-attack",
    observe_angle_of_attack,
    ("angle",),
    pose_axes="b",
    parameters="antenna",
    calibration_parameters=("clock", "mounting", "vertical-wind"),
    reference="Beard & McLain (2012) section 2.3",
    **WIND,
)
LATERAL = MeasurementModel(
    "zero-side-slip",
    observe_lateral,
    ("speed",),
    pose_axes="b",
    parameters="reference",
    recorded=False,
    calibration_parameters=("mounting", "vertical-wind"),
    reference="lateral air velocity of a fixed wing",
    **WIND,
)
DRAG = MeasurementModel(
    "rotor-drag",
    observe_drag,
    ("acceleration", "acceleration"),
    pose_axes="b",
    parameters="drag",
    recorded=False,
    when="moving",
    mean_of="accel",
    calibration_parameters=("scale", "vertical-wind"),
    reference="Martin & Salaun (2010), ICRA; Leishman et al. (2014), IEEE Control Systems 34(1)",
    **WIND,
)
