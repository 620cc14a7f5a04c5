"""Ellipsoidal height of a point of the body: y = m."""
from ..core.contract import OBSERVE, Sensor, kernel

ALTITUDE = 3


@kernel(OBSERVE)
def observe(belief, y, parameters, innovation, H):
    """One row, down: estimated height of the point - y, m."""
    C = belief.C
    l0 = C[0, 0] * parameters[0] + C[0, 1] * parameters[1] + C[0, 2] * parameters[2]
    l1 = C[1, 0] * parameters[0] + C[1, 1] * parameters[1] + C[1, 2] * parameters[2]
    l2 = C[2, 0] * parameters[0] + C[2, 1] * parameters[1] + C[2, 2] * parameters[2]
    innovation[0] = belief.lla[2] - y[0] - l2
    H[0, 2] = 1.0
    H[0, 6], H[0, 7] = l1, -l0
    return 1


SENSOR = Sensor("altitude", ALTITUDE, observe, ("length",), parameters="antenna", reference="down component of the position fix")
