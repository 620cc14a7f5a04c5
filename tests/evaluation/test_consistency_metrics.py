"""NEES, bands, survival, intervals, coverage and whiteness: against simulation, scipy and values
worked by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import Innovations
from strapdown.evaluation import consistency
from strapdown.evaluation.consistency import (
    INCONSISTENT,
    POSITION_LOST,
    REASONS,
    SURVIVED,
    LossLimits,
)
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion

SCALES = np.r_[[1e3] * 3, [1.0] * 3, [1e-3] * 3, [1e-5] * 3, [1e-8] * 3]


def covariances(rng, count=1):
    """`count` random correlated covariances of 15 states with the scales of a filter."""
    A = rng.standard_normal((count, 15, 15))
    return (A @ A.transpose(0, 2, 1) / 15 + 0.1 * np.eye(15)) * SCALES[:, None] * SCALES


@pytest.mark.short
def test_nees_is_the_quadratic_form_whatever_the_scales():
    rng = np.random.default_rng(1)
    P, e = covariances(rng, 50), rng.standard_normal((50, 15)) * SCALES
    unscaled = [
        np.linalg.solve(p / SCALES[:, None] / SCALES, x / SCALES) @ (x / SCALES)
        for p, x in zip(P, e)
    ]
    np.testing.assert_allclose(consistency.nees(e, P), unscaled, rtol=1e-9)
    assert consistency.nees(e[0], P[0]) == pytest.approx(unscaled[0])
    np.testing.assert_allclose(
        consistency.nees(e.reshape(5, 10, 15), P.reshape(5, 10, 15, 15)).ravel(),
        unscaled,
        rtol=1e-9,
    )
    assert consistency.nees([3.0, 4.0], np.diag([9.0, 4.0])) == pytest.approx(5.0)


@pytest.mark.short
def test_nees_of_errors_drawn_from_P_is_chi_square():
    rng = np.random.default_rng(2)
    P = covariances(rng)[0]
    e = (
        rng.standard_normal((2000, 15))
        @ np.linalg.cholesky(P / SCALES[:, None] / SCALES).T
        * SCALES
    )
    assert stats.kstest(consistency.nees(e, P), "chi2", args=(15,)).pvalue > 1e-3
    assert stats.kstest(consistency.nees(1.2 * e, P), "chi2", args=(15,)).pvalue < 1e-6


@pytest.mark.short
def test_nees_is_nan_without_warning_where_P_is_no_covariance():
    P = np.tile(np.eye(2), (7, 1, 1))
    P[1, 0, 0], P[2, 1, 1], P[3, 0, 1], P[4, 0, 0], P[5] = (
        np.nan,
        -1.0,
        np.inf,
        0.0,
        [[1.0, 1.0], [1.0, 1.0]],
    )
    P[6, 0, 1] = P[6, 1, 0] = 1.5
    value = consistency.nees(np.ones((7, 2)), P)
    assert value[0] == 2 and np.isnan(value[1:]).all()
    assert np.isnan(consistency.nees([1.0, np.nan], np.eye(2)))
    # rank 14; what is left of the last pivot is rounding, of either sign
    thin = np.random.default_rng(12).standard_normal((20, 15, 14))
    assert np.isnan(consistency.nees(np.ones(15), thin @ thin.transpose(0, 2, 1))).mean() > 0.8


@pytest.mark.short
def test_band_holds_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(3)
    means = rng.chisquare(15, (4000, 20)).mean(axis=1)
    for probability in (0.5, 0.95):
        low, high = consistency.band(15, 20, probability)
        for share, expected in (
            ((means < low).mean(), 0.5 - probability / 2),
            ((means > high).mean(), 0.5 - probability / 2),
        ):
            assert share == pytest.approx(expected, abs=4 * np.sqrt(expected / len(means)))
    low, high = consistency.band(3)
    assert (low, high) == pytest.approx((0.2158, 9.3484), abs=1e-4)  # of the tables


@pytest.mark.short
def test_bound_is_one_sided():
    assert consistency.chi_square_bound(1, 0.05) == pytest.approx(3.8415, abs=1e-4)
    assert stats.chi2.cdf(consistency.chi_square_bound(15, 1e-6), 15) == pytest.approx(
        1 - 1e-6, abs=1e-12
    )


T = 0.5 * np.arange(100)
FINE = np.full(100, 15.0)


@pytest.mark.short
def test_a_run_that_keeps_its_limits_survives():
    high = np.where(T % 10 < 9.5, 1e9, 15.0)  # beyond the bound, but never for more than 10 s
    assert consistency.survival(np.full(100, 499.0), FINE, T) == (100, SURVIVED)
    assert consistency.survival(np.zeros(100), high, T) == (100, SURVIVED)
    assert consistency.survival([], [], []) == (0, SURVIVED)


@pytest.mark.short
@pytest.mark.parametrize("far", [501.0, np.nan, np.inf])
def test_a_run_is_lost_at_its_first_far_epoch(far):
    distance = np.zeros(100)
    distance[[40, 60]] = far
    assert consistency.survival(distance, FINE, T) == (40, POSITION_LOST)
    assert REASONS[POSITION_LOST] == "lost"


@pytest.mark.short
@pytest.mark.parametrize("value", [100.0, np.nan, np.inf])
def test_a_run_is_inconsistent_once_its_nees_was_beyond_for_more_than_ten_seconds(value):
    nees = FINE.copy()
    nees[10:] = value  # from 5 s: 15 s is exactly ten seconds on, 15.5 s is more
    assert consistency.survival(np.zeros(100), nees, T) == (31, INCONSISTENT)
    # 3.0000000000000004 - 1.0
    assert consistency.survival(
        np.zeros(100), nees, 0.1 * np.arange(100), LossLimits(seconds=2.0)
    ) == (
        31,
        INCONSISTENT,
    )
    nees[20] = 15.0
    assert consistency.survival(np.zeros(100), nees, T) == (42, INCONSISTENT)
    assert consistency.survival(np.zeros(100), nees, T, LossLimits(seconds=60.0)) == (100, SURVIVED)
    assert REASONS[INCONSISTENT] == "inconsistent"


@pytest.mark.short
def test_whichever_limit_is_broken_first_ends_a_run():
    nees, distance = np.full(100, 1e3), np.zeros(100)
    distance[21:] = 600.0  # NEES: more than 10 s at epoch 21 too
    assert consistency.survival(distance, nees, T) == (21, POSITION_LOST)
    assert consistency.survival(np.roll(distance, 1) * (T > 0), nees, T) == (21, INCONSISTENT)


@pytest.mark.short
def test_the_nees_bound_is_that_of_the_alarm():
    limit = stats.chi2.isf(1e-6, 15)
    assert consistency.survival(np.zeros(100), FINE * 0 + 0.999 * limit, T)[1] == SURVIVED
    assert consistency.survival(np.zeros(100), FINE * 0 + 1.001 * limit, T)[1] == INCONSISTENT
    assert (
        consistency.survival(np.zeros(100), FINE * 0 + 1.001 * limit, T, LossLimits(alarm=1e-9))[1]
        == SURVIVED
    )


@pytest.mark.short
def test_rmse_is_the_root_of_scipys_interval_of_the_mean_square():
    squares = np.random.default_rng(4).chisquare(6, 40)
    found = consistency.rmse(np.r_[squares, np.nan], 0.9)
    low, high = stats.t.interval(0.9, 39, squares.mean(), stats.sem(squares))
    assert found == pytest.approx(np.sqrt([squares.mean(), low, high]))
    wide = consistency.rmse([0.0, 100.0])
    assert wide.low == 0.0 and wide.value == pytest.approx(np.sqrt(50))
    assert consistency.rmse([4.0]).value == 2 and np.isnan(consistency.rmse([4.0])[1:]).all()
    assert np.isnan(consistency.rmse([])).all() and np.isnan(consistency.rmse([np.nan])).all()


@pytest.mark.short
@pytest.mark.parametrize(
    "successes, count, probability", [(0, 50, 0.95), (47, 50, 0.95), (50, 50, 0.9), (1, 2, 0.99)]
)
def test_proportion_is_scipys_wilson_interval(successes, count, probability):
    expected = stats.binomtest(successes, count).proportion_ci(probability, "wilson")
    found = consistency.proportion(successes, count, probability)
    assert found == pytest.approx((successes / count, expected.low, expected.high), abs=1e-12)
    assert (found.low == 0) == (successes == 0) and (found.high == 1) == (successes == count)


@pytest.mark.short
def test_proportion_without_trials_and_with_too_many_successes():
    none = consistency.proportion(0, 0)
    assert np.isnan(none.value) and none[1:] == (0, 1)
    with pytest.raises(DataError, match="3 successes of 2"):
        consistency.proportion(3, 2)


@pytest.mark.short
def test_paired_is_the_t_interval_of_the_differences():
    rng = np.random.default_rng(5)
    common = 10 * rng.standard_normal(30)
    a, b = common + 0.2 * rng.standard_normal(30), common + 0.3
    a[3], b[7] = np.nan, np.inf
    both = np.isfinite(a + b)
    found = consistency.paired_comparison(a, b)
    expected = stats.ttest_rel(a[both], b[both]).confidence_interval()
    assert found[:3] == pytest.approx(((a - b)[both].mean(), expected.low, expected.high))
    assert found.count == 28 and found.wins == (a < b)[both].sum()
    assert found.high < 0  # the runs differ by 10, the filters by 0.3: seen only pair by pair
    assert consistency.paired_comparison([1.0], [2.0])[3:] == (1, 1) and np.isnan(
        consistency.paired_comparison([1.0], [2.0]).low
    )


@pytest.mark.short
def test_coverage_of_gaussian_errors():
    rng = np.random.default_rng(6)
    deviations = np.array([1e3, 1e-8, 2.0])
    error = rng.standard_normal((50, 400, 3)) * deviations
    error[:, :100, 2] = np.nan
    share = consistency.coverage(error, deviations)
    for row, expected in zip(share, (0.6827, 0.9545, 0.9973)):
        assert row == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 15000))
    assert consistency.coverage(error, 0.5 * deviations)[0] == pytest.approx(0.383, abs=0.02)
    np.testing.assert_array_equal(
        consistency.coverage([[1.0, np.nan], [-3.0, np.nan]], np.ones((2, 2)), (1, 3)),
        [[0.5, np.nan], [1.0, np.nan]],
    )


@pytest.mark.short
def test_ljung_box_by_hand():
    """z = (1, 2, -1, 1): power 7, lagged products 2 - 2 - 1 = -1 and -1 + 2 = 1; Q = 4 * 6
    ((1/49)/3 + (1/49)/2) = 20/49."""
    found = consistency.whiteness([1.0, 2.0, -1.0, 1.0], lags=2)
    assert found.autocorrelation[:, 0] == pytest.approx([-1 / 7, 1 / 7])
    assert found.bound == pytest.approx(0.98)
    assert found.p_value == pytest.approx(np.exp(-10 / 49))  # chi-square of two degrees of freedom


@pytest.mark.short
def test_whiteness_tells_white_from_coloured_and_from_biased():
    rng = np.random.default_rng(7)
    white = rng.standard_normal((400, 200))
    found = consistency.whiteness(white)
    assert stats.kstest(found.p_value, "uniform").pvalue > 1e-3
    assert np.mean(np.abs(found.autocorrelation) > found.bound) == pytest.approx(0.05, abs=0.015)
    coloured = white[1:] + 0.5 * white[:-1]
    assert np.median(consistency.whiteness(coloured).p_value) < 1e-6
    # 0.5 / (1 + 0.25)
    assert np.median(consistency.whiteness(coloured).autocorrelation[0]) == pytest.approx(
        0.4, abs=0.02
    )
    assert np.median(consistency.whiteness(white + 0.5).p_value) < 1e-6


@pytest.mark.short
def test_whiteness_leaves_out_what_was_not_measured():
    z = np.random.default_rng(8).standard_normal((60, 3))
    holes = np.insert(z, [10, 30], np.nan, axis=0)
    holes[:, 2] = np.nan
    found, whole = consistency.whiteness(holes, 5), consistency.whiteness(z[:, :2], 5)
    np.testing.assert_array_equal(found.autocorrelation[:, :2], whole.autocorrelation)
    assert found.bound == whole.bound and np.isnan(found.p_value[2])
    with pytest.raises(DataError, match="5 innovations are too few for 5 lags"):
        consistency.whiteness(z[:5], 5)


def solution_with(innovation, nis, source, accepted, names):
    return SimpleNamespace(
        innovations=Innovations(np.arange(len(nis)), source, innovation, nis, accepted, names, ())
    )


@pytest.mark.short
def test_normalised_innovations_have_unit_size_and_keep_their_correlation():
    rng = np.random.default_rng(9)
    z, nan = rng.standard_normal((2000, 3)), np.full((2000, 2), np.nan)
    swelling = np.exp(np.linspace(0, 3, 2000))[:, None] * [1.0, 10.0, 0.1]
    source, accepted = np.arange(2000) % 2, np.arange(2000) % 50 > 1
    heights = np.c_[4.0 * z[:, :1], nan]
    innovation, nis = (
        np.where(source[:, None] == 0, z * swelling, heights),
        np.where(source == 0, 3.0, z[:, 0] ** 2),
    )
    solution = solution_with(innovation, nis, source, accepted, ("gnss", "baro"))
    scaled = consistency.normalised_innovations(solution, "gnss")
    assert scaled.shape == (960, 3) and np.square(scaled).mean(axis=0) == pytest.approx(1, abs=0.02)
    assert (
        min(np.corrcoef(scaled[:, k], z[(source == 0) & accepted, k])[0, 1] for k in range(3))
        > 0.98
    )
    assert consistency.whiteness(scaled).p_value.min() > 1e-3
    # exactly e / sqrt(S), not e / rms
    np.testing.assert_allclose(
        consistency.normalised_innovations(solution, 1)[:, 0], z[(source == 1) & accepted, 0]
    )
    with pytest.raises(DataError, match="no source 'radar'; it has gnss, baro"):
        consistency.normalised_innovations(solution, "radar")


CRUISE = Motion(
    "circling",
    (DEG * 47, DEG * 8, 500.0),
    lambda t: (30 * np.cos(0.1 * t), 30 * np.sin(0.1 * t), 0 * t),
    lambda t: (0.2 + 0 * t, 0.03 + 0 * t, 0.1 * t),
)


@pytest.fixture(scope="module")
def flown():
    recording = sd.simulate(CRUISE, 40.0, "tactical", seed=1, rate=20.0)
    deviations = np.r_[[1.0] * 3, [0.1] * 3, [1e-2] * 3, [5e-2] * 3, [1e-4] * 3]
    start = draw_start(
        recording.reference,
        deviations,
        np.random.default_rng(2),
        biases=(recording.meta["b_a"][0], recording.meta["b_g"][0]),
    )
    return recording, start, sd.fuse(recording, start=start, every=20, covariance=True)


def test_state_errors_are_those_of_the_simulation(flown):
    recording, start, solution = flown
    error, rows = consistency.state_errors(solution, recording), np.arange(19, 800, 20)
    np.testing.assert_array_equal(solution.t, recording.imu.t[rows])
    np.testing.assert_array_equal(error[:, 9:12], recording.meta["b_a"][rows] - solution.b_a)
    np.testing.assert_array_equal(error[:, 12:15], recording.meta["b_g"][rows] - solution.b_g)
    np.testing.assert_allclose(
        error[:, 3:6], recording.reference.v_n[rows + 1] - solution.trajectory.v_n, atol=1e-12
    )
    by_hand = [e @ np.linalg.solve(P, e) for e, P in zip(error, solution.covariance)]
    np.testing.assert_allclose(consistency.nees_of(solution, recording), by_hand, rtol=1e-6)
    assert 3 < np.mean(by_hand) < 45  # of one run: a right filter's epochs are strongly correlated


def test_what_the_recording_does_not_know_is_refused_or_nan(flown):
    from dataclasses import replace

    recording, start, solution = flown
    with pytest.raises(DataError, match="covariance=True"):
        consistency.nees_of(replace(solution, covariance=None), recording)
    for other in (
        replace(recording, meta={}),
        replace(recording, reference=None),
        recording.between(0.0, 20.0),
    ):
        with pytest.raises(DataError, match="whole simulated recording"):
            consistency.nees_of(solution, other)
    truth = recording.reference
    with pytest.raises(DataError, match="no velocity or attitude"):
        consistency.nees_of(solution, replace(recording, reference=replace(truth, q_nb=None)))
    shifted = replace(recording, imu=recording.imu._replace(t=recording.imu.t + 0.01))
    with pytest.raises(DataError, match="not at the recording's IMU samples"):
        consistency.nees_of(solution, shifted)
    half = replace(
        truth, **{name: getattr(truth, name)[:401] for name in ("t", "lla", "v_n", "q_nb")}
    )
    np.testing.assert_array_equal(
        np.isnan(consistency.nees_of(solution, replace(recording, reference=half))), solution.t > 20
    )


def test_nees_takes_the_states_beyond_the_fifteenth_whose_truth_is_known(flown):
    from dataclasses import replace

    recording, start, _ = flown
    wrong = replace(
        recording, sources=tuple(replace(a, parameters=(-0.3, 0, 0)) for a in recording.sources)
    )
    solution = sd.fuse(
        wrong, start=start, every=20, covariance=True, estimate=["lever-arm", "clock"]
    )
    names = list(solution.columns)[:4]
    assert names[0] == "clock error of GNSS position [s]"
    truth = dict(zip(names, (0.0, 0.3, 0.0, 0.0)))
    places = [*range(15), 17, 15]
    beyond = {names[2]: np.zeros(len(solution.t)), names[0]: truth[names[0]]}
    error = np.c_[
        consistency.state_errors(solution, wrong),
        -solution.columns[names[2]],
        -solution.columns[names[0]],
    ]
    P = solution.covariance[:, places][:, :, places]
    by_hand = [e @ np.linalg.solve(p, e) for e, p in zip(error, P)]
    np.testing.assert_allclose(consistency.nees_of(solution, wrong, beyond), by_hand, rtol=1e-6)
    assert 4 < np.mean(consistency.nees_of(solution, wrong, truth)) < 50
    # a truth that is not the one is seen
    assert np.mean(consistency.nees_of(solution, wrong, truth | {names[1]: -2.0})[20:]) > 50
    for bad, text in (
        ({"clock": 0.0}, "clock error of GNSS position"),
        ({names[0]: [0.0, 1.0]}, "shape"),
    ):
        with pytest.raises(DataError, match=text):
            consistency.nees_of(solution, wrong, bad)
    with pytest.raises(DataError, match="comes from a file"):
        consistency.nees_of(replace(solution, recording=None), wrong, truth)
