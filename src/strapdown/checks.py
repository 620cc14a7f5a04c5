"""Checks of arguments at the public functions, with messages of one form: numbers out of range,
arrays of another shape, unknown words.

Every check raises a DataError of one line: the value, and what it must be. Nothing here knows
files.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from numbers import Integral, Real
from os import PathLike
from types import UnionType
from typing import TYPE_CHECKING, TypeGuard

if TYPE_CHECKING:
    from .typing import Array


class DataError(ValueError):
    """Unusable input: one line that names file, row or field, and the remedy. The line is always
    printable and not longer than MAX."""

    def __init__(self, text: object = "") -> None:
        text = printable(str(text))
        if len(text) > MAX_MESSAGE:
            text = f"{text[: MAX_MESSAGE - 505]} ... {text[-500:]}"
        super().__init__(text)


MAX_MESSAGE = 3000
"""Characters of a message."""


def printable(text: str) -> str:
    """The text on one line, its control characters as escapes, so that none moves the cursor, colours
    or turns round what is printed."""
    if text.isprintable():
        return text
    signs = (each if each.isprintable() else " " if each in "\n\r\t" else None for each in text)
    return "".join(ascii(own)[1:-1] if sign is None else sign for sign, own in zip(signs, text))


@contextmanager
def locate_errors(where: object) -> Iterator[None]:
    """Every DataError of the block begins with the place: "plan 'mine': ..."."""
    try:
        yield
    except DataError as error:
        raise type(error)(f"{where}: {error}") from None


def is_number(value: object) -> TypeGuard[float]:
    """True for a real number; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def one_line_repr(value: object) -> str:
    """The value on one line, numbers of numpy as plain ones."""
    return " ".join(repr(_plain(value)).split())


def brief(value: object) -> str:
    """The beginning of what `one_line_repr` gives."""
    text = one_line_repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    item = getattr(value, "item", None)
    return item() if callable(item) and getattr(value, "shape", None) == () else value


def check_type(
    value: object, name: str, kinds: type | UnionType | tuple[type, ...], wanted: str
) -> None:
    """Refuse a value of another type. Raises DataError, e.g. "path is 3; it must be a path"."""
    if not isinstance(value, kinds):
        raise DataError(f"{name} is {brief(value)}; it must be {wanted}")


def check_path(value: object, name: str = "path") -> None:
    """Refuse what is no path. Raises DataError."""
    check_type(value, name, (str, PathLike), "the path of a file, text or a Path")


def check_window(value: object, name: str = "window") -> tuple[float, float]:
    """The window, (start, stop) in s. Raises DataError where it is something else."""
    pair = tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else ()
    if len(pair) != 2 or not all(map(is_number, pair)):
        raise DataError(f"{name} is {brief(value)}; it must be (start, stop) in s")
    return pair


def check_flag(value: object, name: str) -> bool:
    """The value, which must be True or False. Raises DataError."""
    if not isinstance(value, bool):
        raise DataError(f"{name} is {one_line_repr(value)}; it must be True or False")
    return value


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def nearest(word: object, words: Iterable[str]) -> str | None:
    """The one of `words` that is most like `word`, in upper or lower case, if one is like it."""
    by_lower = {each.lower(): each for each in words}
    match = get_close_matches(str(word).lower(), by_lower, 1, 0.5)
    return by_lower[match[0]] if match else None


def did_you_mean(word: object, words: Iterable[str]) -> str:
    """ " (did you mean 'x'?)" where one of `words` is like `word`, else nothing."""
    near = nearest(word, words)
    return f" (did you mean {near!r}?)" if near else ""


def check_choice(value: object, name: str, choices: Collection[str]) -> str:
    """The value, which must be one of the words. Raises DataError with the nearest."""
    if not isinstance(value, str) or value not in choices:
        known = ", ".join(choice or "''" for choice in choices)
        raise DataError(
            f"{name} is {value!r}{did_you_mean(value, choices)}; it must be one of {known}"
        )
    return value


def check_keys(keys: Iterable[str], known: Collection[str], where: str = "") -> None:
    """Refuse the first key that is not known. Raises DataError with the nearest."""
    for key in keys:
        if key not in known:
            raise DataError(
                f"{where and where + ': '}unknown key {key!r}{did_you_mean(key, known)}; known: {', '.join(known)}"
            )


def check_number(
    value: object,
    name: str,
    unit: str = "",
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
    whole: bool = False,
    infinite: bool = False,
) -> float:
    """The value, which must be a real number in these bounds, finite unless `infinite` allows inf
    itself. Raises DataError, e.g. "rate is -1 Hz; it must be a finite number above 0"."""
    fits = (
        is_number(value)
        and least <= value <= most
        and (above < value or above == -math.inf)
        and (value < below or below == math.inf)
        and (_finite(value) or (infinite and abs(value) == math.inf))
        and (not whole or isinstance(value, Integral))
    )
    if not fits:
        kind = "a whole number" if whole else "a number" if infinite else "a finite number"
        raise DataError(
            f"{name} is {one_line_repr(value)}{unit and ' ' + unit}; it must be {kind}"
            f"{_bounds(least, above, most, below)}"
        )
    return value  # type: ignore[return-value]


def check_array(
    value: object,
    name: str,
    shape: Sequence[int | None],
    *,
    finite: bool = True,
    what: str = "numbers",
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
) -> "Array":
    """The value as an array of floats of this shape, where None is any length, in these bounds,
    without NaN and inf unless `finite` is False. Raises DataError."""
    import numpy as np

    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    fits = array.ndim == len(shape) and all(
        size in (None, own) for size, own in zip(shape, array.shape)
    )
    outside = (array < least) | (array > most) | ((array <= above) & (above > -math.inf))
    if not fits or outside.any() or (finite and not np.isfinite(array).all()):
        wanted = " x ".join("n" if size is None else str(size) for size in shape)
        bounds = _bounds(least, above, most).strip(", ")
        raise DataError(
            f"{name} is {_brief(value, array)}; it must be {wanted} {'finite ' if finite else ''}{what}"
            f"{bounds and ', each ' + bounds}"
        )
    return array


def _bounds(least: float, above: float, most: float, below: float = math.inf) -> str:
    """Those that are finite, as they follow upon "a number"."""
    bounds = [
        text
        for text, bound in (
            (f"above {above:g}", above),
            (f"{least:g} or more", least),
            (f"below {below:g}", below),
            (f"at most {most:g}", most),
        )
        if math.isfinite(bound)
    ]
    separator = ", " if math.isfinite(least) and above == -math.inf else " "
    return separator + " and ".join(bounds) if bounds else ""


def _brief(value: object, array: "Array") -> str:
    """The value on one line, or where it is long what of it, read as `array`, is wrong."""
    import numpy as np

    text = " ".join(repr(value).split())
    if len(text) <= 80 or not array.size:
        return text if len(text) <= 80 else text[:77] + "..."
    bad = np.argwhere(~np.isfinite(array))
    return f"of shape {array.shape}{f', not finite at {bad[0].tolist()}' if len(bad) else ''}"
