"""Figures of a Solution: track, errors or estimates with 3-sigma bands, claimed uncertainty,
biases, innovations and NIS.

Errors are true - estimate. Every function returns a plotly Figure, or None where the solution holds
nothing of what it shows; axes that are nowhere known are left out. Sentences that belong below a
figure are in `figure.layout.meta["notes"]`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from ..data import Solution, Trajectory
from ..evaluation import metrics
from ..evaluation.metrics import Errors
from ..geodesy import displacement
from ..typing import Array, Mask
from .drawing import (
    COLOURS,
    GREY,
    NED_AXES,
    RED,
    about_mean,
    band,
    column,
    cut,
    even,
    extent,
    finish,
    frame,
    line,
    log_range,
    note,
    origin,
    panels,
    peak,
    time_axis,
    together,
)
from .fix_figures import kind
from .summary import claimed_sd

EULER = ("roll", "pitch", "heading")


def track(
    solutions: Mapping[str, Solution], reference: Trajectory | None = None
) -> go.Figure | None:
    """East and north in metres from the start, of {name: Solution}.

    The frame is that of the reference, or of the solution that moves least.
    """
    shown = [name for name, solution in solutions.items() if solution.has_position]
    if not shown:
        return None
    first = solutions[shown[0]]
    known = None if reference is None else reference.lla[np.isfinite(reference.lla).all(axis=1)]
    known = known if known is not None and len(known) else None
    start = (
        first.trajectory.lla[np.isfinite(first.trajectory.lla).all(axis=1)]
        if known is None
        else known
    )[0]
    known = None if known is None else _ground(known, start)
    paths = {name: _ground(solutions[name].trajectory.lla, start) for name in shown}
    figure = finish(go.Figure(), 480 if known is None else 690)
    _fixes(figure, first, start)
    for rank, colour, name in _last_first(solutions, shown):
        path = paths[name]
        _path(
            figure, path[even(len(path))], name, line={"color": colour, "width": 2}, legendrank=rank
        )
    if known is not None:
        _path(
            figure,
            known[even(len(known))],
            "reference",
            line={"color": GREY, "width": 1.5, "dash": "dash"},
        )
    path = known if known is not None else next(iter(paths.values()))
    for row, label, symbol, colour in (
        (0, "start", "circle", "#2f9e44"),
        (-1, "end", "square", "#343a40"),
    ):
        marker = {
            "symbol": symbol,
            "size": 11,
            "color": colour,
            "line": {"color": "#fff", "width": 1.5},
        }
        _path(figure, path[[row]], label, mode="markers", marker=marker)
    _frame_track(figure, known, paths)
    return figure.update_layout(
        xaxis_title="east [m]",
        yaxis_title="north [m]",
        hovermode="closest",
        yaxis_scaleanchor="x",
        margin_t=72,
    )


def _fixes(figure: go.Figure, solution: Solution, start: Array) -> None:
    """Mark the position fixes of a solution, accepted and rejected."""
    looks = {
        True: ("accepted", {"color": GREY, "size": 4, "opacity": 0.5}),
        False: ("rejected", {"color": RED, "size": 8, "symbol": "x"}),
    }
    for name, (places, accepted) in _position_fixes(solution, start).items():
        for good, (label, marker) in looks.items():
            chosen = np.flatnonzero(accepted == good)
            chosen = chosen[even(len(chosen))]
            if len(chosen):
                _path(
                    figure, places[chosen], f"{name} fixes, {label}", mode="markers", marker=marker
                )


def _last_first(names: Iterable[str], shown: Sequence[str]) -> list[tuple[int, str, str]]:
    """(legend rank, colour, name) of those `shown` in the order of drawing: the first solution
    comes to lie on top."""
    return [
        (1 + i, COLOURS[i % len(COLOURS)], name) for i, name in enumerate(names) if name in shown
    ][::-1]


def _ground(lla: Array, start: Array) -> Array:
    """(n, 2) east and north, m, longitude unwrapped so that a track may cross the antimeridian."""
    return displacement(lla, np.broadcast_to(start, lla.shape))[:, [1, 0]]


def _path(figure: go.Figure, path: Array, name: str, mode: str = "lines", **style: Any) -> None:
    figure.add_trace(
        go.Scatter(
            x=column(path[:, 0]),
            y=column(path[:, 1]),
            name=escape(name),
            mode=mode,
            hovertemplate="%{x:.1f} m east, %{y:.1f} m north",
            **style,
        )
    )


def _position_fixes(solution: Solution, start: Array) -> dict[str, tuple[Array, Mask]]:
    """{source: (east and north, accepted)} of position sources: the estimate at each fix plus
    its innovation."""
    fixes, found = solution.innovations, {}
    for index, name in enumerate(fixes.names):
        if kind(solution, name) == "position":
            chosen = (fixes.source == index) & np.isfinite(fixes.innovation[:, :2]).all(axis=1)
            path = _ground(solution.trajectory.lla, start)
            there = np.column_stack(
                [np.interp(fixes.t[chosen], solution.t, axis) for axis in path.T]
            )
            found[name] = there + fixes.innovation[chosen][:, [1, 0]], fixes.accepted[chosen]
    return found


def _frame_track(figure: go.Figure, known: Array | None, paths: Mapping[str, Array]) -> None:
    """Set the ranges around the reference or the solution that moves least; one that goes as far
    again beyond that leaves the frame."""
    low, high = (
        _corners(known)
        if known is not None
        else min(map(_corners, paths.values()), key=lambda box: (box[1] - box[0]).max())
    )
    room = max((high - low).max(), 10.0)
    for name, path in paths.items():
        far_low, far_high = _corners(path)
        beyond = max((low - far_low).max(), (far_high - high).max())
        if beyond <= room:
            low, high = np.minimum(low, far_low), np.maximum(high, far_high)
        else:
            note(
                figure,
                f"{name} leaves the frame by up to {_metres(beyond)}; double-click the plot to see "
                f"all of it.",
            )
    margin = 0.06 * max((high - low).max(), 10.0)
    figure.update_layout(
        xaxis_range=[low[0] - margin, high[0] + margin],
        yaxis_range=[low[1] - margin, high[1] + margin],
    )


def _corners(path: Array) -> Array:
    """(2, 2) smallest and largest east and north."""
    return np.array([extent(path[:, 0]), extent(path[:, 1])]).T


def _metres(value: float) -> str:
    return f"{value / 1000:.3g} km" if value >= 1000 else f"{value:.3g} m"


def height(
    solutions: Mapping[str, Solution], reference: Trajectory | None = None
) -> go.Figure | None:
    """Height above the ellipsoid over time, of {name: Solution} that have a position."""
    shown = [name for name, solution in solutions.items() if solution.has_position]
    if not shown:
        return None
    figure, first = panels(["height [m]"], 260), solutions[shown[0]]
    zero = origin(first.t)
    for rank, colour, name in _last_first(solutions, shown):
        line(
            figure,
            solutions[name].t - zero,
            solutions[name].trajectory.lla[:, 2],
            name,
            colour,
            rank=rank,
        )
    spans = [extent(solutions[name].trajectory.lla[:, 2]) for name in shown]
    low, high = min(spans, key=lambda span: span[1] - span[0])
    inside = (
        None if reference is None else (reference.t >= first.t[0]) & (reference.t <= first.t[-1])
    )
    if reference is not None and metrics.any_known(reference.lla[inside, 2]):
        line(
            figure,
            reference.t[inside] - zero,
            reference.lla[inside, 2],
            "reference",
            GREY,
            dash="dash",
        )
        low, high = extent(reference.lla[inside, 2])
    room = max(high - low, 20.0)
    for name, (lowest, highest) in zip(shown, spans):
        beyond = max(low - lowest, highest - high)
        if beyond > 2 * room:
            note(
                figure,
                f"{name} leaves the frame by up to {_metres(beyond)}; double-click the plot to see "
                f"all of it.",
            )
        else:
            low, high = min(low, lowest), max(high, highest)
    figure.update_yaxes(range=[low - 0.06 * room, high + 0.06 * room])
    return time_axis(figure, first, zero)


def horizontal(
    solutions: Mapping[str, Solution], reference: Trajectory | dict[str, Errors]
) -> go.Figure | None:
    """Horizontal position error over time on a logarithmic axis, with the 3-sigma each of {name:
    Solution} claims.

    reference: Trajectory, or {name: Errors} against it where they are known already.
    """
    found = (
        reference
        if isinstance(reference, dict)
        else {name: metrics.errors(solution, reference) for name, solution in solutions.items()}
    )
    shown = [name for name in solutions if metrics.any_known(found[name].horizontal)]
    if not shown:
        return None
    figure, first = panels(["horizontal error [m]"], 300, log=True), solutions[shown[0]]
    drawn: list[Array] = []
    zero = origin(first.t)
    for rank, colour, name in _last_first(solutions, shown):
        e = found[name]
        error, claimed = e.horizontal, 3 * np.hypot(claimed_sd(e)[:, 0], claimed_sd(e)[:, 1])
        assert error is not None  # as of all that are shown
        line(figure, e.t - zero, error, name, colour, rank=2 * rank)
        if np.isfinite(claimed).any():
            line(
                figure,
                e.t - zero,
                claimed,
                f"{name}, 3σ claimed",
                colour,
                rank=2 * rank + 1,
                dash="dot",
            )
        drawn += [error, claimed]
    values = np.concatenate(drawn)
    values = values[np.isfinite(values) & (values > 0)]
    if len(values):
        log_range(figure, max(np.quantile(values, 0.01), values.max() * 1e-6), values.max())
    return time_axis(figure, first, zero)


def position(
    solution: Solution,
    reference: Trajectory | Errors | None = None,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
) -> go.Figure | None:
    """Position error per axis with its 3-sigma band, m NED; without a reference north, east and
    height from the start.

    reference: Trajectory, or the Errors against it where they are known already; so for the figures
    below too.
    """
    e = _known(solution, reference)
    if e is not None and e.position is not None:
        shown = _Columns(NED_AXES, "m", e.position, 3 * claimed_sd(e)[:, :3])
        return _errors(solution, e.t, shown, colour, window)
    lla = solution.trajectory.lla
    moved = displacement(lla, np.broadcast_to(lla[0], lla.shape))
    values = np.c_[moved[:, :2], lla[:, 2]]
    names = ("north", "east", "height")
    shown = _Columns(names, "m", values, 3 * claimed_sd(solution)[:, :3])
    return _estimates(solution, shown, colour)


def heave(
    solution: Solution, colour: str = COLOURS[0], compare: Trajectory | None = None
) -> go.Figure | None:
    """Height about its mean with its 3-sigma band of a solution that knows no place beside it,
    m, upwards; None of others. Beside it `compare`, about its own."""
    if solution.has_position:
        return None
    beside = None
    if compare is not None:
        beside = _Beside(compare.t, about_mean(compare.t, compare.lla[:, 2:], solution.t))
    values = about_mean(solution.t, solution.trajectory.lla[:, 2:], solution.t)
    sd = 3 * claimed_sd(solution)[:, 2:3]
    shown = _Columns(("heave about its mean",), "m", values, sd, beside)
    return _estimates(solution, shown, colour, 260)


def velocity(
    solution: Solution,
    reference: Trajectory | Errors | None = None,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Velocity error per axis with its 3-sigma band, m/s NED; without a reference the estimate
    (with `compare` drawn beside it)."""
    e = _known(solution, reference)
    if e is not None and e.velocity is not None:
        shown = _Columns(NED_AXES, "m/s", e.velocity, 3 * claimed_sd(e)[:, 3:6])
        return _errors(solution, e.t, shown, colour, window)
    beside = None
    if compare is not None and compare.v_n is not None:
        beside = _Beside(compare.t, compare.v_n)
    v_n, sd = solution.trajectory.v_n, 3 * claimed_sd(solution)[:, 3:6]
    assert v_n is not None  # a solution has it, NaN where its filter estimates none
    return _estimates(solution, _Columns(NED_AXES, "m/s", v_n, sd, beside), colour)


def attitude(
    solution: Solution,
    reference: Trajectory | Errors | None = None,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Errors of roll, pitch and heading with 3-sigma bands, deg; without a reference the
    estimate (with `compare` drawn beside it)."""
    e = _known(solution, reference)
    if e is not None and e.rph is not None:
        sd = euler_sd(solution.trajectory.rph[e.rows], claimed_sd(e)[:, 6:9])
        shown = _Columns(EULER, "deg", np.degrees(e.rph), 3 * np.degrees(sd))
        return _errors(solution, e.t, shown, colour, window)
    rph, sd = solution.trajectory.rph, claimed_sd(solution)[:, 6:9]
    beside = None
    if compare is not None and compare.q_nb is not None:
        beside = _Beside(compare.t, np.degrees(compare.rph))
    shown = _Columns(EULER, "deg", np.degrees(rph), 3 * np.degrees(euler_sd(rph, sd)), beside)
    return _estimates(solution, shown, colour)


def attitude_angles(
    solution: Solution,
    reference: Trajectory | Errors,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
) -> go.Figure | None:
    """How far the attitude is off, deg: the angle of the whole rotation, of the vertical
    (inclination) and about it (heading)."""
    e = reference if isinstance(reference, Errors) else metrics.errors(solution, reference)
    found = metrics.attitude_angles(e)
    if found is None or not metrics.any_known(e.attitude):
        return None
    angles, names = np.degrees(found), metrics.AttitudeAngles._fields
    figure, zero, outside = panels([f"{name} [deg]" for name in names], 140), origin(solution.t), []
    for i, name in enumerate(names):
        line(figure, e.t - zero, angles[i], "angle of the error", colour, row=i + 1)
        limit, largest = frame(e.t, angles[i], np.zeros(len(e.t)), window)
        figure.update_yaxes(range=[0, limit], row=i + 1, col=1)
        outside += [f"{name} up to {largest:.3g} deg"] if largest > limit else []
    _beyond(figure, outside, window)
    return time_axis(figure, solution, zero)


def _known(solution: Solution, reference: Trajectory | Errors | None) -> Errors | None:
    return (
        reference
        if reference is None or isinstance(reference, metrics.Errors)
        else metrics.errors(solution, reference)
    )


def euler_sd(rph: Array, sd: Array) -> Array:
    """Standard deviations of roll, pitch and heading from those of the rotation vector in n, rad.

    Correlations are neglected; NaN beyond 85 deg of pitch, where roll and heading lose their
    meaning.
    """
    pitch, heading = rph[:, 1], rph[:, 2]
    variance_n, variance_e, variance_d = (sd**2).T
    forward = np.cos(heading) ** 2 * variance_n + np.sin(heading) ** 2 * variance_e
    right = np.sin(heading) ** 2 * variance_n + np.cos(heading) ** 2 * variance_e
    steep = np.where(np.abs(pitch) > np.radians(85), np.nan, 1.0)
    return np.sqrt(
        np.c_[
            steep * forward / np.cos(pitch) ** 2,
            right,
            steep * (variance_d + np.tan(pitch) ** 2 * forward),
        ]
    )


class _Beside(NamedTuple):
    """What is drawn beside the columns of a solution."""

    t: Array  # (m,) s
    values: Array  # (m, k)


class _Columns(NamedTuple):
    """What the panels of a figure show, a panel for each column."""

    names: Sequence[str]
    unit: str
    values: Array  # (n, k)
    half: Array  # (n, k) half the height of their bands
    beside: _Beside | None = None


def _errors(
    solution: Solution,
    t: Array,
    shown: _Columns,
    colour: str,
    window: tuple[float, float] | None,
) -> go.Figure | None:
    """A panel per column of `shown`, at times t, around zero, with its band; columns without a
    number are left out."""
    names, unit, values, half, _ = _with_numbers(shown)
    if not names:
        return None
    figure, zero, outside = panels([f"{name} [{unit}]" for name in names]), origin(solution.t), []
    for i, name in enumerate(names):
        band(figure, t - zero, np.zeros(len(t)), half[:, i], row=i + 1)
        line(figure, t - zero, values[:, i], "error (true - estimate)", colour, row=i + 1)
        limit, largest = frame(t, values[:, i], half[:, i], window)
        figure.update_yaxes(range=[-limit, limit], row=i + 1, col=1)
        if largest > limit:
            outside.append(f"{name} up to {largest:.3g} {unit}")
    _beyond(figure, outside, window)
    return time_axis(figure, solution, zero)


def _beyond(
    figure: go.Figure, outside: Sequence[str], window: tuple[float, float] | None = None
) -> None:
    """Say below the figure what of `outside` its frames do not show."""
    if outside:
        when = "outside the scored window" if window else "while the filter converges"
        note(
            figure,
            f"Beyond the frame {when}: {', '.join(outside)}. Double-click a panel to see all of it.",
        )


def _with_numbers(shown: _Columns) -> _Columns:
    """The same without the columns whose values have no number."""
    kept = np.flatnonzero(np.isfinite(shown.values).any(axis=0))
    beside = shown.beside
    return _Columns(
        [shown.names[i] for i in kept.tolist()],
        shown.unit,
        shown.values[:, kept],
        shown.half[:, kept],
        None if beside is None else _Beside(beside.t, beside.values[:, kept]),
    )


def _estimates(
    solution: Solution, shown: _Columns, colour: str, height: int = 170
) -> go.Figure | None:
    """A panel per column of `shown` that has numbers, with its band around it; angles that wrap
    are cut there."""
    names, unit, values, half, beside = _with_numbers(shown)
    if not names:
        return None
    figure, zero, t = (
        panels([f"{name} [{unit}]" for name in names], height),
        origin(solution.t),
        solution.t,
    )
    for i, name in enumerate(names):
        wraps, seen = name in ("roll", "heading"), None if beside is None else beside.values[:, i]
        if name == "heading":
            values[:, i], seen = together(values[:, i], seen)
        centre = cut(values[:, i]) if wraps else values[:, i]
        band(
            figure,
            t - zero,
            centre,
            np.where(half[:, i] < 180, half[:, i], np.nan) if wraps else half[:, i],
            row=i + 1,
        )
        line(figure, t - zero, centre, "estimate", colour, row=i + 1)
        if beside is not None and seen is not None and metrics.any_known(seen):
            inside = (beside.t >= t[0]) & (beside.t <= t[-1])
            path = cut(seen[inside]) if wraps else seen[inside]
            line(figure, beside.t[inside] - zero, path, "reference", GREY, row=i + 1, dash="dot")
        low, high = extent(values[:, i])
        reach = 1.15 * max(
            (high - low) / 2, min(peak(half[len(t) // 3 :, i]), 2 * (high - low)), 1e-9
        )
        whole_turn = name == "heading" and high - low > 180
        figure.update_yaxes(
            range=[0, 360] if whole_turn else [(low + high) / 2 - reach, (low + high) / 2 + reach],
            row=i + 1,
            col=1,
        )
    return time_axis(figure, solution, zero)


def sigma(solution: Solution) -> go.Figure | None:
    """3-sigma of position (m), velocity (m/s) and attitude (deg) over time on logarithmic axes;
    None where the filter claims none."""
    sd, zero = (
        3 * claimed_sd(solution)[:, :9] * np.r_[np.ones(6), np.full(3, np.degrees(1))],
        origin(solution.t),
    )
    if not np.isfinite(sd).any():
        return None
    groups = [k for k in range(3) if np.isfinite(sd[:, 3 * k : 3 * k + 3]).any()]
    figure, legend = (
        panels(
            [("3σ position [m]", "3σ velocity [m/s]", "3σ attitude [deg]")[k] for k in groups],
            log=True,
        ),
        set(),
    )
    for row, group in enumerate(groups, start=1):
        shown = np.where(
            sd[:, 3 * group : 3 * group + 3] > 0, sd[:, 3 * group : 3 * group + 3], np.nan
        )
        for i in np.flatnonzero(np.isfinite(shown).any(axis=0)):
            line(
                figure,
                solution.t - zero,
                shown[:, i],
                NED_AXES[i],
                COLOURS[i],
                row=row,
                legend=i not in legend,
            )
            legend.add(i)
        shown = shown[np.isfinite(shown)]
        if len(shown):
            log_range(figure, shown.min(), shown.max(), row=row)
    return time_axis(figure, solution, zero)


def accel_bias(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """Accelerometer bias per body axis with its 3-sigma band, in mg or, where it is small, ug."""
    scale, unit = (1e6 / 9.80665, "ug") if peak(solution.b_a) < 1e-3 else (1e3 / 9.80665, "mg")
    return _bias(
        solution, solution.b_a * scale, 3 * claimed_sd(solution)[:, 9:12] * scale, unit, colour
    )


def gyro_bias(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """Gyro bias per body axis with its 3-sigma band, in deg/h or, where it is large, deg/s."""
    scale, unit = (
        (np.degrees(1), "deg/s")
        if peak(solution.b_g) > np.radians(0.5)
        else (np.degrees(3600), "deg/h")
    )
    return _bias(
        solution, solution.b_g * scale, 3 * claimed_sd(solution)[:, 12:15] * scale, unit, colour
    )


def _bias(
    solution: Solution, values: Array, half: Array, unit: str, colour: str
) -> go.Figure | None:
    if not np.isfinite(half).any() and not peak(values):
        return None
    axes, _, values, half, _ = _with_numbers(_Columns("xyz", unit, values, half))
    figure, zero, t, outside = (
        panels([f"{axis} [{unit}]" for axis in axes]),
        origin(solution.t),
        solution.t,
        [],
    )
    for i, axis in enumerate(axes):
        band(figure, t - zero, values[:, i], half[:, i], row=i + 1)
        line(figure, t - zero, values[:, i], "estimate", colour, row=i + 1)
        late = values[len(t) // 3 :, i]
        settled = float(np.nanmedian(late)) if np.isfinite(late).any() else 0.0
        limit, largest = frame(
            t, values[:, i] - settled, half[:, i] + np.abs(values[:, i] - settled)
        )
        figure.update_yaxes(range=[settled - limit, settled + limit], row=i + 1, col=1)
        if largest > limit:
            outside.append(axis)
    _beyond(figure, outside)
    return time_axis(figure, solution, zero)


def extra(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """The filter's own output columns, a panel each; None where it has none."""
    numeric = {
        name: np.asarray(values, float)
        for name, values in solution.columns.items()
        if np.asarray(values).dtype.kind in "fiub"
    }
    if not numeric:
        return None
    figure, zero = panels([escape(name) for name in numeric]), origin(solution.t)
    for row, (name, values) in enumerate(numeric.items(), start=1):
        line(figure, solution.t - zero, values, name, colour, row=row, legend=False)
    return time_axis(figure, solution, zero)
