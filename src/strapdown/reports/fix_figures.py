"""Figures of what became of the fixes: innovations per source, and their normalised squares
(NIS) against the gate."""

from __future__ import annotations

from html import escape
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from ..aiding import find
from ..data import Solution
from ..quantities import shown_unit
from ..typing import Array, Mask
from .drawing import (
    COLOURS,
    GREY,
    NED_AXES,
    RED,
    column,
    even,
    log_range,
    note,
    origin,
    panels,
    peak,
    time_axis,
)

CROSS = {"color": RED, "size": 7, "symbol": "x-thin", "line": {"width": 1.5, "color": RED}}


def kind(solution: Solution, name: str) -> str:
    """The kind of aiding behind a source: the solution says it in `meta["kinds"]`; by default
    sources are named after it."""
    return solution.meta.get("kinds", {}).get(name, name)


def unit(solution: Solution, name: str) -> tuple[str, float, tuple[str, ...]]:
    """(unit, factor from SI, names of the rows) of a source's innovations.

    Filters that take of a magnetic field its direction alone publish the angle by which it is off,
    in the first row.
    """
    try:
        sensor = find(kind(solution, name))
    except ValueError:  # a source of the user's own naming
        return "m, m/s or rad", 1.0, NED_AXES
    if (
        set(sensor.quantities) == {"magnetic field"}
        and not np.isfinite(_innovations(solution, name)[:, 1:]).any()
    ):
        return *shown_unit("angle"), NED_AXES
    units = {shown_unit(quantity) for quantity in sensor.quantities}
    named, factor = units.pop() if len(units) == 1 else ("m, m/s or rad", 1.0)
    rows = (
        ("roll", "pitch", "heading")
        if sensor.name == "attitude"
        else tuple("xyz")
        if sensor.vector == "b"
        else NED_AXES
    )
    return named, factor, rows


def _innovations(solution: Solution, name: str) -> Array:
    fixes = solution.innovations
    return fixes.innovation[fixes.source == fixes.names.index(name)]


class _Panel(NamedTuple):
    """Where one source is drawn."""

    figure: go.Figure
    row: int
    legend: set[str]  # the names that the legend of the figure has already


def innovations(solution: Solution) -> go.Figure | None:
    """Innovation (fix - estimate) of every source over time, rejected fixes crossed in red; None
    without fixes."""
    fixes, used = solution.innovations, _used(solution)
    if not used:
        return None
    units = {source: unit(solution, fixes.names[source]) for source in used}
    figure = panels([f"{escape(fixes.names[source])} [{units[source][0]}]" for source in used], 210)
    zero = origin(solution.t)
    legend: set[str] = set()
    for row, source in enumerate(used, start=1):
        named, factor, rows = units[source]
        chosen = np.flatnonzero(fixes.source == source)
        t, values, good = (
            fixes.t[chosen] - zero,
            fixes.innovation[chosen] * factor,
            fixes.accepted[chosen],
        )
        names = rows if np.isfinite(values[:, 1:]).any() else ("single component",)
        panel = _Panel(figure, row, legend)
        for i, name in enumerate(names):
            _points(panel, t, values[:, i], good, name, {"color": COLOURS[i], "size": 4})
        for i in range(len(names)):
            _points(panel, t, values[:, i], ~good, "rejected", CROSS)
        _range(figure, values, good, row, fixes.names[source], named)
    return time_axis(figure, solution, zero)


def nis(solution: Solution) -> go.Figure | None:
    """Normalised innovation squared of every source over time with its gate, on logarithmic
    axes; None where no filter gave any."""
    fixes, zero = solution.innovations, origin(solution.t)
    used = [
        source for source in _used(solution) if np.isfinite(fixes.nis[fixes.source == source]).any()
    ]
    if not used:
        return None
    figure = panels([escape(fixes.names[source]) for source in used], 190, log=True)
    legend: set[str] = set()
    for row, source in enumerate(used, start=1):
        chosen = np.flatnonzero((fixes.source == source) & (fixes.nis > 0))
        t, values, good = fixes.t[chosen] - zero, fixes.nis[chosen], fixes.accepted[chosen]
        panel = _Panel(figure, row, legend)
        _points(panel, t, values, good, "accepted", {"color": COLOURS[0], "size": 4})
        _points(panel, t, values, ~good, "rejected", CROSS)
        gate = fixes.gates[source] if source < len(fixes.gates) else None
        if gate is not None and np.isfinite(gate):
            _gate(panel, solution.t[[0, -1]] - zero, gate)
        top = max(peak(values), peak(np.array([gate or 0.0]))) or 1.0
        low = np.quantile(values, 0.02) if len(values) else 0.01
        log_range(figure, max(low, top * 1e-7), top, row)
    return time_axis(figure, solution, zero)


def _used(solution: Solution) -> list[int]:
    """Indices of the sources that had fixes to measure."""
    fixes = solution.innovations
    measured = np.isfinite(fixes.innovation).any(axis=1)
    return [
        source for source in range(len(fixes.names)) if (measured & (fixes.source == source)).any()
    ]


def _gate(panel: _Panel, ends: Array, gate: float) -> None:
    panel.figure.add_trace(
        go.Scatter(
            x=column(ends),
            y=[gate, gate],
            name="gate",
            legendgroup="gate",
            mode="lines",
            hovertemplate="%{y:.4g}",
            showlegend="gate" not in panel.legend,
            line={"color": GREY, "dash": "dash", "width": 1.5},
        ),
        row=panel.row,
        col=1,
    )
    panel.legend.add("gate")


def _points(
    panel: _Panel, t: Array, values: Array, which: Mask, name: str, style: dict[str, Any]
) -> None:
    """Markers of the chosen fixes."""
    chosen = np.flatnonzero(which & np.isfinite(values))
    chosen = chosen[even(len(chosen))]
    if len(chosen):
        panel.figure.add_trace(
            go.Scatter(
                x=column(t[chosen]),
                y=column(values[chosen]),
                name=name,
                legendgroup=name,
                mode="markers",
                marker=style,
                showlegend=name not in panel.legend,
                hovertemplate="%{y:.4g}",
            ),
            row=panel.row,
            col=1,
        )
        panel.legend.add(name)


def _range(figure: go.Figure, values: Array, good: Mask, row: int, name: str, named: str) -> None:
    """Frame the accepted fixes; rejected ones beyond three times that leave the frame, and the
    note says how far."""
    inner, largest = peak(values[good]), peak(values)
    limit = largest if largest <= 3 * inner or not inner else inner
    figure.update_yaxes(range=[-1.12 * (limit or 1.0), 1.12 * (limit or 1.0)], row=row, col=1)
    if largest > limit:
        count = int(
            (
                np.nanmax(np.abs(values), axis=1, initial=0.0, where=np.isfinite(values))
                > 1.12 * limit
            ).sum()
        )
        fixes = "fix" if count == 1 else "fixes"
        note(
            figure,
            f"{name}: {count} rejected {fixes} beyond the frame, up to {largest:.3g} {named}. "
            f"Double-click the panel to see all.",
        )
