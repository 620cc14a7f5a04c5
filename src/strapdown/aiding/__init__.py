"""Kinds of aiding, one file per measurement. A file holds `observe` kernels and, for each, one
`Measurement(...)` value; nothing else lists them."""

import importlib
import pkgutil
from difflib import get_close_matches
from functools import cache

from ..core.contract import Measurement


@cache
def measurements() -> dict[str, Measurement]:
    """{name: Measurement} of all kinds, in the order of their `kind` numbers, which must be 0,
    1, 2, ..."""
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(__path__, __name__ + ".")
    ]
    found = {
        id(value): value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, Measurement)
    }.values()
    ordered = sorted(found, key=lambda sensor: sensor.kind)
    if [sensor.kind for sensor in ordered] != list(range(len(ordered))):
        raise RuntimeError(
            f"kind numbers of aiding must be 0, 1, 2, ...: {[(s.name, s.kind) for s in ordered]}"
        )
    return {sensor.name: sensor for sensor in ordered}


def names() -> list[str]:
    """Names of all kinds of aiding."""
    return list(measurements())


def find(name: str) -> Measurement:
    """The Measurement of that kind. Raises ValueError with the nearest name."""
    if name not in measurements():
        near = get_close_matches(str(name), names(), 1)
        raise ValueError(
            f"no aiding is of kind {name!r}; {f'did you mean {near[0]!r}? ' if near else ''}there "
            f"are: {', '.join(names())}"
        )
    return measurements()[name]
