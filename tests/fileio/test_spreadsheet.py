"""Cells that a spreadsheet would run (OWASP, CSV Injection) are text; numbers stay numbers."""

import pandas as pd
import pytest
from hypothesis import given, strategies as st

from strapdown.fileio.spreadsheet import as_written, inert, inert_table

pytestmark = pytest.mark.short


@pytest.mark.parametrize("begin", ["=", "+", "-", "@", "\t", "\r", "\n", "\uff1d"])
def test_a_formula_gets_an_apostrophe(begin):
    assert inert(f"{begin}cmd|'/c calc'!A0").startswith("'" + begin)
    assert f";'{begin}x" in inert(f"a;{begin}x")


@pytest.mark.parametrize(
    "text", ["-1.5", "+3", "1e-9", "-inf", "nan", "a-b", "lat [deg]", "", "'a"]
)
def test_numbers_and_names_stay(text):
    assert inert(text) == text


@given(st.text("=+-@\t\r\n;'a1", max_size=8))
def test_what_was_written_comes_back(text):
    assert as_written(inert(text)) == text


def test_a_table_keeps_its_numbers():
    table = pd.DataFrame({"=a": [-1.5, 2.0], "b": ["@x", "-2"], "c": [None, "=y"]})
    found = inert_table(table)
    assert list(found.columns) == ["'=a", "b", "c"] and list(found["b"]) == ["'@x", "-2"]
    assert found["'=a"].tolist() == [-1.5, 2.0] and found["c"][1] == "'=y"
    assert list(table.columns) == ["=a", "b", "c"] and table["b"][0] == "@x"
