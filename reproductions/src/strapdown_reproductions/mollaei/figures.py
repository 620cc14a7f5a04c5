"""Figures 2 to 7 of Mollaei et al. redrawn, and what they do not show: control inputs with fixes,
errors over time, ratios, the turning flight.

In their colours: blue without a filter, EKF grey (theirs is black, which a dark page hides), UKF
red, PKF green.
"""

from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.reports.drawing import (
    COLOURS,
    GREY,
    RED,
    WITHHELD,
    finish,
    line,
    log_ticks,
    note,
    panels,
)
from strapdown.typing import Array

from ..common.paired_ratios import ratio
from .cells import (
    CUT,
    E0,
    E1,
    E2,
    EKF,
    FULL,
    IMU,
    MODEL,
    MODES,
    NO_FILTER,
    PKF,
    SENSORS,
    TRUTH,
    TURN,
    UKF,
    Case,
)
from .metrics import Record
from .rules import DEVIATIONS
from .runs import Results

COLOUR = {NO_FILTER: COLOURS[0], EKF: GREY, UKF: RED, PKF: COLOURS[2], TRUTH: COLOURS[1]}
STYLE: dict[str, dict[str, Any]] = {
    EKF: {"width": 2.6},
    UKF: {"width": 1.8, "dash": "dash"},
    PKF: {"width": 1.4, "dash": "dot"},
    TRUTH: {"width": 1.0},
    NO_FILTER: {"width": 1.4},
}
"""Curves that coincide, as those of one filter do, are told apart by their strokes."""
SHARE = 4.0
"""Frames hold the filters' and the reference's values and this many times their range about
them; what leaves it is named."""
FIRST = "First seed, whatever it looks like. "
SHADED = FIRST + "Shaded: no fixes. "
FORCES = (("Fx [N]", "force", 0), ("Fy [N]", "force", 1), ("Fz [N]", "force", 2))
SPEEDS = (
    ("u, X [m/s]", "velocity", 0),
    ("v, Y [m/s]", "velocity", 1),
    ("w, Z [m/s]", "velocity", 2),
)
CONTROLS = (
    ("Ua, aileron<br>[deg]", "surfaces", 0),
    ("Ue, elevator<br>[deg]", "surfaces", 1),
    ("Ur, rudder<br>[deg]", "surfaces", 2),
    ("engine speed<br>[rad/s]", "engine", None),
    ("AOF, angle of<br>attack [deg]", "alpha", None),
)
PLACES = (("X, north [m]", 0), ("Y, east [m]", 1), ("Z, down [m]", 2))
DRIVEN = (("a", IMU), ("b", MODEL))


def all_figures(
    results: Results, tables: dict[Case, pd.DataFrame]
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page; results: runs.Results, tables:
    cells.wide of its scores."""
    found = [
        (
            "Figure 1: control inputs with fixes (E0)",
            over_time(results, Case(E0), CONTROLS),
            FIRST + "Not in the paper, which speaks of them.",
        ),
        (
            "Figure 2 redrawn: forces with fixes (E0)",
            over_time(results, Case(E0), FORCES),
            FIRST + "Aerodynamic and propulsive, along the body axes.",
        ),
        (
            "Figure 3 redrawn: body speed with fixes (E0)",
            over_time(results, Case(E0), SPEEDS),
            FIRST + "True velocity of the aircraft along its axes.",
        ),
    ]
    found += [
        (
            f"Figure 4{letter} redrawn: control inputs, GPS cut at 15 s, {each}-driven (E1)",
            over_time(results, Case(E1, prediction=each), CONTROLS),
            SHADED + ALIKE * (each == IMU),
        )
        for letter, each in DRIVEN
    ]
    found += [
        (
            f"Figure 5{letter} redrawn: position, GPS cut at 15 s, {each}-driven (E1)",
            positions(results, Case(E1, prediction=each)),
            SHADED + "Estimates; the curve of the true state is where that flight was.",
        )
        for letter, each in DRIVEN
    ]
    for number, title, rows in ((6, "forces", FORCES), (7, "control inputs", CONTROLS)):
        found += [
            (
                f"Figure {number}{letter} redrawn: {title}, no GPS for five minutes, {each}-driven "
                f"(E2)",
                over_time(results, Case(E2, prediction=each), rows),
                SHADED,
            )
            for letter, each in DRIVEN
        ]
    found += [
        ("Figure 8: growth of the errors in 10 s (E1)", growth(results, E1), OVER_SEEDS),
        ("Figure 9: ratios of the deviations", ratios(tables), RATIOS),
        ("Figure 10: growth of the errors in five minutes (E2)", growth(results, E2), OVER_SEEDS),
        (
            "Figure 11: the turning flight seen from above",
            turning(results),
            FIRST + "True path of the aircraft; a mark where the fixes end.",
        ),
    ]
    return found


ALIKE = "EKF and UKF are one filter here, and their curves coincide."
OVER_SEEDS = (
    "Horizontal error of the estimate, and distance of the aircraft from the reference flight at "
    "the same time: "
    "median over the seeds, dotted the 10 and 90 % quantiles; flights that stopped count as "
    "infinitely far off. Logarithmic."
)
RATIOS = (
    "Rms deviations from the final value: geometric means over the seeds with 95 % intervals; left "
    "of 1: the first one is smaller. "
    "Gx, Gy, Gz as weight (N) and as moment (N m)."
)


def over_time(
    results: Results, case: Case, rows: tuple[tuple[str, str, int | None], ...]
) -> go.Figure:
    """A panel per signal (label, field of Record, column) with the reference flight and the
    modes of a case."""
    runs = _runs(results, case)
    drawn = panels([label for label, _, _ in rows], height=140)
    for row, (label, field, column) in enumerate(rows, 1):
        of = lambda record: (
            getattr(record, field) if column is None else getattr(record, field)[:, column]
        )
        _panel(drawn, row, label, {mode: (record.t, of(record)) for mode, record in runs.items()})
    return _finished(drawn, case, runs, len(rows))


def positions(results: Results, case: Case) -> go.Figure:
    """Estimated position north, east, down of the start; of the reference flight the true one."""
    runs = _runs(results, case)
    drawn = panels([label for label, _ in PLACES], height=170)
    for row, (label, axis) in enumerate(PLACES, 1):
        estimate = lambda mode, record: (
            record.place[:, axis] - (0.0 if mode == TRUTH else record.position[:, axis])
        )
        _panel(
            drawn,
            row,
            label,
            {mode: (record.t, estimate(mode, record)) for mode, record in runs.items()},
            everything=True,
        )
    return _finished(drawn, case, runs, len(PLACES))


def _runs(results: Results, case: Case) -> dict[str, Record]:
    """{mode: Record} of the first seed, the reference flight first; without a filter there is
    one reading."""
    found = {TRUTH: results.references.get(case.experiment)}
    for mode in MODES:
        found[mode] = results.samples.get(
            (case._replace(prediction=IMU) if mode == NO_FILTER else case, mode)
        )
    return {mode: record for mode, record in found.items() if record is not None and len(record.t)}


def _panel(
    drawn: go.Figure,
    row: int,
    label: str,
    curves: dict[str, tuple[Array, Array]],
    everything: bool = False,
) -> None:
    """Lines of one panel; its frame holds all but what no filter does, where that is much more."""
    for mode, (t, values) in curves.items():
        line(drawn, t, values, mode, COLOUR[mode], row=row, **STYLE[mode])
    shown = [
        values[np.isfinite(values)] for mode, (_, values) in curves.items() if mode != NO_FILTER
    ]
    if NO_FILTER not in curves or everything or not shown:
        return
    low, high = min(map(np.min, shown)), max(map(np.max, shown))
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-6) * SHARE
    outside = curves[NO_FILTER][1]
    if np.nanmin(outside) < middle - half or np.nanmax(outside) > middle + half:
        drawn.update_yaxes(range=[middle - half, middle + half], row=row, col=1)
        note(
            drawn,
            f"Outside the frame without a filter: {label.replace('<br>', ' ')} from "
            f"{np.nanmin(outside):.3g} to {np.nanmax(outside):.3g}.",
        )


def _finished(drawn: go.Figure, case: Case, runs: dict[str, Record], rows: int) -> go.Figure:
    end = max((float(record.t[-1]) for record in runs.values()), default=1.0)
    if case.experiment != E0:
        drawn.add_vrect(CUT, end, fillcolor=WITHHELD, line_width=0, layer="below")
    drawn.update_xaxes(range=[0.0, end])
    for mode, record in runs.items():
        if record.stopped:
            note(drawn, f"{mode}: {record.stopped}.")
    return drawn.update_xaxes(title_text="time [s]", row=rows, col=1)


def growth(results: Results, experiment: str) -> go.Figure:
    """Medians and quantiles over the seeds of horizontal error (left) and distance of the
    aircraft (right), both predictions."""
    titles = [
        f"{each}-driven: {what}"
        for each in (IMU, MODEL)
        for what in ("error of the estimate", "aircraft from the reference flight")
    ]
    drawn = make_subplots(
        rows=2, cols=2, horizontal_spacing=0.09, vertical_spacing=0.16, subplot_titles=titles
    )
    for row, each in enumerate((IMU, MODEL), 1):
        for mode in MODES:
            found = results.curves.get(
                (Case(experiment, prediction=IMU if mode == NO_FILTER else each), mode)
            )
            if found is None:
                continue
            t, values = found
            for col in (1, 2):
                quantiles = np.quantile(
                    values[:, col - 1], (0.1, 0.5, 0.9), axis=0, method="inverted_cdf"
                )
                for k, y in enumerate(quantiles):
                    style = STYLE[mode] if k == 1 else {"width": 0.8, "dash": "dot"}
                    drawn.add_trace(
                        go.Scatter(
                            x=t,
                            y=np.where(np.isfinite(y) & (y > 0), y, np.nan),
                            mode="lines",
                            name=mode,
                            legendgroup=mode,
                            line={"color": COLOUR[mode], **style},
                            showlegend=k == 1 and row == col == 1,
                            hovertemplate="%{y:.3g} m",
                        ),
                        row=row,
                        col=col,
                    )
    drawn.update_yaxes(type="log", exponentformat="power", dtick=1)
    drawn.update_yaxes(title_text="[m]", col=1)
    drawn.update_xaxes(title_text="time [s]", row=2)
    drawn.add_vline(x=CUT, line={"color": GREY, "width": 1, "dash": "dot"})
    return finish(drawn, 640).update_layout(margin={"t": 84}, legend={"y": 1.06})


PAIRS = ((UKF, EKF), (PKF, EKF), (PKF, UKF))
SHORT = {
    "fx_n": "Fx",
    "fz_n": "Fz",
    "gx_n": "Gx weight",
    "gz_n": "Gz weight",
    "mx_nm": "Gx moment",
    "my_nm": "Gy moment",
    "mz_nm": "Gz moment",
}


def ratios(tables: dict[Case, pd.DataFrame]) -> go.Figure:
    """Ratios of DEVIATIONS of the pairs of filters, a panel per case with Q and R from the
    sensors."""
    cases = [
        case
        for case in tables
        if case.experiment in (E0, E1, E2) and case.form != FULL and case.tuning == SENSORS
    ]
    titles = [
        E0 if case.experiment == E0 else f"{case.experiment}, {case.prediction}" for case in cases
    ]
    drawn = make_subplots(
        rows=1,
        cols=max(len(cases), 1),
        shared_yaxes=True,
        horizontal_spacing=0.015,
        subplot_titles=titles,
    )
    ends = [0.9, 1.1]
    for col, case in enumerate(cases, 1):
        for k, (first, second) in enumerate(PAIRS):
            found = [ratio(tables[case], measure, first, second) for measure in DEVIATIONS]
            values, low, high = (
                np.array([getattr(each, name) for each in found], float)
                for name in ("value", "low", "high")
            )
            ends += [*low[low > 0], *high[np.isfinite(high)], *values[values > 0]]
            drawn.add_trace(
                go.Scatter(
                    x=values,
                    y=np.arange(len(DEVIATIONS)) + 0.2 * (k - 1),
                    mode="markers",
                    name=f"{first} / {second}",
                    legendgroup=str(k),
                    showlegend=col == 1,
                    marker={
                        "color": COLOURS[k + 1],
                        "size": 6,
                        "symbol": ("circle", "diamond", "square")[k],
                    },
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
    low, high = np.log10(min(ends)) - 0.05, np.log10(max(ends)) + 0.05
    drawn.update_xaxes(type="log", range=[low, high], title_text="ratio", **log_ticks(low, high))
    drawn.update_yaxes(
        tickmode="array",
        tickvals=list(range(len(DEVIATIONS))),
        ticktext=[SHORT[name] for name in DEVIATIONS],
        range=[len(DEVIATIONS) - 0.5, -0.5],
    )
    return finish(drawn, 460).update_layout(
        hovermode="closest", margin={"t": 84}, legend={"y": 1.1}
    )


def turning(results: Results) -> go.Figure:
    """Path of the turning flight, IMU-driven, beside that of the reference."""
    drawn = panels(["north [m]"], height=440)
    for mode, record in _runs(results, Case(TURN)).items():
        step = max(1, len(record.t) // 800)
        drawn.add_trace(
            go.Scatter(
                x=record.place[::step, 1],
                y=record.place[::step, 0],
                mode="lines",
                name=mode,
                line={"color": COLOUR[mode], **STYLE[mode]},
                hoverinfo="skip",
            )
        )
        cut = int(np.searchsorted(record.t, CUT))
        if mode == TRUTH and cut < len(record.t):
            drawn.add_trace(
                go.Scatter(
                    x=record.place[cut : cut + 1, 1],
                    y=record.place[cut : cut + 1, 0],
                    mode="markers",
                    name="fixes end",
                    marker={"color": GREY, "size": 9, "symbol": "x"},
                )
            )
    drawn.update_xaxes(title_text="east [m]")
    drawn.update_yaxes(scaleanchor="x", scaleratio=1)
    return drawn.update_layout(hovermode="closest")
