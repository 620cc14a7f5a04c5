"""The field's words: names, docstrings and messages keep the private ones out; the glossary has each
term once."""

import ast
import io
import re
import tokenize
from functools import cache
from pathlib import Path

import pytest

import strapdown
import strapdown_reproductions
import strapdown_ros2

pytestmark = pytest.mark.short
ROOT = Path(__file__).resolve().parents[1]
PACKAGES = [
    Path(each.__file__).parent for each in (strapdown, strapdown_reproductions, strapdown_ros2)
]
FILES = sorted(file for package in PACKAGES for file in package.rglob("*.py"))
GLOSSARY = ROOT / "docs" / "reference" / "glossary.md"
NAMES = re.compile(
    r"^_?(MOST|LEAST|LARGEST|LONGEST|SHORTEST|HIGHEST|LOWEST|SMALLEST)(_|$)"
    r"|^(Asked|Belief|Start|Brought|Estimable|take_over|level_again|left_open|recent_motion"
    r"|heavy_tails|followed_noise)$"
)
"""Names that another one has replaced: bounds are MAX and MIN, the rest is in the glossary."""
KEPT = {"strapdown_reproductions": {"Asked"}}
"""{package: names that stand for something else there}: how a reproduction is asked for."""
PHRASES = re.compile(
    r"one of its relatives|not surely, or not by much|noses near|brought along|gates? (was |is )?lifted"
)
"""What messages and docstrings said before, each with a plainer wording now."""
FIRST = {"What", "Whether", "Of", "How"}
"""Words that no docstring begins with: it says what a function returns or does, a value is."""
GONE = {"Aiding", "aidings", "sd", "grade()", "grades()", "Fix"}
"""Names of before: of variables, parameters and attributes, functions (with parentheses), classes."""
PARTICIPLES = re.compile(
    r"_?([a-z]{3,}(ed|ing)|[a-z]{2,}own|alike|apart|begun|bent|born|bought|bound|broken|brought"
    r"|built|caught|chosen|dealt|done|drawn|driven|due|fallen|fed|felt|forgotten|found|frozen|given|gone|heard"
    r"|held|hidden|kept|laid|led|left|lent|lost|made|meant|met|paid|risen|said|seen|sent|sold"
    r"|sought|spent|spoken|stood|taken|taught|thought|told|torn|whole|won|worn|worth|written)"
)
"""Functions are named by what they do or return, not by a participle or an adjective alone."""
NOUNS = (
    "bound cleaning embed ending encoding feed finding heading meaning mounting need recording seed"
    " setting speed strapdown string swing"
).split()
"""Nouns and verbs that look like one."""
PUBLIC = {"hidden", "displaced", "replacing", "turning"}
"""Recording.hidden and Trajectory.displaced make another value, `files.replacing` is a context like
`contextlib.closing`, `plan.turning` a flight plan of that name."""


@cache
def source(file):
    return file.read_text(encoding="utf-8")


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_names_are_those_of_the_field(package):
    found = []
    for file in package.rglob("*.py"):
        tokens = tokenize.generate_tokens(io.StringIO(source(file)).readline)
        names = {token.string for token in tokens if token.type == tokenize.NAME}
        found += [
            f"{file}: {name}"
            for name in names
            if NAMES.search(name) and name not in KEPT.get(package.name, ())
        ]
    assert not found


def test_docstrings_say_what_a_function_returns_or_does():
    assert not [
        f"{file}: {name}: {text[:60]}"
        for file in FILES
        for node in ast.walk(ast.parse(source(file)))
        for name, text in documented(node)
        if text.split()[0] in FIRST
    ]


def documented(node):
    """[(name, docstring)] of a node itself and of the assignments in its body."""
    said = []
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
        said.append((getattr(node, "name", "module"), ast.get_docstring(node) or "-"))
    body = getattr(node, "body", [])
    for first, then in zip(body, body[1:]) if isinstance(body, list) else ():
        if isinstance(first, ast.Assign | ast.AnnAssign) and isinstance(then, ast.Expr):
            text = getattr(then.value, "value", None)
            target = first.target if isinstance(first, ast.AnnAssign) else first.targets[0]
            said += [(ast.unparse(target), text)] if isinstance(text, str) else []
    return said


def test_functions_are_not_named_by_a_participle_alone():
    assert not [
        f"{file}:{node.lineno}: {node.name}"
        for file in FILES
        for node in ast.walk(ast.parse(source(file)))
        if isinstance(node, ast.FunctionDef) and is_participle(node)
    ]


def is_participle(function):
    """True for a function or method, but no property, whose name is a bare participle."""
    name = function.name.strip("_")
    return bool(
        PARTICIPLES.fullmatch(name)
        and name not in NOUNS
        and name not in PUBLIC
        and not function.name.endswith("__")
        and not any("property" in ast.unparse(each) for each in function.decorator_list)
    )


def test_names_of_before_do_not_come_back():
    assert not [
        f"{file}: {name}"
        for file in FILES
        for node in ast.walk(ast.parse(source(file)))
        for name in defined(node)
        if name in GONE
    ]


def defined(node):
    """The names that a node gives to classes, functions (with parentheses), values and parameters."""
    match node:
        case ast.ClassDef():
            return [node.name]
        case ast.FunctionDef():
            return [
                f"{node.name}()",
                *(each.arg for each in ast.walk(node.args) if isinstance(each, ast.arg)),
            ]
        case ast.Name(ctx=ast.Store()):
            return [node.id]
        case ast.Attribute() | ast.keyword():
            return [getattr(node, "attr", None) or getattr(node, "arg", None)]
    return []


def test_sentences_are_plain():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    pages = [page for page in pages if "_site" not in page.parts]
    assert not [
        f"{file}: {found[0]}"
        for file in [*FILES, *pages]
        if (found := PHRASES.search(source(file)))
    ]


def test_a_class_has_a_name_of_its_own():
    homes = {}
    for file in FILES:
        for node in ast.parse(source(file)).body:
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(file)
    assert not {name: files for name, files in homes.items() if len(files) > 1}


def test_the_glossary_has_each_term_once_with_a_definition():
    rows = [
        [cell.strip() for cell in line.strip("|\n").split("|")]
        for line in source(GLOSSARY).splitlines()
        if line.startswith("|") and not set(line) <= set("|- ")
    ]
    terms = [row[0] for row in rows if row[0] != "term"]
    assert len(terms) > 60 and len({term.lower() for term in terms}) == len(terms)
    assert all(len(row) == 4 and len(row[2]) > 15 for row in rows if row[0] != "term")


def test_a_private_word_would_be_seen():
    assert all(map(NAMES.search, ("MOST_STATES", "_LEAST", "Belief")))
    assert not any(map(NAMES.search, ("MAX_STATES", "ALMOST", "FilterState", "start")))
    code = "class Fix: ...\ndef grade(sd, *aidings):\n    sd = 1\n    return x.aidings, f(sd=1)"
    found = [name for node in ast.walk(ast.parse(code)) for name in defined(node)]
    assert sorted(GONE & set(found)) == ["Fix", "aidings", "grade()", "sd"]
    words = {
        "counted",
        "_moving",
        "shown",
        "told",
        "recording",
        "count_cells",
        "hidden",
        "__missing__",
    }
    made = [ast.parse(f"def {word}(): ...").body[0] for word in sorted(words)]
    assert [each.name for each in made if is_participle(each)] == [
        "_moving",
        "counted",
        "shown",
        "told",
    ]
    (method,) = ast.parse("@cached_property\ndef told(self): ...").body
    assert not is_participle(method)
