"""Errors on the group of extended poses against 5x5 matrices and scipy's exponential and logarithm."""

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from strapdown.filters.invariant.group_errors import (
    ADDED,
    ESTIMATE,
    IN_GROUP,
    LEFT,
    RIGHT,
    about_correction,
    from_group,
    left_jacobian,
    to_group,
    turn_covariance,
)

pytestmark = pytest.mark.short
SIDES = [LEFT, RIGHT]
RNG = np.random.default_rng(51)


def skew(x):
    return np.cross(np.eye(3), x)


def pose(C, v, p):
    """chi as a 5x5 matrix."""
    chi = np.eye(5)
    chi[:3, :3], chi[:3, 3], chi[:3, 4] = C, v, p
    return chi


def algebra(xi):
    """xi = (p, v, theta) as a 5x5 matrix of the Lie algebra."""
    X = np.zeros((5, 5))
    X[:3, :3], X[:3, 3], X[:3, 4] = skew(xi[6:9]), xi[3:6], xi[:3]
    return X


def coordinates(X):
    """`algebra` undone."""
    return np.concatenate([X[:3, 4], X[:3, 3], [X[2, 1], X[0, 2], X[1, 0]]])


def estimate():
    """(an estimate as a row, its matrix, its velocity, position and biases)."""
    C = Rotation.random(random_state=7).as_matrix()
    v, p, b_a, b_g = RNG.normal(size=(4, 3))
    return np.concatenate([C.ravel(), v, p, b_a, b_g]), C, v, p, b_a, b_g


def off_by(delta, C, v, p):
    """The true pose where an estimate is off by (dp, dv, theta)."""
    turned = Rotation.from_rotvec(delta[6:9]).as_matrix() @ C
    return pose(turned, v + delta[3:6], p + delta[:3])


def error_on_group(chi, known, side):
    """xi with chi = known exp(xi), or exp(xi) known."""
    back = np.linalg.inv(known)
    return coordinates(np.real(logm(back @ chi if side == LEFT else chi @ back)))


@pytest.mark.parametrize("side", SIDES)
def test_errors_on_the_group_are_the_derivative_of_its_logarithm(side):
    row, C, v, p, *_ = estimate()
    known, step = pose(C, v, p), 1e-6
    for k in range(9):
        delta = np.zeros(15)
        delta[k] = 1.0
        one = error_on_group(off_by(step * delta, C, v, p), known, side)
        two = error_on_group(off_by(-step * delta, C, v, p), known, side)
        to_group(delta, side, ADDED, row)
        np.testing.assert_allclose(delta[:9], (one - two) / (2 * step), atol=1e-8)


def test_biases_in_two_frames_are_the_derivative_of_the_group_s_error():
    """xi_b = b - exp(-xi) b_hat, of the law (C1, x1, b1) (C2, x2, b2) = (C1 C2, x1 + C1 x2, b2 + C2' b1)."""
    row, C, _, _, b_a, b_g = estimate()
    step = 1e-6
    for k in range(6, 15):
        delta = np.zeros(15)
        delta[k] = 1.0
        off = step * delta
        turned = Rotation.from_rotvec(-C.T @ off[6:9]).as_matrix()
        expected = np.concatenate([b_a + off[9:12] - turned @ b_a, b_g + off[12:] - turned @ b_g])
        to_group(delta, LEFT, IN_GROUP, row)
        np.testing.assert_allclose(delta[9:], expected / step, atol=1e-5)


def test_biases_in_the_semi_direct_product_are_the_adjoint_of_rotation_and_velocity():
    """xi_b = Ad(C, v) db of SE(3), with the gyro's bias as the rotation."""
    row, C, v, *_ = estimate()
    delta = RNG.normal(size=15)
    Ad = np.block([[C, np.zeros((3, 3))], [skew(v) @ C, C]])  # of (rotation, translation)
    expected = Ad @ np.concatenate([delta[12:], delta[9:12]])
    to_group(delta, RIGHT, IN_GROUP, row)
    np.testing.assert_allclose(np.concatenate([delta[12:], delta[9:12]]), expected, atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("biases", [ADDED, IN_GROUP])
def test_there_and_back(side, biases):
    row, x = estimate()[0], RNG.normal(size=15)
    there = x.copy()
    to_group(there, side, biases, row)
    assert np.abs(there - x).max() > 0.1
    from_group(there, side, biases, row)
    np.testing.assert_allclose(there, x, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 9.99e-3, 1.01e-2, 0.7, 3.1])
def test_the_exponential_of_the_group(angle):
    theta = angle * np.array([0.6, 0.0, -0.8])
    v, p = RNG.normal(size=(2, 3))
    chi = expm(algebra(np.concatenate([p, v, theta])))
    np.testing.assert_allclose(left_jacobian(theta, v), chi[:3, 3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(left_jacobian(theta, p), chi[:3, 4], rtol=0, atol=1e-14)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("size", [0.1, 1.0, 2.5])
def test_errors_about_a_correction(side, size):
    """What is left of errors c + e after exp(c), to first order in e, of a rotation by up to 2.5 rad."""
    direction = RNG.normal(size=9)
    c = size * direction / np.linalg.norm(direction[6:])
    back = np.linalg.inv(expm(algebra(c)))
    for k in range(9):
        e = 1e-6 * np.eye(9)[k]
        one, two = (
            coordinates(np.real(logm(back @ whole if side == LEFT else whole @ back)))
            for whole in (expm(algebra(c + e)), expm(algebra(c - e)))
        )
        x = np.concatenate([e, np.zeros(6)])
        about_correction(x, side, np.concatenate([c, np.zeros(6)]), np.zeros(9))
        np.testing.assert_allclose(x[:9], (one - two) / 2, atol=1e-7 * np.abs(one - two).max())


@pytest.mark.parametrize("n", [15, 18])
def test_a_covariance_is_turned_whole(n):
    root = RNG.normal(size=(n, n))
    P, M = root @ root.T, RNG.normal(size=(15, 15))
    A = np.eye(n)
    A[:15, :15] = M
    expected = A @ P @ A.T
    turn_covariance(P, M, np.zeros(15))
    np.testing.assert_allclose(P, expected, rtol=1e-10, atol=1e-10)
    assert np.array_equal(P, P.T)


def test_a_row_of_an_estimate_has_its_size():
    assert estimate()[0].size == ESTIMATE
