"""The findings as Markdown, for docs/alam.md: what stands there between its two marks is this file's output."""
from . import markdown

BEGIN, END = markdown.begin("findings.md", "alam"), markdown.END


def findings(size, claims, tables):
    """Text: sentences on the size of the study, the claims with their verdicts, and the tables [(heading, DataFrame of text)]."""
    rows = [f"| {i} | {markdown.plain(c['claim'])} | **{c['verdict']}** | {markdown.plain(c['measured'])} |" for i, c in enumerate(claims, 1)]
    parts = [size, "", "| | the paper says | verdict | measured |", "|---|---|---|---|", *rows]
    for heading, table in tables:
        parts += ["", f"{heading}:", "", markdown.table(table, lambda value: markdown.plain(str(value)))]
    return "\n".join(parts) + "\n"


def insert(path, text):
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
