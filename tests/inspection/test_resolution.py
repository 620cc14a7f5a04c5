"""IMU samples in coarse steps: found where noise does not round them off evenly, and only there."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.core.loop.contract import Imu
from strapdown.inspection import resolution
from strapdown.inspection.motion import InspectedRecording

STEPS = (0.1, float(np.radians(0.1)))


def counted(recording, accel, gyro):
    """The recording with specific force and rate rounded to these steps."""
    imu = recording.imu
    dt = imu.dt[:, None]
    dv, dtheta = (
        np.round(each / dt / step) * step * dt if step else each
        for each, step in ((imu.dv, accel), (imu.dtheta, gyro))
    )
    return replace(recording, imu=Imu(imu.t, imu.dt, dtheta, dv))


def reasons(recording):
    return resolution.check(InspectedRecording(recording)).reasons


@pytest.mark.parametrize("scenario, grade", [("car", "industrial"), ("demo", "tactical")])
def test_steps_beyond_the_noise_are_named_with_their_size(scenario, grade):
    recording = sd.simulate(scenario, 60.0, grade, seed=3)
    assert not reasons(recording)
    found = reasons(counted(recording, *STEPS))
    assert found[0].cause == "accelerometer"
    assert "steps of 0.1 m/s^2" in str(found[0])


def test_fine_steps_and_those_that_noise_rounds_off_evenly_are_no_reason():
    recording = sd.simulate("car", 60.0, "consumer", seed=4)
    assert not reasons(counted(recording, 0.005, float(np.radians(0.01))))
    rng, imu = np.random.default_rng(5), recording.imu
    noise = rng.normal(0, 0.1, imu.dv.shape) * imu.dt[:, None]
    loud = replace(recording, imu=imu._replace(dv=imu.dv + noise))
    assert not reasons(counted(loud, 0.1, 0.0))


def test_the_step_is_that_of_the_values():
    rng = np.random.default_rng(6)
    fine = rng.normal(0, 1, 5000)
    assert resolution.step_of(fine) == 0.0
    for step in (0.25, 0.1, 1 / 3):
        assert resolution.step_of(np.round(fine / step) * step) == pytest.approx(step)
    assert resolution.step_of(np.zeros(100)) == 0.0
