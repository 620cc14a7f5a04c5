"""Figures of what became of the fixes: innovations per source, and their normalised squares
(NIS) against the gate."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ..aiding import find
from ..data import Solution
from ..evaluation.metrics import EULER, NED_AXES
from ..quantities import shown_unit
from ..typing import Array, Mask
from .drawing import (
    COLOURS,
    GREY,
    RED,
    column,
    even,
    kind,
    log_range,
    note,
    origin,
    panels,
    peak,
    time_axis,
)

CAUSES = {
    "": RED,
    "jump": "#ae3ec9",
    "drift": "#e67700",
    "clock": "#1098ad",
    "noise too small": "#5c940d",
    "other sources disagree": "#364fc7",
    "single outliers": "#8d5524",
    "not known": "#495057",
}
"""Colours of rejected fixes by their probable cause; none: chance."""


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
        EULER if sensor.name == "attitude" else tuple("xyz") if sensor.vector == "b" else NED_AXES
    )
    return named, factor, rows


def _innovations(solution: Solution, name: str) -> Array:
    fixes = solution.innovations
    return fixes.innovation[fixes.source == fixes.names.index(name)]


def innovations(solution: Solution) -> go.Figure | None:
    """Innovation (fix - estimate) of every source over time, rejected fixes crossed in the colour of
    their probable cause; None without fixes."""
    fixes, used = solution.innovations, _used(solution)
    if not used:
        return None
    units = {source: unit(solution, fixes.names[source]) for source in used}
    figure = panels([f"{escape(fixes.names[source])} [{units[source][0]}]" for source in used], 210)
    zero = origin(solution.t)
    for row, source in enumerate(used, start=1):
        named, factor, rows = units[source]
        own = fixes.source == source
        t, values, good = fixes.t[own] - zero, fixes.innovation[own] * factor, fixes.accepted[own]
        names = rows if np.isfinite(values[:, 1:]).any() else ("single component",)
        for i, name in enumerate(names):
            mark = {"color": COLOURS[i], "size": 4}
            _points(figure, row, t, np.where(good, values[:, i], np.nan), name, mark)
        for cause, why in _causes(solution, fixes.names[source], fixes.t[own], good).items():
            for i in range(len(names)):
                _points(figure, row, t, np.where(why, values[:, i], np.nan), *_rejected(cause))
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
    for row, source in enumerate(used, start=1):
        own = (fixes.source == source) & (fixes.nis > 0)
        t, values, good = fixes.t[own] - zero, fixes.nis[own], fixes.accepted[own]
        accepted = {"color": COLOURS[0], "size": 4}
        _points(figure, row, t, np.where(good, values, np.nan), "accepted", accepted)
        for cause, why in _causes(solution, fixes.names[source], fixes.t[own], good).items():
            _points(figure, row, t, np.where(why, values, np.nan), *_rejected(cause))
        gate = fixes.gates[source] if source < len(fixes.gates) else None
        if gate is not None and np.isfinite(gate):
            dashed = {"color": GREY, "dash": "dash", "width": 1.5}
            ends = column(solution.t[[0, -1]] - zero)
            _scatter(figure, row, "gate", x=ends, y=[gate, gate], mode="lines", line=dashed)
        top = max(peak(values), peak(np.array([gate or 0.0]))) or 1.0
        low = np.quantile(values, 0.02) if len(values) else 0.01
        log_range(figure, max(low, top * 1e-7), top, row)
    return time_axis(figure, solution, zero)


def _causes(solution: Solution, name: str, t: Array, good: Mask) -> dict[str, Mask]:
    """The rejected fixes (m,) of a source at these times by their probable cause; of "" without."""
    cause = np.full(len(t), "", dtype=object)
    for run in sorted(solution.rejected, key=lambda run: -run.of):  # the shortest over all
        if run.source == name:
            cause[(t >= run.start) & (t <= run.stop)] = run.cause
    return {each: ~good & (cause == each) for each in CAUSES}


def _rejected(cause: str) -> tuple[str, dict[str, Any]]:
    """(name, style) of fixes that were rejected for a cause."""
    colour = CAUSES[cause]
    line = {"width": 1.5, "color": colour}
    style = {"color": colour, "size": 7, "symbol": "x-thin", "line": line}
    return f"rejected: {cause}" if cause else "rejected", style


def weights(solution: Solution) -> go.Figure | None:
    """Weights of the fixes of robust sources, and standard deviations of adaptive ones over those
    stated, over time; None without such a source, and of a file."""
    fixes, zero = solution.innovations, origin(solution.t)
    shown: list[tuple[int, str, Array, tuple[str, ...]]] = []
    if fixes.weight is None or fixes.followed is None:
        return None
    for source in _used(solution):
        own = fixes.source == source
        weight, ratio = fixes.weight[own], fixes.followed[own]
        if ((weight > 0) & (weight < 1)).any():
            shown.append((source, "weight [1]", weight[:, None], ("weight",)))
        if (ratio != 1).any():
            rows = unit(solution, fixes.names[source])[2]
            seen = np.flatnonzero(np.isfinite(fixes.innovation[own]).any(axis=0))
            names = tuple(rows[i] for i in seen) if len(seen) > 1 else ("single component",)
            shown.append((source, "noise over stated [1]", ratio[:, seen], names))
    if not shown:
        return None
    figure = panels([f"{escape(fixes.names[source])}: {what}" for source, what, *_ in shown], 190)
    for row, (source, _, values, names) in enumerate(shown, start=1):
        t = fixes.t[fixes.source == source] - zero
        for i, name in enumerate(names):
            _points(figure, row, t, values[:, i], name, {"color": COLOURS[i], "size": 4})
        figure.update_yaxes(rangemode="tozero", row=row, col=1)
    return time_axis(figure, solution, zero)


def _used(solution: Solution) -> list[int]:
    """Indices of the sources that had fixes to measure."""
    fixes = solution.innovations
    measured = np.isfinite(fixes.innovation).any(axis=1)
    return [
        source for source in range(len(fixes.names)) if (measured & (fixes.source == source)).any()
    ]


def _points(
    figure: go.Figure, row: int, t: Array, values: Array, name: str, style: dict[str, Any]
) -> None:
    """Markers of the known values, thinned at even steps."""
    chosen = np.flatnonzero(np.isfinite(values))
    chosen = chosen[even(len(chosen))]
    if len(chosen):
        x, y = column(t[chosen]), column(values[chosen])
        _scatter(figure, row, name, x=x, y=y, mode="markers", marker=style)


def _scatter(figure: go.Figure, row: int, name: str, **data: Any) -> None:
    """A trace that is in the legend where its name is not there yet."""
    new = name not in {trace.name for trace in figure.data}
    figure.add_trace(
        go.Scatter(name=name, legendgroup=name, showlegend=new, hovertemplate="%{y:.4g}", **data),
        row=row,
        col=1,
    )


def _range(figure: go.Figure, values: Array, good: Mask, row: int, name: str, named: str) -> None:
    """Frame the accepted fixes; rejected ones beyond three times that leave the frame, and the
    note says how far."""
    inner, largest = peak(values[good]), peak(values)
    limit = largest if largest <= 3 * inner or not inner else inner
    figure.update_yaxes(range=[-1.12 * (limit or 1.0), 1.12 * (limit or 1.0)], row=row, col=1)
    if largest > limit:
        sizes = np.nanmax(np.abs(values), axis=1, initial=0.0, where=np.isfinite(values))
        count = int((sizes > 1.12 * limit).sum())
        fixes = "fix" if count == 1 else "fixes"
        note(
            figure,
            f"{name}: {count} rejected {fixes} beyond the frame, up to {largest:.3g} {named}. "
            f"Double-click the panel to see all.",
        )
