"""Attitude and gyro bias from gyros, specific force and magnetic field: a multiplicative extended Kalman filter with six error states.

Its vertical is the specific force carried along by the gyros and low-passed, so that the body's own accelerations, whose mean over seconds is small,
average out in a frame that does not turn with it. Of the magnetic field only the horizontal direction corrects anything; the weaker the trust in it, the
more its strength and dip differ from what they were: a magnet or iron nearby changes them.
"""
import math

from ..core.contract import ATT, BG, CORRECT, MAGNETIC_KIND, PREDICT, Filter, helper, kernel
from ..core.earth import GRAVITY_EQUATOR, RATE
from ..core.error_state import DX, OWN, auxiliary, measure
from ..core.gaussian import decay
from ..core.rotation import orthonormalise, rotate_left, rotate_right, wrap

EARTH = OWN             # Earth rate north and down, rad/s
LOW_PASS = OWN + 2      # time constant, s
ACCELERATION = OWN + 3  # variance density of the horizontal acceleration that is left, (m/s^2)^2 s
SECONDS = OWN + 4       # s since the start
STRENGTH, DIP = OWN + 5, OWN + 6    # of the magnetic field, running: T, rad
"""Places in aux."""


def start(start, noise, low_pass=2.0, acceleration=0.5):
    """Belief at `start`. low_pass: time constant of the specific force, s, 0 for none; acceleration: what it leaves of the body's own, m/s^2."""
    for name, value in (("low_pass", low_pass), ("acceleration", acceleration)):
        if not 0 <= value < math.inf:
            raise ValueError(f"{name} is {value}; it must be a finite number, 0 or more")
    belief = start.belief(auxiliary(len(start.sd)))
    keep = [*range(*ATT.indices(15)), *range(*BG.indices(15))]
    for i in range(15):
        if i not in keep:
            belief.P[i, i] = 0.0
    aux, lat = belief.aux, belief.lla[0]
    aux[EARTH], aux[EARTH + 1] = RATE * math.cos(lat), -RATE * math.sin(lat)
    aux[LOW_PASS], aux[ACCELERATION] = low_pass, acceleration * acceleration * max(low_pass, 0.0) + noise.accel ** 2
    return belief
