"""Headings tried where nothing tells the heading: the fixes decide, or the start says that they do
not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.alignment.initial_heading import UNKNOWN_STD
from strapdown.engine.heading_hypotheses import DOUBTFUL, REUSE, _mean, align_start
from strapdown.io.readers.broad import with_positions
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion, demo_flight, ramp, static
from strapdown_reproductions.worth.sensors import WITH_DIVE, record_motion, with_kinds

LLA = (DEG * 50, DEG * 7, 150.0)
IMU = "industrial"


def carried(heading, stands=0.0):
    """Walks east with the IMU held at any heading, to and fro after having stood."""
    begun = (lambda t: ramp(t, stands + 2, 0.5)) if stands else (lambda t: 1.0 + 0 * t)
    return Motion(
        "carried",
        LLA,
        lambda t: (
            begun(t) * 0.8 * np.sin(0.9 * t),
            begun(t) * (0.7 + 0.6 * np.sin(0.5 * t)),
            begun(t) * 0.1 * np.sin(2 * t),
        ),
        lambda t: (
            0.2 + begun(t) * 0.1 * np.sin(t),
            0.3 + 0 * t,
            heading + 0.2 * np.sin(0.3 * t) * begun(t),
        ),
    )


def heading_error(start, recording):
    truth = recording.reference
    row = int(np.argmin(np.abs(truth.t - start.t)))
    return (start.rph[2] - truth.rph[row, 2] + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("heading", [0.5, 3.1, 5.0])
def test_the_fixes_of_a_carried_imu_decide_and_not_its_course(heading):
    recording = sd.simulate(carried(heading), 40.0, IMU, 4, 50.0, Gnss(0.2, 1.0, 0.1))
    start = align_start(recording, sd.imu(IMU))
    assert "deg found by trying 12 headings over" in start.note and start.std[8] < DOUBTFUL
    assert abs(heading_error(start, recording)) < 3 * start.std[8]
    solution = sd.fuse(recording)
    assert solution.meta["start"]["note"] == start.note
    late = sd.errors(solution, recording.reference)
    assert np.degrees(np.abs(late.rph[late.t > 30, 2])).max() < 5


def test_a_heading_found_after_a_rest_is_that_of_the_rest():
    recording = sd.simulate(carried(4.0, 15.0), 50.0, IMU, 4, 50.0, Gnss(1.0, 1.5, None))
    recording = recording.between(2.0)
    start = align_start(recording, sd.imu(IMU))
    assert abs(heading_error(start, recording)) < 3 * start.std[8] < 3.0


def test_what_stands_has_no_heading():
    recording = sd.simulate(static(LLA, (0.0, 0.0, 2.0)), 30.0, IMU, 1, 50.0, Gnss(0.5, 2.0, None))
    start = align_start(recording, sd.imu(IMU))
    assert start.std[8] == UNKNOWN_STD and "heading unknown" in start.note


def test_where_fixes_end_nothing_is_tried():
    recording = sd.simulate(carried(1.0, 15.0), 30.0, IMU, 4, 50.0, Gnss(1.0, 1.5, None))
    early = replace(recording, sources=tuple(a.between(0.0, 5.0) for a in recording.sources))
    assert "tried" not in align_start(early, sd.imu(IMU)).note
    short = recording.between(0.0, 1.02)
    assert "heading unknown" in align_start(short, sd.imu(IMU)).note


def test_a_slow_straight_course_is_a_guess_that_nothing_confirms():
    straight = Motion(
        "straight", LLA, lambda t: (0 * t, 1 + 0 * t, 0 * t), lambda t: (0 * t, 0 * t, 1.7 + 0 * t)
    )
    recording = sd.simulate(straight, 40.0, IMU, 1, 50.0, Gnss(0.2, 1.0, 0.1))
    start = align_start(recording, sd.imu(IMU))
    assert "12 headings tried over" in start.note and "deg" in start.note
    assert np.degrees(start.std[8]) > 45 and abs(heading_error(start, recording)) < start.std[8]


def test_a_sure_heading_is_not_tried():
    fast = sd.simulate(demo_flight(), 20.0, IMU, 4, 50.0)
    assert align_start(fast, sd.imu(IMU)) == sd.align(fast, sd.imu(IMU))
    slow = sd.simulate(carried(1.0), 20.0, IMU, 4, 50.0)
    alone = align_start(slow, sd.imu(IMU), position=False)
    assert alone == sd.align(slow, sd.imu(IMU), position=False)


def test_recorded_hands(data_folder):
    """BROAD: an IMU turned about all axes, its heading to its way arbitrary; truth by cameras."""
    errors = []
    for path in sorted((data_folder / "broad").glob("*.npz")):
        trial = sd.read(path)
        placed = with_positions(replace(trial, sources=()), 10.0, 0.05)
        begin = trial.meta["movement"][0][0]
        for after in (20.0,):
            recording = placed.between(begin + after)
            start = align_start(recording, sd.imu("consumer"))
            row = int(np.argmin(np.abs(trial.reference.t - start.t)))
            turn = trial.reference.rotation[row] * euler(start.rph).inv()
            errors.append(turn.as_rotvec() / start.std[6:9])
            assert "12 headings" in start.note, start.note
    assert len(errors) == 5 and np.abs(errors).max() < 3.5
    assert (np.mean(np.square(errors), axis=0) < 2.5).all()


def euler(rph):
    return Rotation.from_euler("ZYX", rph[::-1])


@pytest.mark.short
def test_mean_of_weighted_headings():
    headings = np.radians([350.0, 10.0])
    mean, spread = _mean(headings, np.ones(2))
    assert mean == pytest.approx(0.0, abs=1e-9) and np.degrees(spread) == pytest.approx(
        10, rel=0.02
    )
    assert _mean(np.radians([0.0, 180.0]), np.ones(2))[1] > np.radians(150) and REUSE == 4


def test_a_sensor_that_contradicts_gnss_has_no_say():
    """A depth in feet, which read 134 deg of heading into the motion."""
    made = with_kinds(record_motion(WITH_DIVE["underwater"], 2), ("depth",))
    (alone, right, wrong) = (
        align_start(each, sd.imu(IMU))
        for each in (
            with_kinds(made, ()),
            made,
            replace(
                made,
                sources=tuple(
                    replace(a, y=a.y / 0.3048) if a.kind == "depth" else a for a in made.sources
                ),
            ),
        )
    )
    assert np.degrees(abs(heading_error(wrong, made))) < 30.0
    assert abs(heading_error(wrong, made) - heading_error(alone, made)) < 1e-9
    assert np.degrees(abs(heading_error(right, made))) < 30.0
