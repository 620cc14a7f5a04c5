"""Distances to beacons: what they hold without GNSS, and what a beacon at a wrong place shows."""

from dataclasses import replace

import numpy as np
import pymap3d
import pytest

import strapdown as sd
from strapdown import aiding
from strapdown.core.loop.contract import FilterState, compile_kernel
from strapdown.core.mathematics.earth import vector_to
from strapdown.core.mathematics.source import new_source
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated

pytestmark = pytest.mark.short
ARM = (0.5, 0.2, 1.0)
AROUND = [(900.0, 200.0, 40.0), (-300.0, 800.0, 60.0), (-500.0, -700.0, 50.0)]  # m NED


def drive(seconds=90.0):
    """A car between three beacons about its start."""
    place = sd.simulate("car", 2.0, "tactical", seed=1).reference.lla[0]
    sensors = [
        Simulated("range", 0.5, 2.0, (*ARM, *displace_lla(place, np.array(ned))), f"beacon {k}")
        for k, ned in enumerate(AROUND)
    ]
    return sd.simulate("car", seconds, "tactical", seed=1, sensors=sensors)


@pytest.fixture(scope="module")
def made():
    return drive()


def test_the_vector_to_a_place_is_that_of_the_ellipsoid():
    rng = np.random.default_rng(0)
    for _ in range(50):
        lla = rng.uniform([-1.5, -3.1, -5e3], [1.5, 3.1, 2e4])
        there = lla + rng.uniform(-1, 1, 3) * (1e-2, 1e-2, 500.0)
        wanted = pymap3d.geodetic2ned(*there, *lla, deg=False)
        np.testing.assert_allclose(vector_to(lla, *there), wanted, atol=2e-7)


def test_beside_the_beacon_nothing_is_divided_by_zero(made):
    lla = made.reference.lla[5]
    belief = FilterState(
        lla.copy(),
        np.zeros(3),
        np.eye(3),
        np.zeros(3),
        np.zeros(3),
        np.eye(16),
        np.zeros(3),
        np.zeros(3),
        np.zeros(1),
        np.zeros(1),
    )
    source = new_source(first_state=15)
    source.parameters[:] = (0.0, 0.0, 0.0, *lla)
    kernel = aiding.find("range").observe
    compile_kernel(kernel)
    innovation, H = np.zeros(3), np.zeros((3, 16))
    assert kernel(belief, np.array([0.0, np.nan, np.nan]), source, innovation, H) == 1
    assert np.isfinite(innovation).all() and np.isfinite(H).all() and H[0, 15] == 1.0


def test_beacons_hold_the_position_without_gnss(made):
    """From 20 s on: with their ranges it stays within its standard deviations, some metres; without
    them it does not."""
    fixes = [a.between(0.0, 20.0) for a in made.sources[:2]]
    ranges = made.sources[2:]
    alone, held = (
        sd.fuse(replace(made, sources=(*fixes, *more)), imu="tactical") for more in ((), ranges)
    )
    error = [
        np.linalg.norm(sd.errors(each, made.reference).position[-1, :2]) for each in (alone, held)
    ]
    assert held.std[-1, :2].max() < 1.0 < alone.std[-1, :2].max()
    assert error[1] < 3 * np.linalg.norm(held.std[-1, :2])
    assert all(bad <= 0.02 * (good + bad) for good, bad in held.counts().values())


def test_a_beacon_at_a_wrong_place_is_said(made):
    """By its rejected fixes and by the verdict, which trusts the right place."""
    right = sd.fuse(made, imu="tactical")
    *others, last = made.sources
    arm, lla = last.parameters[:3], np.array(last.parameters[3:])
    off = displace_lla(lla, np.array([100.0, 0.0, 0.0]))
    wrong = sd.fuse(
        replace(made, sources=(*others, replace(last, parameters=(*arm, *off)))), imu="tactical"
    )
    assert right.verdict.word == "trusted" and right.counts()["beacon 2"][1] <= 3
    assert wrong.verdict.word != "trusted" and wrong.verdict.reasons[0].source == "beacon 2"
    assert any("beacon 2" in text and "rejected" in text for _, text in wrong.events)
