"""Velocity of a point of the vehicle along its own axes: wheel speed, and the constraints of a
vehicle that neither slips sideways nor hops.

h = C' v + omega x l; with true C = exp(theta) C the derivative by theta is C' S(v).
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, helper, kernel
from ..typing import Array
from . import augmented


@helper
def along(
    axis: int, belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: y - velocity of the point `source.parameters[0:3]` (m, body, from the IMU) along body
    axis 0, 1 or 2."""
    if augmented.any_of(belief, source):
        augmented.along(axis, belief, y, source, innovation, H)
        return 1
    C, v, w = belief.C_nb, belief.v_n, belief.omega
    i, j = (axis + 1) % 3, (axis + 2) % 3
    c0, c1, c2 = C[0, axis], C[1, axis], C[2, axis]
    innovation[0] = (
        y[0]
        - c0 * v[0]
        - c1 * v[1]
        - c2 * v[2]
        - (w[i] * source.parameters[j] - w[j] * source.parameters[i])
    )
    H[0, 3], H[0, 4], H[0, 5] = c0, c1, c2
    H[0, 6], H[0, 7], H[0, 8] = c1 * v[2] - c2 * v[1], c2 * v[0] - c0 * v[2], c0 * v[1] - c1 * v[0]
    H[0, 12 + i], H[0, 12 + j] = -source.parameters[j], source.parameters[i]
    return 1


@kernel(OBSERVE)
def observe_speed(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: forward speed, m/s."""
    return along(0, belief, y, source, innovation, H)


@kernel(OBSERVE)
def observe_lateral(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: speed to the right, m/s."""
    return along(1, belief, y, source, innovation, H)


@kernel(OBSERVE)
def observe_vertical(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> int:
    """One row: speed downwards in the body, m/s."""
    return along(2, belief, y, source, innovation, H)


FORWARD = MeasurementModel(
    "speed",
    observe_speed,
    ("speed",),
    parameters="reference",
    calibration_parameters=("clock", "mounting", "scale"),
    reference="odometer: Groves (2013) section 16.3",
    lanes=True,
)
LATERAL = MeasurementModel(
    "zero-lateral-velocity",
    observe_lateral,
    ("speed",),
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
    parameters="reference",
    recorded=False,
    calibration_parameters=("mounting",),
    reference="Dissanayake et al. (2001), IEEE Trans. Robotics and Automation 17(5)",
    lanes=True,
)
