"""Rest of a vehicle, and wheels that spin or lock, on simulated samples and at their edges."""

from dataclasses import replace

import numpy as np
import pytest
from test_samples import level

from strapdown.data.solution import Source
from strapdown.preprocessing.imu_samples import increments
from strapdown.preprocessing.stationary import at_rest
from strapdown.preprocessing.vehicle_rest import vehicle_at_rest
from strapdown.preprocessing.wheel_slip import MAX_SLIP, is_slipping, without_slip

pytestmark = pytest.mark.short


def wheel(t, y, std=0.05, **more):
    return Source("speed", t, np.asarray(y, float)[:, None], np.full((len(t), 1), std), **more)


def samples(t, gyro, accel):
    return increments(t, gyro, accel)[0]


# ---- rest


def test_a_turn_on_bias_is_no_motion():
    t, gyro, accel = level(2000)
    gyro[:] += [0.09, -0.08, 0.07]
    imu = samples(t, gyro, accel)
    assert not at_rest(imu).any() and vehicle_at_rest(imu).all()


def test_a_turn_at_a_steady_rate_is_no_rest():
    t, gyro, accel = level(3000)
    gyro[(t > 20) & (t < 30), 2] += 0.15
    rest = vehicle_at_rest(samples(t, gyro, accel))
    assert not rest[(t > 20) & (t < 30)].any() and rest[(t < 18.9) & (t > 12)].all()


def test_noise_of_many_samples_is_no_motion():
    """0.35 m/s^2 in samples at 1 kHz is what 0.11 is at 100 Hz."""
    t = 10 + np.arange(1, 10001) / 1000
    accel = np.random.default_rng(1).normal(0, 0.2, (len(t), 3)) - [0, 0, 9.8]
    imu = samples(t, np.random.default_rng(2).normal(0, 1e-3, (len(t), 3)), accel)
    assert not at_rest(imu).any() and vehicle_at_rest(imu).all()


@pytest.mark.parametrize("kind", ["speed", "velocity"])
def test_smooth_straight_motion_is_no_rest_where_a_speed_says_so(kind):
    imu = samples(*level(3000))
    t = np.arange(10.5, 40.0, 0.5)
    speed = np.where((t > 20) & (t < 30), 5.0, 0.0)
    fixes = wheel(t, speed, 0.1)
    if kind == "velocity":
        y = np.c_[0 * speed, -speed, 0 * speed]
        fixes = Source("velocity", t, y, np.full_like(y, 0.1))
    assert vehicle_at_rest(imu).all()
    rest = vehicle_at_rest(imu, [fixes])
    assert not rest[(imu.t > 20.1) & (imu.t < 29.9)].any()
    assert rest[(imu.t < 19.9) | (imu.t > 30.1)].all()


def test_a_speed_that_noise_explains_or_that_is_old_is_none():
    imu = samples(*level(3000))
    assert vehicle_at_rest(imu, [wheel(np.array([20.0]), [0.6], 0.1)]).all()
    rest = vehicle_at_rest(imu, [wheel(np.array([20.0]), [5.0], 0.1)])
    np.testing.assert_array_equal(rest, np.abs(imu.t - 20.0) > 1.5)
    assert vehicle_at_rest(imu, [wheel(np.empty(0), np.empty(0))]).all()


# ---- slip


def driven(seconds=60.0, slope=0.0):
    """Samples at 100 Hz and wheel speed at 10 of a car that swings between 6 and 14 m/s, up a slope
    (rad) that begins at 30 s; both with noise."""
    rng = np.random.default_rng(4)
    t = np.arange(1, int(100 * seconds) + 1) / 100
    v, acceleration = 10 + 4 * np.sin(0.3 * t), 1.2 * np.cos(0.3 * t)
    pitch = slope * np.clip((t - 30) / 2, 0, 1)
    gyro = np.c_[0 * t, np.gradient(pitch, t), 0 * t] + rng.normal(0, 1e-3, (len(t), 3))
    accel = np.c_[acceleration + 9.81 * np.sin(pitch), 0 * t, -9.81 * np.cos(pitch)]
    imu = samples(t, gyro, accel + rng.normal(0, 0.2, (len(t), 3)))
    rows = slice(9, None, 10)
    return imu, wheel(t[rows], v[rows] + rng.normal(0, 0.05, len(t[rows])))


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.1])
def test_ordinary_driving_is_no_slip(slope):
    imu, speed = driven(slope=slope)
    same, notes = without_slip(speed, imu)
    assert same is speed and not notes


@pytest.mark.parametrize("share", [-1.0, -0.3, 0.3, 1.0])
def test_spin_and_lock_are_left_out_and_nothing_else(share):
    imu, speed = driven(slope=0.05)
    wrong = (speed.t > 40.0) & (speed.t < 43.0)
    bad = replace(speed, y=speed.y * np.where(wrong, 1 + share, 1.0)[:, None], name="wheel")
    np.testing.assert_array_equal(is_slipping(bad, imu), wrong)
    left, [note] = without_slip(bad, imu)
    assert len(left.t) == len(speed.t) - wrong.sum()
    assert note.startswith(f"wheel: {wrong.sum()} fixes left out") and "40.1 to 42.9 s" in note


def test_what_lasts_is_followed_again():
    imu, speed = driven()
    bad = replace(speed, y=speed.y * np.where(speed.t > 30, 1.5, 1.0)[:, None])
    found = is_slipping(bad, imu)
    assert found[(speed.t > 30) & (speed.t < 30 + MAX_SLIP)].all()
    assert not found[speed.t > 30.1 + MAX_SLIP].any()


def test_a_wheel_speed_that_always_contradicts_is_kept_and_said():
    imu, speed = driven()
    bad = replace(speed, y=10 * np.sin(2 * speed.t)[:, None])
    kept, [note] = without_slip(bad, imu)
    assert kept is bad and "too many for wheel slip" in note and "clock" in note


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_few_fixes(rows):
    imu, speed = driven(5.0)
    assert not is_slipping(speed._where(np.arange(len(speed.t)) < rows), imu).any()


def test_backwards_is_below_zero():
    imu, speed = driven()
    back = imu._replace(dv=imu.dv * [-1.0, 1.0, 1.0])
    assert not is_slipping(replace(speed, y=-speed.y), back).any()
    assert is_slipping(speed, back).any()
