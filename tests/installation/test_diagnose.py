"""What is found of an installation that is wrong in a known way, that a right one is left alone, and
what is said where nothing can be told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from installed import car, flown, wrong

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.calibration_parameters import SCALE
from strapdown.installation.findings import CONSISTENT, NOT_OBSERVABLE
from strapdown.installation.iteration import MAX_RUNS
from strapdown.sensor_models.gnss import Gnss
from strapdown_reproductions.worth.sensors import WITH_DIVE, record_motion, with_kinds

DEG = np.pi / 180
FAULTS = {
    "clock 0.1 s": (("clock", 0.1), 0.012),
    "clock -18 s": (("clock", -18.0), 0.02),
    "clock of the velocity 0.1 s": (("clock", 0.1, 0, "velocity"), 0.012),
    "clock of the position 0.25 s": (("clock", 0.25, 0, "position"), 0.03),
    "clock of the odometer 0.15 s": (("clock", 0.15, 0, "speed"), 0.02),
    "lever arm forward 1 m": (("lever arm", 1.0, 0), 0.15),
    "lever arm down -3 m": (("lever arm", -3.0, 2), 0.25),
    "mounting pitch 2 deg": (("mounting", 2 * DEG, 1), 0.1),
    "mounting heading -5 deg": (("mounting", -5 * DEG, 2), 0.3),
    "scale 0.01": (("scale", 0.01), 0.002),
}
"""{name: (what `wrong` does, by what the value found may be off: five standard deviations or less)}."""


SPEEDS = {
    "airspeed": ("flight", ("true-airspeed", "side-slip"), (0.0, 0.1, -0.05)),
    "sound": ("underwater", ("range", "depth"), (0.0, 0.03)),
}
"""{name: (motion, kinds beside GNSS, errors of the scale of the first)}."""


@pytest.mark.parametrize("name, error", [(k, e) for k, each in SPEEDS.items() for e in each[2]])
def test_the_scale_of_an_airspeed_and_of_ranges_is_found(name, error):
    motion, kinds, _ = SPEEDS[name]
    for seed in (11, 12, 13):
        made = with_kinds(record_motion(WITH_DIVE[motion], seed), kinds)
        first = next(i for i, a in enumerate(made.sources) if a.kind == kinds[0])
        sources = list(made.sources)
        sources[first] = replace(sources[first], y=(1 + error) * sources[first].y)
        found = sd.diagnose(replace(made, sources=tuple(sources)))
        told = sources[first].name or kinds[0]
        (one,) = (p for p in found.parameters if p.of is SCALE and told in p.sources)
        assert abs(one.change - error) < 3 * one.std and one.std < 0.005, (seed, str(one))
        assert [p.name for p in found.found] == [one.name] * (error != 0), (seed, str(found))


def size(fault):
    kind, value = fault[:2]
    return value / DEG if kind == "mounting" else value


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_is_found_and_nothing_else(name):
    fault, tolerance = FAULTS[name]
    found = sd.diagnose(wrong(car(1002), *fault))
    assert [each.cause for each in found.found] == [fault[0]]
    (one,) = found.found
    assert one.change == pytest.approx(size(fault), abs=tolerance)
    assert abs(one.change - size(fault)) < 5 * one.std and one.std < tolerance
    assert found.gain > 25 and one.gain == pytest.approx(found.gain)
    assert found.runs <= MAX_RUNS and found.misfit < 1.5
    (reason,) = found.reasons
    assert reason.cause == fault[0] and reason.weight >= 1


def test_the_recording_found_is_the_right_one_and_the_solution_its_own():
    right = car(1003)
    found = sd.diagnose(wrong(right, "lever arm", 1.0, 1))
    for a, b in zip(found.recording.sources[:2], right.sources[:2]):
        np.testing.assert_allclose(a.parameters, b.parameters, atol=0.15)
    again = sd.fuse(found.recording)
    np.testing.assert_array_equal(again.trajectory.lla, found.solution.trajectory.lla)


def test_two_things_wrong_at_once():
    recording = wrong(wrong(car(1004), "clock", 0.2), "mounting", 3 * DEG, 1)
    found = sd.diagnose(recording)
    assert {each.cause: round(each.change, 1) for each in found.found} == {
        "clock": 0.2,
        "mounting": 3.0,
    }
    assert sum(each.gain for each in found.found) == pytest.approx(found.gain)


def test_a_clock_does_not_take_up_what_an_unreported_arm_is_off():
    """An arm of 0.4 m is within five standard deviations in this flight, and looks like a clock."""
    late = wrong(flown(1006), "clock", 0.1)
    (alone,), (beside,) = (
        sd.diagnose(each).found for each in (late, wrong(late, "lever arm", 0.4, 0))
    )
    assert beside.cause == "clock"
    assert abs(beside.change - alone.change) < 0.3 * alone.std


def test_a_right_one_is_left_alone_in_one_run():
    recording = car(1005)
    found = sd.diagnose(recording)
    assert not found.found and not found.reasons and not found.changes and found.gain == 0
    assert found.runs == 1 and found.recording.imu.dv is not None
    assert {each.status for each in found.parameters} == {CONSISTENT}
    assert found.lines[-1].startswith("nothing to change")


def test_what_a_flight_does_not_show_is_not_observable():
    found = sd.diagnose(flown(1006))
    status = {each.name: (each.status, each.motion) for each in found.parameters}
    assert status["mounting heading"] == (
        NOT_OBSERVABLE,
        "on a road vehicle, add the constraint zero-lateral-velocity",
    )
    assert status["lever arm forward"][0] == CONSISTENT


def test_without_turns_no_arm_shows():
    """200 s straight ahead: the clock shows where the speed changes, the arm to the side nowhere."""
    from strapdown.sim.trajectory import Motion

    motion = Motion(
        "straight",
        (0.8, 0.1, 300.0),
        lambda t: (20 + 5 * np.sin(0.1 * t), 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, 0 * t),
    )
    found = sd.diagnose(sd.simulate(motion, 200.0, "tactical", 1007, gnss=Gnss(interval=0.2)))
    status = {each.name: each.status for each in found.parameters}
    assert status["clock of GNSS position and GNSS velocity"] == CONSISTENT
    assert status["lever arm right"] == status["lever arm down"] == NOT_OBSERVABLE
    assert "turn" in next(e for e in found.parameters if e.name == "lever arm right").motion


def test_without_velocity_only_a_large_clock_is_reported():
    gnss = Gnss(interval=0.2, velocity_std=None)
    recording = car(1008, 300.0, vehicle=False, gnss=gnss)
    small = sd.diagnose(wrong(recording, "clock", 0.2))
    assert not small.found
    large = sd.diagnose(wrong(recording, "clock", 1.0))
    assert [each.name for each in large.found] == ["clock of GNSS position"]
    arms = [each for each in large.parameters if each.cause == "lever arm"]
    assert len(arms) == 3 and {each.motion for each in arms} == {"add a source of velocity"}


def test_changes_are_in_the_terms_of_the_description():
    recording = car(1009)
    recording = replace(
        recording,
        meta=recording.meta | {"imu_lever_arm": [0.0, 0.0, -0.6], "imu_mounting": [0.0, 0.0, 0.1]},
    )
    arm = sd.diagnose(wrong(recording, "lever arm", 1.0, 1))
    assert arm.changes[0].startswith("[[source]] 1 (GNSS position) lever_arm = [0.50, ")
    assert arm.changes[0].endswith(", -1.60]") and len(arm.changes) == 2
    given = {each.name: each.given for each in arm.parameters}
    assert given["lever arm down"] == pytest.approx(-1.6)
    turned = sd.diagnose(wrong(recording, "mounting", 3 * DEG, 2))
    (line,) = turned.changes
    heading = float(line.partition("heading = ")[2].partition(",")[0])
    assert heading == pytest.approx(np.degrees(0.1) + 3, abs=0.3)


def test_velocities_in_a_wrong_unit_stop_it():
    recording = car(1010)
    velocity = recording.sources[1]
    bad = replace(
        recording,
        sources=(
            recording.sources[0],
            replace(velocity, y=velocity.y / 3.6),
            *recording.sources[2:],
        ),
    )
    with pytest.raises(
        DataError, match="GNSS velocity.*correct this before you diagnose the installation$"
    ):
        sd.diagnose(bad)


def test_without_positions_there_is_nothing_to_diagnose():
    recording = car(1011)
    with pytest.raises(DataError, match="add one$"):
        sd.diagnose(replace(recording, sources=recording.sources[2:]))


@pytest.mark.deep
def test_right_ones_are_left_alone():
    """60 seeds: not one finding."""
    for seed in range(1200, 1220):
        for recording in (car(seed), car(seed, 300.0, "industrial", False), flown(seed)):
            assert not sd.diagnose(recording).found


@pytest.mark.deep
@pytest.mark.parametrize("seconds", [0.05, 0.25, 0.5, 1.0])
def test_clocks_are_found_within_12_ms(seconds):
    for seed in range(1220, 1225):
        for recording in (car(seed), flown(seed)):
            (one,) = sd.diagnose(wrong(recording, "clock", seconds)).found
            assert one.change == pytest.approx(seconds, abs=0.02)


@pytest.mark.deep
def test_recorded_ones(data_folder):
    """The drive is set up rightly but for a few cm and 0.3 deg; the flight's GPS is some 0.05 s late, which
    an interval that allows for time-correlated errors just does not show."""
    examples = Path(__file__).parents[2] / "examples/recordings"
    drive = sd.diagnose(sd.read(examples / "drive0708-vehicle.toml"))
    assert not drive.found
    flown = sd.diagnose(sd.read(examples / "thor75.toml"))
    (clock,) = (each for each in flown.parameters if each.cause == "clock")
    assert not flown.found and clock.change == pytest.approx(-0.049, abs=0.01)
    assert 0.01 < clock.std < 0.03
