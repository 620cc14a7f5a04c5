"""Heights of two sources: a constant difference is named, scatter and small differences are not."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.data.solution import Source
from strapdown.inspection.height_differences import check
from strapdown.inspection.motion import InspectedRecording


def with_altitude(recording, off, scatter=1.0, std=2.0):
    """With an altitude of the antenna that differs by `off` (m) from the height of its positions."""
    position = recording.sources[0]
    noise = np.random.default_rng(1000).normal(0, scatter, (len(position.t), 1))
    y = position.y[:, 2:] + off + noise
    altitude = Source(
        "altitude", position.t, y, np.full(y.shape, std), position.parameters[:3], name="altitude"
    )
    return InspectedRecording(replace(recording, sources=(*recording.sources, altitude)))


@pytest.mark.parametrize(
    "off, words", [(-47.3, "+47.3 m"), (30.0, "-30.0 m"), (400.0, "wrong unit, scale or zero")]
)
def test_a_constant_difference_is_named(drive, off, words):
    (reason,) = check(with_altitude(drive, off)).reasons
    assert reason.cause == "height" and words in reason.seen and "ellipsoid" in reason.remedy


@pytest.mark.parametrize("off, scatter, std", [(3.0, 1.0, 2.0), (20.0, 30.0, 2.0), (20.0, 1.0, 10)])
def test_what_is_small_is_a_fact(drive, off, scatter, std):
    found = check(with_altitude(drive, off, scatter, std))
    assert found.reasons == [] and "height of GNSS position minus" in found.facts[0]


def test_a_height_of_the_imu_agrees_with_that_of_an_antenna_on_a_mast(drive):
    """12 m above the IMU are no other zero."""
    masted = replace(drive.sources[0], parameters=(0.0, 0.0, -12.0))
    found = check(with_altitude(replace(drive, sources=(masted, *drive.sources[1:])), 0.0))
    lower = with_altitude(replace(drive, sources=(masted,)), -12.0).recording
    of_imu = replace(lower.sources[-1], parameters=(0.0, 0.0, 0.0))
    level = replace(lower, sources=(masted, of_imu))
    assert not found.reasons and not check(InspectedRecording(level)).reasons


def test_one_source_alone_does_not_tell(drive):
    (text,) = check(InspectedRecording(drive)).inconclusive
    assert "no other source" in text
