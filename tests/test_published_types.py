"""Public names as an editor shows them: short types, with nothing unknown in them."""

import dataclasses
import inspect
import json
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import strapdown

ROOT = Path(__file__).resolve().parents[1]
SHORT = 350
"""Characters of the longest type, some five lines of an editor's."""
EXPANDED = {"static_attitude"}
"""Those that take numpy's `ArrayLike`, which is long once it is expanded."""


def test_the_type_of_every_public_name_is_short_and_known(tmp_path):
    pytest.importorskip("basedpyright")
    lines = ["import strapdown", *(f"reveal_type(strapdown.{each})" for each in strapdown.__all__)]
    (tmp_path / "revealed.py").write_text("\n".join(lines), encoding="utf-8")
    settings = {"extraPaths": [str(ROOT / "src")], "include": ["revealed.py"]}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings), encoding="utf-8")
    command = ["-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable, "-p", tmp_path]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    found = {
        strapdown.__all__[each["range"]["start"]["line"] - 1]: each["message"].partition(" is ")[2]
        for each in json.loads(done.stdout)["generalDiagnostics"]
        if each["message"].startswith("Type of")
    }
    assert found.keys() == set(strapdown.__all__)
    unknown = {name: text for name, text in found.items() if "Unknown" in text or text == '"Any"'}
    long = {name: text for name, text in found.items() if len(text) > SHORT}
    assert not unknown and long.keys() == EXPANDED


def test_help_of_the_library_is_one_screen():
    assert len(pydoc.render_doc(strapdown, renderer=pydoc.plaintext).splitlines()) <= 60
    assert "fuse" in strapdown.__all__ and "no name" not in strapdown.__all__


CLASSES = [each for each in strapdown.__all__ if inspect.isclass(getattr(strapdown, each))]


@pytest.mark.parametrize("name", CLASSES)
def test_help_of_a_class_says_what_each_field_is(name):
    """By numpydoc: name : type, and behind it at least a line of meaning."""
    made = getattr(strapdown, name)
    fields = getattr(made, "_fields", None) or [
        each.name for each in (dataclasses.fields(made) if dataclasses.is_dataclass(made) else ())
    ]
    text = pydoc.render_doc(made, renderer=pydoc.plaintext)
    silent = [
        field
        for field in fields
        if not re.search(rf"\|  (\w+, )*{field}(, \w+)* : \S.*\n \|      \S", text)
        and not re.search(rf"\|  (\w+, )*{field}(, \w+)*\n \|      \S", text)
    ]
    assert not silent
