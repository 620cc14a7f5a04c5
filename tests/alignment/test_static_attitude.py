"""Static attitude in all quadrants against scipy's rotations, what cannot be found, gyrocompass
and gravity against closed forms; the ring-laser record."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from strapdown import read
from strapdown.alignment.static_attitude import gyrocompass, level, level_vector, static_attitude
from strapdown.core.mathematics import earth
from strapdown.geometry.geodesy import gravity, gravity_ned
from strapdown.preprocessing.stationary import motionless
from strapdown_reproductions.recordings.main import earth_rate

DEG = np.pi / 180
FIELD = np.array([15e-6, 1.5e-6, 47e-6])  # T, NED; declination 5.7 deg
DECLINATION = np.arctan2(FIELD[1], FIELD[0])

pytestmark = pytest.mark.short


def seen(rph, vector):
    """A vector of n in the body with these Euler angles, rad."""
    return Rotation.from_euler("ZYX", np.asarray(rph)[..., ::-1]).inv().apply(vector)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.floats(-179.9, 179.9), st.floats(-89.9, 89.9), st.floats(0, 359.99), st.floats(0.1, 30))
def test_every_attitude_is_found_from_its_force_and_field(roll, pitch, heading, g):
    rph = np.array([roll, pitch, heading]) * DEG
    found = static_attitude(seen(rph, [0, 0, -g]), seen(rph, FIELD), DECLINATION)
    off = Rotation.from_euler("ZYX", found[::-1]) * Rotation.from_euler("ZYX", rph[::-1]).inv()
    assert (
        off.magnitude() < 1e-7
        and -np.pi < found[0] <= np.pi
        and abs(found[1]) <= np.pi / 2
        and 0 <= found[2] < 2 * np.pi
    )


@pytest.mark.parametrize("roll", range(-170, 181, 35))
@pytest.mark.parametrize("heading", [0, 45, 135, 179.9, 180, 180.1, 225, 359.9])
def test_angles_are_those_of_the_closed_form(roll, heading):
    rph = np.array([roll, -40, heading]) * DEG
    f, m = seen(rph, [0, 0, -9.8]), seen(rph, FIELD)
    expected = np.arctan2(-f[1], -f[2]), np.arctan2(f[0], np.hypot(f[1], f[2])), heading * DEG
    off = np.array(static_attitude(f, m, DECLINATION)) - expected
    assert np.abs((off + np.pi) % (2 * np.pi) - np.pi).max() < 1e-9


def test_rows_are_treated_like_single_triples():
    rph = np.random.default_rng(1).uniform([-3, -1.5, 0], [3, 1.5, 6], (40, 3))
    f, m = seen(rph, [0, 0, -9.8]), seen(rph, FIELD)
    whole = static_attitude(f, m, 0.1)
    assert whole.shape == (40, 3) and static_attitude(f[0], m[0]).shape == (3,)
    np.testing.assert_allclose(
        whole, [static_attitude(a, b, 0.1) for a, b in zip(f, m)], atol=1e-12
    )
    np.testing.assert_allclose(static_attitude(f, m, np.full(40, 0.1)), whole)
    # one field for all rows
    np.testing.assert_allclose(static_attitude(f, FIELD)[:, :2], whole[:, :2])
    np.testing.assert_allclose(np.array(level(f)).T, whole[:, :2], atol=1e-12)


@pytest.mark.parametrize(
    "f, m, known",
    [
        ([0, 0, 0], FIELD, []),
        ([np.nan, 0, -9.8], FIELD, []),
        ([np.inf, 0, -9.8], FIELD, []),
        ([0, 0, -9.8], None, [0, 1]),
        ([0, 0, -9.8], [0, 0, 5e-5], [0, 1]),
        ([0.1, -3.0, -9.0], np.array([0.1, -3.0, -9.0]) * 1e-6, [0, 1]),
        ([0, 0, -9.8], [0, 0, 0], [0, 1]),
        ([0, 0, -9.8], [np.nan, 0, 0], [0, 1]),
        ([0, 0, -9.8], FIELD, [0, 1, 2]),
    ],
)
def test_what_cannot_be_found_is_nan(f, m, known):
    assert np.flatnonzero(np.isfinite(static_attitude(f, m))).tolist() == known


@pytest.mark.parametrize("sign", [-1, 1])
def test_at_the_vertical_roll_is_zero_and_the_heading_takes_all(sign):
    rph = np.array([25, sign * 90, 70]) * DEG
    found = static_attitude(np.array([sign * 9.8, 0.0, -0.0]), seen(rph, FIELD), DECLINATION)
    assert found[:2] == pytest.approx((0, sign * np.pi / 2))
    same = Rotation.from_euler("ZYX", found[::-1]) * Rotation.from_euler("ZYX", rph[::-1]).inv()
    assert same.magnitude() < 1e-7


def test_acceleration_tilts_by_its_share_of_gravity():
    assert static_attitude([2.0, 0, -9.8])[1] == pytest.approx(np.arctan(2 / 9.8))


def test_signed_zeros_do_not_turn_it_over():
    for zero in (0.0, -0.0):
        assert np.abs(static_attitude([zero, zero, -9.8])[:2]).max() == 0
        assert abs(static_attitude([zero, zero, 9.8])[0]) == pytest.approx(np.pi)


def test_levelled_vectors_keep_their_vertical_part():
    rph = np.array([0.4, -0.7, 1.1])
    np.testing.assert_allclose(
        level_vector(seen(rph, FIELD), *rph[:2]),
        Rotation.from_euler("z", -rph[2]).apply(FIELD),
        atol=1e-20,
    )


# ---- the Earth's rate


def at_rest(latitude, rph):
    rate = earth.RATE * np.array([np.cos(latitude), 0, -np.sin(latitude)])
    return seen(rph, rate), seen(rph, [0, 0, -9.8])


@pytest.mark.parametrize("latitude", [-60, 0, 34, 70])
@pytest.mark.parametrize("heading", [0, 88, 180, 271])
def test_gyrocompass_finds_heading_and_latitude(latitude, heading):
    rph = np.array([10, -20, heading]) * DEG
    found = gyrocompass(*at_rest(latitude * DEG, rph))
    assert np.cos(found.rph[2] - rph[2]) == pytest.approx(1, abs=1e-12) and found.rph[
        :2
    ] == pytest.approx(rph[:2])
    assert found.latitude == pytest.approx(
        latitude * DEG, abs=1e-9
    ) and found.total == pytest.approx(earth.RATE)


def test_deviation_of_the_gyrocompass_is_that_of_its_errors():
    """4000 draws; the standard deviation of a sample has 1.1 %, so 5 % is over four of its own."""
    rng, latitude, rate_std, tilt_std = np.random.default_rng(3), 50 * DEG, 5e-8, 5e-4
    rph = np.array([0, 0, 200]) * DEG
    rate, f = at_rest(latitude, rph)
    errors, tilts = rng.normal(0, rate_std, (4000, 3)), rng.normal(0, tilt_std, (4000, 2))
    forces = f + 9.8 * np.c_[-tilts[:, 1], tilts[:, 0], np.zeros(len(tilts))]
    off = np.array([gyrocompass(rate + e, g).rph[2] for e, g in zip(errors, forces)]) - rph[2]
    stated = gyrocompass(rate, f, rate_std, tilt_std).heading_std
    assert stated == pytest.approx(
        np.hypot(rate_std / (earth.RATE * np.cos(latitude)), np.tan(latitude) * tilt_std)
    )
    assert off.std() == pytest.approx(stated, rel=0.05)


def test_gyrocompass_refuses_what_tells_nothing():
    with pytest.raises(ValueError, match="must be finite"):
        gyrocompass([1e-5, 0, 0], [0, 0, 0])
    with pytest.raises(ValueError, match="must be finite"):
        gyrocompass([np.nan, 0, 0], [0, 0, -9.8])
    pole = gyrocompass([0, 0, -earth.RATE], [0, 0, -9.8], 1e-8)
    assert np.isnan(pole.rph[2]) and pole.heading_std == np.inf
    assert np.isnan(gyrocompass([0, 0, -2 * earth.RATE], [0, 0, -9.8]).latitude)


def test_the_earth_in_the_ring_laser_record(data_folder):
    recording = read(data_folder / "lasergyro" / "lasergyro.imu.xz")
    table, claims = earth_rate(recording)
    assert all(claim["holds"] for claim in claims) and len(claims) == 3
    assert table["vertical rate, deg/h"].iloc[-1] == pytest.approx(8.46, abs=0.01) and table[
        "horizontal rate, deg/h"
    ].iloc[-1] == pytest.approx(12.43, abs=0.01)
    stated = table["stated deviation of heading, deg"].iloc[0]
    parts = table["heading, deg"].iloc[1:-1]
    assert 0.5 < stated < 5 and parts.std() / np.sqrt(len(parts)) == pytest.approx(stated, rel=0.3)
    still = motionless(recording.imu, 0.0)
    assert still.stop - still.start > 1800 and np.linalg.norm(still.force) == pytest.approx(
        9.7955, abs=1e-3
    )


# ---- gravity


@pytest.mark.parametrize("h", [-100.0, 0.0, 9e3, 450e3, 600e3])
def test_gravity_of_arrays_is_that_of_the_filters(h):
    latitudes = np.linspace(-89, 89, 13) * DEG
    np.testing.assert_allclose(
        gravity(latitudes, h),
        [earth.gravity(np.sin(lat), h) for lat in latitudes],
        rtol=1e-15,
    )


@pytest.mark.parametrize("h", [-100.0, 0.0, 9e3, 450e3, 600e3])
def test_the_vector_of_gravity_is_that_of_the_filters(h):
    latitudes = np.linspace(-89, 89, 13) * DEG
    found = gravity_ned(latitudes, h)
    north = [earth.gravity_north(np.sin(lat), np.cos(lat), h) for lat in latitudes]
    np.testing.assert_allclose(found[:, 0], north, rtol=1e-14)
    assert np.all(found[:, 1] == 0) and np.array_equal(found[:, 2], gravity(latitudes, h))
    assert np.array_equal(gravity_ned(latitudes[3], h), found[3])
    assert np.array_equal(gravity_ned(latitudes[:2], [h, 0.0])[0], found[0])


def test_gravity_is_the_published_formula():
    """As gravity.m of the Marine Systems Simulator and Fossen (2021) write it: rounded
    constants, no height."""
    lat = np.linspace(-np.pi / 2, np.pi / 2, 37)
    printed = (
        9.7803253359
        * (1 + 0.00193185 * np.sin(lat) ** 2)
        / np.sqrt(1 - 0.00669438 * np.sin(lat) ** 2)
    )
    np.testing.assert_allclose(gravity(lat), printed, rtol=3e-9)
    # WGS-84's gravity at the pole
    assert gravity(np.pi / 2) == pytest.approx(9.8321849378, abs=1e-9)


def test_constant_gravity_and_an_unknown_model():
    assert gravity(0.7, 1e4, "constant") == 9.80665 and gravity(
        np.zeros(3), model="constant"
    ).shape == (3,)
    assert np.abs(gravity(np.linspace(-1.5, 1.5, 9)) / 9.80665 - 1).max() < 0.003
    with pytest.raises(ValueError, match="no gravity model 'egm'; there is: wgs84, constant"):
        gravity(0.5, model="egm")
