"""Prediction of the covariance against Van Loan's matrix exponential, correction against the
Joseph form; symmetry, sign, gate."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from ins_equations import DEG
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown.core.mathematics.error_dynamics import (
    BLOCKS,
    CORRECTED,
    LITERAL,
    cross_matrix,
    dynamics,
    kinematic_blocks,
)
from strapdown.core.mathematics.kalman import (
    WORKSPACE,
    propagate,
    propagate_error,
    propagate_in_place,
    update,
)
from strapdown.filters.ins.closed_loop import CLOSED_LOOP

pytestmark = pytest.mark.short
repeatable = settings(deadline=None, derandomize=True, max_examples=40)
NOISE = Noise(
    gyro=1e-4, accel=2e-3, gyro_bias=3e-6, accel_bias=4e-5, gyro_decay=1 / 300, accel_decay=1 / 100
)
WALK = NOISE._replace(gyro_decay=0.0, accel_decay=0.0)
STD = np.r_[[3.0] * 3, [0.3] * 3, [0.01, 0.01, 0.05], [0.05] * 3, [1e-3] * 3]
LLA, V = np.array([-70 * DEG, 2.0, 9000.0]), np.array([120.0, -150.0, 8.0])
C = Rotation.from_euler("ZYX", [2.0, 1.2, -0.4]).as_matrix()
FORCE = np.array([20.0, -15.0, -17.0])  # body, 30 m/s^2


def covariance(rng, std):
    """A positive matrix with these standard deviations and correlations up to 0.9."""
    n = len(std)
    A = np.linalg.cholesky(np.eye(n) + 0.5 * np.ones((n, n)))
    B = A @ rng.standard_normal((n, 2 * n))
    P = B @ B.T
    scale = std / np.sqrt(np.diag(P))
    P *= np.outer(scale, scale)
    return (P + P.T) / 2


def van_loan(F, Q, dt):
    """Transition and integrated noise of a constant F over dt; Van Loan (1978)."""
    n = len(F)
    E = expm(np.block([[-F, Q], [np.zeros((n, n)), F.T]]) * dt)
    Phi = E[n:, n:].T
    return Phi, Phi @ E[:n, n:]


def step(P, dt, noise=NOISE, C=C, model=CORRECTED, vector=None, by=propagate):
    """One prediction in place of P, or of an error vector."""
    # stale numbers in the workspace must not matter
    blocks, work = (
        np.zeros(BLOCKS),
        np.full(WORKSPACE, np.nan),
    )
    w = np.array(kinematic_blocks(LLA, V, model, blocks)) * dt
    if vector is None:
        by(P, blocks, C, C @ FORCE * dt, tuple(w), dt, noise, work)
    else:
        propagate_error(vector, blocks, C, C @ FORCE * dt, tuple(w), dt, noise, work)


def transition(dt, noise=NOISE, model=CORRECTED):
    columns = np.eye(15)
    for column in columns:
        step(None, dt, noise, model=model, vector=column)
    return columns.T


def normalised(difference, P):
    """The largest error of a covariance in units of its standard deviations."""
    std = np.sqrt(np.diag(P))
    return np.abs(difference / np.outer(std, std)).max()


@pytest.mark.parametrize("model", [CORRECTED, LITERAL])
def test_transition_is_the_matrix_exponential_to_third_order(model):
    F, _ = dynamics(LLA, V, C, C @ FORCE, NOISE, model)
    errors = [np.abs(transition(dt, model=model) - expm(F * dt)) for dt in (0.1, 0.05, 0.025)]
    assert (
        7.5 < errors[0].max() / errors[1].max() < 8.5
        and 7.5 < errors[1].max() / errors[2].max() < 8.5
    )
    small = np.abs(transition(0.01, model=model) - expm(0.01 * F)) / np.outer(STD, 1 / STD)
    assert small.max() < 2e-7  # in standard deviations, at 100 Hz
    kinematic = np.r_[0:6]  # no large numbers there: what is left out is the square of F, 1e-5 1/s
    assert small[np.ix_(kinematic, kinematic)].max() < 1e-9


@pytest.mark.parametrize("model", [CORRECTED, LITERAL])
def test_every_entry_of_F_is_in_the_transition(model):
    """Also those of 1e-11 1/s, which no covariance shows."""
    dt = 1e-4
    F, _ = dynamics(LLA, V, C, C @ FORCE, NOISE, model)
    there = F != 0
    assert there.sum() > 60
    np.testing.assert_allclose(
        ((transition(dt, model=model) - np.eye(15)) / dt)[there], F[there], rtol=1e-3, atol=0
    )


@pytest.mark.parametrize(
    "noise, keep_accel, keep_gyro",
    [(NOISE, math.exp(-0.05 / 100), math.exp(-0.05 / 300)), (WALK, 1.0, 1.0)],
)
def test_biases_decay_as_gauss_markov_processes(noise, keep_accel, keep_gyro):
    np.testing.assert_allclose(
        transition(0.05, noise)[9:, 9:], np.diag([keep_accel] * 3 + [keep_gyro] * 3), rtol=1e-15
    )
    assert not transition(0.05, noise)[9:, :9].any()


def test_stationary_bias_keeps_its_variance():
    """With driving noise 2 std^2 / tau a Gauss-Markov bias stays at its standard deviation."""
    noise = Noise(
        0.0, 0.0, math.sqrt(2 * 1e-6 / 300), math.sqrt(2 * 0.0025 / 100), 1 / 300, 1 / 100
    )
    P = np.diag(np.r_[np.zeros(9), [0.0025] * 3, [1e-6] * 3])
    for _ in range(100):
        step(P, 0.1, noise)
    np.testing.assert_allclose(np.diag(P)[9:], [0.0025] * 3 + [1e-6] * 3, rtol=1e-5)


@pytest.mark.parametrize("n", [15, 16, 17, 18])
@pytest.mark.parametrize("rate, tolerance", [(100.0, 2e-7), (20.0, 5e-6)])
def test_prediction_agrees_with_van_loan(n, rate, tolerance):
    """Also with states beyond the fifteenth, which stand still."""
    P = covariance(np.random.default_rng(n), np.r_[STD, np.full(n - 15, 2.0)])
    F, Q = (np.pad(part, (0, n - 15)) for part in dynamics(LLA, V, C, C @ FORCE, NOISE))
    Phi, Q_d = van_loan(F, Q, 1 / rate)
    expected = Phi @ P @ Phi.T + Q_d
    before = P.copy()
    step(P, 1 / rate)
    assert normalised(P - expected, expected) < tolerance
    assert normalised(P - before, expected) > 10 * tolerance
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_array_equal(P[15:, 15:], before[15:, 15:])


@pytest.mark.parametrize("seed", range(20))
def test_any_prediction_agrees_with_van_loan(seed):
    """At random places, speeds, attitudes and forces, with noise as large as P: to third order in
    dt."""
    rng = np.random.default_rng(seed)
    lla, v = np.array([rng.uniform(-1.4, 1.4), 0.0, rng.uniform(-400, 12e3)]), rng.normal(0, 120, 3)
    C, f = Rotation.random(rng=rng).as_matrix(), rng.normal(0, 15, 3)
    dt = 0.01
    densities = (
        STD[[6, 3, 12, 9]] / math.sqrt(dt) * 10 ** rng.uniform(-1, 0, 4)
    )  # in a step up to STD
    noise = Noise(*densities, *rng.uniform(0, 0.01, 2))
    P = covariance(rng, STD)
    F, Q = dynamics(lla, v, C, C @ f, noise)
    Phi, Q_d = van_loan(F, Q, dt)
    expected, blocks = Phi @ P @ Phi.T + Q_d, np.zeros(BLOCKS)
    w = np.array(kinematic_blocks(lla, v, CORRECTED, blocks)) * dt
    propagate(P, blocks, C, C @ f * dt, tuple(w), dt, noise, np.full(WORKSPACE, np.nan))
    assert normalised(P - expected, expected) < 4e-5


@pytest.mark.parametrize("n", [15, 17])
def test_prediction_is_its_own_transition_twice(n):
    """Without noise P becomes Phi P Phi' with the Phi of `propagate_error`, to rounding: every
    block, whatever the order of the products."""
    P, still = (
        covariance(np.random.default_rng(7), np.r_[STD, np.full(n - 15, 2.0)]),
        Noise(0.0, 0.0, 0.0, 0.0, 0.5, 0.25),
    )
    Phi = np.eye(n)
    Phi[:15, :15] = transition(0.05, still)
    expected = Phi @ P @ Phi.T
    step(P, 0.05, still)
    assert normalised(P - expected, expected) < 1e-13


@pytest.mark.parametrize("noise", [NOISE, WALK])
@pytest.mark.parametrize("n", [15, 17, 26])
def test_in_place_it_is_the_same_to_the_bit(n, noise):
    P = covariance(np.random.default_rng(7), np.r_[STD, np.full(n - 15, 2.0)])
    twin = P.copy()
    for _ in range(3):
        step(P, 0.05, noise)
        step(twin, 0.05, noise, by=propagate_in_place)
    np.testing.assert_array_equal(twin, P)


def test_noise_from_nothing_adds_up_to_the_integral():
    """From P = 0 over 1 s: the double and triple integrals of white noise too, where one step
    alone has them only to first order."""
    F, Q = dynamics(LLA, V, C, C @ FORCE, NOISE)
    expected = van_loan(F, Q, 1.0)[1]
    errors = []
    for rate in (50, 100):
        P = np.zeros((15, 15))
        for _ in range(rate):
            step(P, 1 / rate)
        errors.append(normalised(P - expected, expected))
    assert errors[1] < 1e-3 and errors[0] / errors[1] == pytest.approx(4, abs=0.4)


ROTATIONS = {
    "straight": (0.0, 0.0, 0.0),
    "roll 200 deg/s": (200.0, 0.0, 0.0),
    "tumbling 200 deg/s": (100.0, -120.0, 125.0),
}


@pytest.mark.parametrize("rate, tolerance", [(100, 5e-4), (20, 1e-2)])
@pytest.mark.parametrize("turn", ROTATIONS)
def test_prediction_of_a_filter_in_fast_rotation(turn, rate, tolerance):
    """`predict` of the closed loop over 0.5 s at 30 m/s^2 against Van Loan on 20 slices of each
    sample, in which the body turns."""
    compile_kernel(CLOSED_LOOP.predict)
    omega, dt, slices = DEG * np.array(ROTATIONS[turn]), 1 / rate, 20
    bias = np.array([0.3, -0.2, 0.1]), np.array([0.02, 0.01, -0.03])
    belief = CLOSED_LOOP.start(
        InitialState(0.0, tuple(LLA), tuple(V), (-0.4, 1.2, 2.0), *map(tuple, bias), tuple(STD)),
        NOISE,
    )
    expected, belief.P[:] = (
        covariance(np.random.default_rng(3), STD),
        covariance(np.random.default_rng(3), STD),
    )
    for _ in range(rate // 2):
        u = np.r_[(omega + belief.b_g) * dt, (FORCE + belief.b_a) * dt]
        for k in range(slices):
            C_k = belief.C_nb @ Rotation.from_rotvec(omega * dt * (k + 0.5) / slices).as_matrix()
            Phi, Q_d = van_loan(
                *dynamics(belief.lla, belief.v_n, C_k, C_k @ FORCE, NOISE), dt / slices
            )
            expected = Phi @ expected @ Phi.T + Q_d
        CLOSED_LOOP.predict(belief, u, dt, NOISE)
        np.testing.assert_allclose(np.r_[belief.omega, belief.f], np.r_[omega, FORCE], atol=1e-12)
    assert normalised(belief.P - expected, expected) < tolerance
    decayed = bias[0] * math.exp(-0.5 / 100), bias[1] * math.exp(-0.5 / 300)
    np.testing.assert_allclose(np.r_[belief.b_a, belief.b_g], np.concatenate(decayed), rtol=1e-12)


def lever_arm_jacobian(n):
    """A position fix with lever arm and a state beyond the fifteenth."""
    H = np.zeros((3, n))
    H[:, 0:3], H[:, 6:9] = np.eye(3), -cross_matrix([1.5, -2.0, 3.0])
    H[2, 15:] = 1.0
    return H


def textbook(P, H, innovation, std):
    """Gain, covariance in the Joseph form and NIS of the measured rows."""
    measured = ~np.isnan(innovation)
    H, R, e = H[measured], np.diag(std[measured] ** 2), innovation[measured]
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    A = np.eye(len(P)) - K @ H
    return K @ e, A @ P @ A.T + K @ R @ K.T, e @ np.linalg.solve(S, e)


def corrected(P, H, innovation, std, rows=3, gate=math.inf):
    """(NIS, dx, P) after `update`, which is given a workspace full of old numbers."""
    n = len(P)
    P, dx = P.copy(), np.full(2 * n, 77.0)
    nis = update(P, H, innovation, std, rows, gate, np.full(WORKSPACE, 1e3), dx)
    return nis, dx[:n], P


ROWS = {
    "three": [1.0, -2.0, 0.5],
    "first": [1.0, np.nan, np.nan],
    "second": [np.nan, -2.0, np.nan],
    "last": [np.nan, np.nan, 0.5],
    "first and last": [1.0, np.nan, 0.5],
    "first two": [1.0, -2.0, np.nan],
    "last two": [np.nan, -2.0, 0.5],
}


@pytest.mark.parametrize("n", [15, 16, 18])
@pytest.mark.parametrize("measured", ROWS)
def test_correction_is_the_textbook_one(n, measured):
    P = covariance(np.random.default_rng(n), np.r_[STD, np.full(n - 15, 2.0)])
    innovation, std = np.array(ROWS[measured]), np.array([1.0, 2.0, 0.5])
    nis, dx, after = corrected(P, lever_arm_jacobian(n), innovation, std)
    expected_dx, expected_P, expected_nis = textbook(P, lever_arm_jacobian(n), innovation, std)
    assert nis == pytest.approx(expected_nis, rel=1e-12)
    np.testing.assert_allclose(dx, expected_dx, rtol=1e-10, atol=1e-14)
    assert normalised(after - expected_P, expected_P) < 1e-12
    np.testing.assert_array_equal(after, after.T)


@pytest.mark.parametrize("seed", range(20))
def test_any_correction_is_the_textbook_one(seed):
    """A full H, a full P, noises of a thousandth to a thousand times what the states bring, rows
    missing at random."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(15, 30))
    scale = np.r_[STD, np.full(n - 15, 2.0)]
    P, H = covariance(rng, scale), rng.standard_normal((3, n)) / scale
    innovation, std = rng.standard_normal(3), 10 ** rng.uniform(-3, 3, 3)
    innovation[rng.random(3) < 0.2] = np.nan
    nis, dx, after = corrected(P, H, innovation, std)
    expected_dx, expected_P, expected_nis = textbook(P, H, innovation, std)
    if np.isnan(innovation).all():
        assert math.isnan(nis)
        return
    assert nis == pytest.approx(expected_nis, rel=1e-9)
    np.testing.assert_allclose(dx / scale, expected_dx / scale, rtol=0, atol=1e-9)
    assert normalised(after - expected_P, P) < 1e-12
    np.testing.assert_array_equal(after, after.T)


@pytest.mark.parametrize("rows", [1, 2])
def test_rows_that_a_sensor_does_not_have_are_not_read(rows):
    P, H = covariance(np.random.default_rng(1), STD), lever_arm_jacobian(15)
    innovation, std = np.array([1.0, -2.0, 0.5]), np.array([1.0, 2.0, 0.5])
    nis, dx, after = corrected(P, H, innovation, std, rows)
    padded = np.where(np.arange(3) < rows, innovation, np.nan)
    expected = corrected(P, H, padded, std)
    assert nis == expected[0]
    np.testing.assert_array_equal(dx, expected[1])
    np.testing.assert_array_equal(after, expected[2])


def test_nothing_measured_changes_nothing():
    P = covariance(np.random.default_rng(1), STD)
    nis, dx, after = corrected(P, lever_arm_jacobian(15), np.full(3, np.nan), np.ones(3))
    assert math.isnan(nis) and not dx.any()
    np.testing.assert_array_equal(after, P)


def test_gate_leaves_the_covariance_as_it_was_to_the_last_bit():
    P, H, innovation, std = (
        covariance(np.random.default_rng(1), STD),
        lever_arm_jacobian(15),
        np.array([9.0, -9.0, 9.0]),
        np.ones(3),
    )
    nis = textbook(P, H, innovation, std)[2]
    below, above = (
        corrected(P, H, innovation, std, gate=0.999 * nis),
        corrected(P, H, innovation, std, gate=1.001 * nis),
    )
    assert below[0] == above[0] == pytest.approx(nis)
    np.testing.assert_array_equal(below[2], P)
    assert np.all(np.diag(above[2]) <= np.diag(P)) and above[2][0, 0] < 0.9 * P[0, 0]
    np.testing.assert_array_equal(corrected(P, H, np.array([1e150, 0, 0]), std, gate=16.0)[2], P)


def is_positive(P):
    scale = 1 / np.sqrt(np.diag(P))
    return np.all(np.diag(P) > 0) and np.linalg.eigvalsh(P * np.outer(scale, scale)).min() > 0


EXTREMES = {
    "plain": np.eye(3, 15),
    "lever arm": lever_arm_jacobian(15),
    "alike": np.ones((3, 15)) + 1e-3 * np.eye(3, 15),
}


@pytest.mark.parametrize("H", EXTREMES.values(), ids=EXTREMES)
def test_extreme_ratio_of_belief_and_noise_stays_positive(H):
    P, std = 1e6 * np.eye(15), np.full(3, 1e-6)
    for _ in range(20):
        _, _, P = corrected(P, H, np.zeros(3), std)
        assert is_positive(P)
        np.testing.assert_array_equal(P, P.T)
    step(P, 0.01)
    assert is_positive(P)


def test_a_perfect_fix_counts_as_nearly_perfect():
    _, dx, P = corrected(np.diag(STD**2), np.eye(3, 15), np.ones(3), np.zeros(3))
    np.testing.assert_allclose(dx[:3], 1, rtol=1e-8)
    assert 0 < P[0, 0] < 1e-7 * STD[0] ** 2


seconds = st.sampled_from([0.001, 0.01, 0.05, 1.0])
fixes = st.tuples(
    st.sampled_from([0, 1, 2]),
    st.sampled_from([1e-3, 1.0, 100.0]),
    st.lists(st.booleans(), min_size=3, max_size=3),
)


@repeatable
@given(
    st.lists(seconds | fixes, max_size=40),
    st.sampled_from([15, 17]),
    st.sampled_from([1e-3, 1.0, 100.0]),
)
def test_any_sequence_keeps_the_covariance_symmetric_and_positive(events, n, scale):
    P = covariance(np.random.default_rng(5), scale * np.r_[STD, np.full(n - 15, 2.0)])
    jacobians = [lever_arm_jacobian(n), np.eye(3, n, 3), np.eye(3, n, 8)]
    for event in events:
        if isinstance(event, float):
            step(P, event)
        else:
            which, std, missing = event
            innovation = np.where(missing, np.nan, [1.0, -2.0, 0.5])
            before = np.trace(P)
            P = corrected(P, jacobians[which], innovation, np.full(3, std))[2]
            assert np.trace(P) <= before
        np.testing.assert_array_equal(P, P.T)
        assert is_positive(P)
