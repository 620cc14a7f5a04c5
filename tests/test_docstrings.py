"""Docstrings of what `strapdown` and `strapdown.flight` show: numpydoc sections that name every parameter, and examples
that run."""

import doctest
import inspect
import re

import pytest

import strapdown as sd

NAMED = [(name, getattr(room, name)) for room in (sd, sd.flight) for name in room.__all__]
PUBLIC = [value for _, value in NAMED if inspect.isfunction(value)]
EXAMPLES = [
    test
    for name, value in NAMED
    for test in doctest.DocTestFinder(recurse=inspect.isclass(value)).find(value, name)
    if test.examples
]


def section(text, heading):
    """The lines of a numpydoc section."""
    found = re.search(rf"^{heading}\n-+\n(.*?)(?=^[\w ]+\n-+\n|\Z)", text, re.M | re.S)
    return found[1].strip() if found else ""


@pytest.mark.short
@pytest.mark.parametrize("function", PUBLIC, ids=lambda function: function.__name__)
def test_every_parameter_is_documented(function):
    text = inspect.getdoc(function)
    parameters = "\n".join(section(text, each) for each in ("Parameters", "Other Parameters"))
    listed = re.findall(r"^([*\w, ]+)(?: : |$)", parameters, re.M)
    named = {name.strip("* ") for line in listed for name in line.split(",")}
    assert set(inspect.signature(function).parameters) <= named
    assert section(text, "Returns") or section(text, "Yields") or text.startswith(("Write", "Add"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_examples_run(example):
    said = []
    doctest.DocTestRunner().run(example, out=said.append)
    assert not said, "".join(said)
