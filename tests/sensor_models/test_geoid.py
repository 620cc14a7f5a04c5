"""The geoid EGM96 against the values that the NGA publishes for its model."""

import hashlib

import numpy as np
import pytest
from scipy.ndimage import map_coordinates, spline_filter

from strapdown.sensor_models import geoid

pytestmark = pytest.mark.short
NGA = np.array(
    [  # latitude, longitude (deg), height of the geoid (m): OUTINTPT.DAT beside WW15MGH.DAC
        (38.6281550, 269.7791550, -31.628),
        (-14.6212170, 305.0211140, -2.969),
        (46.8743190, 102.4487290, -43.575),
        (-23.6174460, 133.8747120, 15.871),
        (38.6254730, 359.9995000, 50.066),
        (-0.4667440, 0.0023000, 17.329),
    ]
)


def test_it_is_that_of_the_nga():
    lat, lon = np.radians(NGA[:, :2]).T
    assert np.abs(geoid.undulation(lat, lon) - NGA[:, 2]).max() < 0.005
    once_round = geoid.undulation(lat, lon - 2 * np.pi)
    assert once_round == pytest.approx(geoid.undulation(lat, lon), abs=1e-9)


def test_it_is_the_cubic_spline_of_scipy():
    rng = np.random.default_rng(1)
    lat, lon = rng.uniform(-np.pi / 2, np.pi / 2, 1000), rng.uniform(-7, 7, 1000)
    own = geoid._spline()
    assert spline_filter(
        map_coordinates(own, np.indices(own.shape), order=3, prefilter=False), 3
    ) == (pytest.approx(own, abs=1e-9))
    place = [(90 - np.degrees(lat)) * 4 + geoid.MARGIN, np.degrees(lon) % 360 * 4 + geoid.MARGIN]
    expected = map_coordinates(own, place, order=3, prefilter=False, mode="nearest")
    assert geoid.undulation(lat, lon) == pytest.approx(expected, abs=1e-9)


def test_the_grid_is_the_published_file():
    numbers = np.round(geoid.grid() * 100).astype(">i2")
    assert hashlib.sha256(numbers.tobytes()).hexdigest() == geoid.SHA256
    assert geoid.pack(numbers.tobytes())[:6] == b"\xfd7zXZ\x00"


def test_it_goes_on_around_the_earth_and_across_the_poles():
    lat = np.radians([0.1, 0.1, 90, 90, 89.99, 90, np.nan, 0])
    lon = np.radians([-1e-7, 1e-7, 0, 123, 10, 190, 0, np.inf])
    found = geoid.undulation(lat, lon)
    assert abs(found[0] - found[1]) < 1e-4 and abs(found[2] - found[3]) < 1e-9
    assert abs(found[4] - found[5]) < 0.01 and found[2] == pytest.approx(13.61, abs=0.005)
    assert np.isnan(found[6:]).all()
