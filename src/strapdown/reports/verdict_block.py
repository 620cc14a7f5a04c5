"""The first block of a page: whether to trust what it shows, why, and what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape

from ..verdict import (
    DOUBTFUL,
    NOT_JUDGED,
    NOT_TO_BE_TRUSTED,
    TRUSTED,
    Reason,
    Verdict,
    together,
)

LOOKS = {
    TRUSTED: ("right", "✓", "Nothing that could be tested speaks against it."),
    DOUBTFUL: (
        "doubt",
        "!",
        "Something does not look like a right set-up. Check it before you rely on this.",
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
    "Nothing that could be tested speaks against it as a whole. Of a part, this is to be said."
)
"""What "trusted" means where there are reasons."""


def verdict_block(verdicts: Mapping[str, Verdict]) -> str:
    """HTML of the verdict on each of {name: result}, the gravest first; results that agree share
    theirs. Names are shown where there are several."""
    groups = together(verdicts)
    return "".join(
        _block(verdict, ", ".join(names) if len(verdicts) > 1 else "") for names, verdict in groups
    )


def _block(verdict: Verdict, names: str) -> str:
    look, mark, meaning = LOOKS[verdict.word]
    if verdict.word == TRUSTED and verdict.reasons:
        meaning = OF_A_PART
    whose = f"<span class=whose>{escape(names)}</span>" if names else ""
    reasons = "".join(f"<li>{_reason(reason)}</li>" for reason in verdict.reasons)
    untested = f"Not tested: {'; '.join(verdict.untested)}." if verdict.untested else ""
    return (
        f"<div class='verdict {look}' role=note><p class=word><i aria-hidden=true>{mark}</i>"
        f"<strong>{escape(_begun(verdict.word))}</strong>{whose}</p><p>{meaning}</p>"
        + (f"<ol>{reasons}</ol>" if reasons else "")
        + (f"<p class=untested>{_text(untested)}</p>" if untested else "")
        + "</div>"
    )


def _reason(reason: Reason) -> str:
    lines = (("Seen", reason.seen), ("To do", reason.remedy))
    said = "".join(
        f"<p><span>{name}</span><span>{_text(_begun(text))}.</span></p>" for name, text in lines
    )
    return f"<h3>Probable cause: {escape(reason.what)}</h3>{said}"


def _begun(text: str) -> str:
    """The text with a capital, where it does not begin with something quoted."""
    return text[:1].upper() + text[1:]


def _text(text: str) -> str:
    """Escaped, with what stands between backticks as code."""
    return re.sub("`([^`]*)`", r"<code>\1</code>", escape(text))
