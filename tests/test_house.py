"""The house: a README in each room, public names that are what the stub says, reproductions that use what a user could use."""

import ast
import importlib
import re
import typing
from collections import Counter
from pathlib import Path

import pytest

import strapdown
import strapdown_reproductions

PACKAGE = Path(strapdown.__file__).parent
REPRODUCTIONS = Path(strapdown_reproductions.__file__).parent
ROOT = Path(__file__).resolve().parents[1]
ROOMS = sorted({file.parent for file in PACKAGE.rglob("*.py")} - {PACKAGE})


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(PACKAGE)))
def test_a_room_says_what_it_is(room):
    text = (room / "README.md").read_text(encoding="utf-8")
    assert text.startswith("# ") and 100 < len(text) < 3000


def test_the_rooms_can_be_counted():
    """As many as one can keep in mind: 25 rooms, and 6 modules beside them."""
    rooms = {room for room in ROOMS if room.parent == PACKAGE}
    modules = {file.name for file in PACKAGE.glob("*.py")} - {"__init__.py", "__main__.py"}
    assert len(rooms) <= 25 and len(modules) <= 6


def test_no_two_files_of_tests_have_one_name():
    """pytest imports them by name, and refuses the second."""
    names = Counter(file.name for file in Path(__file__).parent.rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


def test_public_names_are_those_of_the_stub():
    """Type checkers read __init__.pyi, Python loads by it: each name must be what its module has."""
    tree = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    listed = {
        alias.asname: f"strapdown.{node.module}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    assert set(strapdown.__all__) == {*listed, "__version__", "flight"} and len(listed) > 40
    for name, module in listed.items():
        assert getattr(strapdown, name) is getattr(importlib.import_module(module), name)


@pytest.mark.parametrize("name", sorted(set(strapdown.__all__) - {"__version__"}))
def test_annotations_of_public_names_can_be_evaluated(name):
    """An annotation that names something which is not imported would only show in an editor."""
    value = getattr(strapdown, name)
    methods = (
        [each for each in vars(value).values() if callable(each)] if isinstance(value, type) else []
    )
    for each in (value, *methods):
        if getattr(each, "__module__", "").startswith("strapdown") and hasattr(
            each, "__annotations__"
        ):
            typing.get_type_hints(
                each, vars(importlib.import_module(each.__module__)) | types_of(each.__module__)
            )


def types_of(module):
    """What the module imports for type checkers alone."""
    found = {}
    for node in ast.parse(
        Path(importlib.import_module(module).__file__).read_text(encoding="utf-8")
    ).body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            module_of = importlib.import_module(module)
            exec(
                ast.unparse(ast.Module(node.body, [])),
                {"__name__": module, "__package__": module_of.__package__},
                found,
            )
    return found


def test_reproductions_use_what_a_user_could_use():
    """No name of the library that begins with an underscore."""
    files = list(REPRODUCTIONS.rglob("*.py"))
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.ImportFrom)
                and (node.module or "").split(".")[0] == "strapdown"
            ):
                names = [*node.module.split("."), *(alias.name for alias in node.names)]
                assert not [
                    name for name in names if name.startswith("_") and name != "__version__"
                ], f"{file}: {ast.unparse(node)}"
    assert len(files) > 50


def test_nothing_in_the_library_names_a_file_of_a_reproduction():
    papers = [folder.name for folder in REPRODUCTIONS.iterdir() if (folder / "main.py").exists()]
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert not [paper for paper in papers if f"strapdown_reproductions.{paper}" in text], file
    assert len(papers) >= 12


PAGES = [
    *ROOT.glob("*.md"),
    *ROOT.glob("docs/**/*.md"),
    *ROOT.glob("src/strapdown/**/README.md"),
    ROOT / "reproductions" / "README.md",
    ROOT / "ros2" / "README.md",
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_that_a_page_names_exist(page):
    """Paths from a room on, such as `core/loop/loop.py`; an example of a file to come says so."""
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?<![\w/.])((?:[a-z_]+/)+[a-z_0-9]+\.(?:py|toml|txt))\b", text)
    places = (ROOT, PACKAGE, ROOT / "tests", page.parent, REPRODUCTIONS.parent)
    to_come = {"vertical_speed.py", "my_filter.py"}
    missing = [
        name
        for name in named
        if Path(name).name not in to_come and not any((at / name).exists() for at in places)
    ]
    assert not missing
