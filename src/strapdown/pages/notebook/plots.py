"""Figures by name, as plotly Figures that one can change: those of the report for a Solution, and of
the samples and fixes for a Recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import singledispatch
from html import escape
from textwrap import wrap

import plotly.graph_objects as go

from ...checks import DataError, check_choice
from ...data.recording import Recording
from ...data.solution import Solution, Trajectory
from ...evaluation import metrics
from ..drawing import COLOURS
from ..figure_list import Figure, figures_of_page
from . import recording_figures

ERRORS = "errors"
"""Stands for the first figure of the section of errors that there is."""
TEMPLATE = "plotly_white"
LINE = 18
"""px of a line above a figure."""
NOTE_WIDTH = 110
"""Letters in such a line."""


@singledispatch
def figure_of(value: object, what: str) -> go.Figure:
    """The figure of a value that is called `what`. Raises DataError."""
    raise TypeError(f"no figure of a {type(value).__name__}")


@figure_of.register(Solution)
def of_solution(
    solution: Solution, what: str | None = None, reference: Trajectory | None = None
) -> go.Figure:
    """The figure of the report that is called `what`, of one Solution; reference: as of `report`, by
    default that of the recording which the solution was made of. Raises DataError."""
    known = {figure.name: figure for figure in figures_of_page()}
    if what is None:
        what = "track" if solution.has_position else "attitude"
    check_choice(what, "figure", [*known, ERRORS])
    if not len(solution):
        raise DataError(f"figure {what!r}: the solution has no rows, so there is nothing to draw")
    if reference is None and solution.recording is not None:
        reference = solution.recording.reference
    wanted = [known[what]] if what in known else _of_errors(known)
    for figure in wanted:
        # some are drawn only where there is no reference
        for against in (reference, None) if reference is not None else (None,):
            if (made := _draw_figure(figure, solution, against)) is not None:
                heading = (
                    figure.title if isinstance(figure.title, str) else figure.title([solution])
                )
                return add_title(made, heading)
    lacks = (
        "" if reference is not None else " without a reference: give reference=recording.reference"
    )
    raise DataError(f"figure {what!r}: this solution has nothing to draw there{lacks}")


def _of_errors(known: Mapping[str, Figure]) -> list[Figure]:
    """Those of errors, position first."""
    return [figure for figure in known.values() if figure.section == "Errors"]


def _draw_figure(
    figure: Figure, solution: Solution, reference: Trajectory | None
) -> go.Figure | None:
    """Draw a Figure of the report for one solution alone."""
    name = str(solution.meta.get("filter", "solution"))
    errors = None
    if reference is not None and not {"errors", "scores"}.isdisjoint(figure.takes):
        errors = metrics.errors(solution, reference)
    given = {
        "errors": errors,
        "scores": {} if errors is None else {name: errors},
        "colour": COLOURS[0],
        "window": None,
        "recording": solution.recording,
        "solutions": {name: solution},
    }
    subject = {name: solution} if figure.together else solution
    return figure.draw(subject, reference, **{each: given[each] for each in figure.takes})


@figure_of.register(Recording)
def of_recording(recording: Recording, what: str = "readings") -> go.Figure:
    """The figure of a Recording that is called `what`. Raises DataError."""
    draw: Callable[[Recording], go.Figure | None]
    heading, draw = recording_figures.FIGURES[
        check_choice(what, "figure", recording_figures.FIGURES)
    ]
    made = draw(recording)
    if made is None:
        raise DataError(f"figure {what!r}: this recording has nothing to draw there")
    return add_title(made, heading)


def add_title(figure: go.Figure, heading: str) -> go.Figure:
    """A figure of a page as it stands alone: with its heading, and what the page says below it."""
    notes = (figure.layout.meta or {}).get("notes", ())
    said = [part for note in notes for part in wrap(note, NOTE_WIDTH)]
    small = "".join(f"<br><sub>{escape(part)}</sub>" for part in said)
    above = LINE * (1 + len(said))
    return figure.update_layout(
        template=TEMPLATE,
        title={
            "text": f"{escape(heading)}{small}",
            **{"x": 0.01, "y": 1, "yanchor": "top", "pad": {"t": 14 + LINE * len(said) / 2}},
        },
        height=(figure.layout.height or 450) + above,
        margin_t=(figure.layout.margin.t or 52) + above,
    )
