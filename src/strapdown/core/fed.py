"""What filters share whose attitude comes from elsewhere, such as an AHRS: the known attitude, what its errors do to the velocity, bias models, Euler angles.

The known attitude is that of the last record, carried on by the gyros. Position and velocity are computed with it, so that their errors, with those
of the accelerometer biases, and the errors of attitude and gyro biases are two linear filters beside each other. Source: Fossen (2021) 14.3-14.4.
"""
import math

from .compiling import helper, matrix
from .contract import ATTITUDE_KIND, Noise
from .error_state import DV, DX, HEIGHT, MID, OWN, STEP, inject, inject_biases, linearised_step, measure
from .mechanization import mechanize
from .rotation import euler_to_matrix, matrix_to_euler, wrap

BEYOND = 0              # s with the pitch beyond STEEP, in a place that errors injected at once leave free: an extra column of the solution
ANGLES = OWN            # Euler angles, rad
KNOWN = OWN + 21        # the known attitude C_nb, 3 x 3; further on than what an open loop keeps
ERRORS = KNOWN + 9      # covariance of its errors in n when it was measured, rad^2: nn, ne, ee, dd
SINCE = ERRORS + 4      # s since then
CORRELATION = SINCE + 1 # s for which its errors are alike
DECAYING = SINCE + 2    # which bias model:
BIAS_MODELS = {"random-walk": 0.0, "decaying": 1.0}
"""Biases driven by white noise alone, or Gauss-Markov with the time constants of the IMU (where it has any), so that they fade without fixes."""
STEEP = math.radians(85.0)
"""Pitch from which on Euler angles are read off the rotation matrix: roll and heading move 11 times as fast as the body, and ever faster."""
SHORTEST = 1e-3         # s between two attitude records
BEYOND_COLUMN = "pitch_beyond_85_deg [s]"


def know(belief, bias, correlation=0.0):
    """Begin with the attitude of `belief` as the known one, as uncertain as P says; refuses an unknown bias model.

    correlation: time constant (s) of the errors of attitude records; 0 for errors that are new with each record.
    """
    if bias not in BIAS_MODELS:
        raise ValueError(f"bias is {bias!r}; it must be one of {', '.join(BIAS_MODELS)}")
    if not 0 <= correlation < math.inf:
        raise ValueError(f"correlation is {correlation} s; it must be a finite number, 0 or more")
    aux, P = belief.aux, belief.P
    aux[KNOWN:KNOWN + 9], aux[ERRORS:ERRORS + 4] = belief.C.ravel(), (P[6, 6], P[6, 7], P[7, 7], P[8, 8])
    aux[CORRELATION], aux[DECAYING] = correlation, BIAS_MODELS[bias]
    return belief


def with_angles(belief, start):
    """`belief` with the Euler angles of `start`."""
    belief.aux[ANGLES:ANGLES + 3] = start.rph
    return belief


@helper
def bias_model(belief, noise):
    """`noise` with the decay of the biases that was asked for."""
    decaying = belief.aux[DECAYING]
    return Noise(noise.gyro, noise.accel, noise.gyro_bias, noise.accel_bias, decaying * noise.gyro_decay, decaying * noise.accel_decay)


@helper
def measured_attitude(y, heading, C):
    """C_nb from y = roll, pitch, heading (rad), or from `heading` where that one is not measured. Returns the heading."""
    heading = heading if math.isnan(y[2]) else y[2]
    euler_to_matrix(y[0], y[1], heading, C)
    return heading


@helper
def take_attitude(belief, y, sd):
    """The measured attitude is the known one from now on; a heading that it lacks is the belief's."""
    aux, C = belief.aux, belief.C
    heading = measured_attitude(y, math.atan2(C[1, 0], C[0, 0]), matrix(aux, KNOWN, 3, 3))
    ch, sh, forward, right = math.cos(heading), math.sin(heading), sd[0] * sd[0], sd[1] * sd[1]
    aux[ERRORS], aux[ERRORS + 1] = ch * ch * forward + sh * sh * right, ch * sh * (forward - right)
    aux[ERRORS + 2], aux[ERRORS + 3] = sh * sh * forward + ch * ch * right, belief.P[8, 8] if math.isnan(y[2]) else sd[2] * sd[2]
    aux[SINCE] = 0.0


@helper
def weigh(belief, sd, kind):
    """Write the standard deviations to use of a fix into aux[DV], which is free between predictions: those given.

    Those of an attitude record are so much larger that independent errors have the low-frequency power of its correlated ones.
    """
    aux, used, scale = belief.aux, belief.aux[DV], 1.0
    if kind == ATTITUDE_KIND:
        scale = math.sqrt(max(2 * aux[CORRELATION] / max(aux[SINCE], SHORTEST), 1.0))
    for i in range(3):
        used[i] = scale * sd[i]


@helper
def held(belief, since, dt):
    """By how much the square of the time for which an error has acted grows over dt (s^2), `since` (s) after its record began to be used."""
    return (2 * max(since, belief.aux[CORRELATION]) + dt) * dt


@helper
def predict_fed(belief, u, dt, noise):
    """Advance P, position, velocity and the known attitude with bias-corrected increments. Returns the rotation vector of the body, rad."""
    ba, bg = belief.ba, belief.bg
    r0, r1, r2 = u[0] - bg[0] * dt, u[1] - bg[1] * dt, u[2] - bg[2] * dt
    a0, a1, a2 = u[3] - ba[0] * dt, u[4] - ba[1] * dt, u[5] - ba[2] * dt
    linearised_step(belief, matrix(belief.aux, KNOWN, 3, 3), 0.0, u, dt, noise, False)
    move(belief, belief.lla, belief.v, r0, r1, r2, a0, a1, a2, dt, noise)
    return r0, r1, r2


@helper
def move(belief, lla, v, r0, r1, r2, a0, a1, a2, dt, noise):
    """Advance lla, v and the known attitude by rotation r and velocity increment a (body), and P by what errors of that attitude do to the velocity.

    An error n held for the time s since the record moves the velocity by s f x n, whose variance grows by (2 s + dt) dt of that of f x n.
    """
    aux, P, f = belief.aux, belief.P, belief.aux[DX]
    mechanize(lla, v, matrix(aux, KNOWN, 3, 3), r0, r1, r2, a0, a1, a2, dt, f, aux[HEIGHT])
    f0, f1, f2 = f[0], f[1], f[2]
    growth = held(belief, aux[SINCE], dt) / (dt * dt)   # f is the increment, and so has dt in it
    nn, ne, ee, dd = known_variances(belief, noise)
    n0, n1, n2 = -f2 * ne, -f2 * ee, f1 * dd    # rows of f x n: their products with n
    e0, e1, e2 = f2 * nn, f2 * ne, -f0 * dd
    d0, d1 = f0 * ne - f1 * nn, f0 * ee - f1 * ne
    P[3, 3] += growth * (f1 * n2 - f2 * n1)
    P[4, 4] += growth * (f2 * e0 - f0 * e2)
    P[5, 5] += growth * (f0 * d1 - f1 * d0)
    north_east, north_down, east_down = growth * (f2 * n0 - f0 * n2), growth * (f0 * n1 - f1 * n0), growth * (f0 * e1 - f1 * e0)
    P[3, 4] += north_east
    P[4, 3] += north_east
    P[3, 5] += north_down
    P[5, 3] += north_down
    P[4, 5] += east_down
    P[5, 4] += east_down
    aux[SINCE] += dt


@helper
def known_variances(belief, noise):
    """Covariance of the known attitude's errors in n, rad^2: nn, ne, ee, dd; with the share of what the gyros have added since that keeps `move` right."""
    aux, P = belief.aux, belief.P
    since = aux[SINCE]
    carried = 0.5 * since * (noise.gyro * noise.gyro + since * (P[12, 12] + P[13, 13] + P[14, 14]) / 3)
    return aux[ERRORS] + carried, aux[ERRORS + 1], aux[ERRORS + 2] + carried, aux[ERRORS + 3] + carried


@helper
def rate_of_body(belief, r0, r1, r2):
    """Rotation vector of the body to n, in the body (rad): r less that of n."""
    m, w = belief.aux[MID:], belief.aux[STEP]
    w0, w1, w2 = w[2], w[3], w[4]
    return r0 - m[0] * w0 - m[3] * w1 - m[6] * w2, r1 - m[1] * w0 - m[4] * w1 - m[7] * w2, r2 - m[2] * w0 - m[5] * w1 - m[8] * w2


@helper
def euler_rates(sr, cr, tp, cp, r0, r1, r2):
    """T(Theta) r: changes of roll, pitch and heading by a small rotation r of the body, from sine and cosine of roll, tangent and cosine of pitch."""
    across = sr * r1 + cr * r2
    return r0 + tp * across, cr * r1 - sr * r2, across / cp


@helper
def gentle(belief, turn):
    """Whether the Euler angles stay away from their singularity while the body turns by `turn` (rad)."""
    return abs(belief.aux[ANGLES + 1]) + turn < STEEP


@helper
def add_angles(belief, d0, d1, d2):
    """Add to the Euler angles and make the belief's attitude of them."""
    angles = belief.aux[ANGLES:ANGLES + 3]
    angles[0], angles[1], angles[2] = wrap(angles[0] + d0), angles[1] + d1, wrap(angles[2] + d2)
    euler_to_matrix(angles[0], angles[1], angles[2], belief.C)


@helper
def read_angles(belief):
    """The Euler angles are those of the belief's attitude."""
    angles = belief.aux[ANGLES:ANGLES + 3]
    angles[0], angles[1], angles[2] = matrix_to_euler(belief.C)


@helper
def correct_angles(belief, y, sd, observe, parameters, gate, innovation):
    """Correct P and the belief by one fix: angles by angles, unless they are steep. Returns the NIS."""
    nis = measure(belief, y, sd, observe, parameters, gate, innovation)
    if nis <= gate:
        dx = belief.aux[DX]
        inject(belief.lla, belief.v, belief.C, dx)
        inject_biases(belief, dx)
        if gentle(belief, math.sqrt(dx[6] * dx[6] + dx[7] * dx[7] + dx[8] * dx[8])):
            inject_angles(belief, dx[6], dx[7], dx[8])
        else:
            read_angles(belief)
    return nis


@helper
def inject_angles(belief, x, y, z):
    """Add to the Euler angles what a small rotation (x, y, z) in n (rad) means to first order: the inverse of their Jacobian."""
    angles = belief.aux[ANGLES:ANGLES + 3]
    ch, sh = math.cos(angles[2]), math.sin(angles[2])
    forward = (ch * x + sh * y) / math.cos(angles[1])
    add_angles(belief, forward, ch * y - sh * x, z + forward * math.sin(angles[1]))


def steep(t, lla, columns):
    """[(t, text)] where the pitch first was beyond STEEP, else []."""
    seconds = columns[BEYOND_COLUMN]
    rows = (seconds > 0).nonzero()[0]
    return [(float(t[rows[0]]), f"pitch beyond 85 deg for {seconds[-1]:.3g} s, first here: Euler angles are near their singularity and "
             "attitude is kept as a rotation matrix meanwhile")] if len(rows) else []
