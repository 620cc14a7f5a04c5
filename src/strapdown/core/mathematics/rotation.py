"""Rotations: exponential map, quaternions, Euler angles (ZYX). Hamilton quaternions, scalar first,
body to navigation frame.

Compiled helpers that write into arrays. Source: Groves (2013) sections 2.2 and 5.5.
"""

import math
from typing import TypeAlias

import numpy as np

from ...typing import Array
from ..compile.jit import helper
from ..compile.selection import any_of, where
from .elementary import arctangent2, cosine as cosine_of, sine as sine_of

Three: TypeAlias = tuple[float, float, float]
"""A vector as three numbers, for compiled code that makes no array of it: as an argument it becomes the
same machine code as three numbers by themselves."""
NineNumbers: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""A rotation matrix row by row, for compiled code that makes no array of it."""


@helper
def wrap(angle: float) -> float:
    """`angle` in [-pi, pi), rad; NaN stays NaN."""
    return angle - 2 * math.pi * np.floor((angle + math.pi) / (2 * math.pi))


@helper
def cross(a: Three | Array, b: Three | Array) -> Three:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@helper
def dot(a: Three, b: Three) -> float:
    """a' b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def rotate_vector(C: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """C times the vector (x, y, z)."""
    return (
        C[0, 0] * x + C[0, 1] * y + C[0, 2] * z,
        C[1, 0] * x + C[1, 1] * y + C[1, 2] * z,
        C[2, 0] * x + C[2, 1] * y + C[2, 2] * z,
    )


@helper
def axis(k: int) -> Three:
    """The unit vector along axis 0, 1 or 2."""
    return (
        1.0 if k == 0 else 0.0,
        1.0 if k == 1 else 0.0,
        1.0 if k == 2 else 0.0,
    )


@helper
def turned_on(C: Array, r: Three, out: Array) -> None:
    """out = C (I + S(r)): C after a small rotation r (rad) in the frame on its right, to first
    order."""
    r0, r1, r2 = r
    for i in range(3):
        out[i, 0] = C[i, 0] + C[i, 1] * r2 - C[i, 2] * r1
        out[i, 1] = C[i, 1] + C[i, 2] * r0 - C[i, 0] * r2
        out[i, 2] = C[i, 2] + C[i, 0] * r1 - C[i, 1] * r0


def quaternion_to_euler(q: Array) -> Array:
    """(n, 3) roll, pitch, heading, rad, each in [-pi, pi], of unit quaternions (n, 4); for use in
    Python. Groves (2013) eq. 2.37."""
    w, x, y, z = np.asarray(q, float).T
    return np.stack(
        [
            np.arctan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z),
            np.arcsin(np.clip(2 * (w * y - x * z), -1, 1)),
            np.arctan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z),
        ],
        axis=-1,
    )


@helper
def euler_to_matrix(roll: float, pitch: float, heading: float, C: Array) -> None:
    """C_nb = Rz(heading) Ry(pitch) Rx(roll), rad."""
    C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2] = euler_terms(
        roll, pitch, heading
    )


@helper
def euler_terms(roll: float, pitch: float, heading: float) -> NineNumbers:
    """The nine numbers of that matrix, row by row."""
    sr, cr, sp, cp, sh, ch = (
        math.sin(roll),
        math.cos(roll),
        math.sin(pitch),
        math.cos(pitch),
        math.sin(heading),
        math.cos(heading),
    )
    return (
        cp * ch,
        sr * sp * ch - cr * sh,
        cr * sp * ch + sr * sh,
        cp * sh,
        sr * sp * sh + cr * ch,
        cr * sp * sh - sr * ch,
        -sp,
        sr * cp,
        cr * cp,
    )


@helper
def measured_heading(y: Array, C: Array) -> float:
    """Heading (rad) of a record y = roll, pitch, heading; where that is not measured (NaN), the
    heading of C_nb."""
    return where(math.isnan(y[2]), arctangent2(C[1, 0], C[0, 0]), y[2])


@helper
def matrix_to_euler(C: Array) -> tuple[float, float, float]:
    """Roll, pitch, heading of C_nb, rad; at pitch +-90 deg roll and heading are not separate and
    roll is what atan2 makes of zeros."""
    return (
        arctangent2(C[2, 1], C[2, 2]),
        math.asin(min(1.0, max(-1.0, -C[2, 0]))),
        arctangent2(C[1, 0], C[0, 0]),
    )


@helper
def matrix_to_quaternion(C: Array, q: Array) -> None:
    """Unit quaternion q[0:4] of a rotation matrix, q_w >= 0; the largest component is computed
    first (Shepperd 1978)."""
    trace = C[0, 0] + C[1, 1] + C[2, 2]
    if trace >= max(C[0, 0], C[1, 1], C[2, 2]):
        w = 0.5 * math.sqrt(1 + trace)
        x, y, z = (
            (C[2, 1] - C[1, 2]) / (4 * w),
            (C[0, 2] - C[2, 0]) / (4 * w),
            (C[1, 0] - C[0, 1]) / (4 * w),
        )
    elif C[0, 0] >= C[1, 1] and C[0, 0] >= C[2, 2]:
        x = 0.5 * math.sqrt(1 + 2 * C[0, 0] - trace)
        w, y, z = (
            (C[2, 1] - C[1, 2]) / (4 * x),
            (C[0, 1] + C[1, 0]) / (4 * x),
            (C[0, 2] + C[2, 0]) / (4 * x),
        )
    elif C[1, 1] >= C[2, 2]:
        y = 0.5 * math.sqrt(1 + 2 * C[1, 1] - trace)
        w, x, z = (
            (C[0, 2] - C[2, 0]) / (4 * y),
            (C[0, 1] + C[1, 0]) / (4 * y),
            (C[1, 2] + C[2, 1]) / (4 * y),
        )
    else:
        z = 0.5 * math.sqrt(1 + 2 * C[2, 2] - trace)
        w, x, y = (
            (C[1, 0] - C[0, 1]) / (4 * z),
            (C[0, 2] + C[2, 0]) / (4 * z),
            (C[1, 2] + C[2, 1]) / (4 * z),
        )
    sign = 1.0 if w >= 0 else -1.0
    q[0], q[1], q[2], q[3] = sign * w, sign * x, sign * y, sign * z


@helper
def turn_quaternion(x: float, y: float, z: float, q: Array) -> None:
    """q <- exp([x y z]/2) q, scalar first and not negative: a rotation vector in the frame on
    the left, rad, by any angle."""
    a, b = _exponential(0.5 * x, 0.5 * y, 0.5 * z)
    w, x, y, z = 1 - 0.25 * b * (x * x + y * y + z * z), 0.5 * a * x, 0.5 * a * y, 0.5 * a * z
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    sign = where(w * q0 - x * q1 - y * q2 - z * q3 >= 0, 1.0, -1.0)
    w, x, y, z = sign * w, sign * x, sign * y, sign * z
    q[0], q[1] = w * q0 - x * q1 - y * q2 - z * q3, w * q1 + x * q0 + y * q3 - z * q2
    q[2], q[3] = w * q2 - x * q3 + y * q0 + z * q1, w * q3 + x * q2 - y * q1 + z * q0


@helper
def rotation_between(C: Array, M: NineNumbers) -> tuple[float, float, float]:
    """Rotation vector x (rad) with M = exp(x) C of two rotation matrices, |x| <= pi; M is nine
    numbers, row by row."""
    m0, m1, m2, m3, m4, m5, m6, m7, m8 = M
    d0, d1, d2 = (
        m0 * C[0, 0] + m1 * C[0, 1] + m2 * C[0, 2],
        m3 * C[1, 0] + m4 * C[1, 1] + m5 * C[1, 2],
        m6 * C[2, 0] + m7 * C[2, 1] + m8 * C[2, 2],
    )
    x = 0.5 * (
        m6 * C[1, 0] + m7 * C[1, 1] + m8 * C[1, 2] - m3 * C[2, 0] - m4 * C[2, 1] - m5 * C[2, 2]
    )
    y = 0.5 * (
        m0 * C[2, 0] + m1 * C[2, 1] + m2 * C[2, 2] - m6 * C[0, 0] - m7 * C[0, 1] - m8 * C[0, 2]
    )
    z = 0.5 * (
        m3 * C[0, 0] + m4 * C[0, 1] + m5 * C[0, 2] - m0 * C[1, 0] - m1 * C[1, 1] - m2 * C[1, 2]
    )
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (d0 + d1 + d2 - 1)
    scale = where(sine > 1e-9, arctangent2(sine, cosine) / max(sine, 1e-9), 1.0)
    x, y, z = scale * x, scale * y, scale * z
    half = (sine < 1e-9) & (cosine < 0)
    if any_of(half):  # half a turn, about the axis that moves least, near enough
        first = d0 >= max(d1, d2)
        second = where(first, 0.0, where(d1 >= d2, math.pi, 0.0))
        x, y = where(half, where(first, math.pi, 0.0), x), where(half, second, y)
        z = where(half, where(first | (d1 >= d2), 0.0, math.pi), z)
    return x, y, z


@helper
def nearest_turn(
    x: float, y: float, z: float, a: float, b: float, c: float
) -> tuple[float, float, float]:
    """Return the equivalent of rotation vector (x, y, z), whole turns about it apart, that is
    nearest to (a, b, c), rad."""
    size = math.sqrt(x * x + y * y + z * z)
    if size > 1e-9:
        scale = 1 + 2 * math.pi / size * np.floor(
            ((x * a + y * b + z * c) / size - size) / (2 * math.pi) + 0.5
        )
        return scale * x, scale * y, scale * z
    size = math.sqrt(a * a + b * b + c * c)  # no rotation: whole turns about any axis
    scale = 2 * math.pi / size * np.floor(size / (2 * math.pi) + 0.5) if size > 0 else 0.0
    return x + scale * a, y + scale * b, z + scale * c


@helper
def _exponential(x: float, y: float, z: float) -> tuple[float, float]:
    """sin(|r|)/|r| and (1 - cos|r|)/|r|^2 of a rotation vector r, with their series near zero."""
    square = x * x + y * y + z * z
    a, b = 1 - square / 6 * (1 - square / 20), 0.5 - square / 24 * (1 - square / 30)
    large = square >= 1e-4  # below, the dropped terms are below 1e-16
    if any_of(large):
        angle = math.sqrt(square)
        a = where(large, sine_of(angle) / angle, a)
        b = where(large, (1 - cosine_of(angle)) / square, b)
    return a, b


@helper
def rotation_terms(x: float, y: float, z: float) -> NineNumbers:
    """exp([x y z]), a rotation vector (rad), row by row."""
    a, b = _exponential(x, y, z)
    xy, xz, yz = b * x * y, b * x * z, b * y * z
    return (
        1 - b * (y * y + z * z),
        xy - a * z,
        xz + a * y,
        xy + a * z,
        1 - b * (x * x + z * z),
        yz - a * x,
        xz - a * y,
        yz + a * x,
        1 - b * (x * x + y * y),
    )


@helper
def turned_by(R: NineNumbers, x: float, y: float, z: float) -> tuple[float, float, float]:
    """`rotate_vector` by the nine numbers of a matrix."""
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = R
    return r0 * x + r1 * y + r2 * z, r3 * x + r4 * y + r5 * z, r6 * x + r7 * y + r8 * z


@helper
def rotate_left(x: float, y: float, z: float, C: Array) -> None:
    """C <- exp([x y z]) C, a rotation vector in the frame on the left of C, rad."""
    R = rotation_terms(x, y, z)
    for j in range(3):
        C[0, j], C[1, j], C[2, j] = turned_by(R, C[0, j], C[1, j], C[2, j])


@helper
def rotate_right(C: Array, x: float, y: float, z: float) -> None:
    """C <- C exp([x y z]), a rotation vector in the frame on the right of C, rad."""
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = rotation_terms(x, y, z)
    for i in range(3):
        c0, c1, c2 = C[i, 0], C[i, 1], C[i, 2]
        C[i, 0] = c0 * r0 + c1 * r3 + c2 * r6
        C[i, 1] = c0 * r1 + c1 * r4 + c2 * r7
        C[i, 2] = c0 * r2 + c1 * r5 + c2 * r8


@helper
def orthonormalise(C: Array, needed: bool = True) -> None:
    """One Newton step towards the nearest rotation, C <- C (3 I - C'C) / 2, where that is asked
    for: undoes the rounding of many products."""
    a = C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0] + C[2, 0] * C[2, 0]
    b = C[0, 1] * C[0, 1] + C[1, 1] * C[1, 1] + C[2, 1] * C[2, 1]
    c = C[0, 2] * C[0, 2] + C[1, 2] * C[1, 2] + C[2, 2] * C[2, 2]
    ab = C[0, 0] * C[0, 1] + C[1, 0] * C[1, 1] + C[2, 0] * C[2, 1]
    ac = C[0, 0] * C[0, 2] + C[1, 0] * C[1, 2] + C[2, 0] * C[2, 2]
    bc = C[0, 1] * C[0, 2] + C[1, 1] * C[1, 2] + C[2, 1] * C[2, 2]
    for i in range(3):
        c0, c1, c2 = C[i, 0], C[i, 1], C[i, 2]
        C[i, 0] = where(needed, 0.5 * (c0 * (3 - a) - c1 * ab - c2 * ac), c0)
        C[i, 1] = where(needed, 0.5 * (c1 * (3 - b) - c0 * ab - c2 * bc), c1)
        C[i, 2] = where(needed, 0.5 * (c2 * (3 - c) - c0 * ac - c1 * bc), c2)
