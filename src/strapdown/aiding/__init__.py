"""Kinds of measurement, one file per measurement. A file holds `observe` kernels and, for each, one
`MeasurementModel(...)` value; nothing else lists them. Plugins bring more."""

import importlib
import pkgutil
from functools import cache
from threading import Lock

from .. import plugins
from ..checks import DataError, check_choice, check_number, check_type, locate_errors
from ..core.loop.contract import OBSERVE, Kind, MeasurementModel, Observe, compile_kernel
from ..core.mathematics.source import POSE_AXES
from ..units import quantities
from .more_parameters import MEANINGS
from .trial import derivative_complaints

PARAMETER_MEANINGS = ("", "antenna", "reference", "field", "baseline", "drag")
"""Meanings that source.parameters[0:3] of a source can have."""


def name_of(kind: Kind) -> str:
    """Return the name of a kind that kernels know by its number."""
    return kind.name.lower().replace("_", "-")


@cache
def _own_models() -> dict[str, MeasurementModel]:
    """{name: MeasurementModel} of the files here, those that kernels know by their number first."""
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(__path__, __name__ + ".")
    ]
    found = {
        value.name: value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, MeasurementModel)
    }
    return {name: found.pop(name) for name in map(name_of, Kind)} | found


def own_names() -> list[str]:
    """Names of the library's own kinds; no plugin is imported."""
    return list(_own_models())


def measurements() -> dict[str, MeasurementModel]:
    """{name: MeasurementModel} of all kinds: the library's, then those of plugins in the order of
    their coming."""
    return _own_models() | {name: value for name, (value, _) in REGISTRY.plugin_values().items()}


def names() -> list[str]:
    """Names of all kinds of measurement."""
    return REGISTRY.names()


def find(name: str) -> MeasurementModel:
    """The MeasurementModel of that kind. Raises DataError with the nearest name."""
    return REGISTRY.find(name)


def number(name: str) -> int:
    """The number by which kernels of this process know a kind, from the first time it is asked for."""
    own = list(_own_models())
    with _one_at_a_time:
        return own.index(name) if name in own else _given.setdefault(name, len(own) + len(_given))


_given: dict[str, int] = {}
_one_at_a_time = Lock()


def compile_observation(name: str) -> Observe:
    """The observation of a kind, compiled. Raises DataError of one line, which names the plugin,
    where somebody else's code does not compile or does not pass its trial."""
    sensor = find(name)
    with plugins.blame_plugin(sensor, sensor.observe, lambda: REGISTRY.brought_by(name)):
        compile_kernel(sensor.observe)
    plugin = REGISTRY.brought_by(name)
    if plugin and _tried.get(name) is not sensor.observe:
        with locate_errors(f"plugin {plugin.name}: MeasurementModel {name!r}"):
            for text in derivative_complaints(sensor, sensor.observe):
                plugin.complain(f"MeasurementModel {name!r}: {text}")
        _tried[name] = sensor.observe
    return sensor.observe


_tried: dict[str, Observe] = {}


def check(sensor: MeasurementModel) -> None:
    """Refuse a MeasurementModel that cannot be used. Raises DataError."""
    what = f"MeasurementModel {sensor.name!r}: "
    plugins.check_word(sensor)
    plugins.check_kernel(sensor.observe, OBSERVE, 5, what + "observe")
    for field in ("quantities", "states", "more_states"):
        texts = getattr(sensor, field)
        if not isinstance(texts, tuple) or not all(isinstance(text, str) for text in texts):
            raise DataError(
                f'{what}{field} is {texts!r}; it must be a tuple of texts, as ("speed",)'
            )
    if not 1 <= len(sensor.quantities) <= 3:
        raise DataError(f"{what}it has {len(sensor.quantities)} quantities; it must have 1 to 3")
    with locate_errors(what[:-2]):
        for quantity in sensor.quantities:
            quantities.REGISTRY.find(quantity)
    check_choice(sensor.parameters, what + "parameters", PARAMETER_MEANINGS)
    check_choice(sensor.more_parameters, what + "more_parameters", MEANINGS)
    check_choice(sensor.vector, what + "vector", ("", "n", "b"))
    check_choice(sensor.pose_axes, what + "pose_axes", POSE_AXES)
    check_choice(sensor.when, what + "when", ("", "at rest", "moving"))
    check_choice(sensor.mean_of, what + "mean_of", ("", "gyro", "accel"))
    if len(set(sensor.states)) < len(sensor.states):
        raise DataError(f"{what}two of its states have one name: {', '.join(sensor.states)}")
    check_type(sensor.shared, what + "shared", str, 'a text, as "wind"')
    if sensor.shared and not sensor.states:
        raise DataError(f"{what}shared is {sensor.shared!r}, and it has no states to share")
    if sensor.states:
        check_number(sensor.state_std, what + "state_std", above=0)
    check_number(sensor.state_walk, what + "state_walk", least=0)


REGISTRY = plugins.Registry(
    MeasurementModel, "no aiding is of kind", lambda name: _own_models().get(name), own_names, check
)
