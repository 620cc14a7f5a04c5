"""The layout of the single struct of an exported filter: the fields of the kernels' records, with
their sizes as numbers."""

from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ...core.compile.signatures import Number, Numbers, Record, Row, Rows
from ...core.loop.cursor import CURSOR
from ...core.loop.tables import FIXES, IMU, OUTPUT
from ...core.mathematics.belief import BELIEF, NOISE
from ...typing import Array, Ints

RECORDS: Mapping[str, Record] = {
    "belief": BELIEF,
    "imu": IMU,
    "fixes": FIXES,
    "noise": NOISE,
    "cursor": CURSOR,
    "out": OUTPUT,
}
"""The records in the order in which the loop takes them, by the name of its argument."""
BYTES = 8
"""Size of every number, so that no compiler leaves a gap between them."""


class MemoryPlace(NamedTuple):
    """A field of a record."""

    record: str
    name: str
    real: bool  # double, else int64_t; of a table neither
    shape: tuple[int, ...]  # () of a number
    first: int  # numbers before it in the struct
    sizes: tuple[int | str, ...] = ()  # the shape as declared
    row: Row | None = None  # of a table: the type of its rows

    @property
    def length(self) -> int:
        """Number of numbers."""
        return prod(self.shape) * (words(self.row) if self.row else 1)

    def within(self, k: int) -> tuple[str, bool]:
        """(suffix of its name in C for its number k, whether that is a double)."""
        if self.row is None:
            return _index(self.shape, k), self.real
        row, k = divmod(k, words(self.row))
        for name, real, shape in self.row.fields:
            if k < prod(shape):
                return f"{'' if self.single else f'[{row}]'}.{name}{_index(shape, k)}", real
            k -= prod(shape)
        raise IndexError(k)

    @property
    def single(self) -> bool:
        """True for a table of one row, which is a struct in C and no array of them."""
        return self.row is not None and self.sizes == (1,)


def words(row: Row) -> int:
    """Numbers of a row."""
    return sum(prod(shape) for _, _, shape in row.fields)


def _index(shape: Sequence[int], k: int) -> str:
    """The number k of an array, in brackets."""
    found = ""
    for size in reversed(shape):
        k, i = divmod(k, size)
        found = f"[{i}]{found}"
    return found


class ExportLayout(NamedTuple):
    """The fields in their order, and the sizes by name."""

    places: tuple[MemoryPlace, ...]
    sizes: Mapping[str, int]

    @property
    def length(self) -> int:
        """Numbers in all."""
        last = self.places[-1]
        return last.first + last.length

    def of(self, record: str) -> Iterator[MemoryPlace]:
        """Those of a record."""
        return (place for place in self.places if place.record == record)


def layout(sizes: Mapping[str, int]) -> ExportLayout:
    """The layout with these sizes. Sizes of one name are the same in all records, but `states` of
    Output, which is `n` of a FilterState."""
    places, first = [], 0
    for record, kinds in RECORDS.items():
        for name, kind in kinds.fields:
            declared: tuple[int | str, ...] = ()
            real = isinstance(kind, Number) and kind.real
            row = kind.item if isinstance(kind, Rows) else None
            if isinstance(kind, Numbers):
                declared, real = kind.shape, kind.item.real
            elif isinstance(kind, Rows):
                declared = kind.shape
            shape = tuple(sizes[size] if isinstance(size, str) else size for size in declared)
            places.append(MemoryPlace(record, name, real, shape, first, declared, row))
            first += places[-1].length
    return ExportLayout(tuple(places), dict(sizes))


def sizes_of(values: Mapping[str, Sequence[Any]]) -> dict[str, int]:
    """{name of a size: number} of the records of a run, by their names in RECORDS. An array may be
    longer than its kind says."""
    found: dict[str, int] = {}
    for record, kinds in RECORDS.items():
        for (name, kind), value in zip(kinds.fields, values[record], strict=True):
            if not isinstance(kind, Numbers | Rows):
                continue
            for declared, size in zip(kind.shape, np.shape(value), strict=True):
                if isinstance(declared, str) and found.setdefault(declared, size) != size:
                    raise RuntimeError(
                        f"{record}.{name}: {declared} is {size} and {found[declared]}"
                    )
    return found


def numbers(values: Mapping[str, Sequence[Any]], made: ExportLayout) -> tuple[Array, Ints]:
    """All numbers of the records of a run in the order of the struct: as doubles, and as int64;
    each is 0 in the other."""
    real, whole = np.zeros(made.length), np.zeros(made.length, np.int64)
    for place in made.places:
        value = values[place.record][RECORDS[place.record].made._fields.index(place.name)]
        here = slice(place.first, place.first + place.length)
        if place.row is None:
            (real if place.real else whole)[here] = np.ravel(value)
        else:
            kinds = [place.within(k)[1] for k in range(words(place.row))]
            reals = np.tile(kinds, len(value))
            real[here] = np.where(reals, value.reshape(-1).view(np.float64), 0.0)
            whole[here] = np.where(reals, 0, value.reshape(-1).view(np.int64))
    return real, whole
