"""Figures of the page of an advice: errors with stated uncertainty and bound, NEES with its
band, survival, the crossover map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ...core.loop.contract import POS, STATES
from ...evaluation.consistency import band
from ...pages.drawing import COLOURS, GREY, RED, finish, line, log_range, note, panels, positive
from ...typing import Array
from ...units.wording import duration_text
from .verdicts import CLOSED, OPEN, display_name, interval_of

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
LIMIT = {"color": RED, "width": 1, "dash": "dash"}
"""The line of what the rule asks for."""
WIDEST_AXIS = 1e4
"""Ratio of the ends of a logarithmic axis at most, so that one diverging run does not flatten
all others."""


def _over_time(
    advice: Advice,
    label: str,
    height: int,
    log: bool,
    lines: Callable[[Arrays, int], Sequence[Array]],
) -> tuple[go.Figure, Array, list[Array]]:
    """(figure, its times in the unit of the axis, values shown at once) over time.

    lines: of a filter, of the curves of the mission's only cell and its place in them; the first is
    solid, others dashed. Resets that are not the answer wait in the legend.
    """
    curves, duration = advice.campaign.curves(advice.campaign.cells[0]), advice.scenario.duration
    scale, unit = (
        (1.0, "s") if duration < 600 else (60.0, "min") if duration < 5 * 3600 else (3600.0, "h")
    )
    labels, t = list(advice.campaign.manifest["filters"]), curves["t"] / scale
    resets = sorted((name for name in labels if name not in LINES), key=interval_of)
    colours = LINES | dict(zip(resets, cycle(RESET_COLOURS)))
    figure, seen = panels([label], height, log), []
    for name in advice.found:
        shown = name in LINES or name == advice.decision.filter
        for i, values in enumerate(lines(curves, labels.index(name))):
            style: dict[str, Any] = {"dash": "dash"} if i else {}
            line(figure, t, values, display_name(name), colours[name], legend=not i, **style)
            figure.data[-1].visible = True if shown else "legendonly"
            seen += [values] if shown else []
    figure.update_xaxes(title_text=f"time [{unit}]", range=[0, float(t[-1])])
    return figure, t, seen


def _errors(
    advice: Advice, label: str, length: Callable[[Array], Array], factor: float = 1.0
) -> go.Figure:
    """RMSE, stated standard deviation and bound of one quantity; `length` makes it of (n, 15)
    values."""

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [factor * length(curves[name][place]) for name in ("rmse", "sd")]

    figure, t, seen = _over_time(advice, label, 290, True, lines)
    bound = factor * length(advice.campaign.curves(advice.campaign.cells[0])["bound"])
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
    values = positive(*seen, bound)
    if len(values):
        log_range(figure, max(values.min(), 1e-9), min(values.max(), WIDEST_AXIS * values.min()))
    return figure


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

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [np.where(curves["alive"][place] > 0, curves["nees"][place], np.nan)]

    figure, _, seen = _over_time(advice, "NEES per state", 290, True, lines)
    low, high = (value / STATES for value in band(STATES, advice.campaign.manifest["runs"]))
    # after the lines: plotly draws no shapes in an empty panel
    figure.add_hrect(low, high, fillcolor="rgba(134,142,150,0.3)", line_width=0, layer="below")
    belief = advice.rules.belief
    for limit in (1 / belief, belief):
        figure.add_hline(limit, line=LIMIT)
    largest = np.nanmax(np.concatenate(seen), initial=belief)
    log_range(figure, 0.6 / belief, min(largest, WIDEST_AXIS))
    return figure


def survival(advice: Advice) -> go.Figure:
    """Share of the runs that are alive over time, with the least that the rule asks for."""
    runs = advice.campaign.manifest["runs"]

    def lines(curves: Arrays, place: int) -> list[Array]:
        return [100 * curves["alive"][place] / runs]

    figure, _, _ = _over_time(advice, "runs alive [%]", 210, False, lines)
    figure.add_hline(100 * advice.rules.survival, line=LIMIT)
    return figure.update_yaxes(range=[-4, 104])


def crossover(advice: Advice) -> go.Figure:
    """The map: a panel per motion, a row per IMU, a column per duration; the colour is the
    answer."""
    rows, kinds = advice.map, list(FILLS)
    motions, imus, times = (
        list(dict.fromkeys(row[name] for row in rows)) for name in ("motion", "imu", "duration_s")
    )
    figure = make_subplots(
        rows=len(motions),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.13,
        subplot_titles=[f"{motion} flight" for motion in motions],
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
                x=[duration_text(t) for t in times],
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
    finish(figure, 110 + len(motions) * (70 + 34 * len(imus)))
    return figure.update_layout(margin={"l": 90, "t": 36, "b": 50}, hovermode="closest")


def _mark(cell: dict[str, Any]) -> str:
    if cell["answer"] == "undecided":
        return "?"
    text = f"{interval_of(cell['filter']):g} s" if cell["answer"] == "reset" else cell["answer"]
    return text + ("" if cell["sure"] else " ?")
