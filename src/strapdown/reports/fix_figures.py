"""Figures of what became of the fixes: innovations per source, and their normalised squares
(NIS) against the gate."""

from html import escape

import numpy as np
import plotly.graph_objects as go

from ..core.contract import ATTITUDE_KIND
from .drawing import (
    AXES,
    COLOURS,
    GREY,
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
SHOWN = {
    "latitude": ("m", 1.0),
    "longitude": ("m", 1.0),
    "length": ("m", 1.0),
    "speed": ("m/s", 1.0),
    "angle": ("deg", np.degrees(1)),
    "acceleration": ("m/s^2", 1.0),
    "magnetic field": ("uT", 1e6),
    "pressure": ("m", 1.0),
}
"""Unit of the innovations of a quantity and its size in it; those of a pressure are heights."""


def kind(solution, name):
    """The kind of aiding behind a source: the solution says it in `meta["kinds"]`; by default
    sources are named after it."""
    return solution.meta.get("kinds", {}).get(name, name)


def unit(solution, name):
    """(unit, factor from SI, names of the rows) of a source's innovations.

    Filters that take of a magnetic field its direction alone publish the angle by which it is off,
    in the first row.
    """
    from ..aiding import find

    try:
        sensor = find(kind(solution, name))
    except ValueError:  # a source of the user's own naming
        return "m, m/s or rad", 1.0, AXES
    if (
        set(sensor.quantities) == {"magnetic field"}
        and not np.isfinite(_innovations(solution, name)[:, 1:]).any()
    ):
        return *SHOWN["angle"], AXES
    units = {SHOWN[quantity] for quantity in sensor.quantities}
    named, factor = units.pop() if len(units) == 1 else ("m, m/s or rad", 1.0)
    rows = (
        ("roll", "pitch", "heading")
        if sensor.kind == ATTITUDE_KIND
        else tuple("xyz")
        if sensor.vector == "b"
        else AXES
    )
    return named, factor, rows


def _innovations(solution, name):
    fixes = solution.innovations
    return fixes.innovation[fixes.source == fixes.names.index(name)]


def innovations(solution):
    """Innovation (fix - estimate) of every source over time, rejected fixes crossed in red; None
    without fixes."""
    fixes, used = solution.innovations, _used(solution)
    if not used:
        return None
    units = {source: unit(solution, fixes.names[source]) for source in used}
    figure = panels([f"{escape(fixes.names[source])} [{units[source][0]}]" for source in used], 210)
    zero, shown = origin(solution.t), set()
    for row, source in enumerate(used, start=1):
        named, factor, rows = units[source]
        chosen = np.flatnonzero(fixes.source == source)
        t, values, good = (
            fixes.t[chosen] - zero,
            fixes.innovation[chosen] * factor,
            fixes.accepted[chosen],
        )
        names = rows if np.isfinite(values[:, 1:]).any() else ("single component",)
        for i, name in enumerate(names):
            _points(
                figure, t, values[:, i], good, name, {"color": COLOURS[i], "size": 4}, row, shown
            )
        for i in range(len(names)):
            _points(figure, t, values[:, i], ~good, "rejected", CROSS, row, shown)
        _range(figure, values, good, row, fixes.names[source], named)
    return time_axis(figure, solution, zero)


def nis(solution):
    """Normalised innovation squared of every source over time with its gate, on logarithmic
    axes; None where no filter gave any."""
    fixes, zero = solution.innovations, origin(solution.t)
    used = [
        source for source in _used(solution) if np.isfinite(fixes.nis[fixes.source == source]).any()
    ]
    if not used:
        return None
    figure, shown = panels([escape(fixes.names[source]) for source in used], 190, log=True), set()
    for row, source in enumerate(used, start=1):
        chosen = np.flatnonzero((fixes.source == source) & (fixes.nis > 0))
        t, values, good = fixes.t[chosen] - zero, fixes.nis[chosen], fixes.accepted[chosen]
        _points(figure, t, values, good, "accepted", {"color": COLOURS[0], "size": 4}, row, shown)
        _points(figure, t, values, ~good, "rejected", CROSS, row, shown)
        gate = fixes.gates[source] if source < len(fixes.gates) else None
        if gate is not None and np.isfinite(gate):
            _gate(figure, solution.t[[0, -1]] - zero, gate, row, shown)
        top = max(peak(values), peak(np.array([gate or 0.0]))) or 1.0
        low = np.quantile(values, 0.02) if len(values) else 0.01
        log_range(figure, max(low, top * 1e-7), top, row)
    return time_axis(figure, solution, zero)


def _used(solution):
    """Indices of the sources that had fixes to measure."""
    fixes = solution.innovations
    measured = np.isfinite(fixes.innovation).any(axis=1)
    return [
        source for source in range(len(fixes.names)) if (measured & (fixes.source == source)).any()
    ]


def _gate(figure, ends, gate, row, shown):
    figure.add_trace(
        go.Scatter(
            x=column(ends),
            y=[gate, gate],
            name="gate",
            legendgroup="gate",
            mode="lines",
            hovertemplate="%{y:.4g}",
            showlegend="gate" not in shown,
            line={"color": GREY, "dash": "dash", "width": 1.5},
        ),
        row=row,
        col=1,
    )
    shown.add("gate")


def _points(figure, t, values, which, name, style, row, shown):
    """Markers of the chosen fixes; `shown` are the names that the legend has already."""
    chosen = np.flatnonzero(which & np.isfinite(values))
    chosen = chosen[even(len(chosen))]
    if len(chosen):
        figure.add_trace(
            go.Scatter(
                x=column(t[chosen]),
                y=column(values[chosen]),
                name=name,
                legendgroup=name,
                mode="markers",
                marker=style,
                showlegend=name not in shown,
                hovertemplate="%{y:.4g}",
            ),
            row=row,
            col=1,
        )
        shown.add(name)


def _range(figure, values, good, row, name, named):
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
            f"{name}: {count} rejected {fixes} beyond the frame, up to {largest:.3g} {named}. Double-click the panel to see all.",
        )
