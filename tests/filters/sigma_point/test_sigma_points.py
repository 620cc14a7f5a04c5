"""Sigma points in square-root form: against the Kalman filter, filterpy and the textbook sums;
repairs, and what needs none."""

import math
from functools import partial

import numpy as np
import pytest
from filterpy.kalman import CubatureKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from filterpy.kalman.CubatureKalmanFilter import spherical_radial_sigmas
from plain_sigma_points import SigmaPointFilter, points, weights

pytestmark = pytest.mark.short
SETS = {
    "merwe": points.merwe,
    "symmetric": points.symmetric,
    "wide": partial(points.merwe, alpha=1.0, beta=0.0, kappa=1.0),
}


def root(P):
    """Rows A with A'A = P."""
    return np.linalg.cholesky(P).T


def positive(rng, n):
    B = rng.standard_normal((n, 2 * n))
    return B @ B.T / n


def rows_of(A, n, lanes):
    return A.reshape(-1, lanes)[:n, :n]


# ---- the pieces against dense algebra


@pytest.mark.parametrize(
    "rows, n, lanes", [(5, 5, 8), (7, 6, 8), (23, 5, 8), (40, 15, 16), (30, 17, 24), (1, 1, 8)]
)
def test_triangle_keeps_the_product_of_the_rows(rows, n, lanes):
    A = np.zeros((rows + 1, lanes))
    A[:rows, :n] = np.random.default_rng(1).standard_normal((rows, n)) * 10.0 ** np.arange(
        0, -n, -1
    )
    if n > 2:
        A[:, 1] = 0.0  # nothing in a column
        A[:, 2] = 3 * A[:, 0]  # the same as another
    before, A = A[:rows, :n].T @ A[:rows, :n], A.ravel()
    points.triangle(A, rows, n, lanes)
    R = rows_of(A, n, lanes)
    assert (
        np.array_equal(R, np.triu(R))
        and (np.diag(R) >= 0).all()
        and not A.reshape(-1, lanes)[:n, n:].any()
    )
    scale = np.sqrt(np.outer(np.diag(before), np.diag(before))) + 1e-30
    assert np.abs((R.T @ R - before) / scale).max() < 1e-14


def test_factor_gives_the_cholesky_rows_and_covariance_undoes_it():
    P, A, back = positive(np.random.default_rng(2), 6), np.full(56, np.nan), np.zeros((6, 6))
    assert points.factor(P, 6, 8, A) == 0
    assert (
        np.allclose(rows_of(A, 6, 8), root(P), rtol=1e-12, atol=1e-12)
        and not A.reshape(7, 8)[:6, 6:].any()
    )
    points.covariance(A, 6, 8, back)
    assert np.abs(back - P).max() < 1e-14 * np.abs(P).max() and np.array_equal(back, back.T)


def test_factor_raises_what_is_no_covariance_and_counts_it():
    back, A = np.zeros((3, 3)), np.zeros(32)
    known = np.diag([4.0, 0.0, 9.0])  # a state known exactly needs no repair
    assert points.factor(known, 3, 8, A) == 0
    points.covariance(A, 3, 8, back)
    assert np.array_equal(back, known)
    wrong = np.array([[1.0, 2, 0], [2, 1, 0], [0, 0, 1]])  # a correlation of 2
    assert points.factor(wrong, 3, 8, A) == 1
    points.covariance(A, 3, 8, back)
    assert np.linalg.eigvalsh(back).min() > 0 and np.allclose(
        back, [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    )
    for seed in range(20):  # variances stay, however far from a covariance it is
        rng = np.random.default_rng(seed)
        wrong, A, back = (
            positive(rng, 6) + 0.5 * np.outer(*np.sign(rng.standard_normal((2, 6)))),
            np.zeros(56),
            np.zeros((6, 6)),
        )
        wrong = 0.5 * (wrong + wrong.T) + np.eye(6) * (0.6 - np.diag(wrong).min())
        repaired = points.factor(wrong, 6, 8, A)
        points.covariance(A, 6, 8, back)
        assert (
            (repaired > 0) == (np.linalg.eigvalsh(wrong).min() < 0)
            and np.allclose(np.diag(back), np.diag(wrong))
            and np.isfinite(back).all()
        )
        assert repaired or np.allclose(back, wrong)


def test_downdate_against_dense_algebra_and_repaired_where_it_fails():
    rng = np.random.default_rng(3)
    P, A, back, work = positive(rng, 5), np.zeros(48), np.zeros((5, 5)), np.full(10, np.nan)
    x = root(P).T @ (0.9 * np.array([0.5, -0.5, 0.5, 0.1, 0.4]))
    points.factor(P, 5, 8, A)
    assert points.downdate(A, x, 5, 8, work) == 0
    points.covariance(A, 5, 8, back)
    assert np.abs(back - P + np.outer(x, x)).max() < 1e-14 * np.abs(P).max()
    points.factor(P, 5, 8, A)
    assert points.downdate(A, 3 * x, 5, 8, work) == 1
    points.covariance(A, 5, 8, back)
    assert np.linalg.eigvalsh(P - 9 * np.outer(x, x)).min() < 0 < np.linalg.eigvalsh(back).min()
    # the same direction
    assert np.allclose(
        back,
        P - (1 - points.DOWNDATE_FLOOR) / (x @ np.linalg.solve(P, x)) * np.outer(x, x),
        atol=1e-12,
    )
    A[:] = 0.0
    assert points.downdate(A, x, 5, 8, work) == 1 and not A.any()


def test_sets_without_points_are_refused():
    for wrong in (dict(alpha=0.0), dict(kappa=-5.0), dict(alpha=math.nan), dict(beta=math.inf)):
        with pytest.raises(ValueError, match="alpha must be above 0 and kappa above -5"):
            points.merwe(5, **wrong)


# ---- moments against the textbook sums, and the -96


def curved(x):
    return np.array([x[0] * x[1], math.sin(x[2]), x[3] + x[0] ** 2, x[4], math.exp(0.1 * x[1])])


@pytest.mark.parametrize(
    "alpha, beta, kappa", [(0.1, 2.0, 0.0), (1.0, 0.0, 0.0), (0.7, 0.0, -1.0), (1.0, 2.0, 3.0)]
)
def test_moments_are_those_of_the_textbook_weights(alpha, beta, kappa):
    rng = np.random.default_rng(4)
    P, x, R = positive(rng, 5), rng.standard_normal(5), np.array([0.1, 0.2])
    own = SigmaPointFilter(
        x,
        P,
        partial(points.merwe, alpha=alpha, beta=beta, kappa=kappa),
        lambda x, w: curved(x),
        lambda x: curved(x)[:2],
        R,
    )
    centre, centre_cov, outer = weights(5, alpha, beta, kappa)
    spread = math.sqrt(0.5 / outer)
    at = np.r_[[x], x + spread * root(P), x - spread * root(P)]
    mean_weights, cov_weights = np.r_[centre, [outer] * 10], np.r_[centre_cov, [outer] * 10]
    there = np.array([curved(each) for each in at])
    mean = mean_weights @ there
    away = there - mean
    expected = (cov_weights[:, None] * away).T @ away
    own.predict()
    assert (
        np.abs(own.x - mean).max() < 1e-12
        and np.abs(own.P - expected).max() < 1e-11
        and own.repairs == 0
    )
    y, z, d = np.array([0.3, 0.2]), mean[:2], there[:, :2] - mean[:2]
    S, across = (
        (cov_weights[:, None] * d).T @ d + np.diag(R),
        (cov_weights[:, None] * (at - x)).T @ d,
    )
    K = across @ np.linalg.inv(S)
    own = SigmaPointFilter(
        x,
        P,
        partial(points.merwe, alpha=alpha, beta=beta, kappa=kappa),
        None,
        lambda x: curved(x)[:2],
        R,
    )
    nis = own.update(y)
    assert nis == pytest.approx((y - z) @ np.linalg.solve(S, y - z), abs=1e-12) and np.allclose(
        own.innovation, y - z, atol=1e-12
    )
    assert (
        np.abs(own.x - x - K @ (y - z)).max() < 1e-12
        and np.abs(own.P - P + K @ S @ K.T).max() < 1e-12
        and own.repairs == 0
    )


def test_the_weight_of_the_default_set_is_that_of_the_textbook():
    for n in (1, 6, 15, 27):
        assert weights(n)[0] == pytest.approx(-99) and weights(n)[1] == pytest.approx(-96.01)
        assert 1 - n / points.merwe(n, 0.1, 2.0, 0.0)[0] ** 2 == pytest.approx(-99)


def test_no_default_set_needs_a_downdate():
    """beta + alpha^2 kappa / n >= 0 is enough for the rest to be taken on, not off; the formula
    itself is tested above."""
    for n in (1, 6, 18, 27):
        assert points.merwe(n)[1] > 0 and points.merwe(n, 1.0, 0.0, 3.0 - n)[1] * (3 - n) >= 0
        assert points.symmetric(n) == pytest.approx(points.merwe(n, 1.0, 0.0, 0.0), abs=1e-12)


def test_the_downdate_of_the_textbook_leaves_two_per_cent_with_the_default_and_nothing_with_beta_0():
    """Outer points with the plain mean z have outer weights times (z - m)^2 about the weighted
    mean m, the centre its own times m^2."""
    for n in (1, 6, 15, 27):
        left = []
        for beta in (2.0, 0.0):
            centre, centre_cov, outer = weights(n, beta=beta)
            z, total = 1.0, 2 * n * outer
            m = total * z
            left.append(1 + centre_cov * m**2 / (total * (z - m) ** 2))
        assert left == pytest.approx([1 / 49, 0.0], abs=5e-4)


def test_the_downdate_of_the_textbook_fails_where_this_form_does_not():
    """x^2 + 1e-7 x of N(0, 1) with beta = 0: of two numbers near 100 there should be left 1e-14."""
    f = lambda x, w: x * x + 1e-7 * x
    own = SigmaPointFilter([0.0], [[1.0]], partial(points.merwe, beta=0.0), f, None, 1.0)
    own.predict()
    assert own.P[0, 0] == pytest.approx(1e-14, rel=1e-6) and own.repairs == 0
    centre, centre_cov, outer = weights(1, beta=0.0)
    at = np.array([0.0, 0.1, -0.1])
    away = f(at, 0) - np.array([centre, outer, outer]) @ f(at, 0)
    A = np.zeros((3, 8))
    A[:2, 0] = math.sqrt(outer) * away[1:]
    A = A.ravel()
    points.triangle(A, 2, 1, 8)
    assert points.downdate(A, math.sqrt(-centre_cov) * away[:1], 1, 8, np.zeros(3)) == 1


def test_a_set_whose_covariance_is_none_is_repaired_and_counted():
    """kappa = 3 - n with beta = 0, as once recommended: the squares of n states have a negative
    variance."""
    made = lambda n: points.merwe(n, 1.0, 0.0, 3.0 - n)
    own = SigmaPointFilter(
        np.zeros(5),
        np.eye(5),
        made,
        lambda x, w: np.r_[x @ x, x[1:]],
        lambda x: np.array([x @ x]),
        [0.1],
    )
    assert made(5)[1] < 0
    own.update(np.array([5.0]))
    assert own.repairs == 1 and np.linalg.eigvalsh(own.P).min() > 0
    own.predict()
    assert own.repairs == 2 and np.isfinite(own.x).all() and np.linalg.eigvalsh(own.P).min() > 0


# ---- filters: the Kalman filter on linear systems, filterpy on nonlinear ones


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("augmented", [True, False])
def test_on_a_linear_system_it_is_the_kalman_filter(name, augmented):
    rng = np.random.default_rng(5)
    F, G, H = (
        np.eye(5) + 0.1 * rng.standard_normal((5, 5)),
        rng.standard_normal((5, 2)),
        rng.standard_normal((3, 5)),
    )
    Q, R, x, P = (
        positive(rng, 2),
        np.array([0.5, 1e-6, 2.0]),
        rng.standard_normal(5),
        positive(rng, 5),
    )
    noise = dict(noises=root(Q)) if augmented else dict(added=root(Q) @ G.T)
    own = SigmaPointFilter(
        x,
        P,
        SETS[name],
        lambda x, w: F @ x + (G @ w if augmented else 0),
        lambda x: H @ x,
        R,
        **noise,
    )
    for k in range(50):
        own.predict()
        x, P = F @ x, F @ P @ F.T + G @ Q @ G.T
        y = H @ x + rng.standard_normal(3)
        there = np.ones(3, bool)
        if k % 3 == 1:
            there[k % 2] = False
            y[~there] = np.nan
        nis = own.update(y)
        S = H[there] @ P @ H[there].T + np.diag(R[there])
        K = P @ H[there].T @ np.linalg.inv(S)
        e = (y - H @ x)[there]
        x, P = x + K @ e, P - K @ S @ K.T
        assert nis == pytest.approx(e @ np.linalg.solve(S, e), rel=1e-9) and np.array_equal(
            np.isnan(own.innovation), ~there
        )
        assert (
            np.abs(own.x - x).max() < 1e-9 * max(1, np.abs(x).max())
            and np.abs(own.P - P).max() < 1e-9 * np.abs(P).max()
        )
    assert own.repairs == 0


def test_what_the_gate_rejects_and_what_is_not_measured_changes_nothing():
    own = SigmaPointFilter([1.0, 2.0], np.eye(2), points.merwe, None, lambda x: x, [1.0, 1.0])
    x, A = own.x, own.A[: own.n * own.lanes].copy()
    assert own.update(np.array([9.0, 9.0]), gate=3.0) > 3 and math.isnan(
        own.update(np.full(2, np.nan))
    )
    assert np.array_equal(own.x, x) and np.array_equal(own.A[: len(A)], A)


def growth():
    """The univariate nonstationary growth model: (f, h, Q, R, x, P, truth); Gordon, Salmond &
    Smith (1993)."""
    return (
        lambda x, k: 0.5 * x + 25 * x / (1 + x * x) + 8 * np.cos(1.2 * k),
        lambda x: x * x / 20,
        np.array([[10.0]]),
        np.array([1.0]),
        [0.1],
        [[5.0]],
    )


def turning():
    """A coordinated turn, ranges and bearings: position and velocity (m, m/s) in the plane, rate
    of turn (rad/s); Arasaratnam & Haykin (2009) VIII-A."""

    def f(x, k):
        w, sine, cosine = x[4], math.sin(x[4]), math.cos(x[4])
        a, b = sine / w, (1 - cosine) / w
        return np.array(
            [
                x[0] + a * x[1] - b * x[3],
                cosine * x[1] - sine * x[3],
                x[2] + b * x[1] + a * x[3],
                sine * x[1] + cosine * x[3],
                w,
            ]
        )

    half = np.array([[1 / 3, 1 / 2], [1 / 2, 1]]) * 0.1
    Q = np.zeros((5, 5))
    Q[:2, :2], Q[2:4, 2:4], Q[4, 4] = half, half, 1.75e-4
    return (
        f,
        lambda x: np.array([math.hypot(x[0], x[2]), math.atan2(x[2], x[0])]),
        Q,
        np.array([100.0, 1e-5]),
        [1000.0, 300, 1000, 0, -math.radians(3)],
        np.diag([100.0, 10, 100, 10, 1e-4]),
    )


@pytest.mark.parametrize("model", [growth, turning])
@pytest.mark.parametrize("name", ["ukf", "ckf"])
def test_on_nonlinear_benchmarks_it_is_filterpy_step_by_step(model, name):
    f, h, Q, R, x, P = model()
    n, rng = len(x), np.random.default_rng(6)
    if name == "ukf":
        peer = UnscentedKalmanFilter(
            n, len(R), 1.0, h, None, MerweScaledSigmaPoints(n, 0.1, 2.0, 0.0)
        )
    else:
        peer = CubatureKalmanFilter(n, len(R), 1.0, h, None)
    own = SigmaPointFilter(
        x,
        P,
        points.merwe if name == "ukf" else points.symmetric,
        lambda x, w, k: f(x, k),
        h,
        R,
        added=root(Q),
    )
    peer.x, peer.P, peer.Q, peer.R = np.array(x), np.array(P), Q, np.diag(R)
    truth = np.array(x)
    for k in range(40):
        truth = f(truth, k) + rng.multivariate_normal(np.zeros(n), Q)
        peer.fx = peer._fx = lambda x, dt=1.0: f(x, k)
        own.predict(k)
        peer.predict(fx=peer.fx) if name == "ukf" else peer.predict()
        if name == "ckf":
            # points of the prediction with its noise, as the rule has them
            peer.sigmas_f = spherical_radial_sigmas(peer.x, peer.P)
        y = h(truth) + rng.standard_normal(len(R)) * np.sqrt(R)
        own.update(y)
        peer.update(y if name == "ukf" else y[:, None])
        std = np.sqrt(np.diag(peer.P))
        assert (
            np.abs((own.x - peer.x.ravel()) / std).max() < 1e-8
            and np.abs((own.P - peer.P) / np.outer(std, std)).max() < 1e-8
        )
        # each step from the same belief: on the growth model differences multiply
        own.x, own.A[:] = (
            peer.x.ravel().copy(),
            0.0,
        )
        points.factor(peer.P, n, own.lanes, own.A)
    assert own.repairs == 0
