"""Velocity of an antenna over ground: y = north, east, down, m/s. The Earth's rate in the
lever-arm term (7e-5 rad/s) is left out."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..typing import Array
from . import augmented


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: antenna velocity y - h, m/s NED."""
    if augmented.any_of(belief, source):
        for i in range(3):
            innovation[i] = y[i] - belief.v_n[i]
        augmented.velocity(belief, source, innovation, H)
        return 3
    C, w = belief.C_nb, belief.omega
    l0, l1, l2 = source.parameters[0], source.parameters[1], source.parameters[2]
    b0, b1, b2 = w[1] * l2 - w[2] * l1, w[2] * l0 - w[0] * l2, w[0] * l1 - w[1] * l0
    n0 = C[0, 0] * b0 + C[0, 1] * b1 + C[0, 2] * b2
    n1 = C[1, 0] * b0 + C[1, 1] * b1 + C[1, 2] * b2
    n2 = C[2, 0] * b0 + C[2, 1] * b1 + C[2, 2] * b2
    innovation[0] = y[0] - belief.v_n[0] - n0
    innovation[1] = y[1] - belief.v_n[1] - n1
    innovation[2] = y[2] - belief.v_n[2] - n2
    H[0, 3] = H[1, 4] = H[2, 5] = 1.0
    H[0, 7], H[0, 8] = n2, -n1
    H[1, 6], H[1, 8] = -n2, n0
    H[2, 6], H[2, 7] = n1, -n0
    for i in range(3):
        H[i, 12] = C[i, 1] * l2 - C[i, 2] * l1
        H[i, 13] = C[i, 2] * l0 - C[i, 0] * l2
        H[i, 14] = C[i, 0] * l1 - C[i, 1] * l0
    return 3


MEASUREMENT = MeasurementModel(
    "velocity",
    observe,
    ("speed", "speed", "speed"),
    pose_axes="n",
    parameters="antenna",
    vector="n",
    calibration_parameters=("clock", "lever-arm", "mounting"),
    reference="Groves (2013) eq. 14.111",
    lanes=True,
)
