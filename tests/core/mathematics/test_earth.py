"""The Earth against pymap3d, pyproj, published numbers and the exact potential of the ellipsoid;
not against the simulator's Earth."""

import math

import numpy as np
import pymap3d
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from strapdown.core.mathematics import earth

pytestmark = pytest.mark.short
DEG = np.pi / 180
LATITUDES = [-89.0, -75.0, -47.5, -1.0, 0.0, 30.0, 48.0, 60.0, 85.0]


def ecef(lat, lon, alt):
    return np.array(pymap3d.geodetic2ecef(lat, lon, alt, deg=False))


def exact_gravity(lat, alt):
    """Normal gravity (m/s^2, north and down) of the rotating ellipsoid, closed form:
    Heiskanen & Moritz (1967), 2-62 to 2-66.

    In ellipsoidal coordinates (u, beta); no series in height. WGS-84 defining constants a, 1/f, GM,
    omega.
    """
    a, f, gm, omega = 6378137.0, 1 / 298.257223563, 3.986004418e14, 7.292115e-5
    b, linear = a * (1 - f), a * math.sqrt(f * (2 - f))
    normal = a / math.sqrt(1 - f * (2 - f) * math.sin(lat) ** 2)
    p, z = (normal + alt) * math.cos(lat), (normal * (1 - f) ** 2 + alt) * math.sin(lat)
    square = p * p + z * z - linear**2
    u2 = square / 2 * (1 + math.sqrt(1 + 4 * linear**2 * z * z / square**2))
    u = math.sqrt(u2)
    sin_b, cos_b = z / u, p / math.sqrt(u2 + linear**2)
    length = math.hypot(sin_b, cos_b)
    sin_b, cos_b = sin_b / length, cos_b / length
    w = math.sqrt((u2 + linear**2 * sin_b**2) / (u2 + linear**2))
    q = lambda u: ((1 + 3 * u * u / linear**2) * math.atan(linear / u) - 3 * u / linear) / 2
    q_prime = 3 * (1 + u2 / linear**2) * (1 - u / linear * math.atan(linear / u)) - 1
    of_u = (
        -(
            gm / (u2 + linear**2)
            + omega**2
            * a
            * a
            * linear
            * q_prime
            / (q(b) * (u2 + linear**2))
            * (sin_b**2 / 2 - 1 / 6)
            - omega**2 * u * cos_b**2
        )
        / w
    )
    of_beta = (
        -(
            -(omega**2) * a * a * q(u) / (q(b) * math.sqrt(u2 + linear**2))
            + omega**2 * math.sqrt(u2 + linear**2)
        )
        * sin_b
        * cos_b
        / w
    )
    by_p = u / (w * math.sqrt(u2 + linear**2)) * cos_b * of_u - sin_b / w * of_beta
    by_z = sin_b / w * of_u + u / (w * math.sqrt(u2 + linear**2)) * cos_b * of_beta
    return (
        by_z * math.cos(lat) - by_p * math.sin(lat),
        -by_p * math.cos(lat) - by_z * math.sin(lat),
    )


def test_radii_at_48_degrees_are_those_of_e2_and_not_of_e():
    """Finding h of paper 1: with e = f(2 - f), as printed, they would be 6 378 088 and 6 378 216
    m."""
    assert earth.radii(48 * DEG) == pytest.approx((6370736, 6389960), abs=1.0)
    assert earth.E2 == pytest.approx(0.00669437999014, abs=1e-14)
    assert earth.M_RATIO == pytest.approx(0.00344978650684, rel=1e-11)  # published with WGS-84


@pytest.mark.parametrize("lat", LATITUDES)
def test_radii_agree_with_pymap3d_and_with_distances(lat):
    R_M, R_N = earth.radii(lat * DEG)
    assert R_M == pytest.approx(pymap3d.rcurve.meridian(lat), rel=1e-12)
    assert R_N == pytest.approx(pymap3d.rcurve.transverse(lat), rel=1e-12)
    north = pyproj.Geod(ellps="WGS84").inv(0, lat - 1e-3, 0, lat + 1e-3)[2] / (2e-3 * DEG)
    assert R_M == pytest.approx(north, rel=1e-7)


@pytest.mark.parametrize("lat", LATITUDES)
def test_place_gives_what_the_position_needs(lat):
    sine, cosine, M, N = earth.place(lat * DEG, 1234.5)
    R_M, R_N = pymap3d.rcurve.meridian(lat), pymap3d.rcurve.transverse(lat)
    assert (sine, cosine, M, N) == pytest.approx(
        (math.sin(lat * DEG), math.cos(lat * DEG), R_M + 1234.5, R_N + 1234.5), rel=1e-12
    )


def test_at_the_pole_the_cosine_stays_above_zero():
    assert (
        earth.place(math.pi / 2, 0.0)[1] == 1e-3
        and earth.place(-math.pi / 2 + 1e-4, 0.0)[1] == 1e-3
    )
    assert math.cos(earth.LATITUDE_LIMIT) > 10 * 1e-3


@pytest.mark.parametrize("lat, published", [(0.0, 9.7803253359), (90.0, 9.8321849378)])
def test_gravity_on_the_ellipsoid_is_the_published_one(lat, published):
    assert earth.gravity(math.sin(lat * DEG), 0.0) == pytest.approx(published, abs=5e-9)
    assert exact_gravity(lat * DEG, 0.0)[1] == pytest.approx(published, abs=5e-9)


@pytest.mark.parametrize("lat", [0.0, 30.0, -47.5, 75.0, -89.0])
@pytest.mark.parametrize(
    "alt, tolerance",
    [(-400.0, 5e-8), (0.0, 1e-11), (1000.0, 1.1e-7), (9000.0, 8e-7), (30e3, 6e-6), (200e3, 2e-3)],
)
def test_gravity_above_the_ellipsoid_is_that_of_the_exact_potential(lat, alt, tolerance):
    assert earth.gravity(math.sin(lat * DEG), alt) == pytest.approx(
        exact_gravity(lat * DEG, alt)[1], abs=tolerance
    )


@pytest.mark.parametrize("lat", [-80.0, -60.0, -45.0, -20.0, 5.0, 30.0, 48.0, 70.0, 80.0])
@pytest.mark.parametrize("alt", [-100.0, 0.0, 500.0, 3000.0, 10e3, 20e3])
def test_north_gravity_is_that_of_the_exact_potential(lat, alt):
    """To 0.35 % of itself; 1e-11 m/s^2 is the rounding of the closed form."""
    north = earth.gravity_north(math.sin(lat * DEG), math.cos(lat * DEG), alt)
    assert north == pytest.approx(exact_gravity(lat * DEG, alt)[0], rel=3.5e-3, abs=1e-11)
    # as printed, 1 % smaller
    groves = -8.08e-9 * alt * math.sin(2 * lat * DEG)
    assert north == pytest.approx(groves, rel=1e-2)
    assert alt <= 0 or north * lat < 0  # towards the equator


def test_north_gravity_at_45_degrees():
    assert exact_gravity(45 * DEG, 3e3)[0] == pytest.approx(-2.4425e-5, abs=1e-9)
    assert exact_gravity(45 * DEG, 10e3)[0] == pytest.approx(-8.1352e-5, abs=1e-9)


@pytest.mark.parametrize("alt", [-100.0, 3000.0, 20e3])
def test_north_gravity_is_odd_and_none_at_equator_and_poles(alt):
    north = lambda lat, alt: earth.gravity_north(math.sin(lat * DEG), math.cos(lat * DEG), alt)
    for lat in (10.0, 45.0, 80.0):
        assert north(lat, alt) == -north(-lat, alt) == -north(lat, -alt) != 0
    for lat in (-90.0, 0.0, 90.0):
        assert abs(north(lat, alt)) < 1e-19


@pytest.mark.parametrize("lat", [-70.0, -45.0, 20.0, 48.0])
@pytest.mark.parametrize("alt", [0.0, 3000.0, 20e3])
def test_gravity_has_no_curl(lat, alt):
    """d(north (R_M + h))/dh + d down/d lat = 0 in a meridian plane; either is 0.05 m/s^2."""
    sine, cosine, step = math.sin(lat * DEG), math.cos(lat * DEG), 10.0
    meridian = earth.radii(lat * DEG)[0]
    moment = lambda h: earth.gravity_north(sine, cosine, h) * (meridian + h)
    by_height = (moment(alt + step) - moment(alt - step)) / (2 * step)
    by_latitude = earth.gravity_gradient(sine, cosine, alt)[0]
    assert by_height == pytest.approx(-by_latitude, rel=1e-2)
    assert abs(by_latitude) > 0.02


@pytest.mark.parametrize("alt", [-501e3, 501e3, 700e3, 3550e3])
def test_far_gravity_points_to_the_ellipsoid(alt):
    assert earth.gravity_north(0.6, 0.8, alt) == 0
    assert earth.gravity_north(0.6, 0.8, math.copysign(499e3, alt)) != 0


@pytest.mark.parametrize("alt", [-501e3, 501e3, 700e3, 3550e3])
def test_far_gravity_is_newtons(alt):
    assert earth.gravity(0.7, alt) == pytest.approx(
        3.986004418e14 / (6378137.0 + alt) ** 2, rel=1e-12
    )
    if alt > 0:  # centrifugal force grows with distance: up to 2 % there
        assert earth.gravity(0.7, alt) == pytest.approx(
            exact_gravity(math.asin(0.7), alt)[1], rel=0.02
        )


def test_far_gravity_joins_the_series_and_is_finite_at_the_centre():
    assert earth.gravity(0.7, 499.999e3) == pytest.approx(earth.gravity(0.7, 500.001e3), rel=5e-3)
    assert math.isfinite(earth.gravity(0.7, -6378137.0)) and math.isfinite(earth.gravity(0.7, -1e8))


@pytest.mark.parametrize("lat", LATITUDES)
@pytest.mark.parametrize("alt", [-400.0, 0.0, 9000.0, 300e3])
def test_gravity_gradient_is_the_derivative(lat, alt):
    by_lat, by_h = earth.gravity_gradient(math.sin(lat * DEG), math.cos(lat * DEG), alt)
    at = lambda lat, alt: earth.gravity(math.sin(lat), alt)
    step = 1e-4
    assert by_lat == pytest.approx(
        (at(lat * DEG + step, alt) - at(lat * DEG - step, alt)) / (2 * step), rel=1e-6, abs=1e-9
    )
    assert by_h == pytest.approx(
        (at(lat * DEG, alt + 50) - at(lat * DEG, alt - 50)) / 100, rel=1e-7
    )


@pytest.mark.parametrize("lat", LATITUDES)
@pytest.mark.parametrize("v", [(100.0, 0.0, 0.0), (0.0, -250.0, 0.0), (60.0, 80.0, -10.0)])
def test_rates_are_those_at_which_the_frames_turn(lat, v):
    """Earth rate from its axis; transport rate from how far the NED triad turns along 1 s of the
    velocity on either side (pymap3d)."""
    lat, lon, alt = lat * DEG, 0.3, 5000.0
    triad = lambda lat, lon: Rotation.from_matrix(
        np.array(
            [
                [-math.sin(lat) * math.cos(lon), -math.sin(lon), -math.cos(lat) * math.cos(lon)],
                [-math.sin(lat) * math.sin(lon), math.cos(lon), -math.cos(lat) * math.sin(lon)],
                [math.cos(lat), 0, -math.sin(lat)],
            ]
        )
    )
    moved = lambda sign: pymap3d.ned2geodetic(*(sign * np.array(v)), lat, lon, alt, deg=False)[:2]
    transport = (
        triad(lat, lon).inv() * triad(*moved(1)) * triad(*moved(-1)).inv() * triad(lat, lon)
    ).as_rotvec() / 2
    axis = triad(lat, lon).inv().apply([0, 0, 7.292115e-5])
    sine, cosine, M, N = earth.place(lat, alt)
    ie_n, ie_d, *omega_in = earth.rotation_rates(v[0], v[1], sine, cosine, M, N)
    np.testing.assert_allclose([ie_n, 0, ie_d], axis, atol=1e-19)
    np.testing.assert_allclose(np.array(omega_in) - axis, transport, rtol=2e-6, atol=3e-11)


@pytest.mark.parametrize("lat", [-85.0, -30.0, 0.0, 48.0, 80.0])
@pytest.mark.parametrize("ned", [(1.0, 0, 0), (0, -1.0, 0), (0, 0, 30.0), (3.0, 4.0, -5.0)])
def test_displacement_is_in_metres_ned(lat, ned):
    lla = np.array([lat * DEG, -1.0, 2000.0])
    expected = ecef(*pymap3d.ned2geodetic(*ned, *lla, deg=False))
    earth.displace(lla, *map(float, ned))
    assert np.linalg.norm(ecef(*lla) - expected) < 5e-5  # the curvature of 5 m


@pytest.mark.parametrize("east", [40.0, -40.0])
def test_displacement_across_the_antimeridian(east):
    lla = np.array([0.5, math.copysign(math.pi - 1e-6, east), 0.0])
    expected = ecef(*pymap3d.ned2geodetic(0, east, 0, *lla, deg=False))
    earth.displace(lla, 0.0, east, 0.0)
    assert abs(lla[1]) <= math.pi and lla[1] * east < 0
    assert np.linalg.norm(ecef(*lla) - expected) < 1e-3


@pytest.mark.parametrize("side", [1, -1])
def test_displacement_across_a_pole_comes_down_on_the_other_side(side):
    lla = np.array([side * 89.9999 * DEG, 1.0, 0.0])
    expected = ecef(*pymap3d.ned2geodetic(side * 100.0, 0, 0, *lla, deg=False))
    earth.displace(lla, side * 100.0, 0.0, 0.0)
    assert abs(lla[0]) < math.pi / 2 and lla[1] == pytest.approx(1.0 - math.pi)
    assert np.linalg.norm(ecef(*lla) - expected) < 1e-3


def test_sine_of_latitude_is_right_to_units_in_the_last_place():
    lat = np.r_[np.linspace(-np.pi / 2, np.pi / 2, 20_001), 10.0 ** np.arange(-300, 0, 10)]
    found = np.array([earth.sine_of_latitude(float(each)) for each in lat])
    right = np.sin(lat.astype(np.longdouble))
    assert np.max(np.abs(found.astype(np.longdouble) - right) / np.spacing(np.abs(found))) < 2.5
