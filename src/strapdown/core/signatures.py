"""What kernels take and return, said once for Python, numba, LLVM, ctypes and C.

In C a kernel is a function of plain arguments: numbers as `double` and `int64_t`, an array as the
address of its first number (by rows, without gaps), a record as the address of a struct of its
fields, addresses and numbers as above, and behind them one `int64_t` for each size of its arrays that
has a name, in the order in which they first occur. Sizes that have a name and stand in no record of
the call are `int64_t` arguments behind all others. A kernel as an argument is its address as an
`int64_t`.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

Size: TypeAlias = int | str
"""Of one dimension of an array: a number, or the name of a size that the call says."""


class Number(NamedTuple):
    """A `double`, or an `int64_t`."""

    real: bool


REAL, WHOLE = Number(True), Number(False)


class Numbers(NamedTuple):
    """An array of them, C-contiguous, of float64 or int64."""

    item: Number
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
        return tuple(dict.fromkeys(_named(self.kinds)))


class Function(NamedTuple):
    """Another kernel, by its address."""

    signature: "Signature"


Kind: TypeAlias = Number | Numbers | Record | Function


class Signature(NamedTuple):
    """Of a kernel: its arguments by name, and what it returns."""

    name: str
    arguments: tuple[tuple[str, Kind], ...]
    result: Number | None = None

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Of the arguments."""
        return tuple(kind for _, kind in self.arguments)

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the sizes that are arguments of their own in C."""
        of_records = {
            size for kind in self.kinds if isinstance(kind, Record) for size in kind.sizes
        }
        plain = _named(kind for kind in self.kinds if isinstance(kind, Numbers))
        return tuple(size for size in dict.fromkeys(plain) if size not in of_records)


ABI = 1
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


def _named(kinds: Any) -> Iterator[str]:
    """Names of the sizes of arrays, as they occur."""
    for kind in kinds:
        if isinstance(kind, Numbers):
            yield from (size for size in kind.shape if isinstance(size, str))
