"""Values that compare by what they hold, arrays among it, and whose arrays nobody can write to."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

Numbers = TypeVar("Numbers", bound=NDArray[Any])


class Value:
    """Base of frozen dataclasses (declared with eq=False) that hold arrays.

    Arrays are read-only, also after copying and unpickling: a writable one is copied, so that its
    owner may go on writing to it; one that is read-only already (`read_only`) is taken as it is.
    `==` is True where all compared fields are the same, NaN equal to NaN, of one type or of a type
    and one derived from it, and never raises.
    """

    __hash__: ClassVar[None]  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for each in fields(self):  # type: ignore[arg-type]  # it is the base of dataclasses
            given = getattr(self, each.name)
            kept = _freeze_part(given)
            if kept is not given:
                object.__setattr__(self, each.name, kept)

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update({name: _freeze_part(part) for name, part in state.items()})

    def __eq__(self, other: object) -> bool:
        alike = isinstance(other, type(self)) or isinstance(self, type(other))
        return (
            isinstance(other, Value)
            and alike
            and all(
                same(getattr(self, each.name), getattr(other, each.name))
                for each in fields(self)  # type: ignore[arg-type]  # it is the base of dataclasses
                if each.compare
            )
        )


class TakenByTime:
    """Values whose part by time is taken by `between`; an index would be a row to some and a second to
    others."""

    if not TYPE_CHECKING:  # a type checker says by itself that there is none

        def __getitem__(self, part: object) -> NoReturn:
            name = type(self).__name__
            raise TypeError(
                f"a {name} has no index; select a part by time with .between(10.0, 20.0), in s or "
                "dates"
            )


def read_only(array: Numbers) -> Numbers:
    """Return a view of an array through which nobody can write: a Value takes it without a copy, so
    whoever made the array must not change it any more."""
    view = array.view()
    view.flags.writeable = False
    return view


def _freeze_part(part: Any) -> Any:
    """A part of a value with its arrays read-only; dictionaries and lists are copied."""
    if isinstance(part, np.ndarray):
        return read_only(part.copy()) if part.flags.writeable else part
    if isinstance(part, np.void):  # a row of a table
        return read_only(np.array([part], part.dtype).view(np.recarray))[0]
    if type(part) is dict:
        return {key: _freeze_part(value) for key, value in part.items()}
    if isinstance(part, list | tuple):
        parts = list(map(_freeze_part, part))
        if type(part) is list:
            return parts
        if all(new is old for new, old in zip(parts, part)):
            return part
        return type(part)._make(parts) if hasattr(part, "_make") else tuple(parts)
    return part


def same(a: Any, b: Any) -> bool:
    """Return True where two values hold the same: arrays element by element, NaN equal to NaN, tables
    and lists by what is in them."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if is_dataclass(a) and not isinstance(a, Value):
        return type(a) is type(b) and all(
            same(getattr(a, each.name), getattr(b, each.name)) for each in fields(a) if each.compare
        )
    if hasattr(a, "equals") or hasattr(b, "equals"):  # a table of pandas
        return type(a) is type(b) and bool(a.equals(b))
    try:
        return bool(a == b) or bool(a != a and b != b)
    except (TypeError, ValueError):  # what cannot be compared is not the same
        return False


def _same_arrays(a: Any, b: Any) -> bool:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return False
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    if a.dtype.names:
        return all(_same_arrays(a[name], b[name]) for name in a.dtype.names)
    return np.array_equal(a, b, equal_nan=a.dtype.kind in "fc")
