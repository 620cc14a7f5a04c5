"""Every operation that the package provides names a function that is there."""

import pytest

import strapdown
from strapdown.data import operations

pytestmark = pytest.mark.short


@pytest.mark.parametrize("name", operations._provided)
def test_it_is_a_function(name):
    assert strapdown.__version__ and callable(operations.operation(name))
