"""Figures of a cell of a study over time: errors with stated uncertainty and Cramer-Rao bound, NEES
with its band, runs alive. A filter has the same colour in all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from ...checks import check_choice
from ...core.loop.contract import ATT, POS, STATES, VEL
from ...evaluation.consistency import band
from ...pages.drawing import COLOURS, GREY, RED, line, log_range, note, panels, positive, wider
from ...pages.notebook.plots import add_title
from ...typing import Array

if TYPE_CHECKING:
    from .campaign import Campaign
    from .chunks import Arrays

LIMIT = {"color": RED, "width": 1, "dash": "dash"}
"""The line of a threshold."""
MAX_RATIO = 1e4
"""Largest ratio of the ends of a logarithmic axis, so that one diverging run does not flatten all
others."""
USUAL_NEES = 2.0
"""NEES per state, and its inverse, that the axis shows at least."""
NO_BOUND = (
    "The Cramer-Rao bound is left out: it is computed along an ideal run (no errors of the IMU, exact "
    "fixes), and here the ideal run leaves the truth, so that its linearisation does not hold, or "
    "rejects a fix."
)


class Entry(NamedTuple):
    """Name, colour and visibility of a filter in a figure."""

    label: str  # in the study
    name: str  # in the legend
    colour: str
    shown: bool = True  # at once; else it waits in the legend


class CellCurves(NamedTuple):
    """The curves of a cell of a campaign, and the filters that are drawn."""

    curves: Arrays  # as `Campaign.curves`
    filters: Sequence[str]  # labels, in the order of the curves
    runs: int
    entries: Sequence[Entry]


def curves_of(campaign: Campaign, cell: str, entries: Sequence[Entry] | None = None) -> CellCurves:
    """Return the curves of a cell for drawing, by default of all filters. Raises DataError where no
    run of it is finished."""
    filters, runs = campaign.manifest["filters"], campaign.manifest["runs"]
    if entries is None:
        entries = [Entry(label, label, colour) for label, colour in zip(filters, cycle(COLOURS))]
    return CellCurves(campaign.curves(cell), list(filters), runs, entries)


def _over_time(
    drawn: CellCurves,
    label: str,
    height: int,
    log: bool,
    lines: Callable[[Arrays, int], Sequence[Array]],
) -> tuple[go.Figure, Array, list[Array]]:
    """(figure, its times in the unit of the axis, values shown at once) over time.

    lines: of a filter, of the curves and its place in them; the first is solid, others dashed.
    """
    duration = float(drawn.curves["t"][-1])
    scale, unit = (
        (1.0, "s") if duration < 600 else (60.0, "min") if duration < 5 * 3600 else (3600.0, "h")
    )
    figure, seen, t = panels([label], height, log), [], drawn.curves["t"] / scale
    for rank, entry in reversed(list(enumerate(drawn.entries))):
        for i, values in enumerate(lines(drawn.curves, drawn.filters.index(entry.label))):
            style: dict[str, Any] = {"dash": "dash" if i else "solid", "width": wider(1.4, rank)}
            line(figure, t, values, entry.name, entry.colour, 1, not i, rank, **style)
            figure.data[-1].visible = True if entry.shown else "legendonly"
            seen += [values] if entry.shown else []
    figure.update_xaxes(title_text=f"time [{unit}]", range=[0, float(t[-1])])
    return figure, t, seen


def errors(
    drawn: CellCurves, label: str, length: Callable[[Array], Array], factor: float = 1.0
) -> go.Figure:
    """RMSE, stated standard deviation (dashed) and bound of one quantity; `length` makes it of
    (n, 15) values."""

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [factor * length(curves[name][place]) for name in ("rmse", "std")]

    figure, t, seen = _over_time(drawn, label, 290, True, lines)
    bound = factor * length(drawn.curves["bound"])
    if np.isfinite(bound).any():
        line(figure, t, bound, "Cramer-Rao bound", GREY, dash="dot")
    else:
        note(figure, NO_BOUND)
    values = positive(*seen, bound)
    if len(values):
        log_range(figure, max(values.min(), 1e-9), min(values.max(), MAX_RATIO * values.min()))
    return figure


def _size(states: slice) -> Callable[[Array], Array]:
    """The length of the vector of these states."""
    return lambda values: np.sqrt(np.square(values[:, states]).sum(axis=1))


def position(drawn: CellCurves) -> go.Figure:
    """Three-dimensional position error over time."""
    return errors(drawn, "position error [m]", _size(POS))


def velocity(drawn: CellCurves) -> go.Figure:
    """Three-dimensional velocity error over time."""
    return errors(drawn, "velocity error [m/s]", _size(VEL))


def attitude(drawn: CellCurves) -> go.Figure:
    """Total error of rotation over time."""
    return errors(drawn, "attitude error [deg]", _size(ATT), np.degrees(1))


def heading(drawn: CellCurves) -> go.Figure:
    """Error of rotation about the vertical over time."""
    return errors(
        drawn, "heading error [deg]", lambda values: values[:, ATT.stop - 1], np.degrees(1)
    )


def nees(drawn: CellCurves, limit: float | None = None) -> go.Figure:
    """NEES per state over time, with the band of a mean over all runs, and a `limit` of it and of
    its inverse."""

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [np.where(curves["alive"][place] > 0, curves["nees"][place], np.nan)]

    figure, _, seen = _over_time(drawn, "NEES per state", 290, True, lines)
    low, high = (value / STATES for value in band(STATES, drawn.runs))
    # after the lines: plotly draws no shapes in an empty panel
    figure.add_hrect(low, high, fillcolor="rgba(134,142,150,0.3)", line_width=0, layer="below")
    for each in (1 / limit, limit) if limit else ():
        figure.add_hline(each, line=LIMIT)
    most = limit or USUAL_NEES
    largest = np.nanmax(np.concatenate(seen), initial=most)
    log_range(figure, 0.6 / most, min(largest, MAX_RATIO))
    return figure


def survival(drawn: CellCurves, limit: float | None = None) -> go.Figure:
    """Share of the runs that are alive over time, and a `limit` of it."""

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [100 * curves["alive"][place] / drawn.runs]

    figure, _, _ = _over_time(drawn, "runs alive [%]", 210, False, lines)
    if limit:
        figure.add_hline(100 * limit, line=LIMIT)
    return figure.update_yaxes(range=[-4, 104])


NAMED: dict[str, tuple[str, Callable[[CellCurves], go.Figure]]] = {
    "position": ("Position error over time", position),
    "velocity": ("Velocity error over time", velocity),
    "attitude": ("Attitude error over time", attitude),
    "heading": ("Heading error over time", heading),
    "nees": ("NEES per state over time", nees),
    "survival": ("Runs alive over time", survival),
}
"""{name of a figure: how its heading begins, what draws it}."""


def figure_of_name(campaign: Campaign, what: str, cell: str | None) -> go.Figure:
    """The figure of that name as it stands alone, of a cell, by default the first. Raises
    DataError."""
    heading, draw = NAMED[check_choice(what, "figure", NAMED)]
    cell = check_choice(campaign.cells[0] if cell is None else cell, "cell", campaign.cells)
    return add_title(draw(curves_of(campaign, cell)), f"{heading}, {cell}")
