"""Figures 2 to 7 of Mollaei et al. redrawn, and what they do not show: control inputs with fixes,
errors over time, ratios, the turning flight, the readings of the EKF.

In their colours: blue without a filter, EKF grey (theirs is black, which a dark page hides), UKF
red, PKF green.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.pages.drawing import (
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

from ..common.figures import Marks, names_down
from ..common.paired_ratios import ratio
from .cells import (
    AT_TRIM,
    CUT,
    E0,
    E1,
    E2,
    EKF,
    EKFS,
    FULL,
    HELD,
    IMU,
    MODEL,
    MODES,
    NO_FILTER,
    ONCE,
    PKF,
    SENSORS,
    TRUTH,
    TURN,
    UKF,
    FlightCase,
)
from .metrics import DEVIATIONS, FlightRecord
from .runs import MollaeiResults

COLOUR = {
    NO_FILTER: COLOURS[0],
    EKF: GREY,
    AT_TRIM: COLOURS[1],
    ONCE: COLOURS[3],
    HELD: COLOURS[5],
    UKF: RED,
    PKF: COLOURS[2],
    TRUTH: COLOURS[1],
}
STYLE: dict[str, dict[str, Any]] = {
    EKF: {"width": 2.6},
    **dict.fromkeys((AT_TRIM, ONCE, HELD), {"width": 1.4}),
    UKF: {"width": 1.8, "dash": "dash"},
    PKF: {"width": 1.4, "dash": "dot"},
    TRUTH: {"width": 1.0},
    NO_FILTER: {"width": 1.4},
}
"""Coinciding curves, as those of one filter, differ in their dashes."""
SHARE = 4.0
"""Frames hold the filters' and the reference's values and this many times their range about
them; what leaves it is named."""
FIRST = "First seed, whatever it looks like. "
SHADED = FIRST + "Shaded: no fixes. "
Signal: TypeAlias = tuple[str, Callable[[str, FlightRecord], Array]]
"""(label of its panel, values (n,) of the flight of a mode)."""


def _column(field: str, column: int | None = None) -> Callable[[str, FlightRecord], Array]:
    """A field of Record, or one column of it."""
    at = ... if column is None else (slice(None), column)
    return lambda mode, record: getattr(record, field)[at]


def _estimate(axis: int) -> Callable[[str, FlightRecord], Array]:
    """The estimated place of the aircraft; of the reference flight the true one."""
    return lambda mode, record: (
        record.place[:, axis] - (record.position[:, axis] if mode != TRUTH else 0.0)
    )


FORCES = tuple((f"F{axis} [N]", _column("force", k)) for k, axis in enumerate("xyz"))
SPEEDS = (
    ("u, X [m/s]", _column("velocity", 0)),
    ("v, Y [m/s]", _column("velocity", 1)),
    ("w, Z [m/s]", _column("velocity", 2)),
)
CONTROLS = (
    ("Ua, aileron<br>[deg]", _column("surfaces", 0)),
    ("Ue, elevator<br>[deg]", _column("surfaces", 1)),
    ("Ur, rudder<br>[deg]", _column("surfaces", 2)),
    ("engine speed<br>[rad/s]", _column("engine")),
    ("AOF, angle of<br>attack [deg]", _column("alpha")),
)
PLACES = (
    ("X, north [m]", _estimate(0)),
    ("Y, east [m]", _estimate(1)),
    ("Z, down [m]", _estimate(2)),
)
DRIVEN = (("a", IMU), ("b", MODEL))


def all_figures(
    results: MollaeiResults, tables: dict[FlightCase, pd.DataFrame]
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page; results: runs.Results, tables:
    cells.wide of its scores."""
    return [
        (
            "Figure 1: control inputs with fixes (E0)",
            over_time(results, FlightCase(E0), CONTROLS),
            FIRST + "Not in the paper, which speaks of them.",
        ),
        (
            "Figure 2 redrawn: forces with fixes (E0)",
            over_time(results, FlightCase(E0), FORCES),
            FIRST + "Aerodynamic and propulsive, along the body axes.",
        ),
        (
            "Figure 3 redrawn: body speed with fixes (E0)",
            over_time(results, FlightCase(E0), SPEEDS),
            FIRST + "True velocity of the aircraft along its axes.",
        ),
        *(
            (
                f"Figure 4{letter} redrawn: control inputs, GPS cut at 15 s, {each}-driven (E1)",
                over_time(results, FlightCase(E1, prediction=each), CONTROLS),
                SHADED + ALIKE * (each == IMU),
            )
            for letter, each in DRIVEN
        ),
        *(
            (
                f"Figure 5{letter} redrawn: position, GPS cut at 15 s, {each}-driven (E1)",
                over_time(results, FlightCase(E1, prediction=each), PLACES, 170, everything=True),
                SHADED + "Estimates; the curve of the true state is where that flight was.",
            )
            for letter, each in DRIVEN
        ),
        *(
            (
                f"Figure {number}{letter} redrawn: {title}, no GPS for five minutes, {each}-driven "
                f"(E2)",
                over_time(results, FlightCase(E2, prediction=each), signals),
                SHADED,
            )
            for number, title, signals in ((6, "forces", FORCES), (7, "control inputs", CONTROLS))
            for letter, each in DRIVEN
        ),
        ("Figure 8: growth of the errors in 10 s (E1)", growth(results, E1), OVER_SEEDS),
        ("Figure 9: ratios of the deviations", ratios(tables), RATIOS),
        ("Figure 10: growth of the errors in five minutes (E2)", growth(results, E2), OVER_SEEDS),
        (
            "Figure 11: the turning flight seen from above",
            turning_figure(results),
            FIRST + "True path of the aircraft; a mark where the fixes end.",
        ),
        (
            "Figure 12: growth of the errors in 10 s by what is linearised where (E1)",
            growth(results, E1, (*EKFS, UKF)),
            OF_READINGS + OVER_SEEDS,
        ),
    ]


ALIKE = "EKF and UKF are one filter here, and their curves coincide."
OVER_SEEDS = (
    "Horizontal error of the estimate, and distance of the aircraft from the reference flight at "
    "the same time: "
    "median over the seeds, dotted the 10 and 90 % quantiles; flights that stopped count as "
    "infinitely far off. Logarithmic."
)
OF_READINGS = (
    "; ".join(f"{ekf}: {text}" for ekf, text in EKFS.items())
    + ". Driven by the IMU the first two are one filter. "
)
RATIOS = (
    "Rms deviations from the final value: geometric means over the seeds with 95 % intervals; left "
    "of 1: the first one is smaller. "
    "Gx, Gy, Gz as weight (N) and as moment (N m)."
)


def over_time(
    results: MollaeiResults,
    case: FlightCase,
    signals: tuple[Signal, ...],
    height: int = 140,
    everything: bool = False,
) -> go.Figure:
    """A panel per signal with the reference flight and the modes of a case; everything: frames
    hold also what no filter does."""
    runs = _runs(results, case)
    drawn = panels([label for label, _ in signals], height=height)
    for row, (label, of) in enumerate(signals, 1):
        values = {mode: of(mode, record) for mode, record in runs.items()}
        for mode, y in values.items():
            line(drawn, runs[mode].t, y, mode, COLOUR[mode], row=row, **STYLE[mode])
        if not everything:
            _frame_panel(drawn, row, label.replace("<br>", " "), values)
    end = max((float(record.t[-1]) for record in runs.values()), default=1.0)
    if case.experiment != E0:
        drawn.add_vrect(CUT, end, fillcolor=WITHHELD, line_width=0, layer="below")
    for mode, record in runs.items():
        if record.stopped:
            note(drawn, f"{mode}: {record.stopped}.")
    drawn.update_xaxes(range=[0.0, end])
    return drawn.update_xaxes(title_text="time [s]", row=len(signals), col=1)


def _runs(results: MollaeiResults, case: FlightCase) -> dict[str, FlightRecord]:
    """{mode: Record} of the first seed, the reference flight first; without a filter there is
    one reading."""
    found = {TRUTH: results.references.get(case.experiment)}
    for mode in MODES:
        flown = case._replace(prediction=IMU) if mode == NO_FILTER else case
        found[mode] = results.samples.get((flown, mode))
    return {mode: record for mode, record in found.items() if record is not None and len(record.t)}


def _frame_panel(drawn: go.Figure, row: int, label: str, values: dict[str, Array]) -> None:
    """The frame of a panel holds all but what no filter does, where that is much more."""
    outside = values.get(NO_FILTER)
    shown = [own[np.isfinite(own)] for mode, own in values.items() if mode != NO_FILTER]
    if outside is None or not shown:
        return
    low, high = min(map(np.min, shown)), max(map(np.max, shown))
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-6) * SHARE
    least, most = np.nanmin(outside), np.nanmax(outside)
    if least < middle - half or most > middle + half:
        drawn.update_yaxes(range=[middle - half, middle + half], row=row, col=1)
        note(
            drawn,
            f"Outside the frame without a filter: {label} from {least:.3g} to {most:.3g}.",
        )


def growth(results: MollaeiResults, experiment: str, modes: Sequence[str] = MODES) -> go.Figure:
    """Medians and quantiles over the seeds of horizontal error (left) and distance of the
    aircraft (right), both predictions."""
    titles = [
        f"{each}-driven: {what}"
        for each in (MODEL, IMU)
        for what in ("error of the estimate", "aircraft from the reference flight")
    ]
    drawn = make_subplots(
        rows=2, cols=2, horizontal_spacing=0.09, vertical_spacing=0.16, subplot_titles=titles
    )
    thin = {"width": 0.8, "dash": "dot"}
    for row, each in enumerate((MODEL, IMU), 1):
        for mode in modes:
            case = FlightCase(experiment, prediction=IMU if mode == NO_FILTER else each)
            if (case, mode) not in results.curves:
                continue
            t, values = results.curves[case, mode]
            ends = np.quantile(values, (0.1, 0.5, 0.9), axis=0, method="inverted_cdf")
            for quantile, style in zip(ends, (thin, STYLE[mode], thin)):
                for col, y in enumerate(quantile, 1):
                    drawn.add_trace(
                        go.Scatter(
                            x=t,
                            y=np.where(np.isfinite(y) & (y > 0), y, np.nan),
                            mode="lines",
                            name=mode,
                            legendgroup=mode,
                            line={"color": COLOUR[mode], **style},
                            showlegend=style is not thin and row == col == 1,
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


def ratios(tables: dict[FlightCase, pd.DataFrame]) -> go.Figure:
    """Ratios of DEVIATIONS of the pairs of filters, a panel per case with Q and R from the
    sensors."""
    cases = [
        case
        for case in tables
        if case.experiment in (E0, E1, E2)
        and case.form != FULL
        and case.tuning == SENSORS
        and not case.condition
    ]
    titles = [f"{case.experiment}, {case.prediction}" for case in cases]
    drawn = make_subplots(
        rows=1,
        cols=max(len(cases), 1),
        shared_yaxes=True,
        horizontal_spacing=0.015,
        subplot_titles=titles,
    )
    known = [0.9, 1.1]
    for col, case in enumerate(cases, 1):
        for k, (pair, symbol) in enumerate(zip(PAIRS, ("circle", "diamond", "square"))):
            found = [ratio(tables[case], measure, *pair) for measure in DEVIATIONS]
            values, *ends = np.array(found, float)[:, :3].T
            known += [each for each in np.ravel([values, *ends]) if 0 < each < np.inf]
            made = Marks(
                values,
                np.arange(len(DEVIATIONS)) + 0.2 * (k - 1),
                " / ".join(pair),
                COLOURS[k + 1],
                tuple(ends),
                along="x",
                hover="%{x:.3g}",
            )
            made.draw(drawn, col=col, legend=col == 1, size=6, symbol=symbol)
        drawn.add_vline(x=1, line={"color": GREY, "width": 1, "dash": "dot"}, row=1, col=col)
    low, high = np.log10(min(known)) - 0.05, np.log10(max(known)) + 0.05
    drawn.update_xaxes(type="log", range=[low, high], title_text="ratio", **log_ticks(low, high))
    drawn.update_yaxes(**names_down([SHORT[name] for name in DEVIATIONS]))
    return finish(drawn, 460).update_layout(
        hovermode="closest", margin={"t": 84}, legend={"y": 1.1}
    )


def turning_figure(results: MollaeiResults) -> go.Figure:
    """Path of the turning flight, IMU-driven, beside that of the reference."""
    drawn = panels(["north [m]"], height=440)
    for mode, record in _runs(results, FlightCase(TURN)).items():
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
        if mode == TRUTH:
            at = np.flatnonzero(record.t >= CUT)[:1]
            x, y = record.place[at, 1], record.place[at, 0]
            Marks(x, y, "fixes end", GREY).draw(drawn, size=9, symbol="x")
    drawn.update_xaxes(title_text="east [m]")
    drawn.update_yaxes(scaleanchor="x", scaleratio=1)
    return drawn.update_layout(hovermode="closest")
