"""Tables that a command makes, as Markdown, and the pages of docs/ in which they stand between
two marks."""

import hashlib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from strapdown.fileio.files import replacing

from .pages import counts, found_text

END = "<!-- end -->"
"""The mark below an empty place."""
_END = r"<!-- end(?: \w+)? -->"


def end(text: str) -> str:
    """The mark below `text`, with its digest: text that somebody edits by hand has another."""
    return f"<!-- end {hashlib.sha256(text.encode()).hexdigest()[:12]} -->"


def begin(file: str, command: str) -> str:
    """Return the mark above the content of `file` of a run of `strapdown reproduce command`."""
    return f"<!-- begin: {file} of strapdown reproduce {command} -->"


def insert(path: Path, text: str, mark: str) -> None:
    """Put `text` between `mark` and its end in the Markdown file `path`."""
    page = path.read_text(encoding="utf-8")
    found = re.sub(
        f"{re.escape(mark)}.*?{_END}",
        lambda _: f"{mark}\n{text}{end(text)}",
        page,
        count=1,
        flags=re.DOTALL,
    )
    with replacing(path) as part:
        part.write_text(found, encoding="utf-8")


def read_marked(path: Path, mark: str) -> str:
    """The text between `mark` and its end in the Markdown file `path`."""
    page = path.read_text(encoding="utf-8")
    return page.partition(f"{mark}\n")[2].partition("<!-- end")[0]


def rows(text: str) -> list[list[str]]:
    """Cells of the first table of a Markdown text, the head first."""
    found = re.search(r"(?:^\|.*\n)+", text, re.MULTILINE)
    if not found:
        return []
    lines = [line.strip("|").split("|") for line in found[0].splitlines()]
    return [[cell.strip() for cell in line] for i, line in enumerate(lines) if i != 1]


def section(text: str, heading: str) -> str:
    """Return the text below a heading of a Markdown text, up to the next heading of any level."""
    below = text.rpartition(f"# {heading}\n")[2]
    return re.split(r"^#+ ", below, maxsplit=1, flags=re.MULTILINE)[0]


def edited_texts(page: str) -> list[str]:
    """Return the names of the marked texts of a page that differ from what their command wrote,
    such as "table.md of strapdown reproduce noise"."""
    found = re.finditer(rf"<!-- begin: (.+?) -->\n(.*?)({_END})", page, re.DOTALL)
    return [
        match[1]
        for match in found
        if (match[3] != END or "reproduce" in match[1]) and match[3] != end(match[2])
    ]


def table(frame: pd.DataFrame, cell: Callable[[Any], str]) -> str:
    """A DataFrame, each name of a column and value through `cell`."""
    rows = [frame.columns, ["---"] * len(frame.columns), *frame.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(cell, row)) + " |" for row in rows)


def plain(text: str) -> str:
    """Text that no table and no browser takes for its own."""
    return text.replace("|", "/").replace("<", "&lt;")


def number(value: float, digits: int = 2) -> str:
    """Text of a number, a dash where it is not known."""
    return "–" if np.isnan(value) else f"{value:.{digits}g}"


def cell(value: object) -> str:
    """A value of a table as text that Markdown leaves as it is: two decimals, lines stay lines."""
    if isinstance(value, (float, np.floating)):
        return "–" if np.isnan(value) else f"{value:.2f}"
    return str(value).replace("|", "/").replace("*", r"\*").replace("\n", "<br>")


def short(value: object) -> str:
    """The same with three digits."""
    if isinstance(value, (float, np.floating)):
        return number(float(value), 3)
    return cell(value)


def tables(headed: Iterable[tuple[str, pd.DataFrame]], written: Callable[[Any], str] = cell) -> str:
    """Markdown of [(line, DataFrame)], each under its line; written: how a value is."""
    return "\n".join(f"{line}\n\n{table(frame, written)}\n" for line, frame in headed)


def findings(
    size: str,
    claims: Sequence[Mapping[str, str]],
    tables: Iterable[tuple[str, pd.DataFrame]],
    between: Sequence[str] = (),
    work: str = "paper",
) -> str:
    """Text: sentences on the size of the study, the claims of the `work` with their verdicts, the
    lines `between`, and the tables [(heading, DataFrame of text)]."""
    rows = [
        f"| {i} | {plain(c['claim'])} | **{c['verdict']}** | {plain(found_text(c))}{_by_algebra(c)} |"
        for i, c in enumerate(claims, 1)
    ]
    head = f"| | the {work} says | verdict | what was found |"
    parts = [size, "", f"{counts(claims)}.", "", head, "|---|---|---|---|", *rows]
    if folded := [
        "\n".join(
            [
                f"{i}. {plain(c['kind'] or 'No kind')}.",
                *map(_bullet, c["measured"].splitlines()),
                *map(_bullet, f"Rule: {c['rule']}".splitlines()),
            ]
        )
        for i, c in enumerate(claims, 1)
        if c["answer"]
    ]:
        summary = "The numbers behind each verdict, and the rule that decides"
        parts += ["", f"<details><summary>{summary}</summary>", "", *folded, "", "</details>"]
    parts += between
    for heading, frame in tables:
        parts += ["", f"{heading}:", "", table(frame, lambda value: plain(str(value)))]
    return "\n".join(parts) + "\n"


def _bullet(line: str) -> str:
    return f"    - {line[:1].upper()}{plain(line[1:]).rstrip('.;')}."


def _by_algebra(c: Mapping[str, str]) -> str:
    return f" (By algebra: {plain(c['identity'])})" * bool(c["identity"])
