"""Figures of the page of an advice: errors with stated uncertainty and bound, NEES with its
band, survival, the crossover map."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ...core.contract import POS, STATES
from ...evaluation.consistency import band
from ...reports.drawing import COLOURS, GREY, RED, line, log_range, note, panels
from ...typing import Array
from .mission import spoken
from .verdicts import CLOSED, OPEN, called, interval_of

if TYPE_CHECKING:
    from ..monte_carlo.chunks import Arrays
    from .advise import Advice

LINES = {OPEN: COLOURS[1], CLOSED: COLOURS[0]}
"""Colours of the two extremes; resets take the others."""
RESET_COLOURS = COLOURS[2:]
FILLS = {
    "open": "#8fd19e",
    "reset": "#ffe08a",
    "closed": "#9ec5f5",
    "none": "#e9b8b8",
    "undecided": "#d5d9de",
}
"""Of the map's answers, pale so that black text can be read on them."""
WIDEST_AXIS = 1e4
"""Ratio of the ends of a logarithmic axis at most, so that one diverging run does not flatten
all others."""


def _time(advice: Advice) -> tuple[float, str]:
    """(scale, unit) of the time axes."""
    duration = advice.scenario.duration
    return (1.0, "s") if duration < 600 else (60.0, "min") if duration < 5 * 3600 else (3600.0, "h")


def _curves(advice: Advice) -> tuple[Arrays, Array, str]:
    """Curves of the mission's only cell; times in the unit of the axis, and the unit."""
    curves = advice.campaign.curves(advice.campaign.cells[0])
    scale, unit = _time(advice)
    return curves, curves["t"] / scale, unit


def _filters(advice: Advice) -> list[tuple[int, str, str, bool]]:
    """(place, label, colour, shown at once) of each filter; resets that are not the answer wait
    in the legend."""
    labels = list(advice.campaign.manifest["filters"])
    resets = sorted((label for label in labels if label not in LINES), key=interval_of)
    colours = LINES | {
        label: RESET_COLOURS[i % len(RESET_COLOURS)] for i, label in enumerate(resets)
    }
    return [
        (
            labels.index(label),
            label,
            colours[label],
            label in LINES or label == advice.decision.filter,
        )
        for label in advice.found
    ]


def _labelled(figure: go.Figure, t: Array, unit: str) -> go.Figure:
    figure.update_xaxes(title_text=f"time [{unit}]", range=[0, float(t[-1])])
    return figure


def _hide(figure: go.Figure, count: int, shown: bool) -> None:
    """The last `count` traces wait in the legend unless they are `shown`."""
    for trace in figure.data[-count:]:
        trace.visible = True if shown else "legendonly"


def _errors(
    advice: Advice, label: str, length: Callable[[Array], Array], factor: float = 1.0
) -> go.Figure:
    """RMSE, stated standard deviation and bound of one quantity; `length` makes it of (n, 15)
    values."""
    curves, t, unit = _curves(advice)
    figure, seen = panels([label], height=290, log=True), []
    for place, name, colour, shown in _filters(advice):
        rmse, sd = factor * length(curves["rmse"][place]), factor * length(curves["sd"][place])
        line(figure, t, rmse, called(name), colour)
        line(figure, t, sd, called(name), colour, legend=False, dash="dash")
        figure.data[-1].legendgroup = figure.data[-2].legendgroup
        _hide(figure, 2, shown)
        seen += [rmse, sd] if shown else []
    bound = factor * length(curves["bound"])
    if np.isfinite(bound).any():
        line(figure, t, bound, "Cramer-Rao bound", GREY, dash="dot")
    else:
        note(
            figure,
            "The Cramer-Rao bound is left out: it is computed along an ideal run (no errors of the "
            "IMU, exact fixes), and on this mission "
            "the ideal run leaves the truth, so that its linearisation does not hold, or rejects a "
            "fix.",
        )
    values = np.concatenate([*seen, bound])
    values = values[np.isfinite(values) & (values > 0)]
    if len(values):
        log_range(figure, max(values.min(), 1e-9), min(values.max(), WIDEST_AXIS * values.min()))
    return _labelled(figure, t, unit)


def rmse(advice: Advice) -> go.Figure:
    """Three-dimensional position error over time."""
    return _errors(
        advice, "position error [m]", lambda values: np.sqrt(np.square(values[:, POS]).sum(axis=1))
    )


def heading(advice: Advice) -> go.Figure:
    """Error of rotation about the vertical over time."""
    return _errors(advice, "heading error [deg]", lambda values: values[:, 8], np.degrees(1))


def nees(advice: Advice) -> go.Figure:
    """NEES per state over time, with the band of a mean over all runs and the limits of the
    rule."""
    curves, t, unit = _curves(advice)
    figure = panels(["NEES per state"], height=290, log=True)
    low, high = (value / STATES for value in band(STATES, advice.campaign.manifest["runs"]))
    largest = advice.rules.belief
    for place, name, colour, shown in _filters(advice):
        values = np.where(curves["alive"][place] > 0, curves["nees"][place], np.nan)
        line(figure, t, values, called(name), colour)
        _hide(figure, 1, shown)
        largest = max(largest, np.nanmax(values, initial=0.0)) if shown else largest
    # after the lines: plotly draws no shapes in an empty panel
    figure.add_hrect(low, high, fillcolor="rgba(134,142,150,0.3)", line_width=0, layer="below")
    for limit in (1 / advice.rules.belief, advice.rules.belief):
        figure.add_hline(limit, line={"color": RED, "width": 1, "dash": "dash"})
    log_range(figure, 0.6 / advice.rules.belief, min(largest, WIDEST_AXIS))
    return _labelled(figure, t, unit)


def survival(advice: Advice) -> go.Figure:
    """Share of the runs that are alive over time, with the least that the rule asks for."""
    curves, t, unit = _curves(advice)
    figure = panels(["runs alive [%]"], height=210)
    for place, name, colour, shown in _filters(advice):
        line(
            figure,
            t,
            100 * curves["alive"][place] / advice.campaign.manifest["runs"],
            called(name),
            colour,
        )
        _hide(figure, 1, shown)
    figure.add_hline(100 * advice.rules.survival, line={"color": RED, "width": 1, "dash": "dash"})
    figure.update_yaxes(range=[-4, 104])
    return _labelled(figure, t, unit)


def crossover(advice: Advice) -> go.Figure:
    """The map: a panel per motion, a row per IMU, a column per duration; the colour is the
    answer."""
    rows, kinds = advice.map, list(FILLS)
    motions, imus, times = (
        list(dict.fromkeys(row[name] for row in rows)) for name in ("motion", "imu", "duration_s")
    )
    titles = [f"{motion} flight" for motion in motions]
    figure = make_subplots(
        rows=len(motions), cols=1, shared_xaxes=True, vertical_spacing=0.13, subplot_titles=titles
    )
    found = {(row["motion"], row["imu"], row["duration_s"]): row for row in rows}
    steps = [
        (edge, colour)
        for i, colour in enumerate(FILLS.values())
        for edge in (i / len(kinds), (i + 1) / len(kinds))
    ]
    for place, motion in enumerate(motions, 1):
        cells = [[found[motion, imu, t] for t in times] for imu in imus]
        figure.add_trace(
            go.Heatmap(
                z=[[kinds.index(cell["answer"]) for cell in line] for line in cells],
                x=[spoken(t) for t in times],
                y=imus,
                text=[[_mark(cell) for cell in line] for line in cells],
                texttemplate="%{text}",
                textfont={"color": "#1f2933"},
                zmin=-0.5,
                zmax=len(kinds) - 0.5,
                colorscale=steps,
                xgap=2,
                ygap=2,
                showscale=False,
                hovertemplate="%{y}, %{x}: %{text}<extra></extra>",
            ),
            row=place,
            col=1,
        )
    figure.update_xaxes(
        title_text="duration of the mission", type="category", row=len(motions), col=1
    )
    figure.update_yaxes(type="category", autorange="reversed", automargin=True)
    figure.update_layout(
        template=go.layout.Template(),
        height=110 + len(motions) * (70 + 34 * len(imus)),
        margin={"l": 90, "r": 15, "t": 36, "b": 50},
        font={"size": 12},
        meta={"notes": []},
        hovermode="closest",
    )
    return figure


def _mark(cell: dict[str, Any]) -> str:
    if cell["answer"] == "undecided":
        return "?"
    text = f"{interval_of(cell['filter']):g} s" if cell["answer"] == "reset" else cell["answer"]
    return text + ("" if cell["sure"] else " ?")
