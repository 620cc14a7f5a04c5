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


def test_without_a_station_the_air_is_left_to_the_filter(build):
    (airspeed,) = sources(build, AIRSPEED)
    assert airspeed.parameters == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "section, words",
    [
        (AIRSPEED.replace("indicated", "true") + AIR, "atmosphere: true-airspeed takes none"),
        (AIRSPEED + AIR.replace("987.0", "98700.0"), "pressure"),
        (AIRSPEED + AIR.replace("31.0", "304.0"), "temperature"),
        (AIRSPEED + "lever_arm = [1.0, 0.0, 0.0]\n", "lever_arm: indicated-airspeed takes none"),
        (SLIP + 'estimate = ["scale"]\n', "nothing of this source can be estimated"),
        (SLIP.replace("rate = 5.0", ""), "rate: is missing"),
    ],
)
def test_what_is_refused(build, section, words):
    with pytest.raises(DataError) as error:
        sources(build, section)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("parameters", [(0, 0, 0, 987.0, 31.0, 250.0), (98700.0,), (0, 0, 0, 98700.0)])
def test_air_in_other_units_is_refused_in_arrays_too(parameters):
    t = np.arange(0.0, 20.0, 0.1)
    airspeed = Source(
        "indicated-airspeed", t, np.full((len(t), 1), 20.0), np.ones((len(t), 1)), parameters
    )
    rest = np.zeros((len(t), 3))
    with pytest.raises(DataError, match="indicated-airspeed: parameters are .* in Pa"):
        Recording.from_arrays(t, rest, rest - [0, 0, 9.81], (airspeed,))
