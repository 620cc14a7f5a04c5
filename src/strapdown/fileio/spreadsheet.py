"""Texts in tables that a spreadsheet would run as formulas, made inert, and as they were.

A cell that begins with =, +, -, @ or a control character is a formula to a spreadsheet (OWASP, CSV Injection).
An apostrophe before it makes it text. So it is behind a semicolon, tab or line break, where a spreadsheet of
another country begins a new cell. Numbers stay as they are.
"""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

BEGINS = "=+\\-@\t\r\n\uff1d\uff0b\uff0d\uff20"  # the last four are as wide as Chinese signs
FORMULA = re.compile(f"(^|[;\t\r\n])(?='*[{BEGINS}])")
INERT = re.compile(f"(^|[;\t\r\n])'(?='*[{BEGINS}])")


def inert(text: str) -> str:
    """The text of a cell, with an apostrophe where a formula would begin; a number stays one."""
    try:
        float(text)
    except ValueError:
        return FORMULA.sub(r"\1'", text)
    return text


def as_written(text: str) -> str:
    """The text that `inert` was given."""
    return INERT.sub(r"\1", text)


def inert_table(table: "pd.DataFrame") -> "pd.DataFrame":
    """The table with the names of its columns and index and its cells of text `inert`."""

    def cell(value: object) -> object:
        return inert(value) if isinstance(value, str) else value

    made = table.copy(deep=False)
    for place in range(made.shape[1]):
        column = made.iloc[:, place]
        if column.dtype.kind not in "iufbM":
            made.isetitem(place, column.astype(object).map(cell).to_numpy())
    made = made.rename(columns=cell, index=cell)
    return made.rename_axis(index=cell, columns=cell)
