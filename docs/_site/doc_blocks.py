"""Texts in the pages that commands write: which are stale. What is quick is made again and
compared; what comes from a long study has a digest in its mark."""

import subprocess
import sys

import doc_lists as lists
import figure_pages
import filter_pages
import notebooks
from doc_pages import ROOT, every

from strapdown_reproductions.common import markdown


def edited() -> list[str]:
    """A line for each text of a study that is not the one the study wrote."""
    pages = [path for path in every() if path.suffix == ".md"]
    return [
        f"{page.relative_to(ROOT)}: {mark} was edited by hand; run "
        f"`strapdown reproduce {mark.rpartition(' ')[2]} --out DIR` and "
        f"`python -m strapdown_reproductions.common.write_docs {mark.rpartition(' ')[2]} DIR`"
        for page in pages
        for mark in markdown.edited_texts(page.read_text(encoding="utf-8"))
    ]


def picture() -> list[str]:
    """A line where the picture of the README is not what its command draws."""
    command = ["benchmarks/picture.py", "--check"]
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True)
    said = (done.stdout + done.stderr).strip().splitlines()
    return [f"README.md: {said[-1]}"] if done.returncode else []


def stale() -> list[str]:
    """A line for each stale text, with its page and the command that writes it."""
    return [
        *filter_pages.stale(),
        *figure_pages.stale(),
        *lists.stale(),
        *notebooks.stale(),
        *edited(),
    ]
