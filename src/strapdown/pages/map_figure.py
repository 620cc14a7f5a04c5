"""The track on a map, the one figure of a page that asks the network for something."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np
import plotly.graph_objects as go

from ..data.solution import Solution, Trajectory
from ..typing import Array
from .drawing import GREY, MAX_POINTS, each, even_indices, finish

HEIGHT = 560
"""px."""
CAPTION = (
    "This map comes from the network, tile.openstreetmap.org, whenever the page is opened: its "
    "servers learn from where it is asked for and which place it shows. © OpenStreetMap "
    "contributors, openstreetmap.org/copyright."
)


def track_map(
    solutions: Mapping[str, Solution], reference: Trajectory | None = None
) -> go.Figure | None:
    """The positions of {name: Solution} and of a reference on a street map; None where none is
    known."""
    figure, seen = finish(go.Figure(), HEIGHT), []

    def draw_line(t: Array, lla: Array, name: str, **line: object) -> None:
        known = np.flatnonzero(np.isfinite(lla[:, :2]).all(axis=1))
        rows = known[even_indices(len(known), MAX_POINTS)]
        if not len(rows):
            return
        places = np.degrees(np.unwrap(lla[rows, :2], axis=0))
        seen.append(places)
        figure.add_trace(
            go.Scattermap(
                lat=places[:, 0],
                lon=places[:, 1],
                mode="lines",
                name=escape(name),
                line=line,
                customdata=t[rows],
                hovertemplate="%{lat:.6f} deg, %{lon:.6f} deg, %{customdata:.1f} s",
            )
        )

    if reference is not None:
        draw_line(reference.t, reference.lla, "reference", color=GREY, width=4)
    for one in reversed(each(solutions)):
        draw_line(
            one.solution.t, one.solution.trajectory.lla, one.label(), color=one.colour, width=2
        )
    if not seen:
        return None
    low, high = (end(np.concatenate(seen), axis=0) for end in (np.min, np.max))
    # a world of 512 px at zoom 0, seen in some 500 px
    span = max(float(np.max((high - low) / [np.cos(np.radians(low[0])), 1.0])), 1e-3)
    figure.layout.meta["track"] = True
    return figure.update_layout(
        hovermode="closest",
        map={
            "style": "open-street-map",
            "center": {"lat": float(low[0] + high[0]) / 2, "lon": float(low[1] + high[1]) / 2},
            "zoom": float(np.clip(np.log2(0.8 * 360 / span), 0, 18)),
        },
    )
