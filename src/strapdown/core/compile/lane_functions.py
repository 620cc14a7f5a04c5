"""Helpers that stand for functions of `math` or numpy where those are called with lanes."""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
Pair = tuple[Callable[..., Any], Callable[..., Any]]

_pairs: list[Pair] = []
_listeners: list[Callable[..., None]] = []


def stands_for(*functions: Callable[..., Any]) -> Callable[[Function], Function]:
    """Let a helper stand for these functions in lanes; it takes as many arguments."""

    def keep(helper: Function) -> Function:
        new = [(function, helper) for function in functions]
        _pairs.extend(new)
        for listener in _listeners:
            for pair in new:
                listener(*pair)
        return helper

    return keep


def for_each_helper(listener: Callable[..., None]) -> None:
    """Call `listener(function, helper)` for each pair, also for those that modules imported later bring."""
    for pair in _pairs:
        listener(*pair)
    _listeners.append(listener)
