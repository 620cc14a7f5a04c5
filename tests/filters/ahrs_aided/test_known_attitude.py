"""What errors of the known attitude do in the filters that an AHRS feeds, in closed form:
velocity and position, gaps, records without heading."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import aiding, filters
from strapdown.core.loop.contract import InitialState, Kind, Noise, compile_kernel
from strapdown.core.mathematics.mechanization import stationary_increments
from strapdown.core.mathematics.source import new_source
from strapdown.filters.ahrs_aided.known_attitude import KNOWN, KNOWN_ATTITUDE, SINCE_TILT
from strapdown.filters.ins import open_loop

pytestmark = pytest.mark.short
FED = ("direct-ahrs", "indirect-ahrs-closed", "indirect-ahrs-open")
STILL = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def standing(name, heading=0.7, noise=STILL, deviation=(0.01, 0.02, 0.03), bias_std=0.0, **options):
    """(belief of a body at rest that is level and knows all but its attitude and gyro bias,
    function of seconds)."""
    filter = filters.find(name)
    begin = InitialState(
        0.0,
        (0.8, 0.1, 100.0),
        (0.0,) * 3,
        (0.0, 0.0, heading),
        (0.0,) * 3,
        (0.0,) * 3,
        (*[1e-9] * 6, *deviation, *[1e-12] * 3, *[bias_std] * 3),
    )
    belief, u = filter.start(begin, noise, **options), np.zeros(6)
    for kernel in (filter.predict, filter.correct, aiding.find("attitude").observe):
        compile_kernel(kernel)

    def advance(seconds, dt=0.01, extra=(0.0,) * 6):
        for _ in range(round(seconds / dt)):
            stationary_increments(
                belief.lla,
                np.zeros(3),
                np.ascontiguousarray(belief.workspace[KNOWN : KNOWN + 9].reshape(3, 3)),
                dt,
                u,
            )
            filter.predict(belief, u + np.array(extra) * dt, dt, noise)

    return filter, belief, advance


def record(filter, belief, rph, deviation, gate=np.inf):
    return filter.correct(
        belief,
        np.array(rph),
        np.array(deviation),
        Kind.ATTITUDE,
        aiding.find("attitude").observe,
        new_source(),
        gate,
        np.zeros(12),
    )


@pytest.mark.parametrize("name", FED)
def test_an_error_of_the_known_attitude_is_a_velocity_error_of_g_times_time(name):
    """P_vv after a record that is 0.01 rad (forward) and 0.02 rad (right) wrong and is held for
    2 s, and independently for 2 s more. Down it is what they shorten gravity by, the same in both."""
    filter, belief, advance = standing(name, heading=0.0)
    g = 9.81
    for seconds in (2.0, 4.0):
        before = np.diag(belief.P)[3:6].copy()
        record(filter, belief, (0.0, 0.0, 0.0), (0.01, 0.02, 0.05))
        advance(2.0)
        np.testing.assert_allclose(
            np.diag(belief.P)[3:5] - before[:2],
            [(g * 0.02 * 2) ** 2, (g * 0.01 * 2) ** 2],
            rtol=2e-3,
        )
        shortened = 0.5 * (0.01**2 + 0.02**2) * g * seconds
        assert np.sqrt(belief.P[5, 5]) == pytest.approx(shortened, rel=2e-3)


@pytest.mark.parametrize("how", ["considered", "neglected"])
@pytest.mark.parametrize("name", FED)
def test_no_mean_is_shifted_by_a_stated_covariance(name, how):
    """At rest with 20 deg of roll, exact records: the velocity stays 0 whether they are stated as
    0.01, 10 or 57 deg. A shift by the mean of E exp[n x] would be g/2 with the last."""
    true = Rotation.from_euler("ZYX", [0.4, 0.0, np.radians(20)])
    found, u, dt = [], np.zeros(6), 0.01
    for stated in (2e-4, 0.17, 1.0):
        filter, belief, _ = standing(name, 0.4, deviation=(stated,) * 3, attitude_error=how)
        for _ in range(5):
            record(filter, belief, true.as_euler("ZYX")[::-1], (stated,) * 3)
            for _ in range(10):
                stationary_increments(belief.lla, np.zeros(3), true.as_matrix(), dt, u)
                filter.predict(belief, u, dt, STILL)
        found.append(np.r_[belief.v_n, belief.b_a])
    assert np.abs(found).max() < 1e-6


@pytest.mark.parametrize("name", FED)
def test_neglected_errors_of_the_attitude_leave_the_velocity_certain(name):
    """And with them the variance of velocity is (g t std)^2, as the tests below have it."""
    noise = STILL._replace(gyro=1e-3)
    for how, expected in (("neglected", 0.0), ("considered", 0.5)):
        filter, belief, advance = standing(
            name, 0.0, noise, (0.1,) * 3, bias_std=1e-3, attitude_error=how
        )
        record(filter, belief, (0.0, 0.0, np.nan), (0.1, 0.1, np.nan))
        advance(1.0)
        assert np.sqrt(belief.P[3, 3]) == pytest.approx(
            9.81 * 0.1 * (expected > 0), rel=0.01, abs=1e-6
        )


@pytest.mark.parametrize("name", FED)
def test_the_error_turns_with_the_heading(name):
    _, one, advance = standing(name, 0.0)
    advance(1.0)
    _, other, advance_other = standing(name, np.radians(90), deviation=(0.02, 0.01, 0.03))  # in n
    advance_other(1.0)
    np.testing.assert_allclose(np.diag(one.P)[[3, 4]], np.diag(other.P)[[4, 3]], rtol=1e-3)
    filter, turned, advance_turned = standing(name, np.radians(60))
    record(filter, turned, (0.0, 0.0, np.radians(60)), (0.01, 0.02, 0.03))
    advance_turned(1.0)
    level = Rotation.from_euler("z", 60, degrees=True).as_matrix()[:2, :2]
    np.testing.assert_allclose(
        turned.P[3:5, 3:5],
        level @ np.diag([(9.81 * 0.02) ** 2, (9.81 * 0.01) ** 2]) @ level.T,
        rtol=3e-3,
        atol=1e-6,
    )


@pytest.mark.parametrize("name", FED)
def test_without_records_the_gyros_carry_on_and_their_errors_count(name):
    """f^2 (std^2 t^2 + q t^3/3 + b^2 t^4/4) of the velocity after 20 s: a held error, a random
    walk, a constant rate."""
    noise = STILL._replace(gyro=1e-3)
    _, belief, advance = standing(name, noise=noise, deviation=(0.002,) * 3, bias_std=1e-3)
    advance(20.0, 0.02)
    expected = 9.81**2 * (0.002**2 * 400 + 1e-6 * 8000 / 3 + 1e-6 * 160000 / 4)
    np.testing.assert_allclose(np.diag(belief.P)[3:5], expected, rtol=5e-3)


@pytest.mark.parametrize("name", FED)
def test_position_errs_with_the_velocity(name):
    """By s^2/2 f n of a held error, so that var(p) is s^4/4 and cov(p, v) s^3/2 of f n; of white
    gyro errors s^5/20 and s^4/8.

    A constant gyro bias gives var(v) = s^4/4, as above, but 10 % less than its cov(p, v) = s^5/12
    and var(p) = s^6/36.
    """
    for noise, deviation, bias, expected in (
        (STILL, 0.002, 0.0, 4e-6 * np.array([400.0, 4000, 40000])),
        (STILL._replace(gyro=1e-3), 1e-12, 0.0, 1e-6 * np.array([8000 / 3, 20000, 160000])),
        (STILL, 1e-12, 1e-3, 1e-6 * np.array([40000.0, 0.9 * 20**5 / 12, 0.9 * 20**6 / 36])),
    ):
        _, belief, advance = standing(name, noise=noise, deviation=(deviation,) * 3, bias_std=bias)
        advance(20.0, 0.02)
        P = belief.P
        np.testing.assert_allclose([P[4, 4], P[1, 4], P[1, 1]], 9.8**2 * expected, rtol=0.01)


@pytest.mark.parametrize("name", FED)
def test_what_the_gyros_added_in_a_gap_is_not_forgotten_after_it(name):
    """A random walk for 10 s, of the density of a gap, and its end held for 10 s: f^2 q (T^3/3 +
    T^3 + T^3)."""
    filter, belief, advance = standing(
        name, noise=STILL._replace(gyro=1e-3), deviation=(1e-12,) * 3
    )
    advance(10.0, 0.02)
    u = np.zeros(6)
    for _ in range(500):
        stationary_increments(
            belief.lla,
            np.zeros(3),
            np.ascontiguousarray(belief.workspace[KNOWN : KNOWN + 9].reshape(3, 3)),
            0.02,
            u,
        )
        filter.predict(belief, u, 0.02, STILL)
    np.testing.assert_allclose(np.diag(belief.P)[3:5], 9.8**2 * 1e-6 * 7000 / 3, rtol=0.01)


@pytest.mark.parametrize("name", FED)
def test_the_error_of_a_heading_that_records_lack_goes_on(name):
    """2 m/s^2 forward, heading known to 0.1 rad and never measured by records at 1 Hz: after 20
    s it has moved v by 4 m/s and p by 40 m."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-3, 1e-3, 0.1))
    for _ in range(20):
        advance(1.0, 0.02, (0, 0, 0, 2.0, 0, 0))
        record(filter, belief, (0.0, 0.0, np.nan), (1e-3, 1e-3, np.nan))
    np.testing.assert_allclose(np.sqrt(np.diag(belief.P)[[1, 4]]), [40.0, 4.0], rtol=0.01)
    record(filter, belief, (0.0, 0.0, 0.0), (1e-3, 1e-3, 0.1))
    before = belief.P[4, 4]
    advance(1.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    assert belief.P[4, 4] - before == pytest.approx(0.04, rel=0.02)  # a new error


@pytest.mark.parametrize("name", FED)
def test_a_compass_makes_such_a_heading_partly_new(name):
    """Errors psi_0 for 10 s, then psi_1 of the corrected estimate, of half the variance and so
    with that covariance: var(v) = f^2 T^2 (1 + 2/2 + 1/2)."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-3, 1e-3, 0.1))
    advance(10.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    compass = aiding.find("heading")
    compile_kernel(compass.observe)
    filter.correct(
        belief,
        np.array([0.0, np.nan, np.nan]),
        np.array([0.1, np.nan, np.nan]),
        aiding.number(compass.name),
        compass.observe,
        new_source(),
        np.inf,
        np.zeros(12),
    )
    assert belief.P[8, 8] == pytest.approx(0.005, rel=1e-3)
    record(filter, belief, (0.0, 0.0, np.nan), (1e-3, 1e-3, np.nan))
    advance(10.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    assert belief.P[4, 4] == pytest.approx(4 * 100 * 0.01 * 2.5, rel=0.01)


def test_the_open_loop_keeps_its_kinematics_beside_what_is_known():
    _, belief, _ = standing("indirect-ahrs-open")
    own = KNOWN_ATTITUDE.views(belief.workspace)
    assert own["MODE"] == open_loop.SECOND_ORDER and own["ERROR_EE"] == belief.P[7, 7]
    assert np.array_equal(own["KNOWN"], belief.C_nb) and np.array_equal(own["C"], belief.C_nb)


@pytest.mark.parametrize("name", FED)
def test_velocity_follows_the_known_attitude_and_no_other(name):
    """A record 1 deg off in roll: the velocity grows by g sin(1 deg), although the estimate has
    hardly followed it."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-4,) * 3)
    nis = record(filter, belief, (np.radians(1), 0.0, 0.0), (0.02,) * 3)
    assert 0 < nis < 1 and np.abs(np.arcsin(belief.C_nb[2, 1])) < 1e-6
    lla = belief.lla.copy()
    u = np.zeros(6)
    for _ in range(100):
        stationary_increments(lla, np.zeros(3), np.eye(3), 0.01, u)
        filter.predict(belief, u, 0.01, STILL)
    assert (
        belief.v_n[1] == pytest.approx(9.81 * np.sin(np.radians(1)), rel=2e-3)
        and abs(belief.v_n[0]) < 1e-4
        and belief.workspace[SINCE_TILT] == pytest.approx(1.0)
    )


@pytest.mark.parametrize("name", FED)
def test_a_rejected_record_changes_nothing_and_one_without_heading_takes_the_estimated_one(name):
    filter, belief, _ = standing(name, 0.7)
    known = belief.workspace[KNOWN : KNOWN + 9].copy()
    assert record(filter, belief, (1.0, 0.0, 0.7), (0.01,) * 3, gate=16.0) > 16 and np.array_equal(
        belief.workspace[KNOWN : KNOWN + 9], known
    )
    assert np.isnan(record(filter, belief, (np.nan,) * 3, (0.01,) * 3)) and np.array_equal(
        belief.workspace[KNOWN : KNOWN + 9], known
    )
    record(filter, belief, (0.01, 0.02, np.nan), (0.01, 0.01, np.nan), gate=16.0)
    np.testing.assert_allclose(
        Rotation.from_matrix(belief.workspace[KNOWN : KNOWN + 9].reshape(3, 3)).as_euler("ZYX"),
        [0.7, 0.02, 0.01],
        atol=3e-4,
    )
    assert (
        np.isfinite(belief.P).all() and np.isfinite(belief.workspace[KNOWN : SINCE_TILT + 1]).all()
    )


@pytest.mark.parametrize("name", FED)
def test_errors_that_last_weigh_as_white_ones_of_the_same_power(name):
    """A record each second whose errors last 20 s: its variance counts 40 times, and the
    velocity grows by 40 s of that of g n, at rest."""
    deviation = (0.01, 0.01, 0.03)
    both = []
    for correlation, factor in ((20.0, 1.0), (0.0, np.sqrt(40.0))):
        filter, belief, advance = standing(
            name, 0.0, deviation=(0.05,) * 3, correlation=correlation
        )
        for _ in range(5):
            advance(1.0)
            record(filter, belief, (0.0, 0.0, 0.0), factor * np.array(deviation))
        both.append(np.diag(belief.P).copy())
        before = belief.P[3, 3]
        advance(1.0)
        assert belief.P[3, 3] - before == pytest.approx((9.81 * 0.01) ** 2 * 40, rel=0.01)
    np.testing.assert_allclose(both[0][6:9], both[1][6:9], rtol=0.02)
