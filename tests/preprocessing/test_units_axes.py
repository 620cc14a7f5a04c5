"""Units against their definitions, axes and mounting against scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix, rotation_matrix
from strapdown.units.conversion import ALIASES, UNITS, factor


@pytest.mark.parametrize(
    "unit, dimension, si",
    [
        ("ms", "time", 1e-3),
        ("deg", "angle", np.pi / 180),
        ("arcsec", "angle", np.pi / 648000),
        ("deg/h", "angular rate", np.pi / 648000),
        ("g", "acceleration", 9.80665),
        ("mg", "acceleration", 9.80665e-3),
        ("km/h", "speed", 1000 / 3600),
        ("knot", "speed", 0.514444444444),
        ("ft", "length", 0.3048),
        ("gauss", "magnetic field", 1e-4),
        ("nT", "magnetic field", 1e-9),
        ("hPa", "pressure", 100.0),
        ("g*s", "velocity increment", 9.80665),
    ],
)
def test_factors(unit, dimension, si):
    assert factor(unit, dimension) == pytest.approx(si, rel=1e-11)


@pytest.mark.parametrize(
    "unit, dimension, words",
    [
        (None, "acceleration", "unit is missing; accepted for acceleration: m/s^2, g, mg"),
        ("degrees", "angle", "(did you mean 'deg'?); accepted for angle: rad, deg, arcsec"),
        ("dps", "angular rate", "did you mean 'deg/s'?"),
        ("mG", "acceleration", "did you mean 'mg'?"),
        ("mG", "magnetic field", "did you mean 'mgauss'?"),
        ("m/s^2", "speed", "is one of acceleration; accepted for speed"),
        ("furlong", "length", "unknown unit 'furlong'; accepted for length"),
    ],
)
def test_refusals_list_what_is_accepted(unit, dimension, words):
    with pytest.raises(DataError) as error:
        factor(unit, dimension)
    assert words in str(error.value)


def test_every_alias_suggests_a_unit():
    assert {name for names in ALIASES.values() for name in names.split()} <= {
        unit for units in UNITS.values() for unit in units
    }
    assert not set(ALIASES) & {unit for units in UNITS.values() for unit in units}


@pytest.mark.parametrize(
    "name, forward_right_down",
    [("FRD", [1, 2, 3]), ("FLU", [1, -2, -3]), ("RFU", [2, 1, -3]), ("-z +y +x", [-3, 2, 1])],
)
def test_body_axes(name, forward_right_down):
    np.testing.assert_array_equal(axes_matrix(name, BODY_AXES) @ [1, 2, 3], forward_right_down)


def test_navigation_axes():
    np.testing.assert_array_equal(axes_matrix("ENU", NAVIGATION_AXES) @ [1, 2, 3], [2, 1, -3])


@pytest.mark.parametrize(
    "text, words",
    [
        ("+x +y -z", "left-handed"),
        ("+x +x +z", "twice"),
        ("xyz", "unknown axes 'xyz'; give FRD, FLU, RFU"),
        ("NED", "unknown"),
    ],
)
def test_wrong_axes(text, words):
    with pytest.raises(DataError, match=words):
        axes_matrix(text, BODY_AXES)
    if words == "left-handed":
        axes_matrix(text, BODY_AXES, right_handed=False)


def test_mounting_is_heading_pitch_roll():
    roll, pitch, heading = np.radians([-179.364, 6.760, -174.612])
    C = rotation_matrix(roll, pitch, heading)
    np.testing.assert_allclose(
        C, Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix(), atol=1e-15
    )
    np.testing.assert_allclose(C @ [1.157, 0.311, 9.861], [-0.007, 0.202, -9.932], atol=2e-3)
