"""Streams of chance: the same numbers wherever they are drawn, and streams that have nothing to do
with each other."""

from concurrent.futures import ThreadPoolExecutor
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import kstest

from strapdown.sensor_models.streams import RandomStream

COUNT = 200_000


def test_a_number_depends_on_its_place_alone():
    stream = RandomStream.of(3).child("gyro")
    long = stream.standard_normal((101, 3))
    for count in (1, 2, 50):
        assert np.array_equal(stream.standard_normal((count, 3)), long[:count])
    assert np.array_equal(stream.standard_normal(303), long.ravel())
    assert np.array_equal(stream.random(7), stream.random(70)[:7])
    assert stream.standard_normal((0, 3)).shape == (0, 3)


def test_threads_draw_the_same():
    alone = [RandomStream.of(seed).standard_normal(1000) for seed in range(40)]
    with ThreadPoolExecutor(8) as pool:
        beside = list(pool.map(lambda seed: RandomStream.of(seed).standard_normal(1000), range(40)))
    assert np.array_equal(alone, beside)


def test_what_a_stream_can_be_made_of():
    stream = RandomStream.of(5)
    assert RandomStream.of(stream) is stream
    assert stream == RandomStream.of(np.random.SeedSequence(5)) == RandomStream.of([5])
    used = np.random.SeedSequence(5)
    used.spawn(3)
    assert RandomStream.of(used) == stream  # however often it was used
    assert (
        RandomStream.of(2**200 + 1)
        != RandomStream.of(1)
        != RandomStream.of([1, 2])
        != RandomStream.of([2, 1])
    )
    rng = np.random.default_rng(5)
    first, second = RandomStream.of(rng), RandomStream.of(rng)
    assert first != second and first == RandomStream.of(np.random.default_rng(5))


def test_names_and_numbers_make_streams_of_their_own():
    stream = RandomStream.of(0)
    some = [
        stream,
        RandomStream.of(1),
        *stream.spawn(100),
        *map(stream.child, ("a", "b", "1", "", "é")),
    ]
    some += [stream.child("a").child("b"), stream.child("b").child("a"), stream.child("a b")]
    assert len({each.key for each in some}) == len(some)
    assert stream.spawn(2)[1] == stream.numbered_child(1) and stream.child("a") == stream.child("a")
    assert all(0 <= word < 2**32 for each in some for word in each.key)


def test_numbers_have_their_laws():
    """Kolmogorov-Smirnov, 1 in 1e4 each, and the first four moments within 4 sigma."""
    stream = RandomStream.of(11)
    z, u = stream.standard_normal(COUNT), stream.random(COUNT)
    assert kstest(z, "norm").pvalue > 1e-4 and kstest(u, "uniform").pvalue > 1e-4
    for power, mean, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert np.mean(z**power) == pytest.approx(mean, abs=4 * np.sqrt(variance / COUNT))
    assert 0 < u.min() and u.max() < 1


def test_streams_and_places_are_independent():
    """Correlations of streams that follow from each other, of numbers next to each other and of their
    squares: 57 within 5 sigma, 3 in 1e5 to be wrong."""
    stream = RandomStream.of(2)
    some = [
        stream,
        RandomStream.of(3),
        *stream.spawn(2),
        stream.child("a"),
        stream.child("a").child("b"),
    ]
    drawn = np.array([each.standard_normal(COUNT) for each in some])
    pairs = [(drawn[i], drawn[j]) for i, j in combinations(range(len(some)), 2)]
    pairs += [(row[:-lag], row[lag:]) for row in drawn for lag in (1, 2)]
    pairs += [(a**2 / np.sqrt(2), b**2 / np.sqrt(2)) for a, b in pairs]
    assert max(abs(np.corrcoef(a, b)[0, 1]) * np.sqrt(len(a)) for a, b in pairs) < 5
