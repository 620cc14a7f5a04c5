"""The figures of Hager & Bryne, redrawn from a campaign, and three more: errors over time beside
their bound, and what the drift of the raw INS does."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.core.loop.contract import POS
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.scoring import RUN_REASONS
from strapdown.pages.drawing import (
    COLOURS,
    GREY,
    RED,
    band,
    column,
    finish,
    frame,
    line,
    log_range,
    log_ticks,
    note,
    panels,
)
from strapdown.sim.scenario import Scenario
from strapdown.typing import Array

from ..common.figures import Marks
from .cells import LIMIT, ONSET, STRAIGHT, CellRows, Numbers, flight_of, numbers_of, rows_of
from .drift import Drift
from .rules import CellTables

BLUE, ORANGE = COLOURS[:2]
LOOPS = (("open", "open loop", BLUE), ("closed", "closed loop", ORANGE))
GRADES = ("consumer", "tactical", "navigation")
RUN = 0
"""Number of the run in figures of one run: the first, chosen in advance."""
STATES = tuple(
    f"{what} {axis} [{unit}]"
    for what, unit in (("pos.", "m"), ("vel.", "m/s"), ("rot.", "deg"))
    for axis in ("N", "E", "D")
)
BIASES = tuple(
    f"{what} {axis} [{unit}]"
    for what, unit in (("accel.", "m/s²"), ("gyro", "deg/h"))
    for axis in ("x", "y", "z")
)
WIDEST = 8.0
"""Half the height of a panel of errors, by the largest ±3σ of the filter: the band stays to be seen
where errors leave it."""
DARKER = {
    "selector": {"fill": "toself"},
    "fillcolor": "rgba(134,142,150,0.34)",
    "line": {"color": "#495057", "width": 1.0},
}
"""Options of `update_traces`: bands of ±3σ that other lines run through."""
SCALE = np.r_[np.ones(6), np.full(3, np.degrees(1))]
BIAS_SCALE = np.r_[np.ones(3), np.full(3, np.degrees(1) * 3600)]


def profiles(scenarios: Sequence[Scenario]) -> list[go.Figure]:
    """Figure 1: (plan, height) of Scenario values as small multiples."""
    columns = min(4, len(scenarios))
    count = -(-len(scenarios) // columns)
    plan, height = (
        make_subplots(
            rows=count,
            cols=columns,
            subplot_titles=_titles(scenarios),
            horizontal_spacing=0.07,
            vertical_spacing=0.26 / count,
        )
        for _ in range(2)
    )
    for i, scenario in enumerate(scenarios):
        truth, place = scenario.glance(800), {"row": i // columns + 1, "col": i % columns + 1}
        north, east = _kilometres(truth.lla)
        for drawn, x, y in ((plan, east, north), (height, truth.t / 60, truth.lla[:, 2])):
            drawn.add_trace(
                go.Scatter(
                    x=column(x),
                    y=column(y),
                    mode="lines",
                    line={"color": BLUE, "width": 1.3},
                    showlegend=False,
                ),
                **place,
            )
        begin = Marks(east[:1], north[:1], "start", ORANGE)
        begin.draw(plan, size=7, legend=i == 0, **place)
        plan.update_yaxes(scaleanchor=f"x{i + 1 if i else ''}", constrain="domain", **place)
        height.update_yaxes(range=_at_least(truth.lla[:, 2], 50.0), **place)
        if i + columns >= len(scenarios):
            plan.update_xaxes(title_text="east [km]", **place)
            height.update_xaxes(title_text="time [min]", **place)
    for drawn, each, text in ((plan, 250, "north [km]"), (height, 190, "height [m]")):
        drawn.update_yaxes(title_text=text, col=1).update_xaxes(constrain="domain")
        finish(drawn, each * count + 80).update_layout(hovermode="closest", legend={"y": 1.06})
    return [plan, height]


def in_space(scenarios: Sequence[Scenario]) -> go.Figure:
    """Figure 1 as the paper has it: the profiles in three dimensions of all Scenario values but the
    straight ones, a scene each, heights drawn as high as the flight is wide."""
    dynamic = [s for s in scenarios if flight_of(s.name) not in STRAIGHT] or list(scenarios)
    columns = min(3, len(dynamic))
    count = -(-len(dynamic) // columns)
    drawn = make_subplots(
        rows=count,
        cols=columns,
        specs=[[{"type": "scene"}] * columns] * count,
        subplot_titles=_titles(dynamic),
        horizontal_spacing=0.01,
        vertical_spacing=0.1 / count,
    )
    for i, scenario in enumerate(dynamic):
        lla = scenario.glance(800).lla
        north, east = _kilometres(lla)
        place = {"row": i // columns + 1, "col": i % columns + 1}
        drawn.add_trace(
            go.Scatter3d(
                x=column(east),
                y=column(north),
                z=column(lla[:, 2]),
                mode="lines",
                line={"color": BLUE, "width": 3},
                name=flight_of(scenario.name),
                showlegend=False,
            ),
            **place,
        )
        axes = {"xaxis": "east [km]", "yaxis": "north [km]", "zaxis": "height [m]"}
        drawn.update_scenes(
            {name: {"title": {"text": text}, "nticks": 4} for name, text in axes.items()},
            zaxis_range=_at_least(lla[:, 2], 100.0),
            aspectmode="manual",
            aspectratio={"x": 1, "y": 1, "z": 0.7},
            camera={"eye": {"x": 1.5, "y": -1.5, "z": 1.1}},
            **place,
        )
    return finish(drawn, 330 * count + 60).update_layout(
        hovermode="closest", font={"size": 10}, margin={"l": 5, "r": 5, "b": 5}
    )


def _titles(scenarios: Sequence[Scenario]) -> list[str]:
    return [f"{flight_of(s.name)}, {s.duration / 60:.0f} min" for s in scenarios]


def _kilometres(lla: Array) -> tuple[Array, Array]:
    """North and east, km, from the first row, on the sphere: for a look."""
    return (lla[:, 0] - lla[0, 0]) * 6371.0, (lla[:, 1] - lla[0, 1]) * 6371.0 * np.cos(lla[0, 0])


def _at_least(values: Array, span: float) -> list[float]:
    middle, half = (values.max() + values.min()) / 2, max(span, 1.15 * np.ptp(values)) / 2
    return [float(middle - half), float(middle + half)]


def _by_flight(
    cells: pd.DataFrame, label: str, height: int
) -> tuple[go.Figure, list[pd.DataFrame]]:
    """An empty panel per grade with flights along x, logarithmic; and the cells of each."""
    grades = [grade for grade in GRADES if (cells["grade"] == grade).any()] or list(
        dict.fromkeys(cells["grade"])
    )
    parts = [cells[cells["grade"] == grade] for grade in grades]
    drawn = panels([f"{grade}: {label}" for grade in grades], height=height, log=True)
    for row, own in enumerate(parts, 1):
        drawn.update_xaxes(
            tickvals=list(range(len(own))),
            ticktext=list(own["flight"]),
            range=[-0.6, len(own) - 0.4],
            showticklabels=True,
            row=row,
            col=1,
        )
    drawn.update_xaxes(title_text="flight", row=len(grades), col=1)
    return drawn.update_layout(hovermode="closest"), parts


POSITIONS = (
    ("rmse_m", "surviving runs ± std", "circle", 9, 0.0),
    ("censored_500_m", "all runs, 500 m rule alone", "circle-open", 7, 0.09),
    ("censored_m", "all runs, both abort rules", "x-thin-open", 7, -0.09),
)
"""(column of cells.table, what it is, symbol and size of its marks, how far they are aside)."""


def positions(cells: pd.DataFrame) -> go.Figure:
    """Figures 2 and 6: position RMSE per flight with survival, a panel per grade, from
    cells.table."""
    drawn, parts = _by_flight(cells, "RMSE [m]", 280)
    for row, own in enumerate(parts, 1):
        for (loop, name, colour), shift, top in zip(LOOPS, (-0.12, 0.12), (1600.0, 900.0)):
            x = np.arange(len(own)) + shift
            for key, said, symbol, size, aside in POSITIONS:
                y = own[f"{loop}_{key}"]
                ends = (y - own[f"{loop}_std_m"], y + own[f"{loop}_std_m"])
                made = Marks(
                    x + aside,
                    y,
                    f"{name}, {said}",
                    colour,
                    ends if key == "rmse_m" else None,
                    hover="%{y:.4g} m",
                )
                made.draw(
                    drawn,
                    row=row,
                    legend=row == 1,
                    symbol=symbol,
                    size=size,
                    line={"color": colour, "width": 1.3},
                )
            drawn.add_trace(
                go.Scatter(
                    x=x,
                    y=np.full(len(own), top),
                    mode="text",
                    textfont={"size": 10, "color": colour},
                    showlegend=False,
                    hoverinfo="skip",
                    text=[
                        f"{value:.0%}" if np.isfinite(value) else ""
                        for value in own[f"{loop}_survived"]
                    ],
                ),
                row=row,
                col=1,
            )
    drawn.update_yaxes(range=[np.log10(0.03), np.log10(2600)], dtick=1, exponentformat="power")
    return drawn.update_layout(margin={"t": 92})


def errors_of_a_run(campaign: Campaign, cell: str) -> list[go.Figure]:
    """Figure 3: (open, closed) errors of run RUN with what the filter states and what the bound
    allows, 3 sigma each."""
    numbers, ran = numbers_of(campaign, cell)
    rows, bound = rows_of(campaign, cell, numbers, ran), campaign.curves(cell)["bound"]
    found = []
    for place, (_, name, colour) in enumerate(LOOPS):
        drawn, outside = panels(STATES, height=125), []
        for row, (label, scale) in enumerate(zip(STATES, SCALE), 1):
            error, stated, least = (
                values[..., row - 1].astype(float) * scale
                for values in (rows.error[place, RUN], 3 * rows.std[place, RUN], 3 * bound)
            )
            zero = np.zeros(len(rows.t))
            band(drawn, rows.t, zero, stated, row=row, name="±3σ stated by the filter")
            line(drawn, rows.t, error, f"{name}: true − estimate", colour, row=row)
            if np.isfinite(least).any():
                bound_name = "±3σ of the Cramér-Rao bound"
                _edges(drawn, row, rows.t, zero, least, bound_name, colour=RED, width=1)
            limit, largest = frame_of_errors(rows.t, error, stated)
            drawn.update_yaxes(range=[-limit, limit], row=row, col=1)
            if largest > 1.1 * limit:
                outside.append(f"{label} {largest:.3g}")
        if outside:
            note(drawn, f"Largest values outside the frame: {', '.join(outside)}.")
        found.append(_mark_end(drawn.update_traces(**DARKER), rows, numbers, place))
    return found


def frame_of_errors(t: Array, error: Array, stated: Array) -> tuple[float, float]:
    """(half the height of a panel, the largest error): that of `drawing.frame`, no more than WIDEST
    times what is stated after the first tenth."""
    limit, largest = frame(t, error, stated)
    later = WIDEST * np.nanmax(stated[t >= 0.1 * t[-1]], initial=0.0)
    return min(limit, later) or limit, largest


def _edges(
    drawn: go.Figure,
    row: int,
    t: Array,
    centre: Array,
    half: Array,
    name: str,
    **style: Any,
) -> None:
    """Dotted lines `half` (n,) above and below `centre` (n,); style: colour and width."""
    for sign in (1, -1):
        y, legend = centre + sign * half, row == 1 and sign > 0
        line(drawn, t, y, name, row=row, legend=legend, dash="dot", **style)


def _along_time(drawn: go.Figure, rows: CellRows, last: int) -> go.Figure:
    drawn.update_xaxes(title_text="time [s]", row=last, col=1)
    return drawn.update_xaxes(range=[0, float(rows.t[-1])])


def _mark_end(drawn: go.Figure, rows: CellRows, numbers: Numbers, place: int) -> go.Figure:
    """The time axis, and where the run was given up."""
    reason, end = int(numbers["reason"][place, RUN]), float(numbers["lasted"][place, RUN])
    if reason:
        drawn.add_shape(
            type="line",
            x0=end,
            x1=end,
            y0=0,
            y1=1,
            xref="x",
            yref="paper",
            line={"width": 1, "dash": "dash", "color": GREY},
        )
        note(
            drawn,
            f"Dashed vertical line, {end:.0f} s: the run was given up ({RUN_REASONS[reason]}); the "
            f"filter goes on.",
        )
    return _along_time(drawn, rows, len(STATES))


def attitudes(cells: pd.DataFrame) -> go.Figure:
    """Figure 4: roll, pitch and heading RMSE averaged over flights, over all grades and per
    grade; and tilt and heading over the same time for both filters."""
    names = ("all grades", *GRADES)
    drawn = make_subplots(
        rows=2,
        cols=4,
        subplot_titles=names + names,
        shared_yaxes=True,
        horizontal_spacing=0.02,
        vertical_spacing=0.17,
    )
    drawn.update_yaxes(type="log", exponentformat="power", dtick=1)
    for row, text, angles in (
        (1, "until interrupted", ("roll", "pitch", "heading")),
        (2, "while both within 500 m", ("tilt_500", "heading_500")),
    ):
        drawn.update_yaxes(title_text=f"RMSE {text} [deg]", row=row, col=1)
        for col, grade in enumerate(names, 1):
            own = cells if col == 1 else cells[cells["grade"] == grade]
            for loop, name, colour in LOOPS:
                drawn.add_trace(
                    go.Bar(
                        x=[angle.removesuffix("_500") for angle in angles],
                        y=[own[f"{loop}_{angle}_deg"].mean() for angle in angles],
                        name=name,
                        legendgroup=name,
                        showlegend=row == col == 1,
                        marker={"color": colour},
                        hovertemplate="%{y:.3g} deg",
                    ),
                    row=row,
                    col=col,
                )
    return finish(drawn, 560).update_layout(
        hovermode="closest", barmode="group", margin={"t": 80}, legend={"y": 1.06}
    )


def biases(campaign: Campaign, cell: str) -> go.Figure:
    """Figure 5: bias estimates of run RUN with 3 sigma and the true biases."""
    rows = rows_of(campaign, cell, *numbers_of(campaign, cell))
    drawn, outside = panels(BIASES, height=125), []
    for row, (label, scale) in enumerate(zip(BIASES, BIAS_SCALE), 1):
        true = rows.bias[RUN, :, row - 1].astype(float) * scale
        open_, closed = true - rows.error[:2, RUN, :, 8 + row] * scale
        of_open, of_closed = 3 * rows.std[:2, RUN, :, 8 + row].astype(float) * scale
        open_name = "±3σ, open loop"
        _edges(drawn, row, rows.t, open_, of_open, open_name, colour=BLUE, width=0.8)
        line(drawn, rows.t, open_, "open loop: estimate", BLUE, row=row)
        band(drawn, rows.t, closed, of_closed, row=row, name="±3σ, closed loop")
        line(drawn, rows.t, closed, "closed loop: estimate", ORANGE, row=row)
        line(drawn, rows.t, true, "true bias", GREY, row=row, width=1.8, dash="dash")
        limits, left = frame_of_biases(rows.t, true, open_, closed, of_closed)
        drawn.update_yaxes(range=limits, row=row, col=1)
        outside += [label] * left
    drawn.update_traces(**DARKER)
    if outside:
        note(drawn, f"The open loop leaves the frame: {', '.join(outside)}.")
    return _along_time(drawn, rows, len(BIASES))


def frame_of_biases(
    t: Array, true: Array, open_: Array, closed: Array, stated: Array
) -> tuple[list[float], bool]:
    """(ends of the axis, whether the open loop leaves it): the frame follows truth and closed
    loop, and the open loop as far as four times as wide; the first tenth is left out."""
    later = t >= 0.1 * t[-1]
    near = np.r_[true[later], (closed + stated)[later], (closed - stated)[later]]
    middle = np.nanmean([np.nanmin(near), np.nanmax(near)])
    half = 0.55 * np.ptp(near[np.isfinite(near)])
    apart = np.nanmax(np.abs(open_[later] - middle), initial=0.0)
    half = min(max(half, 1.05 * apart), 4 * half) or 1.0
    return [middle - half, middle + half], bool(apart > half)


def over_time(campaign: Campaign, cells: dict[str, str]) -> go.Figure:
    """Figure 7: position RMSE of the runs alive, what the filters state, and the Cramer-Rao
    bound over time; cells: their names by flight."""
    drawn = make_subplots(rows=len(cells), cols=1, vertical_spacing=0.14 / len(cells) + 0.04)
    finish(drawn, 250 * len(cells) + 85)
    length = lambda values: np.sqrt((values[..., POS].astype(float) ** 2).sum(axis=-1))
    for row, (title, cell) in enumerate(cells.items(), 1):
        curves = campaign.curves(cell)
        lines = [
            (
                f"{name}: {what}",
                np.where(curves["alive"][place] > 0, length(curves[key][place]), np.nan),
                colour,
                style,
            )
            for place, (_, name, colour) in enumerate(LOOPS)
            for key, what, style in (
                ("rmse", "RMSE of the runs alive", {}),
                ("std", "stated", {"dash": "dot"}),
            )
        ]
        if np.isfinite(curves["bound"]).any():
            lines.append(("Cramér-Rao bound", length(curves["bound"]), RED, {"dash": "dash"}))
        for name, y, colour, style in lines:
            line(drawn, curves["t"], y, name, colour, row=row, **style)
        seen = np.concatenate([y for _, y, _, _ in lines])
        seen = seen[np.isfinite(seen) & (seen > 0)]
        if len(seen):
            log_range(drawn, seen.min(), min(seen.max(), LIMIT), row=row)
        drawn.update_yaxes(type="log", title_text=f"{title}: position [m]", row=row, col=1)
    return drawn.update_xaxes(title_text="time [s]", row=len(cells), col=1)


def drifts(bins: pd.DataFrame) -> go.Figure:
    """Figure 8a: NEES and position error of the open by the closed loop against the raw INS's
    drift."""
    drawn = panels(["open by closed loop"], height=330, log=True)
    x = bins["drift, m"].to_numpy(float)
    drawn.add_trace(
        go.Scatter(
            x=np.r_[x, x[::-1]],
            y=np.r_[bins["lower quartile"], bins["upper quartile"][::-1]],
            fill="toself",
            fillcolor="rgba(59,125,216,0.18)",
            line={"width": 0},
            name="NEES: half of all epochs",
            hoverinfo="skip",
        )
    )
    for name, colour, text in (
        ("NEES ratio", BLUE, "NEES, median"),
        ("position error ratio", ORANGE, "position error, median"),
    ):
        drawn.add_trace(
            go.Scatter(
                x=x,
                y=bins[name],
                mode="lines+markers",
                line={"color": colour},
                name=text,
                hovertemplate="%{y:.4g}",
            )
        )
    drawn.add_hline(y=1, line={"color": GREY, "width": 1, "dash": "dot"})
    drawn.update_xaxes(
        type="log",
        title_text="drift of the raw INS's position [m]",
        exponentformat="power",
        dtick=1,
    )
    return drawn.update_yaxes(exponentformat="power")


def consistency(cells: pd.DataFrame) -> go.Figure:
    """Figure 8b: NEES/15 of both filters per flight."""
    drawn, parts = _by_flight(cells, "NEES/15", 190)
    for row, own in enumerate(parts, 1):
        for (loop, name, colour), shift in zip(LOOPS, (-0.1, 0.1)):
            middle, *ends = (own[f"{loop}_anees{end}"] for end in ("", "_low", "_high"))
            x, shown = np.arange(len(own)) + shift, row == 1
            Marks(x, middle, name, colour, tuple(ends)).draw(drawn, row=row, legend=shown)
        drawn.add_hline(y=1, line={"color": GREY, "width": 1, "dash": "dot"}, row=row, col=1)
        low, high = (
            np.log10(own[[f"{loop}_anees_{end}" for loop, _, _ in LOOPS]].to_numpy(float))
            for end in ("low", "high")
        )
        ends = [np.nanmin(low), np.nanmax(high)]
        if np.all(np.isfinite(ends)):
            drawn.update_yaxes(**log_ticks(ends[0] - 0.1, ends[1] + 0.1), row=row, col=1)
    return drawn


def by_reading(cells: pd.DataFrame, readings: Mapping[str, pd.DataFrame]) -> go.Figure:
    """Figure 9: position RMSE per flight of both loops as corrected, and of the closed loop by each
    of its printed readings."""
    shown = [
        ("open loop", "open", cells, BLUE),
        ("closed loop, corrected", "closed", cells, ORANGE),
        *(
            (f"closed loop, {name}", "closed", readings[name], colour)
            for name, colour in zip(readings, COLOURS[2:])
        ),
    ]
    drawn, parts = _by_flight(cells, "RMSE [m]", 230)
    for row, own in enumerate(parts, 1):
        for place, (name, loop, read, colour) in enumerate(shown):
            part = read.loc[own.index]
            middle, *ends = (part[f"{loop}_censored_500_m{end}"] for end in ("", "_low", "_high"))
            x = np.arange(len(own)) + 0.15 * (place - 1.5)
            Marks(x, middle, name, colour, tuple(ends)).draw(drawn, row=row, legend=row == 1)
    return drawn.update_yaxes(
        range=[np.log10(0.03), np.log10(1000)], dtick=1, exponentformat="power"
    )


def all_figures(
    campaigns: Mapping[str, Campaign],
    chosen: CellTables,
    printed: Mapping[str, pd.DataFrame],
    drift: Drift,
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page. campaigns: "flights", "offset", "initial"; chosen:
    their tables; printed: flights of the closed loop by what the paper prints."""
    cells, offset, initial = chosen
    flights = campaigns["flights"]
    scenarios = flights.study.scenarios
    plan, height = profiles(scenarios)
    space = in_space(scenarios)
    tenth = _cell(flights, "10", "tactical")
    shown = {
        flight: cell
        for flight in ("01", "07", "10")
        if (cell := _cell(flights, flight, "tactical"))
    }
    return [
        (
            "Figure 1a: the flights in three dimensions",
            space,
            "The paper does not publish its paths; these are this library's, of the "
            "stated lengths and kinds. As there, the straight ones are left out. Drag to turn.",
        ),
        ("Figure 1b: the flights seen from above", plan, "All of them."),
        ("Figure 1c: their heights", height, "Above the ellipsoid."),
        ("Figure 2: position RMSE without offset", positions(cells), MARKS),
        *(
            (
                f"Figure 3{letter}: errors of the {loop} loop, flight 10, tactical grade, run {RUN}",
                drawn,
                "Run 0 is shown whatever it looks like. True − estimate: position and velocity "
                "along N, E, D, rotation about them.",
            )
            for letter, loop, drawn in zip(
                "ab", ("open", "closed"), errors_of_a_run(flights, tenth) if tenth else ()
            )
        ),
        (
            "Figure 4: attitude RMSE averaged over all flights",
            attitudes(cells),
            "Above, as in the paper: mean over flights and grades of the RMSE over all runs, each "
            "until it was given up, so that a "
            "filter given up early is scored over less "
            "time. The mean over all grades is that of the consumer grade. Below: the same time for "
            "both filters, after 120 s; tilt "
            "is roll and pitch together.",
        ),
        *(
            (
                f"Figure 5{letter}: estimated biases of accelerometers and gyros, flight 07, "
                f"tactical grade, {what}, run {RUN}",
                biases(campaigns[name], cell),
                "Grey band: ±3σ of the closed loop around its estimate. Body axes x forward, y "
                "right, z down.",
            )
            for letter, name, what in (
                ("a", "flights", "without offset"),
                ("b", "offset", "constant offset"),
                ("c", "initial", "offset as initial value"),
            )
            if (cell := _cell(campaigns[name], "07", "tactical"))
        ),
        (
            "Figure 6a: position RMSE with a constant accelerometer offset of 0.5 m/s² on each axis",
            positions(offset),
            MARKS,
        ),
        (
            "Figure 6b: position RMSE with 0.5 m/s² as initial value of the bias process",
            positions(initial),
            MARKS,
        ),
        *([(OVER_TIME, over_time(flights, shown), OVER_TIME_READ)] if shown else []),
        (
            "Figure 8a: what the drift of the raw INS does to the open loop",
            drifts(drift.bins),
            "Every stored epoch of the first runs of all cells with both filters within 500 m. 1: "
            "both filters alike.",
        ),
        (
            "Figure 8b: NEES/15 per flight",
            consistency(cells),
            "Geometric mean over runs with its 95 % interval, each run until it was "
            "given up; a right filter is at 1, one that is too sure above.",
        ),
        (
            "Figure 9: position RMSE as the paper prints update (15) and prediction (19)",
            by_reading(cells, printed),
            "All runs by the 500 m rule alone, each epoch after it counted as 500 m, with 95 % "
            "intervals.",
        ),
    ]


OVER_TIME = "Figure 7: position RMSE over time and the Cramér-Rao bound, tactical grade"
OVER_TIME_READ = (
    "Three-dimensional; until they are given up, runs count. No filter can undercut "
    "the bound on average; an RMSE of few runs scatters around it."
)
MARKS = (
    f"Discs: RMSE of the runs that survived both abort rules ± their standard deviation. Rings and "
    f"crosses: RMSE of all runs, every "
    f"epoch counted with at most {LIMIT:g} m and those "
    f"after an abort with just that, by the 500 m rule alone and by both rules. Percentages: runs "
    f"that survived both, open loop above "
    f"closed loop. The noise of a fix is 1 m per axis; {ONSET:g} m "
    "counts as diverged."
)


def _cell(campaign: Campaign, flight: str, grade: str) -> str | None:
    """Name of the cell of a flight and grade, or None."""
    for name, cell in zip(campaign.cells, campaign.manifest["cells"]):
        scenario, imu = flight_of(cell["scenario"]["name"]), cell["imu"]["name"]
        if scenario.endswith(flight) and imu.endswith(grade):
            return name
    return None
