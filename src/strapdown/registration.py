"""One call that adds sensors, filters, readers and figures from a user's own file."""

import inspect
from typing import Any

from .checks import DataError
from .plugins import Registry, plugins


def register(*values: Any) -> None:
    """Add a sensor, filter, file format, figure or quantity of your own to the library, for this process
    and for worker processes that a study starts from it.

    It then works wherever one of the library's does. A value of the same name that came from the same
    file before is replaced.

    Parameters
    ----------
    *values : MeasurementModel, Filter, Reader, Figure or Quantity
        docs/how-to/plugins.md has an example of each.

    Raises
    ------
    DataError
        Where something else has the name, or the value cannot be used.
    """
    homes = _homes()
    caller = inspect.currentframe()
    assert caller and caller.f_back  # there is somebody who calls
    module = caller.f_back.f_globals["__name__"]
    for value in values:
        if type(value) not in homes:
            if inspect.ismodule(value):
                raise DataError(f"register: {value.__name__} is a module; give the values in it")
            raise DataError(
                f"register: {value!r} is a {type(value).__name__}; it must be one of "
                f"{', '.join(kind.__name__ for kind in homes)}"
            )
        homes[type(value)].add(value, module)


def registration_rows() -> list[tuple[str, str, str, str]]:
    """[(plugin, where it is from, what it brings, what cannot be used)], a row per plugin."""
    found = [
        (plugin, f"{kind.__name__} {name}")
        for kind, home in _homes().items()
        for name, (_, plugin) in home.plugin_values().items()
    ]
    return [
        (
            plugin.name,
            plugin.where,
            ", ".join(text for its, text in found if its is plugin),
            "; ".join(plugin.complaints),
        )
        for plugin in plugins()
    ]


def _homes() -> dict[type, Registry[Any]]:
    """{type: registry of its values}."""
    from . import aiding, filters
    from .io import registry
    from .pages import figure_list
    from .units import quantities

    homes = (quantities, aiding, filters, registry, figure_list)
    return {home.REGISTRY.kind: home.REGISTRY for home in homes}
