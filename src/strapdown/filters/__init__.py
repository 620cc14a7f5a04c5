"""Filter architectures, one file each. A filter's name is its file's name with dashes; the file ends in one `Filter(...)` value."""
import importlib
import pkgutil
from difflib import get_close_matches

from ..core.contract import Filter


def names():
    """Names of all filters."""
    return [module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__)]


def find(name):
    """The Filter of that name; only its own file is imported. Raises ValueError with the nearest name."""
    if isinstance(name, Filter):
        return name
    if name not in names():
        near = get_close_matches(str(name), names(), 1)
        raise ValueError(f"no filter is called {name!r}; {f'did you mean {near[0]!r}? ' if near else ''}there are: {', '.join(names())}")
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    return next(value for value in vars(module).values() if isinstance(value, Filter) and value.name == name)
