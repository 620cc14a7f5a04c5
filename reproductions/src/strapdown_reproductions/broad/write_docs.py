"""The tables of `strapdown reproduce broad` as Markdown, for docs/attitude-broad.md: this file's
output stands there between two marks."""

import numpy as np

from ..common import markdown

BEGIN, END = markdown.begin("table.md", "broad"), markdown.END


def text(tables):
    """Markdown of {name: (caption, DataFrame)}, a caption above each table."""
    return "\n".join(
        f"{caption[0].upper()}{caption[1:].replace('*', chr(92) + '*')}:\n\n{markdown.table(table, _cell)}\n"
        for caption, table in tables.values()
    )


def _cell(value):
    if isinstance(value, (float, np.floating)):
        return "–" if np.isnan(value) else f"{value:.2f}"
    return str(value).replace("|", "/").replace("*", r"\*")


def insert(path, text):
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
