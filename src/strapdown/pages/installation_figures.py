"""Parameters of the installation that were states of a filter: figures of their estimates over time,
and a table of what they came to."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np
import plotly.graph_objects as go

from ..data.solution import Solution
from ..installation.findings import NOT_OBSERVABLE
from ..installation.states import EstimatedParameter, estimated_installation
from ..units.wording import join_words, number
from .drawing import (
    SHADED_BANDS,
    BandStyle,
    ShownSolution,
    band,
    each,
    frame,
    level,
    line,
    note,
    origin,
    panels,
    time_axis,
)
from .parts import remarks, table

SIGMAS = 2.0
"""Half the width of the bands, standard deviations."""


def estimates(solutions: Solution | Mapping[str, Solution], name: str) -> go.Figure | None:
    """The errors, true - given, of the parameters of that name (of `calibration_parameters`) over time, of a
    Solution or {name: Solution}, with their bands and those of their priors, a panel for each
    parameter; None where none was estimated."""
    shown = each(solutions)
    found: dict[str, list[tuple[ShownSolution, EstimatedParameter]]] = {}
    for one in shown:
        for parameter in estimated_installation(one.solution).parameters:
            if parameter.parameter == name:
                found.setdefault(parameter.column, []).append((one, parameter))
    if not found:
        return None
    first = [parts[0][1] for parts in found.values()]
    several = len({parameter.sources for parameter in first}) > 1
    figure = panels([_label(parameter, several) for parameter in first], 150)
    zero, beyond = origin(shown[0].solution.t), []
    for row, parts in enumerate(found.values(), start=1):
        framed = [_panel(figure, row, one, parameter, zero, len(shown)) for one, parameter in parts]
        limit = max(limit for limit, _ in framed)
        largest = max(largest for _, largest in framed)
        prior, unit = SIGMAS * max(p.prior for _, p in parts), parts[0][1].unit
        if max(largest, prior) <= 3 * limit:  # the prior too, where the rest stays readable
            limit = 1.08 * max(largest, prior)
        for side in sorted({sign * SIGMAS * p.prior for _, p in parts for sign in (-1, 1)}):
            level(figure, shown[0].solution.t - zero, side, "prior", row, unit)
        if prior > limit:
            beyond.append(f"{parts[0][1].component} ±{number(prior)} {unit}".strip())
        figure.update_yaxes(range=[-limit, limit], row=row, col=1)
    if beyond:
        note(figure, f"Priors beyond the frame: {join_words(beyond)}.")
    return time_axis(figure, shown, zero)


def _panel(
    figure: go.Figure, row: int, one: ShownSolution, found: EstimatedParameter, zero: float, of: int
) -> tuple[float, float]:
    """Draw a parameter of one solution of `of`; return half the height of its axis, and its
    largest."""
    columns, t = one.solution.columns, one.solution.t - zero
    values, std = columns[found.column], columns[found.std_column]
    half, label = SIGMAS * std, one.label()
    if one.alone:
        band(figure, t, values, half, row, "±2σ")
    else:
        style = BandStyle(one.colour, label, of <= SHADED_BANDS)
        band(figure, t, values, half, row, f"{label} ±2σ", style)
    line(figure, t, values, label, one.colour, row, unit=found.unit, std=std, dash=one.dash)
    return frame(t, values, np.abs(values) + half)


def _label(found: EstimatedParameter, several: bool) -> str:
    """Return the label of an axis: component, sources where they differ, and unit."""
    words = [found.component or found.parameter]
    words += [f"of {' and '.join(found.sources)}"] if several else []
    return escape(" ".join(words)) + (f" [{found.unit}]" if found.unit else "")


def installation_table(solutions: Mapping[str, Solution]) -> str:
    """HTML of what the parameters came to, of {name: Solution}, and of what must be known beside;
    "" where none was estimated."""
    rows, said = [], []
    for name, solution in solutions.items():
        found, whose = estimated_installation(solution), f"{name}: " if len(solutions) > 1 else ""
        for parameter in found.parameters:
            unit = f" [{parameter.unit}]" if parameter.unit else ""
            values = (
                parameter.given,
                parameter.value,
                parameter.change,
                parameter.std,
                parameter.prior,
            )
            numbers = (f"{value:.{3 if parameter.unit else 4}f}" for value in values)
            rows.append([f"{whose}{parameter.name}{unit}", *numbers, _status(parameter)])
        said += [f"{whose}{text}" for text in found.remarks]
    head = ["parameter", "given", "estimated", "true − given", "± 1σ", "prior σ", "is"]
    return table(head, rows) + remarks(said) if rows else ""


def _status(parameter: EstimatedParameter) -> str:
    if parameter.status == NOT_OBSERVABLE:
        return f"{parameter.status}; {parameter.advice}"
    return parameter.status
