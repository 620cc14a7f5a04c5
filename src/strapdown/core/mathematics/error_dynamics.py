"""Error dynamics of the INS: the 15-state F of Hager & Bryne in metres, corrected, and its printed
form.

Errors are true - estimate: position p in metres NED, velocity v (m/s, NED), attitude theta (rad, in n)
with q_true = dq (x) q_est, biases of accelerometer a (m/s^2) and gyro g (rad/s) in the body. With the
specific force f_n, C = C_nb, omega_in_n = omega_ie_n + omega_en_n and 1/T the decay of a bias:

    p'     = F_pp p + v
    v'     = F_vp p + F_vv v - S(f_n) theta - C (a + w_f)
    theta' = F_theta_p p + F_theta_v v - S(omega_in_n) theta - C (g + w_omega)
    a'     = - a / T_a + w_a
    g'     = - g / T_g + w_g
    x' = F x + G w,  G Q_c G' = diag(0, Q_f, Q_omega, Q_a, Q_g)

Source: Hager & Bryne (11), (12) and Table II, with the signs, denominators and gravity gradient that
numeric differentiation of the mechanization demands (`docs/reference/conventions.md`); Groves (2013)
14.2.4.
"""

from typing import TypeAlias

import numpy as np

from ...typing import Array, Vector
from ..compile.jit import helper, inline
from .belief import Noise
from .earth import GRAVITY_NORTH_GRADIENT, gravity_gradient, place, rotation_rates
from .rotation import Three

CORRECTED, LITERAL, PRINTED_SIGNS, NO_GRADIENT, LATITUDE_GRAVITY = range(5)
"""Error models: corrected; Table II of the paper as printed; with its signs of F_theta_v and
F_theta_p alone; without the gravity gradient alone; corrected for an Earth whose gravity does
not depend on height, where the INS uses such a gravity too."""
MODELS = {
    "corrected": CORRECTED,
    "literal": LITERAL,
    "printed-signs": PRINTED_SIGNS,
    "no-gradient": NO_GRADIENT,
    "latitude-gravity": LATITUDE_GRAVITY,
}

PP, VP, VV, TP, TV = 0, 9, 18, 27, 36
BLOCKS = 45
"""Where each 3 x 3 block starts in the flat array that `kinematic_blocks` fills: rows are p, v
and theta, columns p and v."""


@helper
def kinematic_blocks(lla: Array, v: Array, model: int, F: Array) -> Three:
    """The blocks F_pp, F_vp, F_vv, F_theta_p, F_theta_v (1/s; F_vp 1/s^2, F_theta_p 1/(m s),
    F_theta_v 1/m) of a `model`, at lla (rad, rad, m) and v_n = (n, e, d) (m/s), into F[0:45].

    Entries that are zero in every model are left. F_pv = I, and F_theta_theta = -S(omega_in) with
    omega_in_n (rad/s), which is returned. In the blocks below M = R_M + h and N = R_N + h, m; t is
    tan L; omega_ie_n = (i, 0, j), rad/s; s = e / (N cos^2 L).
    """
    sine, cosine, M, N = place(lla[0], lla[2])
    ie_n, ie_d, w0, w1, w2 = rotation_rates(v[0], v[1], sine, cosine, M, N)
    u, at = (v[0], v[1], v[2]), (sine / cosine, v[1] / (N * cosine * cosine), M, N)
    _position_by_position(u, at, F)
    _velocity_by_velocity(u, at, (ie_n, ie_d), F)
    _velocity_by_position(u, at, (ie_n, ie_d), F)
    _attitude_by_position_and_velocity(u, at, (ie_n, ie_d), F)
    if model == CORRECTED or model == PRINTED_SIGNS:
        _gravity_by_position((sine, cosine), lla[2], M, F)
    elif model == LATITUDE_GRAVITY:
        F[VP + 6] += gravity_gradient(sine, cosine, 0.0)[0] / M
    if model == LITERAL:
        F[VP + 2] = (v[0] * v[2] - v[1] * v[1] * (sine / cosine)) / (M * M)
    if model == LITERAL or model == PRINTED_SIGNS:
        _attitude_as_printed(u, at, (ie_n, ie_d), F)
    return w0, w1, w2


At: TypeAlias = tuple[float, float, float, float]
"""tan L, v_E / (N cos^2 L) in rad/s, M and N in m."""


@inline
def _position_by_position(v: Three, at: At, F: Array) -> None:
    """F_pp = [ -d/M      0         n/M ]
    [ e t/N  -(d + n t)/N  e/N ]
    [  0       0          0  ]"""
    v_n, v_e, v_d = v
    tan, _, M, N = at
    F[PP], F[PP + 2] = -v_d / M, v_n / M
    F[PP + 3], F[PP + 4], F[PP + 5] = v_e * tan / N, -(v_d + v_n * tan) / N, v_e / N


@inline
def _velocity_by_velocity(v: Three, at: At, ie: tuple[float, float], F: Array) -> None:
    """F_vv = [     d/M      2 (j - e t/N)      n/M     ]
    [ e t/N - 2 j   (n t + d)/N    2 i + e/N ]
    [   -2 n/M     -2 (i + e/N)       0      ]"""
    v_n, v_e, v_d = v
    tan, _, M, N = at
    ie_n, ie_d = ie
    F[VV], F[VV + 1], F[VV + 2] = v_d / M, 2 * (ie_d - v_e * tan / N), v_n / M
    F[VV + 3], F[VV + 4], F[VV + 5] = (
        v_e * tan / N - 2 * ie_d,
        (v_n * tan + v_d) / N,
        2 * ie_n + v_e / N,
    )
    F[VV + 6], F[VV + 7] = -2 * v_n / M, -2 * (ie_n + v_e / N)


@inline
def _velocity_by_position(v: Three, at: At, ie: tuple[float, float], F: Array) -> None:
    """Without gravity, with the radii held fixed,

    F_vp = [     -e (2 i + s)/M      0   n d/M^2 - e^2 t/N^2  ]
           [ (2 (n i + d j) + n s)/M  0     e (n t + d)/N^2    ]
           [        -2 j e/M         0  -(n^2/M^2 + e^2/N^2) ]
    """
    v_n, v_e, v_d = v
    tan, secant, M, N = at
    ie_n, ie_d = ie
    F[VP] = -v_e * (2 * ie_n + secant) / M
    F[VP + 3] = (2 * (v_n * ie_n + v_d * ie_d) + v_n * secant) / M
    F[VP + 6] = -2 * ie_d * v_e / M
    F[VP + 2] = v_n * v_d / (M * M) - v_e * v_e * tan / (N * N)
    F[VP + 5] = v_e * (v_n * tan + v_d) / (N * N)
    F[VP + 8] = -(v_n * v_n / (M * M) + v_e * v_e / (N * N))


@inline
def _gravity_by_position(angle: tuple[float, float], h: float, M: float, F: Array) -> None:
    """Add to F the gradient of gravity, g down and -k h sin L cos L north, k
    GRAVITY_NORTH_GRADIENT:

        F_vp += [ -k h cos(2 L)/M  0  k sin L cos L ]
                [        0         0        0       ]
                [    (dg/dL)/M     0     -dg/dh     ]

    `angle` is sine and cosine of the latitude L, h the height in m.
    """
    sine, cosine = angle
    g_lat, g_h = gravity_gradient(sine, cosine, h)
    F[VP + 6] += g_lat / M
    F[VP + 8] -= g_h
    # of gravity's north component: 1e-8 1/s^2, but more than the rest of F[VP + 2]
    F[VP] -= GRAVITY_NORTH_GRADIENT * (cosine * cosine - sine * sine) * h / M
    F[VP + 2] += GRAVITY_NORTH_GRADIENT * sine * cosine


@inline
def _attitude_by_position_and_velocity(v: Three, at: At, ie: tuple[float, float], F: Array) -> None:
    """Minus the derivatives of omega_in_n:

    F_theta_p = [   -j/M     0  -e/N^2  ]    F_theta_v = [  0   -1/N  0 ]
                [     0      0   n/M^2  ]                [ 1/M    0   0 ]
                [ (i + s)/M  0  e t/N^2 ]                [  0    t/N  0 ]
    """
    v_n, v_e, _ = v
    tan, secant, M, N = at
    ie_n, ie_d = ie
    F[TP], F[TP + 6] = -ie_d / M, (ie_n + secant) / M
    F[TP + 2], F[TP + 5], F[TP + 8] = -v_e / (N * N), v_n / (M * M), v_e * tan / (N * N)
    F[TV + 1], F[TV + 3], F[TV + 7] = -1 / N, 1 / M, tan / N


@inline
def _attitude_as_printed(v: Three, at: At, ie: tuple[float, float], F: Array) -> None:
    """F_theta_p and F_theta_v as Table II has them: with the opposite signs, and e^2 and n^2 for e
    and n."""
    v_n, v_e, _ = v
    tan, secant, M, N = at
    ie_n, ie_d = ie
    F[TP], F[TP + 6] = ie_d / M, -(ie_n + secant) / M
    F[TP + 2], F[TP + 5], F[TP + 8] = (
        v_e * v_e / (N * N),
        -v_n * v_n / (M * M),
        -v_e * tan / (N * N),
    )
    F[TV + 1], F[TV + 3], F[TV + 7] = 1 / M, -1 / M, -tan / N


def cross_matrix(a: Vector) -> Array:
    """S(a) with S(a) b = a x b."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0.0]])


def dynamics(
    lla: Vector, v: Vector, C: Array, f_n: Vector, noise: Noise, model: int = CORRECTED
) -> tuple[Array, Array]:
    """F (15, 15) in 1/s and the spectral density G Q_c G' (15, 15): the plain matrices that the
    compiled transition is tested against.

    `f_n` is the specific force in n, m/s^2; units of the states as in core.loop.contract.
    """
    blocks = np.zeros(BLOCKS)
    lla, v = np.asarray(lla, float), np.asarray(v, float)
    omega_in_n = kinematic_blocks(lla, v, model, blocks)

    def block(first: int) -> Array:
        return blocks[first : first + 9].reshape(3, 3)

    F = np.zeros((15, 15))
    F[0:3, 0:3], F[0:3, 3:6] = block(PP), np.eye(3)
    F[3:6, 0:3], F[3:6, 3:6], F[3:6, 6:9], F[3:6, 9:12] = (
        block(VP),
        block(VV),
        -cross_matrix(f_n),
        -C,
    )
    F[6:9, 0:3], F[6:9, 3:6], F[6:9, 6:9], F[6:9, 12:15] = (
        block(TP),
        block(TV),
        -cross_matrix(omega_in_n),
        -C,
    )
    F[9:12, 9:12], F[12:15, 12:15] = -noise.accel_decay * np.eye(3), -noise.gyro_decay * np.eye(3)
    density = np.r_[
        np.zeros(3),
        [noise.accel**2] * 3,
        [noise.gyro**2] * 3,
        [noise.accel_bias**2] * 3,
        [noise.gyro_bias**2] * 3,
    ]
    return F, np.diag(density)
