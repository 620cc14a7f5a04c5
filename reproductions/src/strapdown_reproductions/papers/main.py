"""The four papers in one go: each study into a folder of its own, and one table of all claims.

Two such runs show the effect of another seed on the verdicts:

    python -m strapdown_reproductions.papers.main OUT OTHER

writes seeds.md into the folder OUT.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pandas as pd

from strapdown.fileio.files import replacing
from strapdown.typing import File

from ..alam import main as alam
from ..common.kinds import KINDS
from ..common.markdown import plain, table
from ..common.pages import ReproductionPage, claims_table, counts, found_text, write_files
from ..common.reproduction import Asked, reproduction
from ..common.runner import part_of
from ..fossen import main as fossen
from ..hager_bryne import main as hager_bryne
from ..mollaei import main as mollaei


class Paper(NamedTuple):
    """A paper, the page of docs/ on it, its study with the share of the time that it takes, and
    what that takes beside seed and progress."""

    authors: str
    page: str
    study: ModuleType
    share: float
    options: tuple[str, ...] = ()


PAPERS = {
    "hager-bryne": Paper(
        "Hager & Bryne", "open-or-closed-loop.md", hager_bryne, 0.25, ("ablations", "notify")
    ),
    "fossen": Paper("Fossen, chapter 14", "fossen.md", fossen, 0.15),
    "alam": Paper("Alam et al.", "alam.md", alam, 0.2, ("recordings", "notify")),
    "mollaei": Paper("Mollaei et al.", "mollaei.md", mollaei, 0.4),
}
INTRODUCTION = (
    "<p>What four papers claim, and what became of it here: the verdict, and the number that "
    "decides. A paper's own page has the rule of each claim and the numbers behind it.</p>"
)


@reproduction("quick", "seed", "recordings", "notify", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run the studies of all papers into folders of `out`, write the table of all claims, return
    the claims; the full study of Hager & Bryne is run with its ablations. Raises DataError."""
    given = asked._replace(ablations=not asked.quick)
    found, done = dict[str, list[dict[str, Any]]](), 0.0
    for name, paper in PAPERS.items():
        found[name] = paper.study.reproduce(
            out / name,
            quick=asked.quick,
            seed=asked.seed,
            progress=part_of(asked.progress, done, done + paper.share),
            **{option: getattr(given, option) for option in paper.options},
        )
        done += paper.share
    return write(out, found)


def write(out: File, found: Mapping[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Write index.html, claims.csv, claims.json and claims.md of {name: claims} into the folder
    `out`; return all claims."""
    claims = [{"paper": name} | claim for name, own in found.items() for claim in own]
    sections = [
        (
            PAPERS[name].authors,
            f"<p><a href='{name}/index.html'>The study with its figures</a></p>{claims_table(own)}",
        )
        for name, own in found.items()
    ]
    page = ReproductionPage(
        "The claims of four papers",
        (),
        claims,
        {"claims": (None, pd.DataFrame(claims))},
        texts={"claims.md": markdown_of(found)},
    )
    write_files(out, page, INTRODUCTION, sections)
    return claims


def markdown_of(found: Mapping[str, list[dict[str, Any]]]) -> str:
    """Text for docs/: the rules by kind, then the claims of each paper."""
    rules = pd.DataFrame([(kind.name, kind.rule) for kind in KINDS], columns=["kind", "rule"])
    return "\n\n".join([table(rules, plain), *map(section, found, found.values())]) + "\n"


def section(name: str, own: list[dict[str, Any]]) -> str:
    """Text for docs/: the claims of one paper under its heading."""
    rows = pd.DataFrame(
        [
            (i, c["claim"], c["kind"], f"**{c['verdict']}**", found_text(c))
            for i, c in enumerate(own, 1)
        ],
        columns=["", "the paper says", "kind", "verdict", "what was found"],
    )
    said = f"{counts(own)}. [Its page]({PAPERS[name].page})."
    parts = [f"## {PAPERS[name].authors}", said, table(rows, lambda value: plain(str(value)))]
    return "\n\n".join(parts)


def seeds(own: list[dict[str, Any]], other: list[dict[str, Any]]) -> str:
    """Markdown: the verdicts of claims.json of two runs that differ, and how many there are."""
    pairs = [(a, b) for a, b in zip(own, other, strict=True) if a["verdict"] != b["verdict"]]
    rows = pd.DataFrame(
        [(PAPERS[a["paper"]].authors, a["claim"], a["verdict"], b["verdict"]) for a, b in pairs],
        columns=["paper", "claim", "verdict", "with the other seed"],
    )
    said = f"Of {len(own)} verdicts {len(pairs)} change with the seed alone."
    return f"{said}\n" + f"\n{table(rows, plain)}\n" * bool(pairs)


def main(out: str, other: str) -> None:
    """Write seeds.md of two finished runs into the folder of the first."""
    own, before = (
        json.loads((Path(each) / "claims.json").read_text(encoding="utf-8"))
        for each in (out, other)
    )
    with replacing(Path(out) / "seeds.md") as part:
        part.write_text(seeds(own, before), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
