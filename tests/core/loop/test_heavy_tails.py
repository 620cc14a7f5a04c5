"""The factor on the noise of a robust source against the mean of the whole mixture, by integration
and in three rows; the noise of an adaptive source, followed to what it is."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from strapdown.core.compile.records import rows
from strapdown.core.loop.cursor import Books
from strapdown.core.loop.stages.adaptive import MAX_FACTOR, apply_factors, follow
from strapdown.core.loop.stages.robust import OUTLIERS, SCALES, STEP, variance_factor
from strapdown.core.mathematics.innovation_moments import moments

SHARES = np.r_[1 - OUTLIERS, OUTLIERS * 0.5 ** np.r_[1:SCALES, SCALES - 1]]
FACTORS = STEP ** np.arange(SCALES + 1.0)


def told(e, S):
    """The 12 numbers that a filter leaves of a fix."""
    found, measured = np.full(12, np.nan), np.flatnonzero(np.isfinite(e))
    L = np.full((3, 3), np.nan)
    root = np.linalg.cholesky(S[np.ix_(measured, measured)])
    L[measured] = 0.0
    L[np.ix_(measured, measured)] = root
    found[:3], found[3 + measured] = e, np.linalg.solve(root, e[measured])
    found[6:] = L[np.tril_indices(3)]
    return found


def factor_of(e, H_P_H, R):
    """What the loop does with an innovation: (factor, S, R as six numbers each)."""
    S, noise = np.empty(6), np.empty(6)
    assert moments(told(e, H_P_H + R), told(e, H_P_H + 4 * R), S, noise)
    return variance_factor(S, noise, told(e, H_P_H + R)), S, noise


def alone(value):
    """As the first of three rows, of which the others are not measured."""
    return np.diag([value, 1.0, 1.0])


def test_shares_are_a_distribution():
    assert SHARES.sum() == pytest.approx(1) and len(SHARES) == len(FACTORS)


@pytest.mark.parametrize("prior", [0.3, 4.0])
@pytest.mark.parametrize("e", [0.5, 2.5, 5.0, 20.0, 300.0])
def test_correction_is_the_mean_of_the_posterior_by_integration(e, prior):
    deviation = np.sqrt(FACTORS)
    likely = lambda x: norm.pdf(x, 0, prior**0.5) * (SHARES * norm.pdf(e - x, 0, deviation)).sum()
    ends = dict(limit=400, points=[0.0, e]) if e < 15 else dict(limit=400, points=[0.0])
    span = 14 * prior**0.5
    total = quad(likely, -span, span, epsabs=0, epsrel=1e-9, **ends)[0]
    mean = quad(lambda x: x * likely(x), -span, span, epsabs=0, epsrel=1e-9, **ends)[0] / total
    factor, *_ = factor_of(np.array([e, np.nan, np.nan]), alone(prior), alone(1.0))
    assert prior / (prior + factor) * e == pytest.approx(mean, rel=1e-6)


def test_influence_goes_back_to_nothing():
    corrections = [
        e / (1 + factor_of(np.array([e, np.nan, np.nan]), alone(1.0), alone(1.0))[0])
        for e in (1.0, 3.0, 10.0, 100.0, 1000.0)
    ]
    assert corrections[0] > 0.45 and max(corrections) < 1.5
    assert corrections[2] < 0.25 and corrections[4] < corrections[3] < 0.03


def test_three_rows_with_one_missing():
    rng = np.random.default_rng(1)
    A, R = rng.normal(size=(3, 3)), np.diag([1.0, 4.0, 0.25])
    e = np.array([4.0, np.nan, -2.0])
    factor, *_ = factor_of(e, A @ A.T, R)
    two = np.ix_([0, 2], [0, 2])
    S = [(A @ A.T + f * R)[two] for f in FACTORS]
    nis = np.array([e[[0, 2]] @ np.linalg.solve(each, e[[0, 2]]) for each in S])
    p = SHARES * np.exp(-0.5 * nis) / np.sqrt([np.linalg.det(each) for each in S])
    found = e[[0, 2]] @ np.linalg.solve((A @ A.T + factor * R)[two], e[[0, 2]])
    assert found == pytest.approx(p @ nis / p.sum(), rel=1e-6)


def books():
    """Of an adaptive source, at 0 s."""
    (of_source,) = rows(Books, 1)
    of_source.factor[:] = of_source.power = 1.0
    return of_source


def watched(true_std, memory, interval, walk=0.3, tests=None, fixes=1000, first=0, seed=2):
    """Variances that a scalar filter of a random walk follows, of fixes whose std is stated as 1 and
    of rows 2 and 3 of which nothing is measured."""
    rng, tests = np.random.default_rng(seed), books() if tests is None else tests
    x, estimate, P, found = 0.0, 0.0, 1.0, []
    factor = np.ones(3)
    for k in range(first, first + fixes):
        x, P = x + walk * rng.normal(), P + walk**2
        std = np.ones(3)
        apply_factors(std, tests, factor)
        R = std[0] ** 2
        e = np.array([x + true_std(k * interval) * rng.normal() - estimate, np.nan, np.nan])
        S, noise = np.empty(6), np.empty(6)
        assert moments(told(e, alone(P + R)), told(e, alone(P + 4 * R)), S, noise)
        follow(tests, memory, k * interval, told(e, alone(P + R)), S, noise, 1.0)
        K = P / (P + R)
        estimate, P = estimate + K * e[0], (1 - K) * P
        found.append(tests.factor[0])
    return np.array(found)


@pytest.mark.parametrize("true", [1 / 3, 1.0, 3.0])
def test_the_factor_becomes_that_of_the_true_noise(true):
    found = watched(lambda t: true, 60.0, 1.0, walk=0.3 * true, fixes=3000)
    # 60 fixes that count: 2 / 60 of the square
    assert np.sqrt(found[1000:].mean()) == pytest.approx(true, rel=0.08)
    assert found[1000:].std() / found[1000:].mean() < 0.45


def test_a_change_is_learned_within_about_the_memory():
    changed = lambda t: 1.0 if t < 300.0 else 2.0
    runs = np.mean([watched(changed, 30.0, 0.4, fixes=1600, seed=s) for s in range(8)], axis=0)
    share = (runs - 1) / (4 - 1)
    assert abs(share[:750].mean()) < 0.07  # before
    assert 0.3 < share[750 + 75] < 0.9  # one memory after
    assert share[-300:].mean() == pytest.approx(1, abs=0.12)


def test_ten_fixes_decide_at_least_and_nothing_leaves_its_bounds():
    tests = books()
    watched(lambda t: 1.0, 1.0, 100.0, tests=tests, fixes=1, first=1)
    assert abs(tests.factor[0] - 1) < 1.0
    assert watched(lambda t: 1e4, 2.0, 1.0, fixes=400).max() <= MAX_FACTOR


def test_lasting_errors_are_not_believed():
    tests = books()
    tests.factor[:], tests.alike = [0.1, 4.0, 1.0], 0.5
    std, factor = np.full(3, 2.0), np.empty(3)
    apply_factors(std, tests, factor)
    np.testing.assert_allclose(std, [2.0, 4.0, 2.0])
    tests.alike = 0.1
    apply_factors(np.full(3, 2.0), tests, factor)
    np.testing.assert_allclose(factor, [np.sqrt(0.1), 2.0, 1.0])
