"""Without biases and Earth rate the error on the group obeys a linear equation that does not know the
trajectory, however large it is (Barrau & Bonnabel 2017, theorem 2)."""

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation
from test_group_errors import algebra, coordinates, error_on_group, pose

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import BLOCKS
from strapdown.core.mathematics.kalman import WORKSPACE, propagate_error
from strapdown.core.mathematics.rotation_vectors import exponentials
from strapdown.filters.invariant.group_errors import LEFT, from_group, to_group

pytestmark = pytest.mark.short
G = np.array([0.0, 0.0, 9.81])
DT, STEPS = 0.01, 300


def samples(seed):
    """Rotation vectors and velocity increments (STEPS, 3) of a wild motion."""
    rng = np.random.default_rng(seed)
    slow = np.cumsum(rng.normal(size=(STEPS, 6)), axis=0) / 20
    return slow[:, :3] * DT, (slow[:, 3:] * 5 - G) * DT


def flown(chi, r, a):
    """The pose after increments over a flat Earth that does not turn."""
    C, v, p = chi[:3, :3], chi[:3, 3], chi[:3, 4]
    for turn, half, push in zip(exponentials(r), exponentials(r / 2), a):
        p = p + v * DT + 0.5 * DT * (C @ half @ push + G * DT)
        v = v + C @ half @ push + G * DT
        C = C @ turn
    return pose(C, v, p)


def begun(seed):
    rng = np.random.default_rng(seed)
    return pose(
        Rotation.random(random_state=seed).as_matrix(),
        50 * rng.normal(size=3),
        1e3 * rng.normal(size=3),
    )


def test_a_large_error_goes_its_way_whatever_the_trajectory():
    """The same error of 1 rad, 20 m/s and 100 m at two starts, with the same increments."""
    xi = np.concatenate([100 * np.eye(3)[0], 20 * np.eye(3)[1], [0.6, -0.5, 0.6]])
    r, a = samples(1)
    ends = []
    for seed in (2, 3):
        known = begun(seed)
        ends.append(
            error_on_group(flown(known @ expm(algebra(xi)), r, a), flown(known, r, a), LEFT)
        )
    assert np.linalg.norm(ends[0] - xi) > 10
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10 * np.linalg.norm(ends[0]))


def test_twice_the_error_stays_twice_the_error():
    xi = np.concatenate([[3.0, -2.0, 1.0], [0.5, 0.2, -0.4], [0.3, -0.2, 0.4]])
    (r, a), known = samples(4), begun(5)
    one, two = (
        error_on_group(flown(known @ expm(algebra(k * xi)), r, a), flown(known, r, a), LEFT)
        for k in (1, 2)
    )
    np.testing.assert_allclose(two, 2 * one, atol=1e-10 * np.linalg.norm(two))


def test_the_library_s_transition_is_that_equation():
    """F of the fifteen states without its terms of the Earth, in coordinates of the group: to second order in the
    step, as the transition is."""
    xi = np.concatenate([[3.0, -2.0, 1.0], [0.5, 0.2, -0.4], [0.3, -0.2, 0.4]])
    (r, a), known = samples(6), begun(7)
    x = np.concatenate([xi, np.zeros(6)])
    before = np.concatenate([known[:3, :3].ravel(), np.zeros(12)])
    from_group(x, LEFT, 0.0, before)
    C, work, still = known[:3, :3].copy(), np.zeros(WORKSPACE), Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for rotation, turn, push in zip(r, exponentials(r), a):
        mid = C @ Rotation.from_rotvec(rotation / 2).as_matrix()
        propagate_error(x, np.zeros(BLOCKS), mid, mid @ push, (0.0, 0.0, 0.0), DT, still, work)
        C = C @ turn
    to_group(x, LEFT, 0.0, np.concatenate([C.ravel(), np.zeros(12)]))
    expected = error_on_group(flown(known @ expm(algebra(xi)), r, a), flown(known, r, a), LEFT)
    np.testing.assert_allclose(x[:9], expected, atol=1e-5 * np.linalg.norm(expected))


def test_the_logarithm_of_these_errors_is_unique():
    assert np.linalg.norm([0.6, -0.5, 0.6]) < np.pi
    chi = expm(algebra(np.arange(9) / 10))
    np.testing.assert_allclose(coordinates(np.real(logm(chi))), np.arange(9) / 10, atol=1e-12)
