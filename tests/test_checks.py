"""Refusals said one way: what is accepted comes back as it was, what is not ends in one line."""

import numpy as np
import pytest

from strapdown.checks import (
    DataError,
    check_array,
    check_choice,
    check_keys,
    check_number,
    did_you_mean,
)

pytestmark = pytest.mark.short
INF, NAN = float("inf"), float("nan")


@pytest.mark.parametrize(
    "value, bounds",
    [
        (0, dict(least=0)),
        (2.5, dict(above=0, most=2.5)),
        (INF, dict(least=0, infinite=True)),
        (np.int64(3), dict(whole=True, above=2, below=4)),
        (np.float32(1), {}),
        (-1e300, {}),
    ],
)
def test_numbers_within_their_bounds(value, bounds):
    assert check_number(value, "rate", "Hz", **bounds) is value


@pytest.mark.parametrize(
    "value, bounds, said",
    [
        (-1, dict(above=0), "rate is -1 Hz; it must be a finite number above 0"),
        (0, dict(above=0), "above 0"),
        (-1e-9, dict(least=0), "it must be a finite number, 0 or more"),
        (3, dict(above=0, most=2), "above 0 and at most 2"),
        (2, dict(below=2), "a finite number below 2"),
        (NAN, {}, "rate is nan Hz; it must be a finite number"),
        (INF, dict(least=0), "finite"),
        (NAN, dict(infinite=True), "it must be a number"),
        (1.5, dict(whole=True, least=1), "a whole number, 1 or more"),
        (10**400, {}, "a finite number"),
        (np.eye(3), {}, "array("),
        (True, {}, "True"),
        ("1", {}, "'1'"),
        (None, {}, "None"),
    ],
)
def test_numbers_out_of_their_bounds(value, bounds, said):
    with pytest.raises(DataError) as error:
        check_number(value, "rate", "Hz", **bounds)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_arrays():
    assert check_array([1, 2], "std", (2,)).dtype == float
    assert check_array(np.eye(3), "C", (None, 3)).shape == (3, 3)
    assert np.isnan(check_array([NAN], "y", (1,), finite=False)).all()
    for value, shape in (([1, 2], (3,)), ([1, NAN], (2,)), ("x", (1,)), ([[1], [1, 2]], (2, None))):
        with pytest.raises(DataError, match="^std is .*; it must be .* finite numbers$"):
            check_array(value, "std", shape)
    with pytest.raises(DataError, match=r"std is of shape .1000,.; it must be 3 finite numbers"):
        check_array(list(range(1000)), "std", (3,))


def test_words():
    assert check_choice("closed-loop", "filter", ["closed-loop", "mekf"]) == "closed-loop"
    with pytest.raises(DataError, match=r"filter is 'closed-lop' \(did you mean 'closed-loop'\?\)"):
        check_choice("closed-lop", "filter", ["closed-loop", "mekf"])
    with pytest.raises(DataError, match="filter is 3; it must be one of mekf"):
        check_choice(3, "filter", ["mekf"])
    check_keys(["a"], ["a", "b"])
    with pytest.raises(DataError, match=r"^\[imu\]: unknown key 'rat' .did you mean 'rate'"):
        check_keys(["rat"], ["rate"], "[imu]")
    assert did_you_mean("NKA", ["nKa", "x"]) == " (did you mean 'nKa'?)"
    assert did_you_mean("zzz", ["nKa"]) == ""
