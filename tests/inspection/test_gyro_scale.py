"""The scale of the gyro against the course."""

from dataclasses import replace

import pytest

import strapdown as sd
from strapdown.data.verdict import HEADING, TILT
from strapdown.inspection.gyro_scale import check
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.gnss import Gnss

GOOD = Gnss(0.2, 0.5, 0.02)


def found(recording, scale=1.0):
    imu = recording.imu
    return check(
        InspectedRecording(replace(recording, imu=imu._replace(dtheta=scale * imu.dtheta)))
    )


@pytest.fixture(scope="module")
def drive():
    return sd.simulate("car", 700.0, "industrial", 5, gnss=GOOD)


@pytest.mark.parametrize("scale, words", [(1.03, "more"), (0.97, "less")])
def test_a_scale_is_named_with_its_value(drive, scale, words):
    (reason,) = found(drive, scale).reasons
    assert reason.cause == "gyro" and words in reason.seen and reason.weight > 1
    value = float(reason.seen.split("turns ")[1].split(" +-")[0])
    assert value == pytest.approx(3.0, abs=0.7)


def test_right_scales_are_facts_or_told_as_coarse():
    """10 drives, five standard deviations: a false alarm below 1 in 10^5."""
    for seed in range(10):
        said = found(sd.simulate("robot", 240.0, "industrial", seed=seed))
        assert not said.reasons and "scale of the gyro" in said.facts[0]
        (coarse,) = said.untested
        assert coarse.rests == (TILT, HEADING) and coarse.cause == "gyro" and coarse.remedy


@pytest.mark.parametrize("name", ["straight", "multicopter", "hover", "ship-heave"])
def test_what_does_not_turn_or_has_no_course_tells_nothing(name):
    said = found(sd.simulate(name, 200.0, "industrial", seed=2))
    assert not said.reasons and not said.facts


def test_an_aircraft_that_banks_is_not_doubted():
    for seed in range(5):
        assert not found(sd.simulate("demo", 600.0, "tactical", seed=seed)).reasons
