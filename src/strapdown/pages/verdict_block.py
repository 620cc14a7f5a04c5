"""The first block of a page: whether to trust what it shows, why, and what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape

from ..data.verdict import (
    DOUBTFUL,
    NOT_JUDGED,
    NOT_TO_BE_TRUSTED,
    SEVERITY,
    TRUSTED,
    Reason,
    Verdict,
    together,
)
from ..units.wording import capitalise, count_text
from .parts import Html, fold, paragraphs, remarks

LOOKS = {
    TRUSTED: ("right", "✓", "Nothing that could be tested speaks against it."),
    DOUBTFUL: (
        "doubt",
        "!",
        "Something looks different from a correct set-up. Check it before you rely on this.",
    ),
    NOT_TO_BE_TRUSTED: (
        "wrong",
        "✕",
        "Something in the set-up is wrong. Correct it and run again.",
    ),
    NOT_JUDGED: ("unknown", "?", "Nothing tells whether to trust it."),
}
"""{word: its class in page.css, its mark, what it means}."""
OF_A_PART = (
    "Nothing that could be tested speaks against it as a whole. One part of the run has a problem:"
)
"""Meaning of "trusted" where there are reasons."""


CONTRADICTED = (
    "The recording itself shows nothing wrong, but the reference contradicts what is claimed: one of the "
    "two is wrong."
)
"""Meaning of "trusted" where a reference says otherwise."""


def verdict_block(
    verdicts: Mapping[str, Verdict], contradicted: Mapping[str, Sequence[str]] = {}
) -> str:
    """HTML of the verdict on each of {name: result}, the gravest first; results that agree share
    theirs. Names are shown where there are several. contradicted: {name: sentences on how a
    reference contradicts what it claims}."""
    apart = [
        {name: each for name, each in verdicts.items() if (name in contradicted) == known}
        for known in (True, False)
    ]
    groups = sorted(
        (group for part in apart for group in together(part)),
        key=lambda group: SEVERITY.index(group[1].word),
    )
    return "".join(
        _block(
            verdict,
            ", ".join(names) if len(verdicts) > 1 else "",
            {name: contradicted[name] for name in names if name in contradicted},
        )
        for names, verdict in groups
    )


def verdict_text(verdict: Verdict, contradicted: bool) -> str:
    """The word of a verdict, with what a reference says of it."""
    said = ", but contradicted by the reference" if contradicted and verdict.trusted else ""
    return capitalise(verdict.word) + said


def _block(verdict: Verdict, names: str, contradicted: Mapping[str, Sequence[str]]) -> str:
    look, mark, meaning = LOOKS[verdict.word]
    if verdict.trusted and contradicted:
        look, mark, meaning = *LOOKS[DOUBTFUL][:2], CONTRADICTED
    elif verdict.trusted and verdict.reasons:
        meaning = OF_A_PART
    whose = f"<span class=whose>{escape(names)}</span>" if names else ""
    word = f"<strong>{escape(verdict_text(verdict, bool(contradicted)))}</strong>{whose}"
    gravest, others = verdict.reasons[:1], verdict.reasons[1:]
    return judgement_html(
        look,
        mark,
        word,
        paragraphs([meaning]),
        *map(_reason, gravest),
        fold(
            f"{count_text(len(others), 'further probable cause')}, less grave",
            *map(_reason, others),
        ),
        fold(
            "What the reference contradicts",
            remarks(f"{name}: {text}" for name, texts in contradicted.items() for text in texts),
        ),
        fold("What was not tested", paragraphs(map(_text, _limits(verdict)), "untested")),
    )


def _limits(verdict: Verdict) -> list[str]:
    """Lines on what could not be tested, first what most rests on, and what smaller errors would not show."""
    lines = [f"Not tested: {each.line}." for each in verdict.untested]
    if verdict.bounds:
        lines.append(
            f"Errors of the set-up below these would not have shown: {verdict.bounds_line}."
        )
    return lines


def judgement_html(look: str, mark: str, word: str, *parts: str) -> str:
    """HTML of a judgement: its class in page.css, its mark, its word and parts below, HTML."""
    head = f"<p class=word><i aria-hidden=true>{mark}</i>{word}</p>"
    return f"<div class='verdict {look}' role=note>{head}{''.join(parts)}</div>"


def _reason(reason: Reason) -> str:
    lines = (("Seen", reason.seen), ("To do", reason.remedy))
    said = "".join(
        f"<p><span>{name}</span><span>{_text(capitalise(text))}.</span></p>" for name, text in lines
    )
    return f"<div class=reason><h3>Probable cause: {escape(reason.what)}</h3>{said}</div>"


def _text(text: str) -> Html:
    """Escaped, with what stands between backticks as code."""
    return Html(re.sub("`([^`]*)`", r"<code>\1</code>", escape(text)))
