"""A filter without positions and velocities does not lose the wheels and constraints that it has to
its own gate."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import start

import strapdown as sd
from strapdown.core.compile.records import rows
from strapdown.core.loop.contract import InitialState
from strapdown.core.loop.cursor import Work
from strapdown.core.loop.reacquisition import make_room
from strapdown.core.mathematics.source import new_source
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.any_sensor import Simulated

pytestmark = pytest.mark.short
KINDS = ("speed", "zero-lateral-velocity", "zero-vertical-velocity")


def constraints(t):
    zeros = np.zeros((len(t), 1))
    return tuple(sd.Source(kind, t, zeros, zeros + 0.1) for kind in KINDS[1:])


def drive(seed, shaken):
    """A car on its wheels and constraints, whose IMU vibrates by more than its description says."""
    wheel = Simulated("speed", 0.05, 10.0)
    made = sd.simulate("car", 80.0, "consumer", seed=seed, sensors=[wheel])
    noise = np.random.default_rng(seed).normal(size=made.imu.dv.shape)
    dv = made.imu.dv + shaken * noise * made.imu.dt[:, None]
    speed = made.sources[-1]
    sources = (speed, *constraints(speed.t))
    return replace(made, imu=made.imu._replace(dv=dv), sources=sources)


def ungated(recording):
    return replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))


@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.parametrize("shaken", [1.5, 3.0])
def test_wheels_and_constraints_are_not_locked_out(seed, shaken):
    recording = drive(seed, shaken)
    gated, free = (
        sd.fuse(each, imu="consumer", start=start(recording))
        for each in (recording, ungated(recording))
    )
    end = [
        np.linalg.norm(sd.errors(each, recording.reference).position[-1]) for each in (gated, free)
    ]
    assert end[0] < max(1.5 * end[1], 5.0)
    assert all(good > 0.8 * (good + bad) for good, bad in gated.counts().values())
    assert not any("left out" in text for _, text in gated.events)


def test_a_single_wild_wheel_speed_is_still_rejected():
    recording = drive(5, 0.0)
    speed, *others = recording.sources
    y = speed.y.copy()
    y[300] += 20.0
    recording = replace(recording, sources=(replace(speed, y=y), *others))
    solution = sd.fuse(recording, imu="consumer", start=start(recording))
    own = solution.innovations.source == 0
    (row,) = np.flatnonzero(own & (np.abs(solution.innovations.t - speed.t[300]) < 1e-6))
    assert not solution.innovations.accepted[row]


def test_one_fix_makes_room_along_what_it_measures_alone():
    """As a plain twin has it: H P H' grows by the squared innovation, by the velocity alone."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(15, 15))
    P, h, e = root @ root.T, rng.normal(size=3), 2.5
    grown, (work,) = P.copy(), rows(Work, 1)
    H = np.zeros((3, 15))
    H[0, 3:6], H[0, 6:9] = h, rng.normal(size=3)
    work.jacobian[: H.size] = H.ravel()
    work.other[:] = e, np.nan, np.nan, *[np.nan] * 9
    work.alone = 1
    make_room(grown, new_source(), False, work)
    added = grown - P
    assert h @ added[3:6, 3:6] @ h == pytest.approx(e**2)
    added[3:6, 3:6] = 0.0
    assert not added.any()
    assert np.linalg.eigvalsh(grown).min() > 0


@pytest.mark.parametrize("heading", [0.0, 90.0])
def test_a_recorded_robot_comes_home(heading, data_folder):
    """A simulated Jackal in a recorded bag drives 80 m and ends 2 m from its start; its IMU
    vibrates by 1 m/s^2. With gates that locked its only aid out it ended 20 km off."""
    recording = sd.read(data_folder / "native" / "rosbag2" / "jackal_sim_imu_odom_61s.mcap.xz")
    t = np.arange(47.7, 108.7, 0.1)
    recording = replace(recording, sources=(*recording.sources, *constraints(t)))
    first = recording.imu.t[0] - recording.imu.dt[0]
    lla = (0.8, 0.1, 100.0)
    begin = InitialState(float(first), lla, (0.0,) * 3, (np.nan, np.nan, np.radians(heading)))
    solution = sd.fuse(recording, start=begin)
    moved = displacement(solution.trajectory.lla[-1:], np.array([lla]))
    assert np.linalg.norm(moved) < 15.0
