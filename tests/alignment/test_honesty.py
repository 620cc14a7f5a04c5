"""Starts are as good as they say, over seeds on which nothing was chosen: the table of
`python tests/support/start_honesty.py`."""

import pytest
from start_honesty import CASES, bound, table

BRIEFLY = ("car, 2 m/s", "car, rest later", "walker", "flight")
NOTED = 0.9  # share of the starts that were found in the way that the case is about


def check(name, count):
    squares, says, _ = table([name], range(1, 1 + count))[name]
    assert {part: value for part, value in squares.items() if value > bound(count)} == {}
    assert says >= NOTED, says


@pytest.mark.parametrize("name", BRIEFLY)
def test_a_few_starts(name):
    check(name, 6)


@pytest.mark.deep
@pytest.mark.parametrize("name", CASES)
def test_100_starts(name):
    check(name, 100)
