"""Numbers, counts, lengths of time and lists in words."""

import pytest

from strapdown.units.wording import (
    capitalise,
    count_text,
    duration_text,
    join_words,
    metres,
    number,
    short,
)

pytestmark = pytest.mark.short


def test_counts_have_the_noun_in_their_number():
    assert [count_text(n, "row") for n in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]
    assert count_text(1, "fix", "es") == "1 fix" and count_text(3, "fix", "es") == "3 fixes"


@pytest.mark.parametrize(
    "value, said",
    [
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "–"),
        (0.0, "0.00"),
        (12.0, "12.0"),
        (123.4, "123"),
        (-1234.5, "-1234"),
        (4.2e-5, "4.20e-05"),
    ],
)
def test_numbers_of_tables_have_three_digits(value, said):
    assert number(value) == said


def test_short_numbers_end_without_zeros_and_without_exponent():
    values = (0.5, 12.0, 123.4, 999.4, 999.6, 1234.5, 2e7)
    assert [short(value) for value in values] == "0.5 12 123 999 1000 1234 2e+07".split()


@pytest.mark.parametrize(
    "seconds, said",
    [
        (0.5, "0.5 s"),
        (45, "45 s"),
        (90, "90 s"),
        (119, "119 s"),
        (120, "2 min"),
        (140, "2 min 20 s"),
        (660, "11 min"),
        (3600, "1 h"),
        (3723, "1 h 2 min"),
        (5400, "1 h 30 min"),
        (7199.6, "2 h"),
    ],
)
def test_lengths_of_time(seconds, said):
    assert duration_text(seconds) == said


def test_lists_and_lengths():
    assert [join_words("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert metres(12.34) == "12.3 m" and metres(4567) == "4.57 km"
    assert capitalise("no IMU") == "No IMU" and capitalise("") == ""
