"""Axes of the gyro against those of a magnetometer."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection import field_turns
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.magnetometer import Magnetometer


def found(recording):
    return field_turns.check(InspectedRecording(recording))


def with_gyro(recording, C):
    """The recording of an IMU whose axes are changed by C (3, 3): rates turn as axes do, and where one is
    mirrored those about the two others change sign."""
    imu = recording.imu
    pseudo = np.linalg.det(C) * C
    return replace(recording, imu=imu._replace(dtheta=imu.dtheta @ pseudo.T, dv=imu.dv @ C.T))


@pytest.fixture(scope="module")
def held():
    return sd.simulate("hand-held", seed=5)


def test_right_axes_are_a_fact(held):
    said = found(held)
    assert not said.reasons and "0 % of the change" in said.facts[0]


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_axes_turned_by_quarters_are_named(held, degrees):
    c, s = np.cos(np.radians(degrees)).round(), np.sin(np.radians(degrees)).round()
    C = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    (reason,) = found(with_gyro(held, C)).reasons
    assert reason.cause == "axes" and f"turned by {360 - degrees} deg about z" in reason.seen


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_gyro_of_the_wrong_sign_is_named(held, axis):
    imu, sign = held.imu, np.where(np.arange(3) == axis, -1.0, 1.0)
    (reason,) = found(replace(held, imu=imu._replace(dtheta=imu.dtheta * sign))).reasons
    assert f"sign of gyro {'xyz'[axis]} changed" in reason.seen


def test_a_hard_iron_names_no_axes(held):
    """It does not turn with the body, whatever the axes are."""
    sources = (replace(a, y=a.y + 60e-6) if a.kind == "magnetic-field" else a for a in held.sources)
    assert not found(replace(held, sources=tuple(sources))).reasons


def test_a_gyro_that_was_converted_twice_is_named(held):
    imu = held.imu._replace(dtheta=held.imu.dtheta * np.pi / 180)
    (reason,) = found(replace(held, imu=imu)).reasons
    assert reason.cause == "unit" and "multiplied by 180/pi" in reason.seen


def test_axes_that_change_on_the_way_are_a_reason():
    """No one change of the axes explains both halves."""
    recording = sd.simulate("hand-held", 240.0, seed=5)
    imu, half = recording.imu, recording.imu.t > 120.0
    flipped = np.where(half[:, None], imu.dtheta * [1, 1, -1], imu.dtheta)
    (reason,) = found(replace(recording, imu=imu._replace(dtheta=flipped))).reasons
    assert reason.cause == "gyro" and "steps by -" in reason.seen


def test_what_hardly_turns_tells_nothing():
    compass = Magnetometer(rate=10.0, field=(21e-6, 1.6e-6, 43.9e-6))
    said = found(sd.simulate("static", 60.0, seed=1, magnetometer=compass))
    assert not said.reasons and "hardly turns" in said.inconclusive[0]


@pytest.mark.parametrize("name", ["car", "demo", "ship-heave", "multicopter"])
def test_right_axes_of_vehicles_are_never_doubted(name):
    compass = Magnetometer(rate=10.0, field=(21e-6, 1.6e-6, 43.9e-6))
    for seed in range(5):
        said = found(sd.simulate(name, 120.0, "consumer", seed=seed, magnetometer=compass))
        assert not said.reasons


@pytest.mark.parametrize("name, axis", [("demo", 0), ("ship-heave", 0), ("ship-heave", 1)])
def test_an_accelerometer_axis_of_the_wrong_sign_is_named(name, axis):
    recording = sd.simulate(name, 200.0, "industrial", seed=4)
    own = replace(recording, sources=())
    assert not found(own).reasons
    imu, sign = own.imu, np.where(np.arange(3) == axis, -1.0, 1.0)
    (reason,) = found(replace(own, imu=imu._replace(dv=imu.dv * sign))).reasons
    assert reason.cause == "axes" and (
        f"gravity along {'xyz'[axis]} of the accelerometer" in reason.seen
    )


@pytest.mark.parametrize("name", ["car", "multicopter", "hover", "alam"])
def test_gravity_of_vehicles_is_never_doubted(name):
    for seed in range(2):
        recording = sd.simulate(name, 200.0, "consumer", seed=seed)
        assert not found(replace(recording, sources=())).reasons
