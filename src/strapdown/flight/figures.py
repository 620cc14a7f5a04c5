"""Figures of a flight in the loop: route, controls, forces and moments, air data, wind, what the
autopilot asked for and got; and what was flown."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import plotly.graph_objects as go

from ..core.compile.records import Table
from ..data.solution import SolutionMeta, Source, Trajectory
from ..evaluation.metrics import any_known
from ..geometry.geodesy import displacement
from ..pages.drawing import (
    COLOURS,
    GREY,
    even_indices,
    finish,
    legend_names,
    line,
    note,
    panels,
    path,
    time_axis,
)
from ..typing import Array
from .autopilot import Segment
from .run_flight import Flight

Rows: TypeAlias = Sequence[tuple[str, Sequence[tuple[str, str]], float]]
"""Rows of `_rows`: label, [(column of the log, what it is)], scale."""
Sections: TypeAlias = list[tuple[str, list[tuple[go.Figure, str, str]]]]
"""[(heading, [(figure, its heading, caption)])]"""
ARC_STEP = np.radians(5)
"""Step along the arcs of a route as they are drawn."""
RPM = 30 / np.pi
CUT_COLOUR = "rgba(59,125,216,0.3)"
"""Colour of the stretch that was flown without GNSS, on the map: as the windows of withheld fixes, but
stronger."""
FRAMED = 3.0
"""An estimate that is as many times the flight's own reach away from it leaves the frame of the
map."""
FIX_UNITS = {"position": "m", "velocity": "m/s"}


def sections(flight: Flight) -> Sections:
    """The sections of a page on a sim.flight.Flight, for reports.page.report: [(heading,
    [(figure, its heading, caption)])]."""
    gusty = flight.recording.meta["turbulence"] != "none"
    at_once = (
        " At 0 s the gusts are there at once, upon an aircraft trimmed without them."
        if gusty
        else ""
    )
    wind = [
        (
            wind_figure(flight),
            "Wind",
            f"Of the air over ground, towards north, east and "
            f"down{', gusts included' if gusty else ''}.{at_once}",
        )
    ]
    return [
        (
            "Flight",
            [
                (
                    route(flight),
                    "Route, flight and estimate",
                    "The aircraft flies where its filter believes the route to be. The route is "
                    "drawn as far as it was flown, or is believed to be.",
                ),
                (off_route(flight), "Off the route", "Of the aircraft, not of its estimate."),
                (
                    command_figure(flight),
                    "Asked, flown and estimated",
                    f"The autopilot holds "
                    f"{'the aircraft itself' if flight.recording.meta['feedback'] == 'truth' else 'the estimate'} "
                    f"to what it "
                    "asks for. Pitch is held without an integral, so that it stays off what is "
                    "asked in steady flight; the integral of height makes "
                    "up for it. "
                    "The estimated airspeed is without gusts, that of the velocity less the steady "
                    "wind.",
                ),
            ],
        ),
        (
            "Controls",
            [
                (
                    controls(flight),
                    "Controls",
                    "Dashed: commands. Solid: positions, behind their lag, rate limit and stops.",
                ),
                (air(flight), "Air and propeller", "Against the air, gusts included."),
            ]
            + (wind if wind[0][0] else []),
        ),
        (
            "Forces",
            [
                (
                    loads(flight, "F", "N"),
                    "Forces",
                    f"Of air and propeller, without weight, in body axes.{at_once}",
                ),
                (loads(flight, "G", "N m"), "Moments", "About the centre of mass, in body axes."),
            ],
        ),
    ]


def facts(flight: Flight) -> dict[str, str]:
    """Return the facts of a flight, {name: text}, for the head of a page."""
    meta, end = flight.recording.meta, float(flight.recording.imu.t[-1])
    cut = ", ".join(
        f"{start:g} to {min(stop, end):g} s" for start, stop in meta["outages"] if start < end
    )
    wind = "{:g}, {:g}, {:g} m/s towards north, east, down".format(*meta["wind"])
    fixes = [
        f"{a.kind} every {np.diff(a.t).min():.3g} s{_std(a)}"
        for a in flight.recording.sources
        if len(a.t) > 1
    ]
    return {
        "aircraft": meta["aircraft"],
        "plan": meta["name"],
        "flown": f"{end:.1f} s{f', then {flight.stopped.cause}' if flight.stopped else ''}",
        "wind": wind if any(meta["wind"]) else "none",
        "turbulence": meta["turbulence"],
        "Earth": meta["earth"],
        "fixes": "; ".join(fixes),
        "GNSS cut": cut or "never",
        "autopilot flies by": meta["feedback"],
        "predicted without GNSS by": (
            "the aircraft's model" if meta["prediction"] == "model" else "IMU"
        )
        if cut
        else "",
        "seed": str(meta["seed"]),
    }


def _std(source: Source) -> str:
    values = "{:g} {:g} {:g}".format(*source.std[0]) if source.kind in FIX_UNITS else ""
    return f", std {values} {FIX_UNITS[source.kind]} NED" if values else ""


def controls(flight: Flight) -> go.Figure:
    """Commands and positions of elevator, aileron, rudder (deg) and throttle (%)."""
    shown = [
        (
            name,
            f"{name} [{'%' if name == 'throttle' else 'deg'}]",
            "" if name == "throttle" else ", rad",
        )
        for name in ("elevator", "aileron", "rudder", "throttle")
    ]
    rows = [
        (
            label,
            [(f"{name} command{unit}", "command"), (f"{name}{unit}", "position")],
            np.degrees(1) if unit else 100.0,
        )
        for name, label, unit in shown
    ]
    return _rows(flight, rows)


def loads(flight: Flight, letter: str, unit: str) -> go.Figure:
    """Forces (`letter` "F", N) or moments ("G", N m) along or about the three body axes."""
    return _rows(
        flight,
        [
            (f"{letter}{axis} [{unit}]", [(f"{letter}{axis}, {unit}", "aircraft")], 1.0)
            for axis in "xyz"
        ],
    )


def air(flight: Flight) -> go.Figure:
    """Airspeed, flow angles and the propeller's speed."""
    return _rows(
        flight,
        [
            (
                "airspeed [m/s]",
                [("commanded airspeed, m/s", "command"), ("airspeed, m/s", "position")],
                1.0,
            ),
            ("angle of attack [deg]", [("angle of attack, rad", "position")], np.degrees(1)),
            ("sideslip [deg]", [("sideslip, rad", "position")], np.degrees(1)),
            ("propeller [rpm]", [("propeller speed, rad/s", "position")], RPM),
        ],
        names=("asked", "flown"),
    )


def wind_figure(flight: Flight) -> go.Figure | None:
    """Wind with its gusts towards north, east and down, m/s; None in still air."""
    names = [f"wind {axis}, m/s" for axis in ("north", "east", "down")]
    if not any(np.any(flight.log[name]) for name in names):
        return None
    return _rows(flight, [(f"{name[5:-5]} [m/s]", [(name, "aircraft")], 1.0) for name in names])


def command_figure(flight: Flight) -> go.Figure:
    """Roll, pitch, height and airspeed that the autopilot asks for, beside the aircraft's own
    and those that the filter believes in."""
    truth, believed, log, deg = (
        _truth(flight),
        flight.solution.trajectory,
        flight.log,
        np.degrees(1),
    )
    wind = np.array(flight.recording.meta.get("told_wind", flight.recording.meta["wind"]))
    rows = [
        (
            "roll [deg]",
            "commanded roll, rad",
            deg,
            truth.rph[1:, 0] * deg,
            believed.rph[:, 0] * deg,
        ),
        (
            "pitch [deg]",
            "commanded pitch, rad",
            deg,
            truth.rph[1:, 1] * deg,
            believed.rph[:, 1] * deg,
        ),
        ("height [m]", "commanded height, m", 1.0, truth.lla[1:, 2], believed.lla[:, 2]),
        (
            "airspeed [m/s]",
            "commanded airspeed, m/s",
            1.0,
            log["airspeed, m/s"],
            np.linalg.norm(believed.v_n - wind, axis=1),
        ),
    ]
    figure, t = panels([label for label, *_ in rows], 150), log["t, s"]
    for row, (_, name, scale, flown, estimate) in enumerate(rows, 1):
        line(figure, t, log[name] * scale, "asked", GREY, row, dash="dash")
        line(figure, t, flown, "flown", COLOURS[2], row)
        if any_known(estimate):
            line(figure, flight.solution.t, estimate, "estimate", COLOURS[0], row)
    return _format_time_axis(figure, flight)


def off_route(flight: Flight) -> go.Figure:
    """Distance of the aircraft to the right of and above its route, m."""
    return _rows(
        flight,
        [
            (f"{side} route [m]", [(f"{side} route, m", "aircraft")], 1.0)
            for side in ("right of", "above")
        ],
    )


def route(flight: Flight) -> go.Figure:
    """East and north in metres from the start: the route as far as flown, the flight, where GNSS
    was cut, and the estimate."""
    figure, truth, place = finish(go.Figure(), 560), _truth(flight), flight.plan.place
    flown, believed = displacement(truth.lla, place)[:, :2], None
    if flight.solution.has_position:
        believed = displacement(flight.solution.trajectory.lla, place)[:, :2]
    for start, stop in flight.recording.meta["outages"]:
        _path(
            figure,
            flown[(truth.t >= start) & (truth.t <= stop)],
            "flown without GNSS",
            CUT_COLOUR,
            9,
        )
    _path(
        figure,
        route_points(
            flown_route(flight, flown if believed is None else np.r_[flown[-1:], believed[-1:]])
        ),
        "route",
        GREY,
        dash="dash",
    )
    _path(figure, flown, "flown", COLOURS[2])
    if believed is not None:
        _path(figure, believed, "estimate", COLOURS[0])
        _mark(figure, believed[-1], "end of the estimate", "square-open", COLOURS[0])
    _mark(figure, flown[0], "start", "circle", "#2f9e44")
    _mark(figure, flown[-1], "end", "square", "#343a40")
    _frame(figure, flown, believed)
    return figure.update_layout(
        xaxis_title="east [m]",
        yaxis_title="north [m]",
        hovermode="closest",
        yaxis_scaleanchor="x",
        margin_t=72,
    )


def _path(
    figure: go.Figure,
    points: Array,
    name: str,
    colour: str,
    width: float = 1.8,
    dash: str = "solid",
) -> None:
    """A line along points (n, 2), north and east; lines of one name are one entry of the legend."""
    places, new = points[even_indices(len(points))][:, ::-1], name not in legend_names(figure)
    style = {"color": colour, "width": width, "dash": dash}
    if len(places):
        path(figure, places, name, line=style, legendgroup=name, showlegend=new)


def _mark(figure: go.Figure, point: Array, name: str, symbol: str, colour: str) -> None:
    edge = {"color": colour if "open" in symbol else "#fff", "width": 1.5}
    marker = {"symbol": symbol, "size": 11, "color": colour, "line": edge}
    path(figure, point[None, ::-1], name, mode="markers", marker=marker)


def _frame(figure: go.Figure, flown: Array, believed: Array | None) -> None:
    """Set the ranges around the flight and the estimate of it; of one that goes far beyond the
    flight, say so."""
    low, high = flown.min(axis=0), flown.max(axis=0)
    if believed is not None and any_known(believed):
        reach = FRAMED * max((high - low).max(), 60.0)
        furthest = np.nanmin(believed, axis=0), np.nanmax(believed, axis=0)
        if (low - furthest[0]).max() > reach or (furthest[1] - high).max() > reach:
            note(figure, "The estimate leaves the frame; double-click the plot to see all of it.")
        low, high = (
            np.maximum(np.minimum(low, furthest[0]), low - reach),
            np.minimum(np.maximum(high, furthest[1]), high + reach),
        )
    middle, half = (low + high) / 2, np.maximum((high - low) / 2 + 0.06 * (high - low).max(), 60.0)
    figure.update_layout(
        xaxis_range=[middle[1] - half[1], middle[1] + half[1]],
        yaxis_range=[middle[0] - half[0], middle[0] + half[0]],
    )


def flown_route(flight: Flight, ends: Array) -> Table[Segment]:
    """The segments of the route that were flown, the last one up to the furthest of `ends`, (n,
    2) north and east in m."""
    parts = flight.route[: int(flight.log["segment"][-1]) + 1].copy()
    last = parts[-1]
    away = ends[np.isfinite(ends).all(axis=1)] - [last.north, last.east]
    if not last.is_arc:
        along = away @ [last.along_north, last.along_east]
    else:
        turned = (
            np.sign(last.radius) * (np.arctan2(away[:, 1], away[:, 0]) - last.angle) % (2 * np.pi)
        )
        # short of its begin
        along = abs(last.radius) * np.where(
            turned > np.pi + last.length / abs(last.radius) / 2, 0.0, turned
        )
    last.length = np.clip(along, 0.0, last.length).max(initial=0.0)
    return parts


def route_points(parts: Table[Segment]) -> Array:
    """(n, 2) north and east of segments of a route, m from the plan's place: its lines by their
    ends, its arcs in steps of ARC_STEP."""
    points = [np.zeros((1, 2))]
    for part in parts:
        begin, along = np.array([[part.north, part.east], [part.along_north, part.along_east]])
        if not part.is_arc:
            points.append(np.array([begin, begin + part.length * along]))
        else:
            turn = part.length / part.radius
            angle = part.angle + np.linspace(0, turn, 2 + int(abs(turn) / ARC_STEP))
            points.append(begin + abs(part.radius) * np.c_[np.cos(angle), np.sin(angle)])
    return np.concatenate(points)


def _truth(flight: Flight) -> Trajectory:
    """Where the aircraft was: every flight has it."""
    return flight.recording.reference


def _rows(
    flight: Flight, rows: Rows, names: tuple[str, str] = ("command", "position")
) -> go.Figure:
    """A panel per row (label, [(column of the log, "command", "position" or "aircraft")],
    scale)."""
    figure, t = (
        panels([label for label, _, _ in rows], 150 if len(rows) > 3 else 170),
        flight.log["t, s"],
    )
    for row, (_, columns, scale) in enumerate(rows, 1):
        for column, kind in columns:
            style: dict[str, Any] = {"dash": "dash"} if kind == "command" else {}
            name = names[kind != "command"] if kind != "aircraft" else kind
            line(
                figure,
                t,
                flight.log[column] * scale,
                name,
                GREY if kind == "command" else COLOURS[2],
                row,
                legend=row == 1 and kind != "aircraft",
                **style,
            )
    return _format_time_axis(figure, flight)


def _format_time_axis(figure: go.Figure, flight: Flight) -> go.Figure:
    """The figure with its time axis, and the outages shaded whether or not the solution has been
    told of them."""
    meta: SolutionMeta = {"withheld": flight.recording.meta["outages"], **flight.solution.meta}
    return time_axis(figure, replace(flight.solution, meta=meta))
