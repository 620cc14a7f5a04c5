"""Where a measurement tells nothing it is NaN: a course near standstill, a pressure that is none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import aiding
from strapdown.aiding.course import MIN_SPEED, SURELY
from strapdown.aiding.pressure import pressure_altitude
from strapdown.core.loop.contract import FilterState, compile_kernel
from strapdown.core.mathematics.source import new_source

pytestmark = pytest.mark.short


def course(v, std=(0.01, 0.01), omega=(0.0, 0.0, 0.0), arm=(0.0, 0.0, 0.0)):
    """Innovation of a course of 0 rad at that velocity (m/s), known to std."""
    P = np.diag(np.r_[np.ones(3), np.square(std), np.ones(10)])
    C = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1]).as_matrix()
    zero = np.zeros(3)
    belief = FilterState(
        np.array([0.8, 0.1, 5.0]),
        np.array([*v, 0.0]),
        C,
        zero,
        zero,
        P,
        np.array(omega),
        zero,
        zero,
        np.zeros(0),
    )
    sensor, innovation = aiding.find("course"), np.zeros(3)
    compile_kernel(sensor.observe)
    source = new_source(parameters=np.r_[arm, np.zeros(3)])
    assert sensor.observe(belief, np.zeros(3), source, innovation, np.zeros((3, 15))) == 1
    return innovation[0]


@pytest.mark.parametrize("heading", [-2.0, 0.3, 3.0])
def test_a_course_is_that_of_the_antennas_velocity(heading):
    v = 5.0 * np.array([np.cos(heading), np.sin(heading)])
    assert course(v) == pytest.approx(-heading)
    omega, arm = np.array([0.1, -0.2, 0.5]), np.array([2.0, -1.0, 0.5])
    C = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1])
    moved = v + C.apply(np.cross(omega, arm))[:2]
    assert course(v, omega=omega, arm=arm) == pytest.approx(-np.arctan2(moved[1], moved[0]))


@pytest.mark.parametrize("speed, told", [(0.99, False), (1.0, True), (1.01, True)])
def test_at_walking_pace_there_is_none(speed, told):
    assert MIN_SPEED == 1.0
    for v in ((speed, 0.0), (0.0, -speed)):
        assert np.isfinite(course(v)) == told


@pytest.mark.parametrize("std", [(2.0, 0.1), (0.1, 2.0)])
def test_nor_where_the_speed_may_be_none(std):
    assert np.isnan(course((SURELY * 2.0 - 0.01, 0.0), std))
    assert np.isfinite(course((SURELY * 2.0 + 0.01, 0.0), std))


@pytest.mark.parametrize("p", [0.0, -1.0, np.nan])
def test_a_pressure_that_is_none_has_no_height(p):
    assert np.isnan(pressure_altitude(p))


@pytest.mark.parametrize(
    "p, height", [(101325.0, 0.0), (89874.6, 1000.0), (22632.1, 11000.0), (12044.6, 15000.0)]
)
def test_heights_of_the_standard_atmosphere(p, height):
    """ICAO Doc 7488, geopotential heights."""
    assert pressure_altitude(p) == pytest.approx(height, abs=0.5)
