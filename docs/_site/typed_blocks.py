"""The Python of the documentation as modules for type checkers: `python docs/_site/typed_blocks.py
FOLDER` writes one for each page and for each module whose docstrings have examples.

Line n of such a module is line n of the page or of the module, so that what a checker says of it
leads to the place. A block that is a file becomes that file."""

import ast
import doctest
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from doc_pages import ROOT
from page_blocks import PAGES, blocks

PACKAGE = ROOT / "src" / "strapdown"


def placed(parts: Iterable[tuple[int, str]]) -> str:
    """The texts, each from its line on, with nothing between them."""
    lines: list[str] = []
    for line, text in parts:
        lines += [""] * (line - 1 - len(lines)) + text.splitlines()
    return "\n".join(lines) + "\n" if lines else ""


def of_page(page: Path) -> dict[str, str]:
    """{name of a module: text} of the Python blocks of a page."""
    found = [block for block in blocks(page) if block.language == "python"]
    files = {Path(block.file).stem: placed([(block.line, block.text)]) for block in found}
    whole = placed((block.line, block.text) for block in found if not block.file)
    files[module_name(page)] = whole
    return {name: text for name, text in files.items() if name and text}


def of_module(file: Path) -> str:
    """The examples in the docstrings of a module."""
    text = file.read_text(encoding="utf-8")
    if ">>> " not in text:
        return ""
    parts = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and (
            said := ast.get_docstring(node, clean=False)
        ):
            begin = node.body[0].lineno
            parts += [
                (begin + each.lineno, each.source)
                for each in doctest.DocTestParser().get_examples(said)
            ]
    return placed(sorted(parts))


def module_name(file: Path) -> str:
    """The name of the module with what a file shows."""
    path = file.with_suffix("")
    return "_".join(path.relative_to(ROOT).parts).replace("-", "_").replace(".", "_")


def modules() -> dict[str, str]:
    """{name of a module: text} of all that is shown. Raises ValueError where two have one name."""
    found: dict[str, str] = {}
    shown = [of_page(page) for page in PAGES]
    for file in sorted(PACKAGE.rglob("*.py")):
        if text := of_module(file):
            shown.append({module_name(file): text})
    for each in shown:
        if twice := found.keys() & each.keys():
            raise ValueError(f"two files of the documentation have the name {min(twice)}.py")
        found |= each
    return found


def write(folder: Path) -> None:
    """Write all modules into a folder, which then holds nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, text in modules().items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
