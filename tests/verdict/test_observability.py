"""What a recording cannot show, and what rests on it."""

from dataclasses import replace

import pytest

import strapdown as sd
from strapdown.data.verdict import HEADING, HEIGHT, POSITION, TILT
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer

NONE = Gnss(position_std=None, velocity_std=None)
COMPASS = Magnetometer(rate=10.0, field=(21e-6, 1.6e-6, 43.9e-6))


def resting(verdict, what):
    """What rests on the one thing whose name begins with `what`."""
    (found,) = [each for each in verdict.untested if each.what.startswith(what)]
    assert found.remedy
    return found.rests


@pytest.fixture(scope="module")
def drive():
    return sd.fuse(sd.simulate("car", duration=200.0, imu="industrial", seed=7))


def test_attitude_rests_on_the_mounting_and_height_on_its_only_source(drive):
    verdict = drive.verdict
    assert verdict.trusted
    assert resting(verdict, "mounting of the IMU") == (TILT, HEADING)
    assert resting(verdict, "height above geoid") == (HEIGHT,)
    assert POSITION in verdict.vouched and HEIGHT not in verdict.vouched


def test_a_heading_that_rests_on_a_magnetometer_alone():
    alone = sd.simulate("car", 120.0, "industrial", 3, gnss=NONE, magnetometer=COMPASS)
    verdict = sd.fuse(alone, "attitude-mekf").verdict
    assert resting(verdict, "heading") == (HEADING,)
    assert any("magnetometer alone" in each.why for each in verdict.untested)
    assert resting(verdict, "accelerometer biases") == (TILT, HEADING)


def test_an_accelerometer_bias_counts_as_tilt_where_nothing_turns(drive):
    straight = sd.fuse(sd.simulate("straight", 120.0, "industrial", seed=3)).verdict
    assert resting(straight, "horizontal accelerometer biases") == (TILT,)
    assert not any("accelerometer" in each.what for each in drive.verdict.untested)


def test_bounds_are_what_the_motion_would_have_shown(drive):
    """A clock error at the bound is doubted, of which a fifth is trusted."""
    (bound,) = [b for b in drive.verdict.bounds if b.what == "clock of GNSS velocity"]
    assert bound.unit == "s" and 0.02 <= bound.size < 0.15
    words = []
    for share in (0.2, 1.3):
        shifted = _late(drive.recording, share * bound.size)
        words.append(sd.fuse(shifted).verdict.trusted)
    assert words == [True, False]


def _late(recording, seconds):
    changed = (
        replace(a, t=a.t + seconds).between(*recording.span) if a.kind == "velocity" else a
        for a in recording.sources
    )
    return replace(recording, sources=tuple(changed))


def test_heights_and_axes_have_bounds_where_two_tell(drive):
    named = {bound.what: bound for bound in drive.verdict.bounds}
    assert named["axes of the IMU about the vertical"].size == 20.0
    assert "height above geoid or ellipsoid" not in named
    height = Simulated("altitude", 2.0, 1.0)
    both = sd.fuse(sd.simulate("car", 100.0, "industrial", seed=7, sensors=(height,))).verdict
    (bound,) = [each for each in both.bounds if each.cause == "height"]
    assert 5.0 <= bound.size < 20.0 and bound.unit == "m"


def test_three_mistakes_at_once_are_all_named():
    """A clock, a zero of the height, and stated standard deviations."""
    height = Simulated("altitude", 2.0, 1.0)
    drive = sd.simulate("car", 240.0, "industrial", seed=7, sensors=(height,))
    wrong = []
    for a in drive.sources:
        y = a.y - [0.0, 0.0, 47.0] if a.kind == "position" else a.y
        std = a.std / 5 if a.kind != "altitude" else a.std
        later = replace(a, t=a.t + 1.0 if a.kind != "altitude" else a.t, y=y, std=std)
        wrong.append(later.between(*drive.span))
    verdict = sd.fuse(replace(drive, sources=tuple(wrong))).verdict
    causes = list(dict.fromkeys(reason.cause for reason in verdict.reasons))
    assert verdict.word == "not to be trusted" and causes[0] == "clock"
    assert {"clock", "fix noise", "height"} <= set(causes)
