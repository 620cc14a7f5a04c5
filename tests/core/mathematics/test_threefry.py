"""Random numbers from a counter: known answers, laws, and the same bits from compiled code and from
plain Python."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from strapdown.core.mathematics.threefry import (
    COUNTER,
    box_muller,
    new_stream,
    normal_rows,
    normals,
    threefry,
    uniform,
)

pytestmark = pytest.mark.short
ONES, PI = 0xFFFFFFFF, (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344)


def table_of(seed, rows, size):
    table = np.empty((rows, size))
    normal_rows(new_stream(seed), table)
    return table


@pytest.mark.parametrize(
    "key, counter, words",
    [
        ((0, 0), (0, 0), (0x6B200159, 0x99BA4EFE)),
        ((ONES, ONES), (ONES, ONES), (0x1CB996FC, 0xBB002BE7)),
        (PI[2:], PI[:2], (0xC4923A9C, 0x483DF7A0)),
    ],
)
def test_threefry_gives_the_known_answers_of_random123(key, counter, words):
    assert threefry(*key, *counter) == words


def test_normals_are_normal():
    """Kolmogorov-Smirnov, and the variance within its 1 in 1e4 band; another seed gives other
    numbers."""
    table = table_of(3, 2000, 15)
    assert kstest(table.ravel(), "norm").pvalue > 1e-4
    low, high = chi2.ppf([5e-5, 1 - 5e-5], table.size)
    assert low < np.sum(table**2) < high and abs(table.sum()) < 4 * np.sqrt(table.size)
    assert not np.isclose(table_of(4, 1, 15), table[0]).any()
    assert not np.isclose(table_of(3 + 2**32, 1, 15), table[0]).any()


def test_normals_have_the_same_bits_one_by_one_and_in_a_table():
    """The one is plain Python, the other compiled."""
    table, stream, row = table_of(3, 200, 15), new_stream(3), np.zeros(15)
    for k in range(200):
        normals(stream, row, 15)
        assert np.array_equal(row, table[k])
    assert stream[COUNTER] == 200 * 8


def test_normals_are_those_of_their_words():
    """Box & Muller's formula in the functions of the C library, at the ends of the words too."""
    words = [
        (0, 0),
        (ONES, ONES),
        (0, ONES),
        (1 << 31, 1 << 30),
        *(PI[k : k + 2] for k in range(3)),
    ]
    for x, y in words:
        radius = math.sqrt(-2 * math.log((x + 0.5) / 2**32))
        angle = 2 * math.pi * (y + 0.5) / 2**32
        assert box_muller(x, y) == pytest.approx(
            (radius * math.cos(angle), radius * math.sin(angle)), rel=1e-13, abs=1e-14
        )


def test_uniforms_are_uniform():
    """Kolmogorov-Smirnov, 1 in 1e4."""
    stream = new_stream(11)
    drawn = np.array([uniform(stream) for _ in range(2000)])
    assert (
        kstest(drawn, "uniform").pvalue > 1e-4
        and 0 < drawn.min()
        and drawn.max() < 1
        and stream[COUNTER] == 2000
    )


@pytest.mark.parametrize("seed", [-1, 0.5, 2**53, math.nan, math.inf])
def test_seeds_that_are_none(seed):
    with pytest.raises(ValueError, match="whole number"):
        new_stream(seed)
