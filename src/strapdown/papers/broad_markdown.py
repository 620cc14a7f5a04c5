"""The tables of `strapdown reproduce broad` as Markdown, for docs/attitude-broad.md: this file's output stands there between two marks."""
import re

import numpy as np

from ..files import replacing

BEGIN, END = "<!-- begin: table.md of strapdown reproduce broad -->", "<!-- end -->"


def text(tables):
    """Markdown of {name: (caption, DataFrame)}, a caption above each table."""
    return "\n".join(f"{caption[0].upper()}{caption[1:].replace('*', chr(92) + '*')}:\n\n{_table(table)}\n" for caption, table in tables.values())


def _table(table):
    rows = [table.columns, ["---"] * len(table.columns), *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(_cell(value) for value in row) + " |" for row in rows)


def _cell(value):
    if isinstance(value, (float, np.floating)):
        return "–" if np.isnan(value) else f"{value:.2f}"
    return str(value).replace("|", "/").replace("*", r"\*")


def insert(path, text):
    """Put `text` between the marks of the Markdown file `path`."""
    page = path.read_text(encoding="utf-8")
    found = re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: f"{BEGIN}\n{text}{END}", page, count=1, flags=re.DOTALL)
    with replacing(path) as part:
        part.write_text(found, encoding="utf-8")
