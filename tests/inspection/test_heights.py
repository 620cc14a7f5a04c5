"""Heights of two sources: a constant difference is named, scatter and small differences are not."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.data.solution import Aiding
from strapdown.inspection.height_differences import check
from strapdown.inspection.motion import InspectedRecording


def with_altitude(recording, off, scatter=1.0, sd=2.0):
    """With an altitude that differs by `off` (m) from the height of the positions."""
    position = recording.aidings[0]
    noise = np.random.default_rng(1000).normal(0, scatter, (len(position.t), 1))
    y = position.y[:, 2:] + off + noise
    altitude = Aiding("altitude", position.t, y, np.full(y.shape, sd), name="altitude")
    return InspectedRecording(replace(recording, aidings=(*recording.aidings, altitude)))


@pytest.mark.parametrize(
    "off, words", [(-47.3, "+47.3 m"), (30.0, "-30.0 m"), (400.0, "wrong unit, scale or zero")]
)
def test_a_constant_difference_is_named(drive, off, words):
    (reason,) = check(with_altitude(drive, off)).reasons
    assert reason.cause == "height" and words in reason.seen and "ellipsoid" in reason.remedy


@pytest.mark.parametrize("off, scatter, sd", [(3.0, 1.0, 2.0), (20.0, 30.0, 2.0), (20.0, 1.0, 10)])
def test_what_is_small_is_a_fact(drive, off, scatter, sd):
    found = check(with_altitude(drive, off, scatter, sd))
    assert found.reasons == [] and "height of GNSS position less" in found.facts[0]


def test_one_source_alone_does_not_tell(drive):
    (text,) = check(InspectedRecording(drive)).inconclusive
    assert "no other source" in text
