"""Geodetic position of an antenna: y = latitude (rad), longitude (rad), ellipsoidal height (m)."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.earth import radii
from ..core.mathematics.elementary import cosine
from ..core.mathematics.rotation import rotate_vector, wrap
from ..typing import Array
from . import augmented


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: antenna position y - h, m NED."""
    R_M, R_N = radii(belief.lla[0])
    innovation[0] = (y[0] - belief.lla[0]) * (R_M + belief.lla[2])
    innovation[1] = wrap(y[1] - belief.lla[1]) * (R_N + belief.lla[2]) * cosine(belief.lla[0])
    innovation[2] = belief.lla[2] - y[2]
    if augmented.any_of(belief, source):
        augmented.position(belief, source, innovation, H)
        return 3
    l0, l1, l2 = rotate_vector(
        belief.C_nb, source.parameters[0], source.parameters[1], source.parameters[2]
    )
    innovation[0] -= l0
    innovation[1] -= l1
    innovation[2] -= l2
    H[0, 0] = H[1, 1] = H[2, 2] = 1.0
    H[0, 7], H[0, 8] = l2, -l1
    H[1, 6], H[1, 8] = -l2, l0
    H[2, 6], H[2, 7] = l1, -l0
    return 3


MEASUREMENT = MeasurementModel(
    "position",
    observe,
    ("latitude", "longitude", "length"),
    pose_axes="n",
    parameters="antenna",
    calibration_parameters=("clock", "lever-arm", "mounting"),
    reference="Groves (2013) eq. 14.111",
    lanes=True,
)
