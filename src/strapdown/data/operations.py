"""Functions on values that the values do not know: clean, judge, show, draw, convert.

`Solution.plot` calls `operation("figure")`. `strapdown/__init__.py` says which function of which room that
is; the room is imported at the first call. So values lie below all rooms that work on them, and have
their methods nevertheless.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_provided: dict[str, str] = {}


def provide(functions: Mapping[str, str]) -> None:
    """Name the functions, {operation: "module:function"}."""
    _provided.update(functions)


def operation(name: str) -> Callable[..., Any]:
    """Return the function that does this."""
    module, _, function = _provided[name].partition(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found
