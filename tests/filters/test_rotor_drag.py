"""A multicopter knows the wind by the drag of its rotors: the specific force across their axis."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.aiding.air_data import DRAG
from strapdown.data.solution import Source, Trajectory
from strapdown.evaluation.consistency import nees_of
from strapdown.geometry.rotations import Rotation
from strapdown.preprocessing.rotated_imu import with_the_imu
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import Scenario
from strapdown.sim.splined import spline_motion
from strapdown.sim.synthesis import Simulator

WIND, K = np.array([4.0, -3.0]), 0.3  # m/s, 1/s
NAMES = ["wind north [m/s]", "wind east [m/s]"]
RATE, DURATION = 50.0, 80.0


def multicopter(speed=6.0):
    """The motion of one that flies to and fro, or hovers, and turns: its rotors push along their axis and
    drag across it, so that the axis is along f + K (v - wind)."""
    t = np.arange(0.0, DURATION + 1.0, 0.1)
    v = speed * np.c_[np.sin(0.35 * t), np.sin(0.23 * t), 0.05 * np.sin(0.2 * t)]
    a = np.gradient(v, t, axis=0)
    push = a - [0, 0, 9.81] + K * (v - np.r_[WIND, 0])
    down = -push / np.linalg.norm(push, axis=1, keepdims=True)
    yaw = 0.3 + 0.8 * np.sin(0.1 * t)
    right = np.cross(down, np.c_[np.cos(yaw), np.sin(yaw), 0 * t])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    C = np.stack([np.cross(right, down), right, down], axis=2)
    lla = np.tile([0.84, 0.19, 500.0], (len(t), 1))
    return spline_motion(Trajectory(t, lla, v, Rotation.from_matrix(C).as_wxyz()))


def flown(seed, given=K, speed=6.0, estimate=None):
    """(start, a recording with GPS, one with the drag too, of coefficient `given`)."""
    gnss = Gnss(velocity_std=None)
    scenario = Scenario("copter", multicopter(speed), DURATION, RATE, gnss, "consumer")
    recording, start = Simulator(scenario).run("consumer", seed)
    imu, every = recording.imu, 5
    rows = slice(0, len(imu.t) // every * every)
    sums = (
        imu.dv[rows].reshape(-1, every, 3).sum(axis=1)
        / imu.dt[rows].reshape(-1, every).sum(1)[:, None]
    )
    t = imu.t[rows][every - 1 :: every]
    drag = Source(
        DRAG.name,
        t,
        sums[:, :2],
        np.full((len(t), 2), 0.3),
        (given, given, 0.0),
        estimate=estimate or {},
    )
    return start, recording, replace(recording, sources=(*recording.sources, drag))


@pytest.mark.parametrize("speed", [6.0, 0.0])
def test_the_wind_is_found_in_flight_and_hovering(speed):
    """Hovering, the lean of the vehicle is the wind; the bias of an accelerometer limits that."""
    for seed in range(3):
        start, _, recording = flown(seed, speed=speed)
        solution = sd.fuse(recording, start=start)
        for each, blown in zip(NAMES, WIND):
            std = solution.columns[f"std of {each}"][-1]
            assert std < 1.0 and abs(solution.columns[each][-1] - blown) < 4 * std


def test_the_coefficient_is_a_state():
    """Given by 20 % too large: its scale is a state, as of an airspeed."""
    for seed in range(3):
        start, _, recording = flown(seed, 1.2 * K, estimate={"scale": (0.3,)})
        solution = sd.fuse(recording, start=start)
        (name,) = (each for each in solution.columns if each.startswith("scale error"))
        std = solution.columns[f"std of {name}"][-1]
        assert std < 0.15 and abs(solution.columns[name][-1] - (1 / 1.2 - 1)) < 4 * std


def test_errors_are_as_large_as_they_are_said_to_be():
    """The accelerometers are in prediction and measurement: NEES of 17 states over 10 seeds all the same,
    of which at most one in ten epochs is beyond its upper bound of 99.9 %."""
    values = []
    for seed in range(10):
        start, _, recording = flown(seed)
        solution = sd.fuse(recording, start=start, covariance=True, every=50)
        truth = {name: np.full(len(solution.t), blown) for name, blown in zip(NAMES, WIND)}
        values.append(nees_of(solution, recording, truth))
    sums = np.sum(values, axis=0)[solution.t > 30.0]
    assert np.mean(sums > 1.33 * 10 * 17) < 0.1


def test_drag_holds_the_position_without_gps():
    """30 s of six flights: it is a velocity once the wind is known."""
    worst = np.empty((2, 6))
    for seed in range(6):
        start, *both = flown(seed)
        for k, recording in enumerate(both):
            position, *others = recording.sources
            hidden = replace(recording, sources=(position.without([(48.0, 78.0)]), *others))
            e = sd.errors(sd.fuse(hidden, start=start), recording.reference)
            worst[k, seed] = np.hypot(*e.position[(e.t > 48.0) & (e.t < 78.0), :2].T).max()
    without, with_drag = np.median(worst, axis=1)
    assert with_drag < 0.5 * without


def test_its_axes_turn_with_the_imu():
    """As the reading of the accelerometers does, whose third component is the weight."""
    turn = Rotation.from_rph(np.array([0.02, -0.01, 0.3]))
    y = np.array([[0.5, -0.2]])
    (turned,) = with_the_imu(Source(DRAG.name, [1.0], y, [[0.3, 0.3]], (K, K, 0.0)), turn).y
    np.testing.assert_allclose(turned, turn.apply(np.c_[y, -9.80665])[0, :2])
