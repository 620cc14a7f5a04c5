"""Rotations against scipy, and the laws that hold whatever the angles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from strapdown.core.mathematics import rotation

pytestmark = pytest.mark.short
repeatable = settings(deadline=None, derandomize=True, max_examples=60)
angles = st.floats(-math.pi, math.pi)
vectors = st.tuples(*[st.floats(-2.5, 2.5)] * 3)  # up to 4.3 rad: beyond half a turn too
DEG = np.pi / 180


def matrix_of(roll, pitch, heading):
    C = np.empty((3, 3))
    rotation.euler_to_matrix(roll, pitch, heading, C)
    return C


def turned(vector, C=None, left=True):
    C = np.eye(3) if C is None else C.copy()
    rotation.rotate_left(*vector, C) if left else rotation.rotate_right(C, *vector)
    return C


@repeatable
@given(angles, st.floats(-1.56, 1.56), angles)
def test_euler_angles_become_the_matrix_and_come_back(roll, pitch, heading):
    C = matrix_of(roll, pitch, heading)
    np.testing.assert_allclose(
        C, Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix(), atol=1e-15
    )
    np.testing.assert_allclose(matrix_of(*rotation.matrix_to_euler(C)), C, atol=1e-13)


@pytest.mark.parametrize("pitch", [89.9, 89.999, -89.9, 60.0, -85.0])
def test_steep_pitch_keeps_heading_and_roll(pitch):
    expected = np.array([-170.0, pitch, 123.0]) * DEG
    np.testing.assert_allclose(rotation.matrix_to_euler(matrix_of(*expected)), expected, atol=1e-9)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_at_vertical_pitch_the_angles_are_finite_and_the_pitch_is_right(pitch):
    angles = rotation.matrix_to_euler(matrix_of(0.3, pitch * DEG, 1.0))
    assert np.all(np.isfinite(angles)) and angles[1] == pytest.approx(pitch * DEG, abs=1e-7)
    # rounded beyond asin's domain
    assert math.isfinite(
        rotation.matrix_to_euler(1.0000000001 * matrix_of(0.3, pitch * DEG, 1.0))[1]
    )


@repeatable
@given(vectors, vectors)
def test_rotate_left_and_right_are_the_exponential_map(vector, other):
    C = Rotation.from_rotvec(other).as_matrix()
    turn = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(turned(vector, C), turn @ C, atol=2e-15)
    np.testing.assert_allclose(turned(vector, C, left=False), C @ turn, atol=2e-15)


@pytest.mark.parametrize(
    "size", [0.0, 1e-12, 1e-6, 0.99e-2, 1.01e-2, 0.1, math.pi, 2 * math.pi, 7.0]
)
def test_exponential_on_both_sides_of_its_series(size):
    vector = size * np.array([2.0, -1, 2]) / 3
    np.testing.assert_allclose(turned(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-15)


@repeatable
@given(vectors)
def test_exponential_is_undone_by_its_negative_and_by_the_logarithm(vector):
    np.testing.assert_allclose(turned(-np.array(vector), turned(vector)), np.eye(3), atol=1e-15)
    logarithm = Rotation.from_matrix(turned(vector)).as_rotvec()
    if np.linalg.norm(vector) < 3.1:
        np.testing.assert_allclose(logarithm, vector, atol=1e-13)


BRANCHES = {
    "w": [0.1, 0.2, -0.3],
    "x": [3.0, 0.2, -0.1],
    "y": [0.1, 3.1, 0.2],
    "z": [-0.2, 0.1, 3.0],
    "half turn x": [math.pi, 0, 0],
    "half turn y": [0, math.pi, 0],
    "half turn z": [0, 0, math.pi],
    "none": [0, 0, 0],
}


@pytest.mark.parametrize("vector", BRANCHES.values(), ids=BRANCHES)
def test_quaternion_in_every_branch(vector):
    expected = Rotation.from_rotvec(vector).as_quat()[[3, 0, 1, 2]]
    q = np.empty(4)
    rotation.matrix_to_quaternion(Rotation.from_rotvec(vector).as_matrix(), q)
    np.testing.assert_allclose(q * np.sign(q @ expected), expected, atol=1e-15)
    assert q[0] >= 0


@repeatable
@given(vectors)
def test_quaternion_is_that_of_the_matrix(vector):
    q = np.empty(4)
    rotation.matrix_to_quaternion(turned(vector), q)
    np.testing.assert_allclose(
        Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix(), turned(vector), atol=2e-15
    )
    assert q[0] >= 0 and np.linalg.norm(q) == pytest.approx(1, abs=1e-15)


@repeatable
@given(st.floats(-1e4, 1e4))
def test_wrapped_angle_is_the_same_direction(angle):
    wrapped = rotation.wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert abs(np.exp(1j * wrapped) - np.exp(1j * angle)) < 1e-11


@pytest.mark.parametrize(
    "angle, expected", [(0.0, 0.0), (3.1, 3.1), (3.2, 3.2 - 2 * math.pi), (-3.2, 2 * math.pi - 3.2)]
)
def test_wrap_leaves_small_angles(angle, expected):
    assert rotation.wrap(angle) == pytest.approx(expected, abs=1e-15)
    assert math.isnan(rotation.wrap(math.nan))


def test_orthonormalise_finds_the_nearest_rotation():
    rng = np.random.default_rng(1)
    C = Rotation.random(random_state=2).as_matrix()
    noisy = C + 1e-5 * rng.standard_normal((3, 3))
    u, _, vt = np.linalg.svd(noisy)
    rotation.orthonormalise(noisy)
    np.testing.assert_allclose(noisy, u @ vt, atol=1e-9)  # one step leaves the square of the defect
    rotation.orthonormalise(noisy)
    np.testing.assert_allclose(noisy.T @ noisy, np.eye(3), atol=1e-15)


def test_after_many_products_one_step_makes_it_a_rotation_again():
    products, vector, C = 100_000, 0.01 * np.array([1.0, -2.0, 0.5]), np.eye(3)
    for _ in range(products):
        rotation.rotate_left(vector[0], vector[1], vector[2], C)
    np.testing.assert_allclose(C, Rotation.from_rotvec(products * vector).as_matrix(), atol=1e-10)
    assert 1e-14 < np.abs(C.T @ C - np.eye(3)).max() < 1e-10
    rotation.orthonormalise(C)
    assert np.abs(C.T @ C - np.eye(3)).max() < 1e-15


@repeatable
@given(vectors, st.integers(-3, 3), st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_the_nearest_turn_is_the_same_rotation_and_no_other_is_nearer(vector, turns, off):
    x = np.array(vector)
    size = np.linalg.norm(x)
    if not 1e-3 < size < 3:
        return
    near = x * (1 + 2 * math.pi * turns / size) + off
    own = np.array(rotation.nearest_turn(*x, *near))
    others = x * (1 + 2 * math.pi * np.arange(-5, 6)[:, None] / size)
    assert np.linalg.norm(own - near) == pytest.approx(
        np.linalg.norm(others - near, axis=1).min(), abs=1e-9
    )
    assert (
        np.abs(Rotation.from_rotvec(own).as_matrix() - Rotation.from_rotvec(x).as_matrix()).max()
        < 1e-12
    )


def test_the_nearest_turn_of_no_rotation_is_whole_turns():
    assert rotation.nearest_turn(0.0, 0.0, 0.0, 0.1, 0.2, 6.2) == pytest.approx(
        2 * math.pi * np.array([0.1, 0.2, 6.2]) / np.linalg.norm([0.1, 0.2, 6.2])
    )
    assert (
        rotation.nearest_turn(0.0, 0.0, 0.0, 0.1, 0.0, 0.0)
        == rotation.nearest_turn(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        == (0, 0, 0)
    )
