"""The findings as Markdown, for docs/alam.md: what stands there between its two marks is this
file's output."""

from ..common import markdown

BEGIN, END = markdown.begin("findings.md", "alam"), markdown.END


def insert(path, text):
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
