"""The two-stage model: its Jacobians against numeric differentiation of the nonlinear equations,
and what is wrong in the printed ones."""

import numpy as np
import pytest
from recordings import flight
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.core.loop.contract import InitialState, Noise
from strapdown.core.mathematics.earth import gravity
from strapdown.engine.prepare import prepare
from strapdown.filters.two_stage.joseph_covariance import of_stages
from strapdown.filters.two_stage.model import (
    from_angles,
    inflate_velocity,
    to_angles,
    turn_attitude,
    turn_velocity,
)

pytestmark = pytest.mark.short
G = 9.8
ANGLES = np.array([0.4, -0.5, 2.2])
QUIET = Noise(0.0, 0.0, 0.0, 0.0, 1 / 30, 1 / 20)


def matrix(angles):
    return Rotation.from_euler("ZYX", np.asarray(angles)[::-1]).as_matrix()


def gradient(function, x, step=1e-5):
    """Columns d function / d x_i by central differences."""
    return np.column_stack(
        [
            (np.asarray(function(x + e)) - function(x - e)) / (2 * step)
            for e in step * np.eye(len(x))
        ]
    )


def rates(x, omega, f):
    """The model in continuous time, Earth at rest: derivative of Euler angles, gyro bias,
    position, velocity in the body, accelerometer bias."""
    (roll, pitch), v = x[:2], x[9:12]
    r = omega - x[3:6]
    T = np.array(
        [
            [1, np.sin(roll) * np.tan(pitch), np.cos(roll) * np.tan(pitch)],
            [0, np.cos(roll), -np.sin(roll)],
            [0, np.sin(roll) / np.cos(pitch), np.cos(roll) / np.cos(pitch)],
        ]
    )
    C = matrix(x[:3])
    return np.r_[
        T @ r, np.zeros(3), C @ v, f - x[12:15] - np.cross(r, v) + C.T @ [0, 0, G], np.zeros(3)
    ]


STATE = np.r_[ANGLES, 0.01, -0.02, 0.03, 100.0, 200.0, -300.0, 20.0, 1.0, -2.0, 0.1, 0.2, -0.1]
OMEGA, FORCE = np.array([0.3, -0.2, 0.4]), np.array([1.0, 0.5, -10.0])


def test_euler_angles_and_small_rotations():
    """J against C(angles + d) = exp(theta) C(angles), and its inverse."""
    theta = lambda a: Rotation.from_matrix(matrix(a) @ matrix(ANGLES).T).as_rotvec()
    J = gradient(theta, ANGLES)
    for column, d in zip(J.T, np.eye(3)):
        np.testing.assert_allclose(from_angles(*ANGLES[1:], *d), column, atol=1e-9)
        np.testing.assert_allclose(to_angles(*ANGLES[1:], *column), d, atol=1e-9)
    assert np.isfinite(to_angles(np.pi / 2, 0.3, 1.0, 0.0, 0.0)).all()


def test_p_between_fixes_is_that_of_the_numerically_differentiated_model():
    """P of one second of constant rates by the kernel, as errors of angles, v_b and biases,
    against the flow of the equations, for both stages."""
    name, dt, steps = "two-stage-ekf", 0.005, 200
    filter = filters.find(name)
    prepare(name, [])
    start = InitialState(
        0.0,
        (0.0, 0.2, 0.0),
        tuple(matrix(ANGLES) @ STATE[9:12]),
        tuple(ANGLES),
        tuple(STATE[12:15]),
        tuple(STATE[3:6]),
        (1.0,) * 15,
    )
    belief = filter.start(
        start,
        QUIET._replace(gyro_decay=0.0, accel_decay=0.0),
        correlation=0.0,
        acceleration=1e6,
        covariance="published",
    )
    rng = np.random.default_rng(2)
    one, two = ([6, 7, 8, 12, 13, 14], [3, 4, 5, 9, 10, 11])
    A = rng.standard_normal((6, 6))
    begin = np.zeros((15, 15))
    begin[np.ix_(one, one)], begin[np.ix_(two, two)] = 1e-4 * A @ A.T, 1e-2 * A @ A.T
    of_stages(belief).P[:] = begin
    for _ in range(steps):
        filter.predict(
            belief,
            np.r_[OMEGA * dt, FORCE * dt],
            dt,
            QUIET._replace(gyro_decay=0.0, accel_decay=0.0),
        )

    def flow(x, parts):
        """The state after a second; stage 2 with the attitude and gyro bias of the nominal path
        (`parts` = 2)."""
        nominal = STATE.copy()
        for _ in range(steps):
            step = lambda y: rates(np.r_[nominal[:6], y[6:]] if parts == 2 else y, OMEGA, FORCE)
            middle = nominal + 0.5 * dt * rates(nominal, OMEGA, FORCE)
            half = x + 0.5 * dt * step(x)
            ahead = rates(np.r_[middle[:6], half[6:]] if parts == 2 else half, OMEGA, FORCE)
            x, nominal = x + dt * ahead, nominal + dt * rates(middle, OMEGA, FORCE)
        return x

    end, T0, T1 = flow(STATE, 1), np.eye(15), np.eye(15)
    for T, angles in ((T0, ANGLES), (T1, end[:3])):
        T[3:6, 3:6], T[6:9, 6:9] = (
            matrix(angles),
            np.column_stack([from_angles(*angles[1:], *d) for d in np.eye(3)]),
        )
    order = [
        6,
        7,
        8,
        12,
        13,
        14,
        0,
        1,
        2,
        3,
        4,
        5,
        9,
        10,
        11,
    ]  # of the library, in the order of STATE
    own = lambda P, T: (np.linalg.inv(T) @ P @ np.linalg.inv(T).T)[np.ix_(order, order)]
    for part, rows in ((1, slice(0, 6)), (2, slice(6, 15))):
        Phi = gradient(lambda x: flow(x, part), STATE)[rows, rows]
        expected = Phi @ own(begin, T0)[rows, rows] @ Phi.T
        scale = np.sqrt(np.diag(expected)) + 1e-12
        assert (
            np.abs((own(belief.P, T1)[rows, rows] - expected) / np.outer(scale, scale)).max() < 2e-3
        )
    assert not belief.P[np.ix_(one, two)].any()


def test_printed_measurement_of_gravity():
    """(6) prints -cos theta sin theta as its third entry, and no g: the specific force of a body
    at rest is C_bn [0 0 -g]."""
    rest = lambda a: matrix(a).T @ [0, 0, -G]
    printed = lambda a: np.array(
        [np.sin(a[1]), -np.cos(a[1]) * np.sin(a[0]), -np.cos(a[1]) * np.sin(a[1])]
    )
    right = lambda a: (
        G * np.array([np.sin(a[1]), -np.cos(a[1]) * np.sin(a[0]), -np.cos(a[1]) * np.cos(a[0])])
    )
    np.testing.assert_allclose(right(ANGLES), rest(ANGLES), atol=1e-12)
    assert (
        np.abs(printed(ANGLES) - rest(ANGLES)).max() > 1
        and abs(G * printed(ANGLES)[2] - rest(ANGLES)[2]) > 1
    )
    H = gradient(rest, ANGLES)  # the rows of the filter, -g C_1i and g C_0i, in Euler angles
    C = matrix(ANGLES)
    J = np.column_stack([from_angles(*ANGLES[1:], *d) for d in np.eye(3)])
    np.testing.assert_allclose(
        np.column_stack([-G * C[1], G * C[0], np.zeros(3)]) @ J, H, atol=1e-8
    )
    assert not np.abs(H[:, 2]).max() > 1e-8


def test_printed_velocity_equation():
    """(9) turns gravity by C_nb; differentiated along a true flight, v_b' + omega x v_b - f is
    gravity turned by C_bn."""
    truth, imu = flight(20.0, 20.0).reference, flight(20.0, 20.0).imu
    v_b = truth.rotation.inv().apply(truth.v_n.copy())
    k = np.flatnonzero((truth.t > 5) & (truth.t < 15))
    row = np.searchsorted(imu.t, truth.t[k] + 1e-6)
    dt = truth.t[k + 1] - truth.t[k - 1]
    change = (v_b[k + 1] - v_b[k - 1]) / dt[:, None]
    rate, force = ((a[row] + a[row - 1]) / (2 * imu.dt[row, None]) for a in (imu.dtheta, imu.dv))
    left = np.mean(change + np.cross(rate, v_b[k]) - force, axis=0)
    g = [0, 0, gravity(np.sin(truth.lla[0, 0]), 500.0)]
    right, printed = (
        np.mean([C @ g for C in Cs], axis=0)
        for Cs in (truth.rotation[k].inv().as_matrix(), truth.rotation[k].as_matrix())
    )
    assert np.abs(left - right).max() < 0.05 and np.abs(left - printed).max() > 1.0


def test_printed_measurement_of_stage_two():
    """(10) has six measured numbers and predicts four; the downward component along the body is
    neither v_D nor all of the velocity."""
    recording = flight()
    from recordings import start

    full, down = (
        sd.fuse(recording, "two-stage-ekf", start=start(recording), options={"velocity": kind})
        for kind in ("full", "down")
    )
    velocity = full.innovations.source == 1
    assert np.isfinite(full.innovations.innovation[velocity]).all()
    assert (
        np.isnan(down.innovations.innovation[velocity][:, 1:]).all()
        and np.isfinite(down.innovations.innovation[velocity][:, 0]).all()
    )
    first = np.flatnonzero(velocity)[0]
    C = full.trajectory.rotation[
        np.searchsorted(full.t, full.innovations.t[first] - 1e-6)
    ].as_matrix()
    assert (
        abs(C[:, 2] @ full.innovations.innovation[first] - down.innovations.innovation[first, 0])
        < 0.01
    )
    assert (down.trajectory.std[-1, 3:5] > 1.2 * full.trajectory.std[-1, 3:5]).all()


def test_p_is_carried_to_other_angles_and_attitudes():
    rng = np.random.default_rng(5)
    A = rng.standard_normal((15, 15))
    P = A @ A.T
    kept, new = P.copy(), ANGLES + [0.1, 0.2, -0.7]
    J, K = (
        np.column_stack([from_angles(*angles[1:], *d) for d in np.eye(3)])
        for angles in (ANGLES, new)
    )
    one = [6, 7, 8, 12, 13, 14]
    turn_attitude(P, *ANGLES[1:], *new[1:])
    T = np.eye(15)
    T[6:9, 6:9] = K @ np.linalg.inv(J)
    np.testing.assert_allclose(
        P[np.ix_(one, one)], (T @ kept @ T.T)[np.ix_(one, one)], rtol=1e-9, atol=1e-9
    )
    turn_velocity(P, matrix(ANGLES), matrix(new))
    T = np.eye(15)
    T[3:6, 3:6] = matrix(new) @ matrix(ANGLES).T
    two = [0, 1, 2, 3, 4, 5, 9, 10, 11]
    np.testing.assert_allclose(
        P[np.ix_(two, two)], (T @ kept @ T.T)[np.ix_(two, two)], rtol=1e-9, atol=1e-9
    )
    moved, before = np.array([0.3, -0.2, 0.1]), P[3:6, 3:6].copy()
    inflate_velocity(P, moved)
    np.testing.assert_allclose(
        P[3:6, 3:6] - before, np.outer([0.3, -0.2, 0.1], [0.3, -0.2, 0.1]), atol=1e-12
    )
    assert not moved.any()
