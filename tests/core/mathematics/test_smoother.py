"""The way back: adjoints against dense matrices, whole passes against the least squares of a
random linear model, composition against scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise, address, compile_kernel
from strapdown.core.loop.loop import BIASES, LLA, NAV_WIDTH, STD, Q, V
from strapdown.core.mathematics.rotation import turn_quaternion
from strapdown.core.mathematics.smoother import run_back, work_size
from strapdown.filters.attitude.attitude_error_state import (
    INVERSE,
    RECORD,
    SIX,
    adjoint_propagate_attitude,
    adjoint_scalar_update,
    propagate,
    scalar_update,
)
from strapdown.filters.attitude.attitude_mekf import (
    CALL,
    FIRST_RECORD,
    FIX,
    PREDICTED,
    SECOND_RECORD,
    STEP,
    adjoint_step,
)
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
NOISE = Noise(0.0, 0.0, 0.3, 0.0, 0.5, 0.0)
BLOCK = np.ix_(SIX, SIX)
WIDTH = CALL.size


def positive(rng, n):
    A = rng.standard_normal((n, n + 2))
    return A @ A.T / n


def whole(block):
    """The 15 x 15 covariance with the six states' block in it."""
    P = np.zeros((15, 15))
    P[BLOCK] = block
    return P


def transition(C, w0, w2, dt):
    turn = np.array([[1, w2, 0], [-w2, 1, w0], [0, -w0, 1]])  # I - [w x], w = (w0, 0, w2)
    return np.block(
        [[turn, -dt * C], [np.zeros((3, 3)), np.exp(-NOISE.gyro_decay * dt) * np.eye(3)]]
    )


def predicted(C, w0, w2, dt):
    """The record of a prediction without level rows."""
    call = np.zeros(WIDTH)
    call[0], call[1:10], call[10:13] = (
        PREDICTED,
        dt * C.ravel(),
        (w0, w2, np.exp(-NOISE.gyro_decay * dt)),
    )
    return call


@pytest.mark.parametrize("seed", range(5))
def test_adjoint_of_the_prediction_is_the_transposed_transition(seed):
    rng = np.random.default_rng(seed)
    C, (w0, w2), dt = (
        Rotation.random(random_state=seed).as_matrix(),
        rng.standard_normal(2) * 1e-4,
        rng.uniform(0.1, 1),
    )
    Phi, before, lam, Lam = (
        transition(C, w0, w2, dt),
        positive(rng, 6),
        rng.standard_normal(6),
        positive(rng, 6),
    )
    P = whole(before)
    propagate(P, C, w0, w2, 0.2, dt, NOISE)
    added = np.diag([0.2] * 3 + [NOISE.gyro_bias**2 * dt] * 3)
    # Phi is what the filter does, but for squares of 1e-4
    np.testing.assert_allclose(P[BLOCK], Phi @ before @ Phi.T + added, rtol=0, atol=1e-6)
    found, Found = lam.copy(), Lam.copy()
    adjoint_propagate_attitude(predicted(C, w0, w2, dt)[STEP], found, Found, np.zeros(72))
    np.testing.assert_allclose(found, Phi.T @ lam, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(Found, Phi.T @ Lam @ Phi, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_adjoint_of_the_correction(seed):
    rng = np.random.default_rng(seed)
    before, lam, Lam, h, variance = (
        positive(rng, 6),
        rng.standard_normal(6),
        positive(rng, 6),
        rng.standard_normal(3),
        0.3,
    )
    P, dx, record = whole(before), np.zeros(6), np.zeros(RECORD.size)
    nis = scalar_update(P, *h, 0.7, variance, np.inf, dx, record)
    H = np.r_[h, 0, 0, 0]
    S = H @ before @ H + variance
    K = before @ H / S
    back_of = np.eye(6) - np.outer(K, H)
    np.testing.assert_allclose(nis, 0.49 / S)
    np.testing.assert_allclose(P[BLOCK], back_of @ before, atol=1e-12)
    found, Found = lam.copy(), Lam.copy()
    adjoint_scalar_update(record, found, Found, np.zeros(72))
    np.testing.assert_allclose(found, back_of.T @ lam - H * 0.7 / S, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        Found, back_of.T @ Lam @ back_of + np.outer(H, H) / S, rtol=1e-12, atol=1e-12
    )


def test_calls_are_undone_last_step_first():
    """A prediction and its two level rows, whose errors are strongly correlated, so that their
    order shows."""
    rng = np.random.default_rng(4)
    compile_kernel(adjoint_step)
    before = positive(rng, 6) + 3 * np.ones((6, 6))
    C = Rotation.random(random_state=4).as_matrix()
    P, dx, call, lam, Lam, steps = (
        whole(before),
        np.zeros(6),
        predicted(C, 0.02, -0.03, 0.2),
        np.zeros(6),
        np.zeros((6, 6)),
        [],
    )
    for h, e, place in (
        ((1.0, 0.0, 0.0), 0.5, FIRST_RECORD),
        ((0.0, 1.0, 0.0), -0.8, SECOND_RECORD),
    ):
        H, held = np.r_[h, 0, 0, 0], P[BLOCK].copy()
        S = H @ held @ H + 0.3
        steps.append((H, e - H @ dx, S, np.eye(6) - np.outer(held @ H / S, H)))
        scalar_update(P, *h, e, 0.3, np.inf, dx, call[place])
    for H, e, S, M in steps[::-1]:
        lam, Lam = M.T @ lam - H * e / S, M.T @ Lam @ M + np.outer(H, H) / S
    Phi, found, Found = transition(C, 0.02, -0.03, 0.2), np.zeros(6), np.zeros((6, 6))
    adjoint_step(call, found, Found, np.zeros(72))
    np.testing.assert_allclose(found, Phi.T @ lam, atol=1e-12)
    np.testing.assert_allclose(Found, Phi.T @ Lam @ Phi, atol=1e-12)


def test_what_was_not_used_says_nothing():
    rng = np.random.default_rng(3)
    P, record, lam, Lam = (
        whole(positive(rng, 6)),
        np.full(RECORD.size, np.nan),
        rng.standard_normal(6),
        positive(rng, 6),
    )
    for e, gate in ((100.0, 10.0), (np.nan, np.inf)):
        scalar_update(P, 1.0, 0.0, 0.0, e, 0.1, gate, np.zeros(6), record)
        found, Found = lam.copy(), Lam.copy()
        adjoint_scalar_update(record, found, Found, np.zeros(72))
        assert record[INVERSE] == 0 and np.array_equal(found, lam) and np.array_equal(Found, Lam)


class Linear:
    """A random walk through `calls` predictions and corrections, run by the helpers of the
    filter; the estimate stays apart from the belief."""

    def __init__(self, seed, calls=60):
        rng = np.random.default_rng(seed)
        self.first = positive(rng, 6)
        P, x, dx = whole(self.first), np.zeros(6), np.zeros(6)
        self.record, self.steps, self.P, self.x, self.mark = [], [], [], [], []
        for number in range(calls):
            if number % 3 == 0:
                C, dt = Rotation.random(random_state=number).as_matrix(), rng.uniform(0.1, 0.4)
                propagate(P, C, 0.0, 0.0, 0.2, dt, NOISE)
                x = transition(C, 0.0, 0.0, dt) @ x
                self.record.append(predicted(C, 0.0, 0.0, dt))
                self.steps.append(
                    (
                        transition(C, 0.0, 0.0, dt),
                        np.diag([0.2] * 3 + [NOISE.gyro_bias**2 * dt] * 3),
                    )
                )
            else:
                h, y, call = rng.standard_normal(3), rng.standard_normal(), np.zeros(WIDTH)
                gate = 0.0 if number % 7 == 0 else np.inf
                call[0] = FIX
                scalar_update(P, *h, y - h @ x[:3], 0.4, gate, dx, call[FIRST_RECORD])
                x, dx[:] = x + dx, 0.0
                self.record.append(call)
                self.steps.append((h, y) if gate else None)
            if number % 5 == 4:
                self.mark.append(number + 1)
                self.P.append(P.copy())
                self.x.append(x)

    def least_squares(self):
        """(estimates, covariances) after the marked calls given all measurements: a weighted
        least squares over the states of all times at once."""
        count = 1 + sum(step is not None and np.ndim(step[0]) == 2 for step in self.steps)
        N, b, now, when = np.zeros((6 * count, 6 * count)), np.zeros(6 * count), 0, []
        N[:6, :6] = np.linalg.inv(self.first)
        for number, step in enumerate(self.steps):
            if step is not None and np.ndim(step[0]) == 2:
                now += 1
                J = np.zeros((6, 6 * count))
                J[:, 6 * now : 6 * now + 6], J[:, 6 * now - 6 : 6 * now] = np.eye(6), -step[0]
                N += J.T @ np.linalg.inv(step[1]) @ J
            elif step is not None:
                place = slice(6 * now, 6 * now + 3)
                N[place, place] += np.outer(step[0], step[0]) / 0.4
                b[place] += step[0] * step[1] / 0.4
            if number + 1 in self.mark:
                when.append(slice(6 * now, 6 * now + 6))
        P = np.linalg.inv(N)
        return [(P @ b)[w] for w in when], [P[w, w] for w in when]


def passed_back(model, pieces=1):
    """(errors, covariances) of the marked rows by run_back, in so many tapes one after the
    other."""
    compile_kernel(run_back)
    compile_kernel(adjoint_step)
    lam, Lam, work = np.zeros(6), np.zeros((6, 6)), np.zeros(work_size(6, 15))
    record, mark, nav = (
        np.array(model.record),
        np.array(model.mark),
        np.zeros((len(model.mark), NAV_WIDTH)),
    )
    P, smoothed = np.array(model.P), np.empty((len(mark), 15, 15))
    nav[:, Q] = 1.0
    edges = np.linspace(0, len(mark), pieces + 1).astype(int)
    for first, last in zip(edges[-2::-1], edges[:0:-1]):
        begin, end = (
            (mark[first - 1] if first else 0),
            (mark[last - 1] if last < len(mark) else len(record)),
        )
        run_back(
            address(adjoint_step),
            record[begin:end],
            mark[first:last] - begin,
            P[first:last],
            np.array(SIX),
            lam,
            Lam,
            work,
            nav[first:last],
            smoothed[first:last],
        )
    turned = Rotation.from_quat(nav[:, [Q + 1, Q + 2, Q + 3, Q]]).as_rotvec()
    return np.hstack([turned, nav[:, BIASES + 3 : STD]]), smoothed, nav


@pytest.mark.parametrize("seed", range(3))
def test_a_pass_is_the_least_squares_of_all_measurements(seed):
    model = Linear(seed)
    error, P, nav = passed_back(model)
    x, covariance = model.least_squares()
    rotation = lambda v: Rotation.from_rotvec(
        v
    ).as_rotvec()  # errors beyond half a turn come back from the other side
    expected = np.array(x) - np.array(model.x)
    np.testing.assert_allclose(error[:, 3:], expected[:, 3:], atol=1e-9)
    np.testing.assert_allclose(error[:, :3], [rotation(v) for v in expected[:, :3]], atol=1e-9)
    np.testing.assert_allclose(P[(slice(None), *BLOCK)], covariance, atol=1e-9)
    # the others stand at 0
    np.testing.assert_allclose(nav[:, STD : STD + 15] ** 2, np.einsum("ijj->ij", P), atol=1e-9)
    np.testing.assert_allclose(error[-1], 0.0, atol=1e-12)  # nothing comes after the last row


@pytest.mark.parametrize("pieces", (2, 5, 12))
def test_tapes_follow_each_other(pieces):
    whole, parts = (passed_back(Linear(1), n) for n in (1, pieces))
    for one, other in zip(whole, parts):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("tail", (0, 2))
def test_all_states_and_those_of_aidings_are_composed(tail):
    rng, n = np.random.default_rng(5), 15 + tail
    compile_kernel(run_back)
    compile_kernel(adjoint_step)
    before, lam, Lam = positive(rng, n), rng.standard_normal(n) * 0.1, positive(rng, n) * 0.01
    P, nav, found = (
        before[None].copy(),
        np.zeros((1, NAV_WIDTH + 1 + 2 * tail)),
        np.empty((1, n, n)),
    )
    lla, attitude = np.array([0.8, 3.1, 400.0]), Rotation.random(random_state=2)
    x, y, z, w = attitude.as_quat()
    nav[0, LLA:BIASES] = [*lla, 1.0, 2.0, 3.0, w, x, y, z]
    # a column of the filter, two states of sources, their standard deviations
    nav[0, NAV_WIDTH:] = [
        7.0,
        *[10.0, 20.0][:tail],
        *[0.0] * tail,
    ]
    run_back(
        address(adjoint_step),
        np.zeros((0, WIDTH)),
        np.zeros(1, np.int64),
        P,
        np.arange(n),
        lam,
        Lam,
        np.full(work_size(n, n), np.nan),
        nav,
        found,
    )
    error, smoothed = -before @ lam, before - before @ Lam @ before
    row = nav[0]
    np.testing.assert_allclose(displacement(row[LLA:V], lla), error[:3], atol=1e-6)
    np.testing.assert_allclose(row[V:Q], [1, 2, 3] + error[3:6])
    turned = Rotation.from_quat(row[[Q + 1, Q + 2, Q + 3, Q]]) * attitude.inv()
    np.testing.assert_allclose(turned.as_rotvec(), error[6:9], atol=1e-12)
    np.testing.assert_allclose(row[BIASES:STD], error[9:15])
    np.testing.assert_allclose(row[STD : STD + 15], np.sqrt(np.diag(smoothed)[:15]))
    np.testing.assert_allclose(
        row[NAV_WIDTH:], [7.0, *(error[15:] + [10, 20][:tail]), *np.sqrt(np.diag(smoothed)[15:])]
    )
    np.testing.assert_allclose(found[0], smoothed, atol=1e-12)
    np.testing.assert_array_equal(found[0], found[0].T)
    np.testing.assert_array_equal(P[0], before)


def test_quaternions_turn_as_rotations_do():
    rng = np.random.default_rng(6)
    for size in (0.0, 1e-9, 1e-3, 1.0, 3.1, 9.0):
        vector, attitude = rng.standard_normal(3), Rotation.random(random_state=int(10 * size))
        vector *= size / np.linalg.norm(vector)
        q = attitude.as_quat()[[3, 0, 1, 2]]
        turn_quaternion(*vector, q)
        assert q[0] >= 0 and abs(q @ q - 1) < 1e-14
        np.testing.assert_allclose(
            (
                Rotation.from_quat(q[[1, 2, 3, 0]])
                * (Rotation.from_rotvec(vector) * attitude).inv()
            ).magnitude(),
            0.0,
            atol=1e-14,
        )
