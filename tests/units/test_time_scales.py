"""Absolute clocks: against the calendar and known leap seconds."""

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.units.time_scales import (
    days_of,
    gps_from_unix,
    gps_of,
    iso,
    leap_seconds,
    midnight,
    rate_of,
    seconds_since,
    unix_from_gps,
)

pytestmark = pytest.mark.short


def test_known_leap_seconds():
    since, ahead = leap_seconds()
    assert ahead[0] == 0 and np.all(np.diff(since) > 0)
    for date, seconds in [("1999-01-01", 13), ("2006-01-01", 14), ("2017-01-01", 18)]:
        row = since.tolist().index(np.datetime64(date, "s").astype(float))
        assert ahead[row] == seconds and ahead[row - 1] == seconds - 1


def test_gps_time_runs_on_through_a_leap_second():
    assert gps_of("2017-01-01T00:00:00Z") - gps_of("2016-12-31T23:59:59Z") == 2
    # GPS week 1930 began at 2017-01-01 00:00:00 of GPS time, 18 s before that of UTC
    assert gps_of("2017-01-01T00:00:00Z") == 1930 * 604800 + 18


def test_there_and_back():
    t = np.linspace(3.2e8, 2e9, 1001)
    np.testing.assert_allclose(unix_from_gps(gps_from_unix(t)), t, rtol=0, atol=1e-6)
    assert iso(gps_of("2024-05-01T12:30:00.25Z")) == "2024-05-01T12:30:00.250000Z"
    assert iso(gps_of("2024-05-01T12:30:00+02:00")) == "2024-05-01T10:30:00Z"
    assert iso(midnight(gps_of("2024-05-01T12:30:00Z"))) == "2024-05-01T00:00:00Z"


def test_posix_nanoseconds_keep_their_steps():
    t = 1714521600_000000000 + 5_000_001 * np.arange(1000)
    found = seconds_since(gps_of("2024-05-01T00:00:00Z"), t, "unix", 1e-9)
    np.testing.assert_allclose(np.diff(found), 5.000001e-3, rtol=0, atol=1e-15)
    assert abs(found[0]) < 1e-6


@pytest.mark.parametrize(
    "t, unit",
    [
        (np.array([5_900_000_000, 4_999_999_999, 0], np.uint64), 1e-9),
        (np.array([-2_000_000_000, 2_000_000_000], np.int32), 1e-3),
        (np.array([-100, 100], np.int8), 1e-3),
        (np.array([7, 2**64 - 1], np.uint64), 1e-9),
    ],
)
def test_whole_numbers_of_any_type_do_not_wrap(t, unit):
    found = seconds_since(0.0, t, "gps", unit)
    np.testing.assert_allclose(found, [int(each) * unit for each in t], rtol=1e-15)


def test_time_of_week():
    found = seconds_since(gps_of("2024-05-01T00:00:00Z"), [259218.0, 259219.5], "gps", 1.0, 2312)
    np.testing.assert_allclose(found, [0.0, 1.5])


def test_what_is_no_time():
    with pytest.raises(DataError, match="write it as"):
        gps_of("yesterday")


def test_days_of_dates_are_those_of_the_calendar():
    days = np.arange("1900-01-01", "2101-01-01", 17, dtype="M8[D]")
    parts = [[each.year, each.month, each.day] for each in days.astype(object)]
    assert (days_of(*np.array(parts, float).T) == days.astype(int)).all()
    wrong = [[2023, 2, 29], [2024, 2, 30], [2024, 4, 31], [2024, 0, 1], [2024, 13, 1], [2024, 1, 0]]
    assert np.isnan(days_of(*np.array([*wrong, [np.nan, 1, 1], [2024, 1, np.nan]]).T)).all()
    assert days_of(*np.array([[2024.0, 2.0, 29.0]]).T).tolist() == [19782]


def test_the_rate_is_that_of_most_intervals():
    assert rate_of(np.array([0, 10, 20, 20, 500, 30], np.uint64), 1e-3) == pytest.approx(100)
    assert rate_of([1.0]) == rate_of([]) == rate_of([2.0, 2.0]) == 0
