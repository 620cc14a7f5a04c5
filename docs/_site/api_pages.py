"""The reference of functions and classes, from their docstrings: a page for each public name, and
one for what the examples of the documentation import from modules."""

import ast
import importlib
import inspect
import re
from types import ModuleType
from typing import Any

from doc_pages import DOCS, every

import strapdown
import strapdown.flight

ROOMS = (strapdown, strapdown.flight)
PAGE = DOCS / "reference" / "api.md"
EXAMPLE = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def public() -> dict[str, Any]:
    """{public name: value}."""
    return {name: getattr(room, name) for room in ROOMS for name in _names(room)}


def _names(room: ModuleType) -> list[str]:
    """Names of the functions and classes of a room."""
    return [
        name
        for name in room.__all__
        if not name.startswith("__") and not inspect.ismodule(getattr(room, name))
    ]


def imported() -> dict[str, dict[str, Any]]:
    """{module: {name: function or class}} of what examples import and `strapdown` itself lacks."""
    found: dict[str, dict[str, Any]] = {}
    known = list(public().values())
    for page in every():
        for block in EXAMPLE.findall(page.read_text(encoding="utf-8")):
            for node in ast.walk(ast.parse(block)):
                if not isinstance(node, ast.ImportFrom) or not node.module:
                    continue
                if node.module.split(".")[0] != "strapdown":
                    continue
                module = importlib.import_module(node.module)
                for alias in node.names:
                    value = getattr(module, alias.name)
                    if inspect.isclass(value) or inspect.isfunction(value):
                        if not any(value is each for each in known):
                            found.setdefault(value.__module__, {})[alias.name] = value
    return {module: dict(sorted(found[module].items())) for module in sorted(found)}


def _entry(module: str, name: str, value: Any) -> str:
    kind, members = ("class", "\n   :members:") if inspect.isclass(value) else ("function", "")
    return f"```{{eval-rst}}\n.. currentmodule:: {module}\n\n.. auto{kind}:: {name}{members}\n```\n"


def pages() -> dict[str, str]:
    """{file beside api.md: text}."""
    found = {
        f"api/{name}.md": f"# {name}\n\n{_entry(room.__name__, name, getattr(room, name))}"
        for room in ROOMS
        for name in _names(room)
    }
    parts = ["# In modules\n\nWhat the examples of these pages import from modules.\n"]
    for module, names in imported().items():
        parts.append(f"## {module}\n")
        parts += [_entry(module, name, value) for name, value in names.items()]
    return found | {"api/modules.md": "\n".join(parts)}


def linked(text: str) -> str:
    """api.md with each name leading to its page, and a line on the names in modules."""
    names = public()

    def link(name: re.Match[str]) -> str:
        return f"[`{name[1]}`](api/{name[1]}.md)" if name[1] in names else name[0]

    def row(line: re.Match[str]) -> str:
        return re.sub(r"`(\w+)`", link, line[0])

    text = re.sub(r"^\|[^|\n]*\|", row, text, flags=re.MULTILINE)
    listed = "\n".join(f"api/{name}" for name in sorted(names, key=str.lower))
    return (
        f"{text}\nWhat examples import from modules stands on [a page of its own](api/modules.md)."
        f"\n\n```{{toctree}}\n:hidden:\n\n{listed}\nIn modules <api/modules>\n```\n"
    )
