"""Rest before, around and after a start, and what it says of the gyros; velocities in part."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.alignment.initial import align
from strapdown.alignment.rest import gyro_bias, rests
from strapdown.core.mathematics.earth import RATE
from strapdown.data.solution import Source
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sim.trajectory import DEG, Motion, ramp, static

LLA = (DEG * 50, DEG * 7, 150.0)
MEMS = ImuSpec("MEMS", Triad(noise=2e-4, turn_on_bias=0.005), Triad(noise=1e-3, turn_on_bias=0.02))
WANDERING = ImuSpec(
    "wandering", Triad(noise=2e-4, turn_on_bias=0.005, bias_walk=1e-5), Triad(noise=1e-3)
)
pytestmark = pytest.mark.short


def stopping(at=20.0):
    """Drives north-east, winding, and stops."""
    speed = lambda t: 8.0 * (1 - ramp(t, at, 0.5))
    course = lambda t: 0.8 + 0.3 * np.sin(0.8 * t) * (1 - ramp(t, at, 0.5))
    return Motion(
        "stopping",
        LLA,
        lambda t: (speed(t) * np.cos(course(t)), speed(t) * np.sin(course(t)), 0 * t),
        lambda t: (0.02 + 0 * t, 0.01 + 0 * t, course(t)),
    )


def test_a_rest_after_the_start_tells_the_gyro_bias():
    recording = sd.simulate(stopping(), 40.0, MEMS, 3, 50.0)
    start = align(recording, MEMS, at=5.0)
    z = (recording.meta["b_g"][0] - start.b_g) / start.std[12:]
    assert "s of rest 1" in start.note and "later" in start.note and np.abs(z).max() < 4
    assert start.std[12] < 0.1 * MEMS.bias_std()[1]
    none = align(recording.between(0.0, 19.0), MEMS, at=5.0)
    assert "biases unknown" in none.note and none.std[12] == MEMS.bias_std()[1]


def test_the_older_the_rest_the_less_sure():
    recording = sd.simulate(stopping(), 40.0, WANDERING, 3, 50.0)
    found = rests(recording, 2.0)
    stop = recording.imu.t[found.after[0][0]]
    near, far = (gyro_bias(recording.imu, WANDERING, t, found)[1] for t in (stop, stop - 19.0))
    np.testing.assert_allclose(far**2 - near**2, 1e-10 * 19.0, rtol=1e-6)


def test_a_start_within_a_rest_uses_all_of_it():
    recording = sd.simulate(static(LLA, (0.03, -0.02, 1.0)), 60.0, MEMS, 2, 50.0)
    start = align(recording, MEMS, heading=1.0)
    assert start.t == 1.0 and "level from the standstill 0 s before" in start.note
    assert "gyro bias from 60 s of rest" in start.note
    assert rests(recording, 1.0).until(recording.imu, 1.0) == recording.imu.t[-1]


def test_a_steady_turn_that_feels_like_rest_is_a_bias_only_as_far_as_the_gyro_may_have_one():
    turning = Motion(
        "turning", LLA, lambda t: (0 * t, 0 * t, 0 * t), lambda t: (0 * t, 0 * t, 0.06 * t)
    )
    recording = sd.simulate(turning, 20.0, MEMS, 1, 50.0)
    start = align(recording, MEMS, at=10.0)
    assert start.std[14] == pytest.approx(0.06, rel=0.2) and start.std[12] < 2 * RATE


@pytest.mark.parametrize("part", ["none", "some", "two columns"])
def test_a_velocity_without_vertical_part_serves(part):
    recording = sd.simulate(stopping(), 40.0, MEMS, 3, 50.0, Gnss(0.5, 0.5, 0.05))
    position, velocity = recording.sources
    y = velocity.y.copy()
    y[:: 2 if part == "some" else 1, 2] = np.nan
    columns = slice(2 if part == "two columns" else 3)
    flat = replace(velocity, y=y[:, columns], std=velocity.std[:, columns])
    flat = replace(recording, sources=(position, flat))
    whole, start = align(recording, MEMS, at=5.0), align(flat, MEMS, at=5.0)
    assert start.v_n[:2] == whole.v_n[:2] and abs(start.v_n[2]) < 3 * start.std[5]
    assert np.degrees(start.std[8]) < 20 and start.std[3] == whole.std[3]
    solution = sd.fuse(flat, imu=MEMS)
    assert sd.rms(sd.errors(solution, recording.reference), (20.0, 40.0)).position.max() < 1


def test_nothing_vertical_at_all():
    recording = sd.simulate(stopping(), 10.0, MEMS, 3, 50.0)
    position, velocity = recording.sources
    one = Source("position", position.t[:1], position.y[:1], position.std[:1])
    y = velocity.y.copy()
    y[:, 2] = np.nan
    start = align(replace(recording, sources=(one, replace(velocity, y=y))), MEMS)
    assert start.v_n[2] == pytest.approx(0.0, abs=0.1) and start.std[5] >= 10
