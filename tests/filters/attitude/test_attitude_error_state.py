"""What the attitude filters share, against closed forms, Van Loan's matrix exponential and the
Joseph form."""

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import InitialState, Noise
from strapdown.core.mathematics.error_state import ERROR_STATE, allocate
from strapdown.filters.attitude.attitude_error_state import (
    INVERSE,
    RECORD,
    SIX,
    carry,
    count_bias,
    gain_update,
    inject,
    off_vertical,
    propagate,
    scalar_update,
    turn,
)

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=3e-3, accel=0.02, gyro_bias=4e-4, accel_bias=0.0, gyro_decay=1 / 50, accel_decay=0.0
)
EARTH = 0.3, -0.4  # rad/s, north and down: of a faster Earth, so that it shows
STD = np.r_[0.3, 0.2, 0.5, 0.02, 0.03, 0.01]
UP = np.array([0.0, 0.0, -1.0])
OTHERS = [i for i in range(15) if i not in SIX]


def six(P):
    return P[np.ix_(SIX, SIX)]


def random_covariance(rng, std=STD):
    """15 x 15 with six positive states, correlated up to 0.9, and zeros elsewhere."""
    B = np.linalg.cholesky(np.eye(6) + np.ones((6, 6))) @ rng.standard_normal((6, 12))
    B *= (std / np.linalg.norm(B, axis=1))[:, None]
    P = np.zeros((15, 15))
    P[np.ix_(SIX, SIX)] = B @ B.T
    return (P + P.T) / 2


def normalised(difference, P):
    std = np.sqrt(np.diag(P))
    return np.abs(difference / np.outer(std, std)).max()


def belief(rng):
    start = InitialState(
        0.0,
        (0.8, 0.2, 0.0),
        (0.0,) * 3,
        tuple(rng.uniform(-math.pi, math.pi, 3) * [1, 0.5, 1]),
        (0.0,) * 3,
        (0.01, -0.02, 0.03),
        (1.0,) * 15,
    )
    return start.belief(allocate(ERROR_STATE))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_specific_force_stays_where_it_points_while_the_body_turns(share):
    """The old one turns by the whole rotation, the new one is a mean over the sample; the error
    is of third order in the rotation."""
    rng = np.random.default_rng(1)
    old, new, axis = rng.standard_normal(3) * 9, rng.standard_normal(3) * 9, rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    errors = []
    for angle in (0.2, 0.1):
        f, r, dt = old.copy(), axis * angle, 0.01
        # a vector at rest in n, from the body
        body = lambda s: Rotation.from_rotvec(-r * s).apply(new)
        u = np.r_[r, quad_vec(body, 0, 1)[0] * dt]
        carry(f, u, *r, dt, share)
        errors.append(
            np.linalg.norm(
                f - (1 - share) * Rotation.from_rotvec(-r).apply(old) - share * body(1.0)
            )
        )
    assert errors[0] < 0.2**3 * 9 and errors[0] / errors[1] > 7


def test_the_rotation_to_the_vertical_is_exact_at_any_tilt():
    rng = np.random.default_rng(2)
    for _ in range(200):
        C, f = (
            Rotation.random(random_state=rng).as_matrix(),
            rng.standard_normal(3) * rng.choice([0.1, 9.8, 30.0]),
        )
        north, east = off_vertical(C, f)
        np.testing.assert_allclose(
            Rotation.from_rotvec([north, east, 0]).apply(C @ f) / np.linalg.norm(f), UP, atol=1e-12
        )
        assert math.hypot(north, east) <= math.pi + 1e-12


@pytest.mark.parametrize(
    "f, angle",
    [
        ((0, 0, -9.8), 0.0),
        ((0, 0, 9.8), math.pi),
        ((0, 0, 0), 0.0),
        ((9.8, 0, 0), math.pi / 2),
        ((1e-9, 0, 9.8), math.pi - 1e-9 / 9.8),
    ],
)
def test_the_rotation_to_the_vertical_where_it_is_singular(f, angle):
    assert math.hypot(*off_vertical(np.eye(3), np.array(f, float))) == pytest.approx(
        angle, abs=1e-12
    )


def test_the_rate_is_published_and_both_frames_turn():
    b, r, dt = belief(np.random.default_rng(3)), np.array([0.02, -0.03, 0.01]), 0.01
    n = np.array([EARTH[0], 0.0, EARTH[1]]) * dt * 1e3
    before = b.C_nb.copy()
    turn(b, *r, n[0], n[2], dt)
    np.testing.assert_allclose(
        b.C_nb,
        Rotation.from_rotvec(-n).as_matrix() @ before @ Rotation.from_rotvec(r).as_matrix(),
        atol=1e-14,
    )
    np.testing.assert_allclose(b.omega, r / dt)


def dense(C, q, noise=NOISE):
    """(F, Q) of the six error states: theta' = -w x theta - C db - C n, db' = -db/T + walk."""
    north, down = EARTH
    W = np.array([[0, -down, 0], [down, 0, -north], [0, north, 0]])
    F = np.block([[-W, -C], [np.zeros((3, 3)), -noise.gyro_decay * np.eye(3)]])
    return F, np.diag(np.r_[np.full(3, q), np.full(3, noise.gyro_bias**2)])


def propagation_error(dt, P, C):
    q = NOISE.gyro**2
    F, Q = dense(C, q)
    E = expm(np.block([[-F, Q], [np.zeros((6, 6)), F.T]]) * dt)
    Phi = E[6:, 6:].T
    after = P.copy()
    propagate(after, C, EARTH[0] * dt, EARTH[1] * dt, q * dt, dt, NOISE)
    np.testing.assert_array_equal(after, after.T)
    assert not after[OTHERS].any()
    return normalised(six(after) - (Phi @ six(P) @ Phi.T + Phi @ E[:6, 6:]), six(after))


def test_the_covariance_step_is_the_matrix_exponential_to_second_order():
    rng = np.random.default_rng(4)
    for _ in range(20):
        P, C = random_covariance(rng), Rotation.random(random_state=rng).as_matrix()
        errors = [propagation_error(dt, P, C) for dt in (0.04, 0.02, 0.01)]
        assert errors[2] < 2e-4 and errors[0] / errors[1] > 3.5 and errors[1] / errors[2] > 3.5


def take(P, h, e, variance, gate=math.inf, dx=None):
    """(NIS, dx, record) of `scalar_update`, in place of P."""
    dx, record = np.zeros(6) if dx is None else dx, np.full(RECORD.size, np.nan)
    return scalar_update(P, *h, e, variance, gate, dx, record), dx, record


def joseph(P, H, e, R):
    """dx, P, NIS of rows H (m, 6)."""
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    keep = np.eye(6) - K @ H
    return K @ e, keep @ P @ keep.T + K @ R @ K.T, e @ np.linalg.solve(S, e)


def test_a_measurement_is_the_textbook_one_and_several_are_as_one():
    rng = np.random.default_rng(5)
    for count in (1, 2, 3):
        P, H, e, R = (
            random_covariance(rng),
            rng.standard_normal((count, 3)),
            rng.standard_normal(count),
            rng.uniform(1e-3, 1, count),
        )
        dx, after, nis = joseph(six(P), np.c_[H, np.zeros((count, 3))], e, np.diag(R))
        found, total = np.zeros(6), 0.0
        for row in range(count):
            part, _, record = take(P, H[row], e[row], R[row], dx=found)
            total += part
        np.testing.assert_allclose(found, dx, rtol=1e-10)
        assert total == pytest.approx(nis, rel=1e-10) and normalised(six(P) - after, after) < 1e-10
        np.testing.assert_array_equal(P, P.T)
        assert not P[OTHERS].any() and np.isfinite(record).all()


def test_a_gate_leaves_everything_as_it_was():
    rng = np.random.default_rng(6)
    P = random_covariance(rng)
    before, h, e = P.copy(), (0.2, -1.0, 0.4), 1.5
    nis = take(P.copy(), h, e, 0.01)[0]
    again, dx, record = take(P, h, e, 0.01, gate=0.999 * nis)
    assert again == nis and record[INVERSE] == 0 and not dx.any()
    np.testing.assert_array_equal(P, before)
    take(P, h, e, 0.01, gate=1.001 * nis)
    assert (P != before).any()


def test_without_any_uncertainty_nothing_is_measured():
    nis, dx, record = take(np.zeros((15, 15)), (1.0, 0.0, 0.0), 0.1, 0.0)
    assert math.isnan(nis) and not dx.any() and record[INVERSE] == 0


def test_a_measurement_without_noise_leaves_a_covariance():
    P = random_covariance(np.random.default_rng(7))
    for h in np.eye(3):
        take(P, h, 0.0, 0.0)
    assert np.linalg.eigvalsh(six(P)).min() > 0 and np.diag(P)[6:9].max() < 1e-9


def test_a_correction_is_composed_and_taken_back():
    b, dx = belief(np.random.default_rng(8)), np.r_[0.5, -1.0, 2.0, 0.1, 0.2, 0.3]
    expected = Rotation.from_rotvec(dx[:3]).as_matrix() @ b.C_nb
    inject(b, dx)
    np.testing.assert_allclose(b.C_nb, expected, atol=1e-14)
    np.testing.assert_allclose(b.b_g, [0.11, 0.18, 0.33])
    assert not dx.any()


@pytest.mark.parametrize("seed", range(5))
def test_a_pull_by_any_gain_and_biases_that_are_no_states_against_dense_matrices(seed):
    """Only the places of the six states change, alike on both sides of the diagonal."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((15, 15))
    before = root @ root.T
    h, K, S, variance = rng.standard_normal(3), rng.standard_normal(6), *rng.random((2, 6, 3))
    P, H = before.copy(), np.r_[h, 0, 0, 0]
    total = gain_update(P, K, *h, 0.3)
    keep = np.eye(6) - np.outer(K, H)
    assert total == pytest.approx(H @ six(before) @ H + 0.3)
    expected = keep @ six(before) @ keep.T + 0.3 * np.outer(K, K)
    np.testing.assert_allclose(six(P), expected, rtol=1e-9, atol=1e-9)
    count_bias(P, S, variance[0], -1.0)
    expected -= S @ np.diag(variance[0]) @ S.T
    np.testing.assert_allclose(six(P), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_array_equal(P[np.ix_(OTHERS, range(15))], before[np.ix_(OTHERS, range(15))])
