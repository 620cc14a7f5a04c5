"""A MeasurementModel from outside that cannot be used is refused where it is registered, in words that
name the field; and every kind of the library's own passes."""

import pytest

from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.loop.contract import Kind

pytestmark = pytest.mark.short


@pytest.mark.parametrize("name", aiding.own_names())
def test_the_librarys_own_pass(name):
    aiding.check(aiding.find(name))


@pytest.mark.parametrize(
    "field, value, said",
    [
        ("name", "vertical speed", "it must be text without spaces"),
        ("observe", len, "observe"),
        ("quantities", ["length"], r"quantities is \['length'\]; it must be a tuple of texts"),
        ("quantities", (1.0,), "it must be a tuple of texts"),
        ("quantities", (), "it has 0 quantities; it must have 1 to 3"),
        ("quantities", ("length",) * 4, "it has 4 quantities; it must have 1 to 3"),
        ("quantities", ("lenght",), "did you mean 'length'"),
        ("parameters", "antena", "parameters"),
        ("vector", "e", "vector"),
        ("when", "flying", "when"),
        ("mean_of", "magnet", "mean_of"),
        ("states", "bias", "states is 'bias'; it must be a tuple of texts"),
        ("states", ("a [m]", "b [m]", "a [m]"), "two of its states have one name"),
        ("state_walk", -1e-9, "state_walk"),
        ("shared", 3, "shared"),
        ("shared", "wind", "no states to share"),
    ],
)
def test_a_field_that_cannot_be_is_named(field, value, said):
    good = aiding.find("altitude")
    aiding.check(good)
    with pytest.raises(DataError, match=said) as refused:
        aiding.check(good._replace(**{field: value}))
    assert "\n" not in str(refused.value)


def test_states_need_an_initial_standard_deviation():
    sensor = aiding.find("altitude")._replace(states=("b [m]",))
    with pytest.raises(DataError, match="state_std"):
        aiding.check(sensor._replace(state_std=0.0))
    aiding.check(sensor._replace(state_std=1e-9))
    aiding.check(sensor._replace(states=(), state_std=0.0))


def test_up_to_three_quantities_are_right():
    for n in (1, 2, 3):
        aiding.check(aiding.find("altitude")._replace(quantities=("length",) * n))


def test_kernels_know_the_numbered_kinds_by_their_place():
    assert [aiding.number(aiding.name_of(kind)) for kind in Kind] == list(Kind)
    assert [aiding.number(name) for name in aiding.own_names()] == list(
        range(len(aiding.own_names()))
    )
