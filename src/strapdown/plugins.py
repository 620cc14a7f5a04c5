"""Plugins: sensors, filters, readers, figures and quantities of installed packages and of a user's
own files.

A plugin is a module. It provides the values of these types at its top level. Installed packages
name their modules under the entry points `strapdown.plugins`, a user names files or modules in the
environment variable STRAPDOWN_PLUGINS or hands values to `strapdown.register`. Plugins are imported
when a name is asked for that the library does not have, or when everything is listed. One that
cannot be imported, or provides unusable values, is reported in one line and left out.
"""

import importlib
import importlib.util
import inspect
import os
import re
import sys
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from threading import Lock, RLock
from typing import Any, Generic, TypeVar
from uuid import uuid4

from .checks import DataError, did_you_mean

ENTRY_POINTS = "strapdown.plugins"
"""Group under which installed packages name their modules."""
VARIABLE = "STRAPDOWN_PLUGINS"
"""Environment variable with files (.py) and modules, separated as folders in PATH."""
SESSION = "this session"
"""Name of what was registered where there is no file, such as in a notebook."""
PATIENCE = 60.0
"""s that a thread waits for another one that imports plugins."""

Kind = TypeVar("Kind")

TITLE = "Write plugins: custom sensors, filters, readers, figures"
"""That of the page of the documentation."""
PAGE = f'the page "{TITLE}" of the documentation'


class PluginWarning(UserWarning):
    """A plugin, or something that it brings, cannot be used; everything else goes on working."""


@dataclass
class Plugin:
    """A module that brings values."""

    name: str  # as shown
    # what another process finds it by: path of a file, or module; empty: there is nothing to find
    where: str
    # name of the imported module; of what has no file a name that nothing else had
    module: str = ""
    whole: bool = False  # whether all of that module counts, not only what is registered
    failed: str = ""  # why it could not be imported
    registered: list[Any] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    @property
    def values(self) -> list[Any]:
        """All values at the top level of its module now, of any type, and those registered."""
        module = sys.modules.get(self.module) if self.whole else None
        return [*(vars(module).values() if module else ()), *self.registered]

    def complain(self, text: str) -> None:
        """Tell once what is wrong with it."""
        if text not in self.complaints:
            self.complaints.append(text)
            # as from no line of code, which would be shown with it
            message = f"plugin {self.name}: {text}"
            warnings.warn_explicit(message, PluginWarning, "strapdown", 0)


_plugins: dict[str, Plugin] = {}  # by `where`, in the order of their coming
_writing = Lock()  # of that; never held while somebody else's code runs
_loading = RLock()


def plugins() -> list[Plugin]:
    """All plugins, each imported, in the order of their coming."""
    # a module that looks a name up while another thread waits for that module would wait forever
    if _loading.acquire(timeout=PATIENCE):
        try:
            for entry in _installed_plugins():
                _load(entry.name, entry.value, entry.load)
            for where in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
                load(where)
        finally:
            _loading.release()
    return known_plugins()


def known_plugins() -> list[Plugin]:
    """Those that have come so far; nothing is imported."""
    with _writing:
        return list(_plugins.values())


def name_plugins(places: Iterable[str]) -> None:
    """Import these files and modules, and name them in the environment for processes that follow.
    Raises DataError for one that cannot be imported."""
    for where in places:
        with warnings.catch_warnings():  # told of below
            warnings.simplefilter("ignore", PluginWarning)
            plugin = load(where)
        if plugin.failed:
            raise DataError(f"plugin {where}: {plugin.failed}")
        named = os.environ.get(VARIABLE, "")
        os.environ[VARIABLE] = os.pathsep.join(filter(None, [named, plugin.where]))


def require(needed: Iterable[tuple[str, str]]) -> None:
    """Import the plugins [(name, where)] of another process in this one. Raises DataError where one
    is missing here."""
    for name, where in needed:
        if failed := load(where).failed:
            raise DataError(
                f"plugin {name} on a worker: {failed}; copy {where} to the same place there, or "
                "install it as a package"
            )


@cache
def _installed_plugins() -> tuple[EntryPoint, ...]:
    return tuple(sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: entry.name))


def load(where: str) -> Plugin:
    """The plugin at the path of a file (.py), or of a module (and the value in it, behind a colon),
    imported."""
    if not where.endswith(".py"):
        return _load(where, where, EntryPoint(where, where, ENTRY_POINTS).load)
    path = _absolute(where)
    return _load(path.name, str(path), lambda: _imported_from(path))


@cache
def _absolute(where: str) -> Path:
    """The path as it was where it was first asked for, also after a change of the folder."""
    return Path(where).resolve()


def _load(name: str, where: str, imported: Callable[[], Any]) -> Plugin:
    with _writing:
        plugin = _plugins.get(where)
        is_new = plugin is None
        plugin = plugin or Plugin(name, where, _module_name(where))
        _plugins[where] = plugin
        # of an entry point that names a value, that value alone
        plugin.whole = where.endswith(".py") or ":" not in where
    if not is_new:
        return plugin
    try:
        found = imported()
    except KeyboardInterrupt:
        with _writing:
            del _plugins[where]
        raise
    except BaseException as error:  # whatever a stranger's code raises, also SystemExit
        plugin.module, plugin.failed = "", f"cannot be imported ({one_line(error)})"
        plugin.complain(plugin.failed)
    else:
        if not inspect.ismodule(found):
            plugin.registered.append(found)
        else:
            plugin.module = found.__name__
    return plugin


def _module_name(where: str) -> str:
    """The name under which a plugin's module is imported; that of a file is its own unless
    something else has it."""
    if not where.endswith(".py"):
        return where.partition(":")[0]
    stem = Path(where).stem
    taken = stem in sys.modules or stem in sys.stdlib_module_names
    return f"{stem}_{zlib.crc32(where.encode()):x}" if taken else stem


def _imported_from(path: Path) -> Any:
    """The module in a file, whose neighbours it can import as a script can; one that is imported
    already under whatever name is not imported again."""
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    for module in list(sys.modules.values()):
        if isinstance(file := getattr(module, "__file__", None), str):
            if Path(file).resolve() == path:
                return module
    name = _module_name(str(path))
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


class Registry(Generic[Kind]):
    """The values of one type by name: those of the library, then those of plugins in the order of
    their coming."""

    def __init__(
        self,
        kind: type[Kind],
        what: str,
        own: Callable[[str], Kind | None],
        own_names: Callable[[], Iterable[str]],
        check: Callable[[Kind], None],
    ) -> None:
        """what: as in "no filter is called"; own: finds what the library has of a name; own_names:
        all of these; check: refuses what cannot be used, by DataError."""
        self.kind, self.what, self.own, self.own_names = kind, what, own, own_names
        self.check = check

    def names(self) -> list[str]:
        """All names."""
        return [*self.own_names(), *self.plugin_values()]

    def find(self, name: str) -> Kind:
        """The value of that name; one of the library imports no plugin. Raises DataError with the
        nearest name."""
        if own := self.own(name):
            return own
        if name not in (others := self.plugin_values()):
            names = [*self.own_names(), *others]
            raise DataError(
                f"{self.what} {name!r}{did_you_mean(name, names)}; there are: {', '.join(names)}; "
                "if a plugin defines it, load that with --plugin FILE or sd.register"
            )
        return others[name][0]

    def brought_by(self, name: str) -> Plugin | None:
        """The plugin that brings the value of a name; None of the library's own."""
        return None if self.own(name) else self.plugin_values().get(name, (None, None))[1]

    def plugin_values(self, imports: bool = True) -> dict[str, tuple[Kind, Plugin]]:
        """{name: (value, plugin)} of what plugins bring. What has a name that is taken or cannot be
        used is left out and told of once."""
        found: dict[str, tuple[Kind, Plugin]] = {}
        for plugin in plugins() if imports else known_plugins():
            for value in plugin.values:
                if isinstance(value, self.kind):
                    try:
                        if not self._is_there(value, found):
                            self.check(value)
                            found[value.name] = value, plugin  # type: ignore[attr-defined]
                    except DataError as error:
                        plugin.complain(str(error))
                    except Exception as error:  # a field is of another type than it should be
                        plugin.complain(f"a {self.kind.__name__} is not valid ({one_line(error)})")
        return found

    def add(self, value: Kind, module: str) -> None:
        """Keep a value that a module registers. It takes the place of one of the same name that came
        from the same place before. Raises DataError where it cannot be used."""
        plugin = _place(value, module)
        others = {
            name: (other, its)
            for name, (other, its) in self.plugin_values(imports=False).items()
            if its.where != plugin.where or other is value
        }
        try:
            if self._is_there(value, others):
                return
            self.check(value)
        except DataError:
            raise
        except Exception as error:
            raise DataError(f"a {self.kind.__name__} is not valid ({one_line(error)})") from error
        with _writing:
            place, plugin = plugin, _plugins.setdefault(plugin.where, plugin)
            plugin.module = place.module  # without a file, another value is another module
            kept = plugin.registered
            same = [
                type(each) is type(value) and each.name == value.name  # type: ignore[attr-defined]
                for each in kept
            ]
            if any(same):
                kept[same.index(True)] = value
            elif not any(each is value for each in plugin.values):
                kept.append(value)

    def _is_there(self, value: Any, found: dict[str, tuple[Kind, Plugin]]) -> bool:
        """True where this very value is registered already. Raises DataError where its name is
        invalid, or another value has it."""
        name, kind = value.name, self.kind.__name__
        if not isinstance(name, str) or not name.strip() or "\n" in name:
            raise DataError(f"a {kind} has the name {name!r}; it must be text")
        own, other = self.own(name), found.get(name)
        if value is own or (other and value is other[0]):
            return True
        if own or other:
            owner = "the library" if own else f"plugin {other[1].name}" if other else ""
            raise DataError(
                f"{owner} already has a {kind} of the name {name!r}; choose another name"
            )
        return False


def _place(value: Any, registers: str) -> Plugin:
    """The plugin of a value: the module at whose top level it stands, else the one that registers
    it."""
    holders = [
        name
        for name, module in list(sys.modules.items())
        if not name.startswith(("strapdown.", "__main__", "__mp_main__"))
        and any(each is value for each in list(getattr(module, "__dict__", {}).values()))
    ]
    name = min(holders, key=len, default=registers)
    module = sys.modules.get(name)
    file = getattr(module, "__file__", None)
    if not file:  # there is no code to look at
        return Plugin(SESSION, "", uuid4().hex)
    if "." in name or hasattr(module, "__path__"):  # modules of a package need their package
        return Plugin(name, name, name)
    path = Path(file).resolve()
    return Plugin(path.name, str(path), name)


def check_word(value: Any) -> None:
    """Refuse a name that cannot stand in a label or a file. Raises DataError."""
    if set(value.name) & set(" :=,/\\"):
        raise DataError(
            f"a {type(value).__name__} has the name {value.name!r}; it must be text without spaces "
            f"and punctuation, such as 'sun-sensor'"
        )


def check_kernel(function: Any, signature: Any, arguments: int, what: str) -> None:
    """Refuse what was not declared as a kernel of this signature and number of arguments. Raises
    DataError that begins with `what`."""
    declared = getattr(function, "signature", None)
    if declared is None:
        raise DataError(f"{what} is not a kernel: write @kernel(SIGNATURE) above it")
    if declared != signature:
        raise DataError(f"{what} is a kernel with another signature; see {PAGE}")
    names = list(inspect.signature(getattr(function, "py_func", function)).parameters)
    if len(names) != arguments:
        raise DataError(
            f"{what} has the arguments {', '.join(names)}; it must have {arguments}; see {PAGE}"
        )


IN_WORDS = {
    "NRT required": "it allocates memory for an array or a list; write a loop over numbers",
    "No conversion from none": "it returns None; it must return a number",
}
"""Messages of numba for common mistakes, and what they mean."""


@contextmanager
def blame_plugin(value: Any, kernel: Any, plugin: Callable[[], Plugin | None]) -> Iterator[None]:
    """Where and why a kernel of `value` does not compile, as a DataError of one line in place of
    numba's many."""
    try:
        yield
    except DataError:  # it may not be compiled
        raise
    except Exception as error:  # numba's own, and what its passes let through
        whose = plugin()
        code = kernel.py_func.__code__
        text = re.sub(r"\x1b\[\d+m", "", str(error))  # numba shows colours where it can
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        said = (
            next((ours for theirs, ours in IN_WORDS.items() if theirs in line), line)
            for line in lines
            if not line.startswith(("Failed in", "- Resolution"))
        )
        place = next((f" ({line.rstrip(':')})" for line in lines if line.startswith("File ")), "")
        raise DataError(
            f"{f'plugin {whose.name}: ' if whose else ''}{type(value).__name__} {value.name!r}: the "
            f"kernel {code.co_name} ({code.co_filename}, line {code.co_firstlineno}) does not "
            f"compile: {next(said, one_line(error))}{place}"
        ) from error


def one_line(error: BaseException) -> str:
    """Kind and first line of an exception."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
