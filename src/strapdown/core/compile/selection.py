"""Choices by value in helpers that run for one run or for eight at once.

For one run they are plain Python: `where` picks one of two numbers, `any_of` and `all_of` give
back the truth value. For eight, numbers are lanes, a comparison is a truth value per lane, and `if`
would have to go both ways: so a helper computes both and takes `where(condition, this, that)`, and
may leave out what no lane needs by `if any_of(condition)`.
"""

from collections.abc import Callable
from typing import Any, cast

from .jit import COMPILED, Function, Intrinsic


def _where_twin(condition: bool, this: Any, that: Any) -> Any:
    return this if condition else that


def _same(condition: bool) -> bool:
    return condition


where: Callable[[Any, Any, Any], Any] = cast(Any, Intrinsic(_where_twin, "where"))
"""(condition, this, that): `this` where the condition holds, else `that`. Both are computed."""
any_of: Callable[[bool], bool] = cast(Any, Intrinsic(_same, "any_of"))
"""True where a condition holds in any lane."""
all_of: Callable[[bool], bool] = cast(Any, Intrinsic(_same, "all_of"))
"""True where a condition holds in every lane."""


def one_or_several(one: Function, several: Function) -> Function:
    """A helper of two that do the same, the second better with lanes: which of them is called, the
    type of the first argument decides."""
    return cast(Any, Intrinsic(one, "one_or_several", one, several)) if COMPILED else one
