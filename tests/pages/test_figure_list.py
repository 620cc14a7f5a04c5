"""Figures that a user adds to the page: drawn where they belong, refused in a line where they are
none, and never the loss of the page."""

import re

import plotly.graph_objects as go
import pytest
from synthetic import flight, solution
from typer.testing import CliRunner

from strapdown import plugins, report
from strapdown.checks import DataError
from strapdown.pages import figure_list
from strapdown.pages.figure_list import FIGURES, Figure

pytestmark = pytest.mark.short
TRUTH = flight(60, rate=2.0)
SOLUTION = solution(TRUTH)
OTHER = solution(TRUTH, seed=2, name="open-loop")


def add(figure):
    figure_list.REGISTRY.add(figure, __name__)


@pytest.fixture(autouse=True)
def as_before(monkeypatch):
    monkeypatch.setattr(plugins, "_plugins", {})


def drawn(made, reference):
    """A figure as a user draws it, without anything of strapdown in it."""
    return go.Figure(go.Scatter(x=made.t, y=made.trajectory.lla[:, 2], name="mine"))


def headings(page):
    return re.findall(r"<h2>([^<]*)</h2>", page.html)


def test_an_added_figure_is_on_the_page_for_each_solution_with_its_caption():
    add(Figure("mine", "My own <height>", drawn, "What I see in it."))
    page = report([SOLUTION, OTHER], TRUTH)
    assert headings(page)[-2:] == ["More figures", "Details"] and not page.notes
    own = page.html.partition("<h2>More figures</h2>")[2].partition("</section>")[0]
    assert own.count("My own &lt;height&gt;") == own.count("What I see in it.") == 2
    assert own.count("<div class=plot") == 2 and "open-loop" in own and "height:450px" in own


def test_a_figure_may_stand_under_a_heading_of_the_page_and_take_what_it_knows():
    seen = []

    def draw(made, reference, **given):
        seen.append((reference, given))
        return None

    add(Figure("mine", "Mine", draw, section="Errors", takes=figure_list.TAKES))
    page = report(SOLUTION, TRUTH, window=(10.0, 50.0))
    ((reference, given),) = seen
    assert reference is TRUTH and given["window"] == (10.0, 50.0) and given["colour"][0] == "#"
    assert list(given["scores"].values()) == [given["errors"]] and len(given["errors"].t)
    assert "Mine" not in page.html and "More figures" not in headings(page)
    report(SOLUTION)
    assert seen[1][0] is None and seen[1][1]["errors"] is None


def test_one_figure_of_all_solutions_is_drawn_once():
    add(Figure("mine", "All", lambda all, reference: go.Figure(), together=True))
    assert report({"a": SOLUTION, "b": OTHER}).html.count("<h3>All</h3>") == 1


@pytest.mark.parametrize(
    "draw, says",
    [
        (
            lambda made, reference: 1 / 0,
            "figure 'mine' is left out: ZeroDivisionError: division by zero",
        ),
        (
            lambda made, reference: "<b>",
            "figure 'mine' is left out: TypeError: it drew '<b>', which is no",
        ),
        (lambda made: None, "figure 'mine' is left out: TypeError: "),
    ],
)
def test_a_figure_that_cannot_be_drawn_is_named_and_the_rest_is_shown(draw, says):
    whole = report(SOLUTION, TRUTH)
    add(Figure("mine", "Mine", draw))
    page = report(SOLUTION, TRUTH)
    (note,) = page.notes
    assert says in note and note.startswith("plugin ") and "\n" not in note
    assert page.html.count("<div class=plot") == whole.html.count("<div class=plot") > 10
    own = page.html.partition("<h2>More figures</h2>")[2].partition("</section>")[0]
    assert "<p class=note>plugin " in own and "<b>" not in own


def test_the_command_line_prints_which_figure_could_not_be_drawn(tmp_path):
    from strapdown.cli.console import save_page

    def fails(made, reference):
        raise ValueError("no\nluck")

    add(Figure("mine", "Mine", fails))
    import typer

    app = typer.Typer()
    app.command()(lambda: save_page(report(SOLUTION), tmp_path / "a.html"))
    done = CliRunner().invoke(app)
    assert (
        done.output
        == "note: plugin test_figure_list.py: figure 'mine' is left out: ValueError: no luck\n"
    )
    assert (tmp_path / "a.html").exists()


@pytest.mark.parametrize(
    "figure, says",
    [
        (Figure("track", "Track", drawn), "the library already has a Figure of the name 'track'"),
        (Figure("", "Mine", drawn), "a Figure has the name ''; it must be text"),
        (Figure(3, "Mine", drawn), "a Figure has the name 3; it must be text"),
        (Figure("mine", "", drawn), "figure 'mine': its title must be text"),
        (Figure("mine", "Mine", "draw"), "figure 'mine': draw is 'draw'; it must be a function"),
        (Figure("mine", "Mine", drawn, takes=("color",)), "did you mean 'colour'"),
    ],
)
def test_what_is_no_figure_is_refused_in_a_line(figure, says):
    with pytest.raises(DataError, match=re.escape(says)) as refused:
        add(figure)
    assert "\n" not in str(refused.value)


def test_the_figures_of_the_page_are_rows_of_the_same_list():
    assert all(isinstance(figure, Figure) for figure in FIGURES)
    assert len({figure.name for figure in FIGURES}) == len(FIGURES) == 39
    assert figure_list.figures_of_page() == FIGURES
