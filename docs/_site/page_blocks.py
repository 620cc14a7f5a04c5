"""The fenced blocks of the pages: what the tests run and the type checkers read."""

import re
from pathlib import Path
from typing import NamedTuple

from doc_pages import ROOT

PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    ROOT / "benchmarks" / "README.md",
]
FENCE = re.compile(r"^```(\w+)?([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block: its language, what else its fence says, its text and the line where the
    text begins."""

    language: str
    flags: tuple[str, ...]
    text: str
    line: int

    @property
    def needs_data(self) -> bool:
        """Whether recorded data is needed to run it."""
        return "needs-data" in self.flags

    @property
    def file(self) -> str:
        """The file that the block is, or nothing."""
        return next((flag[5:] for flag in self.flags if flag.startswith("file=")), "")


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(m[1] or "", tuple(m[2].split()), m[3], text.count("\n", 0, m.start()) + 2)
        for m in FENCE.finditer(text)
    ]
