"""Concordance of a paper: each equation, figure, table and claim with the file that has it, the test
that holds it, and its verdict."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from .markdown import plain, table

ROOT = Path(__file__).resolve().parents[4]
"""Root of the source tree, at which the references of a ConcordanceEntry begin."""
FROM_PAGE = "../../.."
"""The same as a link of a page in docs/reference/evidence."""


class ConcordanceEntry(NamedTuple):
    """Something that a paper prints, and where it is here."""

    printed: str  # number in the paper, such as "(15)", "Table II", "Fig. 4", "V, end"
    what: str  # in a few words
    where: str  # "folder/file.py::name" or "folder/file.py"; "" where it is nowhere
    test: str  # the same of the test that holds it; "" where there is none
    verdict: str  # "as printed", "corrected: ...", a verdict on a claim, why it is nowhere


def of_claims(
    claims: Sequence[Mapping[str, Any]], names: Iterable[str], where: str, test: str
) -> list[ConcordanceEntry]:
    """A ConcordanceEntry of each claim, numbered as on its page: the findings `claims`, whose rows have these
    `names` in the file `where`."""
    return [
        ConcordanceEntry(
            f"claim {i}, {c['source']}", c["claim"], f"{where}::{name}", test, c["verdict"]
        )
        for i, (name, c) in enumerate(zip(names, claims, strict=True), 1)
    ]


def missing_references(entries: Iterable[ConcordanceEntry], root: Path = ROOT) -> list[str]:
    """References of the entries that lead nowhere, and entries without a reference or verdict."""
    found = []
    for entry in entries:
        said = [
            reference
            for reference in (entry.where, entry.test)
            if reference and not _leads(root, reference)
        ]
        if not entry.verdict or (entry.test and not entry.where):
            said.append("no verdict, or a test without a file")
        found += [f"{entry.printed}: {each}" for each in said]
    return found


def _leads(root: Path, reference: str) -> bool:
    """True where the file exists and has the name as a word of its own."""
    file, _, name = reference.partition("::")
    path = root / file
    return path.is_file() and bool(
        re.search(rf"\b{re.escape(name)}\b", path.read_text(encoding="utf-8"))
    )


def concordance(entries: Iterable[ConcordanceEntry]) -> str:
    """Markdown of the entries as a table whose references are links, for docs/reference/evidence."""
    rows = [
        (plain(e.printed), plain(e.what), _link(e.where), _link(e.test), plain(e.verdict))
        for e in entries
    ]
    columns = ["printed", "what", "where", "test", "verdict"]
    return table(pd.DataFrame(rows, columns=columns), str) + "\n"


def _link(reference: str) -> str:
    """The reference as a link that shows the name alone, or the file where there is no name."""
    file, _, name = reference.partition("::")
    return f"[{name or Path(file).name}]({FROM_PAGE}/{file})" if file else "–"
