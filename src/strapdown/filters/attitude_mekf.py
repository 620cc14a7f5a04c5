"""Attitude and gyro bias from gyros, specific force and magnetic field: a multiplicative extended Kalman filter with six error states.

Its vertical is the specific force, carried along by the gyros and low-passed, so that the body's own accelerations, whose mean over seconds is small,
average out in a frame that does not turn with the body. Of the magnetic field only the horizontal direction is used. How far strength and dip of the
field are from what they were tells how large a disturbance is there, and the direction is trusted accordingly.
"""
import math

from ..core.attitude import LEAST_FORCE, SIX, carry, inject, measured, off_vertical, propagate, turn
from ..core.contract import ATT, BG, CORRECT, MAGNETIC_KIND, PREDICT, Filter, helper, kernel
from ..core.earth import GRAVITY_EQUATOR, RATE
from ..core.error_state import DX, OWN, auxiliary, measure
from ..core.gaussian import decay
from ..core.rotation import orthonormalise, rotate_left, wrap

EARTH_N, EARTH_D = OWN, OWN + 1     # Earth rate, rad/s
LOW_PASS, ACCELERATION, RATE_ERROR, HEADING, TIMING, DISTURBANCE = range(OWN + 2, OWN + 8)     # the options, as numbers
SECONDS, SINCE = OWN + 8, OWN + 9   # s since the start, and since the last field
STRENGTH, DIP = OWN + 10, OWN + 11  # of the field, running: T, rad
"""Places in aux."""
REFERENCE_TIME = 20.0
"""s: time constant of the running strength and dip while the field agrees with them."""
AGREES = 0.05
"""Disagreement of strength (relative) and dip (rad) beyond which they are followed more slowly."""


def start(start, noise, low_pass=2.0, acceleration=0.2, rate_error=0.002, heading=1.7, timing=0.03, disturbance=10.0):
    """Belief at `start`. What the sensors are assumed to do besides their white noise:

    low_pass: time constant of the specific force, s; acceleration: density of what it leaves of the body's own, m/s^2 sqrt(s); rate_error: scale
    errors of the gyros, per rate, sqrt(s); heading: density of the magnetic direction, deg sqrt(s); timing: the same per angular rate, s sqrt(s), for
    a field that lags behind the gyros; disturbance: how long one lasts, s. All 0: white noise alone.
    """
    options = dict(low_pass=low_pass, acceleration=acceleration, rate_error=rate_error, heading=heading, timing=timing, disturbance=disturbance)
    for name, value in options.items():
        if not 0 <= value < math.inf:
            raise ValueError(f"{name} is {value}; it must be a finite number, 0 or more")
    belief = start.belief(auxiliary(len(start.sd)))
    for i in range(15):
        belief.P[i, i] *= i in SIX
    aux, lat = belief.aux, belief.lla[0]
    aux[EARTH_N], aux[EARTH_D] = RATE * math.cos(lat), -RATE * math.sin(lat)
    aux[LOW_PASS], aux[ACCELERATION], aux[RATE_ERROR] = low_pass, acceleration ** 2 + noise.accel ** 2, rate_error ** 2
    aux[HEADING], aux[TIMING], aux[DISTURBANCE] = math.radians(heading) ** 2, timing ** 2, disturbance
    return belief


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """Turn the attitude with the bias-free gyros, grow P, and correct both by the vertical."""
    aux, bg = belief.aux, belief.bg
    if dt <= 0:
        return
    r0, r1, r2 = u[0] - bg[0] * dt, u[1] - bg[1] * dt, u[2] - bg[2] * dt
    w0, w2 = aux[EARTH_N] * dt, aux[EARTH_D] * dt
    q = noise.gyro * noise.gyro * dt + aux[RATE_ERROR] * (r0 * r0 + r1 * r1 + r2 * r2) / dt
    propagate(belief.P, belief.C, w0, w2, q, dt, noise)
    turn(belief, r0, r1, r2, w0, w2, dt)
    keep = decay(noise.gyro_decay * dt)
    for i in range(3):
        bg[i] *= keep
    aux[SECONDS] += dt
    aux[SINCE] += dt
    carry(belief.f, u, r0, r1, r2, dt, max(dt / (aux[LOW_PASS] + dt), dt / aux[SECONDS]))
    _level(belief, dt)


@helper
def _level(belief, dt):
    """Correct by the carried specific force, which points up but for the body's own acceleration."""
    f, dx = belief.f, belief.aux[DX]
    if f[0] * f[0] + f[1] * f[1] + f[2] * f[2] < LEAST_FORCE * LEAST_FORCE:
        return
    north, east = off_vertical(belief.C, f)
    variance = belief.aux[ACCELERATION] / (GRAVITY_EQUATOR * GRAVITY_EQUATOR * dt)
    measured(belief.P, 1.0, 0.0, 0.0, north, variance, dx)
    measured(belief.P, 0.0, 1.0, 0.0, east, variance, dx)
    inject(belief, dx)


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """Correct by the horizontal direction of a magnetic field, whose innovation is an angle (rad), or by the rows of another kind."""
    if kind == MAGNETIC_KIND:
        return _field(belief, y, sd, parameters, gate, innovation)
    nis = measure(belief, y, sd, observe, parameters, gate, innovation)
    if nis <= gate:
        theta, g = belief.aux[DX][ATT], belief.aux[DX][BG]
        rotate_left(theta[0], theta[1], theta[2], belief.C)
        orthonormalise(belief.C)
        for i in range(3):
            belief.bg[i] += g[i]
    dx = belief.aux[DX]
    for i in range(dx.size):
        dx[i] = 0.0
    return nis


@helper
def _field(belief, y, sd, parameters, gate, innovation):
    """Declination less the azimuth of the field y (T, body), turned to n; its derivative is exact in all three attitude errors."""
    C, aux, omega = belief.C, belief.aux, belief.omega
    north = C[0, 0] * y[0] + C[0, 1] * y[1] + C[0, 2] * y[2]
    east = C[1, 0] * y[0] + C[1, 1] * y[1] + C[1, 2] * y[2]
    down = C[2, 0] * y[0] + C[2, 1] * y[1] + C[2, 2] * y[2]
    square = north * north + east * east
    innovation[0] = wrap(math.atan2(parameters[1], parameters[0]) - math.atan2(east, north))
    innovation[1] = innovation[2] = math.nan
    if not square > 0:
        innovation[0] = math.nan
        return math.nan
    seconds = min(aux[SINCE], 1.0)
    aux[SINCE] = 0.0
    density = aux[HEADING] + aux[DISTURBANCE] * _departure(aux, square, down, seconds)
    density += aux[TIMING] * (omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2])
    variance = (sd[0] * sd[0] + sd[1] * sd[1] + sd[2] * sd[2]) / (3 * square) + (density / seconds if seconds > 0 else 0.0)
    nis = measured(belief.P, -north * down / square, -east * down / square, 1.0, innovation[0], variance, aux[DX])
    inject(belief, aux[DX])
    return nis


@helper
def _departure(aux, square, down, seconds):
    """Variance (rad^2) of the azimuth under a disturbance as large as strength and dip are off their running values, which follow.

    Strength and dip see two of the three components of a disturbance; the third, across, turns the azimuth by it over the horizontal field.
    """
    strength, dip = math.sqrt(square + down * down), math.atan2(down, math.sqrt(square))
    if aux[STRENGTH] == 0:
        aux[STRENGTH], aux[DIP] = strength, dip
    a, b = strength / aux[STRENGTH] - 1, dip - aux[DIP]
    off = a * a + b * b
    share = min(seconds / REFERENCE_TIME, 1.0) / max(1.0, off / (AGREES * AGREES)) ** 2
    aux[STRENGTH] += share * (strength - aux[STRENGTH])
    aux[DIP] += share * b
    return off * strength * strength / square


ATTITUDE_MEKF = Filter("attitude-mekf", "Markley (2003), J. Guidance 26(2); Fossen (2021) section 14.4.3; vertical after Laidig & Seel (2023), VQF",
                       start, predict, correct, states=SIX, estimates=SIX, uses=("magnetic-field", "heading"))
