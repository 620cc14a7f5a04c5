"""The first block of a page: words, reasons and remedies as text that cannot break the page."""

import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic import DOUBTFUL, TRUSTED, WRONG, flight, solution

from strapdown import report
from strapdown.data.verdict import Reason, Verdict
from strapdown.geometry.geodesy import displace_lla
from strapdown.pages.verdict_block import verdict_block

pytestmark = pytest.mark.short


def text(html):
    """What a reader reads."""
    return " ".join(re.sub("<[^>]*>", " ", html).split())


def test_it_says_word_cause_what_was_seen_and_what_to_do():
    shown = text(verdict_block({"a": WRONG}))
    assert shown.startswith("✕ Not to be trusted Something in the set-up is wrong.")
    cause, seen, remedy = map(
        shown.index, ("Probable cause: axes", "Seen The course", "To do Rotate")
    )
    assert cause < seen < remedy < shown.index("Probable cause: time stamps of gnss velocity")
    assert "a" not in shown.split()[:5] and "Not tested" not in shown  # no name, nothing untested
    trusted = text(verdict_block({"a": TRUSTED}))
    assert trusted.startswith("✓ Trusted") and trusted.endswith(
        "Not tested: heading: no turns; turn (heading depends on it)."
    )
    assert "class='verdict doubt'" in verdict_block({"a": DOUBTFUL})


def test_what_is_trusted_with_a_reason_is_so_but_for_a_part():
    shown = text(verdict_block({"a": replace(TRUSTED, reasons=WRONG.reasons[:1])}))
    assert shown.startswith("✓ Trusted Nothing that could be tested speaks against it as a whole.")
    assert "Probable cause: axes" in shown
    assert "as a whole" not in verdict_block({"a": TRUSTED})


def test_several_results_are_named_and_those_that_agree_share_a_block():
    shown = verdict_block({"a": TRUSTED, "b": WRONG, "c": TRUSTED})
    assert shown.count("class='verdict ") == 2
    assert text(shown).startswith("✕ Not to be trusted b") and "✓ Trusted a, c" in text(shown)


def test_a_reference_that_contradicts_what_is_trusted_makes_its_block_amber():
    against = {"a": ["attitude error beyond 3σ at 30 % of the times. Suspect the <reference>."]}
    shown = verdict_block({"a": TRUSTED, "b": TRUSTED}, against)
    assert "class='verdict doubt'" in shown and "class='verdict right'" in shown
    assert "Trusted, but contradicted by the reference a" in text(shown)
    assert "one of the two is wrong" in text(shown) and "&lt;reference&gt;" in shown
    grave = verdict_block({"a": WRONG}, against)
    assert "class='verdict wrong'" in grave and "Suspect the" in grave


def test_texts_are_escaped_and_what_is_quoted_is_code():
    reason = Reason("unit", "<b>5 & 6</b>", 'set `unit = "rad"`', "<i>")
    shown = verdict_block({"<u>": Verdict.of([reason]), "x": TRUSTED})
    assert "&lt;b&gt;5 &amp; 6" in shown and "<code>unit = &quot;rad&quot;</code>" in shown
    assert not {"<u>", "<i>", "<b>5"} & set(re.findall("<[^>]*>[0-9]?", shown))


def test_it_is_the_first_block_of_the_page():
    made = solution(flight(60, rate=1.0), verdict=WRONG.as_dict())
    html = report(made).html
    assert html.index("<div class='verdict wrong'") < html.index("<section")
    assert "class='verdict unknown'" in report(solution(flight(60, rate=1.0))).html


def test_a_page_says_once_and_first_that_its_reference_contradicts_it():
    """A solution 9 m beside its reference, of claims of a metre."""
    true = flight(60, rate=1.0)
    made = solution(true, verdict=TRUSTED.as_dict())
    off = np.full((len(true.t), 3), [9.0, 0.0, 0.0])
    html = report(made, replace(true, lla=displace_lla(true.lla, off))).html
    assert html.index("Trusted, but contradicted by the reference") < html.index("<section")
    assert "class='verdict doubt'" in html and html.count("position error beyond 3σ") == 1
    assert "class='verdict right'" in report(made, true).html
