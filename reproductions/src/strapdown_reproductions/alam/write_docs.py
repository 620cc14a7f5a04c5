"""The findings as Markdown, for docs/alam.md: what stands there between its two marks is this
file's output."""

from pathlib import Path

from ..common import markdown

BEGIN, END = markdown.begin("findings.md", "alam"), markdown.END


def insert(path: Path, text: str) -> None:
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
