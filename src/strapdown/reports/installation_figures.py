"""Parameters of the installation that were states of a filter: figures of their estimates over time,
and a table of what they came to."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np
import plotly.graph_objects as go

from ..data import Solution
from ..diagnosis.estimated import EstimatedParameter, installation
from ..diagnosis.findings import NOT_OBSERVABLE
from .drawing import COLOURS, GREY, band, frame, line, note, origin, panels, time_axis
from .summary import enumerated, number, table

SIGMAS = 2.0
"""Half the width of the bands, standard deviations."""


def estimates(solution: Solution, name: str, colour: str = COLOURS[0]) -> go.Figure | None:
    """The errors, true - given, of the parameters of that name (of `estimable`) over time, with
    their bands and those of their priors, a panel each; None where none was estimated."""
    shown = [each for each in installation(solution).parameters if each.parameter == name]
    if not shown:
        return None
    several = len({each.sources for each in shown}) > 1
    figure, zero = panels([_label(each, several) for each in shown], 150), origin(solution.t)
    t, beyond = solution.t - zero, []
    for row, each in enumerate(shown, start=1):
        values, half = solution.columns[each.column], SIGMAS * solution.columns[each.sd_column]
        band(figure, t, values, half, row, "±2σ")
        line(figure, t, values, "estimate", colour, row)
        prior = SIGMAS * each.prior
        limit, largest = frame(t, values, np.abs(values) + half)
        if max(largest, prior) <= 3 * limit:  # the prior too, where the rest stays readable
            limit = 1.08 * max(largest, prior)
        for side in (-prior, prior):
            ends = np.full(2, side)
            first = row == 1 and side > 0
            line(figure, t[[0, -1]], ends, "prior", GREY, row, legend=first, dash="dash")
        if prior > limit:
            beyond.append(f"{each.component} ±{number(prior)} {each.unit}".strip())
        figure.update_yaxes(range=[-limit, limit], row=row, col=1)
    if beyond:
        note(figure, f"Priors beyond the frame: {enumerated(beyond)}.")
    return time_axis(figure, solution, zero)


def _label(each: EstimatedParameter, several: bool) -> str:
    """Of an axis: component, sources where they differ, and unit."""
    words = [each.component or each.parameter]
    words += [f"of {' and '.join(each.sources)}"] if several else []
    return escape(" ".join(words)) + (f" [{each.unit}]" if each.unit else "")


def installation_table(solutions: Mapping[str, Solution]) -> str:
    """HTML of what the parameters came to, of {name: Solution}, and of what must be known beside;
    "" where none was estimated."""
    rows, said = [], []
    for name, solution in solutions.items():
        found, whose = installation(solution), f"{name}: " if len(solutions) > 1 else ""
        for each in found.parameters:
            unit = f" [{each.unit}]" if each.unit else ""
            values = (each.given, each.value, each.error, each.sd, each.prior)
            numbers = (f"{value:.{3 if each.unit else 4}f}" for value in values)
            rows.append([f"{whose}{each.name}{unit}", *numbers, _status(each)])
        said += [f"{whose}{text}" for text in found.remarks]
    head = ["parameter", "given", "estimated", "true − given", "± 1σ", "prior σ", "is"]
    notes = "".join(f"<p class=note>{escape(text)}</p>" for text in said)
    return table(head, rows) + notes if rows else ""


def _status(each: EstimatedParameter) -> str:
    if each.status == NOT_OBSERVABLE:
        return f"{each.status}; {each.advice}"
    return each.status
