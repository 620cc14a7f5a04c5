"""The six-state form driven by the aircraft's model: its truth, its Jacobian, filterpy's
unscented filter, and what its inputs do."""

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, unscented_transform
from flat_flight import GRAVITY, ORIGIN, flat
from flown import acceleration, flown
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.engine import batch
from strapdown.engine.options import run_options
from strapdown.evaluation.metrics import errors
from strapdown.flight import Loop, Sensors, World, fly, trim
from strapdown.flight.aircraft_model.parameters import aircraft
from strapdown.flight.plan import straight
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.imu import ImuSpec
from strapdown_reproductions.mollaei.six_state import filters, particle_filter

NOISE = Noise(gyro=1e-6, accel=0.08, gyro_bias=0.0, accel_bias=0.0, gyro_decay=0.0, accel_decay=0.0)


def through(made, filter, start=None, model=slice(None), **options):
    """(states (n, 6), covariances (n, 6, 6), belief) of a filter that is told its inputs before
    each sample, to use the model in the rows `model`."""
    run = batch.begin(
        made.recording,
        filter,
        run_options(options={"model": 0.05, **options}, start=start or made.start, noise=NOISE),
    )
    flags = np.zeros(len(made.inputs))
    flags[model] = 1
    states, covariances = [], []
    for row, inputs in enumerate(made.inputs):
        run.belief.workspace[filters.INPUTS : filters.INPUTS + 9] = inputs
        run.belief.workspace[filters.INPUTS] = flags[row]
        run.advance(row + 1)
        states.append(np.r_[flat(run.belief.lla, made.start.lla), run.belief.v_n])
        covariances.append(run.belief.P[:6, :6].copy())
    return np.array(states), np.array(covariances), run.belief


def mid_sample(made, row, dt):
    """Attitude C_nb (3, 3) and rates (rad/s) that the increments tell of the middle of a sample."""
    theta = made.recording.imu.dtheta
    before = theta[row - 1] if row else np.zeros(3)
    turn = theta[row] + np.cross(before, theta[row]) / 12
    rotation = Rotation.from_quat(made.truth[row, [7, 8, 9, 6]]) * Rotation.from_rotvec(0.5 * turn)
    return rotation.as_matrix(), turn / dt


def model(made, row, dt):
    """Function x (6,) -> x after sample `row` of a flight, by the midpoint rule with the
    attitude of mid-sample that the increments tell."""
    C, omega = mid_sample(made, row, dt)
    q = Rotation.from_matrix(C).as_quat()[[3, 0, 1, 2]]
    controls, wind = made.inputs[row, 1:5], made.inputs[row, 5:8]

    def advance(x):
        v = x[3:]
        w = v + dt * acceleration(
            q, omega, controls, wind, v + 0.5 * dt * acceleration(q, omega, controls, wind, v)
        )
        return np.r_[x[:3] + 0.5 * dt * (v + w), w]

    return advance


def driven_noise(dt):
    """Covariance of six independent numbers and what they do to the state: velocity noise, which
    moves the position of its sample, and the rest."""
    v = 0.05**2 * dt
    return np.diag([v] * 3 + [v * dt * dt / 12] * 3), np.block(
        [[0.5 * dt * np.eye(3), np.eye(3)], [np.eye(3), np.zeros((3, 3))]]
    )


def test_the_model_flies_what_the_aircraft_flew():
    """Second order in dt: what is left is the rectangle of a sample, and it falls with the
    square of it."""
    error = {}
    for dt in (0.02, 0.01):
        made = flown(6.0, dt)
        states, _, _ = through(made, filters.EKF6)
        error[dt] = np.abs(states - made.flat[1:])[:, 3:].max()
        assert np.ptp(made.flat[:, 3]) > 1 and np.ptp(made.flat[:, 5]) > 1
    assert error[0.01] < 3e-3 and 3 < error[0.02] / error[0.01] < 5, error


def test_the_covariance_follows_the_derivative_of_the_model():
    made, dt = flown(0.05), 0.01
    tilted = made.start._replace(std=(2.0, 1.0, 3.0, 0.5, 0.3, 0.7) + (0.0,) * 9)
    _, covariances, _ = through(made, filters.EKF6, start=tilted)
    P = np.diag(np.array(tilted.std[:6]) ** 2)
    noise, G = driven_noise(dt)
    states = through(made, filters.EKF6)[0]
    for row, x in enumerate([np.r_[0, 0, 0, made.start.v_n], *states[:-1]]):
        advance = model(made, row, dt)
        Phi = np.column_stack([(advance(x + d) - advance(x - d)) / 2e-4 for d in 1e-4 * np.eye(6)])
        P = Phi @ P @ Phi.T + G @ noise @ G.T
        assert np.abs(covariances[row] - P).max() < 1e-7
    # the air holds the velocity: without it the test would show nothing
    assert np.abs(Phi[3:, 3:] - np.eye(3)).max() > 0.03


@pytest.mark.parametrize("options", [{}, dict(sigma="symmetric")])
def test_the_unscented_filter_is_that_of_filterpy(options):
    """Textbook weights and covariances instead of square roots; augmented noise; sigma points
    drawn anew for each fix."""
    made, dt = flown(1.5, fixes=(0.5, 1.0)), 0.01
    states, covariances, belief = through(made, filters.UKF6, **options)
    sets = (1.0, 0.0, 0.0) if options else (0.1, 2.0, 0.0)
    wide, narrow = (MerweScaledSigmaPoints(n, *sets) for n in (12, 6))
    noise, G = driven_noise(dt)
    x, P = np.r_[0, 0, 0, made.start.v_n], np.diag(np.array(made.start.std[:6]) ** 2)
    for row in range(len(made.inputs)):
        points = wide.sigma_points(np.r_[x, np.zeros(6)], block_diag(P, noise))
        advance = model(made, row, dt)
        x, P = unscented_transform(
            np.array([advance(p[:6]) + G @ p[6:] for p in points]), wide.Wm, wide.Wc
        )
        for source, rows in zip(made.recording.sources, (slice(0, 3), slice(3, 6))):
            for k in np.flatnonzero(np.abs(source.t - made.recording.imu.t[row]) < 1e-6):
                y = flat(source.y[k], made.start.lla) if source.kind == "position" else source.y[k]
                points = narrow.sigma_points(x, P)
                z, S = unscented_transform(
                    points[:, rows], narrow.Wm, narrow.Wc, np.diag(source.std[k] ** 2)
                )
                cross = sum(w * np.outer(p - x, p[rows] - z) for w, p in zip(narrow.Wc, points))
                K = cross @ np.linalg.inv(S)
                x, P = x + K @ (y - z), P - K @ S @ K.T
        assert np.abs(states[row] - x).max() < 1e-7 and np.abs(covariances[row] - P).max() < 1e-7
    assert belief.workspace[0] == 0


def test_one_component_is_the_extended_filter_there_too_and_the_flag_alone_decides():
    made = flown(1.0, fixes=(0.4,))
    for rows in (slice(None), slice(50, None), slice(0, 0)):
        (one, P, _), (other, Q, _) = (
            through(made, filters.EKF6, model=rows),
            through(made, filters.PKF6, model=rows, components=1),
        )
        assert np.abs(one - other).max() < 1e-9 and np.abs(P - Q).max() < 1e-9
    by_imu, by_model = (
        through(made, filters.EKF6, model=rows)[1][-1] for rows in (slice(0, 0), slice(None))
    )
    assert by_model[3, 3] < 0.8 * by_imu[3, 3]  # the air holds the velocity, and the model knows it


def tangent(made, reading, airspeed):
    """Function (attitude, rates, controls, wind, v) -> m/s^2, NED: the aircraft's acceleration to
    first order about level flight along the start's heading, by differences of `evaluate`; and its
    attitude and specific force there."""
    at = trim(
        aircraft("aerosonde"), airspeed, origin=ORIGIN, course=made.start.rph[2], earth="flat"
    )
    q0, C0 = at.state[6:10], Rotation.from_quat(at.state[[7, 8, 9, 6]]).as_matrix()
    x0 = np.r_[at.state[3:6], at.state[10:17]]

    def of(x, q):
        return acceleration(q, x[3:6], x[6:10], np.zeros(3), x[:3])

    def slopes(x, q):
        return np.stack([of(x + h, q) - of(x - h, q) for h in 1e-4 * np.eye(10)], 1) / 2e-4

    def tilted(h):
        q = (Rotation.from_matrix(C0) * Rotation.from_rotvec(h)).as_quat()[[3, 0, 1, 2]]
        return of(x0, q)

    a0, S = of(x0, q0), slopes(x0, q0)
    T = np.stack([tilted(h) - tilted(-h) for h in 1e-4 * np.eye(3)], 1) / 2e-4
    level = np.array([1.0, 0, 0, 0])  # axes of the body as those of the map
    b0 = np.r_[C0.T @ x0[:3], x0[3:]]
    f0, F = of(b0, level) - [0, 0, GRAVITY], slopes(b0, level)

    def act(C, omega, controls, wind, v):
        if reading == "trim":
            off = np.r_[C.T @ (v - wind), omega, controls] - b0
            return C @ (f0 + F @ off) + [0, 0, GRAVITY]
        M = C0.T @ C
        phi = 0.5 * np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
        off = np.r_[v - wind, omega, controls] - x0
        return a0 + S @ off + T @ phi * (reading == "once")

    return act, C0, f0


@pytest.mark.parametrize("reading", ["trim", "once", "held"])
def test_a_process_linearised_at_a_trim_is_the_tangent_of_the_aircraft(reading):
    """State and covariance over a second of steps of the controls, fixes on the way, about a trim
    2 m/s slower: against a Kalman filter of the aircraft's derivatives there."""
    made, dt = flown(1.0, fixes=(0.4,)), 0.01
    states, covariances, _ = through(made, filters.EKF6, linearised=reading, airspeed=23.0)
    act, _, _ = tangent(made, reading, 23.0)
    noise, G = driven_noise(dt)
    x, P = np.r_[0, 0, 0, made.start.v_n], np.diag(np.array(made.start.std[:6]) ** 2)
    for row, inputs in enumerate(made.inputs):
        C, omega = mid_sample(made, row, dt)

        def advance(x):
            go = lambda v: act(C, omega, inputs[1:5], inputs[5:8], v)
            w = x[3:] + dt * go(x[3:] + 0.5 * dt * go(x[3:]))
            return np.r_[x[:3] + 0.5 * dt * (x[3:] + w), w]

        Phi = np.column_stack([(advance(x + d) - advance(x - d)) / 2 for d in np.eye(6)])
        x, P = advance(x), Phi @ P @ Phi.T + G @ noise @ G.T
        for source, H in zip(made.recording.sources, (np.eye(6)[:3], np.eye(6)[3:])):
            for k in np.flatnonzero(np.abs(source.t - made.recording.imu.t[row]) < 1e-6):
                y = flat(source.y[k], made.start.lla) if source.kind == "position" else source.y[k]
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(source.std[k] ** 2))
                x, P = x + K @ (y - H @ x), (np.eye(6) - K @ H) @ P
        assert np.abs(states[row] - x).max() < 1e-5 and np.abs(covariances[row] - P).max() < 1e-6
    # the readings are three, and none is the filter that linearises at its estimate
    for other in ({}, *(dict(linearised=r, airspeed=23.0) for r in ("trim", "once", "held"))):
        if other.get("linearised") != reading:
            assert np.abs(through(made, filters.EKF6, **other)[0][-1] - x).max() > 2e-3


def test_driven_by_the_imu_the_readings_differ_by_the_attitude_alone():
    """`trim` is the filter itself; `held` turns the force by the trim's attitude, `once` by that
    and the first order of what the attitude is off it."""
    made, dt = flown(1.5), 0.01
    none = dict(model=slice(0, 0))
    plain = through(made, filters.EKF6, **none)[0]
    at_trim = through(made, filters.EKF6, linearised="trim", airspeed=23.0, **none)[0]
    assert np.array_equal(at_trim, plain)
    for reading in ("once", "held"):
        _, C0, f0 = tangent(made, reading, 23.0)
        x, before = np.r_[0, 0, 0, made.start.v_n], np.zeros((2, 3))
        for row, (theta, dv) in enumerate(zip(made.recording.imu.dtheta, made.recording.imu.dv)):
            f = dv + (np.cross(before[0], dv) + np.cross(before[1], theta)) / 12
            M, before = C0.T @ mid_sample(made, row, dt)[0], np.array([theta, dv])
            phi = 0.5 * np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
            dv = C0 @ (f + np.cross(phi, f0) * dt * (reading == "once")) + [0, 0, GRAVITY * dt]
            x = np.r_[x[:3] + dt * x[3:] + 0.5 * dt * dv, x[3:] + dv]
        found = through(made, filters.EKF6, linearised=reading, airspeed=23.0, **none)[0][-1]
        assert np.abs(found - x).max() < 1e-6 < 5e-3 < np.abs(found - plain[-1]).max()


def test_one_component_by_sigma_points_is_the_unscented_filter_of_the_symmetric_set():
    """(37) to (39) beside (23) to (25): where the model predicts, with fixes, and where the IMU
    does; and it is not the component that is linearised at its mean."""
    made = flown(1.0, fixes=(0.4,))
    wide = made.start._replace(std=(2.0,) * 3 + (3.0,) * 3 + (1e-6,) * 9)
    for rows in (slice(None), slice(0, 0)):
        common = dict(start=wide, model=rows)
        (one, P, _), (other, Q, belief), (linear, _, _) = (
            through(made, filters.UKF6, sigma="symmetric", **common),
            through(made, filters.PKF6, components=1, transition="sigma-points", **common),
            through(made, filters.PKF6, components=1, **common),
        )
        assert np.abs(one - other).max() < 1e-9 and np.abs(P - Q).max() < 1e-9
        assert belief.workspace[2] == 0  # nothing was repaired
        assert (np.abs(linear - other).max() > 1e-3) == (rows == slice(None))


def test_components_by_sigma_points_are_a_bank_of_unscented_filters():
    """Without fixes each of three components goes its own way, as an unscented filter does that
    starts with its mean and covariance."""
    made, count = flown(0.3), 3
    wide = made.start._replace(std=(2.0,) * 3 + (3.0,) * 3 + (1e-6,) * 9)
    options = dict(components=count, kernel=0.6, transition="sigma-points")

    def bank(belief):
        return particle_filter.SLOTS.views(belief.workspace)["COMPONENTS"][: 42 * count].reshape(
            count, 42
        )

    begun = batch.begin(
        made.recording, filters.PKF6, run_options(options=options, start=wide, noise=NOISE)
    ).belief
    ended = through(made, filters.PKF6, start=wide, **options)[2]
    for mine, own in zip(bank(begun).copy(), bank(ended)):
        x, P = unscented(made, mine[:6], mine[6:].reshape(6, 6))
        assert np.abs(own[:6] - x).max() < 1e-8
        assert np.abs(own[6:].reshape(6, 6) - P).max() < 1e-8


def unscented(made, x, P):
    """Mean and covariance after the flight of one unscented filter with the 24 points of equal
    weight of (37) to (39)."""
    noise, G = driven_noise(0.01)
    points = MerweScaledSigmaPoints(12, 1.0, 0.0, 0.0)
    for row in range(len(made.inputs)):
        advance = model(made, row, 0.01)
        spread = points.sigma_points(np.r_[x, np.zeros(6)], block_diag(P, noise))
        moved = np.array([advance(p[:6]) + G @ p[6:] for p in spread])
        x, P = unscented_transform(moved, points.Wm, points.Wc)
    return x, P


def test_where_the_spread_is_wide_points_and_components_find_the_mean_that_the_derivative_misses():
    """Velocities of 4 m/s about the truth, 0.6 s of the model: against Gauss-Hermite quadrature
    of five nodes per axis."""
    made, sigma = flown(0.6), 4.0
    start = made.start._replace(std=(1e-3,) * 3 + (sigma,) * 3 + (0.0,) * 9)
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    grid, weight = (
        np.stack(np.meshgrid(nodes, nodes, nodes), -1).reshape(-1, 3),
        np.einsum("i,j,k->ijk", *[weights / weights.sum()] * 3).ravel(),
    )
    ends = np.array([np.r_[0, 0, 0, np.array(made.start.v_n) + sigma * g] for g in grid])
    for row in range(len(made.inputs)):
        advance = model(made, row, 0.01)
        ends = np.array([advance(x) for x in ends])
    mean = weight @ ends
    off = {
        (filter.name, *more.values()): np.abs(
            through(made, filter, start=start, **more)[0][-1] - mean
        )[3:].max()
        for filter, more in (
            (filters.EKF6, {}),
            (filters.UKF6, {}),
            (filters.CKF6, {}),
            (filters.PKF6, dict(components=4000)),
            (filters.PKF6, dict(components=1, transition="sigma-points")),
        )
    }
    ekf, *others = off.values()
    assert ekf > 0.1 and max(others) < 0.25 * ekf, off


def test_a_slower_filter_is_told_the_mean_of_the_controls():
    """In a flight without any error the model in the filter's hands errs with the square of its
    step: 20 and 10 Hz; controls of one instant would make that its first power."""
    off = {}
    for rate in (20.0, 10.0):
        flight = fly(
            straight(higher=10.0, faster=2.0),
            filters.EKF6,
            duration=6.0,
            world=World(earth="flat"),
            sensors=Sensors(imu=ImuSpec("ideal", Triad(), Triad()), outage="0:"),
            loop=Loop(
                prediction="model",
                inputs=filters.INPUTS,
                start_std=(0.0,) * 15,
                feedback="truth",
                filter_rate=rate,
            ),
        )
        off[rate] = np.abs(errors(flight.solution, flight.recording.reference).velocity).max()
    assert off[20.0] < 0.01 and 3.5 < off[10.0] / off[20.0] < 5.5, off


def test_without_fixes_the_weights_stay():
    made = flown(0.3)
    _, _, belief = through(made, filters.PKF6, components=50)
    assert belief.workspace[0] == 50 and belief.workspace[1] == belief.workspace[2] == 0
