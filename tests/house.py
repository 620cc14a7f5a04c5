"""Measure the house: `python tests/house.py` prints statements of each room, circles of modules, arrows
up, functions that are too long or take too much, and places in arrays that modules
import as integers.

`--list` also names what was found. The rules that hold already are tests: `test_house.py`,
`core/test_size.py`, `.importlinter`.
"""

import argparse
import ast
import configparser
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import grimp
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "strapdown"
REPRODUCTIONS = ROOT / "reproductions" / "src" / "strapdown_reproductions"
MAX_STATEMENTS, MAX_PARAMETERS = 30, 7
"""A function does one thing, and what it needs has names."""


class Module(NamedTuple):
    """A file of a package, parsed."""

    name: str
    file: Path
    tree: ast.Module

    @property
    def room(self) -> str:
        """Package and first folder."""
        return ".".join(self.name.split(".")[:2]) if self.is_in_a_room else self.package

    @property
    def package(self) -> str:
        """Outermost package."""
        return self.name.split(".")[0]

    @property
    def is_in_a_room(self) -> bool:
        """Whether the file stands in a folder of its package."""
        return self.file.parent.name != self.package


def modules(*packages: Path) -> dict[str, Module]:
    """{dotted name: module} of packages."""
    found = {}
    for package in packages:
        for file in sorted(package.rglob("*.py")):
            parts = file.relative_to(package.parent).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            tree = ast.parse(file.read_text(encoding="utf-8"))
            found[name] = Module(name, file, tree)
    return found


# ---- size


def statements(node: ast.AST) -> int:
    """Statements in a function or module, nested ones too, without docstrings."""
    inside = [each for each in ast.walk(node) if isinstance(each, ast.stmt) and each is not node]
    return sum(not _is_text(each) for each in inside)


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(
        getattr(statement.value, "value", None), str
    )


def functions(tree: ast.AST) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Functions of a module, nested ones too."""
    return [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Arguments of a function without `self`, `cls`, `*` and `**`."""
    a = function.args
    names = [each.arg for each in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def longest(found: dict[str, Module], room: str) -> tuple[int, str]:
    """(statements, name) of the longest function of a room."""
    return max(
        (statements(function), f"{name}.{function.name}")
        for name, module in found.items()
        if f"{name}.".startswith(f"{room}.")
        for function in functions(module.tree)
    )


# ---- arrows


def arrows() -> list[tuple[str, str]]:
    """Imports between modules, those inside functions too, those for type checkers not."""
    graph = grimp.build_graph(
        PACKAGE.name, REPRODUCTIONS.name, exclude_type_checking_imports=True, cache_dir=None
    )
    return [(a, b) for a in graph.modules for b in graph.find_modules_directly_imported_by(a)]


def circles(graph: list[tuple[str, str]]) -> list[list[str]]:
    """Groups of modules of which each reaches each other, the largest first."""
    names = sorted({name for arrow in graph for name in arrow})
    place = {name: row for row, name in enumerate(names)}
    rows, columns = zip(*((place[a], place[b]) for a, b in graph))
    matrix = coo_array((np.ones(len(graph)), (rows, columns)), shape=(len(names),) * 2)
    _, group = connected_components(matrix, connection="strong")
    members = [[name for name, of in zip(names, group) if of == each] for each in set(group)]
    return sorted((each for each in members if len(each) > 1), key=len, reverse=True)


def arrows_up(graph: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Imports against the floors of `.importlinter`."""
    settings = configparser.ConfigParser()
    settings.read(ROOT / ".importlinter", encoding="utf-8")
    floors = settings["importlinter:contract:rooms"]["layers"].split("\n")
    height = {
        room.strip(): -level
        for level, line in enumerate(floors)
        for room in line.split("|")
        if room.strip()
    }
    return [
        (a, b)
        for a, b in graph
        if _floor(a) in height and _floor(b) in height and height[_floor(a)] < height[_floor(b)]
    ]


def _floor(name: str) -> str:
    package, *rest = name.split(".")
    return rest[0] if package == PACKAGE.name and rest else ""


# ---- constants for places


def places(found: dict[str, Module]) -> list[tuple[str, str]]:
    """(module, name) of integers that stand for a place in an array and are imported by name."""
    numbers = {name: _integers(module.tree) for name, module in found.items()}
    return [
        (module.name, alias.name)
        for module in found.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name in numbers.get(_base(module, node), ())
    ]


def _integers(tree: ast.Module) -> set[str]:
    """Names that a module gives to integers in a row: `A, B, C = range(3)`, `A, B = 4, 7`."""
    return {
        name.id
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple)
        if _is_range(node.value) or _are_integers(node.value)
        for name in node.targets[0].elts
        if isinstance(name, ast.Name)
    }


def _are_integers(value: ast.expr) -> bool:
    return isinstance(value, ast.Tuple) and all(
        isinstance(each, ast.Constant) and type(each.value) is int for each in value.elts
    )


def _is_range(value: ast.expr) -> bool:
    return isinstance(value, ast.Call) and ast.unparse(value.func) == "range"


def _base(module: Module, node: ast.ImportFrom) -> str:
    """Module that `from ... import` names."""
    if not node.level:
        return node.module or ""
    folder = module.name.split(".")
    keep = len(folder) - node.level + (module.file.name == "__init__.py")
    return ".".join([*folder[:keep], *([node.module] if node.module else [])])


# ---- the table


def measured() -> dict[str, list[str]]:
    """{measure: what was found}, over both packages."""
    found = modules(PACKAGE, REPRODUCTIONS)
    graph = arrows()
    every = [(m, f) for m in found.values() for f in functions(m.tree)]
    kernels = ("strapdown.core", "strapdown.filters", "strapdown.cli")
    return {
        f"functions above {MAX_STATEMENTS} statements": [
            f"{module.name}.{function.name}: {statements(function)}"
            for module, function in every
            if statements(function) > MAX_STATEMENTS
        ],
        f"functions with more than {MAX_PARAMETERS} parameters outside core, filters and cli": [
            f"{module.name}.{function.name}: {parameters(function)}"
            for module, function in every
            if parameters(function) > MAX_PARAMETERS and not module.name.startswith(kernels)
        ],
        "circles of modules": [f"{len(group)}: {', '.join(group)}" for group in circles(graph)],
        "arrows up": [f"{a} -> {b}" for a, b in arrows_up(graph)],
        "places in arrays imported as integers": [
            f"{name}: {what}" for name, what in places(found)
        ],
    }


def by_room(found: dict[str, Module]) -> Counter[str]:
    """{room: statements}, the largest first."""
    sizes: Counter[str] = Counter()
    for module in found.values():
        sizes[module.room if module.package == PACKAGE.name else module.package] += statements(
            module.tree
        )
    return sizes


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--list", action="store_true", help="name what was found")
    names = parser.parse_args().list
    sizes = by_room(modules(PACKAGE, REPRODUCTIONS))
    for room, count in sizes.most_common():
        print(f"{count:6} statements  {room}")
    print(f"{sizes.total():6} statements  in all, docstrings not counted")
    for what, found in measured().items():
        print(f"{len(found):6} {what}")
        if names:
            print("".join(f"       {each}\n" for each in found), end="")


if __name__ == "__main__":
    main()
