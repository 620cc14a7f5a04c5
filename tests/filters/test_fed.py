"""Filters whose attitude an AHRS measures: against two textbook filters beside each other, against each other, and what a known attitude's errors do."""
from dataclasses import replace

import numpy as np
import pytest
from recordings import ahrs, flight, start
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.contract import ATTITUDE_KIND, PARAMETERS, Noise, Start, compile_kernel
from strapdown.core.earth import gravity, place, rotation_rates
from strapdown.core.error_state import HEIGHT
from strapdown.core.fed import DECAYING, ERRORS, KNOWN, SINCE
from strapdown.core.mechanization import stationary_increments
from strapdown.data import DataError
from strapdown.filters import open_loop, periodic_reset
from strapdown.geodesy import displaced, displacement
from strapdown.sensors.gnss import Gnss
from strapdown.sim.trajectory import Motion

pytestmark = pytest.mark.short
FED = ("direct-ahrs", "indirect-ahrs-closed", "indirect-ahrs-open")
NOISE = Noise(gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100)
STILL = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
GNSS = Gnss(velocity_sd=None)


def recorded(rate=2.0, gnss=GNSS, seconds=20.0, motion=None):
    """The turning flight, or another motion, without lever arm or gates, with an AHRS."""
    recording = flight(seconds, gnss=gnss) if motion is None else sd.simulate(motion, seconds, "tactical", 3, 20.0, gnss)
    return replace(recording, aidings=(*(replace(a, gate=np.inf) for a in recording.aidings), ahrs(recording.reference, rate, gate=np.inf)))


def straight():
    """Straight and level at 30 m/s."""
    return Motion("straight", (0.8, 0.1, 500.0), lambda t: (20 + 0 * t, 22 + 0 * t, 0 * t), lambda t: (0 * t, 0.03 + 0 * t, 0.8 + 0 * t))


def fused(recording, name, noise=NOISE, begin=None, **options):
    return sd.fuse(recording, name, start=begin or start(recording), noise=noise, covariance=True, **options)


# ---- a textbook: position, velocity and accelerometer bias in one Kalman filter, attitude and gyro bias in another

def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0.0]])


def step_of(F, Q, dt):
    """Discrete transition and noise of x' = F x + w (Van Loan)."""
    n = len(F)
    both = expm(np.block([[-F, Q], [np.zeros((n, n)), F.T]]) * dt)
    return both[n:, n:].T, both[n:, n:].T @ both[:n, n:]


def corrected(P, H, R, gained=None):
    """(gain, P) of a correction; only the first `gained` states get a gain."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    K[gained or len(P):] = 0
    keep = np.eye(len(P)) - K @ H
    return K, keep @ P @ keep.T + K @ R @ K.T


def textbook(recording, begin):
    """Two linear filters over a measured attitude, in a local frame; yields (lla, v, C, b_a, b_g, variances of p v a theta g).

    The first is a Schmidt-Kalman filter: the error of the known attitude and the gyro bias that turns it stand in its covariance, and get no gain.
    """
    position, attitude = recording.aidings
    known = C = Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix()
    lla, v, b_a, b_g = np.array(begin.lla), np.array(begin.v), np.zeros(3), np.zeros(3)
    variances = np.square(begin.sd)
    P, S = np.diag(np.r_[variances[:6], variances[9:12], variances[6:9], variances[12:]]), np.diag(np.r_[variances[6:9], variances[12:]])
    O, I = np.zeros((3, 3)), np.eye(3)
    fade_a, fade_g = np.exp(-NOISE.accel_decay * 0.05), np.exp(-NOISE.gyro_decay * 0.05)
    for t, dt, dtheta, dv in zip(*recording.imu):
        r, a = dtheta - b_g * dt, dv - b_a * dt
        sine, cosine, M, N = place(lla[0], lla[2])
        ie_n, ie_d, w0, w1, w2 = rotation_rates(v[0], v[1], sine, cosine, M, N)
        w_in, w_v = np.array([w0, w1, w2]), np.array([w0 + ie_n, w1, w2 + ie_d])
        middle = known @ Rotation.from_rotvec(r / 2).as_matrix()
        f = known @ (I + skew(r) / 2 + skew(r) @ skew(r) / 6) @ a / dt
        Phi, Q = step_of(np.block([[O, I, O, O, O], [O, -skew(w_v), -middle, -skew(f), O], [O, O, -NOISE.accel_decay * I, O, O],
                                   [O, O, O, O, -middle], [np.zeros((3, 15))]]),
                         np.diag(np.repeat([0, NOISE.accel ** 2, NOISE.accel_bias ** 2, NOISE.gyro ** 2, 0], 3)), dt)
        P = Phi @ P @ Phi.T + Q
        Phi, Q = step_of(np.block([[-skew(w_in), -middle], [O, -NOISE.gyro_decay * I]]), np.diag(np.repeat([NOISE.gyro ** 2, NOISE.gyro_bias ** 2], 3)), dt)
        S = Phi @ S @ Phi.T + Q
        change = (f + np.array([0, 0, gravity(sine, lla[2])]) - np.cross(w_v, v)) * dt
        lla, v = displaced(lla, (v + change / 2) * dt), v + change
        turn = lambda D: Rotation.from_rotvec(-w_in * dt).as_matrix() @ D @ Rotation.from_rotvec(r).as_matrix()
        known, C, b_a, b_g = turn(known), turn(C), b_a * fade_a, b_g * fade_g
        for row in np.flatnonzero(np.abs(position.t - t) < 1e-6):
            K, P = corrected(P, np.eye(3, 15), np.diag(position.sd[row] ** 2), 9)
            dx = K @ displacement(position.y[row], lla)
            lla, v, b_a = displaced(lla, dx[:3]), v + dx[3:6], b_a + dx[6:9]
        for row in np.flatnonzero(np.abs(attitude.t - t) < 1e-6):
            measured, level = Rotation.from_euler("ZYX", attitude.y[row][::-1]), Rotation.from_euler("z", attitude.y[row][2]).as_matrix()
            R_known = level @ np.diag(attitude.sd[row] ** 2) @ level.T
            K, S = corrected(S, np.eye(3, 6), R_known)
            P = block_diag(P[:9, :9], R_known, S[3:, 3:])
            dx = K @ (measured * Rotation.from_matrix(C).inv()).as_rotvec()
            C, b_g, known = Rotation.from_rotvec(dx[:3]).as_matrix() @ C, b_g + dx[3:], measured.as_matrix()
        p, s = np.diag(P), np.diag(S)
        yield lla, v, C, b_a, b_g, np.r_[p[:6], s[:3], p[6:9], s[3:]]


@pytest.mark.parametrize("rate", [2.0, 0.2])
def test_it_is_two_textbook_filters_beside_each_other(rate):
    """20 s at 20 Hz: coning and sculling (here below 1e-6), the gradient of gravity and the coupling of velocity into attitude are left out there.

    With a record in 5 s the errors of the known attitude are held over five position fixes, which correct what they did.
    """
    recording = recorded(rate)
    solution = fused(recording, "indirect-ahrs-closed", bias="decaying")
    lla, v, C, b_a, b_g, variance = (np.array(part) for part in zip(*textbook(recording, start(recording))))
    deviation = np.sqrt(variance)
    assert np.abs(displacement(solution.trajectory.lla, lla) / deviation[:, :3]).max() < 2e-3
    assert np.abs((solution.trajectory.v_n - v) / deviation[:, 3:6]).max() < 2e-3
    assert (solution.trajectory.rotation * Rotation.from_matrix(C).inv()).magnitude().max() < 2e-3 * deviation[:, 6:9].min()
    assert np.abs((np.c_[solution.b_a, solution.b_g] - np.c_[b_a, b_g]) / deviation[:, 9:]).max() < 2e-3
    assert np.abs(solution.trajectory.sd / deviation - 1).max() < 1e-3


# ---- the three against each other

def differences(a, b):
    """Largest differences of position, velocity, attitude and biases over the standard deviations of `b`."""
    deviation = b.trajectory.sd
    parts = (displacement(a.trajectory.lla, b.trajectory.lla), a.trajectory.v_n - b.trajectory.v_n,
             (a.trajectory.rotation * b.trajectory.rotation.inv()).as_rotvec(), a.b_a - b.b_a, a.b_g - b.b_g)
    return [np.abs(part / deviation[:, 3 * k:3 * k + 3]).max() for k, part in enumerate(parts)]


@pytest.mark.parametrize("bias", ["random-walk", "decaying"])
def test_feed_forward_and_feedback_agree_where_the_error_model_is_linear(bias):
    recording = recorded(gnss=Gnss(lever_arm=(0.3, -0.2, -0.5)))
    begin = start(recording)._replace(ba=(0.05, -0.03, 0.04), bg=(1e-3, -2e-3, 1e-3))
    first, second = (fused(recording, name, begin=begin, bias=bias) for name in ("indirect-ahrs-open", "indirect-ahrs-closed"))
    assert max(differences(first, second)) < 0.02 and np.abs(first.trajectory.sd / second.trajectory.sd - 1).max() < 5e-3
    assert np.abs(first.columns["ins_error_down [m]"]).max() > 1    # the INS itself is elsewhere


@pytest.mark.parametrize("bias", ["random-walk", "decaying"])
def test_the_direct_filter_is_the_feedback_one_where_the_body_does_not_turn(bias):
    recording = recorded(motion=straight())
    first, second = (fused(recording, name, bias=bias) for name in ("direct-ahrs", "indirect-ahrs-closed"))
    assert max(differences(first, second)) < 0.01


def test_where_it_turns_the_direct_filter_differs_by_what_its_covariance_has_more():
    """Errors of the rates at the known attitude are independent of the others, so the squared difference is the difference of the variances.

    100 s with a time constant of about 4 s and two axes are some 50 degrees of freedom: a standard deviation of 0.2.
    """
    recording = recorded(1.0, seconds=100.0)
    first, second = (fused(recording, name, bias="decaying") for name in ("direct-ahrs", "indirect-ahrs-closed"))
    late = first.t > 10
    square = (first.trajectory.rotation * second.trajectory.rotation.inv()).as_rotvec()[late, :2] ** 2
    expected = (first.trajectory.sd ** 2 - second.trajectory.sd ** 2)[late, 6:8]
    assert 0.4 < square.mean() / expected.mean() < 1.6 and (expected > 0).all()
    assert np.abs(displacement(first.trajectory.lla, second.trajectory.lla)).max() < 0.01


def test_open_loop_columns_are_what_the_raw_ins_is_off():
    """With exact fixes: the INS takes only the initial bias off, so a constant rest of it moves the INS by b t^2/2."""
    recording = recorded()
    off = np.array([0.05, -0.04, 0.03])
    raw = replace(recording, imu=recording.imu._replace(dv=recording.imu.dv + off * recording.imu.dt[:, None]))
    solution = fused(raw, "indirect-ahrs-open")
    shift = np.stack([solution.columns[f"ins_error_{axis} [m]"] for axis in ("north", "east", "down")], axis=1)
    assert np.linalg.norm(shift[-1]) == pytest.approx(np.linalg.norm(off[2:]) * 200, abs=12) and np.abs(shift[0]).max() < 2


# ---- what errors of the known attitude do, in closed form

def standing(name, heading=0.7, noise=STILL, deviation=(0.01, 0.02, 0.03), bias_sd=0.0, **options):
    """(belief of a body at rest that is level and knows all but its attitude and gyro bias, function of seconds)."""
    filter = filters.find(name)
    begin = Start(0.0, (0.8, 0.1, 100.0), (0.0,) * 3, (0.0, 0.0, heading), (0.0,) * 3, (0.0,) * 3, (*[1e-9] * 6, *deviation, *[1e-12] * 3, *[bias_sd] * 3))
    belief, u = filter.start(begin, noise, **options), np.zeros(6)
    for kernel in (filter.predict, filter.correct, aiding.find("attitude").observe):
        compile_kernel(kernel)

    def advance(seconds, dt=0.01, extra=(0.0,) * 6):
        for _ in range(round(seconds / dt)):
            stationary_increments(belief.lla, np.zeros(3), np.ascontiguousarray(belief.aux[KNOWN:KNOWN + 9].reshape(3, 3)), dt, u)
            filter.predict(belief, u + np.array(extra) * dt, dt, noise)
    return filter, belief, advance


def record(filter, belief, rph, deviation, gate=np.inf):
    return filter.correct(belief, np.array(rph), np.array(deviation), ATTITUDE_KIND, aiding.find("attitude").observe, np.zeros(PARAMETERS), gate, np.zeros(3))


@pytest.mark.parametrize("name", FED)
def test_an_error_of_the_known_attitude_is_a_velocity_error_of_g_times_time(name):
    """P_vv after a record that is 0.01 rad (forward) and 0.02 rad (right) wrong and is held for 2 s, and independently for a second more."""
    filter, belief, advance = standing(name, heading=0.0)
    g = 9.81
    for _ in range(2):
        before = np.diag(belief.P)[3:6].copy()
        record(filter, belief, (0.0, 0.0, 0.0), (0.01, 0.02, 0.05))
        advance(2.0)
        np.testing.assert_allclose(np.diag(belief.P)[3:5] - before[:2], [(g * 0.02 * 2) ** 2, (g * 0.01 * 2) ** 2], rtol=2e-3)
        assert np.diag(belief.P)[5] < 1e-8


@pytest.mark.parametrize("name", FED)
def test_the_error_turns_with_the_heading(name):
    _, one, advance = standing(name, 0.0)
    advance(1.0)
    _, other, advance_other = standing(name, np.radians(90), deviation=(0.02, 0.01, 0.03))    # in n
    advance_other(1.0)
    np.testing.assert_allclose(np.diag(one.P)[[3, 4]], np.diag(other.P)[[4, 3]], rtol=1e-3)
    filter, turned, advance_turned = standing(name, np.radians(60))
    record(filter, turned, (0.0, 0.0, np.radians(60)), (0.01, 0.02, 0.03))
    advance_turned(1.0)
    level = Rotation.from_euler("z", 60, degrees=True).as_matrix()[:2, :2]
    np.testing.assert_allclose(turned.P[3:5, 3:5], level @ np.diag([(9.81 * 0.02) ** 2, (9.81 * 0.01) ** 2]) @ level.T, rtol=3e-3, atol=1e-6)


@pytest.mark.parametrize("name", FED)
def test_without_records_the_gyros_carry_on_and_their_errors_count(name):
    """f^2 (sd^2 t^2 + q t^3/3 + b^2 t^4/4) of the velocity after 20 s: a held error, a random walk, a constant rate."""
    noise = STILL._replace(gyro=1e-3)
    _, belief, advance = standing(name, noise=noise, deviation=(0.002,) * 3, bias_sd=1e-3)
    advance(20.0, 0.02)
    expected = 9.81 ** 2 * (0.002 ** 2 * 400 + 1e-6 * 8000 / 3 + 1e-6 * 160000 / 4)
    np.testing.assert_allclose(np.diag(belief.P)[3:5], expected, rtol=5e-3)


@pytest.mark.parametrize("name", FED)
def test_position_errs_with_the_velocity(name):
    """By s^2/2 f n of a held error, so that var(p) is s^4/4 and cov(p, v) s^3/2 of f n; of white gyro errors s^5/20 and s^4/8.

    A constant gyro bias gives var(v) = s^4/4, as above, but 10 % less than its cov(p, v) = s^5/12 and var(p) = s^6/36.
    """
    for noise, deviation, bias, expected in ((STILL, 0.002, 0.0, 4e-6 * np.array([400.0, 4000, 40000])),
                                             (STILL._replace(gyro=1e-3), 1e-12, 0.0, 1e-6 * np.array([8000 / 3, 20000, 160000])),
                                             (STILL, 1e-12, 1e-3, 1e-6 * np.array([40000.0, 0.9 * 20 ** 5 / 12, 0.9 * 20 ** 6 / 36]))):
        _, belief, advance = standing(name, noise=noise, deviation=(deviation,) * 3, bias_sd=bias)
        advance(20.0, 0.02)
        P = belief.P
        np.testing.assert_allclose([P[4, 4], P[1, 4], P[1, 1]], 9.8 ** 2 * expected, rtol=0.01)


@pytest.mark.parametrize("name", FED)
def test_what_the_gyros_added_in_a_gap_is_not_forgotten_after_it(name):
    """A random walk for 10 s, of the density of a gap, and its end held for 10 s: f^2 q (T^3/3 + T^3 + T^3)."""
    filter, belief, advance = standing(name, noise=STILL._replace(gyro=1e-3), deviation=(1e-12,) * 3)
    advance(10.0, 0.02)
    u = np.zeros(6)
    for _ in range(500):
        stationary_increments(belief.lla, np.zeros(3), np.ascontiguousarray(belief.aux[KNOWN:KNOWN + 9].reshape(3, 3)), 0.02, u)
        filter.predict(belief, u, 0.02, STILL)
    np.testing.assert_allclose(np.diag(belief.P)[3:5], 9.8 ** 2 * 1e-6 * 7000 / 3, rtol=0.01)


@pytest.mark.parametrize("name", FED)
def test_the_error_of_a_heading_that_records_lack_goes_on(name):
    """2 m/s^2 forward, heading known to 0.1 rad and never measured by records at 1 Hz: after 20 s it has moved v by 4 m/s and p by 40 m."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-3, 1e-3, 0.1))
    for _ in range(20):
        advance(1.0, 0.02, (0, 0, 0, 2.0, 0, 0))
        record(filter, belief, (0.0, 0.0, np.nan), (1e-3, 1e-3, np.nan))
    np.testing.assert_allclose(np.sqrt(np.diag(belief.P)[[1, 4]]), [40.0, 4.0], rtol=0.01)
    record(filter, belief, (0.0, 0.0, 0.0), (1e-3, 1e-3, 0.1))
    before = belief.P[4, 4]
    advance(1.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    assert belief.P[4, 4] - before == pytest.approx(0.04, rel=0.02)     # a new error


@pytest.mark.parametrize("name", FED)
def test_a_compass_makes_such_a_heading_partly_new(name):
    """Errors psi_0 for 10 s, then psi_1 of the corrected estimate, of half the variance and so with that covariance: var(v) = f^2 T^2 (1 + 2/2 + 1/2)."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-3, 1e-3, 0.1))
    advance(10.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    compass = aiding.find("heading")
    compile_kernel(compass.observe)
    filter.correct(belief, np.array([0.0, np.nan, np.nan]), np.array([0.1, np.nan, np.nan]), compass.kind, compass.observe, np.zeros(PARAMETERS), np.inf, np.zeros(3))
    assert belief.P[8, 8] == pytest.approx(0.005, rel=1e-3)
    record(filter, belief, (0.0, 0.0, np.nan), (1e-3, 1e-3, np.nan))
    advance(10.0, 0.02, (0, 0, 0, 2.0, 0, 0))
    assert belief.P[4, 4] == pytest.approx(4 * 100 * 0.01 * 2.5, rel=0.01)


def test_the_places_in_aux_do_not_overlap():
    """Of the open loop, of the direct filters and of what is known; and the open loop keeps its kinematics."""
    _, belief, _ = standing("indirect-ahrs-open")
    own = [set(range(part.start, part.stop)) for part in (open_loop.LLA, open_loop.V, slice(open_loop.C, open_loop.C + 9), open_loop.BIAS)]
    places = [*own, {open_loop.MODE}, {periodic_reset.INTERVAL}, {periodic_reset.ELAPSED}, set(range(KNOWN, DECAYING + 1))]
    assert len(set.union(*places)) == sum(map(len, places)) and max(set.union(*places)) < HEIGHT
    assert belief.aux[open_loop.MODE] == open_loop.SECOND_ORDER and belief.aux[ERRORS + 2] == belief.P[7, 7]


@pytest.mark.parametrize("name", FED)
def test_velocity_follows_the_known_attitude_and_no_other(name):
    """A record 1 deg off in roll: the velocity grows by g sin(1 deg), although the estimate has hardly followed it."""
    filter, belief, advance = standing(name, 0.0, deviation=(1e-4,) * 3)
    nis = record(filter, belief, (np.radians(1), 0.0, 0.0), (0.1,) * 3)
    assert 0 < nis < 1 and np.abs(np.arcsin(belief.C[2, 1])) < 1e-6
    lla = belief.lla.copy()
    u = np.zeros(6)
    for _ in range(100):
        stationary_increments(lla, np.zeros(3), np.eye(3), 0.01, u)
        filter.predict(belief, u, 0.01, STILL)
    assert belief.v[1] == pytest.approx(9.81 * np.sin(np.radians(1)), rel=2e-3) and abs(belief.v[0]) < 1e-4 and belief.aux[SINCE] == pytest.approx(1.0)


@pytest.mark.parametrize("name", FED)
def test_a_rejected_record_changes_nothing_and_one_without_heading_takes_the_estimated_one(name):
    filter, belief, _ = standing(name, 0.7)
    known = belief.aux[KNOWN:KNOWN + 9].copy()
    assert record(filter, belief, (1.0, 0.0, 0.7), (0.01,) * 3, gate=16.0) > 16 and np.array_equal(belief.aux[KNOWN:KNOWN + 9], known)
    assert np.isnan(record(filter, belief, (np.nan,) * 3, (0.01,) * 3)) and np.array_equal(belief.aux[KNOWN:KNOWN + 9], known)
    record(filter, belief, (0.01, 0.02, np.nan), (0.01, 0.01, np.nan), gate=16.0)
    np.testing.assert_allclose(Rotation.from_matrix(belief.aux[KNOWN:KNOWN + 9].reshape(3, 3)).as_euler("ZYX"), [0.7, 0.02, 0.01], atol=3e-4)
    assert np.isfinite(belief.P).all() and np.isfinite(belief.aux[KNOWN:SINCE + 1]).all()


# ---- the bias models

@pytest.mark.parametrize("name", (*FED, "direct-euler"))
def test_in_dead_reckoning_a_bias_decays_or_stays_as_asked(name):
    fading = NOISE._replace(accel_decay=1 / 20, gyro_decay=1 / 10)
    recording = replace(flight(), aidings=())
    begin = start(recording)._replace(ba=(0.05, -0.03, 0.04), bg=(1e-3, -2e-3, 1e-3))
    run = lambda **options: run_of(recording, name, fading, begin, options)
    walk, decaying, default = run(bias="random-walk"), run(bias="decaying"), run()
    np.testing.assert_allclose(walk, [*begin.ba, *begin.bg], rtol=1e-12)
    np.testing.assert_allclose(decaying, np.r_[np.array(begin.ba) * np.exp(-1), np.array(begin.bg) * np.exp(-2)], rtol=1e-9)
    assert np.array_equal(default, walk if name.startswith("direct") else decaying)


def run_of(recording, name, noise, begin, options):
    """The biases at the end, from the kernels alone: without an attitude record there is no `fuse`."""
    filter = filters.find(name)
    compile_kernel(filter.predict)
    belief = filter.start(begin, noise, **options)
    for dt, dtheta, dv in zip(*recording.imu[1:]):
        filter.predict(belief, np.r_[dtheta, dv], dt, noise)
    return np.r_[belief.ba, belief.bg]


@pytest.mark.parametrize("name", (*FED, "direct-euler"))
def test_an_unknown_bias_model_is_refused(name):
    with pytest.raises(DataError, match=f"filter '{name}': bias is 'white'; it must be one of random-walk, decaying"):
        fused(recorded(), name, bias="white")


@pytest.mark.parametrize("name", FED)
def test_errors_that_last_weigh_as_white_ones_of_the_same_power(name):
    """A record each second whose errors last 20 s: its variance counts 40 times, and the velocity grows by 40 s of that of g n, at rest."""
    deviation = (0.01, 0.01, 0.03)
    both = []
    for correlation, factor in ((20.0, 1.0), (0.0, np.sqrt(40.0))):
        filter, belief, advance = standing(name, 0.0, deviation=(0.05,) * 3, correlation=correlation)
        for _ in range(5):
            advance(1.0)
            record(filter, belief, (0.0, 0.0, 0.0), factor * np.array(deviation))
        both.append(np.diag(belief.P).copy())
        before = belief.P[3, 3]
        advance(1.0)
        assert belief.P[3, 3] - before == pytest.approx((9.81 * 0.01) ** 2 * 40, rel=0.01)
    np.testing.assert_allclose(both[0][6:9], both[1][6:9], rtol=0.02)


@pytest.mark.parametrize("correlation", [-1.0, np.inf, np.nan])
def test_an_impossible_correlation_is_refused(correlation):
    with pytest.raises(DataError, match=f"correlation is {correlation} s; it must be a finite number, 0 or more"):
        fused(recorded(), "direct-ahrs", correlation=correlation)


def test_which_of_them_need_an_attitude():
    assert {name for name in filters.names() if filters.find(name).needs == ("attitude",)} == {*FED, "fixed-gain"}
    assert filters.find("direct-euler").needs == ()
