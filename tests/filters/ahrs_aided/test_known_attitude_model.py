"""Filters whose attitude an AHRS measures: against two textbook filters beside each other,
against each other, and their bias models."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import ahrs, flight, start
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.earth import gravity, place, rotation_rates
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import Motion

pytestmark = pytest.mark.short
FED = ("direct-ahrs", "indirect-ahrs-closed", "indirect-ahrs-open")
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
GNSS = Gnss(velocity_std=None)


def recorded(rate=2.0, gnss=GNSS, seconds=20.0, motion=None):
    """The turning flight, or another motion, without lever arm or gates, with an AHRS."""
    recording = (
        flight(seconds, gnss=gnss)
        if motion is None
        else sd.simulate(motion, seconds, "tactical", 3, 20.0, gnss)
    )
    return replace(
        recording,
        sources=(
            *(replace(a, gate=np.inf) for a in recording.sources),
            ahrs(recording.reference, rate, gate=np.inf),
        ),
    )


def straight():
    """Straight and level at 30 m/s."""
    return Motion(
        "straight",
        (0.8, 0.1, 500.0),
        lambda t: (20 + 0 * t, 22 + 0 * t, 0 * t),
        lambda t: (0 * t, 0.03 + 0 * t, 0.8 + 0 * t),
    )


def fused(recording, name, noise=NOISE, begin=None, **options):
    return sd.fuse(
        recording,
        name,
        start=begin or start(recording),
        noise=noise,
        covariance=True,
        options=options,
    )


# ---- a textbook: position, velocity and accelerometer bias in one Kalman filter, attitude and gyro
# bias in another


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
    K[gained or len(P) :] = 0
    keep = np.eye(len(P)) - K @ H
    return K, keep @ P @ keep.T + K @ R @ K.T


def textbook(recording, begin, considered):
    """Two linear filters over a measured attitude, in a local frame; yields (lla, v, C, b_a, b_g,
    variances of p v a theta g).

    The first is a Schmidt-Kalman filter: the error of the known attitude, the gyro bias that turns it
    and the share by which they shorten the force stand in its covariance, and get no gain. Where they are not `considered` it is the
    chapter's, to which the known attitude is exact.
    """
    position, attitude = recording.sources
    known = C = Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix()
    lla, v, b_a, b_g = np.array(begin.lla), np.array(begin.v_n), np.zeros(3), np.zeros(3)
    variances = np.square(begin.std)
    P, S = (
        np.diag(np.r_[variances[:6], variances[9:12], variances[6:9], variances[12:], 1.0]),
        np.diag(np.r_[variances[6:9], variances[12:]]),
    )
    O, o, I = np.zeros((3, 3)), np.zeros((3, 1)), np.eye(3)
    fade_a, fade_g = np.exp(-NOISE.accel_decay * 0.05), np.exp(-NOISE.gyro_decay * 0.05)
    for t, dt, dtheta, dv in zip(*recording.imu):
        r, a = dtheta - b_g * dt, dv - b_a * dt
        sine, cosine, M, N = place(lla[0], lla[2])
        ie_n, ie_d, w0, w1, w2 = rotation_rates(v[0], v[1], sine, cosine, M, N)
        w_in, w_v = np.array([w0, w1, w2]), np.array([w0 + ie_n, w1, w2 + ie_d])
        middle = known @ Rotation.from_rotvec(r / 2).as_matrix()
        f = known @ (I + skew(r) / 2 + skew(r) @ skew(r) / 6) @ a / dt
        tilted = considered * P[9:12, 9:12]
        lacking = ((np.trace(tilted) * I - tilted) @ f / 2)[:, None]
        Phi, Q = step_of(
            np.block(
                [
                    [O, I, O, O, O, o],
                    [O, -skew(w_v), -middle, -considered * skew(f), O, lacking],
                    [O, O, -NOISE.accel_decay * I, O, O, o],
                    [O, O, O, O, -middle, o],
                    [np.zeros((4, 16))],
                ]
            ),
            np.diag(
                np.r_[np.repeat([0, NOISE.accel**2, NOISE.accel_bias**2, NOISE.gyro**2, 0], 3), 0]
            ),
            dt,
        )
        P = Phi @ P @ Phi.T + Q
        Phi, Q = step_of(
            np.block([[-skew(w_in), -middle], [O, -NOISE.gyro_decay * I]]),
            np.diag(np.repeat([NOISE.gyro**2, NOISE.gyro_bias**2], 3)),
            dt,
        )
        S = Phi @ S @ Phi.T + Q
        change = (f + np.array([0, 0, gravity(sine, lla[2])]) - np.cross(w_v, v)) * dt
        lla, v = displace_lla(lla, (v + change / 2) * dt), v + change
        turn = lambda D: (
            Rotation.from_rotvec(-w_in * dt).as_matrix() @ D @ Rotation.from_rotvec(r).as_matrix()
        )
        known, C, b_a, b_g = turn(known), turn(C), b_a * fade_a, b_g * fade_g
        for row in np.flatnonzero(np.abs(position.t - t) < 1e-6):
            K, P = corrected(P, np.eye(3, 16), np.diag(position.std[row] ** 2), 9)
            dx = K @ displacement(position.y[row], lla)
            lla, v, b_a = displace_lla(lla, dx[:3]), v + dx[3:6], b_a + dx[6:9]
        for row in np.flatnonzero(np.abs(attitude.t - t) < 1e-6):
            measured, level = (
                Rotation.from_euler("ZYX", attitude.y[row][::-1]),
                Rotation.from_euler("z", attitude.y[row][2]).as_matrix(),
            )
            R_known = level @ np.diag(attitude.std[row] ** 2) @ level.T
            K, S = corrected(S, np.eye(3, 6), R_known)
            shared = P[:9, 15]
            P = block_diag(P[:9, :9], R_known, S[3:, 3:], 1.0)
            P[:9, 15] = P[15, :9] = shared
            dx = K @ (measured * Rotation.from_matrix(C).inv()).as_rotvec()
            C, b_g, known = (
                Rotation.from_rotvec(dx[:3]).as_matrix() @ C,
                b_g + dx[3:],
                measured.as_matrix(),
            )
        p, s = np.diag(P), np.diag(S)
        yield lla, v, C, b_a, b_g, np.r_[p[:6], s[:3], p[6:9], s[3:]]


@pytest.mark.parametrize("how", ["considered", "neglected"])
@pytest.mark.parametrize("rate", [2.0, 0.2])
def test_it_is_two_textbook_filters_beside_each_other(rate, how):
    """20 s at 20 Hz: coning and sculling (here below 1e-6), the gradient of gravity and the
    coupling of velocity into attitude are left out there.

    With a record in 5 s the errors of the known attitude are held over five position fixes, which
    correct what they did.
    """
    recording = recorded(rate)
    solution = fused(recording, "indirect-ahrs-closed", bias="decaying", attitude_error=how)
    lla, v, C, b_a, b_g, variance = (
        np.array(part) for part in zip(*textbook(recording, start(recording), how == "considered"))
    )
    deviation = np.sqrt(variance)
    assert np.abs(displacement(solution.trajectory.lla, lla) / deviation[:, :3]).max() < 2e-3
    assert np.abs((solution.trajectory.v_n - v) / deviation[:, 3:6]).max() < 2e-3
    assert (
        solution.trajectory.rotation * Rotation.from_matrix(C).inv()
    ).magnitude().max() < 2e-3 * deviation[:, 6:9].min()
    assert (
        np.abs((np.c_[solution.b_a, solution.b_g] - np.c_[b_a, b_g]) / deviation[:, 9:]).max()
        < 2e-3
    )
    assert np.abs(solution.trajectory.std / deviation - 1).max() < 1e-3


# ---- the three against each other


def differences(a, b):
    """Largest differences of position, velocity, attitude and biases over the standard
    deviations of `b`."""
    deviation = b.trajectory.std
    parts = (
        displacement(a.trajectory.lla, b.trajectory.lla),
        a.trajectory.v_n - b.trajectory.v_n,
        (a.trajectory.rotation * b.trajectory.rotation.inv()).as_rotvec(),
        a.b_a - b.b_a,
        a.b_g - b.b_g,
    )
    return [np.abs(part / deviation[:, 3 * k : 3 * k + 3]).max() for k, part in enumerate(parts)]


@pytest.mark.parametrize("bias", ["random-walk", "decaying"])
def test_feed_forward_and_feedback_agree_where_the_error_model_is_linear(bias):
    recording = recorded(gnss=Gnss(lever_arm=(0.3, -0.2, -0.5)))
    begin = start(recording)._replace(b_a=(0.05, -0.03, 0.04), b_g=(1e-3, -2e-3, 1e-3))
    first, second = (
        fused(recording, name, begin=begin, bias=bias)
        for name in ("indirect-ahrs-open", "indirect-ahrs-closed")
    )
    assert (
        max(differences(first, second)) < 0.02
        and np.abs(first.trajectory.std / second.trajectory.std - 1).max() < 5e-3
    )
    assert np.abs(first.columns["ins_error_down [m]"]).max() > 1  # the INS itself is elsewhere


@pytest.mark.parametrize("bias", ["random-walk", "decaying"])
def test_the_direct_filter_is_the_feedback_one_where_the_body_does_not_turn(bias):
    recording = recorded(motion=straight())
    first, second = (
        fused(recording, name, bias=bias) for name in ("direct-ahrs", "indirect-ahrs-closed")
    )
    assert max(differences(first, second)) < 0.01


def test_where_it_turns_the_direct_filter_differs_by_what_its_covariance_has_more():
    """Errors of the rates at the known attitude are independent of the others, so the squared
    difference is the difference of the variances.

    100 s with a time constant of about 4 s and two axes are some 50 degrees of freedom: a standard
    deviation of 0.2.
    """
    recording = recorded(1.0, seconds=100.0)
    first, second = (
        fused(recording, name, bias="decaying") for name in ("direct-ahrs", "indirect-ahrs-closed")
    )
    late = first.t > 10
    square = (first.trajectory.rotation * second.trajectory.rotation.inv()).as_rotvec()[
        late, :2
    ] ** 2
    expected = (first.trajectory.std**2 - second.trajectory.std**2)[late, 6:8]
    assert 0.4 < square.mean() / expected.mean() < 1.6 and (expected > 0).all()
    assert np.abs(displacement(first.trajectory.lla, second.trajectory.lla)).max() < 0.01


def test_open_loop_columns_are_what_the_raw_ins_is_off():
    """With exact fixes: the INS takes only the initial bias off, so a constant rest of it moves
    the INS by b t^2/2."""
    recording = recorded()
    off = np.array([0.05, -0.04, 0.03])
    raw = replace(
        recording, imu=recording.imu._replace(dv=recording.imu.dv + off * recording.imu.dt[:, None])
    )
    solution = fused(raw, "indirect-ahrs-open")
    shift = np.stack(
        [solution.columns[f"ins_error_{axis} [m]"] for axis in ("north", "east", "down")], axis=1
    )
    assert (
        np.linalg.norm(shift[-1]) == pytest.approx(np.linalg.norm(off[2:]) * 200, abs=12)
        and np.abs(shift[0]).max() < 2
    )


@pytest.mark.parametrize("correlation", [-1.0, np.inf, np.nan])
def test_an_impossible_correlation_is_refused(correlation):
    with pytest.raises(
        DataError, match=f"correlation is {correlation} s; it must be a finite number, 0 or more"
    ):
        fused(recorded(), "direct-ahrs", correlation=correlation)


def test_with_errors_of_the_imu_as_states_the_covariance_stays_one():
    """The loop couples those states into P alone: what is considered must not contradict it."""
    drive = sd.simulate("car", 120.0, "dmu10", 31, attitude=Ahrs())
    found = sd.fuse(drive, "indirect-ahrs-closed", covariance=True, every=100)
    assert found.covariance.shape[1] > 15
    scale = 1 / np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    correlation = found.covariance * scale[:, :, None] * scale[:, None, :]
    assert np.linalg.eigvalsh(correlation).min() > 0


def test_an_unknown_treatment_of_attitude_errors_is_refused():
    with pytest.raises(
        DataError, match="attitude_error is 'ignored'.*; it must be one of considered, neglected"
    ):
        fused(recorded(), "direct-ahrs", attitude_error="ignored")


def test_which_of_them_need_an_attitude():
    assert {name for name in filters.names() if filters.find(name).needs == ("attitude",)} == {
        *FED,
        "fixed-gain",
    }
    assert filters.find("direct-euler").needs == ()
