"""Filter architectures by family. A filter's name is its file's name with dashes, in whatever
folder; the file ends in one `Filter(...)` value."""

import copyreg
import importlib
from collections.abc import Callable
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from ..core.contract import Filter


@cache
def _modules() -> dict[str, str]:
    """{name: module} of every file below this folder; those that hold no filter are what a
    family shares."""
    files = sorted(
        file.relative_to(folder).with_suffix("")
        for folder in __path__
        for file in Path(folder).rglob("*.py")
        if file.stem != "__init__"
    )
    found = {
        file.stem.replace("_", "-"): ".".join((__name__, *file.parts))
        for file in sorted(files, key=lambda file: file.stem)
    }
    if len(found) < len(files):
        raise RuntimeError(f"two files below {__name__} have one name")
    return found


def _filter(name: str) -> Filter | None:
    """The Filter that the file of that name holds, or None."""
    module = _modules().get(name)
    if not module:
        return None
    held = vars(importlib.import_module(module)).values()
    return next((one for one in held if isinstance(one, Filter) and one.name == name), None)


@cache
def names() -> list[str]:
    """Names of all filters."""
    return [name for name in _modules() if _filter(name)]


def find(name: str | Filter) -> Filter:
    """The Filter of that name; only its own file is imported. Raises ValueError with the nearest
    name."""
    if isinstance(name, Filter):
        return name
    if not (found := _filter(name)):
        near = get_close_matches(str(name), names(), 1)
        raise ValueError(
            f"no filter is called {name!r}; {f'did you mean {near[0]!r}? ' if near else ''}there "
            f"are: {', '.join(names())}"
        )
    return found


def _by_name(filter: Filter) -> tuple[Callable[[str], Filter], tuple[str]]:
    """Kernels are no data: another process finds the filter by its name."""
    return find, (filter.name,)


copyreg.pickle(Filter, _by_name)
