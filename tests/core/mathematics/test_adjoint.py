"""How the calls of the error-state filters are undone: the adjoints of the compiled prediction and
correction against dense matrices.

The transition comes from the columns that the compiled step makes of unit errors, the correction
from the textbook's gain.
"""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from test_kalman import covariance

from strapdown.core.loop.contract import (
    CORRECT,
    OBSERVE,
    PREDICT,
    InitialState,
    Noise,
    compile_kernel,
    kernel,
)
from strapdown.core.mathematics.adjoint import adjoint_step, save_step, width
from strapdown.core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    PREDICTED,
    X,
    allocate,
    inject_and_reset,
    linearised_step,
    measure,
)
from strapdown.core.mathematics.smoother import work_size
from strapdown.core.mathematics.source import new_source

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=1e-4, accel=2e-3, gyro_bias=3e-6, accel_bias=4e-5, gyro_decay=1 / 3, accel_decay=1 / 5
)
STD = np.r_[[3.0] * 3, [0.3] * 3, [0.01, 0.01, 0.05], [0.05] * 3, [1e-3] * 3]
SCALE = (*STD, 2.0, 2.0, 2.0)
STATES = [15, 16, 18]


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """The linearised step, with an error beside the belief that shows its transition."""
    linearised_step(
        belief,
        belief.C_nb,
        belief.augmented[0] if belief.augmented.size else 1.0,
        u,
        dt,
        noise,
        True,
    )


def belief(n, error_model="corrected"):
    """At 70 deg south and 190 m/s, where no block of the transition is small; P full."""
    start = InitialState(
        0.0,
        (-1.2, 2.0, 9000.0),
        (120.0, -150.0, 8.0),
        (-0.4, 1.2, 2.0),
        (0.1, -0.2, 0.3),
        (0.01, 0.02, -0.03),
        (*STD, *[2.0] * (n - 15)),
    )
    made = start.belief(allocate(ERROR_STATE, error_model))
    made.P[...] = covariance(np.random.default_rng(n), np.array(start.std))
    made.augmented[:] = 1.0
    return made


def record(made):
    """What `save_step` leaves of the last call, in a record that held other things before."""
    compile_kernel(save_step)
    row = np.full(width(len(made.P)), np.nan)
    save_step(made, row)
    return row


def undone(row, lam, Lam):
    compile_kernel(adjoint_step)
    found, Found = lam.copy(), Lam.copy()
    # stale numbers in the workspace must not matter
    adjoint_step(row, found, Found, np.full(work_size(len(lam), len(lam)), np.nan))
    return found, Found


def later(n, seed=1):
    """lam and Lam of about the size that they have: 1/std, and less than the inverse of P."""
    rng, std = np.random.default_rng(seed), np.r_[STD, [2.0] * (n - 15)]
    return rng.standard_normal(n) / std, covariance(rng, 1 / std)


def close(found, expected, std, tolerance=1e-11):
    """Assert that a vector or matrix of 1/std is as expected."""
    scale = std if found.ndim == 1 else np.outer(std, std)
    assert np.abs((found - expected) * scale).max() < tolerance * max(
        1.0, np.abs(expected * scale).max()
    )


def transition(n, dt, u, error_model="corrected", coupling=1.0):
    """Phi (n, n) in columns: what the compiled step makes of unit errors kept beside the belief.
    States beyond the fifteenth stand still."""
    compile_kernel(predict)
    Phi = np.eye(n)
    for column in range(15):
        made = belief(n, error_model)
        made.augmented[:] = coupling
        made.workspace[X] = Phi[:15, column]
        predict(made, u, dt, NOISE)
        Phi[:15, column] = made.workspace[X]
    return Phi


@pytest.mark.parametrize("n", STATES)
@pytest.mark.parametrize(
    "dt, error_model",
    [(0.01, "corrected"), (0.5, "corrected"), (0.1, "literal"), (0.0, "corrected")],
)
def test_adjoint_of_the_prediction_is_the_transposed_transition(n, dt, error_model):
    u = np.r_[np.array([0.2, -0.5, 0.8]) * dt, np.array([20.0, -15.0, -17.0]) * dt]
    Phi, (lam, Lam), made = transition(n, dt, u, error_model), later(n), belief(n, error_model)
    compile_kernel(predict)
    predict(made, u, dt, NOISE)
    row = record(made)
    assert row[0] == PREDICTED and np.abs(Phi - np.eye(n))[:9].max() >= 5 * dt
    found, Found = undone(row, lam, Lam)
    std = np.r_[STD, [2.0] * (n - 15)]
    close(found, Phi.T @ lam, std)
    close(Found, Phi.T @ Lam @ Phi, std)
    there = (np.abs(Phi) > 0) & (Phi != np.eye(n))  # each entry, however small
    for column in range(n):
        unit, _ = undone(row, np.eye(n)[column], Lam)
        np.testing.assert_allclose(
            unit[there[column]], Phi[column][there[column]], rtol=1e-9, atol=0
        )
        assert not unit[~there[column] & (np.arange(n) != column)].any()


def test_an_attitude_known_from_elsewhere_does_not_reach_the_velocity():
    u = np.r_[0.02, -0.05, 0.08, 2.0, -1.5, -1.7]
    Phi, (lam, Lam), made = transition(16, 0.1, u, coupling=0.0), later(16), belief(16)
    made.augmented[:] = 0.0
    predict(made, u, 0.1, NOISE)
    assert not Phi[3:6, 6:9].any()
    found, Found = undone(record(made), lam, Lam)
    close(found, Phi.T @ lam, np.r_[STD, 2.0])
    close(Found, Phi.T @ Lam @ Phi, np.r_[STD, 2.0])


@kernel(OBSERVE)
def observe(belief, y, parameters, innovation, H):
    """Three rows of which each sees many states; those of a y that is no number are not
    measured."""
    for i in range(3):
        innovation[i] = y[i]
        for j in range(i, H.shape[1], 2):
            H[i, j] = math.cos(3.0 * i + j) / SCALE[j]
    return 3


@kernel(CORRECT)
def correct(belief, y, std, kind, observe, parameters, gate, innovation):
    """As the filters."""
    nis = measure(belief, y, std, observe, parameters, gate, innovation)
    if nis <= gate:
        inject_and_reset(belief, belief.workspace[DX])
    return nis


def corrected(made, y, gate=np.inf):
    """(NIS, H, R of the measured rows) of a fix with these innovations."""
    n, std = len(made.P), np.array([0.5, 1.0, 2.0])
    compile_kernel(correct)
    compile_kernel(observe)
    nis = correct(made, np.array(y), std, 0, observe, new_source(), gate, np.empty(12))
    H = np.array(
        [
            [
                math.cos(3.0 * i + j) / SCALE[j] if j >= i and (j - i) % 2 == 0 else 0.0
                for j in range(n)
            ]
            for i in range(3)
        ]
    )
    rows = ~np.isnan(y)
    return nis, H[rows], np.diag(std[rows] ** 2)


@pytest.mark.parametrize("n", STATES)
@pytest.mark.parametrize("y", [(1.0, -2.0, 3.0), (0.3, np.nan, 1.0), (np.nan, np.nan, -2.0)])
def test_adjoint_of_the_correction(n, y):
    made, (lam, Lam), scale = belief(n), later(n), np.r_[STD, [2.0] * (n - 15)]
    before = made.P.copy()
    nis, H, R = corrected(made, y)
    e, S = np.array([v for v in y if v == v]), H @ before @ H.T + R
    theta = made.workspace[DX][6:9]
    A = block_diag(np.eye(6), Rotation.from_rotvec(0.5 * theta).as_matrix(), np.eye(n - 9))
    kept = np.eye(n) - before @ H.T @ np.linalg.solve(S, H)
    M = A @ kept
    assert nis == pytest.approx(e @ np.linalg.solve(S, e))
    assert np.abs((made.P - M @ before @ A.T) / np.outer(scale, scale)).max() < 1e-11
    assert np.linalg.norm(theta) > 1e-4
    found, Found = undone(record(made), lam, Lam)
    close(found, M.T @ lam - H.T @ np.linalg.solve(S, e), scale)
    close(Found, M.T @ Lam @ M + H.T @ np.linalg.solve(S, H), scale)
    np.testing.assert_array_equal(Found, Found.T)


@pytest.mark.parametrize("y, gate", [((50.0, 60.0, 70.0), 1.0), ((np.nan, np.nan, np.nan), np.inf)])
def test_what_was_not_used_says_nothing(y, gate):
    made, (lam, Lam) = belief(16), later(16)
    compile_kernel(predict)
    predict(made, np.full(6, 0.01), 0.1, NOISE)  # its record must not be taken for that of the fix
    corrected(made, y, gate)
    found, Found = undone(record(made), lam, Lam)
    assert np.array_equal(found, lam) and np.array_equal(Found, Lam)


def test_rounding_does_not_make_the_information_unsymmetric():
    """A prediction leaves rounding; it grows neither by itself nor past the next correction."""
    made, (lam, Lam) = belief(15), later(15)
    compile_kernel(predict)
    predict(made, np.r_[0.02, -0.05, 0.08, 2.0, -1.5, -1.7], 0.1, NOISE)
    row = record(made)
    for _ in range(50):
        lam, Lam = undone(row, lam, Lam)
    scale = np.sqrt(np.diag(Lam))
    assert np.abs((Lam - Lam.T) / np.outer(scale, scale)).max() < 1e-13
    corrected(made, (1.0, 2.0, 3.0))
    _, Lam = undone(record(made), lam, Lam)
    np.testing.assert_array_equal(Lam, Lam.T)


def transition_at(made, u, dt):
    """Phi (n, n) of the next prediction of a belief, which is left as it is."""
    Phi = np.eye(len(made.P))
    for column in range(15):
        copy = type(made)(*(part.copy() for part in made))
        copy.workspace[X] = Phi[:15, column]
        predict(copy, u, dt, NOISE)
        Phi[:15, column] = copy.workspace[X]
    return Phi


@pytest.mark.parametrize("n", [15, 17])
def test_the_way_back_is_the_smoother_of_rauch_tung_and_striebel(n):
    """A filter of random samples and fixes, some of them rejected or with rows missing; backwards
    once by the adjoints, once by the textbook's gain C = P Phi' (Phi P Phi' + Q)^-1, which inverts
    the covariances that the adjoints do without."""
    rng, made, dt = np.random.default_rng(n), belief(n), 0.2
    compile_kernel(predict)
    made.workspace[X] = 0.0
    scale, calls = np.r_[STD, [2.0] * (n - 15)], []
    for number in range(12):
        u = np.r_[rng.normal(0, 0.3, 3), rng.normal(0, 10, 3)] * dt
        Phi, before = transition_at(made, u, dt), made.P.copy()
        predict(made, u, dt, NOISE)
        calls.append((record(made), "prediction", Phi, before, made.P.copy()))
        y = np.where(rng.random(3) < 0.2, np.nan, rng.standard_normal(3))
        before = made.P.copy()
        nis, _, _ = corrected(made, y, 0.0 if number == 5 else np.inf)
        used = not math.isnan(nis) and number != 5
        dx = made.workspace[DX][:n].copy() if used else np.zeros(n)
        half = Rotation.from_rotvec(0.5 * dx[6:9]).as_matrix()
        A = block_diag(np.eye(6), half, np.eye(n - 9))
        calls.append((record(made), "correction", A, before, dx))
    lam, Lam = np.zeros(n), np.zeros((n, n))
    smoothed, covariance_of_it = np.zeros(n), made.P.copy()  # from the filter's estimate
    for row, kind, M, before, other in reversed(calls):
        lam, Lam = undone(row, lam, Lam)
        if kind == "prediction":
            C = np.linalg.solve(other, M @ before).T
            smoothed = C @ smoothed
            covariance_of_it = before + C @ (covariance_of_it - other) @ C.T
        else:
            smoothed = other + np.linalg.solve(M, smoothed)
            covariance_of_it = np.linalg.solve(M, np.linalg.solve(M, covariance_of_it).T).T
        np.testing.assert_allclose(-before @ lam / scale, smoothed / scale, rtol=1e-6, atol=1e-6)
        found = before - before @ Lam @ before
        assert np.abs((found - covariance_of_it) / np.outer(scale, scale)).max() < 1e-6
