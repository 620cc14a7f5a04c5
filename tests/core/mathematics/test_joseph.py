"""Covariance under gains that do not come from it, against dense matrices."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import dynamics
from strapdown.core.mathematics.joseph import (
    JOSEPH,
    await_step,
    carry,
    has_new_noise,
    joseph_update,
)

pytestmark = pytest.mark.short


@pytest.mark.parametrize("n", [15, 19])
def test_spread_is_josephs_form_for_any_gain(n):
    rng = np.random.default_rng(n)
    root, K, H, noise = (rng.standard_normal(shape) for shape in ((n, n), (n, 3), (3, n), (3, 3)))
    P, R = root @ root.T, noise @ noise.T
    keep = np.eye(n) - K @ H
    expected = keep @ P @ keep.T + K @ R @ K.T
    joseph_update(P, JOSEPH.zeros(), np.ascontiguousarray(-K.T), H, R)
    np.testing.assert_allclose(P, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert (P == P.T).all()


def test_carry_is_the_transition_of_the_error_dynamics():
    """To second order in the 10 ms; the states behind the fifteen stand still."""
    dt, noise = 0.01, Noise(1e-3, 1e-2, 1e-4, 1e-3, 0.01, 0.02)
    lla, v, C = np.array([0.8, 0.1, 500.0]), np.array([30.0, -20.0, 2.0]), Rotation.random(rng=3)
    w, f = np.array([0.2, -0.1, 0.3]), np.array([1.0, -2.0, -9.0])
    middle = (C * Rotation.from_rotvec(0.5 * dt * w)).as_matrix()
    F, Q = dynamics(lla, v, middle, middle @ f, noise)
    Phi = np.eye(17)
    Phi[:15, :15] = expm(F * dt)
    root = np.random.default_rng(4).standard_normal((17, 17))
    P = root @ root.T
    expected = Phi @ P @ Phi.T
    expected[:15, :15] += Q * dt
    own, end = JOSEPH.zeros(), (C * Rotation.from_rotvec(dt * w)).as_matrix()
    assert not await_step(own, w, f, 0.004, noise) and not has_new_noise(own, noise)
    assert not await_step(own, w, f, 0.006, noise)
    assert has_new_noise(own, noise._replace(accel=1.0)) and has_new_noise(
        own, noise._replace(gyro=1.0)
    )
    assert carry(P, own, lla, v, end) == pytest.approx(dt) and not has_new_noise(
        own, noise._replace(accel=1.0)
    )
    assert await_step(own, w, f, 0.05, noise)
    np.testing.assert_allclose(P, expected, rtol=0, atol=2e-5 * np.abs(expected).max())
