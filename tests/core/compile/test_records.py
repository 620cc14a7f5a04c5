"""Rows with named fields: the same memory for numpy, for kernels and for C."""

from typing import Annotated

import numpy as np
import pytest

from strapdown.core.compile.jit import kernel
from strapdown.core.compile.records import copy_row, notes, place, row_of, rows, rows_of
from strapdown.core.compile.signatures import REAL, WHOLE, signature
from strapdown.typing import Array, Ints


class Axis:
    """Of an axis."""

    length: int  # samples
    # rad and rad/s
    angle: Annotated[Array, 2]
    places: Annotated[Ints, 3]
    turned: Annotated[Array, 2, 2]


ALONE = signature("alone", REAL, row=row_of(Axis), k=WHOLE)
ALL = signature("all_rows", table=rows_of(Axis, "axes"))


@kernel(ALONE)
def alone(row, k):
    row.length += k
    row.places[2] = row.length
    return row.turned[1, 0] + row.angle[1]


@kernel(ALL)
def all_rows(table):
    for i in range(table.size):
        table[i].turned[0, 1] = 10.0 * i + table[i].length


def test_a_kernel_reads_and_writes_the_rows_of_numpy():
    table = rows(Axis, 3)
    table["length"] = 4, 5, 6
    table[1].turned[1, 0], table[1].angle[1] = 0.5, 0.25
    assert alone(table[1], 2) == 0.75
    assert table["length"].tolist() == [4, 7, 6] and table[1].places.tolist() == [0, 0, 7]
    all_rows(table)
    assert table["turned"][:, 0, 1].tolist() == [4.0, 17.0, 26.0]


def test_every_number_has_eight_bytes_at_the_place_of_its_field():
    table = rows(Axis, 2)
    table[1].angle[:], table[1].turned[1, 1] = (0.5, -2.0), 3.0
    numbers = table.view(np.float64).reshape(2, -1)
    assert numbers.shape[1] == 1 + 2 + 3 + 4
    assert numbers[1, place(Axis, "angle")] == 0.5 and numbers[1, place(Axis, "turned") + 3] == 3.0


def test_a_copy_is_no_view_and_fields_have_their_comments():
    table = rows(Axis, 1)
    own = copy_row(table[0])
    own.length = 9
    assert table[0].length == 0 and alone(own, 1) == 0.0 and own.length == 10
    said = notes(Axis)
    assert list(said) == ["length", "angle", "places", "turned"]
    assert (said["length"], said["angle"], said["turned"]) == ("samples",) + 2 * ("rad and rad/s",)


class Blocks:
    # m, of the first
    # and the second
    one: float
    two: float
    # s, of the third
    three: float
    four: int  # a count


def test_a_comment_after_a_field_begins_anew():
    first = "m, of the first and the second"
    assert notes(Blocks) == {
        "one": first,
        "two": first,
        "three": "s, of the third",
        "four": "a count",
    }


class Mean:
    mean: float  # numpy's rows have a method of that name


class Text:
    name: str


@pytest.mark.parametrize(
    "made, said", [(Mean, "attribute of that name"), (Text, "neither a number")]
)
def test_what_cannot_be_a_field_is_refused(made, said):
    with pytest.raises(TypeError, match=said):
        row_of(made)


def test_another_table_is_refused():
    with pytest.raises(TypeError, match="must be Axis"):
        all_rows(np.zeros(3))


FIRST = 0


@pytest.mark.short
@pytest.mark.parametrize("read", [lambda row, k: row[FIRST] + k, lambda source, k: source[2] * 1.0])
def test_a_kernel_that_reads_a_row_by_number_is_refused(read):
    with pytest.raises(TypeError, match=r"\[(FIRST|2)\]; its fields have names: length, angle, "):
        kernel(ALONE)(read)


@pytest.mark.short
def test_a_kernel_that_reads_a_field_by_number_is_not():
    assert kernel(ALONE)(lambda row, k: row.angle[FIRST]).signature is ALONE
