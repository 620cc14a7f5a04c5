"""What attitude filters share: the specific force carried along by the gyros, and the covariance of six of the fifteen error states.

The six are attitude (6-8, in n) and gyro bias (12-14); they keep their places in the 15 x 15 covariance, whose other rows stay zero.
"""
import math

from .compiling import helper
from .gaussian import decay
from .rotation import orthonormalise, rotate_left, rotate_right

SIX = (6, 7, 8, 12, 13, 14)
"""Places of attitude and gyro bias among the error states."""
RECORD, UNUSED = 11, 9
"""Numbers that a scalar measurement leaves for the smoother: gain (6), h (3), 1/variance of the innovation, innovation; the last but one is 0 where
nothing was used."""
LEAST_FORCE = 0.5
"""m/s^2: a specific force below it (free fall) has no direction."""


@helper
def turn(belief, r0, r1, r2, w0, w2, dt):
    """Turn the attitude by the rotation vector r (body, rad) and the navigation frame by (w0, 0, w2) (rad); publish the rate."""
    C, omega = belief.C, belief.omega
    rotate_right(C, r0, r1, r2)
    rotate_left(-w0, 0.0, -w2, C)
    if dt > 0:
        omega[0], omega[1], omega[2] = r0 / dt, r1 / dt, r2 / dt


@helper
def carry(f, u, r0, r1, r2, dt, share):
    """Turn the specific force f (m/s^2, body) against the rotation vector r, as a vector at rest in n turns, and mix in `share` of the new sample."""
    x0, x1, x2 = r1 * f[2] - r2 * f[1], r2 * f[0] - r0 * f[2], r0 * f[1] - r1 * f[0]
    f0 = f[0] - x0 + 0.5 * (r1 * x2 - r2 * x1)
    f1 = f[1] - x1 + 0.5 * (r2 * x0 - r0 * x2)
    f2 = f[2] - x2 + 0.5 * (r0 * x1 - r1 * x0)
    f[0] = f0 + share * (u[3] / dt - f0)
    f[1] = f1 + share * (u[4] / dt - f1)
    f[2] = f2 + share * (u[5] / dt - f2)


@helper
def off_vertical(C, f):
    """Rotation (north, east; rad) that takes the specific force f, turned to n, to straight up; (0, 0) without any force.

    It is the exact one, so that an attitude that is upside down finds its way too.
    """
    n0 = C[0, 0] * f[0] + C[0, 1] * f[1] + C[0, 2] * f[2]
    n1 = C[1, 0] * f[0] + C[1, 1] * f[1] + C[1, 2] * f[2]
    n2 = C[2, 0] * f[0] + C[2, 1] * f[1] + C[2, 2] * f[2]
    across = math.sqrt(n0 * n0 + n1 * n1)
    if across < 1e-12 * abs(n2):
        return (0.0 if n2 < 0 else math.pi), 0.0
    if across == 0:
        return 0.0, 0.0
    angle = math.atan2(across, -n2) / across
    return -n1 * angle, n0 * angle


@helper
def propagate(P, C, w0, w2, q, dt, noise):
    """P over dt: attitude errors turn with -(w0, 0, w2) (rad) and gather q (rad^2) and - C dt times the gyro bias, which decays and walks."""
    keep = decay(noise.gyro_decay * dt)
    walk = noise.gyro_bias * noise.gyro_bias * dt
    for j in range(3):      # T B, T = I - [w x], kept below the diagonal for the attitude block
        b0, b1, b2 = P[6, 12 + j], P[7, 12 + j], P[8, 12 + j]
        P[12 + j, 6], P[12 + j, 7], P[12 + j, 8] = b0 + w2 * b1, b1 - w2 * b0 + w0 * b2, b2 - w0 * b1
    for i in range(3):      # T B - C dt D above it
        c0, c1, c2 = dt * C[i, 0], dt * C[i, 1], dt * C[i, 2]
        for j in range(3):
            P[6 + i, 12 + j] = P[12 + j, 6 + i] - (c0 * P[12, 12 + j] + c1 * P[13, 12 + j] + c2 * P[14, 12 + j])
    a00, a01, a02, a11, a12, a22 = P[6, 6], P[6, 7], P[6, 8], P[7, 7], P[7, 8], P[8, 8]
    P[6, 6], P[6, 7], P[6, 8] = a00 + 2 * w2 * a01 + q, a01 + w2 * (a11 - a00) + w0 * a02, a02 + w2 * a12 - w0 * a01
    P[7, 7], P[7, 8], P[8, 8] = a11 + 2 * (w0 * a12 - w2 * a01) + q, a12 - w2 * a02 + w0 * (a22 - a11), a22 - 2 * w0 * a12 + q
    for i in range(3):
        for j in range(i, 3):
            P[6 + i, 6 + j] -= dt * (P[12, 6 + i] * C[j, 0] + P[13, 6 + i] * C[j, 1] + P[14, 6 + i] * C[j, 2]
                                     + C[i, 0] * P[6 + j, 12] + C[i, 1] * P[6 + j, 13] + C[i, 2] * P[6 + j, 14])
            P[6 + j, 6 + i] = P[6 + i, 6 + j]
    for i in range(3):
        for j in range(3):
            P[6 + i, 12 + j] *= keep
            P[12 + j, 6 + i] = P[6 + i, 12 + j]
            P[12 + i, 12 + j] *= keep * keep
        P[12 + i, 12 + i] += walk


@helper
def measured(P, h0, h1, h2, e, variance, gate, dx, record):
    """One scalar e = h . attitude error + noise: takes from P what it tells and adds it to the correction dx (6 numbers), unless its NIS is above `gate`.

    dx holds what was found at the same attitude before, so that several can follow each other and be injected once. `record` (RECORD numbers) gets
    what the smoother needs, zeros where nothing was used. Returns the NIS.
    """
    k0 = h0 * P[6, 6] + h1 * P[6, 7] + h2 * P[6, 8]
    k1 = h0 * P[6, 7] + h1 * P[7, 7] + h2 * P[7, 8]
    k2 = h0 * P[6, 8] + h1 * P[7, 8] + h2 * P[8, 8]
    k3 = h0 * P[6, 12] + h1 * P[7, 12] + h2 * P[8, 12]
    k4 = h0 * P[6, 13] + h1 * P[7, 13] + h2 * P[8, 13]
    k5 = h0 * P[6, 14] + h1 * P[7, 14] + h2 * P[8, 14]
    e -= h0 * dx[0] + h1 * dx[1] + h2 * dx[2]
    scale = 1 / (h0 * k0 + h1 * k1 + h2 * k2 + variance)
    nis = e * e * scale
    record[UNUSED] = 0.0
    if not nis <= gate:
        return nis
    gain = (k0, k1, k2, k3, k4, k5)
    for i in range(6):
        g, row = gain[i] * scale, SIX[i]
        record[i] = g
        dx[i] += g * e
        for j in range(i, 6):
            P[row, SIX[j]] -= g * gain[j]
            P[SIX[j], row] = P[row, SIX[j]]
    record[6], record[7], record[8], record[UNUSED], record[10] = h0, h1, h2, scale, e
    return nis


@helper
def inject(belief, dx):
    """Compose the correction dx (attitude in n, rad; gyro bias, rad/s) into the belief, and make it zero."""
    rotate_left(dx[0], dx[1], dx[2], belief.C)
    orthonormalise(belief.C)
    for i in range(3):
        belief.bg[i] += dx[3 + i]
        dx[i] = dx[3 + i] = 0.0
