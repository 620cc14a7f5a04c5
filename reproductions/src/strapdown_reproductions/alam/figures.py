"""Figures of the study of Alam et al.: the flight, growth of the errors in the outages, the ratios
that decide the claims, Figure 4 recomputed."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.data.recording import Recording
from strapdown.geometry.geodesy import displacement
from strapdown.pages.drawing import COLOURS, GREY, WITHHELD, finish, line, log_ticks, note, panels
from strapdown.typing import Array, Ints

from ..common.figures import names_down, quantile_lines, side_by_side
from ..common.paired_ratios import ratio
from .readings import EKF, NLO, XKF
from .runs import AXES, CLOSED, FULL, SINCE, AlamResults, AlamRun, windows

COLOUR = dict(zip((EKF, NLO, XKF, FULL, CLOSED), COLOURS))
DEG = float(np.degrees(1.0))
ANGLES, BODY = ("roll", "pitch", "heading"), ("forward", "right", "down")
SHOWN = (EKF, NLO, XKF)
SYMBOLS = ("circle", "circle-open", "diamond", "diamond-open")
FRAMES = 4.0
"""Limit of the frames of errors and biases as a multiple of the 98 % quantile; larger values are
named below."""


def all_figures(
    results: AlamResults, growth: dict[str, pd.DataFrame], tables: dict[str, pd.DataFrame]
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page; growth: {recording: DataFrame}, tables:
    table1.wide of simulation and recordings."""
    path, height = flight(results.recording)
    return [
        (
            "Figures 2a and 3 of the paper: the flight seen from above, and the outages",
            path,
            "Thick: where position and velocity fixes are withheld, the red circles of Figure 3.",
        ),
        ("Figure 2b of the paper: its height", height, "Above the ellipsoid."),
        (
            "Figure 5a: growth of the errors in the simulated outages",
            growth_of_runs(results.growth),
            "Horizontal and vertical error by time in the outage: median over all outages and "
            "seeds, dotted the 10 and 90 % quantiles. "
            "Outages that a filter did not get through count as infinitely far off.",
        ),
        *(
            (
                f"Figure 5{letter}: growth of the errors in {name}",
                growth_of_recording(table),
                "As figure 5a, over the windows; here windows that a filter did not get through "
                "are left out.",
            )
            for letter, (name, table) in zip("bc", growth.items())
        ),
        (
            "Figure 6: ratios of RMSE",
            ratios(tables),
            "Geometric means over the seeds, or over the blocks of windows of a recording, "
            "with 95 % intervals. Left of 1: the XKF is better.",
        ),
        *(
            (
                f"Figure 4{letter} of the paper: {title}",
                drawn,
                f"{FIRST} {BIASES.get(title, '')}".strip(),
            )
            for letter, (title, drawn) in zip("abcde", figure4(results))
        ),
    ]


FIRST = (
    "First seed, whatever it looks like. Shaded: outages. Frames are chosen for the time after 300 "
    "s and hold all but "
    "extreme values of it; what leaves them then is named, what leaves them before is not."
)
BIASES = {
    "gyro biases": "Estimates also hold what errors of scale and axes make of steady turns: 0.2 % "
    "and 2 mrad are each 0.02 deg/s at 10 deg/s.",
    "accelerometer biases": "Estimates also hold what errors of scale and axes make of 1 g: 0.2 % "
    "and 2 mrad are each 0.02 m/s².",
}


def flight(recording: Recording) -> tuple[go.Figure, go.Figure]:
    """(path, height) of the reference with the outages marked."""
    truth = recording.reference
    t, p = truth.t[::100], displacement(truth.lla[::100], truth.lla[0])
    path, height = panels(["north [km]"], height=420), panels(["height [m]"], height=220)
    over_ground = lambda rows, **style: path.add_trace(
        go.Scatter(x=p[rows, 1] / 1e3, y=p[rows, 0] / 1e3, mode="lines", **style)
    )
    thin = {"color": GREY, "width": 1.2}
    over_ground(slice(None), name="flight", line=thin, hoverinfo="skip")
    line(height, t, truth.lla[::100, 2], "flight", GREY)
    for k, (start, stop) in enumerate(windows(), 1):
        thick = {"color": COLOURS[k - 1], "width": 4}
        over_ground((t >= start) & (t <= stop), name=f"outage {k}", line=thick)
    path.update_xaxes(title_text="east [km]")
    path.update_yaxes(scaleanchor="x", scaleratio=1)
    return path.update_layout(hovermode="closest"), _outages(height, t)


def figure4(results: AlamResults) -> list[tuple[str, go.Figure]]:
    """[(title, figure)] of the paper's Figure 4: attitude, gyro bias, position, velocity in body
    axes, accelerometer bias; as errors, or with truth."""
    rec, truth = results.recording, results.recording.reference
    b_a, b_g = rec.meta["b_a"], rec.meta["b_g"]
    some = next(iter(results.sample.values())).t if results.sample else truth.t[::20]
    rows, samples = _rows(truth.t, some), _rows(rec.imu.t, some)
    true_v_b = truth.rotation[rows].inv().apply(truth.v_n[rows].copy())
    turned = lambda run: (truth.rph[_rows(truth.t, run.t)] - run.rph + np.pi) % (2 * np.pi) - np.pi
    parts = (
        ("errors of roll, pitch and heading", ANGLES, "deg", lambda run: turned(run) * DEG, None),
        ("gyro biases", BODY, "deg/s", lambda run: run.b_g * DEG, (some, b_g[samples] * DEG)),
        ("errors of position", AXES, "m", lambda run: run.position, None),
        ("velocity in body axes", BODY, "m/s", lambda run: run.v_b, (some, true_v_b)),
        ("accelerometer biases", BODY, "m/s²", lambda run: run.b_a, (some, b_a[samples])),
    )
    return [
        (title, _lines(results.sample, names, unit, of, true))
        for title, names, unit, of, true in parts
    ]


def _rows(t: Array, wanted: Array) -> Ints:
    return np.clip(np.searchsorted(t, wanted - 1e-6), 0, len(t) - 1)


def _lines(
    sample: dict[str, AlamRun],
    names: tuple[str, ...],
    unit: str,
    of: Callable[[AlamRun], Array],
    true: tuple[Array, Array] | None,
) -> go.Figure:
    """A panel per component of what `of` takes from each AlamRun; true: (t, values) or None for an
    error."""
    drawn, outside = panels([f"{name}<br>[{unit}]" for name in names], height=150), []
    for i, name in enumerate(names):
        seen = [] if true is None else [true[1][:, i]]
        for label in SHOWN:
            if (run := sample.get(label)) is not None:
                line(drawn, run.t, of(run)[:, i], label, COLOUR[label], row=i + 1)
                seen.append(of(run)[run.t > 300.0, i])
        if true is not None:
            line(drawn, true[0], true[1][:, i], "true", GREY, row=i + 1, dash="dash")
        values = np.concatenate(seen) if seen else np.zeros(1)
        values = values[np.isfinite(values)]
        middle = 0.0 if true is None else float(np.median(values))
        reach, most = (
            np.quantile(np.abs(values - middle), share) if len(values) else 1.0
            for share in (0.98, 1.0)
        )
        limit = 1.08 * min(FRAMES * reach, most) or 1.0
        drawn.update_yaxes(range=[middle - limit, middle + limit], row=i + 1, col=1)
        if most > limit:
            outside.append(f"{name} {most:.3g} {unit}")
    if outside:
        note(drawn, f"Outside the frame after 300 s, by up to: {', '.join(outside)}.")
    return _outages(drawn, next(iter(sample.values())).t if sample else np.zeros(2), len(names))


def _outages(drawn: go.Figure, t: Array, rows: int = 1) -> go.Figure:
    for start, stop in windows():
        drawn.add_vrect(start, stop, fillcolor=WITHHELD, line_width=0, layer="below")
    drawn.update_xaxes(range=[0.0, float(t[-1])])
    return drawn.update_xaxes(title_text="time [s]", row=rows, col=1)


def growth_of_runs(growth: dict[str, Array]) -> go.Figure:
    """Median and quantiles of horizontal and vertical error over time in the outage, from the
    curves of runs.Results."""
    curves = {
        label: [
            np.quantile(part, (0.1, 0.5, 0.9), axis=0, method="inverted_cdf") for part in values
        ]
        for label, values in growth.items()
        if label in COLOUR and values.size
    }
    return _growth(curves, SINCE)


def growth_of_recording(table: pd.DataFrame) -> go.Figure:
    """The same from Comparison.growth."""
    curves = {}
    for label, own in table.groupby("filter", sort=False):
        if label in COLOUR:
            curves[label] = [
                own[[f"{part}_{share}_m" for share in ("p10", "median", "p90")]].to_numpy(float).T
                for part in ("horizontal", "vertical")
            ]
            since = own["since_s"].to_numpy(float)
    return _growth(curves, since if curves else SINCE)


def _growth(curves: dict[str, list[Array]], since: Array) -> go.Figure:
    drawn = make_subplots(
        rows=1, cols=2, horizontal_spacing=0.09, subplot_titles=["horizontal", "vertical"]
    )
    for label, parts in curves.items():
        for col, part in enumerate(parts, 1):
            quantile_lines(
                drawn,
                since,
                [np.where(np.isfinite(y), y, np.nan) for y in part],
                col,
                (2.0, 0.8),
                name=label,
                legendgroup=label,
                color=COLOUR[label],
                hovertemplate="%{y:.3g} m",
            )
    drawn.update_xaxes(title_text="time in the outage [s]")
    drawn.update_yaxes(title_text="error [m]", rangemode="tozero", row=1, col=1)
    drawn.update_yaxes(rangemode="tozero", row=1, col=2)
    return finish(drawn, 430).update_layout(margin={"t": 84}, legend={"y": 1.08})


def ratios(tables: dict[str, pd.DataFrame]) -> go.Figure:
    """Ratio of RMSE of both forms of the XKF to EKF and NLO per case and axis, with intervals."""
    pairs = ((XKF, EKF), (XKF, NLO), (FULL, EKF), (FULL, NLO))
    drawn = side_by_side(AXES)
    names, ends = list(tables), []
    for col, axis in enumerate(AXES, 1):
        for k, (first, second) in enumerate(pairs):
            found = [ratio(table, f"{axis}_rmse_m", first, second) for table in tables.values()]
            values, low, high = (
                np.array([getattr(each, name) for each in found], float)
                for name in ("value", "low", "high")
            )
            ends += [*low[low > 0], *high[np.isfinite(high)], *values[values > 0]]
            drawn.add_trace(
                go.Scatter(
                    x=values,
                    y=np.arange(len(names)) + 0.15 * (k - 1.5),
                    mode="markers",
                    name=f"{first} / {second}",
                    legendgroup=str(k),
                    showlegend=col == 1,
                    marker={"color": COLOURS[k], "size": 7, "symbol": SYMBOLS[k]},
                    hovertemplate="%{x:.3g}",
                    error_x={
                        "type": "data",
                        "array": np.nan_to_num(high - values),
                        "arrayminus": np.nan_to_num(values - low),
                        "width": 2,
                    },
                ),
                row=1,
                col=col,
            )
        drawn.add_vline(x=1, line={"color": GREY, "width": 1, "dash": "dot"}, row=1, col=col)
    low, high = (np.log10(min(ends, default=0.5)) - 0.05, np.log10(max(ends, default=2.0)) + 0.05)
    drawn.update_xaxes(
        type="log", range=[low, high], title_text="ratio of RMSE", **log_ticks(low, high)
    )
    drawn.update_yaxes(**names_down(names))
    return finish(drawn, 190 + 52 * len(names)).update_layout(
        hovermode="closest", margin={"t": 84}, legend={"y": 1.12}
    )
