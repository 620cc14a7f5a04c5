"""Biases and wind by the auxiliary force xi: an adaptive observer around the nonlinear one.

xi has the true value zero, so whatever it is tells of what the observer takes for known: the
biases of accelerometer and gyro, and the wind that lies between course and heading. With beta
their errors, in units of their standard deviations at the start, the observer's error is
U beta + eta: U is the observer's own error equation driven by beta alone, and eta what would be
left without. With a row h of U for each number z that should be zero, xi and the course less the
heading,
    beta^ <- beta^ + J^-1 h z / R,  J' = (I - J) / memory + h h' / R
is least squares that forgets, and the observer moves by U dbeta, so that eta stays what it is
(Zhang 2002, IEEE TAC 47(3)). Where a turn of the attitude has made up for a bias, as on a straight
leg, h is zero and nothing is learnt. Without these turns and with fast fixes xi = - C beta, and
the law is b_a' = -k C' xi. docs/explanation/observer.md has the argument for its stability.
"""

import math

from ...core.compile.jit import helper, inline, matrix
from ...core.compile.selection import any_of, where
from ...core.compile.workspace import Slots
from ...typing import Array

ACCEL, GYRO, AIR, COUNT = 0, 3, 6, 8  # columns of U: where they begin, and how many there are
ADAPTIVE = Slots()
"""The numbers of the law. U has a row for each axis, n but of the gyro bias."""
U_P = ADAPTIVE.matrix("U_P", 3, COUNT)  # true - estimate of all but xi itself
U_V = ADAPTIVE.matrix("U_V", 3, COUNT)
U_TILT = ADAPTIVE.matrix("U_TILT", 3, COUNT)
U_GYRO = ADAPTIVE.matrix("U_GYRO", 3, COUNT)  # gyro bias, body
U_XI = ADAPTIVE.matrix("U_XI", 3, COUNT)
J = ADAPTIVE.matrix("J", COUNT, COUNT)
ROOT = ADAPTIVE.matrix("ROOT", COUNT, COUNT)  # its Cholesky factor, lower
SCALE = ADAPTIVE.array("SCALE", COUNT)  # standard deviations: m/s^2, rad/s, m/s
SUM = ADAPTIVE.array("SUM", COUNT)  # of h z / R since the last change
COURSE = ADAPTIVE.array("COURSE", COUNT)  # h / R of the last course; zero where there was none
WEIGHT = ADAPTIVE.number("WEIGHT")  # 1 / R of xi
CHANGE = ADAPTIVE.array("CHANGE", COUNT)  # dbeta, in units of SCALE
WIND = ADAPTIVE.array("WIND", 2)  # north and east, m/s
MEMORY = ADAPTIVE.number("MEMORY")  # s
XI_NOISE = ADAPTIVE.number("XI_NOISE")  # density of what xi is besides, m/s^2 sqrt(s)
SLIP = ADAPTIVE.number("SLIP")  # of what a course is besides heading and wind, rad sqrt(s)
SINCE = ADAPTIVE.number("SINCE")  # s since the last change
BEGUN = ADAPTIVE.number("BEGUN")  # whether the start is over


@inline
def sample(
    own: Array, C: Array, f0: float, f1: float, f2: float, k: float, ki: float, dt: float
) -> None:
    """U over a sample of specific force f (m/s^2, n), in which the attitude was turned by k f x xi
    (rad)."""
    p, v, a = matrix(own, U_P, 3, COUNT), matrix(own, U_V, 3, COUNT), matrix(own, U_TILT, 3, COUNT)
    g, x = matrix(own, U_GYRO, 3, COUNT), matrix(own, U_XI, 3, COUNT)
    for j in range(COUNT):
        a0, a1, a2, x0, x1, x2 = a[0, j], a[1, j], a[2, j], x[0, j], x[1, j], x[2, j]
        d0, d1, d2 = f1 * a2 - f2 * a1 + x0, f2 * a0 - f0 * a2 + x1, f0 * a1 - f1 * a0 + x2
        if j < GYRO:
            unit = own[SCALE][j]
            d0, d1, d2 = d0 + unit * C[0, j], d1 + unit * C[1, j], d2 + unit * C[2, j]
        p[0, j] += dt * (v[0, j] - 0.5 * dt * d0)
        p[1, j] += dt * (v[1, j] - 0.5 * dt * d1)
        p[2, j] += dt * (v[2, j] - 0.5 * dt * d2)
        v[0, j] -= dt * d0
        v[1, j] -= dt * d1
        v[2, j] -= dt * d2
        for i in range(3):
            a[i, j] -= dt * (C[i, 0] * g[0, j] + C[i, 1] * g[1, j] + C[i, 2] * g[2, j])
        s0, s1, s2 = k * (f1 * x2 - f2 * x1), k * (f2 * x0 - f0 * x2), k * (f0 * x1 - f1 * x0)
        turn_column(own, j, C, f0, f1, f2, s0, s1, s2, ki)


@inline
def turn_column(
    own: Array,
    j: int,
    C: Array,
    f0: float,
    f1: float,
    f2: float,
    s0: float,
    s1: float,
    s2: float,
    ki: float,
) -> None:
    """Column j of U after a turn of the attitude that answers to it by s (rad, n)."""
    a, g = matrix(own, U_TILT, 3, COUNT), matrix(own, U_GYRO, 3, COUNT)
    x = matrix(own, U_XI, 3, COUNT)
    a[0, j] -= s0
    a[1, j] -= s1
    a[2, j] -= s2
    x[0, j] -= s1 * f2 - s2 * f1
    x[1, j] -= s2 * f0 - s0 * f2
    x[2, j] -= s0 * f1 - s1 * f0
    for i in range(3):
        g[i, j] += ki * (C[0, i] * s0 + C[1, i] * s1 + C[2, i] * s2)


@inline
def heading(
    own: Array, C: Array, f0: float, f1: float, f2: float, share: float, ki: float, by_wind: float
) -> None:
    """U after a turn about the vertical by that share of a heading's angle; by_wind: 1/airspeed
    (s/m) where it is a course, in which the wind counts, else 0."""
    a = matrix(own, U_TILT, 3, COUNT)
    for j in range(COUNT):
        s = share * (a[2, j] + across(own, C, j, by_wind))
        turn_column(own, j, C, f0, f1, f2, 0.0, 0.0, s, ki)


@helper
def across(own: Array, C: Array, j: int, by_wind: float) -> float:
    """The angle between course and heading that a unit of column j makes, rad."""
    if j < AIR:
        return 0.0 * by_wind
    size = math.sqrt(max(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0], 1e-2))
    part = -C[1, 0] if j == AIR else C[0, 0]
    return own[SCALE][j] * by_wind * part / size


@helper
def fix(own: Array, axis: int, velocity: bool, K: Array) -> None:
    """U after a position or velocity of that axis with gains K on position, velocity and xi."""
    p, v, x = matrix(own, U_P, 3, COUNT), matrix(own, U_V, 3, COUNT), matrix(own, U_XI, 3, COUNT)
    for j in range(COUNT):
        e = v[axis, j] if velocity else p[axis, j]
        p[axis, j] -= K[0] * e
        v[axis, j] -= K[1] * e
        x[axis, j] += K[2] * e


@helper
def see_course(own: Array, C: Array, z: float, by_wind: float, weight: float) -> None:
    """Count course less heading z (rad) for a measurement, with that weight (rad^-2)."""
    a, M, total = matrix(own, U_TILT, 3, COUNT), matrix(own, J, COUNT, COUNT), own[SUM]
    row = own[COURSE]
    for i in range(COUNT):
        h = a[2, i] + across(own, C, i, by_wind)
        row[i] = weight * h
        total[i] += row[i] * z
        for j in range(i + 1):
            M[i, j] += h * row[j]


@helper
def see_force(own: Array, xi: Array, weight: float) -> None:
    """Count xi (m/s^2) for a measurement, with that weight ((m/s^2)^-2)."""
    x, M, total = matrix(own, U_XI, 3, COUNT), matrix(own, J, COUNT, COUNT), own[SUM]
    own[WEIGHT] = weight
    for i in range(COUNT):
        total[i] += weight * (x[0, i] * xi[0] + x[1, i] * xi[1] + x[2, i] * xi[2])
        for j in range(i + 1):
            M[i, j] += weight * (x[0, i] * x[0, j] + x[1, i] * x[1, j] + x[2, i] * x[2, j])


@helper
def forget(own: Array, wanted: bool) -> None:
    """J over the time since the last change."""
    M, share = matrix(own, J, COUNT, COUNT), where(wanted, min(own[SINCE] / own[MEMORY], 1.0), 0.0)
    own[SINCE] = where(wanted, 0.0, own[SINCE])
    for i in range(COUNT):
        for j in range(i + 1):
            M[i, j] += share * ((1.0 if i == j else 0.0) - M[i, j])


@helper
def factor(own: Array) -> float:
    """ROOT of J. Returns how well the axis of the accelerometer bias that is known least is known:
    1 less its variance over that at the start."""
    M, L, b = matrix(own, J, COUNT, COUNT), matrix(own, ROOT, COUNT, COUNT), own[CHANGE]
    for i in range(COUNT):
        for j in range(i + 1):
            s = M[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(s) if i == j else s / L[j, j]
    worst = 0.0 * L[0, 0]
    for axis in range(ACCEL, GYRO):
        variance = 0.0 * worst
        for i in range(COUNT):
            b[i] = 1.0 if i == axis else 0.0
        for i in range(axis, COUNT):
            forward(L, b, i)
            variance += b[i] * b[i]
        worst = max(worst, variance)
    return 1 - worst


@helper
def forward(L: Array, b: Array, i: int) -> None:
    """Row i of b <- L^-1 b, those above being done."""
    s = b[i]
    for k in range(i):
        s -= L[i, k] * b[k]
    b[i] = s / L[i, i]


@helper
def solve(own: Array, b: Array) -> None:
    """b <- J^-1 b, by ROOT."""
    L = matrix(own, ROOT, COUNT, COUNT)
    for i in range(COUNT):
        forward(L, b, i)
    for i in range(COUNT - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, COUNT):
            s -= L[k, i] * b[k]
        b[i] = s / L[i, i]


@helper
def answer(own: Array, first: int, i: int) -> float:
    """Row i of the block of U that begins at `first`, times CHANGE."""
    U, change = matrix(own, first, 3, COUNT), own[CHANGE]
    total = U[i, 0] * change[0]
    for j in range(1, COUNT):
        total += U[i, j] * change[j]
    return total


@helper
def begin(own: Array, now: bool) -> None:
    """The gyro bias as it is at the end of the start is from now on what is to be known."""
    if any_of(now):
        for j in range(GYRO, AIR):
            for i in range(3):
                for first in (U_P, U_V, U_TILT, U_XI):
                    U = matrix(own, first, 3, COUNT)
                    U[i, j] = where(now, 0.0, U[i, j])
                U = matrix(own, U_GYRO, 3, COUNT)
                U[i, j] = where(now, own[SCALE][j] if i == j - GYRO else 0.0, U[i, j])
        own[BEGUN] = where(now, 1.0, own[BEGUN])
