"""What the studies of the papers share: their seeds, how far they are, and the page of a finished
one."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import pandas as pd
import plotly.graph_objects as go

from strapdown.checks import check_number
from strapdown.typing import File, Progress

from . import markdown
from .pages import TOO_FEW, write_page

Task, Result = TypeVar("Task"), TypeVar("Result")
SEED = 11
"""Of the studies of the papers: one that was used nowhere before their rules were written."""
ENOUGH = 10
"""Runs of each cell; with fewer a study shows how it works, and decides nothing."""


def seeds(quick: bool, runs: int | None, seed: int, full: int, few: int) -> list[int]:
    """The seeds of the runs: `runs` of them where that is given, else `full`, with `quick` only
    `few`. Raises DataError."""
    count = (few if quick else full) if runs is None else runs
    check_number(count, "runs", least=1, whole=True)
    check_number(seed, "seed", least=0, whole=True)
    return [1000 * seed + k for k in range(count)]


def part_of(progress: Progress | None, begin: float, end: float) -> Progress | None:
    """The Progress of a part, which is the whole from the fraction `begin` to `end`; None where
    nobody is told."""
    return (lambda done: progress(begin + done * (end - begin))) if progress else None


def on_threads(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Result]:
    """What `work` makes of each task, in their order; threads: the processors by default; progress:
    called with the fraction done."""
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        for done, result in enumerate(pool.map(work, tasks), 1):
            if progress:  # before it is handed out: nobody may come for another one
                progress(done / len(tasks))
            yield result


def write_study(
    out: File,
    title: str,
    introduction: Sequence[str],
    size: str,
    claims: Sequence[Mapping[str, Any]],
    choices: pd.DataFrame,
    tables: Mapping[str, tuple[str | None, pd.DataFrame]],
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
