"""The figures of Hager & Bryne, redrawn from a campaign, and three more: errors over time beside
their bound, and what the drift of the raw INS does."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.core.contract import POS
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.reports.drawing import (
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

from .cells import LIMIT, ONSET, Numbers, Rows, numbers_of, rows_of

BLUE, ORANGE = COLOURS[:2]
LOOPS = (("open", "open loop", BLUE), ("closed", "closed loop", ORANGE))
GRADES = ("consumer", "tactical", "navigation")
RUN = 0
"""Of figures of one run: the first, whatever it shows."""
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
SCALE = np.r_[np.ones(6), np.full(3, np.degrees(1))]
BIAS_SCALE = np.r_[np.ones(3), np.full(3, np.degrees(1) * 3600)]


def profiles(scenarios: Sequence[Scenario]) -> list[go.Figure]:
    """Figure 1: (plan, height) of Scenario values as small multiples."""
    columns = min(4, len(scenarios))
    count = -(-len(scenarios) // columns)
    titles = [f"{s.name.removeprefix('paper1-')}, {s.duration / 60:.0f} min" for s in scenarios]
    grid = lambda: make_subplots(
        rows=count,
        cols=columns,
        subplot_titles=titles,
        horizontal_spacing=0.07,
        vertical_spacing=0.26 / count,
    )
    plan, height = grid(), grid()
    for i, scenario in enumerate(scenarios):
        truth, place = scenario.glance(800), {"row": i // columns + 1, "col": i % columns + 1}
        north, east = _kilometres(truth.lla)
        plan.add_trace(
            go.Scatter(
                x=column(east),
                y=column(north),
                mode="lines",
                line={"color": BLUE, "width": 1.3},
                showlegend=False,
            ),
            **place,
        )
        plan.add_trace(
            go.Scatter(
                x=column(east[:1]),
                y=column(north[:1]),
                mode="markers",
                marker={"color": ORANGE, "size": 7},
                name="start",
                showlegend=i == 0,
            ),
            **place,
        )
        plan.update_yaxes(
            scaleanchor=f"x{i + 1 if i else ''}",
            constrain="domain",
            title_text="north [km]" if i % columns == 0 else None,
            **place,
        )
        height.add_trace(
            go.Scatter(
                x=column(truth.t / 60),
                y=column(truth.lla[:, 2]),
                mode="lines",
                line={"color": BLUE, "width": 1.3},
                showlegend=False,
            ),
            **place,
        )
        height.update_yaxes(title_text="height [m]" if i % columns == 0 else None, **place)
        height.update_yaxes(range=_at_least(truth.lla[:, 2], 50.0), **place)
        for drawn, text in ((plan, "east [km]"), (height, "time [min]")):
            drawn.update_xaxes(
                title_text=text if i + columns >= len(scenarios) else None,
                constrain="domain",
                **place,
            )
    return [
        finish(drawn, each * count + 80).update_layout(hovermode="closest", legend={"y": 1.06})
        for drawn, each in ((plan, 250), (height, 190))
    ]


def _kilometres(lla: Array) -> tuple[Array, Array]:
    """North and east, km, from the first row, on the sphere: for a look."""
    return (lla[:, 0] - lla[0, 0]) * 6371.0, (lla[:, 1] - lla[0, 1]) * 6371.0 * np.cos(lla[0, 0])


def _at_least(values: Array, span: float) -> list[float]:
    middle, half = (values.max() + values.min()) / 2, max(span, 1.15 * np.ptp(values)) / 2
    return [float(middle - half), float(middle + half)]


def positions(cells: pd.DataFrame) -> go.Figure:
    """Figures 2 and 6: position RMSE per flight with survival, a panel per grade, from
    cells.table."""
    grades = [grade for grade in GRADES if (cells["grade"] == grade).any()] or list(
        dict.fromkeys(cells["grade"])
    )
    drawn = panels([f"{grade}: RMSE [m]" for grade in grades], height=280, log=True)
    for row, grade in enumerate(grades, 1):
        own = cells[cells["grade"] == grade]
        for k, (loop, name, colour) in enumerate(LOOPS):
            x = np.arange(len(own)) + (k - 0.5) * 0.24
            survivors = Look(f"{name}, surviving runs ± std", colour, "circle")
            by_500 = Look(f"{name}, all runs, 500 m rule alone", colour, "circle-open")
            by_both = Look(f"{name}, all runs, both abort rules", colour, "x-thin-open")
            _marks(drawn, row, x, own[f"{loop}_rmse_m"], own[f"{loop}_std_m"], survivors)
            _marks(drawn, row, x + 0.09, own[f"{loop}_censored_500_m"], None, by_500)
            _marks(drawn, row, x - 0.09, own[f"{loop}_censored_m"], None, by_both)
            drawn.add_trace(
                go.Scatter(
                    x=x,
                    y=np.full(len(own), 1600.0 if k == 0 else 900.0),
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
        drawn.update_xaxes(
            tickvals=list(range(len(own))),
            ticktext=list(own["flight"]),
            range=[-0.6, len(own) - 0.4],
            showticklabels=True,
            row=row,
            col=1,
        )
        drawn.update_yaxes(
            range=[np.log10(0.03), np.log10(2600)], dtick=1, exponentformat="power", row=row, col=1
        )
    drawn.update_xaxes(title_text="flight", row=len(grades), col=1)
    return drawn.update_layout(hovermode="closest", margin={"t": 92})


class Look(NamedTuple):
    """How marks look: their name in the legend, a colour, and a symbol of Plotly."""

    name: str
    colour: str
    symbol: str


def _marks(
    drawn: go.Figure, row: int, x: Array, y: pd.Series, spread: pd.Series | None, look: Look
) -> None:
    """One mark per flight at `x` (n,), with error bars where there is a `spread` (n,), m."""
    error = (
        {"type": "data", "array": np.nan_to_num(spread), "thickness": 1.2, "width": 3}
        if spread is not None
        else None
    )
    drawn.add_trace(
        go.Scatter(
            x=x,
            y=np.asarray(y, float),
            error_y=error,
            mode="markers",
            name=look.name,
            legendgroup=look.name,
            showlegend=row == 1,
            marker={
                "color": look.colour,
                "symbol": look.symbol,
                "size": 7 if look.symbol != "circle" else 9,
                "line": {"color": look.colour, "width": 1.3},
            },
            hovertemplate="%{y:.4g} m",
        ),
        row=row,
        col=1,
    )


def errors_of_a_run(campaign: Campaign, cell: str) -> list[go.Figure]:
    """Figure 3: (open, closed) errors of run RUN with what the filter states and what the bound
    allows, 3 sigma each."""
    numbers, ran = numbers_of(campaign, cell)
    rows, bound = rows_of(campaign, cell, numbers, ran), campaign.curves(cell)["bound"]
    found = []
    for place, (_, name, colour) in enumerate(LOOPS):
        drawn, outside = panels(STATES, height=105), []
        for i in range(9):
            error, stated, least = (
                values.astype(float) * SCALE[i]
                for values in (
                    rows.error[place, RUN, :, i],
                    3 * rows.sd[place, RUN, :, i],
                    3 * bound[:, i],
                )
            )
            curves = Curves(rows.t, error, stated, least)
            outside.append(_one(drawn, i + 1, curves, name, colour))
        if any(outside):
            note(drawn, f"Largest values outside the frame: {', '.join(filter(None, outside))}.")
        found.append(_ended(drawn, rows, numbers, place, 9))
    return found


class Curves(NamedTuple):
    """One error state of a run over time, in the unit of its panel; all (n,)."""

    t: Array  # s
    error: Array  # true - estimate
    stated: Array  # 3 sigma by the filter
    least: Array  # 3 sigma of the Cramér-Rao bound, NaN where there is none


def _one(drawn: go.Figure, row: int, curves: Curves, name: str, colour: str) -> str:
    """Draw a panel, and return the text of what lies outside its frame, "" where nothing does."""
    t, error, stated, least = curves
    band(drawn, t, np.zeros(len(t)), stated, row=row, name="±3σ stated by the filter")
    line(drawn, t, error, f"{name}: true − estimate", colour, row=row)
    if np.isfinite(least).any():
        for sign in (1, -1):
            line(
                drawn,
                t,
                sign * least,
                "±3σ of the Cramér-Rao bound",
                RED,
                row=row,
                legend=sign > 0,
                width=1,
                dash="dot",
            )
    limit, largest = frame(t, error, stated)
    drawn.update_yaxes(range=[-limit, limit], row=row, col=1)
    return f"{STATES[row - 1]} {largest:.3g}" if largest > 1.1 * limit else ""


def _ended(drawn: go.Figure, rows: Rows, numbers: Numbers, place: int, last: int) -> go.Figure:
    drawn.update_xaxes(title_text="time [s]", row=last, col=1)
    drawn.update_xaxes(range=[0, float(rows.t[-1])])
    if numbers["reason"][place, RUN]:
        end = float(numbers["lasted"][place, RUN])
        reason = ("", "lost", "inconsistent", "quarantined")[int(numbers["reason"][place, RUN])]
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
            f"Dashed vertical line, {end:.0f} s: the run was given up ({reason}); the filter goes "
            f"on.",
        )
    return drawn


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
    for row, angles in enumerate((("roll", "pitch", "heading"), ("tilt_500", "heading_500")), 1):
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
    drawn.update_yaxes(type="log", exponentformat="power", dtick=1)
    for row, text in ((1, "until the abort [deg]"), (2, "while both within 500 m [deg]")):
        drawn.update_yaxes(title_text=f"RMSE {text}", row=row, col=1)
    return finish(drawn, 560).update_layout(
        hovermode="closest", barmode="group", margin={"t": 80}, legend={"y": 1.06}
    )


def biases(campaign: Campaign, cell: str) -> go.Figure:
    """Figure 5: bias estimates of run RUN with 3 sigma and the true biases."""
    numbers, ran = numbers_of(campaign, cell)
    rows = rows_of(campaign, cell, numbers, ran)
    drawn, outside = panels(BIASES, height=125), []
    for i in range(6):
        true = rows.bias[RUN, :, i].astype(float) * BIAS_SCALE[i]
        seen = []
        for place, (_, name, colour) in enumerate(LOOPS):
            estimate = true - rows.error[place, RUN, :, 9 + i] * BIAS_SCALE[i]
            stated = 3 * rows.sd[place, RUN, :, 9 + i].astype(float) * BIAS_SCALE[i]
            if place:
                band(drawn, rows.t, estimate, stated, row=i + 1, name="±3σ, closed loop")
            else:
                for sign in (1, -1):
                    line(
                        drawn,
                        rows.t,
                        estimate + sign * stated,
                        "±3σ, open loop",
                        colour,
                        row=i + 1,
                        legend=sign > 0,
                        width=0.8,
                        dash="dot",
                    )
            line(drawn, rows.t, estimate, f"{name}: estimate", colour, row=i + 1)
            seen.append((estimate, stated))
        line(drawn, rows.t, true, "true bias", GREY, row=i + 1, width=1.8, dash="dash")
        outside.append(_frame_biases(drawn, i + 1, rows.t, true, seen))
    if any(outside):
        note(drawn, f"The open loop leaves the frame: {', '.join(filter(None, outside))}.")
    drawn.update_xaxes(title_text="time [s]", row=6, col=1)
    return drawn.update_xaxes(range=[0, float(rows.t[-1])])


def _frame_biases(
    drawn: go.Figure, row: int, t: Array, true: Array, seen: list[tuple[Array, Array]]
) -> str:
    """The frame follows truth and closed loop, and the open loop as far as four times as wide;
    the first tenth is left out."""
    later = t >= 0.1 * t[-1]
    (open_, _), (closed, stated) = seen
    near = np.r_[true[later], (closed + stated)[later], (closed - stated)[later]]
    middle, half = (
        np.nanmean([np.nanmin(near), np.nanmax(near)]),
        0.55 * np.ptp(near[np.isfinite(near)]),
    )
    apart = np.nanmax(np.abs(open_[later] - middle), initial=0.0)
    half = min(max(half, 1.05 * apart), 4 * half) or 1.0
    drawn.update_yaxes(range=[middle - half, middle + half], row=row, col=1)
    return BIASES[row - 1] if apart > half else ""


def over_time(campaign: Campaign, cells: list[str], titles: list[str]) -> go.Figure:
    """Figure 7: position RMSE of the runs alive, what the filters state, and the Cramer-Rao
    bound over time."""
    drawn = make_subplots(rows=len(cells), cols=1, vertical_spacing=0.14 / len(cells) + 0.04)
    finish(drawn, 250 * len(cells) + 85)
    length = lambda values: np.sqrt((values[..., POS].astype(float) ** 2).sum(axis=-1))
    for row, (cell, title) in enumerate(zip(cells, titles), 1):
        curves, values = campaign.curves(cell), []
        for place, (_, name, colour) in enumerate(LOOPS):
            for key, what, style in (
                ("rmse", "RMSE of the runs alive", {}),
                ("sd", "stated", {"dash": "dot"}),
            ):
                y = np.where(curves["alive"][place] > 0, length(curves[key][place]), np.nan)
                line(drawn, curves["t"], y, f"{name}: {what}", colour, row=row, **style)
                values.append(y)
        if np.isfinite(curves["bound"]).any():
            line(
                drawn,
                curves["t"],
                length(curves["bound"]),
                "Cramér-Rao bound",
                RED,
                row=row,
                dash="dash",
            )
            values.append(length(curves["bound"]))
        everything = np.concatenate(values)
        seen = everything[np.isfinite(everything) & (everything > 0)]
        if len(seen):
            log_range(drawn, seen.min(), min(seen.max(), LIMIT), row=row)
        drawn.update_yaxes(type="log", title_text=f"{title}: position [m]", row=row, col=1)
    drawn.update_xaxes(title_text="time [s]", row=len(cells), col=1)
    return drawn


def drifts(bins: pd.DataFrame, cells: pd.DataFrame) -> tuple[go.Figure, go.Figure]:
    """Figure 8: NEES and position error of the open by the closed loop against the raw INS's
    drift; and NEES/15 of both filters per flight."""
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
    drawn.update_yaxes(exponentformat="power")
    return drawn, _consistency(cells)


def _consistency(cells: pd.DataFrame) -> go.Figure:
    grades = [grade for grade in GRADES if (cells["grade"] == grade).any()] or list(
        dict.fromkeys(cells["grade"])
    )
    drawn = panels([f"{grade}: NEES/15" for grade in grades], height=190, log=True)
    for row, grade in enumerate(grades, 1):
        own = cells[cells["grade"] == grade]
        for k, (loop, name, colour) in enumerate(LOOPS):
            middle, low, high = (
                own[f"{loop}_anees{end}"].to_numpy(float) for end in ("", "_low", "_high")
            )
            drawn.add_trace(
                go.Scatter(
                    x=np.arange(len(own)) + (k - 0.5) * 0.2,
                    y=middle,
                    mode="markers",
                    name=name,
                    legendgroup=name,
                    showlegend=row == 1,
                    marker={"color": colour, "size": 8},
                    hovertemplate="%{y:.3g}",
                    error_y={
                        "type": "data",
                        "array": np.nan_to_num(high - middle),
                        "arrayminus": np.nan_to_num(middle - low),
                        "width": 3,
                    },
                ),
                row=row,
                col=1,
            )
        drawn.add_hline(y=1, line={"color": GREY, "width": 1, "dash": "dot"}, row=row, col=1)
        drawn.update_xaxes(
            tickvals=list(range(len(own))),
            ticktext=list(own["flight"]),
            showticklabels=True,
            row=row,
            col=1,
        )
        ends = [
            np.log10(np.nanmin(own[["open_anees_low", "closed_anees_low"]].to_numpy(float))),
            np.log10(np.nanmax(own[["open_anees_high", "closed_anees_high"]].to_numpy(float))),
        ]
        if np.all(np.isfinite(ends)):
            drawn.update_yaxes(**log_ticks(ends[0] - 0.1, ends[1] + 0.1), row=row, col=1)
    drawn.update_xaxes(title_text="flight", row=len(grades), col=1)
    return drawn.update_layout(hovermode="closest")


def all_figures(
    campaigns: dict[str, Campaign],
    cells: pd.DataFrame,
    offset: pd.DataFrame,
    initial: pd.DataFrame,
    bins: pd.DataFrame,
    scenarios: Sequence[Scenario],
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page. campaigns: "flights", "offset", "initial";
    cells, offset, initial: their tables; bins: of drift.measure."""
    flights, with_offset = campaigns["flights"], campaigns["offset"]
    plan, height = profiles(scenarios)
    found = [
        (
            "Figure 1a: the flights seen from above",
            plan,
            "The paper does not publish its paths; these are this library's, of the "
            "stated lengths and kinds.",
        ),
        ("Figure 1b: their heights", height, "Above the ellipsoid."),
        ("Figure 2: position RMSE without offset", positions(cells), MARKS),
    ]
    if cell := _cell(flights, "10", "tactical"):
        found += [
            (
                f"Figure 3{letter}: errors of the {loop} loop, flight 10, tactical grade, run {RUN}",
                drawn,
                "Run 0 is shown whatever it looks like. True − estimate: position and velocity "
                "along N, E, D, rotation about them.",
            )
            for letter, loop, drawn in zip("ab", ("open", "closed"), errors_of_a_run(flights, cell))
        ]
    found.append(
        (
            "Figure 4: attitude RMSE averaged over all flights",
            attitudes(cells),
            "Above, as in the paper: mean over flights and grades of the RMSE over all runs, each "
            "until it was given up, so that a "
            "filter given up early is scored over less "
            "time. The mean over all grades is that of the consumer grade. Below: the same time for "
            "both filters, after 120 s; tilt "
            "is roll and pitch together.",
        )
    )
    found += [
        (
            f"Figure 5{letter}: estimated biases of accelerometers and gyros, flight 07, tactical "
            f"grade, {what}, run {RUN}",
            biases(campaign, cell),
            "Grey band: ±3σ of the closed loop around its estimate. Body axes x forward, y right, z "
            "down.",
        )
        for letter, campaign, what in (
            ("a", flights, "without offset"),
            ("b", with_offset, "constant offset"),
            ("c", campaigns["initial"], "offset as initial value"),
        )
        if (cell := _cell(campaign, "07", "tactical"))
    ]
    found.append(
        (
            "Figure 6a: position RMSE with a constant accelerometer offset of 0.5 m/s² on each axis",
            positions(offset),
            MARKS,
        )
    )
    found.append(
        (
            "Figure 6b: position RMSE with 0.5 m/s² as initial value of the bias process",
            positions(initial),
            MARKS,
        )
    )
    shown = [
        (flight, cell)
        for flight in ("01", "07", "10")
        if (cell := _cell(flights, flight, "tactical"))
    ]
    if shown:
        found.append(
            (
                "Figure 7: position RMSE over time and the Cramér-Rao bound, tactical grade",
                over_time(flights, [cell for _, cell in shown], [flight for flight, _ in shown]),
                "Three-dimensional; until they are given up, runs count. No filter can undercut the "
                "bound on average; an RMSE of few runs scatters around it.",
            )
        )
    drift, consistency = drifts(bins, cells)
    return found + [
        (
            "Figure 8a: what the drift of the raw INS does to the open loop",
            drift,
            "Every stored epoch of the first runs of all cells with both filters within 500 m. 1: "
            "both filters alike.",
        ),
        (
            "Figure 8b: NEES/15 per flight",
            consistency,
            "Geometric mean over runs with its 95 % interval, each run until it was "
            "given up; a right filter is at 1, one that is too sure above.",
        ),
    ]


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
    for cell in campaign.manifest["cells"]:
        if cell["scenario"]["name"].removesuffix("-offset").removesuffix("-initial").endswith(
            flight
        ) and cell["imu"]["name"].endswith(grade):
            return cell["name"]
    return None
