"""A multicopter flies to any side, and its accelerometer does not feel a tilt: neither its course
nor that is held against it."""

from dataclasses import replace

import numpy as np
import pytest
from multicopter import motion

import strapdown as sd
from strapdown.inspection import plane
from strapdown.inspection.motion import InspectedRecording
from strapdown.preprocessing.plausible import mistakes


@pytest.fixture(scope="module")
def sideways():
    """At 7 m/s to its right, as a copter and as anything."""
    still = sd.simulate(motion(), duration=60, imu="consumer", seed=2, rate=100.0)
    found = {}
    for vehicle in ("multicopter", "any"):
        found[vehicle] = replace(still, meta={**still.meta, "vehicle": vehicle})
    return found


def test_its_course_is_no_heading(sideways):
    assert "course" in sd.align(sideways["any"], sd.imu("consumer")).note
    start = sd.align(sideways["multicopter"], sd.imu("consumer"))
    assert "heading unknown" in start.note


def test_it_is_fused_all_the_same(sideways):
    recording = sideways["multicopter"]
    error = sd.rms(sd.errors(sd.fuse(recording), recording.reference), (30, 60))
    assert np.degrees(error.rph[2]) < 3


def test_its_forces_say_nothing_of_the_mounting(sideways):
    check = plane.check(InspectedRecording(sideways["multicopter"]))
    assert check.facts == check.reasons == check.inconclusive == []


def test_it_tilts_without_feeling_it(sideways):
    imu = sideways["any"].imu
    fast = imu._replace(dtheta=imu.dtheta * 4)
    fast = fast._replace(dv=np.tile([0.0, 0.0, -9.81], (len(imu.t), 1)) * imu.dt[:, None])
    assert [field for field, _ in mistakes(fast, "rate")] == ["gyro.unit"]
    assert mistakes(fast, "rate", "multicopter") == []
