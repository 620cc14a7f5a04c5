"""A strapdown INS in plain numpy, written down again without anything of the library: the Earth, one
step, the transition of its fifteen errors. For the twins of filters as papers print them.

Sources: WGS-84; Groves (2013), chapters 2, 5 and 14; Hager & Bryne, (6) to (12) and Table II with the
corrections of docs/reference/conventions.md. NED, SI, rad.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

A, FLATTENING, SPIN, GM = 6378137.0, 1 / 298.257223563, 7.292115e-5, 3.986004418e14
E2 = FLATTENING * (2 - FLATTENING)
EQUATOR, SOMIGLIANA = 9.7803253359, 0.00193185265241
RATIO = SPIN**2 * A**3 * (1 - FLATTENING) / GM
NORTHWARDS = 2 * EQUATOR * (SOMIGLIANA + E2 / 2) / (A * (1 - E2))
P, V, THETA, BA, BG = (slice(3 * i, 3 * i + 3) for i in range(5))


def cross(a):
    """S(a), with S(a) b = a x b."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0.0]])


def turn(r):
    """exp(S(r)), r in rad."""
    return Rotation.from_rotvec(r).as_matrix()


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def radii(lla):
    """(M, N): radii of curvature and height, m."""
    x = 1 - E2 * np.sin(lla[0]) ** 2
    normal = A / np.sqrt(x)
    return normal * (1 - E2) / x + lla[2], normal + lla[2]


def gravity(lat, h):
    """Gravity in n at a height, m/s^2."""
    s, c = np.sin(lat), np.cos(lat)
    surface = EQUATOR * (1 + SOMIGLIANA * s * s) / np.sqrt(1 - E2 * s * s)
    linear = 2 / A * (1 + FLATTENING + RATIO - 2 * FLATTENING * s * s)
    return np.array([-NORTHWARDS * s * c * h, 0, surface * (1 - linear * h + 3 / A**2 * h * h)])


def gravity_slopes(lat, h):
    """(by latitude, by height) of gravity's component down."""
    s, c = np.sin(lat), np.cos(lat)
    root = np.sqrt(1 - E2 * s * s)
    surface = EQUATOR * (1 + SOMIGLIANA * s * s) / root
    linear = 2 / A * (1 + FLATTENING + RATIO - 2 * FLATTENING * s * s)
    steeper = (
        EQUATOR * 2 * s * c * (SOMIGLIANA / root + E2 / 2 * (1 + SOMIGLIANA * s * s) / root**3)
    )
    by_latitude = steeper * (1 - linear * h + 3 / A**2 * h * h)
    return by_latitude + surface * 8 * FLATTENING / A * s * c * h, surface * (6 / A**2 * h - linear)


def displaced(lla, way):
    """The position that is `way` (m NED) away."""
    M, N = radii(lla)
    east = way[1] / (N * np.cos(lla[0]))
    return np.array([lla[0] + way[0] / M, wrap(lla[1] + east), lla[2] - way[2]])


def way_between(lla, origin):
    """m NED from `origin`, with the radii there."""
    M, N = radii(origin)
    east = wrap(lla[1] - origin[1]) * N * np.cos(origin[0])
    return np.array([(lla[0] - origin[0]) * M, east, origin[2] - lla[2]])


class Step(NamedTuple):
    """A sample later: lla, v_n, C_nb, and the velocity increment by the specific force in n."""

    lla: np.ndarray
    v: np.ndarray
    C: np.ndarray
    force: np.ndarray


def mechanized(lla, v, C, r, a, dt):
    """One step by the bias-free increments r (rad) and a (m/s), body."""
    (M, N), s, c = radii(lla), np.sin(lla[0]), np.cos(lla[0])
    earth = SPIN * np.array([c, 0, -s])
    w = dt * (earth + [v[1] / N, -v[0] / M, -v[1] * s / (c * N)])
    x = np.cross(r, a)
    force = C @ (a + x / 2 + np.cross(r, x) / 6)
    force = force - np.cross(w, force) / 2
    coriolis = w + earth * dt
    pull = gravity(lla[0], lla[2] - v[2] * dt / 2) * dt
    middle = v + (force - np.cross(coriolis, v) + pull) / 2
    after = v + force - np.cross(coriolis, middle) + pull
    mean = (v + after) / 2
    moved, tan = dt / 2 * mean[0] / M, s / c
    slope = tan + (1 + tan * tan) * moved
    w = [
        earth[0] + earth[2] * moved + mean[1] / N,
        -mean[0] / M,
        earth[2] - earth[0] * moved - slope * mean[1] / N,
    ]
    C = turn(-dt * np.array(w)) @ C @ turn(r)
    north = mean[0] * dt / M
    east = mean[1] * dt / (N * (c - s * north / 2))
    return Step(np.array([lla[0] + north, lla[1] + east, lla[2] - mean[2] * dt]), after, C, force)


def carried(mean, new, r, share):
    """A mean vector in the body, turned against r, with `share` of the integral `new` mixed in, to
    second order."""
    before, added = mean * (1 - share[0]), share[1] * new
    half = before + (added - np.cross(r, before + added / 6)) / 2
    return before + added - np.cross(r, half)


def transition(lla, v, C, r, a, dt, decays):
    """(Phi, C_mid): of the errors over a step by bias-free increments, with the decays (1/s) of
    accelerometer and gyro biases."""
    (M, N), s, c = radii(lla), np.sin(lla[0]), np.cos(lla[0])
    (n, e, d), t = v, s / c
    i, j, sec = SPIN * c, -SPIN * s, v[1] / (N * c * c)
    g_lat, g_h = gravity_slopes(lla[0], lla[2])
    h = lla[2]
    pp = [[-d / M, 0, n / M], [e * t / N, -(d + n * t) / N, e / N], [0, 0, 0]]
    vp = [
        [
            -e * (2 * i + sec) / M - NORTHWARDS * (c * c - s * s) * h / M,
            0,
            n * d / M**2 - e * e * t / N**2 + NORTHWARDS * s * c,
        ],
        [(2 * (n * i + d * j) + n * sec) / M, 0, e * (n * t + d) / N**2],
        [-2 * j * e / M + g_lat / M, 0, -(n * n / M**2 + e * e / N**2) - g_h],
    ]
    vv = [
        [d / M, 2 * (j - e * t / N), n / M],
        [e * t / N - 2 * j, (n * t + d) / N, 2 * i + e / N],
        [-2 * n / M, -2 * (i + e / N), 0],
    ]
    tp = [[-j / M, 0, -e / N**2], [0, 0, n / M**2], [(i + sec) / M, 0, e * t / N**2]]
    tv = [[0, -1 / N, 0], [1 / M, 0, 0], [0, t / N, 0]]
    middle = C @ (np.eye(3) + cross(r / 2))
    w = dt * np.array([i + e / N, -n / M, j - e * t / N])
    I, zero = np.eye(3), np.zeros((3, 3))
    theta = np.hstack([dt * np.array(tp), dt * np.array(tv), I - cross(w), zero, -dt * middle])
    velocity = np.hstack([dt * np.array(vp), I + dt * np.array(vv), zero, -dt * middle, zero])
    before = np.hstack([zero, zero, I, zero, zero])
    velocity = velocity - cross(middle @ a) @ (before + theta) / 2
    position = np.hstack([I + dt * np.array(pp), dt / 2 * I, zero, zero, zero]) + dt / 2 * velocity
    bias = np.hstack([np.zeros((6, 9)), np.diag(np.repeat(np.exp(-dt * np.array(decays)), 3))])
    return np.vstack([position, velocity, theta, bias]), middle


def increments(imu):
    """(t, dt, increments (6,)) of each sample, compensated for coning and sculling."""
    before = None
    for t, dt, r, a in zip(*imu):
        u = np.r_[r, a]
        if before is not None:
            u += np.r_[np.cross(before[0], r), np.cross(before[0], a) + np.cross(before[1], r)] / 12
        before = r, a
        yield t, dt, u
