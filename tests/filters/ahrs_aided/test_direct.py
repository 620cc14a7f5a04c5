"""Direct filters with Euler angles: their covariance, their integration, their agreement with
the closed loop, and pitch near 90 deg."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import ahrs, flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.core.loop.contract import Imu, InitialState, Noise, compile_kernel
from strapdown.data.recording import Recording
from strapdown.filters.ahrs_aided import direct_ahrs, known_attitude
from strapdown.filters.ahrs_aided.known_attitude import ANGLES, STEEP_PITCH
from strapdown.geometry.geodesy import displace_lla, displacement

pytestmark = pytest.mark.short
DEG = np.pi / 180
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
STILL = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
TURN, FORCE = np.array([0.3, -0.4, 0.5]), np.array([1.0, 2.0, -11.0])  # rad/s, m/s^2
RPH = (0.4, -0.5, 2.8)


def jacobian(rph):
    """Derivative of a small rotation in n by the Euler angles."""
    _, pitch, heading = rph
    return np.array(
        [
            [np.cos(pitch) * np.cos(heading), -np.sin(heading), 0],
            [np.cos(pitch) * np.sin(heading), np.cos(heading), 0],
            [-np.sin(pitch), 0, 1],
        ]
    )


def predicted(x, dt, P=np.eye(15)):
    """(state after a prediction, its P): x is position from a reference (m), velocity, Euler
    angles and biases."""
    filter = filters.find("direct-euler")
    compile_kernel(filter.predict)
    at = np.array([0.8, 0.1, 500.0])
    begin = InitialState(
        0.0,
        tuple(displace_lla(at, x[:3])),
        tuple(x[3:6]),
        tuple(x[6:9]),
        tuple(x[9:12]),
        tuple(x[12:]),
        (1.0,) * 15,
    )
    belief = filter.start(begin, STILL)
    belief.P[:] = P
    filter.predict(belief, np.r_[TURN, FORCE] * dt, dt, STILL)
    return np.r_[
        displacement(belief.lla, at),
        belief.v_n,
        belief.workspace[ANGLES],
        belief.b_a,
        belief.b_g,
    ], belief.P


def test_the_covariance_is_that_of_a_filter_in_euler_angles_through_their_jacobian():
    """The Euler model differentiated numerically, mapped at both ends, against the transition in
    use: equal to second order in dt."""
    x = np.r_[0, 0, 0, 30.0, -20, 2, RPH, 0.05, -0.02, 0.03, 1e-3, -2e-3, 1e-3]
    root = np.random.default_rng(2).standard_normal((15, 15)) * np.repeat([1, 1, 0.1, 0.1, 0.1], 3)
    P = root @ root.T
    steps = np.repeat([10.0, 1.0, 1e-3, 1.0, 1e-2], 3)
    off = {}
    for dt in (0.02, 0.01):
        column = lambda k: (
            (
                predicted(x + steps * (np.arange(15) == k), dt)[0]
                - predicted(x - steps * (np.arange(15) == k), dt)[0]
            )
            / (2 * steps[k])
        )
        Phi = np.column_stack([column(k) for k in range(15)])
        before, after = np.eye(15), np.eye(15)
        before[6:9, 6:9], after[6:9, 6:9] = jacobian(RPH), jacobian(predicted(x, dt)[0][6:9])
        mapped = after @ Phi @ np.linalg.inv(before)
        found, expected = predicted(x, dt, P)[1], mapped @ P @ mapped.T
        scale = np.sqrt(np.diag(expected))
        off[dt] = np.abs((found - expected) / np.outer(scale, scale)).max()
        assert (
            np.abs(
                after[6:9, 6:9] @ Phi[6:9, 6:9] @ np.linalg.inv(before[6:9, 6:9]) - np.eye(3)
            ).max()
            < 1e-4
            < np.abs(Phi[6:9, 6:9] - np.eye(3)).max()
        )
    assert off[0.02] < 2e-5 and off[0.01] < 0.26 * off[0.02]


def test_the_angles_are_those_of_the_rotation():
    """Ten seconds at 0.7 rad/s: what the closed loop's rotation matrix has but for the rotation
    of n, taken at the beginning of a step (5 m/s^2 for 10 s)."""
    found = []
    for name in ("direct-euler", "closed-loop"):
        filter = filters.find(name)
        compile_kernel(filter.predict)
        belief = filter.start(
            InitialState(
                0.0, (0.8, 0.1, 500.0), (0.0,) * 3, RPH, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
            ),
            STILL,
        )
        for k in range(500):
            filter.predict(belief, np.r_[TURN * np.cos(0.02 * k) * 0.02, 0, 0, -0.2], 0.02, STILL)
        found.append(Rotation.from_matrix(belief.C_nb))
    assert (found[0] * found[1].inv()).magnitude() < 3e-7


def test_the_direct_filter_is_the_closed_loop_to_first_order():
    """The correction is added to the angles and not composed: a difference of second order in
    it, 0.01 rad at the start."""
    recording = flight()
    euler, closed = (
        sd.fuse(
            recording, name, start=start(recording), noise=NOISE, covariance=True, options=options
        )
        for name, options in (("direct-euler", {"bias": "decaying"}), ("closed-loop", {}))
    )
    deviation = closed.trajectory.std
    assert (
        np.abs(displacement(euler.trajectory.lla, closed.trajectory.lla) / deviation[:, :3]).max()
        < 0.01
    )
    assert (
        np.abs(
            (euler.trajectory.rotation * closed.trajectory.rotation.inv()).as_rotvec()
            / deviation[:, 6:9]
        ).max()
        < 0.02
    )
    assert (
        np.abs(
            (np.c_[euler.b_a, euler.b_g] - np.c_[closed.b_a, closed.b_g]) / deviation[:, 9:]
        ).max()
        < 0.02
    )
    assert np.abs(euler.trajectory.std / deviation - 1).max() < 2e-3


@pytest.mark.parametrize("name", ["direct-euler", "direct-ahrs"])
def test_the_angles_stay_within_a_turn(name):
    """The heading goes from 80 through 180 to 240 deg."""
    recording = flight(40.0)
    recording = replace(recording, sources=(*recording.sources, ahrs(recording.reference)))
    stream = sd.Stream(name, start=start(recording), imu="tactical", sources=recording.sources)
    heading = []
    for t, dt, dtheta, dv in zip(*recording.imu):
        stream.step(sd.Sample(float(t), float(dt), tuple(dtheta), tuple(dv)))
        heading.append(stream.belief.workspace[ANGLES][2])
    assert max(np.abs(heading)) <= np.pi and max(heading) > 3.1 and min(heading) < -3.1


def looping(rate=50.0, seconds=24.0):
    """(Recording of a body at rest that pitches through 360 deg twice while it rolls a little,
    Start): exact increments, attitude and position records."""
    n = round(rate * seconds)
    t = np.arange(1, n + 1) / rate
    pitch_rate, roll_rate = 2 * np.pi / 12, 0.02
    r = np.tile(np.array([roll_rate, pitch_rate, 0.0]) / rate, (n, 1))
    C = [Rotation.from_euler("ZYX", [0.3, 0.0, 0.1])]
    for row in r:
        C.append(C[-1] * Rotation.from_rotvec(row))
    C = Rotation.concatenate(C)
    middle = Rotation.from_rotvec(r / 2)
    force = (C[:-1] * middle).inv().apply([0, 0, -9.80738])  # gravity at the place
    every = np.arange(round(rate) - 1, n, round(rate))
    attitude = sd.Source(
        "attitude",
        t[every],
        C[every + 1].as_euler("ZYX")[:, ::-1],
        np.full((len(every), 3), 0.005),
        gate=np.inf,
    )
    position = sd.Source(
        "position",
        t[every],
        np.tile([0.8, 0.1, 500.0], (len(every), 1)),
        np.full((len(every), 3), 1.0),
        gate=np.inf,
    )
    recording = Recording(
        Imu(t, np.full(n, 1 / rate), r, force / rate),
        (position, attitude),
        meta={"grade": "tactical"},
    )
    deviations = tuple(np.repeat([1.0, 0.1, 0.01, 0.01, 1e-5], 3).tolist())
    return (
        recording,
        C,
        InitialState(
            0.0, (0.8, 0.1, 500.0), (0.0,) * 3, (0.1, 0.0, 0.3), (0.0,) * 3, (0.0,) * 3, deviations
        ),
    )


@pytest.mark.filterwarnings("ignore:Gimbal lock")
@pytest.mark.parametrize("name", ["direct-euler", "direct-ahrs"])
def test_pitch_through_90_degrees_is_handled_and_said(name):
    recording, C, begin = looping()
    solution = sd.fuse(recording, name, start=begin, noise=sd.imu("tactical").noise())
    off = (solution.trajectory.rotation * C[1:].inv()).magnitude()
    assert (
        np.isfinite(solution.trajectory.std).all()
        and off.max() < 0.01
        and np.abs(solution.trajectory.v_n).max() < 0.3
    )
    beyond = solution.columns["pitch_beyond_85_deg [s]"]
    pitch = np.abs(np.arcsin(-C.as_matrix()[1:, 2, 0]))
    assert (
        beyond[-1] == pytest.approx((pitch > STEEP_PITCH).sum() / 50, abs=0.2) and beyond[-1] > 0.3
    )
    ((t, text),) = [event for event in solution.events if "pitch" in event[1]]
    assert (
        t == pytest.approx(np.flatnonzero(pitch > STEEP_PITCH)[0] / 50, abs=0.1)
        and "beyond 85 deg for" in text
        and "rotation matrix" in text
    )


@pytest.mark.parametrize("name", ["direct-euler", "direct-ahrs"])
def test_a_fast_tumble_stays_finite(name):
    """35 rad/s at 50 Hz, 40 deg per sample, passes the singularity anywhere."""
    filter = filters.find(name)
    compile_kernel(filter.predict)
    belief = filter.start(
        InitialState(0.0, (0.8, 0.1, 500.0), (0.0,) * 3, RPH, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15),
        NOISE,
    )
    for k in range(200):
        filter.predict(
            belief, np.r_[0.2, 0.7 * np.cos(k), 0.7 * np.sin(k), 0.0, 0.0, -0.2], 0.02, NOISE
        )
        assert (
            np.abs(belief.C_nb.T @ belief.C_nb - np.eye(3)).max() < 1e-9
            and np.isfinite(belief.P).all()
            and abs(belief.workspace[ANGLES][1]) < np.pi / 2 + 1e-9
        )


@pytest.mark.parametrize("rph", [(0.1, 0.2, 0.4), (-0.5, 1.2, 2.0), (1.0, -1.1, -2.5)])
@pytest.mark.parametrize("correlation", [0.0, 3.0])
def test_what_angles_err_by_at_the_known_attitude(rph, correlation):
    """Against T differentiated numerically: its tilt is off the estimated one, while the angles
    change by a small rotation of the body."""
    rph, rate, dt = np.array(rph), np.array([0.02, -0.015, 0.01]), 0.01
    T = lambda a: np.array(
        [
            [1, np.sin(a[0]) * np.tan(a[1]), np.cos(a[0]) * np.tan(a[1])],
            [0, np.cos(a[0]), -np.sin(a[0])],
            [0, np.sin(a[0]) / np.cos(a[1]), np.cos(a[0]) / np.cos(a[1])],
        ]
    )
    J = jacobian(rph)
    tilts = np.linalg.inv(J)[:, :2]  # angles of a tilt about north and east
    derivative = np.stack(
        [(T(rph + 1e-6 * x) - T(rph - 1e-6 * x)) @ rate / 2e-6 for x in tilts.T], axis=1
    )
    record, estimate = (
        np.array([[4e-6, 1e-6], [1e-6, 2e-6]]),
        np.array([[1e-6, 3e-7], [3e-7, 5e-7]]),
    )
    off = record - estimate if correlation == 0 else record
    begin = InitialState(
        0.0, (0.8, 0.1, 300.0), (0.0,) * 3, tuple(rph), (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
    )
    belief = direct_ahrs.start(begin, NOISE, correlation=correlation)
    belief.P[...] = 0.0
    belief.P[6:8, 6:8] = estimate
    belief.workspace[known_attitude.ERROR_NN] = record[0, 0]
    belief.workspace[known_attitude.ERROR_NE] = record[0, 1]
    belief.workspace[known_attitude.ERROR_EE] = record[1, 1]
    belief.workspace[known_attitude.ERROR_DD] = 0.0
    belief.workspace[known_attitude.SINCE_TILT] = since = 0.3
    _, pitch, heading = T(rph) @ rate
    direct_ahrs._doubt_rates(belief, pitch, heading, belief.C_nb.ravel().copy(), np.cos(rph[1]), dt)
    growth = (2 * max(since - dt, correlation) + dt) / dt
    expected = growth * J @ derivative @ off @ derivative.T @ J.T
    expected[:2, :2] += estimate
    np.testing.assert_allclose(belief.P[6:9, 6:9], expected, rtol=1e-5, atol=1e-12)
