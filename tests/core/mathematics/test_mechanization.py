"""Mechanization with a perfect IMU against closed forms, geodesics of pyproj and trajectories of
pyins.

The height is reset where a run is long: the vertical channel is unstable.
"""

import math

import numba
import numpy as np
import pymap3d
import pyproj
import pytest
from ins_equations import (
    DEG,
    RATE,
    cross_matrix,
    derivatives,
    gravity,
    gravity_north,
    radii,
    rates_of_frame,
)
from pymap3d.latitude import geodetic2isometric
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from strapdown.core.mathematics.mechanization import compensate, mechanize, stationary_increments
from strapdown.core.mathematics.rotation import rotate_right

HOLD_NOTHING, HOLD_HEIGHT = 0, 1


@numba.njit
def drive(lla, v, C, increments, dt, compensated, hold, track):
    """Advance lla, v and C by rows of increments (six columns, one row is used again and again);
    keep positions and velocities in `track`."""
    u, dv_n, previous, height = np.zeros(6), np.zeros(3), np.zeros(7), lla[2]
    for k in range(len(track)):
        sample = increments[k % len(increments)]
        for i in range(6):
            u[i] = sample[i]
        if compensated:
            compensate(sample[0:3], sample[3:6], dt, previous, u)
            for i in range(6):
                previous[i] = sample[i]
            previous[6] = dt
        mechanize(lla, v, C, (u[0], u[1], u[2]), (u[3], u[4], u[5]), dt, dv_n)
        if hold == HOLD_HEIGHT:  # the vertical channel is unstable: e-fold in 570 s
            lla[2], v[2] = height, 0.0
        for i in range(3):
            track[k, i], track[k, 3 + i] = lla[i], v[i]


def run(lla, v, C, increments, dt, steps, compensated=True, hold=HOLD_NOTHING):
    """(lla, v, C, track) after `steps` samples."""
    lla, v, C, track = np.array(lla, float), np.array(v, float), np.array(C), np.empty((steps, 6))
    drive(
        lla, v, C, np.atleast_2d(np.asarray(increments, float)), float(dt), compensated, hold, track
    )
    return lla, v, C, track


def attitude(roll, pitch, heading):
    return Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True).as_matrix()


def at_rest(lat, h, C, dt):
    """Increments of a perfect IMU at rest: Earth rate and the reaction to gravity."""
    return (
        np.r_[
            C.T @ [RATE * math.cos(lat), 0, -RATE * math.sin(lat)],
            C.T @ [-gravity_north(lat, h), 0, -gravity(lat, h)],
        ]
        * dt
    )


def metres(lla, other):
    """Distance between two geodetic positions."""
    return np.linalg.norm(
        np.subtract(
            pymap3d.geodetic2ecef(*lla, deg=False), pymap3d.geodetic2ecef(*other, deg=False)
        )
    )


def angle(C, other):
    return np.linalg.norm(Rotation.from_matrix(C @ other.T).as_rotvec())


@pytest.mark.parametrize(
    "lat, rph",
    [
        (47.0, (10.0, -20.0, 130.0)),
        (-75.0, (0.0, 80.0, -30.0)),
        (0.0, (180.0, 0.0, 0.0)),
        (88.0, (0.0, 0.0, 359.0)),
    ],
)
def test_a_day_at_rest(lat, rph):
    lla, C, dt = np.array([lat * DEG, 1.0, 500.0]), attitude(*rph), 0.1
    end, v, C_end, _ = run(
        lla, np.zeros(3), C, at_rest(lla[0], lla[2], C, dt), dt, 864_000, hold=HOLD_HEIGHT
    )
    assert metres(end, lla) < 1e-3 and np.abs(v).max() < 1e-6
    assert angle(C_end, C) < 0.01 * DEG / 3600


@pytest.mark.short
def test_ten_minutes_at_rest_without_help():
    lla, C = np.array([47 * DEG, 1.0, 500.0]), attitude(3, 4, 5)
    end, v, C_end, _ = run(lla, np.zeros(3), C, at_rest(lla[0], lla[2], C, 0.5), 0.5, 1200)
    assert metres(end, lla) < 2e-4 and np.abs(v).max() < 1e-6 and angle(C_end, C) < 1e-10


@pytest.mark.parametrize("error", ["velocity", "tilt"])
def test_an_error_swings_with_the_schuler_period(error):
    """At the equator: v = v0 cos(w t), from a tilt v = tilt sqrt(g R) sin(w t), w = sqrt(g/R);
    the Earth's rotation adds up to 4 %."""
    lla, dt = np.array([0.0, 0.0, 0.0]), 0.5
    R, g = radii(0.0)[0], gravity(0.0, 0.0)
    w, tilt = math.sqrt(g / R), 1e-5
    assert 2 * math.pi / math.sqrt(g / 6.371e6) == pytest.approx(84.4 * 60, rel=2e-3)
    v = [0.1, 0, 0] if error == "velocity" else [0, 0, 0]
    C = np.eye(3) if error == "velocity" else Rotation.from_rotvec([0, tilt, 0]).as_matrix()
    steps = int(2 * 2 * math.pi / w / dt)
    *_, track = run(lla, v, C, at_rest(0.0, 0.0, np.eye(3), dt), dt, steps, hold=HOLD_HEIGHT)
    t = dt * np.arange(1, steps + 1)
    amplitude = 0.1 if error == "velocity" else -tilt * math.sqrt(g * R)
    expected = amplitude * (np.cos(w * t) if error == "velocity" else np.sin(w * t))
    np.testing.assert_allclose(track[:, 3], expected, atol=0.05 * abs(amplitude))


def test_height_errors_grow_with_the_time_constant_of_570_s():
    lla = np.array([45 * DEG, 0.0, 1.0])
    _, _, _, track = run(
        lla, np.zeros(3), np.eye(3), at_rest(lla[0], 0.0, np.eye(3), 0.5), 0.5, 4000
    )
    tau = math.sqrt(6.3675e6 / 9.8062 / 2)
    np.testing.assert_allclose(track[:, 2], np.cosh(0.5 * np.arange(1, 4001) / tau), rtol=0.01)


def coning(half_angle, frequency, dt, steps):
    """Exact integrals of the rate of a body whose x axis draws a cone, without net rotation;
    Savage (1998) part 1."""
    t, W = dt * np.arange(steps + 1), 2 * math.pi * frequency
    cosine, sine = math.sin(half_angle) * np.cos(W * t), math.sin(half_angle) * np.sin(W * t)
    integral = np.stack([-2 * W * math.sin(half_angle / 2) ** 2 * t, cosine, sine], axis=1)
    vector = half_angle * np.stack([0 * t, np.cos(W * t), np.sin(W * t)], axis=1)
    return np.diff(integral, axis=0), Rotation.from_rotvec(vector).as_matrix()


@pytest.mark.short
@pytest.mark.parametrize("compensated", [False, True])
def test_coning_drifts_as_known_without_compensation_and_hardly_with(compensated):
    half_angle, frequency, dt, steps = 1 * DEG, 10.0, 0.005, 2000
    dtheta, truth = coning(half_angle, frequency, dt, steps)
    x = 2 * math.pi * frequency * dt
    lost = 0.5 * math.sin(half_angle) ** 2 * (x - math.sin(x))  # coning of one sample, seen as none
    # what the last sample's 1/12 gives back
    found = math.sin(half_angle) ** 2 * (1 - math.cos(x)) * math.sin(x) / 6
    C, u, previous = truth[0].copy(), np.zeros(6), np.zeros(7)
    for sample in dtheta:
        u[0:3] = sample
        if compensated:
            compensate(sample, np.zeros(3), dt, previous, u)
            previous[0:3], previous[6] = sample, dt
        rotate_right(C, u[0], u[1], u[2])
    drift = Rotation.from_matrix(C @ truth[-1].T).as_rotvec()
    expected = -steps * (lost - found) if compensated else -steps * lost
    assert drift[0] == pytest.approx(
        expected, abs=0.03 * steps * lost * (1 if not compensated else 0.03)
    )
    assert abs(drift[0]) < (0.03 if compensated else 1.1) * steps * lost
    assert np.abs(drift[1:]).max() < 2e-6


@pytest.mark.short
def test_sculling_is_rectified_rightly():
    """Roll and side force that swing together push down: on average half of angle times force;
    exactly, the same sampled 20 times finer."""
    half_angle, force, W = 1 * DEG, 10.0, 2 * math.pi * 5

    def velocity(dt, compensated):
        t = np.arange(0, 1 + dt / 2, dt)
        swing = np.stack(
            [
                half_angle * np.sin(W * t),
                0 * t,
                0 * t,
                0 * t,
                -force * np.cos(W * t) / W,
                -gravity(0.8, 0.0) * t,
            ],
            axis=1,
        )
        return run(
            [0.8, 0, 0], [0, 0, 0], np.eye(3), np.diff(swing, axis=0), dt, len(t) - 1, compensated
        )[1][2]

    truth = velocity(0.0005, True)
    assert truth == pytest.approx(0.5 * half_angle * force, rel=0.02)
    without, with_it = abs(velocity(0.01, False) - truth), abs(velocity(0.01, True) - truth)
    assert without > 1e-3 and with_it < 0.05 * without


@pytest.mark.short
@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0])
def test_compensation_is_exact_for_linear_rate_and_force_also_where_dt_changes(ratio):
    """Rates that grow linearly over two samples of different length, against 2000 slices."""
    before, dt = 0.01 * ratio, 0.01
    rate = lambda t: np.array([0.5, -0.3, 0.2]) + np.outer(t, [20.0, 30.0, -40.0])
    force = lambda t: np.array([1.0, -2.0, -9.8]) + np.outer(t, [100.0, 200.0, -300.0])
    whole = lambda f, a, b: f([(a + b) / 2])[0] * (b - a)  # exact: linear
    u = np.zeros(6)
    compensate(
        whole(rate, 0, dt),
        whole(force, 0, dt),
        dt,
        np.r_[whole(rate, -before, 0), whole(force, -before, 0), before],
        u,
    )
    fine = (np.arange(1000) + 0.5) * dt / 1000
    turn, velocity = Rotation.identity(), np.zeros(3)
    for omega, f in zip(rate(fine) * dt / 1000, force(fine) * dt / 1000):
        velocity += (turn * Rotation.from_rotvec(omega / 2)).apply(f)
        turn = turn * Rotation.from_rotvec(omega)
    np.testing.assert_allclose(u[0:3], turn.as_rotvec(), atol=2e-9)  # the correction is 2e-6
    assert np.abs(u[0:3] - whole(rate, 0, dt)).max() > 1e-6
    np.testing.assert_allclose(u[3:6] + 0.5 * np.cross(u[0:3], u[3:6]), velocity, atol=2e-6)
    assert np.abs(u[3:6] - whole(force, 0, dt)).max() > 1e-5


@pytest.mark.short
def test_the_first_sample_is_taken_as_it_is():
    u = np.zeros(6)
    compensate(np.array([1.0, 2, 3]), np.array([4.0, 5, 6]), 0.01, np.r_[np.ones(6), 0.0], u)
    np.testing.assert_array_equal(u, [1, 2, 3, 4, 5, 6])


# latitude (deg), height; velocity; attitude (deg); body rate and specific force; bounds on the
# error of position, velocity and attitude after 10 s
FLIGHTS = {
    "turning east": (
        (-35.0, 9000.0),
        (0.0, 200.0, 0.0),
        (-60.0, 3.0, 90.0),
        (0.06, -0.14, 0.7),
        (1.0, -3.0, -19.0),
        (1e-4, 2e-5, 2e-7),
    ),
    "climbing": (
        (60.0, 5000.0),
        (-120.0, 40.0, -150.0),
        (10.0, 85.0, 180.0),
        (0.06, -0.14, 0.7),
        (12.0, 0.0, -4.0),
        (3e-4, 1e-5, 1e-7),
    ),
    "near the pole": (
        (85.0, 9000.0),
        (-140.0, 140.0, -10.0),
        (-30.0, 20.0, 315.0),
        (0.0, 0.0, 0.2),
        (2.0, -1.0, -12.0),
        (3e-4, 5e-5, 3e-7),
    ),
    "falling": (
        (10.0, 9000.0),
        (0.0, 0.0, 100.0),
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (5e-5, 2e-6, 1e-8),
    ),
}


@pytest.mark.short
@pytest.mark.parametrize("flight", FLIGHTS)
def test_constant_rate_and_force_agree_with_runge_kutta(flight):
    """The plain equations, integrated to rounding by scipy; 100 Hz."""
    (lat, h), v, rph, omega, f, bounds = FLIGHTS[flight]
    scale, C = np.array([1e-6, 1e-6, 1.0]), attitude(*rph)  # micro-radians: one tolerance for all

    def rate(_, x):
        lla_rate, v_rate, C_rate = derivatives(
            x[:3] * scale, x[3:6], x[6:].reshape(3, 3), np.array(omega), np.array(f)
        )
        return np.r_[lla_rate / scale, v_rate, C_rate.ravel()]

    start = np.array([lat * DEG, 0.5, h])
    true = solve_ivp(
        rate, (0, 10), np.r_[start / scale, v, C.ravel()], method="DOP853", rtol=1e-13, atol=1e-9
    ).y[:, -1]
    end, v_end, C_end, _ = run(start, v, C, np.r_[omega, f] * 0.01, 0.01, 1000)
    errors = (
        metres(end, true[:3] * scale),
        np.abs(v_end - true[3:6]).max(),
        angle(C_end, true[6:].reshape(3, 3)),
    )
    assert np.all(np.array(errors) < bounds), errors


@pytest.mark.parametrize(
    "lat, azimuth, speed", [(47.0, 60.0, 100.0), (-70.0, 250.0, 250.0), (2.0, 5.0, 30.0)]
)
def test_half_an_hour_along_a_geodesic(lat, azimuth, speed):
    """Level flight at height 0, nose along the path; pyproj says where it leads. What is left is
    of first order: rates at the start of a sample."""
    dt, steps = 0.01, 180_000
    t = dt * np.arange(steps + 1)
    geod = pyproj.Geod(ellps="WGS84")
    place = lambda t: geod.fwd(
        np.full(len(t), 10.0), np.full(len(t), lat), np.full(len(t), azimuth), speed * t
    )
    lon, phi, back = place(t)
    middle = 0.5 * (t[1:] + t[:-1])
    phi_m, heading = place(middle)[1] * DEG, (place(middle)[2] + 180) * DEG
    M, N = radii(phi_m)
    v = speed * np.stack([np.cos(heading), np.sin(heading), 0 * heading])
    turn = v[1] * np.tan(phi_m) / N  # of the path against north
    ie = RATE * np.stack([np.cos(phi_m), 0 * phi_m, -np.sin(phi_m)])
    en = np.stack([v[1] / N, -v[0] / M, -turn])
    f = turn * np.stack([-v[1], v[0], 0 * turn]) + np.cross(2 * ie + en, v, axis=0)
    f[2] -= gravity(phi_m, 0.0)
    to_body = Rotation.from_euler("z", heading[:, None]).inv()
    omega = to_body.apply((ie + en).T) + np.stack([0 * turn, 0 * turn, turn], axis=1)
    start = (back[0] + 180) * DEG
    C = Rotation.from_euler("z", start).as_matrix()
    end, v_end, C_end, _ = run(
        [lat * DEG, 10 * DEG, 0],
        speed * C[:, 0],
        C,
        np.c_[omega, to_body.apply(f.T)] * dt,
        dt,
        steps,
        compensated=False,
    )
    assert metres(end, (phi[-1] * DEG, lon[-1] * DEG, 0)) < 5e-7 * speed * t[-1]
    assert np.linalg.norm(v_end) == pytest.approx(speed, abs=1e-4)
    assert math.remainder(
        math.atan2(C_end[1, 0], C_end[0, 0]) - (back[-1] + 180) * DEG, 2 * math.pi
    ) == pytest.approx(0, abs=1e-7)


@pytest.mark.short
@pytest.mark.parametrize("rate, steps", [(100, 2000), (20, 400)])
def test_increments_of_pyins_lead_along_its_trajectory(rate, steps):
    """20 s at low height, where its gravity (first order) and ours agree; velocity and attitude
    swing."""
    from pyins import sim

    t = np.arange(steps + 1) / rate
    wave = lambda period, phase=0.0: np.sin(2 * np.pi * t / period + phase)
    v = np.stack([60 + 8 * wave(7), -40 + 6 * wave(5, 1.0), 1.5 * wave(4, 2.0)], axis=1)
    rph = np.stack([25 * wave(6), 8 * wave(4, 0.5), 140 + 60 * wave(15)], axis=1)
    truth, imu = sim.generate_imu(t, [58.0, 30.0, 20.0], rph, v, "increment")
    lla = truth[["lat", "lon", "alt"]].to_numpy() * [DEG, DEG, 1]
    end, v_end, C_end, _ = run(lla[0], v[0], attitude(*rph[0]), imu.to_numpy()[1:], 1 / rate, steps)
    scale = (100 / rate) ** 2
    assert metres(end, lla[-1]) < 1e-4 * scale
    assert np.abs(v_end - v[-1]).max() < 1e-5 * scale
    assert angle(C_end, attitude(*rph[-1])) < 1e-7 * scale


@pytest.mark.short
@pytest.mark.parametrize("lat", [-89.0, -40.0, 0.0, 60.0, 85.0])
def test_stationary_increments_hold_velocity_and_attitude(lat):
    lla, v, C, u, dv_n = (
        np.array([lat * DEG, 3.0, 3000.0]),
        np.array([90.0, -70.0, 2.0]),
        attitude(20, -60, 200),
        np.zeros(6),
        np.zeros(3),
    )
    v_0, C_0 = v.copy(), C.copy()
    for _ in range(100):
        stationary_increments(lla, v, C, 0.05, u)
        mechanize(lla, v, C, u[:3], u[3:], 0.05, dv_n)
    np.testing.assert_allclose(v, v_0, atol=2e-6)
    assert angle(C, C_0) < 1e-7
    M, N = (R + 3000 for R in radii(lat * DEG))
    assert lla[0] == pytest.approx(lat * DEG + 450 / M, abs=1e-9) and lla[2] == pytest.approx(
        3000 - 10
    )
    np.testing.assert_allclose(dv_n, C @ u[3:6], atol=1e-4)


def test_constant_velocity_follows_the_loxodrome():
    """What stationary increments fly is a rhumb line: latitude by the meridian arc (pyproj),
    longitude by the isometric latitude (pymap3d)."""
    lla, v, C, u, dv_n = (
        np.array([0.3, 3.0, 0.0]),
        np.array([150.0, 200.0, 0.0]),
        np.eye(3),
        np.zeros(6),
        np.zeros(3),
    )
    for _ in range(6000):
        stationary_increments(lla, v, C, 1.0, u)
        mechanize(lla, v, C, u[:3], u[3:], 1.0, dv_n)
        lla[2], v[2] = 0.0, 0.0
    arc = pyproj.Geod(ellps="WGS84").inv(0, 0.3, 0, lla[0], radians=True)[2]
    assert arc == pytest.approx(150.0 * 6000, rel=1e-6)
    isometric = lambda lat: geodetic2isometric(lat, deg=False)
    assert math.remainder(
        lla[1] - 3.0 - 200 / 150 * (isometric(lla[0]) - isometric(0.3)), 2 * math.pi
    ) == pytest.approx(0, abs=1e-6)


@pytest.mark.short
@pytest.mark.parametrize("side", [1, -1])
def test_the_antimeridian_is_crossed(side):
    lla, v, C, u, dv_n = (
        np.array([0.9, side * (math.pi - 5e-6), 100.0]),
        np.array([0.0, side * 50.0, 0.0]),
        np.eye(3),
        np.zeros(6),
        np.zeros(3),
    )
    expected = lla[1] + side * 100 / ((radii(0.9)[1] + 100) * math.cos(0.9)) - side * 2 * math.pi
    for _ in range(200):
        stationary_increments(lla, v, C, 0.01, u)
        mechanize(lla, v, C, u[:3], u[3:], 0.01, dv_n)
        assert abs(lla[1]) <= math.pi
    assert lla[1] == pytest.approx(expected, abs=1e-10)


@pytest.mark.short
@pytest.mark.parametrize(
    "lla, v",
    [
        ((89.999 * DEG, 0, 0), (300.0, 1.0, 0)),
        ((-89.9999 * DEG, 1, 0), (-3000.0, 200.0, 0)),
        ((89.99 * DEG, 1, 1e6), (-2.0, 9e3, 30.0)),
        ((0.5, 0, 4e6), (9e3, -9e3, -5e3)),
    ],
    ids=["over the north pole", "over the south pole", "around the pole", "far out"],
)
def test_a_raw_ins_far_from_its_model_stays_finite(lla, v):
    _, _, C, track = run(lla, v, np.eye(3), at_rest(0.5, 0.0, np.eye(3), 0.1), 0.1, 2000)
    assert np.all(np.isfinite(track)) and np.all(np.isfinite(C))
    assert np.abs(track[:, 0]).max() <= math.pi / 2 and np.abs(track[:, 1]).max() <= math.pi


def textbook_step(lla, v, C, r, a, dt):
    """One step as Savage (1998) and Groves (2013) section 5.4 have it, in vectors: (lla, v, C, f)
    after it, from functions that are not the library's."""
    M, N = (R + lla[2] for R in radii(lla[0]))
    ie, en = rates_of_frame(lla[0], v, M, N)
    s = a + np.cross(r, a) / 2 + np.cross(r, np.cross(r, a)) / 6
    f = (np.eye(3) - cross_matrix((ie + en) * dt) / 2) @ C @ s
    h = lla[2] - v[2] * dt / 2
    g = np.array([gravity_north(lla[0], h), 0.0, gravity(lla[0], h)])
    middle = v + (f + (g - np.cross(2 * ie + en, v)) * dt) / 2
    after = v + f + (g - np.cross(2 * ie + en, middle)) * dt
    mean = (v + after) / 2
    north = mean[0] * dt / M
    ie, en = rates_of_frame(lla[0] + north / 2, mean, M, N)
    turned = Rotation.from_rotvec(-(ie + en) * dt) * Rotation.from_matrix(C)
    moved = np.array([north, mean[1] * dt / (N * np.cos(lla[0] + north / 2)), -mean[2] * dt])
    return lla + moved, after, (turned * Rotation.from_rotvec(r)).as_matrix(), f


@pytest.mark.short
@pytest.mark.parametrize("seed", range(20))
def test_a_step_is_the_textbook_one(seed):
    """At random places, speeds, attitudes and increments. What is of second order in dt, the library
    takes as series: they meet to fourth order in the way of a step over the radius, 1e-15, here."""
    rng = np.random.default_rng(seed)
    lla = np.array([rng.uniform(-85, 85) * DEG, rng.uniform(-3, 3), rng.uniform(-400, 12e3)])
    v, dt = rng.uniform(-250, 250, 3), 10 ** rng.uniform(-3, -1)
    C, r, a = (
        Rotation.random(rng=rng).as_matrix(),
        rng.normal(0, 3, 3) * dt,
        rng.normal(0, 20, 3) * dt,
    )
    expected = textbook_step(lla, v, C, r, a, dt)
    dv_n = np.zeros(3)
    mechanize(lla, v, C, tuple(r), tuple(a), dt, dv_n)
    for found, right, tolerance in zip(
        (lla, v, C, dv_n), expected, ((1e-13, 1e-13, 1e-9), 1e-10, 1e-13, 1e-12)
    ):
        assert (np.abs(found - right) <= tolerance).all()
