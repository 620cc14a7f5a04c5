"""TOML tables by tables of their keys: which field each key sets, how its value is read, and which
keys must be there. Every refusal is a DataError that names the place in the file.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias, TypeVar

from ..checks import DataError, check_keys, check_number

Made = TypeVar("Made")
Read: TypeAlias = Callable[[Any, str], Any]
"""(value as TOML has it, its place in the file) -> value in SI. Raises DataError."""


class Key(NamedTuple):
    """A key of a TOML table."""

    field: str  # that it sets
    read: Read
    needed: str | None = None  # what to write where it is missing; None: it may be


def read_table(table: Any, keys: Mapping[str, Key], where: str = "") -> dict[str, Any]:
    """{field: value} of the keys that a TOML table has. Raises DataError for one that is unknown,
    that is needed and missing, or whose value is none."""
    entries(table, where)
    check_keys(table, keys, where)
    values = {
        field: read(table[key], within(where, key))
        for key, (field, read, _) in keys.items()
        if key in table
    }
    for key, (_, _, needed) in keys.items():
        if needed is not None and key not in table:
            raise DataError(f"{within(where, key)} is missing{needed and '; ' + needed}")
    return values


def within(where: str, key: str) -> str:
    """The place of a key in a table: "[gnss] rate_hz", "[motion] legs 3, turn_deg"."""
    return f"{where}{', ' if where[-1:] not in ('', ']') else ' ' if where else ''}{key}"


def number(value: Any, where: str) -> float:
    """A finite number."""
    return float(check_number(value, where))


def bound(value: Any, where: str) -> float:
    """A number that may be infinite."""
    return value if value == math.inf else number(value, where)


def text(value: Any, where: str) -> str:
    """Text."""
    if not isinstance(value, str):
        raise DataError(f"{where} is {value!r}; it must be text in quotes")
    return value


def flag(value: Any, where: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise DataError(f"{where} is {value!r}; it must be true or false")
    return value


def entries(value: Any, where: str) -> dict[str, Any]:
    """A table, whatever its keys."""
    if not isinstance(value, dict):
        raise DataError(f"{where} is {value!r}; write a table of its keys")
    return value


def items(value: Any, where: str) -> list[Any]:
    """A list, whatever it holds."""
    if not isinstance(value, list):
        raise DataError(f"{where} is {value!r}; write a list in square brackets")
    return value


def three(value: Any, where: str) -> tuple[float, ...]:
    """Three numbers; a single one stands for three."""
    values = value if isinstance(value, list) else [value] * 3
    if len(values) != 3:
        raise DataError(f"{where} has {len(values)} numbers; it takes one or three")
    return tuple(number(each, where) for each in values)


def exactly_three(value: Any, where: str) -> tuple[float, ...]:
    """Three numbers in a list."""
    return three(items(value, where), where)


def list_of(read: Read) -> Read:
    """A tuple of what `read` makes of each item of a list."""
    return lambda value, where: tuple(
        read(each, f"{where} {row}") for row, each in enumerate(items(value, where), 1)
    )


def in_unit(unit: float, read: Read = number) -> Read:
    """A number, or each of several, in a unit of that size."""

    def in_si(value: Any, where: str) -> Any:
        read_value = read(value, where)
        if isinstance(read_value, tuple):
            return tuple(each * unit for each in read_value)
        return read_value * unit

    return in_si


def table_reader(
    kind: Callable[..., Made], keys: Mapping[str, Key], **others: Any
) -> Callable[[Any, str], Made]:
    """Return a reader that calls `kind` on the fields of a table; `others` are fields where the
    table has none."""
    return lambda value, where: kind(**others | read_table(value, keys, where))


def section(read: Read) -> Read:
    """Return a reader that applies `read` to a table that is a section [of its own]."""

    def in_brackets(value: Any, where: str) -> Any:
        if not isinstance(value, dict):
            raise DataError(f"{where} is {value!r}; write a section [{where}]")
        return read(value, f"[{where}]")

    return in_brackets
