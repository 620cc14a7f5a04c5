"""Truth and ideal increments against closed forms, pyins, and an integration in Earth-fixed
coordinates written here."""

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.sim.trajectory import (
    DEG,
    EARTH_RATE,
    FLATTENING,
    GM,
    SEMI_MAJOR,
    ZONAL,
    Motion,
    demo_flight,
    gravity,
    gravity_north,
    increments,
    radii,
    ramp,
    ramp_rate,
    records,
    sample,
    static,
)

DEMO = demo_flight()
HIGH = Motion(
    "high and fast",
    (DEG * -78.0, DEG * 179.9, 9000.0),
    lambda t: (150 + 20 * np.sin(t / 7), 200 + 10 * np.cos(t / 5), 5 * np.sin(t / 11)),
    lambda t: (0.5 * np.sin(t / 3), 1.2 + 0.1 * np.sin(t / 2), 2.0 + 0.3 * t),
)
STILL = static((DEG * 50, DEG * 8, 300.0), (0.1, -0.2, 2.5))


def exact_gravity(lat, alt):
    """Normal gravity (north, down) from the ellipsoidal potential, Heiskanen & Moritz (1967)
    section 2-8: no series in height."""
    a, f, omega, gm = 6378137.0, 1 / 298.257223563, 7.292115e-5, 3.986004418e14
    b, linear = a * (1 - f), np.sqrt(a**2 - (a * (1 - f)) ** 2)
    normal = a / np.sqrt(1 - f * (2 - f) * np.sin(lat) ** 2)
    p, z = (normal + alt) * np.cos(lat), (normal * (1 - f) ** 2 + alt) * np.sin(lat)

    def potential(p, z):
        d = p * p + z * z - linear**2
        u = np.sqrt(d / 2 * (1 + np.sqrt(1 + 4 * linear**2 * z * z / d**2)))
        sin2 = (z / u) ** 2
        q = lambda u: 0.5 * ((1 + 3 * u * u / linear**2) * np.arctan(linear / u) - 3 * u / linear)
        return gm / linear * np.arctan(linear / u) + 0.5 * omega**2 * (
            a * a * q(u) / q(b) * (sin2 - 1 / 3) + p * p
        )

    step = 1e-20  # along the imaginary axis: differences would lose the north component
    by_p = potential(p + 1j * step, z).imag / step
    by_z = potential(p, z + 1j * step).imag / step
    return -np.sin(lat) * by_p + np.cos(lat) * by_z, -np.cos(lat) * by_p - np.sin(lat) * by_z


@pytest.mark.parametrize("lat", [-80.0, -47.0, -20.0, 0.0, 10.0, 30.0, 45.0, 75.0, 80.0, 90.0])
@pytest.mark.parametrize("alt", [-100.0, 0.0, 1000.0, 10000.0, 20000.0])
def test_gravity_is_that_of_the_ellipsoid(lat, alt):
    """North to 1e-9 m/s^2, which the terms left out there would bring on the ellipsoid."""
    north, down = exact_gravity(DEG * lat, alt)
    assert gravity(DEG * lat, alt) == pytest.approx(down, abs=1e-6 if alt < 2e4 else 4e-6)
    assert gravity_north(DEG * lat, alt) == pytest.approx(north, abs=1e-9)
    assert gravity_north(DEG * lat, alt) == -gravity_north(-DEG * lat, alt)
    if alt >= 1000 and 0 < abs(lat) < 90:
        assert north * lat < 0 and abs(north) > 4e-7  # towards the equator, and seen here


def test_the_zonal_terms_are_those_of_the_ellipsoid():
    """J_2 by its closed form (Heiskanen & Moritz 1967, 2-90), the others of it (2-92)."""
    e2 = FLATTENING * (2 - FLATTENING)
    second = np.sqrt(e2 / (1 - e2))
    m = EARTH_RATE**2 * SEMI_MAJOR**3 * (1 - FLATTENING) / GM
    q = ((1 + 3 / second**2) * np.arctan(second) - 3 / second) / 2
    j2 = e2 / 3 * (1 - 2 / 15 * m * second / q)
    assert ZONAL[0] == pytest.approx(j2, rel=1e-9)
    for n, j in ((2, ZONAL[1]), (3, ZONAL[2])):
        closed = 3 * (-e2) ** n / ((2 * n + 1) * (2 * n + 3)) * (n - 1 - 5 * n * j2 / e2)
        assert j == pytest.approx(closed, rel=1e-8)


@pytest.mark.parametrize("lat", [-60.0, 20.0, 45.0])
def test_the_ins_needs_the_north_component_that_the_truth_has(lat):
    """100 s at rest 10 km up: 8 mm/s and 0.4 m in the north at 45 deg where one of the two has
    it, 0.3 % of them where both have. The Earth of the INS is coded apart."""
    motion, t = static((DEG * lat, 0.2, 1e4)), np.linspace(0.0, 100.0, 1001)
    straight_down = lambda lat, alt: (0 * alt, gravity(lat, alt))
    off = {}
    for name, model in (("with", None), ("without", straight_down)):
        imu = records(motion, t, model)[1]
        lla, v, C = np.array(motion.lla), np.zeros(3), np.eye(3)
        for r, a in zip(imu.dtheta, imu.dv):
            mechanize(lla, v, C, r, a, 0.1, np.zeros(3))
        off[name] = v[0], (lla[0] - DEG * lat) * 6.37e6
    north = exact_gravity(DEG * lat, 1e4)[0]
    assert off["without"] == pytest.approx((100 * north, 5000 * north), rel=0.02)
    assert off["with"] == pytest.approx((0, 0), abs=4e-3 * 5000 * abs(north))
    assert abs(off["with"][0]) < 4e-3 * 100 * abs(north)


def test_radii_measure_distances_on_the_ellipsoid():
    lat, step = DEG * np.array([-70.0, 0.0, 47.0]), 1e-5
    meridian, normal = radii(lat)
    ecef = lambda lat, lon: np.stack(pymap3d.geodetic2ecef(lat, lon + 0 * lat, 0 * lat, deg=False))
    north = np.linalg.norm(ecef(lat + step, 0.0) - ecef(lat - step, 0.0), axis=0) / (2 * step)
    east = np.linalg.norm(ecef(lat, step) - ecef(lat, -step), axis=0) / (2 * step)
    np.testing.assert_allclose(
        np.stack([meridian, normal * np.cos(lat)]), np.stack([north, east]), rtol=1e-9
    )


def test_at_rest_the_imu_feels_earth_rate_and_gravity():
    imu = increments(STILL, [0.0, 0.5, 1.5])
    to_body = Rotation.from_euler("ZYX", [2.5, -0.2, 0.1]).inv()
    earth_rate = 7.292115e-5 * np.array([np.cos(DEG * 50), 0, -np.sin(DEG * 50)])
    north, down = exact_gravity(DEG * 50, 300.0)
    np.testing.assert_allclose(imu.dtheta, np.outer(imu.dt, to_body.apply(earth_rate)), atol=1e-19)
    np.testing.assert_allclose(
        imu.dv,
        np.outer(imu.dt, to_body.apply([-north, 0, -down])),
        atol=3e-8,
    )
    truth = sample(STILL, [0.0, 0.5, 1.5])
    assert np.ptp(truth.lla, axis=0).max() == 0 and not truth.v_n.any()
    np.testing.assert_allclose(truth.rph, np.tile([0.1, -0.2, 2.5], (3, 1)), atol=1e-15)


@pytest.mark.parametrize(
    "motion, tolerances", [(DEMO, (1e-13, 1e-9)), (HIGH, (1e-13, 3e-9))], ids=["demo", "high"]
)
def test_increments_agree_with_pyins(motion, tolerances):
    from pyins import earth, sim

    t = np.arange(0, 60, 0.005) + 80
    truth = sample(motion, t)
    rph = np.degrees(truth.rph)
    lla = np.c_[np.degrees(truth.lla[:, :2]), truth.lla[:, 2]]
    lla[:, 1] = np.degrees(np.unwrap(truth.lla[:, 1]))
    _, theirs = sim.generate_imu(t, lla, rph, truth.v_n, "increment")
    ours = increments(motion, t)
    # pyins is of first order in height, and its gravity points straight down
    lacking = gravity(truth.lla[:, 0], truth.lla[:, 2]) - earth.gravity(lla[:, 0], lla[:, 2])
    north = gravity_north(truth.lla[:, 0], truth.lla[:, 2])
    correction = truth.rotation.inv().apply(np.c_[north, 0 * t, lacking])[1:] * ours.dt[:, None]
    inner = slice(10, -10)  # its splines are worst at the ends
    for mine, other, tolerance in zip(
        (ours.dtheta, ours.dv + correction), (theirs.iloc[1:, :3], theirs.iloc[1:, 3:]), tolerances
    ):
        difference = (mine - other.to_numpy())[inner]
        assert np.abs(difference).max() < tolerance
        # rounding, not drift: 12 000 samples
        assert np.abs(difference.sum(axis=0)).max() < 100 * tolerance


@pytest.mark.parametrize("motion", [DEMO, HIGH], ids=["demo", "high"])
def test_integrating_the_increments_in_ecef_returns_to_the_truth(motion):
    t = np.arange(0, 20.001, 0.002) + 95
    truth, imu = sample(motion, t), increments(motion, t)
    lat, lon, alt = truth.lla.T
    up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    ned_to_e = np.stack(
        [
            np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]),
            np.stack([-np.sin(lon), np.cos(lon), 0 * lon]),
            -up.T,
        ]
    ).transpose(2, 1, 0)
    north, down = exact_gravity(lat, alt)
    g_e = (ned_to_e @ np.stack([north, 0 * north, down], axis=1)[..., None])[..., 0]
    spin = np.array([0, 0, 7.292115e-5])
    r = np.array(pymap3d.geodetic2ecef(lat[0], lon[0], alt[0], deg=False))
    v, C = ned_to_e[0] @ truth.v_n[0], ned_to_e[0] @ truth.rotation[0].as_matrix()
    turns, halves = (Rotation.from_rotvec(part * imu.dtheta).as_matrix() for part in (1.0, 0.5))
    earth, half_earth = (
        Rotation.from_rotvec(-part * spin * 0.002).as_matrix() for part in (1.0, 0.5)
    )
    for k in range(len(imu.t)):
        v_new = (
            v
            + half_earth @ C @ halves[k] @ imu.dv[k]
            + (g_e[k] - 2 * np.cross(spin, v)) * imu.dt[k]
        )
        r, v, C = r + 0.5 * (v + v_new) * imu.dt[k], v_new, earth @ C @ turns[k]
    assert np.linalg.norm(r - pymap3d.geodetic2ecef(lat[-1], lon[-1], alt[-1], deg=False)) < 2e-3
    assert np.linalg.norm(ned_to_e[-1].T @ v - truth.v_n[-1]) < 2e-4
    assert np.abs(C - ned_to_e[-1] @ truth.rotation[-1].as_matrix()).max() < 1e-6


@pytest.mark.parametrize("motion", [DEMO, HIGH], ids=["demo", "high"])
def test_truth_and_increments_do_not_depend_on_the_sampling(motion):
    fine = np.arange(0, 30.001, 0.01)
    coarse = fine[[0, 1, 100, 103, 500, 3000]]
    truth, sums = sample(motion, fine), np.cumsum(np.c_[increments(motion, fine)[2:]], axis=0)
    at = np.searchsorted(fine, coarse)
    np.testing.assert_allclose(
        sample(motion, coarse[2:]).lla,
        truth.lla[at[2:]],
        rtol=0,
        atol=2e-14 if motion is DEMO else 2e-12,
    )
    np.testing.assert_allclose(
        np.c_[increments(motion, coarse)[2:]],
        np.diff(np.r_[np.zeros((1, 6)), sums][at], axis=0),
        rtol=0,
        atol=1e-11,
    )
    np.testing.assert_allclose(
        np.c_[increments(motion, coarse[2:])[2:]],
        np.c_[increments(motion, coarse)[2:]][2:],
        rtol=0,
        atol=1e-13,
    )


def test_one_time_gives_a_row_and_no_increment():
    assert len(sample(DEMO, [5.0])) == 1 and len(increments(DEMO, [5.0]).t) == 0


def test_the_demo_flight_stays_in_its_envelope():
    truth = sample(DEMO, np.arange(0, 600.5, 0.5))
    speed, roll, pitch = np.linalg.norm(truth.v_n, axis=1), *truth.rph[:, :2].T
    assert 38 < speed.min() < 42 and 48 < speed.max() < 52
    assert 25 * DEG < np.abs(roll).max() < 35 * DEG and np.abs(pitch).max() < 10 * DEG
    assert 800 < truth.lla[:, 2].min() and truth.lla[:, 2].max() < 1400
    f = increments(DEMO, np.arange(0, 600.1, 0.1)).dv / 0.1
    # coordinated: no side force but for the turbulence
    assert np.abs(f[:, 1]).max() < 0.6 and 8.5 < -f[:, 2].min() < 13


def test_ramp_rate_is_the_slope_of_the_ramp():
    t = np.linspace(-20, 40, 301)
    np.testing.assert_allclose(
        ramp_rate(t, 10, 4), (ramp(t + 1e-5, 10, 4) - ramp(t - 1e-5, 10, 4)) / 2e-5, atol=1e-9
    )


@pytest.mark.parametrize(
    "motion, t, words",
    [
        (DEMO, [0.0, 1.0, 1.0], "increasing"),
        (DEMO, [-1.0, 1.0], "not before 0 s"),
        (DEMO, [0.0, np.nan], "finite"),
        (DEMO, [], "one or more"),
        (STILL._replace(velocity=lambda t: (np.abs(t - 0.5), 0, 0)), [0.0, 1.0], "not analytic"),
        (STILL._replace(velocity=lambda t: (np.nan, 0, 0)), [0.0, 1.0], "not finite"),
        (
            STILL._replace(lla=(DEG * 88.999, 0, 0), velocity=lambda t: (100, 0, 0)),
            [0.0, 100.0],
            "beyond 89 deg of latitude",
        ),
    ],
)
def test_impossible_simulations_are_refused(motion, t, words):
    with pytest.raises(DataError, match=words):
        increments(motion, t)
