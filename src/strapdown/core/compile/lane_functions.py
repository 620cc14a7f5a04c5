"""Which helper stands for a function of `math` or numpy where that is called with lanes."""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

HELPERS: dict[Callable[..., Any], Any] = {}
"""{function: helper of as many arguments}."""


def stands_for(*functions: Callable[..., Any]) -> Callable[[Function], Function]:
    """Let a helper stand for these functions in lanes."""

    def keep(helper: Function) -> Function:
        HELPERS.update(dict.fromkeys(functions, helper))
        return helper

    return keep
