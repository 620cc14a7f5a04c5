"""The vector between two antennas against its length and the course."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection import baseline
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.any_sensor import Simulated

GIVEN = (1.2, -0.1, 0.05)


@pytest.fixture(scope="module")
def drive():
    sensor = Simulated("baseline", 0.005, 5.0, GIVEN)
    return sd.simulate("car", duration=120.0, seed=11, sensors=[sensor])


def with_given(recording, vector):
    """The recording whose description says that vector."""
    return replace(
        recording,
        sources=tuple(
            replace(a, parameters=tuple(vector)) if a.kind == "baseline" else a
            for a in recording.sources
        ),
    )


def found(recording):
    return baseline.check(InspectedRecording(recording))


def test_a_right_baseline_is_two_facts(drive):
    said = found(drive)
    assert not said.reasons and not said.inconclusive
    assert "its length is 1.20" in said.facts[0] and "against the course" in said.facts[1]


def test_swapped_antennas_are_named(drive):
    (reason,) = found(with_given(drive, -np.array(GIVEN))).reasons
    assert reason.cause == "baseline" and "two antennas are swapped" in reason.seen
    assert not sd.fuse(with_given(drive, -np.array(GIVEN)), "closed-loop").verdict.trusted


def test_a_vector_of_other_axes_is_no_swap(drive):
    (reason,) = found(with_given(drive, (0.1, 1.2, 0.05))).reasons
    assert "turned by" in reason.seen and "swapped" not in reason.seen


def test_a_wrong_length_names_the_measured_one(drive):
    (reason,) = found(with_given(drive, 1.5 * np.array(GIVEN))).reasons
    assert reason.cause == "baseline" and "its length is 1.20" in reason.seen
    assert "correct `baseline`" in reason.remedy and "given 1.808 m" in reason.seen


def test_jumping_lengths_are_the_carrier_solution(drive):
    rng, sources = np.random.default_rng(2), []
    for a in drive.sources:
        if a.kind == "baseline":
            wrong = rng.random(len(a.t)) < 0.3
            a = replace(a, y=a.y * np.where(wrong, 1.2, 1.0)[:, None])
        sources.append(a)
    (reason,) = found(replace(drive, sources=tuple(sources))).reasons
    assert reason.cause == "outliers" and "fixed carrier solution" in reason.remedy


def test_the_start_takes_its_heading(drive):
    """At rest, where no course tells it."""
    start = sd.align(drive, drive.meta["grade"])
    heading = np.interp(start.t, drive.reference.t, np.unwrap(drive.reference.rph[:, 2]))
    assert abs(np.angle(np.exp(1j * (start.rph[2] - heading)))) < np.radians(2)
