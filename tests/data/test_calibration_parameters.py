"""The table of parameters of an installation: whole, and with limits that fit together."""

import numpy as np
import pytest

from strapdown.data import calibration_parameters
from strapdown.data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE
from strapdown.data.verdict import CAUSES

pytestmark = pytest.mark.short
PARAMETERS = {**calibration_parameters.OF_SOURCE, **calibration_parameters.OF_IMU}.values()


@pytest.mark.parametrize("of", PARAMETERS, ids=lambda of: of.name)
def test_each_component_has_a_prior_and_a_motion_and_the_limits_are_in_order(of):
    assert len(of.components) == len(of.std) == len(of.motions) and all(of.motions)
    assert of.cause in CAUSES
    assert of.min_reported < of.known_std < max(of.std) < of.most
    if of in (CLOCK, LEVER_ARM, MOUNTING, SCALE):
        assert 0 < of.min_reported <= of.min_doubted and of.key and of.digits
        assert of.known_std < of.left_std <= of.given_std


def test_a_component_and_a_size_in_words():
    assert LEVER_ARM.component(2) == "lever arm down" and CLOCK.component(0) == "clock"
    assert MOUNTING.size(np.radians(2.0)) == "2 deg" and SCALE.size(0.01) == "0.01"
