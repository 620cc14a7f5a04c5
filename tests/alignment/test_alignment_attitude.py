"""Starts of attitude filters without position, headings from the magnetic field and from the
Earth's rate; errors as large as the deviations say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.alignment.course_heading import COURSE_STD
from strapdown.alignment.initial import EARTH_RADIUS, align
from strapdown.alignment.initial_heading import (
    GYROCOMPASS_STD,
    MAGNETIC_STD,
    UNKNOWN_STD,
    mean_force,
)
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.preprocessing.stationary import motionless
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sim.trajectory import DEG, Motion, ramp, static

FIELD = np.array([17e-6, 1.5e-6, 46e-6])  # T, NED
MEMS = ImuSpec("MEMS", Triad(noise=2e-4, turn_on_bias=0.005), Triad(noise=1e-3, turn_on_bias=0.02))
LLA = (DEG * 52, DEG * 10, 100.0)
NAVIGATION = sd.imu("navigation")


def with_field(
    recording, noise=0.3e-6, distort=lambda m: m, field=FIELD, seed=1, every=5, sources=()
):
    """The recording with a magnetometer, whose reference is `field`, and `sources` instead of
    its fixes."""
    truth = recording.reference
    rows = np.arange(0, len(truth), every)
    m = distort(truth.rotation[rows].inv().apply(field)) + np.random.default_rng(seed).normal(
        0, noise, (len(rows), 3)
    )
    compass = Source(
        "magnetic-field", truth.t[rows], m, np.full((len(rows), 3), noise), tuple(field)
    )
    return replace(recording, sources=(*sources, compass))


def resting(rph, seconds=10.0, seed=1, imu=MEMS, rate=50.0):
    return unplaced(sd.simulate(static(LLA, rph), seconds, imu, seed, rate))


def unplaced(recording):
    """The recording without its place."""
    return replace(
        recording, meta={key: value for key, value in recording.meta.items() if key != "place"}
    )


def attitude_error(start, recording):
    """Rotation vector, rad in n, true - estimate."""
    truth = recording.reference
    row = int(np.argmin(np.abs(truth.t - start.t)))
    return (truth.rotation[row] * Rotation.from_euler("ZYX", start.rph[::-1]).inv()).as_rotvec()


# ---- without position


@pytest.mark.short
@pytest.mark.parametrize(
    "rph", [(0.1, -0.2, 2.0), (-2.9, 0.3, 4.0), (1.4, -1.2, 6.0), (0.0, 0.0, np.pi)]
)
def test_from_rest_without_any_fix(rph):
    recording = with_field(resting(rph))
    start = align(recording, MEMS, position=False)
    assert (
        start.t == 0.0
        and "heading from the magnetic field" in start.note
        and "level at rest" in start.note
        and "gyro bias from" in start.note
    )
    assert (
        "place unknown: 0 deg latitude assumed" in start.note
        and start.lla == (0.0, 0.0, 0.0)
        and start.std[0] == EARTH_RADIUS
    )
    assert (
        np.abs(attitude_error(start, recording) / start.std[6:9]).max() < 3
        and start.std[6] < 0.6 * DEG
    )
    assert start.std[8] > MAGNETIC_STD and np.degrees(start.std[8]) < 7
    assert (
        np.abs((recording.meta["b_g"][0] - start.b_g) / start.std[12:]).max() < 4
        and start.std[12] < 1e-3
    )


@pytest.mark.short
def test_place_is_that_of_the_recording_or_of_a_fix():
    recording = with_field(resting((0, 0, 1)))
    given = align(
        replace(recording, meta=recording.meta | {"place": [0.9, 0.1, 50.0]}), MEMS, position=False
    )
    assert (
        given.lla == (0.9, 0.1, 50.0)
        and "place given" in given.note
        and given.v_n == (0.0, 0.0, 0.0)
    )
    fixed = align(resting((0, 0, 1)), MEMS, position=False)
    assert (
        fixed.lla == pytest.approx(LLA, abs=10)
        and "place of the nearest fix" in fixed.note
        and fixed.std[8] == UNKNOWN_STD
    )


@pytest.mark.short
def test_a_record_without_anything_but_samples():
    start = align(replace(resting((0.1, 0.2, 1.0)), sources=()), MEMS, position=False)
    assert (
        start.rph == pytest.approx((0.1, 0.2, 0.0), abs=0.02)
        and start.std[8] == UNKNOWN_STD
        and "heading unknown" in start.note
    )


@pytest.mark.short
@pytest.mark.parametrize("samples", [2, 3, 40])
def test_the_shortest_records(samples):
    imu = Imu(
        0.02 * np.arange(1, samples + 1),
        np.full(samples, 0.02),
        np.zeros((samples, 3)),
        np.tile([0, 0, -9.8 * 0.02], (samples, 1)),
    )
    start = align(Recording(imu), MEMS, position=False)
    assert start.rph[:2] == pytest.approx((0, 0)) and start.t == 0 and start.std[6] >= 5 * DEG


@pytest.mark.short
def test_without_gravity_there_is_no_level():
    imu = Imu(
        0.02 * np.arange(1, 101),
        np.full(100, 0.02),
        np.zeros((100, 3)),
        np.tile([0, 0, -0.5 * 0.02], (100, 1)),
    )
    with pytest.raises(
        DataError,
        match=r"cannot level: the mean specific force at 0.00 s is 0.5 m/s\^2, far from gravity",
    ):
        align(Recording(imu), MEMS, position=False)
    with pytest.raises(DataError, match="cannot start at 9 s"):
        align(Recording(imu), MEMS, at=9.0, position=False)


def tumbling(speed=2.0):
    """A hand that turns an IMU by up to 2 rad/s about all axes and shakes it by 1 m/s^2."""
    v = lambda t: 0.3 * np.sin(3.3 * t)
    return Motion(
        "tumbling",
        LLA,
        lambda t: (v(t), v(t + 1), v(t + 2)),
        lambda t: (speed * np.sin(t), 0.6 * np.sin(0.8 * speed * t), 1.0 + speed * t),
    )


def test_anywhere_in_a_tumble_errors_are_as_large_as_the_start_says():
    recording = with_field(sd.simulate(tumbling(), 60.0, MEMS, 2, 100.0))
    starts = [
        align(recording, MEMS, at=float(t), position=False) for t in np.arange(0.0, 60.0, 1.7)
    ]
    z = np.array([attitude_error(start, recording) / start.std[6:9] for start in starts])
    assert np.sqrt((z**2).mean(axis=0)).max() < 1.3 and np.abs(z).max() < 3.5
    assert all(
        "level from specific force alone" in start.note and start.b_g == (0.0, 0.0, 0.0)
        for start in starts
    )


def test_the_gyros_take_the_turn_out_of_the_mean():
    """Without acceleration, however fast it turns, the mean force at any instant is that of the
    instant; blurred it would be degrees off."""
    motion = Motion(
        "spinning",
        LLA,
        lambda t: (0 * t, 0 * t, 0 * t),
        lambda t: (3.0 * t, 0.3 * np.sin(t), 0.5 * t),
    )
    recording = sd.simulate(motion, 6.0, "navigation", 1, 200.0)
    for t in (0.0, 2.505, 6.0 - 0.005):
        force = mean_force(recording, t, np.zeros(3))
        row = int(np.argmin(np.abs(recording.reference.t - t)))
        expected = recording.reference.rotation[row].inv().apply([0, 0, -9.81])
        assert (
            np.linalg.norm(force.f - expected) < 0.02
            and force.off < 0.005
            and force.end - force.begin == pytest.approx(1.0, abs=0.01)
        )


def test_a_slow_turn_of_the_hand_is_no_sure_gyro_bias():
    """0.03 rad/s, up and down: still enough for rest, but the IMU's own bias is surer then."""
    motion = Motion(
        "hand",
        LLA,
        lambda t: (0 * t, 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, 0.03 / 0.8 * np.sin(0.8 * t)),
    )
    recording = replace(sd.simulate(motion, 20.0, MEMS, 3, 100.0), sources=())
    start = align(recording, MEMS, position=False)
    assert (
        np.abs((recording.meta["b_g"][0] - start.b_g) / start.std[12:]).max() < 3
        and start.b_g[2] == 0.0
        and start.std[14] == MEMS.bias_std()[1]
    )


def test_after_a_rest_the_surer_of_gyros_and_force():
    turn = lambda t: 1.0 * ramp(t, 11.0, 0.2)
    still = Motion(
        "stand, then turn",
        LLA,
        lambda t: (0 * t, 0 * t, 0 * t),
        lambda t: (0.3 * turn(t), 0.1 + 0 * t, 1 + turn(t)),
    )
    recording = replace(sd.simulate(still, 14.0, MEMS, 3, 100.0), sources=())
    soon = align(recording, MEMS, at=11.2, position=False)
    assert (
        "level from the standstill" in soon.note
        and np.abs(attitude_error(soon, recording)[:2] / soon.std[6:8]).max() < 3
    )
    wild = lambda t: 8.0 * np.maximum(0, 1) * (t - 11.0) * ramp(t, 11.0, 0.05)
    spun = Motion(
        "stand, then spin", LLA, lambda t: (0 * t, 0 * t, 0 * t), lambda t: (wild(t), 0 * t, 0 * t)
    )
    late = align(
        replace(sd.simulate(spun, 30.0, MEMS, 3, 100.0), sources=()), MEMS, at=29.0, position=False
    )
    assert "level from specific force alone" in late.note  # the gyros have turned 144 rad since


# ---- headings


@pytest.mark.short
def test_declination_is_that_of_the_reference_field():
    east = np.array([0.0, 20e-6, 40e-6])
    recording = resting((0.0, 0.0, 1.0))
    truth = recording.reference
    compass = Source(
        "magnetic-field",
        truth.t,
        truth.rotation.inv().apply(east),
        np.full((len(truth), 3), 1e-7),
        tuple(east),
    )
    assert align(replace(recording, sources=(compass,)), MEMS, position=False).rph[
        2
    ] == pytest.approx(1.0, abs=0.02)
    magnetic = align(
        replace(recording, sources=(replace(compass, parameters=()),)), MEMS, position=False
    )
    # without a reference north is where the field points
    assert magnetic.rph[2] == pytest.approx(1.0 - np.pi / 2, abs=0.02)


def test_a_disturbed_field_shows_in_the_deviation():
    """Disturbances of 8 uT in random directions: of 120 headings 85 to 100 % lie within two of
    their own deviations.

    The deviation comes from the two parts of the disturbance that show, so that the ratio has
    Student's long tails (2 degrees of freedom): 89 % were the floor of 5 deg not there.
    """
    rng, z, stated = np.random.default_rng(0), [], []
    base = resting((0.2, -0.1, 1.0), 3.0)
    for _ in range(120):
        other = rng.normal(0, 8e-6, 3)
        recording = with_field(
            base, distort=lambda m: m + base.reference.rotation[0].inv().apply(other)
        )
        start = align(recording, MEMS, position=False)
        z.append(attitude_error(start, recording)[2] / start.std[8])
        stated.append(start.std[8])
    z = np.abs(z)
    assert (z < 2).mean() >= 0.85 and 0.35 < np.median(z) < 0.9 and np.degrees(np.mean(stated)) > 12


@pytest.mark.short
@pytest.mark.parametrize(
    "field, words",
    [
        ((0.0, 0.0, 50e-6), "dip"),
        ((0.0, 0.0, 0.0), "the magnetic field is 0"),
        ((0.2e-6, 0.0, 50e-6), "does not show it"),
    ],
)
def test_a_field_that_tells_no_heading(field, words):
    recording = with_field(
        resting((0, 0, 1)), noise=1e-9 if any(field) else 0.0, field=np.array(field)
    )
    start = align(recording, MEMS, position=False)
    assert start.std[8] == UNKNOWN_STD and "heading unknown" in start.note and words in start.note


@pytest.mark.short
def test_a_field_that_comes_later_is_no_heading_yet():
    recording = with_field(resting((0, 0, 1)))
    late = replace(recording, sources=(recording.sources[0].between(3, 10),))
    assert "no sample of the magnetic field there" in align(late, MEMS, position=False).note
    assert "heading from the magnetic field" in align(late, MEMS, position=False, at=5.0).note


def test_order_of_sources():
    speed = lambda t: 12 * ramp(t, 5.0, 1.0)
    motion = Motion(
        "east", LLA, lambda t: (0 * t, speed(t), 0 * t), lambda t: (0 * t, 0 * t, np.pi / 2 + 0 * t)
    )
    plain = sd.simulate(motion, 20.0, MEMS, 1, 50.0)
    both = with_field(plain, sources=plain.sources)
    start = align(both, MEMS)
    assert start.t == plain.sources[0].t[0] and "magnetic" in start.note  # no waiting for a course
    assert "position and velocity" in start.note and abs(start.rph[2] - np.pi / 2) < 0.2
    compass = Source("heading", np.arange(1.0, 19.0), np.full((18, 1), 1.5), np.full((18, 1), 0.02))
    assert "heading measured" in align(replace(both, sources=(*both.sources, compass)), MEMS).note
    assert (
        "heading given" in align(both, MEMS, heading=1.0).note
        and align(both, MEMS, heading=1.0, position=False).rph[2] == 1.0
    )
    steep = with_field(plain, field=np.array([0.1e-6, 0, 50e-6]), sources=plain.sources)
    course = align(steep, MEMS)
    assert (
        course.t > 3
        and course.std[8] == pytest.approx(COURSE_STD, rel=0.1)
        and "heading from the course" in course.note
        and "magnetic field" in course.note
    )
    assert "heading from the course" in align(plain, MEMS, position=False, at=15.0).note


# ---- the Earth's rate


def parked(seconds, seed=1, heading=2.0, bump=0.0, latitude=DEG * 52, end=np.inf):
    """A navigation-grade IMU in a vehicle that rocks by 0.002 deg and, after `end`, drives off;
    `bump`: rad/s of gyro bias nobody knows of."""
    rock = lambda t: 3e-5 * np.sin(2.37 * t)
    speed = (lambda t: 15 * ramp(t, end, 1.0)) if np.isfinite(end) else (lambda t: 0 * t)
    motion = Motion(
        "parked",
        (latitude, 0.1, 50.0),
        lambda t: (speed(t) * np.cos(heading), speed(t) * np.sin(heading), 0 * t),
        lambda t: (0.05 + rock(t), -0.02 + rock(t + 1), heading + 0 * t),
    )
    made = sd.simulate(motion, seconds, "navigation", seed, 20.0)
    return replace(
        unplaced(made), imu=made.imu._replace(dtheta=made.imu.dtheta + bump * made.imu.dt[:, None])
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("latitude", [-40, 10, 65])
def test_gyrocompass_from_a_long_rest(seed, latitude):
    recording = parked(300.0, seed, latitude=DEG * latitude)
    start = align(recording, NAVIGATION)
    assert (
        "heading from the Earth's rate over 290 s of rest" in start.note
        and "level at rest" in start.note
    )
    assert (
        abs(attitude_error(start, recording)[2]) < 4 * start.std[8]
        and start.std[8] < GYROCOMPASS_STD
        and start.std[6] < 0.6 * DEG
    )
    alone = align(replace(recording, sources=()), NAVIGATION, position=False)
    assert (
        abs(attitude_error(alone, recording)[2]) < 4 * alone.std[8] and "Earth's rate" in alone.note
    )


def test_gyrocompass_ends_where_the_vehicle_drives_off():
    recording = parked(200.0, end=125.0)
    still = motionless(recording.imu, 0.0)
    assert still.start == pytest.approx(0, abs=1e-6) and 100 <= still.stop <= 130
    # from the moment before it leaves, in steps of 10 s
    assert motionless(recording.imu, 118.0).start == pytest.approx(8)
    assert "Earth's rate" in align(recording, NAVIGATION).note


@pytest.mark.parametrize(
    "recording, imu",
    [
        (parked(300.0), sd.imu("tactical")),
        (parked(20.0), NAVIGATION),
        (parked(300.0, bump=3e-5), NAVIGATION),
        (parked(60.0, latitude=DEG * 88.5), NAVIGATION),
    ],
    ids=["gyro too poor", "too short", "unknown bias", "pole"],
)
def test_no_gyrocompass_where_it_would_be_wrong(recording, imu):
    start = align(recording, imu)
    assert "Earth's rate over" not in start.note and start.std[8] == UNKNOWN_STD


def test_cruise_is_no_rest_where_fixes_tell():
    """At 20 m/s to the north the Earth's curvature adds 3e-6 rad/s about east: 4 deg of heading,
    which nothing else would show."""
    motion = Motion(
        "cruise", LLA, lambda t: (20 + 0 * t, 0 * t, 0 * t), lambda t: (0 * t, 0 * t, 0 * t)
    )
    recording = sd.simulate(motion, 120.0, "navigation", 1, 20.0)
    assert "course" in align(recording, NAVIGATION).note
    assert (
        "Earth's rate over"
        in align(replace(recording, sources=()), NAVIGATION, position=False).note
    )


def test_the_surer_of_field_and_earth_rate():
    recording = parked(300.0)
    start = align(with_field(recording, sources=recording.sources), NAVIGATION)
    assert "Earth's rate" in start.note and start.std[8] < MAGNETIC_STD


@pytest.mark.short
def test_motionless_needs_samples_all_the_time():
    n = 400
    imu = Imu(
        0.1 * np.arange(1, n + 1),
        np.full(n, 0.1),
        np.full((n, 3), 1e-7),
        np.tile([0, 0, -0.98], (n, 1)),
    )
    whole = motionless(imu, 0.0)
    assert (
        whole.stop == 40.0
        and whole.rate == pytest.approx([1e-6] * 3)
        and whole.force == pytest.approx([0, 0, -9.8])
        and whole.rate_std < 1e-12
    )
    holed = Imu(*(np.delete(column, slice(120, 180), axis=0) for column in imu))
    assert motionless(holed, 0.0) is None and motionless(imu, 1e6) is None


@pytest.mark.short
def test_a_tilt_that_goes_on_is_in_the_deviation_of_the_rate():
    """Springs that settle at 1e-6 rad/s turn all parts of the rest alike; only the specific
    force shows it."""
    t = 0.1 * np.arange(1, 1001)
    f = np.c_[9.8 * np.sin(1e-6 * t), 0 * t, -9.8 * np.cos(1e-6 * t)]
    assert motionless(
        Imu(t, np.full(1000, 0.1), np.full((1000, 3), 1e-7), 0.1 * f), 0.0
    ).rate_std == pytest.approx(1e-6, rel=1e-3)


def test_the_ring_laser_record_starts_with_a_gyrocompass_heading(data_folder):
    recording = sd.read(data_folder / "lasergyro" / "lasergyro.imu.xz")
    start = align(recording, NAVIGATION)
    assert (
        np.degrees(start.rph[2]) == pytest.approx(88, abs=2) and 0.5 < np.degrees(start.std[8]) < 5
    )
    assert "over 1840 s of rest" in start.note and "level at rest" in start.note
