"""Figures of what was recorded: those that the report has of the sensors, fixes from above, and when
each source spoke."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go

from ...typing import Array
from .. import sensor_figures
from ..drawing import (
    COLOURS,
    GREY,
    column,
    corners,
    even_indices,
    finish,
    ground,
    origin,
    panels,
    path,
    seen_from_above,
    time_axis,
)

if TYPE_CHECKING:
    from ...data.recording import Recording


def sources(recording: Recording) -> go.Figure:
    """A row of marks for the IMU and for each source: when there are samples and fixes."""
    parts = [("IMU", recording.imu.t), *((a.name or a.kind, a.t) for a in recording.sources)]
    if recording.reference is not None:
        parts.append(("reference", recording.reference.t))
    zero = origin(recording.imu.t)
    figure = panels([""], 25 + 34 * len(parts))
    for i, (name, t) in enumerate(parts):
        at = t[even_indices(len(t))]
        figure.add_trace(
            go.Scatter(
                x=column(at - zero),
                y=np.full(len(at), i),
                mode="markers",
                name=escape(name),
                marker={"symbol": "line-ns-open", "size": 13, "color": COLOURS[i % len(COLOURS)]},
                showlegend=False,
                hovertemplate="%{x:.2f} s",
            )
        )
    names = [f"{escape(name)} ({len(t)})" for name, t in parts]
    figure.update_yaxes(
        tickmode="array", tickvals=list(range(len(parts))), ticktext=names, autorange="reversed"
    )
    figure.update_layout(hovermode="closest")
    return time_axis(figure, recording, zero)


def track(recording: Recording) -> go.Figure | None:
    """Position fixes and the reference in metres east and north from the first of them; None where
    there is neither."""
    known = list(_places(recording))
    if not known:
        return None
    start = known[0][1][0]
    figure = finish(go.Figure(), 480)
    boxes = []
    for i, (name, lla, fixes) in enumerate(known):
        places = ground(lla, start)
        boxes.append(corners(places))
        if fixes:
            marker = {"size": 5, "color": COLOURS[i % len(COLOURS)]}
            path(figure, places[even_indices(len(places))], name, mode="markers", marker=marker)
        else:
            style = {"color": GREY, "width": 1.5, "dash": "dash"}
            path(figure, places[even_indices(len(places))], name, line=style)
    box = np.array([np.min([low for low, _ in boxes], 0), np.max([high for _, high in boxes], 0)])
    return seen_from_above(figure, box, 0.06)


def _places(recording: Recording) -> Iterator[tuple[str, Array, bool]]:
    """(name, known positions (n, 3), whether they are fixes) of all that has any."""
    found = [(a.name or a.kind, a.y, True) for a in recording.sources if a.kind == "position"]
    if recording.reference is not None:
        found.append(("reference", recording.reference.lla, False))
    for name, lla, fixes in found:
        whole = lla[np.isfinite(lla).all(axis=1)]
        if len(whole):
            yield name, whole, fixes


FIGURES: dict[str, tuple[str, Callable[[Recording], go.Figure | None]]] = {
    "readings": ("Specific force and angular rate", sensor_figures.readings),
    "temperature": ("Temperature of the IMU", sensor_figures.temperature),
    "spectra": ("Vibration", sensor_figures.spectra),
    "intervals": ("Intervals", sensor_figures.intervals),
    "sources": ("When each source spoke", sources),
    "track": ("Fixes and reference from above", track),
}
"""{name: (heading, function)}."""
