"""The wrong changes that `tests/mutants.py` makes: all kinds, each another program, none where no test could see it."""

import ast

import pytest
import source_mutants

pytestmark = pytest.mark.short

SOURCE = '''
from math import pi


@kernel(signature(3))
def step(x: "Array[3]", most: float = 0.5) -> int:
    """Docstring with 1 + 1."""
    if x < 1 and not x == 2:
        raise ValueError(f"{1 + 1} is less than {3}")
    x[0] = -x
    x += atan2(x, most)
    return min(x, 2 * x)
'''


def mutants(text):
    return [source_mutants.mutant(text, i) for i in range(source_mutants.count(text))]


def test_all_kinds_of_changes_are_made():
    changes = {(each.was, each.now) for each in mutants(SOURCE)}
    assert changes == {
        ("x < 1 and (not x == 2)", "x < 1 or not x == 2"),
        ("x < 1", "x >= 1"),
        ("x < 1", "x <= 1"),
        ("1", "2"),
        ("1", "0"),
        ("not x == 2", "x == 2"),
        ("x == 2", "x != 2"),
        ("2", "3"),
        ("2", "1"),
        ("0.5", "1.0"),
        ("x[0] = -x", "pass"),
        ("0", "1"),
        ("0", "-1"),
        ("-x", "x"),
        ("x += atan2(x, most)", "x -= atan2(x, most)"),
        ("x += atan2(x, most)", "pass"),
        ("atan2(x, most)", "atan2(most, x)"),
        ("2 * x", "2 / x"),
    }


def test_each_is_another_program_that_compiles():
    plain = ast.dump(ast.parse(SOURCE))
    dumps = [ast.dump(each.tree) for each in mutants(SOURCE)]
    assert plain not in dumps and len(set(dumps)) == len(dumps)
    for each in mutants(SOURCE):
        compile(each.tree, "mutant", "exec")


def test_a_mutant_knows_the_line_of_its_statement():
    text = "a = 0\nif a:\n    b = [\n        1 + 2,\n        a\n    ]\n"
    [found] = [each for each in mutants(text) if each.was == "1 + 2"]
    assert (found.line, found.statement) == (4, 3)
