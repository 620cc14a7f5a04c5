"""The mean side slip of a run, of an IMU that is turned about down."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.aiding.air_data import LATERAL
from strapdown.data.solution import Source
from strapdown.preprocessing.axes import rotation_matrix
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import flight
from strapdown.sim.scenario import Scenario
from strapdown.verdict.mean_slip import mean_slip

pytestmark = pytest.mark.short


LEGS = [
    leg
    for k in range(4)
    for leg in ({"duration": 10.0}, {"duration": 30.0, "turn": (-1) ** k * 3.0})
]
CIRCLES = Scenario(
    "circles",
    flight((0.84, 0.19, 800.0), course=0.5, speed=20.0, legs=LEGS),
    160.0,
    50.0,
    Gnss(),
    "tactical",
)


def flown(turned, seed=1):
    """A flight that turns, with airspeed and the constraint; the IMU turned by so many deg to the right."""
    pitot = Simulated("true-airspeed", 1.0, 5.0)
    recording = sd.simulate(CIRCLES, seed=seed, sensors=[pitot])
    C = rotation_matrix(0.0, 0.0, np.radians(turned))
    imu = recording.imu._replace(dtheta=recording.imu.dtheta @ C, dv=recording.imu.dv @ C)
    t = np.arange(1.0, 159.0, 0.2)
    free = Source(LATERAL.name, t, np.zeros((len(t), 1)), np.full((len(t), 1), 4.0))
    return sd.fuse(replace(recording, imu=imu, sources=(*recording.sources, free), reference=None))


@pytest.mark.parametrize("turned", [15.0, -15.0])
def test_a_turned_imu_flies_with_a_slip(turned):
    """Turned to the right, it has the air from its left. The constraint hides a part."""
    (reason,) = mean_slip(flown(turned))
    said = float(reason.seen.split("from ")[1].split()[0])
    assert 0.3 * abs(turned) < said < abs(turned)
    assert ("left" if turned > 0 else "right") in reason.seen
    added = float(reason.remedy.split("add ")[1].split()[0])
    assert abs(added) == said and added * turned > 0
    assert abs(reason.weight - said / 10.0) < 0.01


def test_a_straight_imu_has_none():
    assert [list(mean_slip(flown(0.0, seed))) for seed in range(4)] == [[]] * 4
