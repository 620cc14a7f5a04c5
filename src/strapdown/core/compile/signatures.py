"""Signatures of kernels, declared once for Python, numba, LLVM, ctypes and C.

In C a kernel is a function of plain arguments: numbers as `double` and `int64_t`, an array as the
address of its first number (by rows, without gaps), a row of named numbers as the address of a
struct of them, each of eight bytes, a record as the address of a struct of its fields, addresses
and numbers as above, and behind them one `int64_t` for each size of its arrays that has a name, in
the order in which they first occur. Sizes that have a name and stand in no record of the call are
`int64_t` arguments behind all others. A kernel as an argument is its address as an `int64_t`.

A kernel can also be made for eight runs at once, from the same source: its numbers are then lanes,
eight numbers side by side, one of each run (`in_lanes`). An array of lanes has a last dimension of
eight more. A result of lanes is written to an address, which is the very last argument.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

Size: TypeAlias = int | str
"""Size of one dimension of an array: a number, or the name of a size that the call says."""


LANES = 8
"""Runs that go side by side: as many on every processor, so that results do not depend on it."""


class Number(NamedTuple):
    """A `double`, or an `int64_t`; or `lanes` of them side by side."""

    real: bool
    lanes: int = 1


REAL, WHOLE = Number(True), Number(False)


class Numbers(NamedTuple):
    """An array of them, C-contiguous, of float64 or int64; of lanes with LANES for its last
    dimension, which `shape` does not have."""

    item: Number
    shape: tuple[Size, ...]


class Row(NamedTuple):
    """A row of numbers with names, which kernels read and write as attributes: one item of a
    structured array, a struct in C. `fields`: (name, whether real, shape) of each."""

    name: str
    fields: tuple[tuple[str, bool, tuple[int, ...]], ...]


class Rows(NamedTuple):
    """A structured array, C-contiguous."""

    item: Row
    shape: tuple[Size, ...]


class Record(NamedTuple):
    """A NamedTuple of arrays and numbers."""

    made: type[Any]  # its class
    kinds: tuple["Kind", ...]

    @property
    def fields(self) -> tuple[tuple[str, "Kind"], ...]:
        """(name, kind) of each."""
        return tuple(zip(self.made._fields, self.kinds, strict=True))

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the sizes behind its fields."""
        return tuple(dict.fromkeys(_size_names(self.kinds)))


class Function(NamedTuple):
    """Another kernel, by its address."""

    signature: "Signature"


Kind: TypeAlias = Number | Numbers | Row | Rows | Record | Function


class Signature(NamedTuple):
    """The signature of a kernel: its arguments by name, and its result."""

    name: str
    arguments: tuple[tuple[str, Kind], ...]
    result: Number | None = None
    runs: int = 1  # that a call is for

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Kinds of the arguments."""
        return tuple(kind for _, kind in self.arguments)

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the sizes that are arguments of their own in C."""
        of_records = {
            size for kind in self.kinds if isinstance(kind, Record) for size in kind.sizes
        }
        plain = _size_names(kind for kind in self.kinds if isinstance(kind, Numbers | Rows))
        return tuple(size for size in dict.fromkeys(plain) if size not in of_records)


ABI = 3
"""Goes up whenever the rules above change, so that no library is called by other rules than it was
made by."""


def reals(*shape: Size) -> Numbers:
    """An array of float64."""
    return Numbers(REAL, shape)


def wholes(*shape: Size) -> Numbers:
    """An array of int64."""
    return Numbers(WHOLE, shape)


def record(made: type[Any], **kinds: Kind) -> Record:
    """A NamedTuple class with the kinds of its fields. Raises TypeError where they are not its
    fields."""
    if tuple(kinds) != made._fields:
        raise TypeError(f"{made.__name__} has the fields {', '.join(made._fields)}")
    return Record(made, tuple(kinds.values()))


def signature(name: str, result: Number | None = None, /, **arguments: Kind) -> Signature:
    """The Signature of kernels with these arguments."""
    return Signature(name, tuple(arguments.items()), result)


def in_lanes(one: Signature, *shared: str, words: tuple[str, ...] = ()) -> Signature:
    """The Signature of the same kernel for LANES runs at once.

    Arrays of real numbers become arrays of lanes, those of whole numbers where they are named in
    `words`, and a result that is real becomes a lane. What all runs have in common stays: plain
    arguments, other whole numbers, and the arrays and records of the names `shared`, also in the
    signature of a kernel that is an argument.
    """

    def wide(name: str, kind: Kind) -> Kind:
        if isinstance(kind, Function):
            return Function(in_lanes(kind.signature, *shared, words=words))
        if name in shared or isinstance(kind, Number | Row | Rows):
            return kind
        if isinstance(kind, Numbers):
            real = kind.item.real or name in words
            return kind._replace(item=kind.item._replace(lanes=LANES)) if real else kind
        return kind._replace(kinds=tuple(wide(*field) for field in kind.fields))

    result = one.result
    return Signature(
        f"{one.name}_in_lanes",
        tuple((name, wide(name, kind)) for name, kind in one.arguments),
        result._replace(lanes=LANES) if result and result.real else result,
        LANES,
    )


def _size_names(kinds: Any) -> Iterator[str]:
    """Names of the sizes of arrays, as they occur."""
    for kind in kinds:
        if isinstance(kind, Numbers | Rows):
            yield from (size for size in kind.shape if isinstance(size, str))
