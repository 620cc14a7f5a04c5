"""Choices by value in helpers that run for one run or for eight at once.

For one run they are plain Python: `where` picks one of two numbers, `any_of` and `all_of` give
back the truth value. For eight, numbers are lanes, a comparison is a truth value per lane, and `if`
would have to go both ways: so a helper computes both and takes `where(condition, this, that)`, and
may leave out what no lane needs by `if any_of(condition)`.
"""

from .jit import helper


@helper
def where(condition: bool, this: float, that: float) -> float:
    """`this` where the condition holds, else `that`. Both have been computed by then."""
    return this if condition else that


@helper
def any_of(condition: bool) -> bool:
    """Whether it holds in any lane."""
    return condition


@helper
def all_of(condition: bool) -> bool:
    """Whether it holds in every lane."""
    return condition
