"""Starts: level in all upright quadrants and in acceleration, heading from what there is, biases
from rest; and what a run makes of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.alignment.initial import UNKNOWN_STD, level
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sim.trajectory import DEG, Motion, ramp, static

G = 9.81
SPEC = ImuSpec("test", Triad(noise=1e-4, turn_on_bias=0.01), Triad(noise=1e-3, turn_on_bias=0.02))
ARM = (1.0, 0.5, -2.0)


@pytest.mark.short
@pytest.mark.parametrize("roll", [-170, -80, -10, 0, 35, 100, 179])
@pytest.mark.parametrize("pitch", [-80, -20, 0, 45])
def test_level_from_the_specific_force_of_a_body_at_rest(roll, pitch):
    f = Rotation.from_euler("ZYX", [50, pitch, roll], degrees=True).inv().apply([0, 0, -G])
    found = level(f)
    back = Rotation.from_euler("ZYX", [50 * DEG, found[1], found[0]]).inv().apply([0, 0, -G])
    assert np.allclose(back, f, atol=1e-9)
    if abs(roll) < 90:
        assert np.degrees(found) == pytest.approx((roll, pitch), abs=1e-6)


@pytest.mark.short
@pytest.mark.parametrize("heading", [0, 100, 250])
def test_level_of_an_accelerating_body_needs_its_heading(heading):
    a_n, rph = np.array([2.0, -1.5, 0.8]), (0.3, -0.15, heading * DEG)
    C = Rotation.from_euler("ZYX", rph[::-1])
    found = level(C.inv().apply(a_n - [0, 0, 9.7803]), a_n, rph[2])
    assert found == pytest.approx(rph[:2], abs=1e-3)
    # taken for rest it is wrong
    assert abs(level(C.inv().apply(a_n - [0, 0, 9.7803]))[0] - rph[0]) > 0.02


def parked_then_driving(start=20.0, speed=15.0, seed=4, seconds=60.0):
    """A car that stands for `start` s at 40 deg heading and then drives off in that direction,
    turning from time to time."""
    v = lambda t: speed * ramp(t, start + 6, 2.0)
    course = lambda t: (
        DEG * (40 + 60 * np.sin(2 * np.pi * (t - start) / 25) * ramp(t, start + 12, 2.0))
    )
    motion = Motion(
        "car",
        (DEG * 50, DEG * 10, 100.0),
        lambda t: (v(t) * np.cos(course(t)), v(t) * np.sin(course(t)), 0 * t),
        lambda t: (DEG * 2 + 0 * t, DEG * 3 + 0 * t, course(t)),
    )
    return sd.simulate(
        motion, seconds, SPEC, seed, 50.0, Gnss(0.5, (1, 1, 1), (0.05, 0.05, 0.05), ARM)
    )


def errors_of(start, recording):
    """(position m, attitude rad in n) true - estimate at the start."""
    truth = recording.reference
    row = int(np.argmin(np.abs(truth.t - start.t)))
    estimate = Rotation.from_euler("ZYX", start.rph[::-1])
    return displacement(truth.lla[row], np.array(start.lla)), (
        truth.rotation[row] * estimate.inv()
    ).as_rotvec()


def test_from_rest_to_the_first_course():
    recording = parked_then_driving()
    start = sd.align(recording, SPEC)
    position, attitude = errors_of(start, recording)
    assert (
        "course" in start.note
        and "level from the standstill" in start.note
        and "gyro bias from" in start.note
    )
    assert 20 < start.t < 30 and np.abs(position / start.std[:3]).max() < 4
    assert np.abs(attitude / start.std[6:9]).max() < 3 and abs(attitude[2]) < 5 * DEG
    b_g = recording.meta["b_g"][0]
    assert (
        np.abs((b_g - start.b_g) / start.std[12:]).max() < 4
        and start.std[12] < 5e-4 < np.abs(b_g).max()
    )


def test_smooth_motion_is_not_taken_for_rest():
    """By the IMU alone steady flight is rest; its fixes say otherwise, and then neither level
    nor gyro bias come from it."""
    motion = Motion(
        "steady",
        (DEG * 50, 0.0, 1000.0),
        lambda t: (60.0 + 0 * t, 0 * t, 0 * t),
        lambda t: (0 * t, 0.05 + 0 * t, 0 * t),
    )
    start = sd.align(sd.simulate(motion, 20.0, SPEC, 1, 50.0), SPEC, at=15.0)
    assert "rest" not in start.note and start.std[12] == pytest.approx(SPEC.bias_std()[1])


@pytest.mark.short
def test_heading_as_the_caller_knows_it_or_as_it_is_measured():
    recording = sd.simulate(
        static((DEG * 50, DEG * 10, 100.0), (0.02, -0.01, 2.0)), 6.0, SPEC, 2, 20.0
    )
    given = sd.align(recording, SPEC, heading=2.0, heading_std=0.01)
    assert given.rph[2] == 2.0 and given.std[8] == 0.01 and "heading given" in given.note
    compass = Source("heading", np.arange(1.0, 6.0), np.full((5, 1), 1.99), np.full((5, 1), 0.02))
    measured = sd.align(replace(recording, sources=(*recording.sources, compass)), SPEC)
    assert (
        measured.rph[2] == 1.99 and measured.std[8] == 0.02 and "heading measured" in measured.note
    )


@pytest.mark.short
def test_an_unknown_heading_is_stated_with_its_uncertainty():
    start = sd.align(sd.simulate(static((DEG * 50, DEG * 10, 100.0)), 6.0, SPEC, 2, 20.0), SPEC)
    assert start.std[8] == pytest.approx(UNKNOWN_STD) and "heading unknown" in start.note


def test_a_poor_heading_converges_once_the_vehicle_manoeuvres():
    recording = parked_then_driving(seconds=120.0)
    start = sd.align(recording, SPEC)
    off = start._replace(
        rph=(*start.rph[:2], start.rph[2] + 25 * DEG),
        std=(*start.std[:8], 30 * DEG, *start.std[9:]),
    )
    solution = sd.fuse(recording, imu=SPEC, start=off)
    e = sd.errors(solution, recording.reference)
    late = e.t > 90
    assert (
        np.degrees(np.abs(e.rph[late, 2])).max() < 3
        and (np.abs(e.rph[late, 2]) < 4 * e.std[late, 8]).mean() > 0.95
    )


@pytest.mark.short
def test_the_lever_arm_is_taken_off_the_antenna():
    recording = sd.simulate(
        static((DEG * 50, DEG * 10, 100.0), (0.0, 0.0, 1.0)),
        6.0,
        SPEC,
        2,
        20.0,
        Gnss(1.0, (1e-3,) * 3, None, ARM),
    )
    start = sd.align(recording, SPEC, heading=1.0)
    assert (
        np.abs(displacement(np.array(start.lla), np.array([DEG * 50, DEG * 10, 100.0]))).max()
        < 0.02
    )


@pytest.mark.short
def test_velocity_comes_from_positions_where_nothing_else_tells_it():
    motion = Motion(
        "straight",
        (DEG * 50, 0.0, 1000.0),
        lambda t: (30.0 + 0 * t, 40.0 + 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, np.arctan2(40, 30) + 0 * t),
    )
    recording = sd.simulate(motion, 6.0, SPEC, 1, 20.0, Gnss(1.0, (0.01,) * 3, None))
    start = sd.align(recording, SPEC)
    assert np.allclose(start.v_n, [30, 40, 0], atol=0.1) and start.rph[2] == pytest.approx(
        np.arctan2(40, 30), abs=0.01
    )


@pytest.mark.short
def test_without_a_position_there_is_no_start():
    recording = sd.simulate(static((DEG * 50, DEG * 10, 100.0)), 6.0, SPEC, 2, 20.0)
    with pytest.raises(DataError, match="no position fix"):
        sd.align(replace(recording, sources=recording.sources[1:]), SPEC)
    with pytest.raises(DataError, match="no position fix .* or choose an attitude filter"):
        sd.fuse(Recording(Imu(*recording.imu)), imu=SPEC)


@pytest.mark.short
def test_a_start_can_be_printed_and_overridden():
    recording = sd.simulate(static((DEG * 50, DEG * 10, 100.0)), 6.0, SPEC, 2, 20.0)
    start = sd.align(recording, SPEC)
    assert "lla=" in repr(start) and "note=" in repr(start)
    solution = sd.fuse(recording, imu=SPEC, start=start._replace(rph=(0.1, 0.0, 0.0)))
    assert solution.meta["start"]["rph"] == (0.1, 0.0, 0.0)
