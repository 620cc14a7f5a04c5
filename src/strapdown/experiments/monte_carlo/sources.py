"""Sources of the results of a study, beside its manifest: the code of all modules that the chunk
function can reach, the data files beside them, and the versions of the packages that they use.

Imports in the files are followed, also those inside functions. All modules count of a package that
finds its modules itself (filters, kinds of measurement). Docstrings, comments and annotations do
not count, as in `core.compile.kernel_cache`.
"""

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ...core.compile.kernel_cache import Import, module_code

TOP = __name__.partition(".")[0]
ROOT = Path(__file__).parents[2]
CHUNKS = __name__.rpartition(".")[0] + ".chunks"
"""The module of the chunk function."""
NOT_ASKED = {f"{TOP}.diagnosis", f"{TOP}.notebook"}
"""Rooms that functions of the closure import but no chunk uses: verdicts and notebook output of a
Solution."""
NO_NUMBERS = {"h5netcdf", "h5py", "pandas", "pydantic", "pydantic_core", "fcntl"}
"""Packages that only read, write and lay out."""
NO_DATA = {".py", ".pyc", ".pyi", ".md", ".typed"}
"""Endings of files that no function opens."""
WITH_NUMBA = "llvmlite"
"""Package that generates numba's machine code and imports itself."""


def versions() -> dict[str, str]:
    """{package: version} of what computes, with a short digest of the library's own `sources`."""
    modules, packages = closure()
    digest = hashlib.sha256()
    for name, file in sorted(modules.items()):
        digest.update(name.encode() + b"\0" + module_code(file).digest)
    for file in sorted(_data({file.parent for file in modules.values()})):
        digest.update(str(file.relative_to(ROOT)).encode() + b"\0" + file.read_bytes())
    computing = sorted({*packages, WITH_NUMBA} - NO_NUMBERS)
    return {"sources": digest.hexdigest()[:12]} | {name: _version(name) for name in computing}


def closure(start: str = CHUNKS) -> tuple[dict[str, Path], set[str]]:
    """({module: file} of the library that `start` can reach, names of the other packages)."""
    found: dict[str, Path] = {}
    packages: set[str] = set()
    todo = {start}
    while todo:
        name = todo.pop()
        top, file = name.partition(".")[0], _file(name)
        if top != TOP:
            packages |= {top} - sys.stdlib_module_names
        if name in found or file is None or any(_below(name, room) for room in NOT_ASKED):
            continue
        found[name] = file
        todo |= {name.rpartition(".")[0]} - {""}  # a package is imported before its modules
        statements = module_code(file).imports
        for statement in statements:
            todo |= set(_imported_names(name, file, statement))
        if file.name == "__init__.py" and name != TOP and _looks_around(statements):
            todo |= {
                ".".join((TOP, *other.relative_to(ROOT).with_suffix("").parts)).removesuffix(
                    ".__init__"
                )
                for other in file.parent.rglob("*.py")
            }
    return found, packages


def _imported_names(name: str, file: Path, statement: Import) -> Iterator[str]:
    """Modules that a statement of a module imports."""
    if isinstance(statement, ast.Import):
        yield from (alias.name for alias in statement.names)
        return
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    dots = "." * statement.level
    base = importlib.util.resolve_name(dots + (statement.module or ""), package)
    yield base
    yield from (
        inside for alias in statement.names if _file(inside := f"{base}.{alias.name}") is not None
    )


def _file(name: str) -> Path | None:
    """The file of a module of the library."""
    top, *parts = name.split(".")
    places = ROOT.joinpath(*parts, "__init__.py"), ROOT.joinpath(*parts).with_suffix(".py")
    return next((place for place in places if top == TOP and place.is_file()), None)


def _below(name: str, room: str) -> bool:
    return f"{name}.".startswith(f"{room}.")


def _looks_around(statements: tuple[Import, ...]) -> bool:
    """True where a package imports modules by name at run time, with importlib."""
    return any(alias.name == "importlib" for each in statements for alias in each.names)


def _data(folders: set[Path]) -> Iterator[Path]:
    """Files that are no code, in these folders and those below that have no code."""
    for folder in folders - {ROOT}:
        below = [each for each in folder.iterdir() if each.is_dir() and not list(each.glob("*.py"))]
        for place in (folder, *below):
            yield from (
                each for each in place.iterdir() if each.is_file() and each.suffix not in NO_DATA
            )


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
