"""Errors of attitude, velocity and position as one element of SE_2(3), the group of extended poses
chi = (C, v, p), and linear maps between them and the fifteen error states of every other filter.

    left:   chi_true = chi exp(xi)      xi = (C' dp, C' dv, C' theta)
    right:  chi_true = exp(xi) chi      xi = (dp + p x theta, dv + v x theta, theta)

p is counted from where the estimate was when a fix came: an origin thousands of km away has no part in
it. With biases in the symmetry their errors are coordinates of the group too:

    left, two frames            xi_a = da - b_a x C' theta,  xi_g = dg - b_g x C' theta
    right, semi-direct product  xi_a = C da + v x C dg,      xi_g = C dg

Source: Barrau & Bonnabel (2017), IEEE TAC 62(4); two frames: Barrau & Bonnabel (2023), IEEE TAC 68(2);
semi-direct product: Fornasier, Ge, van Goor, Mahony & Weiss (2023), arXiv:2309.03765.
"""

import math

from ...core.compile.jit import helper, matrix
from ...core.mathematics.belief import ATT, BA, BG, POS, STATES, VEL, FilterState
from ...core.mathematics.elementary import cosine, sine
from ...core.mathematics.rotation import Three, cross, rotate_vector
from ...typing import Array

LEFT, RIGHT = 0.0, 1.0
"""On which side of the estimate the error stands."""
ADDED, IN_GROUP = 0.0, 1.0
"""Errors of biases: added to them, or coordinates of the group."""
PLACE, V, P, B_A, B_G = 0, slice(9, 12), slice(12, 15), slice(15, 18), slice(18, 21)
"""An estimate in a row: C_nb, v_n (m/s), the position from the origin (m, n), biases (m/s^2, rad/s)."""
ESTIMATE = 21
TERMS = 20
"""Terms of the series of a Jacobian: a correction by half a turn leaves 1e-8."""


@helper
def keep_estimate(belief: FilterState, estimate: Array) -> None:
    """The belief as such a row, its own position being the origin."""
    C = matrix(estimate, PLACE, 3, 3)
    for i in range(3):
        for j in range(3):
            C[i, j] = belief.C_nb[i, j]
        estimate[9 + i], estimate[12 + i] = belief.v_n[i], 0.0
        estimate[15 + i], estimate[18 + i] = belief.b_a[i], belief.b_g[i]


@helper
def add(x: Array, factor: float, y: Three) -> None:
    """x <- x + factor y."""
    x[0] += factor * y[0]
    x[1] += factor * y[1]
    x[2] += factor * y[2]


@helper
def turn(C: Array, x: Array) -> None:
    """x <- C x."""
    x[0], x[1], x[2] = rotate_vector(C, x[0], x[1], x[2])


@helper
def turn_back(C: Array, x: Array) -> None:
    """x <- C' x."""
    x0, x1, x2 = x[0], x[1], x[2]
    for i in range(3):
        x[i] = C[0, i] * x0 + C[1, i] * x1 + C[2, i] * x2


@helper
def to_group(x: Array, side: float, biases: float, estimate: Array) -> None:
    """xi of fifteen errors about an estimate, in place."""
    C, theta, da, dg = matrix(estimate, PLACE, 3, 3), x[ATT], x[BA], x[BG]
    if side == RIGHT:
        add(x[POS], 1.0, cross(estimate[P], theta))
        add(x[VEL], 1.0, cross(estimate[V], theta))
        if biases == IN_GROUP:
            turn(C, da)
            turn(C, dg)
            add(da, 1.0, cross(estimate[V], dg))
    else:
        turn_back(C, x[POS])
        turn_back(C, x[VEL])
        turn_back(C, theta)
        if biases == IN_GROUP:
            add(da, -1.0, cross(estimate[B_A], theta))
            add(dg, -1.0, cross(estimate[B_G], theta))


@helper
def from_group(x: Array, side: float, biases: float, estimate: Array) -> None:
    """Fifteen errors about an estimate of xi, in place: `to_group` undone."""
    C, theta, da, dg = matrix(estimate, PLACE, 3, 3), x[ATT], x[BA], x[BG]
    if side == RIGHT:
        add(x[POS], -1.0, cross(estimate[P], theta))
        add(x[VEL], -1.0, cross(estimate[V], theta))
        if biases == IN_GROUP:
            add(da, -1.0, cross(estimate[V], dg))
            turn_back(C, da)
            turn_back(C, dg)
    else:
        if biases == IN_GROUP:
            add(da, 1.0, cross(estimate[B_A], theta))
            add(dg, 1.0, cross(estimate[B_G], theta))
        turn(C, x[POS])
        turn(C, x[VEL])
        turn(C, theta)


@helper
def left_jacobian(theta: Array, x: Array) -> Three:
    """J(theta) x, with exp(dp, dv, theta) = (exp(theta), J dv, J dp):

    J = I + (1 - cos a) / a^2 S(theta) + (a - sin a) / a^3 S(theta)^2,  a = |theta|
    """
    a2 = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    if a2 < 1e-4:  # the series, to the last bit
        one, two = 0.5 - a2 / 24.0 + a2 * a2 / 720.0, 1.0 / 6.0 - a2 / 120.0 + a2 * a2 / 5040.0
    else:
        a = math.sqrt(a2)
        one, two = (1.0 - cosine(a)) / a2, (a - sine(a)) / (a2 * a)
    b0, b1, b2 = cross(theta, x)
    c0 = theta[1] * b2 - theta[2] * b1
    c1 = theta[2] * b0 - theta[0] * b2
    c2 = theta[0] * b1 - theta[1] * b0
    return x[0] + one * b0 + two * c0, x[1] + one * b1 + two * c1, x[2] + one * b2 + two * c2


@helper
def about_correction(x: Array, side: float, c: Array, term: Array) -> None:
    """xi about the corrected estimate from xi about the old one, the correction c taken off, to first
    order in what is left and to all orders in c, in place:

        left   exp(xi+) = exp(-c) exp(xi)    xi+ = J(-ad c) (xi - c)
        right  exp(xi+) = exp(xi) exp(-c)    xi+ = J(ad c) (xi - c)
        J(A) = I + A / 2! + A^2 / 3! + ...

    With it errors on the left and on the right give one and the same filter. term (9,): workspace.
    Source: Ge, van Goor & Mahony (2023), "A note on the extended Kalman filter on a manifold"; Maurer,
    Basso, Schmidt-Didlaukies & Bryne (2025), arXiv:2506.01514.
    """
    sign = 1.0 if side == RIGHT else -1.0
    for i in range(9):
        term[i] = x[i]
    for k in range(TERMS):
        bracket(c, term, sign / (k + 2))
        for i in range(9):
            x[i] += term[i]


@helper
def bracket(c: Array, y: Array, factor: float) -> None:
    """y <- factor ad(c) y."""
    theta, turn = y[ATT], c[ATT]
    p0, p1, p2 = cross(turn, y[POS])
    v0, v1, v2 = cross(turn, y[VEL])
    q0, q1, q2 = cross(c[POS], theta)
    w0, w1, w2 = cross(c[VEL], theta)
    t0, t1, t2 = cross(turn, theta)
    y[0], y[1], y[2] = factor * (p0 + q0), factor * (p1 + q1), factor * (p2 + q2)
    y[3], y[4], y[5] = factor * (v0 + w0), factor * (v1 + w1), factor * (v2 + w2)
    y[6], y[7], y[8] = factor * t0, factor * t1, factor * t2


@helper
def turn_covariance(P: Array, M: Array, row: Array) -> None:
    """P <- A P A' with A = diag(M, I), M (15, 15); symmetric to the last bit. row (15,): workspace."""
    n = P.shape[0]
    for j in range(n):
        multiply(M, P[:, j], row)
    for i in range(n):
        multiply(M, P[i], row)
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@helper
def multiply(M: Array, x: Array, row: Array) -> None:
    """The first fifteen numbers of x <- M times them."""
    for i in range(STATES):
        total = 0.0
        for k in range(STATES):
            total += M[i, k] * x[k]
        row[i] = total
    for i in range(STATES):
        x[i] = row[i]
