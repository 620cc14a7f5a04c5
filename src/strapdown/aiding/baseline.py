"""Vector between two antennas of one vehicle: y = from the first to the second, m NED. The same
vector in the body is known, so the measurement shows the attitude about every axis but its own.

With true C = exp(theta) C the derivative of C l by theta is -S(C l). Its length does not depend on
the attitude: `preprocessing/baseline_length.py` compares it with the given one.
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.rotation import rotate_vector
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: y - C l, m NED; source.parameters[0:3] is l, m in the body."""
    l0, l1, l2 = rotate_vector(
        belief.C_nb, source.parameters[0], source.parameters[1], source.parameters[2]
    )
    innovation[0], innovation[1], innovation[2] = y[0] - l0, y[1] - l1, y[2] - l2
    H[0, 7], H[0, 8] = l2, -l1
    H[1, 6], H[1, 8] = -l2, l0
    H[2, 6], H[2, 7] = l1, -l0
    return 3


MEASUREMENT = MeasurementModel(
    "baseline",
    observe,
    ("length", "length", "length"),
    pose_axes="n",
    parameters="baseline",
    vector="n",
    reference="lever arm of Groves (2013) eq. 14.111, between two antennas",
    lanes=True,
)
