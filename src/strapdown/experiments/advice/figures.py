"""Figures of the page of an advice: how those of its study draw the filters, and the crossover map."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ...pages.drawing import COLOURS, finish
from ...units.wording import duration_text
from ..monte_carlo import figures as study_figures
from .verdicts import CLOSED, OPEN, display_name, interval_of

if TYPE_CHECKING:
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
"""Colours of the map's answers, pale so that black text can be read on them."""


def curves_of(advice: Advice) -> study_figures.CellCurves:
    """Return the curves of the mission's only cell; resets that are not the answer wait in the
    legend."""
    labels = list(advice.campaign.manifest["filters"])
    resets = sorted((name for name in labels if name not in LINES), key=interval_of)
    colours = LINES | dict(zip(resets, cycle(RESET_COLOURS)))
    entries = [
        study_figures.Entry(
            name,
            display_name(name),
            colours[name],
            name in LINES or name == advice.decision.filter,
        )
        for name in advice.found
    ]
    return study_figures.curves_of(advice.campaign, advice.campaign.cells[0], entries)


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
