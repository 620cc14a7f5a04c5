"""A floating body heaves about mean sea level. The waves are the noise: `sd` is that of the heave, m.

y is the height of mean sea level above the ellipsoid, m: the undulation of the geoid where heights are ellipsoidal, 0 where heave is all that is wanted.
"""
from ..core.contract import OBSERVE, SEA_LEVEL_KIND, Sensor, kernel

ZERO_SEA_LEVEL = SEA_LEVEL_KIND


@kernel(OBSERVE)
def observe(belief, y, parameters, innovation, H):
    """One row, down: estimated height of the point - y, m; parameters[0:3] is the lever arm to the point of the waterline, m, body."""
    C = belief.C
    l0 = C[0, 0] * parameters[0] + C[0, 1] * parameters[1] + C[0, 2] * parameters[2]
    l1 = C[1, 0] * parameters[0] + C[1, 1] * parameters[1] + C[1, 2] * parameters[2]
    l2 = C[2, 0] * parameters[0] + C[2, 1] * parameters[1] + C[2, 2] * parameters[2]
    innovation[0] = belief.lla[2] - y[0] - l2
    H[0, 2] = 1.0
    H[0, 6], H[0, 7] = l1, -l0
    return 1


SENSOR = Sensor("zero-sea-level", ZERO_SEA_LEVEL, observe, ("length",), parameters="reference", recorded=False,
                reference="Fossen (2021) section 14.4.3: z = 0 aiding of surface craft")
