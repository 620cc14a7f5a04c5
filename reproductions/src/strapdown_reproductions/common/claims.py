"""The claims of a paper as rows of a table, and the runner that makes a finding of each.

A row names what the paper says and where, the rule in words, and the parts of the claim: each says
over which cells of the evidence, the tables of finished runs, which rule decides, such as
`over(flown(LONG, TACTICAL), position, CLOSED)`.
"""

import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from .pages import UNDECIDED, Finding
from .verdicts import both

Found = TypeVar("Found")


class JudgedClaim(NamedTuple):
    """Result of one part of a claim: its verdict, and the numbers behind it."""

    verdict: str
    text: str

    def __str__(self) -> str:
        return self.text


class ClaimKind(NamedTuple):
    """A kind of claim, and the rule that decides it, in words; the kinds are in kinds.py."""

    name: str
    rule: str


class Claim(NamedTuple):
    """A row of a paper's table of claims."""

    text: str  # what the paper says
    source: str  # where
    rule: str  # in words, which decides
    # {name: what becomes of the evidence}: all must hold
    parts: Mapping[str, Callable[[Any], JudgedClaim]]
    # format string of what was measured: `parts` and `shown` by their names in braces
    measured: str
    decided_by: str  # the figure or table that shows it
    # {name: function of the evidence}: what is told beside the parts and decides nothing
    shown: Mapping[str, Callable[[Any], object]] = {}
    # text: what the evidence lacks, so that the claim cannot be judged; else ""
    lacks: Callable[[Any], str] | None = None
    # which kind of claim it is, whose rule decides; `rule` says of what
    kind: ClaimKind | None = None
    # format string like `measured`: one plain sentence, with the number that decides
    answer: str = ""
    # text where the verdict follows by algebra, whatever is measured; else ""
    identity: Callable[[Any], str] | None = None


MAX_LINE = 300
"""Characters in a line of a rule, or of what was measured, at most."""


def over(
    cells: Callable[[Any], Any], rule: Callable[..., Found], *args: object, **options: object
) -> Callable[[Any], Found]:
    """A function of the evidence: `rule(cells(evidence), *args, **options)`.

    cells: chooses the tables or rows that the rule looks at; rule: counts or judges them, or tells
    something of them.
    """
    return lambda evidence: rule(cells(evidence), *args, **options)


def judge(claim: Claim, evidence: object) -> dict[str, str]:
    """The Finding on one claim: reproduced where all its parts are, not reproduced where none
    is, partly where one is. The rule of its kind stands with the kinds."""
    undecided = Finding(
        claim.text,
        claim.source,
        kind=claim.kind.name if claim.kind else "",
        rule=in_lines(claim.rule),
        answer="",
        measured=claim.lacks(evidence) if claim.lacks else "",
        verdict=UNDECIDED,
        decided_by=claim.decided_by,
        identity="",
    )
    if undecided.measured:
        return undecided._asdict()
    parts = {name: part(evidence) for name, part in claim.parts.items()}
    told = parts | {name: show(evidence) for name, show in claim.shown.items()}
    return undecided._replace(
        answer=claim.answer.format(**told),
        measured=in_lines(claim.measured.format(**told)),
        verdict=both(*(part.verdict for part in parts.values())),
        identity=claim.identity(evidence) if claim.identity else "",
    )._asdict()


def in_lines(text: str) -> str:
    """The text in lines of MAX_LINE characters at most, cut behind sentences and semicolons where
    that is possible."""
    lines: list[str] = []
    for whole in text.splitlines():
        lines.append("")
        for part in re.split(r"(?<=[.;]) ", whole):
            for piece in textwrap.wrap(part, MAX_LINE) or [""]:
                if lines[-1] and len(lines[-1]) + 1 + len(piece) > MAX_LINE:
                    lines.append("")
                lines[-1] = f"{lines[-1]} {piece}".strip()
    return "\n".join(lines)


def verdict_of(claim: Claim, evidence: object) -> str:
    """The verdict on one claim alone."""
    if claim.lacks and claim.lacks(evidence):
        return UNDECIDED
    return both(*(part(evidence).verdict for part in claim.parts.values()))


def findings(claims: Iterable[Claim], evidence: object) -> list[dict[str, str]]:
    """The findings on all claims, in their order."""
    return [judge(claim, evidence) for claim in claims]
