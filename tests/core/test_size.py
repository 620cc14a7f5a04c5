"""Functions of the core can be read at a glance: few statements, few branches."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import house
import pytest

import strapdown

CORE = Path(strapdown.__file__).parent / "core"
MAX_COMPLEXITY = 12
"""McCabe's number, as ruff's C901 counts it."""


def sizes():
    """{file:function: statements} of the core."""
    return {
        f"{file.relative_to(CORE).as_posix()}:{function.name}": house.statements(function)
        for file in sorted(CORE.rglob("*.py"))
        for function in house.functions(ast.parse(file.read_text(encoding="utf-8")))
    }


def test_statements_are_counted_with_those_nested_in_them():
    source = """
def f(x):
    "Docstring."
    for i in x:
        if i:
            g = 1
    def inner():
        return g
    return inner
"""
    assert [house.statements(each) for each in house.functions(ast.parse(source))] == [6, 1]


def test_a_function_has_few_statements():
    found = sizes()
    assert len(found) > 300
    too_long = {name: count for name, count in found.items() if count > house.MAX_STATEMENTS}
    assert not too_long, f"more than {house.MAX_STATEMENTS} statements: {too_long}"


def test_a_function_has_few_branches():
    pytest.importorskip("ruff")
    limit = f"lint.mccabe.max-complexity={MAX_COMPLEXITY}"
    told = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--isolated", "--no-cache", "--select", "C901"]
        + ["--config", limit, "--output-format", "json", str(CORE)],
        capture_output=True,
        text=True,
    ).stdout
    found = {}
    for each in json.loads(told):
        _, name, rest = each["message"].split("`")
        file = Path(each["filename"]).relative_to(CORE).as_posix()
        found[f"{file}:{name}"] = int(rest.split("(")[1].split(" ")[0])
    assert not found, f"more complex than {MAX_COMPLEXITY}: {found}"
