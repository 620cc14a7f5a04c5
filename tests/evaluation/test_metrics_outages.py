"""Scores of outages against values worked out by hand."""

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.evaluation.metrics import moving_windows, outages
from strapdown.geometry.geodesy import displace_lla

pytestmark = pytest.mark.short
T = np.arange(0, 100.5, 0.5)
ORIGIN = np.array([0.8, 0.1, 200.0])


def still(offsets=None):
    lla = np.tile(ORIGIN, (len(T), 1))
    return Trajectory(T, lla if offsets is None else displace_lla(lla, offsets))


def test_errors_within_the_window_are_scored_and_no_others():
    offsets = np.zeros((len(T), 3))
    inside = (T >= 20) & (T <= 30)
    offsets[inside, 0] = 0.3 * (T[inside] - 20)  # to 3 m north at the end
    offsets[inside, 1] = -0.4 * (T[inside] - 20)  # and 4 m west
    offsets[inside, 2] = 1.0
    offsets[T == 25, 0] += 50.0  # a peak of 51.5 m north, 2 m west
    offsets[T > 40] = 1000.0
    (score,) = outages(still(offsets), still(), [(20.0, 30.0)])
    assert score.horizontal_end == pytest.approx(
        5.0, abs=1e-4
    ) and score.horizontal_max == pytest.approx(np.hypot(51.5, 2.0), abs=1e-3)
    assert score.down_max == pytest.approx(1.0) and (score.start, score.stop) == (20.0, 30.0)
    expected = np.sqrt(np.mean(offsets[inside] ** 2, axis=0))
    assert score.rms == pytest.approx(expected, rel=1e-4)


def test_a_window_without_a_reference_is_refused():
    with pytest.raises(DataError, match="200-210 s"):
        outages(still(), still(), [(20.0, 30.0), (200.0, 210.0)])


def test_windows_count_from_the_first_motion():
    v = np.zeros((len(T), 3))
    v[T >= 12.5, 1] = 5.0
    reference = Trajectory(T, np.tile(ORIGIN, (len(T), 1)), v)
    assert moving_windows(reference, count=3, length=4.0, every=10.0, after=7.5, speed=4.0) == [
        (20.0, 24.0),
        (30.0, 34.0),
        (40.0, 44.0),
    ]
    with pytest.raises(DataError, match="never faster than 9 m/s"):
        moving_windows(reference, 3, 4.0, 10.0, 7.5, 9.0)
