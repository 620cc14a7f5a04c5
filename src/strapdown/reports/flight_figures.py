"""Figures of a flight in the loop: route, controls, forces and moments, air data, what the autopilot asked for and got."""
import numpy as np
import plotly.graph_objects as go

from ..geodesy import displacement
from ..sim.autopilot import ALONG_E, ALONG_N, ANGLE, FROM_E, FROM_N, KIND, LENGTH, LINE_KIND, RADIUS
from .drawing import COLOURS, GREY, even, finish, line, panels, time_axis

ARC_STEP = np.radians(5)
"""Of the arcs of a route as they are drawn."""
RPM = 30 / np.pi


def sections(flight):
    """The sections of a page on a sim.flight.Flight, for reports.page.report: [(heading, [(figure, its heading, caption)])]."""
    return [("Flight", [(route(flight), "Route, flight and estimate", "The aircraft flies where its filter believes the route to be."),
                        (off_route(flight), "Off the route", "Of the aircraft, not of its estimate."),
                        (asked(flight), "Asked and flown", "Dashed: what the autopilot asks for. Solid: the aircraft.")]),
            ("Controls", [(controls(flight), "Controls", "Dashed: commands. Solid: positions, behind their lag, rate limit and stops."),
                          (air(flight), "Air and propeller", "Against the air, gusts included.")]),
            ("Forces", [(loads(flight, "F", "N"), "Forces", "Of air and propeller, without weight, in body axes."),
                        (loads(flight, "G", "N m"), "Moments", "About the centre of mass, in body axes.")])]


def controls(flight):
    """Commands and positions of elevator, aileron, rudder (deg) and throttle (%)."""
    shown = [(name, f"{name} [{'%' if name == 'throttle' else 'deg'}]", "" if name == "throttle" else ", rad") for name in
             ("elevator", "aileron", "rudder", "throttle")]
    rows = [(label, [(f"{name} command{unit}", "command"), (f"{name}{unit}", "position")], np.degrees(1) if unit else 100.0) for name, label, unit in shown]
    return _rows(flight, rows)


def loads(flight, letter, unit):
    """Forces (`letter` "F", N) or moments ("G", N m) along or about the three body axes."""
    return _rows(flight, [(f"{letter}{axis} [{unit}]", [(f"{letter}{axis}, {unit}", "aircraft")], 1.0) for axis in "xyz"])


def air(flight):
    """Airspeed, flow angles and the propeller's speed."""
    return _rows(flight, [("airspeed [m/s]", [("commanded airspeed, m/s", "command"), ("airspeed, m/s", "position")], 1.0),
                          ("angle of attack [deg]", [("angle of attack, rad", "position")], np.degrees(1)),
                          ("sideslip [deg]", [("sideslip, rad", "position")], np.degrees(1)),
                          ("propeller [rpm]", [("propeller speed, rad/s", "position")], RPM)], names=("asked", "flown"))


def asked(flight):
    """Roll, pitch and height that the autopilot asks for, beside the aircraft's own."""
    rph, height = np.degrees(flight.recording.reference.rph[1:]), flight.recording.reference.lla[1:, 2]
    rows = [("roll [deg]", "commanded roll, rad", np.degrees(1), rph[:, 0]), ("pitch [deg]", "commanded pitch, rad", np.degrees(1), rph[:, 1]),
            ("height [m]", "commanded height, m", 1.0, height)]
    figure, t = panels([label for label, *_ in rows]), flight.log["t, s"]
    for row, (_, name, scale, flown) in enumerate(rows, 1):
        line(figure, t, flight.log[name] * scale, "asked", GREY, row, dash="dash")
        line(figure, t, flown, "flown", COLOURS[0], row)
    return time_axis(figure, flight.solution)


def off_route(flight):
    """How far the aircraft is right of and above its route, m."""
    return _rows(flight, [(f"{side} route [m]", [(f"{side} route, m", "aircraft")], 1.0) for side in ("right of", "above")])


def route(flight):
    """East and north in metres from the start: the route, the flight and the estimate."""
    figure, place = finish(go.Figure(), 480), flight.plan.place
    paths = {"route": (route_points(flight), GREY, "dash"), "flown": (displacement(flight.recording.reference.lla, place), COLOURS[0], "solid")}
    if flight.solution.has_position:
        paths["estimate"] = displacement(flight.solution.trajectory.lla, place), COLOURS[1], "solid"
    for name, (points, colour, dash) in paths.items():
        points = points[even(len(points))]
        figure.add_trace(go.Scatter(x=points[:, 1], y=points[:, 0], name=name, mode="lines", line={"color": colour, "width": 1.8, "dash": dash}))
    near = paths["flown"][0]
    middle, half = (near.min(axis=0) + near.max(axis=0)) / 2, max(np.ptp(near[:, :2], axis=0).max() * 0.55, 60.0)
    return figure.update_layout(xaxis_title="east [m]", yaxis_title="north [m]", hovermode="closest", yaxis_scaleanchor="x",
                                xaxis_range=[middle[1] - half, middle[1] + half], yaxis_range=[middle[0] - half, middle[0] + half])


def route_points(flight):
    """(n, 2) north and east of the route, m from the plan's place: its lines by their ends, its arcs in steps of ARC_STEP."""
    points = [np.zeros((1, 2))]
    for part in flight.route:
        begin, along, length, radius = part[FROM_N:FROM_E + 1], part[ALONG_N:ALONG_E + 1], part[LENGTH], part[RADIUS]
        if part[KIND] == LINE_KIND:
            points.append(np.array([begin, begin + length * along]))
        else:
            angle = part[ANGLE] + np.linspace(0, length / radius, 2 + int(abs(length / radius) / ARC_STEP))
            points.append(begin + abs(radius) * np.c_[np.cos(angle), np.sin(angle)])
    return np.concatenate(points)


def _rows(flight, rows, names=("command", "position")):
    """A panel per row (label, [(column of the log, "command", "position" or "aircraft")], scale)."""
    figure, t = panels([label for label, _, _ in rows], 150 if len(rows) > 3 else 170), flight.log["t, s"]
    for row, (_, columns, scale) in enumerate(rows, 1):
        for column, kind in columns:
            name = names[kind != "command"] if kind != "aircraft" else kind
            line(figure, t, flight.log[column] * scale, name, GREY if kind == "command" else COLOURS[0], row, legend=row == 1 and kind != "aircraft",
                 **({"dash": "dash"} if kind == "command" else {}))
    return time_axis(figure, flight.solution)
