"""Fixes outside the IMU record: what may have shifted them."""

import pytest

from strapdown.preprocessing.fixes import likely_shift
from strapdown.units.time_scales import GPS_ZERO, WEEK

pytestmark = pytest.mark.short


@pytest.mark.parametrize(
    "start, first, shift, words",
    [
        (0.0, 7200.0, -7200, "a time zone, -2 h?"),
        (0.0, -19790.0, 19800, "a time zone, +5.5 h?"),
        (1000.0, 1000.0 + 86400, -86400, "whole days, -1?"),
        (1.7e9 - GPS_ZERO, 1.7e9, -GPS_ZERO, "the epochs of Unix time and GPS time?"),
        (1e5, 2200 * WEEK + 1e5 + GPS_ZERO - 18, -GPS_ZERO - 2200 * WEEK, "seconds of the week?"),
    ],
)
def test_what_brings_fixes_into_the_record(start, first, shift, words):
    text = likely_shift(start, start + 600.0, first, first + 600.0)
    assert words in text and text.startswith(f"{shift:+.0f} s added to its time")


def test_nothing_is_guessed():
    assert likely_shift(0.0, 600.0, 1e4, 1e4 + 600) is None
