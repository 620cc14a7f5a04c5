"""`tune` on a receiver whose classes scatter differently."""

from dataclasses import replace

import classed
import numpy as np
import pytest

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla


@pytest.mark.deep
def test_each_class_gets_the_noise_that_it_has():
    """Float fixes with 6 m more than the 1.5 m that all state; the others keep theirs."""
    drive = sd.simulate("car", duration=180.0, seed=5)
    position, velocity = drive.sources
    classes = classed.alternating(len(position.t), 50)
    more = (classes == "float")[:, None] * np.random.default_rng(1).normal(0, 6, (len(classes), 3))
    drive = replace(drive, sources=(replace(position, y=displace_lla(position.y, more)), velocity))
    tuned = sd.tune(classed.split(drive, classes), "closed-loop")
    found = [
        each for each in tuned.parameters if each.part == "horizontal" and "position" in each.source
    ]
    for name, std in (("fixed", 1.5), ("float", np.hypot(1.5, 6.0)), ("single", 1.5)):
        (each,) = (each for each in found if each.source.endswith(name))
        assert 0.85 < each.value / std < 1.15
