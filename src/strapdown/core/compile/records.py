"""Rows of numbers with names: what a class with annotated fields says becomes a structured array, which
kernels read and write as `row.field`, plain Python as well, and C as a struct.

    class Axis:
        length: int  # samples at the present value
        mean: Annotated[Array, 3]  # m/s^2

    axes = rows(Axis, 6)
    axes[0].length += 1

Every number takes eight bytes, so that no compiler leaves a gap between them.
"""

import dis
import inspect
import re
from collections.abc import Hashable, Iterator
from functools import cache
from typing import Any, Protocol, TypeVar, get_args, get_origin, get_type_hints, overload

import numpy as np

from ...typing import Array, Ints, Mask
from .signatures import Row, Rows, Signature, Size

Named = TypeVar("Named", covariant=True)


class Table(Protocol[Named]):
    """A structured array whose rows have the fields of a class: what of an array is used."""

    @property
    def size(self) -> int:
        """Number of rows."""

    @property
    def dtype(self) -> Any:
        """numpy's type of a row."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[Named]: ...

    @overload
    def __getitem__(self, rows: int) -> Named: ...

    @overload
    def __getitem__(self, rows: slice | Array | Ints | Mask) -> "Table[Named]": ...

    @overload
    def __getitem__(self, rows: str) -> Any: ...  # a column

    def __setitem__(self, rows: Any, value: Any) -> None: ...

    def copy(self) -> "Table[Named]":
        """The same in memory of its own."""

    def view(self, kind: Any) -> Any:
        """The same memory as another type."""

    def reshape(self, *shape: int) -> Any:
        """The same rows in another shape."""


def row_of(made: type[Any]) -> Row:
    """The kind of a row with the annotated fields of a class: float, int, or an array of them as
    Annotated[Array, size, ...]. Raises TypeError for any other field."""
    return _row_of(made)  # type: ignore[arg-type]


@cache
def _row_of(made: Hashable) -> Row:
    fields = []
    for name, hint in get_type_hints(made, include_extras=True).items():
        shape: tuple[int, ...] = ()
        if get_origin(hint) is not None and hasattr(hint, "__metadata__"):
            hint, shape = get_args(hint)[0], tuple(hint.__metadata__)
        if hint not in (float, int, Array, Ints) or (hint in (Array, Ints)) != bool(shape):
            raise TypeError(f"{_name(made)}.{name} is neither a number nor an array of them")
        if hasattr(np.recarray, name) or hasattr(np.record, name):
            raise TypeError(f"{_name(made)}.{name}: numpy's rows have an attribute of that name")
        fields.append((name, hint in (float, Array), shape))
    return Row(_name(made), tuple(fields))


def _name(made: Any) -> str:
    return str(made.__name__)


def rows_of(made: type[Any], *shape: Size) -> Rows:
    """The kind of an array of such rows."""
    return Rows(row_of(made), shape)


@cache
def dtype_of(row: Row) -> np.dtype[Any]:
    """numpy's type of a row."""
    listed = [(name, "f8" if real else "i8", shape) for name, real, shape in row.fields]
    return np.dtype(listed, align=True)


def rows(made: type[Any], count: int) -> Any:
    """So many rows of zeros, as a record array: a `Table` of the class, whose columns are
    attributes as well."""
    return np.zeros(count, dtype_of(row_of(made))).view(np.recarray)


def place(made: type[Any], name: str) -> int:
    """Number of numbers of a row before a field."""
    return int(dtype_of(row_of(made)).fields[name][1]) // 8  # type: ignore[index]


@cache
def notes(made: Hashable) -> dict[str, str]:
    """Return {field: comment} of a class: the comment on the line of the field, else the one above
    it, else that above the fields before it."""
    found: dict[str, str] = {}
    above: list[str] = []
    read = False  # a field came after these lines, so the next comment begins anew
    for line in inspect.getsource(made).splitlines()[1:]:  # type: ignore[arg-type]
        code, _, said = line.strip().partition("#")
        if not code:
            above = [*([] if read else above), said.strip()] if said else []
            read = False
        elif field := re.match(r"(\w+):", code):
            found[field[1]] = " ".join([said.strip()] if said else above)
            read = True
    return found


def copy_row(row: Any) -> Any:
    """A row of its own with the same numbers."""
    (own,) = table = np.empty(1, row.dtype).view(np.recarray)
    table[0] = row
    return own


def check_names(function: Any, signature: Signature) -> None:
    """Raise TypeError where a function reads a row by number: numba takes `row[0]` for the first field,
    whatever that is."""
    names = function.__code__.co_varnames
    named = {name: kind for name, kind in zip(names, signature.kinds) if isinstance(kind, Row)}
    done = [*dis.get_instructions(function)]
    for row, index, what in zip(done, done[1:], done[2:]):
        if what.opname.startswith("BINARY_SUBSCR") or what.argrepr == "[]":
            value = index.argval
            if index.opname == "LOAD_GLOBAL":
                value = function.__globals__.get(index.argval)
            if (
                row.opname.startswith("LOAD_FAST")
                and row.argval in named
                and isinstance(value, int)
            ):
                fields = ", ".join(field for field, *_ in named[row.argval].fields)
                raise TypeError(
                    f"{function.__module__}.{function.__qualname__} reads {row.argval}[{index.argval}]; "
                    f"its fields have names: {fields}"
                )
