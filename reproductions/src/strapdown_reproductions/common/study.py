"""The page of a finished study: of one whose figures are held against targets, and of one that
decides the claims of a paper."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from strapdown.typing import File

from . import markdown
from .kinds import KINDS
from .pages import TOO_FEW, Claims, Figure, ReproductionPage, write_page
from .runner import ENOUGH, StudyTables
from .tables import Tables
from .targets import Target, in_docs, judge_targets
from .verdicts import without_verdicts


def in_one_file(found: StudyTables, claims: Claims, tables: Tables) -> dict[str, str]:
    """{name: text} of the one file for docs/: figures and all tables, numbers with three digits."""
    return {"table.md": in_docs(claims, tables)}


def held_against(
    targets: Mapping[str, Target],
    figures: Callable[[StudyTables], Mapping[str, float]],
    digits: int = 3,
) -> Callable[[StudyTables], list[dict[str, Any]]]:
    """Return a function of the StudyTables that judges `figures` {name of a target: figure} as
    claims, with `digits` digits; NaN decides nothing."""
    return lambda found: judge_targets(figures(found), targets, digits)


class ReproducedStudy(NamedTuple):
    """A study whose figures are held against bounds: its sentences, and its measures of what its
    runs have left, mostly Evidence."""

    title: str
    introduction: tuple[str, ...]
    # what was asked for, what was measured, whether it holds, as far as the runs decide
    claims: Callable[[Any], list[dict[str, Any]]]
    tables: Callable[[Any], Tables]
    # tables of the Evidence that stand beside the page as they are
    stored: tuple[str, ...] = ()
    # {name: text} of further files: of what was found, its claims and tables
    texts: Callable[[Any, Claims, Tables], Mapping[str, str]] = in_one_file

    def write(
        self, out: File, found: Any, size: Sequence[str] = (), **page: Any
    ) -> list[dict[str, Any]]:
        """Write page and tables into the folder `out`; return the claims. size: sentences on how
        large the study was; page: more of the ReproductionPage."""
        claims, tables = self.claims(found), self.tables(found)
        made = ReproductionPage(
            self.title,
            (*self.introduction, *size),
            claims,
            {name: (None, found[name]) for name in self.stored} | dict(tables),
            texts=self.texts(found, claims, tables),
        )
        write_page(out, made._replace(**page))
        return claims


def choices_table(
    choices: Iterable[tuple[str, str, str]], where: str = "in the paper", **texts: object
) -> pd.DataFrame:
    """Return the points that a work leaves open as a table of text: (what, what stands `where`,
    what was chosen here). `texts` fill the fields in braces."""
    rows = [(what, there, here.format(**texts)) for what, there, here in choices]
    return pd.DataFrame(rows, columns=["what", where, "here"])


class StudyWork(NamedTuple):
    """A published work that is studied again."""

    title: str  # of the page
    introduction: Sequence[str]
    kind: str = "paper"


class Outcome(NamedTuple):
    """Results of the runs of a study of a Work."""

    size: str  # sentences on how large the study was
    claims: Claims  # Findings
    choices: pd.DataFrame  # what the work leaves open, see `choices_table`
    tables: Tables
    figures: Sequence[Figure]
    # (name, heading, DataFrame of text): for the page, a CSV each, and findings.md
    shown: Sequence[tuple[str, str, pd.DataFrame]] = ()
    # (heading, DataFrame of text) after them, for the page alone
    notes: Sequence[tuple[str, pd.DataFrame]] = ()
    # the same for findings.md alone, and lines between the claims and the tables there
    listed: Sequence[tuple[str, pd.DataFrame]] = ()
    between: Sequence[str] = ()
    runs: int = ENOUGH  # of each cell; with fewer than ENOUGH the page has no verdicts
    # {name: text} of more files, of the claims as they stand on the page
    texts: Callable[[Claims], Mapping[str, str]] = lambda claims: {}


def _strip_verdict(claim: Mapping[str, Any]) -> dict[str, Any]:
    """The Finding without its verdict and the words of any other."""
    told = ("answer", "measured", "rule", "identity")
    return {
        **claim,
        **{name: without_verdicts(claim[name]) for name in told},
        "votes": "",
        "verdict": TOO_FEW,
    }


def write_study(out: File, work: StudyWork, found: Outcome) -> list[dict[str, Any]]:
    """Write the page of the study of a StudyWork, and beside it findings.md for docs/, into the folder
    `out`; return the claims as they stand there."""
    banner, claims, introduction = "", found.claims, work.introduction
    kinds = [(kind.name, kind.rule) for kind in KINDS if kind.name in {c["kind"] for c in claims}]
    rules = [("The rule of each kind of claim", pd.DataFrame(kinds, columns=["kind", "rule"]))]
    if found.runs < ENOUGH:
        banner = (
            f"A quick run, {found.runs} of each: it shows that everything works and what the pages "
            f"look like. Verdicts take {ENOUGH} runs or more."
        )
        claims = [_strip_verdict(claim) for claim in claims]
        introduction, rules = list(filter(None, map(without_verdicts, introduction))), []
    headed = [(heading, table) for _, heading, table in found.shown]
    open_questions = f"What the {work.kind} leaves open, and what was chosen"
    text = markdown.findings(found.size, claims, [*headed, *found.listed], found.between, work.kind)
    page = ReproductionPage(
        work.title,
        (*introduction, found.size),
        claims,
        {name: (None, table) for name, _, table in found.shown} | dict(found.tables),
        figures=found.figures,
        notes=[*rules, *headed, (open_questions, found.choices), *found.notes],
        texts={"findings.md": text, **found.texts(claims)},
        banner=banner,
    )
    write_page(out, page)
    return [dict(claim) for claim in claims]
