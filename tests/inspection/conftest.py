"""A drive and a flight that tests bend in one place at a time."""

import pytest

import strapdown as sd


@pytest.fixture(scope="session")
def drive():
    """Four minutes of a simulated car, fixes at 5 Hz; nothing is wrong."""
    return sd.simulate("car", duration=240.0, seed=1001)


@pytest.fixture(scope="session")
def flight():
    """Five minutes of a simulated light aircraft, fixes at 1 Hz; nothing is wrong."""
    return sd.simulate("demo", duration=300.0, imu="tactical", seed=1002)
