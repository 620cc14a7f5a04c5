"""Kinds of aiding, one file per measurement. A file holds `observe` kernels and, for each, one
`Measurement(...)` value; nothing else lists them. Plugins bring more."""

import importlib
import pkgutil
from functools import cache

from .. import plugins, quantities
from ..checks import DataError, check_choice, check_number, did_you_mean
from ..core.contract import NUMBERED, OBSERVE, Measurement, Observe, compile_kernel

PARAMETER_MEANINGS = ("", "antenna", "reference", "field")
"""What parameters[0:3] of a source can be."""


@cache
def _own() -> dict[str, Measurement]:
    """{name: Measurement} of the files here, those that kernels know by their number first."""
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(__path__, __name__ + ".")
    ]
    found = {
        value.name: value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, Measurement)
    }
    return {name: found.pop(name) for name in NUMBERED} | found


def brought() -> dict[str, tuple[Measurement, plugins.Plugin]]:
    """{name: (value, plugin)} of what plugins bring."""
    return plugins.collect(Measurement, _own().get, check)


def measurements() -> dict[str, Measurement]:
    """{name: Measurement} of all kinds: the library's, then those of plugins in the order of
    their coming."""
    return _own() | {name: value for name, (value, _) in brought().items()}


def names() -> list[str]:
    """Names of all kinds of aiding."""
    return list(measurements())


def own_names() -> list[str]:
    """Names of the library's own kinds; no plugin is imported."""
    return list(_own())


def find(name: str) -> Measurement:
    """The Measurement of that kind. Raises DataError with the nearest name."""
    if name in _own():
        return _own()[name]
    if name not in measurements():
        raise DataError(
            f"no aiding is of kind {name!r}{did_you_mean(name, names())}; there are: "
            f"{', '.join(names())}"
        )
    return measurements()[name]


def number(name: str) -> int:
    """The number by which kernels of this process know a kind: its place among all."""
    own = list(_own())
    return own.index(name) if name in own else len(own) + list(brought()).index(name)


def brought_by(name: str) -> plugins.Plugin | None:
    """The plugin that brings a kind; None for the library's own."""
    return None if name in _own() or name not in (others := brought()) else others[name][1]


def compiled(name: str) -> Observe:
    """The observation of a kind, compiled. Raises DataError of one line, which names the plugin,
    where somebody else's code does not compile."""
    sensor = find(name)
    with plugins.blamed(sensor, sensor.observe, lambda: brought_by(name)):
        compile_kernel(sensor.observe)
    return sensor.observe


def check(sensor: Measurement) -> None:
    """Refuse a Measurement that cannot be used. Raises DataError."""
    what = f"Measurement {sensor.name!r}: "
    plugins.check_word(sensor)
    plugins.check_kernel(sensor.observe, OBSERVE, 5, what + "observe")
    if not 1 <= len(sensor.quantities) <= 3:
        raise DataError(f"{what}it has {len(sensor.quantities)} quantities; it must have 1 to 3")
    for quantity in sensor.quantities:
        quantities.find(quantity)
    check_choice(sensor.parameters, what + "parameters", PARAMETER_MEANINGS)
    check_choice(sensor.vector, what + "vector", ("", "n", "b"))
    check_choice(sensor.when, what + "when", ("", "at rest"))
    check_number(sensor.state_sd, what + "state_sd", least=0, above=0 if sensor.states else -1)
    check_number(sensor.state_walk, what + "state_walk", least=0)


def add(sensor: Measurement, module: str) -> None:
    """Add a kind that a module registers. Raises DataError."""
    plugins.admit(sensor, _own().get, brought(), check, module)
