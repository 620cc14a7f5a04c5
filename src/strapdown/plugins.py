"""What comes from outside the library: sensors, filters, readers and figures of installed packages
and of a user's own files.

A plugin is a module. What it brings are the values of these types at its top level. Installed
packages name their modules under the entry points `strapdown.plugins`, a user names files or modules
in the environment variable STRAPDOWN_PLUGINS or hands values to `strapdown.register`. Plugins are
imported when a name is asked for that the library does not have, or when everything is listed. One
that cannot be imported, or brings what cannot be used, is told of in one line and left out.
"""

import importlib
import importlib.util
import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any, NamedTuple, TypeVar
from uuid import uuid4

from .checks import DataError

ENTRY_POINTS = "strapdown.plugins"
"""Group under which installed packages name their modules."""
VARIABLE = "STRAPDOWN_PLUGINS"
"""Environment variable with files (.py) and modules, separated as folders in PATH."""
SESSION = "this session"
"""Name of what was registered where there is no file, such as in a notebook."""

Kind = TypeVar("Kind")


class PluginWarning(UserWarning):
    """A plugin, or something that it brings, cannot be used; everything else goes on working."""


class Plugin(NamedTuple):
    """A module that brings values."""

    name: str  # as shown
    # what another process finds it by: path of a file, name of a module or of an entry point;
    # empty where there is nothing to find
    where: str
    # its name while it is imported here; of what has no file a name that nothing else had
    module: str
    values: list[Any]
    complaints: list[str]


_plugins: dict[str, Plugin] = {}  # by `where`, in the order of their coming
_one_at_a_time = RLock()


def plugins() -> list[Plugin]:
    """All plugins, each imported, in the order of their coming."""
    with _one_at_a_time:
        for entry in _installed():
            _load(entry.name, entry.name, entry.load)
        for where in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
            load(where)
        return list(_plugins.values())


def name_plugins(places: Iterable[str]) -> None:
    """Import these files and modules, and name them in the environment for processes that follow.
    Raises DataError for one that cannot be imported."""
    for where in places:
        with warnings.catch_warnings():  # told of below
            warnings.simplefilter("ignore", PluginWarning)
            plugin = load(where)
        if problem := plugin.complaints:
            raise DataError(f"plugin {where}: {problem[0]}")
        known = os.environ.get(VARIABLE, "")
        where = str(Path(where).resolve()) if where.endswith(".py") else where
        os.environ[VARIABLE] = os.pathsep.join(filter(None, [known, where]))


@cache
def _installed() -> tuple[EntryPoint, ...]:
    return tuple(sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: entry.name))


def load(where: str) -> Plugin:
    """The plugin at the path of a file (.py) or of that module name, imported."""
    with _one_at_a_time:
        if not where.endswith(".py"):
            return _load(where, where, lambda: importlib.import_module(where))
        path = Path(where).resolve()
        return _load(path.name, str(path), lambda: _imported_from(path))


def _load(name: str, where: str, imported: Callable[[], Any]) -> Plugin:
    if where in _plugins:
        return _plugins[where]
    plugin = _plugins[where] = Plugin(name, where, "", [], [])
    try:
        found = imported()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a stranger's code raises, also SystemExit
        complain(plugin, f"cannot be imported ({one_line(error)})")
    else:
        is_module = isinstance(found, ModuleType)
        # it may have registered values while it was imported
        values = [*(vars(found).values() if is_module else [found]), *_plugins[where].values]
        module = found.__name__ if is_module else type(found).__module__
        _plugins[where] = plugin._replace(module=module, values=values)
    return _plugins[where]


def _imported_from(path: Path) -> ModuleType:
    """The module in a file, whose neighbours it can import as a script can."""
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    for module in list(sys.modules.values()):
        if getattr(module, "__file__", None) and Path(str(module.__file__)).resolve() == path:
            return module
    name = path.stem if path.stem not in sys.modules else f"{path.stem}_{abs(hash(path)):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader  # as of every file that ends in .py
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def keep(value: Any, module: str) -> None:
    """Keep a value that a module registers. It takes the place of one of the same type and name
    that came from the same place before."""
    with _one_at_a_time:
        name, where, module = _place(value, module)
        known = _plugins.get(where) or Plugin(name, where, "", [], [])
        before = [type(other) is type(value) and other.name == value.name for other in known.values]
        if any(before):
            known.values[before.index(True)] = value
        else:
            known.values.append(value)
        _plugins[where] = known._replace(module=module)


def _place(value: Any, registers: str) -> tuple[str, str, str]:
    """Name, `where` and module of the plugin of a value: the module at whose top level it stands,
    else the one that registers it."""
    holders = [
        name
        for name, module in list(sys.modules.items())
        if not name.startswith(("strapdown.", "__main__", "__mp_main__"))
        and any(each is value for each in list(getattr(module, "__dict__", {}).values()))
    ]
    name = min(holders, key=len, default=registers)
    file = getattr(sys.modules.get(name), "__file__", None)
    if not file:  # there is no code to look at: another value is another module
        return SESSION, "", uuid4().hex
    if "." in name:  # of a package, whose modules need their package
        return name, name, name
    path = Path(file).resolve()
    return path.name, str(path), name


def collect(
    kind: type[Kind], own: Callable[[str], Kind | None], check: Callable[[Kind], None]
) -> dict[str, tuple[Kind, Plugin]]:
    """{name: (value, plugin)} of this type that plugins bring, in the order of their coming.

    own: finds what the library has of a name; check: raises DataError for what cannot be used.
    What has a name that is taken or is refused by `check` is left out and told of once.
    """
    found: dict[str, tuple[Kind, Plugin]] = {}
    for plugin in plugins():
        for value in plugin.values:
            if not isinstance(value, kind):
                continue
            try:
                name = _name(value)
                if value is own(name) or (name in found and value is found[name][0]):
                    continue  # it only imports it
                refuse_taken(value, own, found)
                check(value)
                found[name] = value, plugin
            except DataError as error:
                complain(plugin, str(error))
    return found


def refuse_taken(
    value: Any, own: Callable[[str], Any], found: dict[str, tuple[Any, Plugin]]
) -> None:
    """Raise DataError where something else has the name of this value."""
    name = _name(value)
    owner = "the library" if own(name) else name in found and f"plugin {found[name][1].name}"
    if owner:
        raise DataError(
            f"{owner} has a {type(value).__name__} of the name {name!r} already; choose another name"
        )


def admit(
    value: Kind,
    own: Callable[[str], Kind | None],
    found: dict[str, tuple[Kind, Plugin]],
    check: Callable[[Kind], None],
    module: str,
) -> None:
    """Keep a value that a module registers, unless its name is taken or `check` refuses it; arguments
    as of `collect`, of which `found` is the result. Raises DataError."""
    where = _place(value, module)[1]
    others = {name: (it, plugin) for name, (it, plugin) in found.items() if plugin.where != where}
    refuse_taken(value, own, others)
    check(value)
    keep(value, module)


def _name(value: Any) -> str:
    name = value.name
    if not isinstance(name, str) or not name.strip() or "\n" in name:
        raise DataError(f"a {type(value).__name__} has the name {name!r}; it must be text")
    return name


def check_word(value: Any) -> None:
    """Refuse a name that cannot stand in a label or a file. Raises DataError."""
    if set(value.name) & set(" :=,/\\"):
        raise DataError(
            f"a {type(value).__name__} has the name {value.name!r}; it must be text without spaces "
            f"and punctuation, such as 'sun-sensor'"
        )


def complain(plugin: Plugin, text: str) -> None:
    """Tell once what is wrong with a plugin."""
    if text not in plugin.complaints:
        plugin.complaints.append(text)
        warnings.warn(f"plugin {plugin.name}: {text}", PluginWarning, stacklevel=2)


def one_line(error: BaseException) -> str:
    """Kind and first line of an exception."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


def check_kernel(function: Any, signature: Any, arguments: int, what: str) -> None:
    """Refuse what was not declared as a kernel of this signature and number of arguments. Raises
    DataError that begins with `what`."""
    declared = getattr(function, "signature", None)
    if declared is None:
        raise DataError(f"{what} is no kernel: write @kernel(SIGNATURE) above it")
    if declared != signature:
        raise DataError(f"{what} is a kernel of another signature; it must be {signature}")
    names = list(inspect.signature(getattr(function, "py_func", function)).parameters)
    if len(names) != arguments:
        raise DataError(
            f"{what} has the arguments {', '.join(names)}; it must have {arguments}, see "
            f"docs/plugins.md"
        )


@contextmanager
def blamed(value: Any, kernel: Any, plugin: Callable[[], Plugin | None]) -> Iterator[None]:
    """Where and why a kernel of `value` does not compile, as a DataError of one line in place of
    numba's many."""
    try:
        yield
    except Exception as error:  # numba's own, and what its passes let through
        whose = plugin()
        code = kernel.py_func.__code__
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        said = (line for line in lines if not line.startswith(("Failed in", "- Resolution")))
        place = next((f" ({line.rstrip(':')})" for line in lines if line.startswith("File ")), "")
        raise DataError(
            f"{f'plugin {whose.name}: ' if whose else ''}{type(value).__name__} {value.name!r}: the "
            f"kernel {code.co_name} ({code.co_filename}, line {code.co_firstlineno}) does not "
            f"compile: {next(said, one_line(error))}{place}"
        ) from error


def require(needed: Iterable[tuple[str, str]]) -> None:
    """Import the plugins [(name, where)] of another process in this one. Raises DataError where one
    is missing here."""
    known = {plugin.where: plugin for plugin in plugins()}
    for name, where in needed:
        plugin = known.get(where) or load(where)
        if plugin.complaints:
            raise DataError(
                f"plugin {name} on a worker: {plugin.complaints[0]}; put {where} there as it is "
                f"here, or install it as a package"
            )
