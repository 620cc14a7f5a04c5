"""Figures of the BROAD comparison: rms errors per trial, and the error of each estimator over
the time of each trial."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from strapdown.pages.drawing import COLOURS, GREY, RED, column, finish, log_range, log_ticks, panels
from strapdown.typing import Array

from ..common.figures import side_by_side
from .peers import PEERS
from .trials import BroadTrial, TrialRun

DASHES = ("solid", "dash", "dot", "dashdot")
SLOW = "#a08060"
"""Colour of peers that are hidden until asked for: their errors would flatten the rest."""
SHADE = "rgba(134,142,150,0.16)"
SECOND = 1.0
"""s: a point of a curve is the rms over so much time."""


def figures(
    trials: Sequence[BroadTrial], runs: Sequence[TrialRun]
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page."""
    drawn = [
        (
            "Orientation, inclination and heading error",
            summary(trials, runs),
            "Rms during movement: each trial (its number when pointed at) and the mean over the "
            "trials. Logarithmic axes.",
        )
    ]
    for trial in trials:
        own = [run for run in runs if run.trial == trial.name]
        drawn.append(
            (
                f"{trial.name}: orientation error",
                over_time(trial, own),
                "Each point is the rms of one second, whatever of it has a reference. Shaded: no "
                "movement, not scored. "
                "A click in the legend hides or shows a line.",
            )
        )
    return drawn


def style(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Colour and dash of an estimator: strapdown's solid, the peers dashed, slow ones all of
    colour `SLOW`."""
    peers = {peer.name: peer for peer in PEERS}
    if name not in peers:
        return COLOURS[[n for n in names if n not in peers].index(name) % len(COLOURS)], "solid"
    fast = [n for n in names if n in peers and not peers[n].slow]
    if not peers[name].slow:
        return RED if fast.index(name) == 0 else GREY, "dash"
    return SLOW, DASHES[
        [n for n in names if n in peers and peers[n].slow].index(name) % len(DASHES)
    ]


def summary(trials: Sequence[BroadTrial], runs: Sequence[TrialRun]) -> go.Figure:
    """Rms errors: a panel per measure, for each estimator the mean over the trials and a circle
    per trial."""
    names = list(dict.fromkeys(run.estimator for run in runs))
    scored = {trial.name: trial.scored for trial in trials}
    rms = lambda run: np.degrees(
        np.sqrt((run.angles[scored[run.trial]].astype(float) ** 2).mean(axis=0))
    )
    values = {name: np.array([rms(run) for run in runs if run.estimator == name]) for name in names}
    drawn = side_by_side(("orientation", "inclination", "heading"))
    for i in range(3):
        place, known = (
            {"row": 1, "col": i + 1},
            np.concatenate([values[name][:, i] for name in names]),
        )
        drawn.add_trace(
            go.Scatter(
                x=known,
                y=np.repeat(names, len(trials)),
                mode="markers",
                name="one trial",
                legendgroup="one",
                showlegend=i == 0,
                text=[trial.number for trial in trials] * len(names),
                hovertemplate="trial %{text}: %{x:.3g} deg",
                marker={"color": GREY, "size": 7, "symbol": "circle-open"},
            ),
            **place,
        )
        drawn.add_trace(
            go.Scatter(
                x=[values[name][:, i].mean() for name in names],
                y=names,
                mode="markers",
                name="mean over the trials",
                legendgroup="mean",
                showlegend=i == 0,
                hovertemplate="mean %{x:.3g} deg",
                marker={
                    "color": [style(name, names)[0] for name in names],
                    "size": 13,
                    "symbol": "diamond",
                },
            ),
            **place,
        )
        low, high = np.log10(np.nanmin(known)) - 0.1, np.log10(np.nanmax(known)) + 0.1
        drawn.update_xaxes(
            type="log",
            title_text="rms error [deg]",
            range=[low, high],
            **log_ticks(low, high),
            **place,
        )
    drawn.update_yaxes(autorange="reversed")
    return finish(drawn, 150 + 30 * len(names)).update_layout(
        hovermode="closest", margin={"t": 70}, legend={"y": 1.0 + 26 / (40 + 30 * len(names))}
    )


def per_second(t: Array, angle: Array) -> tuple[Array, Array]:
    """(times, rms) of an angle (n,) over stretches of `SECOND`; NaN where a stretch has no known
    value."""
    stretch = np.floor((t - t[0]) / SECOND + 1e-9).astype(int)
    known = np.isfinite(angle)
    count = np.bincount(stretch[known], minlength=stretch[-1] + 1)
    square = np.bincount(
        stretch[known], np.asarray(angle, float)[known] ** 2, minlength=stretch[-1] + 1
    )
    return t[0] + (np.arange(len(count)) + 0.5) * SECOND, np.sqrt(
        square / np.where(count, count, np.nan)
    )


def over_time(trial: BroadTrial, runs: Sequence[TrialRun]) -> go.Figure:
    """Orientation error of each estimator over time, rms of each second, with shades where there
    is no movement; slow peers only in the legend."""
    names, t = [run.estimator for run in runs], trial.recording.imu.t
    drawn, most, least = panels(["orientation error [deg]"], height=330, log=True), 1.0, 1.0
    for run in runs:
        colour, dash = style(run.estimator, names)
        middle, error = per_second(t, np.degrees(run.angles[:, 0]))
        hidden = colour == SLOW
        drawn.add_trace(
            go.Scatter(
                x=column(middle),
                y=column(error),
                mode="lines",
                name=run.estimator,
                hovertemplate="%{y:.3g}",
                visible="legendonly" if hidden else True,
                line={"color": colour, "dash": dash, "width": 1.5},
            ),
            row=1,
            col=1,
        )
        if not hidden and np.isfinite(error).any():
            most, least = max(most, np.nanmax(error)), min(least, np.nanpercentile(error, 2))
    log_range(drawn, max(least, 0.05), most)
    drawn.update_xaxes(title_text="time [s]", range=[float(t[0]), float(t[-1])], row=1, col=1)
    edges = [
        float(t[0]),
        *(edge for window in trial.recording.meta["movement"] for edge in window),
        float(t[-1]),
    ]
    shaded = {
        "type": "rect",
        "y0": 0,
        "y1": 1,
        "xref": "x",
        "yref": "paper",
        "fillcolor": SHADE,
        "line": {"width": 0},
        "layer": "below",
    }
    shapes = [{**shaded, "x0": a, "x1": b} for a, b in zip(edges[::2], edges[1::2])]
    return drawn.update_layout(shapes=shapes)
