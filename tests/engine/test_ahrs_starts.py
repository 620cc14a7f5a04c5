"""Starts by recorded attitude: what counts as a record, and how it is carried to the start."""

from dataclasses import replace

import numpy as np
import pytest
from around import beside, recorded, recording
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.data.solution import Source
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sim.trajectory import static


def off(start):
    """Angle (rad) between the attitude of an InitialState and the truth."""
    truth = recording().reference
    row = int(np.argmin(np.abs(truth.t - start.t)))
    return (truth.rotation[row] * Rotation.from_euler("ZYX", start.rph[::-1]).inv()).magnitude()


@pytest.mark.short
def test_a_vehicle_that_stands_starts_at_once_with_the_recorded_attitude():
    imu = sd.imu("tactical")
    assert "heading unknown" in sd.align(beside(), imu).note
    start = sd.align(beside(recorded()), imu)
    assert (
        start.t == beside().sources[0].t[0]
        and "heading from box, roll and pitch from box" in start.note
    )
    assert off(start) < 1e-3
    c, s = np.cos(start.rph[2]), np.sin(start.rph[2])
    P = np.array([[c, -s], [s, c]]) @ np.diag([0.01**2, 0.02**2]) @ np.array([[c, s], [-s, c]])
    assert start.std[6:9] == pytest.approx([*np.sqrt(np.diag(P)), 0.03], rel=1e-6)


@pytest.mark.short
@pytest.mark.parametrize(
    "after, position", [(0.0, True), (0.7, True), (-0.7, True), (0.7, False), (-0.7, False)]
)
def test_a_record_is_carried_to_the_start_by_the_gyros(after, position):
    whole, at = recorded(every=1), 10.0
    one = whole._where(np.abs(whole.t - at - after) < 0.01)
    start = sd.align(beside(one), sd.imu("tactical"), at=at, position=position)
    assert len(one.t) == 1 and off(start) < 2e-3
    turned = 0.01 * 0.2 * abs(after)  # 1 % of the angle, of at least 0.2 rad/s
    assert np.hypot(0.03, turned) <= start.std[8] < np.hypot(0.03, 1.5 * turned) + 1e-9


@pytest.mark.short
def test_the_gyro_bias_is_not_carried_along():
    imu = ImuSpec("biased", Triad(noise=1e-5, turn_on_bias=0.05), Triad(noise=1e-4))
    still = sd.simulate(static((0.8, 0.1, 100.0), (0.1, 0.2, 1.0)), 20.0, imu, 1, 20.0)
    record = Source("attitude", np.array([9.1]), np.array([[0.1, 0.2, 1.0]]), np.full((1, 3), 0.01))
    start = sd.align(replace(still, sources=(*still.sources, record)), imu, at=10.0)
    assert np.linalg.norm(still.meta["b_g"][0]) > 0.02 and start.rph == pytest.approx(
        (0.1, 0.2, 1.0), abs=2e-3
    )


@pytest.mark.short
def test_what_does_not_count_as_a_record():
    imu, at, whole = sd.imu("tactical"), 10.0, recorded(every=1)
    far = whole._where(np.abs(whole.t - at) > 1.01)
    assert "box" not in sd.align(beside(far), imu, at=at).note
    level = replace(whole, y=whole.y * [1, 1, np.nan])
    start = sd.align(beside(level), imu, at=at)
    assert "roll and pitch from box" in start.note and "heading unknown" in start.note
    unsure_box = replace(whole, std=whole.std * [1, 1, 100])
    unsure = sd.align(beside(unsure_box), imu, at=at)
    assert "roll and pitch from box" in unsure.note and "heading unknown" in unsure.note
    beside_field = sd.align(beside(unsure_box, kinds=("position", "magnetic-field")), imu, at=at)
    assert (
        "heading from the magnetic field" in beside_field.note
        and "roll and pitch from box" in beside_field.note
    )
    known = sd.align(beside(whole), imu, at=at, heading=1.0)
    assert "heading given, roll and pitch from box" in known.note and known.rph[2] == 1.0
