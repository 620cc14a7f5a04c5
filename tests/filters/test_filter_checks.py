"""A Filter from outside that cannot be used is refused where it is registered, in words that name
the field; and the library's own pass."""

import pytest

from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES

pytestmark = pytest.mark.short


@pytest.mark.parametrize("name", filters.own_names())
def test_the_librarys_own_pass(name):
    filters.check(filters.find(name))


def test_each_says_whom_it_is_for_and_belongs_to_a_family():
    """A row of `strapdown filters` is a line of 100 characters."""
    found = {name: filters.find(name) for name in filters.own_names()}
    assert all(0 < len(each.good_for) <= 56 for each in found.values())
    assert all(0 < len(each.poor_for) <= 60 for each in found.values())
    assert {filters.family(name) for name in found} == {*filters.FAMILIES}
    assert filters.family("mahony") == "attitude" and filters.family("of-a-plugin") == ""


@pytest.mark.parametrize(
    "field, value, said",
    [
        ("name", "my filter", "it must be text without spaces"),
        ("predict", len, "predict"),
        ("correct", len, "correct"),
        ("start", "begin", "start must be a function of an InitialState, a Noise and options"),
        (
            "start",
            lambda start: start,
            "start must be a function of an InitialState, a Noise and options",
        ),
        ("states", (0, STATES), f"states must be indices of states, 0 to {STATES - 1}"),
        ("estimates", (-1,), f"estimates must be indices of states, 0 to {STATES - 1}"),
        ("uses", "position", "uses is 'position'; it must be a tuple of kinds of measurement"),
        ("needs", (1,), r"needs is \(1,\); it must be a tuple of kinds of measurement"),
        ("configure", 1, "configure is 1; it must be a function"),
        ("diagnose", "no", "diagnose is 'no'; it must be a function"),
        ("slots", None, "slots is None; it must be Slots"),
        ("good_for", None, "good_for is None; it must be text"),
    ],
)
def test_a_field_that_cannot_be_is_named(field, value, said):
    good = filters.find("closed-loop")
    with pytest.raises(DataError, match=said) as refused:
        filters.check(good._replace(**{field: value}))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kernel", ["save_step", "adjoint_step"])
def test_the_kernels_of_a_smoother_are_looked_at(kernel):
    good = filters.find("closed-loop")
    wrong = good._replace(smoother=good.smoother._replace(**{kernel: len}))
    with pytest.raises(DataError, match=kernel):
        filters.check(wrong)
    filters.check(good._replace(smoother=None))
