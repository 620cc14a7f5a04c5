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

pytestmark = pytest.mark.short
ROOT = Path(__file__).resolve().parents[1]
PACKAGES = [Path(each.__file__).parent for each in (strapdown, strapdown_reproductions)]
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
FIRST = {"What", "Whether", "Of"}
"""Words that no docstring begins with: it says what a function returns or does."""


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


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_docstrings_say_what_a_function_returns_or_does(package):
    found = []
    for file in package.rglob("*.py"):
        for node in ast.walk(ast.parse(source(file))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                text = ast.get_docstring(node) or "-"
                if text.split()[0] in FIRST:
                    found.append(f"{file}:{getattr(node, 'lineno', 1)}: {text[:60]}")
    assert not found


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
