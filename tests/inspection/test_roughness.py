"""Vibration and spikes of the accelerometer."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection import roughness
from strapdown.inspection.motion import InspectedRecording


@pytest.fixture(scope="module")
def car():
    return sd.simulate("car", 120.0, "consumer", seed=4)


def reasons(recording, added):
    imu = recording.imu
    imu = imu._replace(dv=imu.dv + added * imu.dt[:, None])
    return roughness.check(InspectedRecording(replace(recording, imu=imu))).reasons


def test_a_smooth_ride_is_no_reason(car):
    assert reasons(car, np.zeros(3)) == []


def test_white_vibration_is_measured(car):
    """8 m/s^2 rms on one axis, 1 of the two others: +- 3 % by 12 000 samples."""
    noise = np.random.default_rng(1).normal(0.0, [1.0, 8.0, 1.0], (len(car.imu.t), 3))
    (reason,) = reasons(car, noise)
    assert reason.cause == "accelerometer" and "accelerometer y changes by 8 m/s^2" in reason.seen
    assert reason.weight == pytest.approx(8.0 / 5.0, rel=0.05)


def test_spikes_in_one_sample_of_a_hundred_are_a_reason(car):
    spikes = np.zeros((len(car.imu.t), 3))
    spikes[::100, 2] = 100.0
    (reason,) = reasons(car, spikes)
    assert "accelerometer z" in reason.seen


def test_single_impacts_are_no_reason(car):
    """A door that slams, in four of the twelve parts."""
    impacts = np.zeros((len(car.imu.t), 3))
    impacts[::3000, 2] = 500.0
    assert reasons(car, impacts) == []


@pytest.mark.parametrize("sensor, unit", [("gyro", "dtheta"), ("accelerometer", "dv")])
def test_an_axis_that_alone_grows_noisy_is_a_reason(car, sensor, unit):
    """20 times the noise of one axis in the second half; of all three it is an engine that runs."""
    imu, late = car.imu, car.imu.t > 60.0
    values = getattr(imu, unit)
    level = np.median(np.abs(np.diff(values, 2, axis=0))) / 0.6745 / np.sqrt(6.0)
    noise = 20 * level * late[:, None] * np.random.default_rng(3).normal(size=values.shape)
    shaken, broken = values + noise, values + noise * [0.0, 1.0, 0.0]
    check = lambda own: roughness.check(
        InspectedRecording(replace(car, imu=imu._replace(**{unit: own})))
    )
    assert check(shaken).reasons == []
    (reason,) = check(broken).reasons
    assert reason.cause == sensor and reason.seen.startswith(f"{sensor} y is ")
