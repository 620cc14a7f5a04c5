"""Functions shared by the attitude filters: the specific force carried along by the gyros, and the
covariance of six of the fifteen error states.

The six are attitude (6-8, in n) and gyro bias (12-14); they keep their places in the 15 x 15
covariance, whose other rows stay zero.
"""

import math

from ...core.compile.jit import helper, inline
from ...core.loop.contract import FilterState, Noise, Slots
from ...core.mathematics.kalman import MIN_NOISE, decay
from ...core.mathematics.rotation import orthonormalise, rotate_left, rotate_right, rotate_vector
from ...typing import Array

SIX = (6, 7, 8, 12, 13, 14)
"""Places of attitude and gyro bias among the error states."""
RECORD = Slots()
"""Slots that a scalar measurement leaves for the smoother."""
GAIN = RECORD.array("GAIN", 6)
ROW = RECORD.array("ROW", 3)  # of H, on the attitude
INVERSE = RECORD.number("INVERSE")  # 1/variance of the innovation; 0 where nothing was used
SEEN = RECORD.number("SEEN")  # the innovation
TRANSITION = Slots()
"""Slots that a prediction leaves for it."""
TURNED = TRANSITION.matrix("TURNED", 3, 3)  # C dt, s
NORTH, DOWN = TRANSITION.numbers("NORTH", "DOWN")  # rotation of n, rad
KEEP = TRANSITION.number("KEEP")  # what the decay leaves of the bias
UNAIDED = "no magnetic field and no heading: heading and the gyro bias about the vertical are not observed and drift"
"""Warning where nothing measures the heading."""
FREE_FALL_FORCE = 0.5
"""m/s^2: a specific force below it (free fall) has no direction."""


@inline
def _six(i: int) -> int:
    """SIX[i], as arithmetic: looking it up where a loop is not unrolled takes longer than the sum."""
    return 6 + i if i < 3 else 9 + i


@helper
def turn(
    belief: FilterState, r0: float, r1: float, r2: float, w0: float, w2: float, dt: float
) -> None:
    """Turn the attitude by the rotation vector r (body, rad) and the navigation frame by (w0, 0,
    w2) (rad); publish the rate."""
    C, omega = belief.C_nb, belief.omega
    rotate_right(C, r0, r1, r2)
    rotate_left(-w0, 0.0, -w2, C)
    if dt > 0:
        omega[0], omega[1], omega[2] = r0 / dt, r1 / dt, r2 / dt


@helper
def carry(
    f: Array, u: Array | tuple[float, ...], r0: float, r1: float, r2: float, dt: float, share: float
) -> None:
    """Turn the specific force f (m/s^2, body) against the rotation vector r, as a vector at rest in
    n turns, and mix in `share` of the new sample.

    That one is a mean over the sample, which r turns by half (and a twelfth of its square); both to
    second order.
    """
    f0, f1, f2, share = f[0] * (1 - share), f[1] * (1 - share), f[2] * (1 - share), share / dt
    a0, a1, a2 = share * u[3], share * u[4], share * u[5]
    x0, x1, x2 = f0 + a0 / 6, f1 + a1 / 6, f2 + a2 / 6
    y0, y1, y2 = (
        f0 + 0.5 * (a0 - r1 * x2 + r2 * x1),
        f1 + 0.5 * (a1 - r2 * x0 + r0 * x2),
        f2 + 0.5 * (a2 - r0 * x1 + r1 * x0),
    )
    f[0], f[1], f[2] = (
        f0 + a0 - r1 * y2 + r2 * y1,
        f1 + a1 - r2 * y0 + r0 * y2,
        f2 + a2 - r0 * y1 + r1 * y0,
    )


@helper
def low_passed(
    belief: FilterState,
    u: Array,
    r0: float,
    r1: float,
    r2: float,
    dt: float,
    time_constant: float,
    seconds: float,
    made_up: bool,
) -> float:
    """Carry belief.f along, low-passed over `time_constant` (s), or over the `seconds` since the
    start where those are fewer. Returns the new seconds.

    Over a gap the loop makes samples up, which know nothing of the vertical: then it is carried
    only, and counts for less.
    """
    if made_up:
        carry(belief.f, u, r0, r1, r2, dt, 0.0)
        return max(min(seconds, time_constant) - dt, 0.0)
    seconds += dt
    carry(belief.f, u, r0, r1, r2, dt, max(dt / (time_constant + dt), dt / seconds))
    return seconds


@helper
def off_vertical(C: Array, f: Array) -> tuple[float, float]:
    """Rotation (north, east; rad) that takes the specific force f, turned to n, to straight up; (0,
    0) without any force.

    It is the exact one, so that an attitude that is upside down finds its way too.
    """
    n0, n1, n2 = rotate_vector(C, f[0], f[1], f[2])
    across = math.sqrt(n0 * n0 + n1 * n1)
    if across < 1e-12 * abs(n2):
        return (0.0 if n2 < 0 else math.pi), 0.0
    if across == 0:
        return 0.0, 0.0
    angle = math.atan2(across, -n2) / across
    return -n1 * angle, n0 * angle


@helper
def propagate(P: Array, C: Array, w0: float, w2: float, q: float, dt: float, noise: Noise) -> None:
    """P over dt: attitude errors turn with -(w0, 0, w2) (rad) and gather q (rad^2) and - C dt
    times the gyro bias, which decays and walks."""
    keep = decay(noise.gyro_decay * dt)
    walk = noise.gyro_bias * noise.gyro_bias * dt
    for j in range(3):  # T B, T = I - [w x], kept below the diagonal for the attitude block
        b0, b1, b2 = P[6, 12 + j], P[7, 12 + j], P[8, 12 + j]
        P[12 + j, 6], P[12 + j, 7], P[12 + j, 8] = (
            b0 + w2 * b1,
            b1 - w2 * b0 + w0 * b2,
            b2 - w0 * b1,
        )
    for i in range(3):  # T B - C dt D above it
        c0, c1, c2 = dt * C[i, 0], dt * C[i, 1], dt * C[i, 2]
        for j in range(3):
            P[6 + i, 12 + j] = P[12 + j, 6 + i] - (
                c0 * P[12, 12 + j] + c1 * P[13, 12 + j] + c2 * P[14, 12 + j]
            )
    a00, a01, a02, a11, a12, a22 = P[6, 6], P[6, 7], P[6, 8], P[7, 7], P[7, 8], P[8, 8]
    P[6, 6], P[6, 7], P[6, 8] = (
        a00 + 2 * w2 * a01 + q,
        a01 + w2 * (a11 - a00) + w0 * a02,
        a02 + w2 * a12 - w0 * a01,
    )
    P[7, 7], P[7, 8], P[8, 8] = (
        a11 + 2 * (w0 * a12 - w2 * a01) + q,
        a12 - w2 * a02 + w0 * (a22 - a11),
        a22 - 2 * w0 * a12 + q,
    )
    for i in range(3):
        for j in range(i, 3):
            P[6 + i, 6 + j] -= dt * (
                P[12, 6 + i] * C[j, 0]
                + P[13, 6 + i] * C[j, 1]
                + P[14, 6 + i] * C[j, 2]
                + C[i, 0] * P[6 + j, 12]
                + C[i, 1] * P[6 + j, 13]
                + C[i, 2] * P[6 + j, 14]
            )
            P[6 + j, 6 + i] = P[6 + i, 6 + j]
    for i in range(3):
        for j in range(3):
            P[6 + i, 12 + j] *= keep
            P[12 + j, 6 + i] = P[6 + i, 12 + j]
            P[12 + i, 12 + j] *= keep * keep
        P[12 + i, 12 + i] += walk


@inline
def scalar_update(
    P: Array,
    h0: float,
    h1: float,
    h2: float,
    e: float,
    variance: float,
    gate: float,
    dx: Array,
    record: Array,
) -> float:
    """One scalar e = h . attitude error + noise: takes from P what it tells and adds it to the
    correction dx (6 numbers), unless its NIS is above `gate`.

    dx holds what was found at the same attitude before, so that several can follow each other and
    be injected once. `record` (of RECORD) gets what the smoother needs, zeros where nothing
    was used. Returns the NIS.
    """
    k0 = h0 * P[6, 6] + h1 * P[6, 7] + h2 * P[6, 8]
    k1 = h0 * P[6, 7] + h1 * P[7, 7] + h2 * P[7, 8]
    k2 = h0 * P[6, 8] + h1 * P[7, 8] + h2 * P[8, 8]
    k3 = h0 * P[6, 12] + h1 * P[7, 12] + h2 * P[8, 12]
    k4 = h0 * P[6, 13] + h1 * P[7, 13] + h2 * P[8, 13]
    k5 = h0 * P[6, 14] + h1 * P[7, 14] + h2 * P[8, 14]
    e -= h0 * dx[0] + h1 * dx[1] + h2 * dx[2]
    known = h0 * k0 + h1 * k1 + h2 * k2
    total = known + max(variance, MIN_NOISE * known)
    record[INVERSE] = 0.0
    if not total > 0:  # nothing is uncertain: no start, noise or measurement
        return math.nan
    scale = 1 / total
    nis = e * e * scale
    if not nis <= gate:
        return nis
    gain = (k0, k1, k2, k3, k4, k5)
    for i in range(6):
        g = gain[i] * scale
        record[GAIN.start + i] = g
        dx[i] += g * e
        for j in range(i, 6):
            x = P[_six(i), _six(j)] - g * gain[j]
            P[_six(i), _six(j)] = P[_six(j), _six(i)] = x
    row = record[ROW]
    row[0], row[1], row[2], record[INVERSE], record[SEEN] = h0, h1, h2, scale, e
    return nis


@helper
def gain_update(P: Array, K: Array, h0: float, h1: float, h2: float, variance: float) -> float:
    """P after a correction by gains K (6,), whatever they are, and a scalar h . attitude error +
    noise: (I - K h) P (I - K h)' + K variance K'. Returns the variance of the innovation."""
    k0 = h0 * P[6, 6] + h1 * P[6, 7] + h2 * P[6, 8]
    k1 = h0 * P[6, 7] + h1 * P[7, 7] + h2 * P[7, 8]
    k2 = h0 * P[6, 8] + h1 * P[7, 8] + h2 * P[8, 8]
    k3 = h0 * P[6, 12] + h1 * P[7, 12] + h2 * P[8, 12]
    k4 = h0 * P[6, 13] + h1 * P[7, 13] + h2 * P[8, 13]
    k5 = h0 * P[6, 14] + h1 * P[7, 14] + h2 * P[8, 14]
    total, known = h0 * k0 + h1 * k1 + h2 * k2 + variance, (k0, k1, k2, k3, k4, k5)
    for i in range(6):
        for j in range(i, 6):
            x = P[_six(i), _six(j)] + (K[i] * K[j] * total - K[i] * known[j] - known[i] * K[j])
            P[_six(i), _six(j)] = P[_six(j), _six(i)] = x
    return total


@helper
def inject(belief: FilterState, dx: Array) -> None:
    """Compose the correction dx (attitude in n, rad; gyro bias, rad/s) into the belief, and make
    it zero."""
    rotate_left(dx[0], dx[1], dx[2], belief.C_nb)
    orthonormalise(belief.C_nb)
    for i in range(3):
        belief.b_g[i] += dx[3 + i]
        dx[i] = dx[3 + i] = 0.0


@helper
def count_bias(P: Array, sensitivity: Array, variance: Array, sign: float) -> None:
    """Add to P (sign 1), or take from it (-1), what accelerometer biases of that `variance`
    (3,) make of the six states, given their `sensitivity` (6, 3) to them.

    The biases are constant and no states: gains do not know them, so that P without them is what
    makes the gains (Schmidt's consider parameters with the gains of the filter without them).
    """
    for i in range(6):
        for j in range(i, 6):
            x = 0.0
            for k in range(3):
                x += variance[k] * sensitivity[i, k] * sensitivity[j, k]
            x = P[_six(i), _six(j)] + sign * x
            P[_six(i), _six(j)] = P[_six(j), _six(i)] = x


@helper
def carry_bias(sensitivity: Array, C: Array, w0: float, w2: float, keep: float, dt: float) -> None:
    """The `sensitivity` (6, 3) of the six states to accelerometer biases over a step of
    `propagate`."""
    for k in range(3):
        x0, x1, x2 = sensitivity[0, k], sensitivity[1, k], sensitivity[2, k]
        b0, b1, b2 = sensitivity[3, k], sensitivity[4, k], sensitivity[5, k]
        sensitivity[0, k] = x0 + w2 * x1 - dt * (C[0, 0] * b0 + C[0, 1] * b1 + C[0, 2] * b2)
        sensitivity[1, k] = (
            x1 - w2 * x0 + w0 * x2 - dt * (C[1, 0] * b0 + C[1, 1] * b1 + C[1, 2] * b2)
        )
        sensitivity[2, k] = x2 - w0 * x1 - dt * (C[2, 0] * b0 + C[2, 1] * b1 + C[2, 2] * b2)
        for i in range(3):
            sensitivity[3 + i, k] *= keep


@helper
def absorb_bias(
    sensitivity: Array, K: Array, h0: float, h1: float, h2: float, d: tuple[float, ...]
) -> None:
    """The `sensitivity` (6, 3) after a correction by gains K (6,) and a scalar with row h of the
    attitude and row d (3,) of the accelerometer biases."""
    for k in range(3):
        seen = d[k] + h0 * sensitivity[0, k] + h1 * sensitivity[1, k] + h2 * sensitivity[2, k]
        for i in range(6):
            sensitivity[i, k] -= K[i] * seen


@helper
def adjoint_scalar_update(record: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `scalar_update`: what the scalar in `record` adds to lam and Lam (of the six
    states, seen from before it)."""
    K, h, scale, q = record[GAIN], record[ROW], record[INVERSE], work[0:6]
    if scale == 0:
        return
    along, known = record[SEEN] * scale, scale
    for i in range(6):
        along += K[i] * lam[i]
        q[i] = 0.0
        for j in range(6):
            q[i] += Lam[i, j] * K[j]
    for i in range(6):
        known += K[i] * q[i]
    for i in range(3):
        lam[i] -= h[i] * along
        for j in range(3):
            Lam[i, j] += h[i] * h[j] * known - h[i] * q[j] - q[i] * h[j]
        for j in range(3, 6):
            Lam[i, j] -= h[i] * q[j]
            Lam[j, i] = Lam[i, j]


@helper
def adjoint_propagate_attitude(step: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `propagate`, whose transition is in `step` (of TRANSITION):
    lam <- Phi' lam, Lam <- Phi' Lam Phi."""
    w0, w2, keep = step[NORTH], step[DOWN], step[KEEP]
    _unpropagate(step, w0, w2, keep, lam)
    for i in range(6):
        _unpropagate(step, w0, w2, keep, Lam[i])  # by symmetry a row is a column
    for i in range(6):
        for j in range(i):
            Lam[i, j], Lam[j, i] = Lam[j, i], Lam[i, j]
    for i in range(6):
        _unpropagate(step, w0, w2, keep, Lam[i])


@helper
def _unpropagate(step: Array, w0: float, w2: float, keep: float, x: Array) -> None:
    """x <- Phi' x of six numbers, Phi = [[I - [w x], - C dt], [0, keep]]."""
    x0, x1, x2 = x[0], x[1], x[2]
    x[0], x[1], x[2] = x0 - w2 * x1, x1 + w2 * x0 - w0 * x2, x2 + w0 * x1
    for j in range(3):
        x[3 + j] = keep * x[3 + j] - (step[j] * x0 + step[3 + j] * x1 + step[6 + j] * x2)
