"""Velocity of a point of the vehicle along directions of the body: wheel speed, the vector of a Doppler
log or a camera, one acoustic beam, and the constraints of a vehicle that neither slips sideways nor
hops.

h = d' (C' v + omega x l); with true C = exp(theta) C the derivative by theta is (C d) x v.
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, helper, kernel
from ..core.mathematics.rotation import Three, axis, cross, rotate_vector
from ..typing import Array
from . import augmented


@helper
def along(
    d: Three,
    row: int,
    belief: FilterState,
    y: Array,
    source: SourceRow,
    innovation: Array,
    H: Array,
) -> None:
    """One row: y - velocity of the point `source.parameters[0:3]` (m, body, from the IMU) along the unit
    vector d of the body."""
    if augmented.any_of(belief, source):
        augmented.along(d, row, belief, y, source, innovation, H)
        return
    C, v, w = belief.C_nb, belief.v_n, belief.omega
    l = source.parameters[0], source.parameters[1], source.parameters[2]
    c = rotate_vector(C, d[0], d[1], d[2])
    by_bias = cross(d, l)
    innovation[row] = (
        y[row]
        - c[0] * v[0]
        - c[1] * v[1]
        - c[2] * v[2]
        + (w[0] * by_bias[0] + w[1] * by_bias[1] + w[2] * by_bias[2])
    )
    H[row, 3], H[row, 4], H[row, 5] = c
    H[row, 6], H[row, 7], H[row, 8] = cross(c, (v[0], v[1], v[2]))
    H[row, 12], H[row, 13], H[row, 14] = by_bias


@kernel(OBSERVE)
def observe_speed(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: forward speed, m/s."""
    along(axis(0), 0, belief, y, source, innovation, H)
    return 1


@kernel(OBSERVE)
def observe_lateral(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: speed to the right, m/s."""
    along(axis(1), 0, belief, y, source, innovation, H)
    return 1


@kernel(OBSERVE)
def observe_vertical(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: speed downwards in the body, m/s."""
    along(axis(2), 0, belief, y, source, innovation, H)
    return 1


@kernel(OBSERVE)
def observe_vector(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """Three rows: velocity forward, to the right and down, m/s."""
    for k in range(3):
        along(axis(k), k, belief, y, source, innovation, H)
    return 3


@kernel(OBSERVE)
def observe_beam(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: velocity along the unit vector source.parameters[3:6] of the body, m/s."""
    d = source.parameters[3], source.parameters[4], source.parameters[5]
    along(d, 0, belief, y, source, innovation, H)
    return 1


FORWARD = MeasurementModel(
    "speed",
    observe_speed,
    ("speed",),
    pose_axes="b",
    parameters="reference",
    calibration_parameters=("clock", "mounting", "scale"),
    reference="odometer: Groves (2013) section 16.3",
    lanes=True,
)
VECTOR = MeasurementModel(
    "body-velocity",
    observe_vector,
    ("speed", "speed", "speed"),
    pose_axes="b",
    parameters="reference",
    vector="b",
    calibration_parameters=("clock", "mounting", "scale"),
    reference="Doppler log: the velocity that an odometer measures, along all three axes",
    lanes=True,
)
BEAM = MeasurementModel(
    "beam-velocity",
    observe_beam,
    ("speed",),
    pose_axes="b",
    parameters="reference",
    more_parameters="direction",
    calibration_parameters=("scale",),
    reference="one beam of a Doppler log: the velocity along a direction of the body",
    lanes=True,
)
LATERAL = MeasurementModel(
    "zero-lateral-velocity",
    observe_lateral,
    ("speed",),
    pose_axes="b",
    parameters="reference",
    recorded=False,
    slips=True,
    calibration_parameters=("mounting",),
    reference="Dissanayake et al. (2001), IEEE Trans. Robotics and Automation 17(5)",
    lanes=True,
)
VERTICAL = MeasurementModel(
    "zero-vertical-velocity",
    observe_vertical,
    ("speed",),
    pose_axes="b",
    parameters="reference",
    recorded=False,
    calibration_parameters=("mounting",),
    reference="Dissanayake et al. (2001), IEEE Trans. Robotics and Automation 17(5)",
    lanes=True,
)
