"""The tables of `strapdown reproduce broad` as Markdown, for docs/attitude-broad.md: this file's
output stands there between two marks."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ..common import markdown

BEGIN, END = markdown.begin("table.md", "broad"), markdown.END


def text(tables: Mapping[str, tuple[str, pd.DataFrame]]) -> str:
    """Markdown of {name: (caption, DataFrame)}, a caption above each table."""
    return "\n".join(
        f"{caption[0].upper()}{caption[1:].replace('*', chr(92) + '*')}:\n\n{markdown.table(table, _cell)}\n"
        for caption, table in tables.values()
    )


def _cell(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return "–" if np.isnan(value) else f"{value:.2f}"
    return str(value).replace("|", "/").replace("*", r"\*")


def insert(path: Path, text: str) -> None:
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
