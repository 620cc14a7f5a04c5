"""Fixes that accelerate together and that the IMU did not feel."""

from dataclasses import replace

import numpy as np
import pytest
from test_second_filter import spoofed

import strapdown as sd
from strapdown.engine.sensitivity import BLOCKS, Sums
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.verdict import accelerating_fixes
from strapdown.verdict.accelerating_fixes import AXES, MIN_GAIN, _estimate, estimate_acceleration


@pytest.fixture(scope="module")
def flight():
    return sd.simulate("demo", 210.0, seed=12)


def test_a_small_acceleration_is_found_with_its_onset(flight):
    right, wrong = (sd.fuse(each) for each in (flight, spoofed(flight, 0.02)))
    assert estimate_acceleration(right).gain < 0.6 * MIN_GAIN
    found = estimate_acceleration(wrong)
    assert found.gain > MIN_GAIN and found.onset == pytest.approx(90.0, abs=15.0)
    np.testing.assert_allclose(found.value, [0.02, 0.0], atol=0.008)
    (reason,) = accelerating_fixes.check(wrong)
    assert "m/s^2 north" in reason.seen and reason.weight >= 1


@pytest.mark.parametrize("name", ["closed-loop", "nlo", "fixed-gain"])
def test_the_verdict_of_every_filter_says_it(flight, name):
    recording = sd.simulate("demo", 210.0, seed=12, attitude=Ahrs(rate=1.0))
    assert sd.fuse(recording, name).verdict.trusted
    verdict = sd.fuse(spoofed(recording, 0.02), name).verdict
    assert not verdict.trusted and "the IMU did not feel it" in str(verdict)


def test_positions_alone_say_nothing(flight):
    alone = [a for a in flight.sources if a.kind == "position"]
    solution = sd.fuse(replace(flight, sources=tuple(alone)))
    assert accelerating_fixes.check(solution) == []


def test_blocks_that_disagree_lower_the_gain():
    """By hand: equal information in each block, of a value of 1 in both axes, or of 5 and -3 in turn."""
    information = np.tile(4.0 * np.eye(AXES), (BLOCKS, 1, 1))
    steady = Sums(information, np.full((BLOCKS, AXES), 4.0))
    found = _estimate(steady, 0, 1.0)
    assert found.gain == pytest.approx(4.0 * AXES * BLOCKS)
    np.testing.assert_allclose(found.value, 1.0)
    unsteady = Sums(
        information, np.resize([[20.0], [-12.0]], (BLOCKS, 1)) + np.zeros((BLOCKS, AXES))
    )
    spread = 16.0 * 4.0 * BLOCKS / (BLOCKS - 1)
    assert _estimate(unsteady, 0, 1.0).gain == pytest.approx(4.0 * AXES * BLOCKS / spread)
