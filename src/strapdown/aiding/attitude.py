"""Attitude from elsewhere, such as an AHRS: y = roll, pitch, heading, rad. Roll and pitch come together; a heading that is not measured is NaN.

The innovation is the rotation from the estimated to the measured attitude, about the horizontal forward and right axes and the vertical, so that
the three standard deviations are those of roll, pitch and heading of a body that is not steep, and no pitch is singular.
"""
import math

from ..core.contract import ATTITUDE_KIND, OBSERVE, Sensor, kernel
from ..core.rotation import rotation_between

ATTITUDE = ATTITUDE_KIND


@kernel(OBSERVE)
def observe(belief, y, parameters, innovation, H):
    """Three rows: rotation vector forward, right, down, rad."""
    C = belief.C
    known = not math.isnan(y[2])
    heading = y[2] if known else math.atan2(C[1, 0], C[0, 0])
    sr, cr, sp, cp, sh, ch = math.sin(y[0]), math.cos(y[0]), math.sin(y[1]), math.cos(y[1]), math.sin(heading), math.cos(heading)
    north, east, down = rotation_between(C, (cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh,
                                             cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch, -sp, sr * cp, cr * cp))
    innovation[0], innovation[1], innovation[2] = ch * north + sh * east, ch * east - sh * north, down if known else math.nan
    H[0, 6], H[0, 7] = ch, sh
    H[1, 6], H[1, 7] = -sh, ch
    H[2, 8] = 1.0
    return 3


SENSOR = Sensor("attitude", ATTITUDE, observe, ("angle", "angle", "angle"), reference="AHRS measurement of Fossen (2021) section 14.3.2")
