"""The page of all measured figures:

    python docs/_site/figure_pages.py

writes the tables of docs/reference/figures.md from benchmarks/result.json and, for the verdicts on
papers, from docs/reference/evidence/claims.md.
"""

import re
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import doc_marks as marks
from doc_pages import DOCS, ROOT

from strapdown_reproductions.common import markdown

sys.path.append(str(ROOT / "benchmarks"))
import figures

PAGE = DOCS / "reference" / "figures.md"
CLAIMS = DOCS / "reference" / "evidence" / "claims.md"
COMMAND = "python docs/_site/figure_pages.py"
NAME = "figures"
HEAD = ["| figure | measured | target | | note |", "|---|---|---|---|---|"]


def measured_on(about: Mapping[str, Any]) -> str:
    """Sentences on commit, date and machine of a result."""
    machine = about["machine"]
    changed = " with changes that were not committed" * about["changed"]
    return (
        f"`make bench` measured them on {about['date']} at commit "
        f"`{about['commit'][:8] or 'unknown'}`{changed}: {machine['processor']}, {machine['cores']} cores, "
        f"load {machine['load']} at the start, {machine['system']}, Python {machine['python']}, "
        f"numpy {machine['numpy']}, scipy {machine['scipy']}, numba {machine['numba']}."
    )


def linked(note: str) -> str:
    """A note as Markdown; the pages that it names are links."""
    return re.sub(r"docs/(\S+\.md)", r"[\1](../\1)", markdown.plain(note))


def row(figure: figures.Figure) -> str:
    """A figure as a row of its table; a missed target is bold."""
    judged = {True: "holds", False: "**missed**", None: ""}[figure.holds]
    name, value, target = map(markdown.plain, (figure.name, figure.measured(), figure.wanted()))
    return f"| {name} | {value} | {target} | {judged} | {linked(figure.note)} |"


def summary(about: Mapping[str, Any], found: Iterable[figures.Figure]) -> list[str]:
    """Lines: how many targets hold, which are missed, how many were not measured and why parts ended
    early."""
    judged = [figure for figure in found if figure.target is not None]
    missed = [figure.name for figure in judged if figure.value is not None and not figure.holds]
    unknown = sum(figure.value is None for figure in judged)
    holding = len(judged) - len(missed) - unknown
    lines = [f"{holding} of {len(judged)} targets hold, {unknown} were not measured."]
    lines[0] += f" Missed: {'; '.join(missed)}." * bool(missed)
    early = "; ".join(f"{part}: {why}" for part, why in about["broken"].items())
    return [*lines, "", f"Incomplete: {markdown.plain(early)}."] if early else lines


def papers() -> list[str]:
    """Lines of the table of verdicts on the claims of papers."""
    text = CLAIMS.read_text(encoding="utf-8")
    found = re.findall(r"^## (.+)\n\n(\d+) claims: ([^.]+)\.", text, re.MULTILINE)
    if not found:
        raise ValueError(f"{CLAIMS}: counts no claims; run `strapdown reproduce papers`")
    head = ["| paper | claims | verdicts |", "|---|---|---|"]
    return [*head, *(f"| {paper} | {count} | {said} |" for paper, count, said in found)]


def tables() -> str:
    """The text between the marks of the page. Raises ValueError where there is no result."""
    about, found = figures.read()
    lines = [measured_on(about), "", *summary(about, found)]
    for part in about["parts"]:
        own = [row(figure) for figure in found if figure.part == part["name"]]
        lines += ["", f"## {part['title']}", "", *HEAD, *own] if own else []
    if other := [row(figure) for figure in found if not figure.part]:
        lines += ["", "## Not measured", "", *HEAD, *other]
    lines += ["", "## Verdicts on the claims of papers", ""]
    lines += ["`strapdown reproduce papers` decided [all claims](evidence/claims.md).", ""]
    return "\n".join([*lines, *papers(), ""])


def written() -> str:
    """The page as it should be."""
    return marks.filled(PAGE.read_text(encoding="utf-8"), NAME, COMMAND, tables())


def stale() -> list[str]:
    """Lines where the page is not what the command writes, and where the result does not have the
    figures of today's targets."""
    try:
        about, found = figures.read()
        should = written()
    except ValueError as error:
        return [str(error)]
    lines = [
        f"{figures.RESULT.relative_to(ROOT)}: {line}; run `make bench`"
        for line in figures.apart(found, figures.targets())
    ]
    if should != PAGE.read_text(encoding="utf-8"):
        lines.append(f"{PAGE.relative_to(ROOT)}: is not what `{COMMAND}` writes; run it")
    return lines


def main() -> None:
    """Write it."""
    try:
        PAGE.write_text(written(), encoding="utf-8")
    except ValueError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
