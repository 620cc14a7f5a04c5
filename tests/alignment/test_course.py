"""Courses as headings: as sure as their fixes, at any speed, and none where nothing moves."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.alignment.course_heading import (
    COURSE_STD,
    DRIFT,
    MOVING,
    best_instant,
    courses,
    heading_of,
)
from strapdown.core.loop.contract import Imu
from strapdown.data.solution import Source
from strapdown.geometry.geodesy import displace_lla

LLA = np.array([0.9, 0.1, 100.0])
pytestmark = pytest.mark.short


def imu(seconds=40.0, rate=0.0, shake=1.0, step=0.02):
    """Turns at `rate` (rad/s) about the vertical and is shaken by `shake` (m/s^2)."""
    n = round(seconds / step)
    f = np.tile([0.0, 0.0, -9.81], (n, 1))
    f[:, 0] += shake * np.where(np.arange(n) % 2, 1.0, -1.0)
    return Imu(
        step * np.arange(1, n + 1),
        np.full(n, step),
        np.tile([0.0, 0.0, rate * step], (n, 1)),
        f * step,
    )


def positions(v, std, seconds=40, seed=1):
    """A fix a second, at a constant velocity (m/s, north and east)."""
    t = np.arange(1.0, seconds)
    noise = np.random.default_rng(seed).normal(0, std, (len(t), 3))
    y = displace_lla(LLA, t[:, None] * np.array([*v, 0.0]) + noise)
    return Source("position", t, y, np.full((len(t), 3), std))


def speeds(v, std, seconds=40, interval=1.0, seed=1):
    t = np.arange(interval, seconds, interval)
    noise = np.random.default_rng(seed).normal(0, std, (len(t), 3))
    return Source("velocity", t, np.array([*v, 0.0]) + noise, np.full((len(t), 3), std))


def test_at_walking_speed_a_course_is_as_sure_as_its_velocities():
    found = heading_of(
        courses(imu(), positions((0.6, 0.8), 2.0), speeds((0.6, 0.8), 0.05)), imu(), 20.0
    )
    assert found.heading == pytest.approx(np.arctan2(0.8, 0.6), abs=0.15)
    assert found.std == pytest.approx(np.linalg.norm([COURSE_STD, DRIFT, 0.05]), rel=0.05)
    assert found.note == "heading from the course at 1.0 m/s"


def test_several_fixes_make_a_course_where_one_does_not():
    slow, noise = (0.6, 0.8), 0.4
    found = courses(imu(), positions(slow, 5.0), speeds(slow, noise))
    assert found.std[10] == pytest.approx(noise / np.sqrt(8), rel=1e-6)
    assert np.abs(found.v[10:] - slow).max() < 4 * noise / np.sqrt(8)
    walked = courses(imu(), positions(slow, 0.5), None)
    # over 8 s, of which each end errs
    assert walked.std[12] == pytest.approx(np.hypot(0.5, 0.5) / 8, rel=1e-6)


def test_velocities_of_the_same_second_count_as_one():
    found = courses(imu(), positions((1.0, 0.0), 5.0), speeds((1.0, 0.0), 0.4, interval=0.1))
    assert found.std[100] == pytest.approx(0.4 / np.sqrt(1 + 6.3), rel=1e-6)  # 64 fixes


def test_a_body_that_turns_makes_the_course_of_several_fixes_doubtful():
    straight = courses(imu(), positions((0.6, 0.8), 0.5), None)
    turning = courses(imu(rate=0.2), positions((0.6, 0.8), 0.5), None)
    assert straight.noise[20] < 0.1 and 0.25 < turning.noise[20]


def test_differences_of_noisy_positions_are_no_course():
    """They read 21 m/s and more; one in 3e5 would pass."""
    noisy = positions((0.0, 0.0), 15.0, 2000)
    still, shaken = imu(2000.0, shake=0.0, step=0.1), imu(2000.0, step=0.1)
    found = courses(still, noisy, None)
    assert found.speed.max() > 4 * MOVING
    assert best_instant(found, still) is None and best_instant(found, shaken) is None


def test_at_rest_fixes_that_are_worse_than_they_say_are_no_course():
    liars = speeds((0.0, 0.0), 0.3, 600)
    liars = Source("velocity", liars.t, liars.y, 0.4 * liars.std)
    still, shaken = imu(600.0, shake=0.0), imu(600.0)
    found = courses(still, positions((0.0, 0.0), 2.0, 600), liars)
    assert best_instant(found, shaken) is not None and best_instant(found, still) is None
    cruise = courses(still, positions((60.0, 0.0), 2.0, 600), speeds((60.0, 0.0), 0.3, 600))
    assert best_instant(cruise, still) == 0  # smooth travel feels like rest


def test_a_fast_course_is_waited_for_but_not_for_ever():
    def after(seconds):
        fixes = positions((1.0, 0.0), 2.0, 600)
        moving = speeds((1.0, 0.0), 0.05, 600)
        fast = (moving.t >= seconds)[:, None] & [True, False, False]
        moving = replace(moving, y=np.where(fast, 12.0, moving.y))
        found = courses(imu(600.0), fixes, moving)
        return found.t[best_instant(found, imu(600.0))]

    assert after(120.0) == 120.0 and after(500.0) == 1.0
