"""The tables of every filter as Markdown, for docs/every-filter.md: what `strapdown reproduce recordings` writes as table.md stands there."""
import re

from ..files import replacing

BEGIN, END = "<!-- begin: table.md of strapdown reproduce recordings -->", "<!-- end -->"


def text(tables):
    """Markdown of [(heading, DataFrame of text)]."""
    return "\n".join(f"### {heading}\n\n{_table(table)}\n" for heading, table in tables)


def _table(table):
    rows = [table.columns, ["---"] * len(table.columns), *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(_cell, row)) + " |" for row in rows)


def _cell(text):
    """Text whose lines stay lines."""
    return text.replace("|", "/").replace("*", r"\*").replace("\n", "<br>")


def insert(path, text):
    """Put `text` between the marks of the Markdown file `path`."""
    page = path.read_text(encoding="utf-8")
    found = re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: f"{BEGIN}\n{text}{END}", page, count=1, flags=re.DOTALL)
    with replacing(path) as part:
        part.write_text(found, encoding="utf-8")
