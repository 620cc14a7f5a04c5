"""The tables of every filter as Markdown, for docs/every-filter.md: what `strapdown reproduce
recordings` writes as table.md stands there."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from ..common import markdown

BEGIN, END = markdown.begin("table.md", "recordings"), markdown.END


def text(tables: Iterable[tuple[str, pd.DataFrame]]) -> str:
    """Markdown of [(heading, DataFrame of text)]."""
    return "\n".join(
        f"### {heading}\n\n{markdown.table(table, _cell)}\n" for heading, table in tables
    )


def _cell(text: str) -> str:
    """Text whose lines stay lines."""
    return text.replace("|", "/").replace("*", r"\*").replace("\n", "<br>")


def insert(path: Path, text: str) -> None:
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
