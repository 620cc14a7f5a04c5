"""The page of a finished study: of one whose figures are held against targets, and of one that
decides the claims of a paper."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pandas as pd
import plotly.graph_objects as go

from strapdown.typing import File

from . import markdown
from .pages import TOO_FEW, write_page
from .runner import ENOUGH, Evidence
from .tables import Tables
from .targets import Target, in_docs, judged

Claims: TypeAlias = Sequence[Mapping[str, Any]]


def in_one_file(found: Evidence, claims: Claims, tables: Tables) -> dict[str, str]:
    """{name: text} of the one file for docs/: figures and all tables, numbers with three digits."""
    return {"table.md": in_docs(claims, tables)}


class Study(NamedTuple):
    """A study whose figures are held against targets: its sentences, and its measures of the
    Evidence that its runs leave."""

    title: str
    introduction: tuple[str, ...]
    targets: Mapping[str, Target]
    # {name of a target: figure}; NaN where the runs do not decide
    figures: Callable[[Evidence], Mapping[str, float]]
    tables: Callable[[Evidence], Tables]
    # tables of the Evidence that stand beside the page as they are
    stored: tuple[str, ...] = ()
    # {name: text} of further files: of the Evidence, its claims and tables
    texts: Callable[[Evidence, Claims, Tables], Mapping[str, str]] = in_one_file
    digits: int = 3  # of the figures

    def claims(self, found: Evidence) -> list[dict[str, Any]]:
        """What was asked for, what was measured, whether it holds, as far as the runs decide."""
        return judged(self.figures(found), self.targets, self.digits)

    def write(
        self, out: File, found: Evidence, size: Sequence[str] = (), **page: Any
    ) -> list[dict[str, Any]]:
        """Write page and tables into the folder `out`; return the claims. size: sentences on how
        large the study was; page: more of `write_page`."""
        claims, tables = self.claims(found), self.tables(found)
        write_page(
            Path(out),
            self.title,
            (*self.introduction, *size),
            claims,
            {name: (None, found[name]) for name in self.stored} | dict(tables),
            texts=self.texts(found, claims, tables),
            **page,
        )
        return claims


def choices_table(
    choices: Iterable[tuple[str, str, str]], where: str = "in the paper", **texts: object
) -> pd.DataFrame:
    """What a work leaves open, as text: (what, what stands `where`, what was chosen here); `texts`
    fill what stands in braces."""
    rows = [(what, there, here.format(**texts)) for what, there, here in choices]
    return pd.DataFrame(rows, columns=["what", where, "here"])


def write_study(
    out: File,
    title: str,
    introduction: Sequence[str],
    size: str,
    claims: Sequence[Mapping[str, Any]],
    choices: pd.DataFrame,
    tables: Tables,
    figures: Sequence[tuple[str, go.Figure, str]],
    shown: Sequence[tuple[str, str, pd.DataFrame]] = (),
    notes: Sequence[tuple[str, pd.DataFrame]] = (),
    listed: Sequence[tuple[str, pd.DataFrame]] = (),
    between: Sequence[str] = (),
    work: str = "paper",
    runs: int = ENOUGH,
) -> list[dict[str, Any]]:
    """Write the page of a study, as `write_page`, and beside it findings.md for docs/; return the
    claims as they stand there.

    size: sentences on how large it was; choices: what the `work` leaves open; shown: [(name,
    heading, DataFrame of text)] for the page, a CSV each, and findings.md; notes, after them, are
    for the page alone; listed [(heading, DataFrame of text)] and lines `between` the claims and
    them are for findings.md alone. runs: of each cell; with fewer than ENOUGH the page says that it
    has no verdicts.
    """
    banner = ""
    if runs < ENOUGH:
        few = f"A quick run, {runs} of each: it shows that everything works and what the pages look"
        banner = f"{few} like. Verdicts take {ENOUGH} runs or more."
        claims = [{**claim, "verdict": TOO_FEW} for claim in claims]
    headed = [(heading, table) for _, heading, table in shown]
    write_page(
        out,
        title,
        (*introduction, size),
        claims,
        {name: (None, table) for name, _, table in shown} | dict(tables),
        figures=figures,
        notes=[*headed, (f"What the {work} leaves open, and what was chosen", choices), *notes],
        texts={"findings.md": markdown.findings(size, claims, [*headed, *listed], between, work)},
        banner=banner,
    )
    return [dict(claim) for claim in claims]
