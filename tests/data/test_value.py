"""Values compare by what they hold and never raise; copies and pickles are equal."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from support.recordings import flight, start

import strapdown as sd
from strapdown.data.value import same

pytestmark = pytest.mark.short


@pytest.fixture(scope="module")
def solution():
    return sd.fuse(flight(), start=start(flight()), imu="tactical", covariance=True)


@pytest.fixture(params=["recording", "solution", "trajectory", "source", "innovations", "errors"])
def value(request, solution):
    return {
        "recording": flight(),
        "solution": solution,
        "trajectory": solution.trajectory,
        "source": flight().sources[0],
        "innovations": solution.innovations,
        "errors": solution.errors(),
    }[request.param]


def test_a_copy_and_a_pickle_are_equal(value):
    for other in (
        copy.copy(value),
        copy.deepcopy(value),
        pickle.loads(pickle.dumps(value)),
    ):
        assert other == value and not other != value


def test_another_value_is_not(value):
    for other in (None, 3.0, "text", np.zeros(3), object()):
        assert value != other


def test_one_number_makes_the_difference(solution):
    path = solution.trajectory
    other = replace(path, v_n=path.v_n + np.eye(len(path), 3, -2) * 1e-12)
    assert other != path and replace(solution, trajectory=other) != solution
    assert replace(path, v_n=None) != path


def test_nothing_that_changes_can_be_a_key(value):
    with pytest.raises(TypeError, match="unhashable"):
        hash(value)


def test_what_is_the_same():
    nan = float("nan")
    assert same({"a": [np.array([1.0, nan]), nan]}, {"a": [np.array([1.0, nan]), nan]})
    assert not same(np.array([1.0]), np.array([1]))
    assert not same(np.array([1.0]), [1.0])
    assert not same((1, 2), [1, 2])
    assert not same({"a": 1}, {"b": 1})
