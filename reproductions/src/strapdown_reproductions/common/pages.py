"""Output of every reproduction: claims.json, CSV tables and an index.html that shows them, with
figures where it has some."""

import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from strapdown.fileio.files import replacing, together, write_table
from strapdown.pages.shell import Document, Page as HtmlPage, figure_html, shell
from strapdown.typing import File
from strapdown.units.wording import count_text

from .tables import Tables

Claims: TypeAlias = Sequence[Mapping[str, Any]]
Figure: TypeAlias = tuple[str, go.Figure, str]
"""Heading, figure, caption."""
REPRODUCED, PARTLY, DEPENDS, NOT_REPRODUCED, UNDECIDED, TOO_FEW = (
    "reproduced",
    "partly",
    "depends on the reading",
    "not reproduced",
    "not decidable here",
    "too few runs",
)
"""Verdicts on what somebody else has claimed; TOO_FEW stands for all of them on the page of a
run that is too small for any."""
COLOURS = {
    REPRODUCED: "yes",
    PARTLY: "half",
    DEPENDS: "half",
    NOT_REPRODUCED: "no",
    UNDECIDED: "open",
    TOO_FEW: "open",
}
FOOTER = "All figures and verdicts on this page were computed by the command that wrote it; the numbers are in the CSV files beside it."
STYLE = """.yes{color:#17692d}.no{color:#a11}.half{color:#8a5a00}.open{color:var(--soft)}
.claims td,.claims th,.text td,.text th{white-space:normal;text-align:left;vertical-align:top}
.claims td:nth-child(2){min-width:15rem}.claims .verdict{min-width:7.5rem;font-weight:600}
.claims td:last-child{min-width:6rem}
.plain td,.plain th{text-align:left;vertical-align:top}.plain td:first-child{white-space:normal;min-width:16rem}
.text td{min-width:6rem}thead th{white-space:normal;min-width:4.2rem;vertical-align:bottom}main a{color:var(--accent)}
caption{text-align:left;color:var(--soft);padding:.3rem 0;max-width:95ch}.slim{font-size:13.5px;color:var(--soft)}
.banner{border:2px solid #b8860b;background:#fff6da;color:#3d2e00;padding:.6rem .9rem;font-weight:600}
@media(prefers-color-scheme:dark){.yes{color:#7cd992}.no{color:#ff8d85}.half{color:#f0c060}.banner{background:#3a2f10;color:#ffe6a0}}"""


class Finding(NamedTuple):
    """A claim of a paper and what became of it; as a dict in claims.json and on pages."""

    claim: str
    source: str  # where it stands in the paper
    kind: str  # of the claim, "" where it has none
    rule: str  # that decides
    answer: str  # what was found in one sentence
    measured: str
    verdict: str
    decided_by: str  # the figure or table that shows it
    identity: str  # by what algebra the verdict holds whatever is measured, "" where by none
    # how the readings of what the paper leaves open vote, "" where there is one reading
    votes: str = ""


class ReproductionPage(NamedTuple):
    """A page of results with the files beside it, before they are written."""

    title: str
    introduction: Sequence[str]
    claims: Claims  # of targets.judge_targets, or Findings
    # {name: (caption, DataFrame)}; one whose caption is None has its CSV alone
    tables: Tables
    links: Sequence[tuple[str, str]] = ()  # (text, file beside the page)
    # (heading, figure of reports.drawing, caption)
    figures: Sequence[Figure] = ()
    notes: Sequence[tuple[str, pd.DataFrame]] = ()  # (heading, DataFrame of text)
    texts: Mapping[str, str] = {}  # {name: text} of more files
    banner: str = ""  # what must not be overlooked


def counts(claims: Claims) -> str:
    """Text: how many claims there are of each verdict; those that hold by algebra apart."""
    free = [c["verdict"] for c in claims if not c["identity"]]
    found = [f"{free.count(verdict)} {verdict}" for verdict in COLOURS if verdict in free]
    same = len(claims) - len(free)
    found += [f"{same} decided by algebra alone"] * bool(same)
    return f"{len(claims)} claims: {', '.join(found)}"


def write_page(out: File, page: ReproductionPage) -> None:
    """Write claims.json, one CSV per table, index.html and the further texts of a ReproductionPage into the
    folder `out`, all or none."""
    said = "".join(f"<p>{_mark_code(text)}</p>" for text in page.introduction)
    if page.banner:
        said = f"<p class=banner role=note>{_mark_code(page.banner)}</p>{said}"
    write_files(out, page, said, [(heading, text) for heading, text in _sections(page) if text])


def write_files(
    out: File, page: ReproductionPage, said: str, sections: Sequence[tuple[str, str]]
) -> None:
    """Write the same with an index.html of the HTML `said` and [(heading, HTML)]."""
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    as_json = json.dumps(page.claims, indent=1, ensure_ascii=False) + "\n"
    with together():
        for name, text in {"claims.json": as_json, **page.texts}.items():
            with replacing(out / name) as part:
                part.write_text(text, encoding="utf-8")
        for name, (_, table) in page.tables.items():
            write_table(table, out / f"{name}.csv", 6)
        document = Document(
            page.title, {}, FOOTER, _headline(page.claims), said, STYLE, sections=sections
        )
        HtmlPage(shell(document)).save(out / "index.html")


def _headline(claims: Claims) -> str:
    """The number of claims of each verdict, or of targets met."""
    if not claims:
        return ""
    if "verdict" in claims[0]:
        return f"{counts(claims)}."
    return f"{sum(bool(c['holds']) for c in claims)} of {count_text(len(claims), 'target')} met."


def _mark_code(text: str) -> str:
    """Return the text as HTML, with the parts between backticks as code."""
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))


def _sections(page: ReproductionPage) -> list[tuple[str, str]]:
    """[(heading, HTML)] of the page; empty where there is nothing."""
    shown = {
        name: (caption, table)
        for name, (caption, table) in page.tables.items()
        if caption is not None
    }
    of_paper = bool(page.claims) and "verdict" in page.claims[0]
    return [
        ("Claims", claims_table(page.claims) if of_paper else _claims(page.claims)),
        (
            "Figures",
            "".join(
                figure_html(i, drawn, heading, caption)
                for i, (heading, drawn, caption) in enumerate(page.figures, 1)
            ),
        ),
        (
            "Tables",
            "".join(
                f"<div class=scroll><table><caption>{escape(caption)} (<a "
                f"href='{name}.csv'>CSV</a>)</caption>{_rows(table)}</table></div>"
                for name, (caption, table) in shown.items()
            ),
        ),
        *(
            (heading, f"<div class='scroll text'><table>{_rows(table)}</table></div>")
            for heading, table in page.notes
        ),
        (
            "Reports",
            "<ul>"
            + "".join(
                f"<li><a href='{escape(path)}'>{escape(text)}</a></li>" for text, path in page.links
            )
            + "</ul>"
            if page.links
            else "",
        ),
    ]


def _claims(claims: Claims) -> str:
    verdict = lambda holds: (
        f"<td class='{'yes' if holds else 'no'}'>{'holds' if holds else 'does not hold'}</td>"
    )
    rows = "".join(
        f"<tr><td>{escape(c['claim'])}</td><td>{escape(c['target'])}</td><td>{escape(c['figure'])}</td>{verdict(c['holds'])}</tr>"
        for c in claims
    )
    return f"<div class='scroll plain'><table><tr><th>claim</th><th>target</th><th>measured</th><th>verdict</th></tr>{rows}</table></div>"


def claims_table(claims: Claims) -> str:
    """HTML: findings with their verdicts, counted."""
    rows = "".join(
        f"<tr id=claim{i}><td>{i}</td><td>{escape(c['claim'])}<br><span "
        f"class=slim>{escape(c['source'])}</span></td>"
        f"<td class='verdict {COLOURS[c['verdict']]}'>{escape(c['verdict'])}</td>"
        f"<td>{_answer(c)}</td><td>{escape(c['decided_by'])}</td></tr>"
        for i, c in enumerate(claims, 1)
    )
    head = "<thead><tr><th></th><th>the paper says</th><th>verdict</th><th>what was found</th><th>see</th></tr></thead>"
    return f"<p>{counts(claims)}.</p><div class='scroll claims'><table>{head}{rows}</table></div>"


def _answer(c: Mapping[str, Any]) -> str:
    """HTML: one sentence, and folded behind it the rule and what was measured."""
    identity = f"<br><span class=slim>By algebra: {escape(c['identity'])}</span>"
    kind = f"Kind of claim: {escape(c['kind'])}. " * bool(c["kind"])
    votes = f"<br>{escape(c['votes'])}" * bool(c["votes"])
    lines = lambda text: escape(text).replace("\n", "<br>")
    return (
        f"{escape(c['answer'])}{votes}{identity * bool(c['identity'])}"
        f"<details{' open' * (not c['answer'])}><summary>rule and numbers</summary>"
        f"{lines(c['measured'])}<br><span class=slim>{kind}Rule: {lines(c['rule'])}</span>"
        "</details>"
    )


def found_text(c: Mapping[str, Any]) -> str:
    """Text: what was found on a claim, with the votes of its readings."""
    return " ".join(filter(None, (c["answer"] or c["measured"], c["votes"])))


def _rows(table: pd.DataFrame) -> str:
    head = "".join(f"<th>{escape(str(name))}</th>" for name in table.columns)
    rows = (
        "<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>"
        for row in table.itertuples(index=False)
    )
    return f"<thead><tr>{head}</tr></thead>{''.join(rows)}"


def _cell(value: object) -> str:
    if not isinstance(value, (float, np.floating)):
        return escape(str(value)).replace("\n", "<br>")
    return "–" if np.isnan(value) else f"{value:.3g}"
