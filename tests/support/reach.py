"""Which tests a change can reach: those whose modules import, at any remove, what changed.

Imports are read, not run. What a test takes from `strapdown` itself counts as the module that the name
comes from; folders whose modules are found by listing them count as importing each; a fixture of a
conftest counts only for files that ask for one of its fixtures.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[2]
TESTS, SOURCES = (
    ROOT / "tests",
    {"strapdown": ROOT / "src", "strapdown_reproductions": ROOT / "reproductions" / "src"},
)
LISTED = {
    "strapdown.filters": "strapdown.filters",
    "strapdown.aiding": "strapdown.aiding",
    "strapdown.io.registry": "strapdown.io.readers",
}
"""{module that imports all modules below a package by listing them: that package}."""
ALL = re.compile(r"pyproject\.toml|Makefile|tests/support/reach\.py|tests/deep\.py")
"""Files whose change reaches every test."""


@cache
def graph() -> grimp.ImportGraph:
    """The imports of library and reproductions, those by listing among them."""
    found = grimp.build_graph(*SOURCES, cache_dir=None)
    for importer, package in LISTED.items():
        for module in found.find_descendants(package):
            found.add_import(importer=importer, imported=module)
    for importer in list(found.find_modules_that_directly_import("strapdown")):
        for name in _named(ast.parse(_file(importer).read_text(encoding="utf-8"))):
            taken = _facade().get(name.removeprefix("strapdown."))
            if taken and name.startswith("strapdown."):
                found.add_import(importer=importer, imported=taken)
    return found


def _file(module: str) -> Path:
    """Where a module of the packages stands."""
    parts = module.split(".")
    folder = SOURCES[parts[0]].joinpath(*parts)
    return folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")


@cache
def _facade() -> dict[str, str]:
    """{name in `strapdown`: its module}."""
    stub = ast.parse((SOURCES["strapdown"] / "strapdown" / "__init__.pyi").read_text())
    return {
        each.asname or each.name: f"strapdown.{node.module or each.name}"
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for each in node.names
    }


def _named(tree: ast.AST) -> Iterator[str]:
    """Dotted names that a file of tests imports, takes from `sd`, or has as words in a string."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id in ("sd", "strapdown"):
                yield f"strapdown.{node.attr}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            # modules that a test runs as a program, or exchanges a name of
            yield from re.findall(r"\bstrapdown(?:_reproductions)?(?:\.\w+)+", node.value)


def _module(name: str) -> str:
    """The module of the packages that a dotted name means; empty where there is none."""
    parts = name.split(".")
    if parts[0] == "strapdown" and len(parts) > 1 and parts[1] in _facade():
        return _facade()[parts[1]]
    while parts and ".".join(parts) not in graph().modules:
        parts.pop()
    return ".".join(parts)


def _beside(path: Path, name: str) -> Path | None:
    """The file of helpers below tests that a name of another module means."""
    first = name.split(".")[0]
    file = first + ".py"
    folders = (path.parent, *path.parents, TESTS / "support", TESTS / "filters")
    places = [folder / file for folder in folders if TESTS in (folder, *folder.parents)]
    places += [TESTS.joinpath(*name.split(".")[:2]).with_suffix(".py")]
    return next((place for place in places if place.is_file() and place != path), None)


def _fixtures(tree: ast.AST) -> set[str]:
    """Names of fixtures of a conftest that a test has to ask for."""
    return {
        node.name
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and any("fixture" in ast.unparse(each) for each in node.decorator_list)
    }


@cache
def _of(path: Path) -> tuple[frozenset[str], frozenset[Path]]:
    """(modules of the packages, files of tests) that a file of tests names by itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = set(_named(tree))
    modules = {_module(name) for name in names if name.split(".")[0] in SOURCES}
    files = {_beside(path, name) for name in names if name.split(".")[0] not in SOURCES}
    asked = {
        each.arg
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for each in node.args.args
    }
    for folder in path.parents:
        conftest = folder / "conftest.py"
        if TESTS in (folder, *folder.parents) and conftest.is_file() and conftest != path:
            if asked & _fixtures(ast.parse(conftest.read_text(encoding="utf-8"))):
                files.add(conftest)
    return frozenset(modules - {""}), frozenset(files - {None})  # type: ignore[arg-type]


def needs(path: Path) -> tuple[set[str], set[Path]]:
    """(modules, files of tests) that a file of tests names at any remove among files of tests."""
    modules: set[str] = set()
    files: set[Path] = set()
    new = {path}
    while new:
        files |= new
        for each in list(new):
            modules |= _of(each)[0]
        new = {file for each in new for file in _of(each)[1]} - files
    return modules, files


def _changed_modules(changed: Iterable[Path]) -> set[str]:
    """Modules of the packages that changed files are, or beside which they lie as data."""
    found: set[str] = set()
    for path in changed:
        root = next((root for root in SOURCES.values() if root in path.parents), None)
        if root is None:
            continue
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        if path.suffix == ".py":
            found.add(name.removesuffix(".__init__"))
        elif package := _module(name.rpartition(".")[0]):
            found |= {package, *graph().find_children(package)}
    return found


def reached(changed: Iterable[str], tests: Iterable[Path]) -> list[Path]:
    """Those of the files of tests that changes of files, named from the root, can reach."""
    names, tests = list(changed), list(tests)
    if any(ALL.fullmatch(name) for name in names):
        return tests
    paths = {ROOT / name for name in names}
    modules = _changed_modules(paths)
    for module in list(modules & graph().modules):
        modules |= graph().find_downstream_modules(module)
    text = any(name.startswith(("docs/", "README")) for name in names)
    found = []
    for test in tests:
        mine, files = needs(test)
        if mine & modules or files & paths or (text and test.parent == TESTS):
            found.append(test)
    return found
