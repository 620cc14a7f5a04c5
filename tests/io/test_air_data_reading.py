"""Reading air data: the air of the day, units, the constraint of a fixed wing, and what is refused."""

import numpy as np
import pytest
from nine_axis import TOML, build, tables  # noqa: F401 (a fixture)

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.io import read

pytestmark = pytest.mark.short
AIRSPEED = """[[source]]
kind = "indicated-airspeed"
file = "mag.csv"
time = { column = "t", unit = "s" }
columns = ["v"]
unit = "knot"
std = 2.0
estimate = { scale = 0.05 }
"""
AIR = "atmosphere = { pressure = 987.0, temperature = 31.0, height = 250.0 }\n"
SLIP = '[[source]]\nkind = "zero-side-slip"\nrate = 5.0\nstd = 4.0\n'


DRAG = '[[source]]\nkind = "rotor-drag"\nrate = 10.0\nstd = 0.5\ndrag = 0.3\n'


def sources(build, *sections):
    made = lambda text: text[: text.index("[[source]]")] + "\n".join(sections)
    return read(build(mag=lambda f: f.assign(v=40.0 + 0.01 * f.t), toml=made)).sources


def test_airspeed_and_side_slip(build):
    airspeed, slip = sources(build, AIRSPEED + AIR, SLIP)
    np.testing.assert_allclose(
        airspeed.y[:, 0], (40.0 + 0.01 * tables()[1].t) * 0.514444, rtol=1e-6
    )
    np.testing.assert_allclose(airspeed.std, 2.0 * 0.514444, rtol=1e-6)
    np.testing.assert_allclose(airspeed.parameters, (0, 0, 0, 98700.0, 304.15, 250.0))
    assert airspeed.estimate == {"scale": (0.05,)}
    assert not slip.y.any() and (slip.std == 4.0).all()
    np.testing.assert_allclose(np.diff(slip.t), 0.2)


def test_a_boom_and_a_vertical_wind(build):
    """The lever arm stands before the air."""
    boom = "lever_arm = [1.0, 0.0, -0.2]\n"
    airspeed = AIRSPEED.replace("scale = 0.05", "scale = 0.05, vertical-wind = 2.0, clock = 0.1")
    (found,) = sources(build, airspeed + boom + AIR)
    np.testing.assert_allclose(found.parameters, (1.0, 0.0, -0.2, 98700.0, 304.15, 250.0))
    assert found.estimate == {"scale": (0.05,), "vertical-wind": (2.0,), "clock": (0.1,)}


def test_the_drag_of_rotors_is_what_the_accelerometers_read(build):
    """Means over the steps before, two components; both coefficients are the same where one is given."""
    (drag,) = sources(build, DRAG)
    assert drag.parameters == (0.3, 0.3, 0.0) and (drag.std == 0.5).all()
    np.testing.assert_allclose(np.diff(drag.t), 0.1)
    imu = read(build(toml=lambda text: text)).imu
    k = len(drag.t) // 2
    within = (imu.t > drag.t[k] - 0.1 + 1e-6) & (imu.t < drag.t[k] + 1e-6)
    mean = imu.dv[within].sum(axis=0) / imu.dt[within].sum()
    np.testing.assert_allclose(drag.y[k], mean[:2], rtol=1e-6, atol=1e-9)
    (two,) = sources(build, DRAG.replace("0.3", "[0.3, 0.4]"))
    assert two.parameters == (0.3, 0.4, 0.0)


def test_without_a_station_the_air_is_left_to_the_filter(build):
    (airspeed,) = sources(build, AIRSPEED)
    assert airspeed.parameters == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "section, words",
    [
        (AIRSPEED.replace("indicated", "true") + AIR, "atmosphere: true-airspeed takes none"),
        (AIRSPEED + AIR.replace("987.0", "98700.0"), "pressure"),
        (AIRSPEED + AIR.replace("31.0", "304.0"), "temperature"),
        (SLIP + 'estimate = ["scale"]\n', "must be one of vertical-wind"),
        (DRAG.replace("0.3", "30.0"), "drag"),
        (DRAG.replace("0.3", "[0.3]"), "drag: give one coefficient, or two"),
        (DRAG.replace("drag = 0.3\n", ""), "drag: rotor-drag needs it"),
        (SLIP + "drag = 0.3\n", "drag: zero-side-slip takes none"),
        (SLIP.replace("rate = 5.0", ""), "rate: is missing"),
    ],
)
def test_what_is_refused(build, section, words):
    with pytest.raises(DataError) as error:
        sources(build, section)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "parameters", [(0, 0, 0, 987.0, 31.0, 250.0), (98700.0,), (0, 0, 0, 98700.0)]
)
def test_air_in_other_units_is_refused_in_arrays_too(parameters):
    t = np.arange(0.0, 20.0, 0.1)
    airspeed = Source(
        "indicated-airspeed", t, np.full((len(t), 1), 20.0), np.ones((len(t), 1)), parameters
    )
    rest = np.zeros((len(t), 3))
    with pytest.raises(DataError, match="indicated-airspeed: parameters are .* in Pa"):
        Recording.from_arrays(t, rest, rest - [0, 0, 9.81], (airspeed,))
