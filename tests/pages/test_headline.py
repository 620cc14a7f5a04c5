"""The sentence at the top of a report says the numbers, and says nothing where nothing is known."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import flight, solution

from strapdown import report
from strapdown.evaluation import metrics
from strapdown.pages.headline import headline, key_figures
from strapdown.units.wording import number

pytestmark = pytest.mark.short
TRUTH = flight(300, rate=2.0)
ONE, FAR = solution(TRUTH), solution(TRUTH, seed=2, drift=0.05, name="open-loop")
SCORES = {name: metrics.errors(made, TRUTH) for name, made in (("one", ONE), ("far", FAR))}


def rms(name, window=None):
    e = SCORES[name]
    return number(float(np.sqrt(np.mean(e.horizontal[e.inside(window)] ** 2))))


def test_one_solution_is_said_beside_its_claim():
    said = headline({"one": ONE}, {"one": SCORES["one"]})
    assert said.startswith(f"RMS error of one: {rms('one')} m horizontal and ")
    assert "; it claims " in said and said.endswith("deg heading.")
    window = (100.0, 200.0)
    assert f"{rms('one', window)} m" in headline({"one": ONE}, SCORES, window)


def test_of_several_the_smallest_comes_first_and_like_ones_are_alike():
    both = {"far": FAR, "one": ONE}
    expected = f"Smallest horizontal error: one, {rms('one')} m RMS; far {rms('far')} m."
    assert headline(both, SCORES) == expected
    same = {"a": ONE, "b": ONE}
    assert "are alike" in headline(same, {name: SCORES["one"] for name in same})


def test_without_a_reference_it_says_what_is_claimed_and_that_nothing_checks_it():
    said = headline({"one": ONE}, {})
    assert said.startswith("one claims errors of ") and said.endswith(
        "There is no reference to check that against."
    )
    silent = replace(
        ONE, trajectory=replace(ONE.trajectory, std=np.full_like(ONE.trajectory.std, np.nan))
    )
    assert headline({"one": silent}, {}).startswith("Neither errors nor standard deviations")
    assert key_figures(silent, None) == []


def test_it_stands_above_the_first_figure_and_the_tables_below_are_folded():
    html = report(ONE, TRUTH).html
    first = html.index("<figure>")
    assert html.index("<p class=headline>") < html.index("class='verdict") < first
    assert html.index("<div class=cards>") < first < html.index("<table>")
    assert "<details class=fold><summary>Errors by axis" in html
    assert "<details class=fold open" not in html
