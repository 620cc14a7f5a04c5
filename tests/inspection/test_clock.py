"""The clock of the fixes: offsets are measured within what is claimed, leap seconds are named."""

from dataclasses import replace

import bent
import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection.clock_offsets import check, coarse_lag
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import car


@pytest.mark.parametrize("seconds", [-40.3, -1.0, -0.25, 0.0, 0.1, 2.0, 18.0])
def test_an_offset_is_measured(drive, seconds):
    subject = InspectedRecording(bent.later(drive, seconds))
    (source,) = subject.sources("velocity")
    lag = coarse_lag(subject, source)
    assert lag.believed and lag.std < 0.05
    assert abs(lag.seconds + seconds) < 3 * lag.std


def test_of_an_aircraft_by_its_accelerations(flight):
    subject = InspectedRecording(bent.later(flight, 7.0))
    lag = coarse_lag(subject, subject.sources("velocity")[0])
    assert lag.believed and abs(lag.seconds + 7.0) < max(3 * lag.std, 0.1)


@pytest.mark.parametrize(
    "seconds, words",
    [
        (18.0, "leap seconds between GPS time and UTC"),
        (-37.0, "leap seconds between TAI and UTC"),
        (19.0, "TAI against GPS time"),
    ],
)
def test_leap_seconds_are_named(drive, seconds, words):
    (reason,) = check(InspectedRecording(bent.later(drive, seconds))).reasons
    assert reason.cause == "clock" and reason.source == "" and words in reason.seen
    assert f"add {-seconds:+.4g} s to `offset`" in reason.remedy


def test_one_source_alone(drive):
    late = bent.later(drive, 0.5, "velocity")
    (reason,) = check(InspectedRecording(late, apart=True)).reasons
    assert reason.source == "GNSS velocity" and "-0.5" in reason.seen
    # positions that hardly tell are taken to be as late, unless they are known not to be
    (reason,) = check(InspectedRecording(late)).reasons
    assert reason.source == "" and "every source" in reason.remedy


def test_a_right_clock_is_a_fact(drive):
    found = check(InspectedRecording(drive))
    assert found.reasons == [] and any("clock of GNSS velocity" in fact for fact in found.facts)


@pytest.mark.parametrize("imu", ["tactical", "industrial"])
@pytest.mark.parametrize("seed", range(1, 5))
def test_gaps_in_fixes_move_no_clock(seed, imu):
    """All eight were accused of -1 s, an end of the search: with few fixes the whole vectors
    may have no best lag inside. Accused are 2 of 500 flights and drives with gaps of other lengths."""
    whole = sd.simulate("demo", 300, imu=imu, seed=seed)
    windows = [(t, t + 20.0) for t in range(100, 300, 60)]
    gaps = replace(whole, sources=tuple(a.without(windows) for a in whole.sources))
    assert check(InspectedRecording(gaps)).reasons == []


def test_an_antenna_far_from_the_imu():
    """A mast that swings: without the lever arm the accelerations are others."""
    ship = sd.simulate("ship", duration=600.0, seed=1003)
    lag = coarse_lag(InspectedRecording(ship), ship.sources[1])
    assert lag.believed and abs(lag.seconds) < max(3 * lag.std, 0.05)


def test_an_even_motion_is_inconclusive(drive):
    still = bent.velocity(drive, lambda v: np.tile([10.0, 0.0, 0.0], (len(v), 1)))
    found = check(InspectedRecording(still))
    assert any("clock of GNSS velocity" in text for text in found.inconclusive)
    assert not any(reason.source == "GNSS velocity" for reason in found.reasons)


def test_of_a_motion_that_repeats_itself_the_smaller_offset_is_meant():
    """Laps of 60 s fit with an offset of -1 s and of +59 s alike: neither is believed."""
    lap = [
        {"duration": 18.0},
        {"duration": 6.0, "turn": np.pi},
        {"duration": 3.0, "speed": 2.0},
        {"duration": 10.0},
        {"duration": 3.0, "speed": 4.0},
        {"duration": 6.0, "turn": np.pi},
        {"duration": 14.0},
    ]
    laps = car((0.9, 0.1, 60.0), 0.3, [{"duration": 3.0, "speed": 4.0}, {"repeat": 4, "legs": lap}])
    recording = sd.simulate(laps, 240.0, "industrial", 4, gnss=Gnss(0.2, 0.5, 0.05))
    late = tuple(replace(a, t=a.t + 1.0).between(*recording.span) for a in recording.sources)
    subject = InspectedRecording(replace(recording, sources=late))
    lag = coarse_lag(subject, late[1])
    assert abs(lag.seconds + 1.0) < 0.1 and not lag.believed
