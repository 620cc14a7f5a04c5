"""Signatures of functions that take their keywords as a record."""

from collections.abc import Mapping
from inspect import Parameter
from typing import Any


def keywords(defaults: Mapping[str, Any]) -> list[Parameter]:
    """Parameters of these names and defaults."""
    return [
        Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default)
        for name, default in defaults.items()
    ]
