"""What the commands that list things print, in the pages: a text between the marks

    <!-- begin: output of strapdown COMMAND -->
    <!-- end -->

is that output. `python docs/_site/doc_lists.py` writes it anew.
"""

import re
import sys
from functools import cache
from pathlib import Path

from doc_pages import ROOT, every
from typer.testing import CliRunner

from strapdown.cli import app

MARKED = re.compile(r"<!-- begin: output of (strapdown .+?) -->\n.*?<!-- end -->", re.DOTALL)
COMMAND = "python docs/_site/doc_lists.py"


@cache
def output(command: str) -> str:
    """What a command prints."""
    done = CliRunner().invoke(app.app, command.split()[1:], env={"COLUMNS": "200"})
    if done.exit_code:
        raise RuntimeError(f"{command} ended with {done.exit_code}: {done.output}")
    return "\n".join(line.rstrip() for line in done.output.strip("\n").splitlines())


def filled(text: str) -> str:
    """A page with today's output between its marks."""
    return MARKED.sub(
        lambda m: f"<!-- begin: output of {m[1]} -->\n```text\n{output(m[1])}\n```\n<!-- end -->",
        text,
    )


def marked() -> list[Path]:
    """Pages that hold such output."""
    pages = [path for path in every() if path.suffix == ".md"]
    return [path for path in pages if MARKED.search(path.read_text(encoding="utf-8"))]


def stale() -> list[str]:
    """A line for each page whose output is no longer that of its commands."""
    return [
        f"{path.relative_to(ROOT)}: its lists are not what the commands print; run `{COMMAND}`"
        for path in marked()
        if filled(text := path.read_text(encoding="utf-8")) != text
    ]


if __name__ == "__main__":
    for path in marked():
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
    sys.exit()
