"""Filters by label: a name, or a name with options, as studies, comparisons and their tables
have them."""

from collections.abc import Mapping
from typing import Any

from .. import filters
from ..checks import DataError
from ..core.contract import STATES, Filter, Noise, Start
from ..engine.prepare import check_options, new_belief

ANYWHERE, NOISELESS = (
    Start(0.0, (0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0,) * STATES),
    Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
"""A start and a noise that any filter takes, to try its options with."""


def parsed(label: str) -> tuple[Filter, dict[str, Any]]:
    """(Filter, options) of "name" or "name:option=value,option=value". Raises DataError."""
    name, _, rest = label.partition(":")
    pairs = [item.partition("=") for item in rest.split(",") if item.strip()]
    if wrong := [key for key, equals, _ in pairs if not equals]:
        raise DataError(
            f"filter {label!r}: {wrong[0]!r} is no option with a value; write "
            f"{name}:option=value,option=value"
        )
    return tried(name, {key.strip(): _value(value) for key, _, value in pairs})


def tried(name: str, options: dict[str, Any]) -> tuple[Filter, dict[str, Any]]:
    """(Filter, options) where there is a filter of that name and it takes these options. Raises
    DataError."""
    filter = filters.find(name)
    check_options(filter, options)
    new_belief(filter, ANYWHERE, NOISELESS, options, ())  # refuses values
    return filter, options


def labelled(name: str, options: Mapping[str, Any]) -> str:
    """The label of a filter with options, as `parsed` reads it; the same options always have the
    same label."""
    texts = {
        key: value if isinstance(value, str) else format(value, ".12g")
        for key, value in sorted(options.items())
    }
    return name + ":" * bool(texts) + ",".join(f"{key}={text}" for key, text in texts.items())


def _value(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text.strip()
