"""The gains of the translational motion observer at one fix, in closed form: velocity that a gap
spread, and poles with and without velocities."""

import numpy as np
import pytest
from scipy.linalg import expm

from strapdown.filters.observer.gains import transition
from strapdown.filters.observer.translation_gains import (
    AGE,
    BY_POLES,
    DESIGN,
    LOST,
    PAIR,
    POLE,
    RICCATI,
    SPREAD,
    TRANSLATION,
    VELOCITY_AGE,
    P,
    fix_gains,
)

pytestmark = pytest.mark.short


def correction(own, velocity, axis=0):
    """Gains on position, velocity and force of a fix with std 0.5."""
    change = np.zeros(3)
    fix_gains(own, axis, velocity, 0.5, 0.0, 0.0, change)
    return change


def test_what_a_gap_spread_counts_once_for_each_axis():
    own = TRANSLATION.zeros()
    own[DESIGN], own[SPREAD] = RICCATI, 2.0
    own[P][3] = own[P][9] = 0.1  # variance of velocity, north and east
    assert np.allclose(correction(own, True), [0, 2.1 / 2.35, 0], atol=1e-12)
    left = 2.1 * 0.25 / 2.35
    assert np.allclose(correction(own, True), [0, left / (left + 0.25), 0], atol=1e-12)
    assert np.allclose(correction(own, True, axis=1), [0, 2.1 / 2.35, 0], atol=1e-12)


@pytest.mark.parametrize(
    "since, alone", [(0.5, False), (2.999, False), (3.0, False), (3.001, True), (50.0, True)]
)
def test_positions_do_the_work_of_velocities_that_are_lost(since, alone):
    """Until LOST seconds without one a position corrects the position alone; then its gains have
    all three poles."""
    own, T, poles = TRANSLATION.zeros(), 0.8, np.array([-0.5, -0.4 + 0.3j, -0.4 - 0.3j])
    own[DESIGN], own[LOST], own[POLE], own[PAIR] = BY_POLES, 3.0, -0.5, (-0.4, 0.3, 1.0)
    own[AGE][0], own[VELOCITY_AGE][0] = T, since
    K = correction(own, False)
    assert own[AGE][0] == 0 and own[VELOCITY_AGE][0] == since
    if not alone:
        assert np.allclose(K, [1 - np.exp(-0.5 * T), 0, 0], rtol=1e-12, atol=0)
    else:
        found = np.linalg.eigvals((np.eye(3) - np.outer(K, [1.0, 0, 0])) @ transition(T))
        assert np.abs(np.poly(found) - np.poly(np.exp(poles * T))).max() < 1e-12


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("velocity", [False, True])
def test_gains_of_the_riccati_equation_are_those_of_the_dense_filter(axis, velocity):
    """Van Loan's process noise over the time since the last fix, then a scalar update."""
    rng, std, accel, wander, T, spread = np.random.default_rng(axis), 0.5, 0.3, 0.2, 0.8, 0.4
    B = rng.standard_normal((3, 3))
    dense, upper = B @ B.T, np.triu_indices(3)
    own = TRANSLATION.zeros()
    own[DESIGN], own[SPREAD], own[AGE][axis] = RICCATI, spread, T
    packed = own[P][6 * axis : 6 * axis + 6]
    packed[:] = dense[upper]
    for _ in range(2):  # the second fix at once: no time, no spread
        F, Q = np.diag([1.0, 1.0], 1), np.diag([0.0, accel**2, wander**2])
        loan = expm(np.block([[-F, Q], [np.zeros((3, 3)), F.T]]) * T)
        Phi = loan[3:, 3:].T
        dense = Phi @ (dense + np.diag([0.0, spread, 0.0])) @ Phi.T + Phi @ loan[:3, 3:]
        h = np.eye(3)[int(velocity)]
        K = dense @ h / (h @ dense @ h + std**2)
        dense = dense - np.outer(K, h @ dense)
        found = np.zeros(3)
        fix_gains(own, axis, velocity, std, accel, wander, found)
        np.testing.assert_allclose(found, K, rtol=1e-9)
        np.testing.assert_allclose(packed, dense[upper], rtol=1e-9, atol=1e-12)
        T, spread = 0.0, 0.0
    others = np.delete(own[P].reshape(3, 6), axis, axis=0)
    assert not others.any()
