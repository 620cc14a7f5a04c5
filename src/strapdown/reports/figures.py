"""Figures of a Solution: track, errors or estimates with 3-sigma bands, claimed uncertainty,
biases, innovations and NIS.

Errors are true - estimate. Every function returns a plotly Figure, or None where the solution holds
nothing of what it shows; axes that are nowhere known are left out. Sentences that belong below a
figure are in `figure.layout.meta["notes"]`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go

from ..core.contract import ATT, BA, BG, POS, VEL
from ..data import Solution, Trajectory
from ..diagnosis.estimated import installation
from ..evaluation import metrics
from ..evaluation.metrics import EULER, NED_AXES, Errors
from ..geodesy import STANDARD_GRAVITY, displacement
from ..typing import Array
from .drawing import (
    COLOURS,
    GREY,
    RED,
    about_mean,
    band,
    corners,
    cut,
    even,
    extent,
    finish,
    frame,
    ground,
    line,
    log_range,
    metres,
    note,
    origin,
    panels,
    path,
    peak,
    seen_from_above,
    time_axis,
    together,
)
from .fix_figures import kind
from .summary import claimed_sd

FIX_MARKS = (
    (True, "accepted", {"color": GREY, "size": 4, "opacity": 0.5}),
    (False, "rejected", {"color": RED, "size": 8, "symbol": "x"}),
)
ENDS = ((0, "start", "circle", "#2f9e44"), (-1, "end", "square", "#343a40"))
"""Of a track: row, name, symbol and colour."""


def track(
    solutions: Mapping[str, Solution], reference: Trajectory | None = None
) -> go.Figure | None:
    """East and north in metres from the start, of {name: Solution}.

    The frame is that of the reference, or of the solution that moves least.
    """
    shown = _placed(solutions)
    if not shown:
        return None
    first = solutions[shown[0]]
    known = None if reference is None else reference.lla[np.isfinite(reference.lla).all(axis=1)]
    known = known if known is not None and len(known) else None
    start = _first_known(first.trajectory.lla if known is None else known)
    known = None if known is None else ground(known, start)
    paths = {name: ground(solutions[name].trajectory.lla, start) for name in shown}
    figure = finish(go.Figure(), 480 if known is None else 690)
    _fixes(figure, first, paths[shown[0]])
    for rank, colour, name in _last_first(solutions, shown):
        places = paths[name][even(len(paths[name]))]
        path(figure, places, name, line={"color": colour, "width": 2}, legendrank=rank)
    if known is not None:
        style = {"color": GREY, "width": 1.5, "dash": "dash"}
        path(figure, known[even(len(known))], "reference", line=style)
    for row, label, symbol, colour in ENDS:
        marker = {
            "symbol": symbol,
            "size": 11,
            "color": colour,
            "line": {"color": "#fff", "width": 1.5},
        }
        places = known if known is not None else paths[shown[0]]
        path(figure, places[[row]], label, mode="markers", marker=marker)
    return seen_from_above(figure, _frame_track(figure, known, paths), 0.06)


def _placed(solutions: Mapping[str, Solution]) -> list[str]:
    """Names of those that have a position."""
    return [name for name, solution in solutions.items() if solution.has_position]


def _first_known(lla: Array) -> Array:
    """The first position that is known whole; the first of all where none is."""
    return lla[np.argmax(np.isfinite(lla).all(axis=1))]


def _fixes(figure: go.Figure, solution: Solution, places: Array) -> None:
    """Mark the position fixes of a solution that is at these `places`, accepted and rejected:
    the estimate at each fix plus its innovation."""
    fixes = solution.innovations
    for index, name in enumerate(fixes.names):
        if kind(solution, name) != "position":
            continue
        own = (fixes.source == index) & np.isfinite(fixes.innovation[:, :2]).all(axis=1)
        for good, label, marker in FIX_MARKS:
            chosen = np.flatnonzero(own & (fixes.accepted == good))
            chosen = chosen[even(len(chosen))]
            if len(chosen):
                there = [np.interp(fixes.t[chosen], solution.t, axis) for axis in places.T]
                seen = np.column_stack(there) + fixes.innovation[chosen][:, [1, 0]]
                path(figure, seen, f"{name} fixes, {label}", mode="markers", marker=marker)


def _last_first(names: Iterable[str], shown: Sequence[str]) -> list[tuple[int, str, str]]:
    """(legend rank, colour, name) of those `shown` in the order of drawing: the first solution
    comes to lie on top."""
    return [
        (1 + i, COLOURS[i % len(COLOURS)], name) for i, name in enumerate(names) if name in shown
    ][::-1]


def _frame_track(figure: go.Figure, known: Array | None, paths: Mapping[str, Array]) -> Array:
    """The corners around the reference or the solution that moves least; one that goes as far
    again beyond that leaves the frame."""
    low, high = (
        corners(known)
        if known is not None
        else min(map(corners, paths.values()), key=lambda box: (box[1] - box[0]).max())
    )
    room = max((high - low).max(), 10.0)
    for name, places in paths.items():
        far_low, far_high = corners(places)
        beyond = max((low - far_low).max(), (far_high - high).max())
        if beyond <= room:
            low, high = np.minimum(low, far_low), np.maximum(high, far_high)
        else:
            _leaves(figure, name, beyond)
    return np.array([low, high])


def _leaves(figure: go.Figure, name: str, beyond: float) -> None:
    note(
        figure,
        f"{name} leaves the frame by up to {metres(beyond)}; double-click the plot to see all of "
        f"it.",
    )


def height(
    solutions: Mapping[str, Solution], reference: Trajectory | None = None
) -> go.Figure | None:
    """Height above the ellipsoid over time, of {name: Solution} that have a position."""
    shown = _placed(solutions)
    if not shown:
        return None
    figure, first = panels(["height [m]"], 260), solutions[shown[0]]
    zero = origin(first.t)
    heights = {name: solutions[name].trajectory.lla[:, 2] for name in shown}
    for rank, colour, name in _last_first(solutions, shown):
        line(figure, solutions[name].t - zero, heights[name], name, colour, rank=rank)
    spans = {name: extent(values) for name, values in heights.items()}
    low, high = min(spans.values(), key=lambda span: span[1] - span[0])
    if reference is not None:
        inside = (reference.t >= first.t[0]) & (reference.t <= first.t[-1])
        true = reference.lla[inside, 2]
        if metrics.any_known(true):
            line(figure, reference.t[inside] - zero, true, "reference", GREY, dash="dash")
            low, high = extent(true)
    room = max(high - low, 20.0)
    for name, (lowest, highest) in spans.items():
        beyond = max(low - lowest, highest - high)
        if beyond > 2 * room:
            _leaves(figure, name, beyond)
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
        error, claimed = e.horizontal, 3 * np.hypot(*claimed_sd(e)[:, :2].T)
        assert error is not None  # as of all that are shown
        line(figure, e.t - zero, error, name, colour, rank=2 * rank)
        if np.isfinite(claimed).any():
            label = f"{name}, 3σ claimed"
            line(figure, e.t - zero, claimed, label, colour, rank=2 * rank + 1, dash="dot")
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
    lla, half = solution.trajectory.lla, 3 * claimed_sd(solution)[:, POS]
    moved = displacement(lla, np.broadcast_to(_first_known(lla), lla.shape))
    values = np.c_[moved[:, :2], lla[:, 2]]
    shown = _Panels(("north", "east", "height"), "m", solution.t, values, half)
    return _errors_or_estimates(solution, shown, reference, "position", colour, window)


def heave(
    solution: Solution, colour: str = COLOURS[0], compare: Trajectory | None = None
) -> go.Figure | None:
    """Height about its mean with its 3-sigma band of a solution that knows no place beside it,
    m, upwards; None of others. Beside it `compare`, about its own."""
    if solution.has_position:
        return None

    def about(made: Trajectory) -> tuple[Array, Array]:
        return made.t, about_mean(made.t, made.lla[:, 2:], solution.t)

    half, beside = 3 * claimed_sd(solution)[:, 2:3], None if compare is None else about(compare)
    t, values = about(solution.trajectory)
    shown = _Panels(("heave about its mean",), "m", t, values, half, beside=beside, height=260)
    return _drawn(solution, shown, colour)


def velocity(
    solution: Solution,
    reference: Trajectory | Errors | None = None,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Velocity error per axis with its 3-sigma band, m/s NED; without a reference the estimate
    (with `compare` drawn beside it)."""
    v_n, half = solution.trajectory.v_n, 3 * claimed_sd(solution)[:, VEL]
    assert v_n is not None  # a solution has it, NaN where its filter estimates none
    beside = None if compare is None or compare.v_n is None else (compare.t, compare.v_n)
    shown = _Panels(NED_AXES, "m/s", solution.t, v_n, half, beside=beside)
    return _errors_or_estimates(solution, shown, reference, "velocity", colour, window)


def attitude(
    solution: Solution,
    reference: Trajectory | Errors | None = None,
    colour: str = COLOURS[0],
    window: tuple[float, float] | None = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Errors of roll, pitch and heading with 3-sigma bands, deg; without a reference the
    estimate (with `compare` drawn beside it)."""
    rph = solution.trajectory.rph
    half = 3 * np.degrees(euler_sd(rph, claimed_sd(solution)[:, ATT]))
    beside = None
    if compare is not None and compare.q_nb is not None:
        beside = compare.t, np.degrees(compare.rph)
    shown = _Panels(EULER, "deg", solution.t, np.degrees(rph), half, beside=beside)
    return _errors_or_estimates(solution, shown, reference, "rph", colour, window)


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
    angles, names = np.degrees(found).T, metrics.AttitudeAngles._fields
    none_claimed = np.full_like(angles, np.nan)
    label = "angle of the error"
    shown = _Panels(names, "deg", e.t, angles, none_claimed, _above_zero, label, height=140)
    return _drawn(solution, shown, colour, window)


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


def _errors_or_estimates(
    solution: Solution,
    estimates: _Panels,
    reference: Trajectory | Errors | None,
    part: str,
    colour: str,
    window: tuple[float, float] | None,
) -> go.Figure | None:
    """The `part` of the Errors where the reference knows it, else the estimates of the same."""
    e = metrics.errors(solution, reference) if isinstance(reference, Trajectory) else reference
    errors = None if e is None else getattr(e, part)
    shown = estimates
    if e is not None and errors is not None:
        names, values = (EULER, np.degrees(errors)) if part == "rph" else (NED_AXES, errors)
        half = estimates.half[e.rows]
        label = "error (true - estimate)"
        shown = _Panels(names, estimates.unit, e.t, values, half, _around_zero, label)
    return _drawn(solution, shown, colour, window)


def _around_zero(
    t: Array, values: Array, half: Array, window: tuple[float, float] | None
) -> tuple[float, float, float]:
    """Ends of an axis around zero, and the largest magnitude where that is beyond them, else 0."""
    limit, largest = frame(t, values, half, window)
    return -limit, limit, largest if largest > limit else 0.0


def _above_zero(
    t: Array, values: Array, half: Array, window: tuple[float, float] | None
) -> tuple[float, float, float]:
    """As `_around_zero`, of values that have no sign."""
    _, limit, beyond = _around_zero(t, values, half, window)
    return 0, limit, beyond


def _around_settled(
    t: Array, values: Array, half: Array, window: tuple[float, float] | None
) -> tuple[float, float, float]:
    """As `_around_zero`, around the value that a bias settles at."""
    late = values[len(t) // 3 :]
    settled = float(np.nanmedian(late)) if np.isfinite(late).any() else 0.0
    away = values - settled
    low, high, beyond = _around_zero(t, away, half + np.abs(away), window)
    return settled + low, settled + high, beyond


def _around_all(
    t: Array, values: Array, half: Array, window: tuple[float, float] | None
) -> tuple[float, float, float]:
    """As `_around_zero`, around all values and their later bands; nothing is beyond."""
    low, high = extent(values)
    reach = 1.15 * max((high - low) / 2, min(peak(half[len(t) // 3 :]), 2 * (high - low)), 1e-9)
    return (low + high) / 2 - reach, (low + high) / 2 + reach, 0.0


class _Panels(NamedTuple):
    """What a figure shows, a panel for each column."""

    names: Sequence[str]
    unit: str
    t: Array  # (n,) s
    values: Array  # (n, k)
    half: Array  # (n, k) half the height of their bands
    framed: Callable[
        [Array, Array, Array, tuple[float, float] | None], tuple[float, float, float]
    ] = _around_all
    label: str = "estimate"
    beside: tuple[Array, Array] | None = None  # (m,) s and (m, k): what is drawn beside them
    height: int = 170  # of a panel


def _drawn(
    solution: Solution,
    shown: _Panels,
    colour: str,
    window: tuple[float, float] | None = None,
) -> go.Figure | None:
    """A panel per column of `shown` that has numbers, with its band: that of errors around zero,
    that of estimates around them. Angles that wrap are cut there."""
    kept = np.flatnonzero(np.isfinite(shown.values).any(axis=0)).tolist()
    if not kept:
        return None
    names, unit, t = shown.names, shown.unit, shown.t
    figure = panels([f"{names[i]} [{unit}]" for i in kept], shown.height)
    zero, outside = origin(solution.t), []
    for row, i in enumerate(kept, start=1):
        name, values, half = names[i], shown.values[:, i], shown.half[:, i]
        seen = None if shown.beside is None else shown.beside[1][:, i]
        turns = shown.framed is _around_all and name in ("roll", "heading")
        if turns and name == "heading":
            values, seen = together(values, seen)
        low, high, beyond = shown.framed(t, values, half, window)
        if turns:
            least, most = extent(values)
            low, high = (0, 360) if name == "heading" and most - least > 180 else (low, high)
            values, half = cut(values), np.where(half < 180, half, np.nan)
        centre = values if shown.label == "estimate" else np.zeros(len(t))
        band(figure, t - zero, centre, half, row=row)
        line(figure, t - zero, values, shown.label, colour, row=row)
        if shown.beside is not None and seen is not None and metrics.any_known(seen):
            inside = (shown.beside[0] >= t[0]) & (shown.beside[0] <= t[-1])
            true = cut(seen[inside]) if turns else seen[inside]
            since = shown.beside[0][inside] - zero
            line(figure, since, true, "reference", GREY, row=row, dash="dot")
        figure.update_yaxes(range=[low, high], row=row, col=1)
        if beyond:
            outside.append(
                name if shown.framed is _around_settled else f"{name} up to {beyond:.3g} {unit}"
            )
    if outside:
        when = "outside the scored window" if window else "while the filter converges"
        note(
            figure,
            f"Beyond the frame {when}: {', '.join(outside)}. Double-click a panel to see all of it.",
        )
    return time_axis(figure, solution, zero)


def sigma(solution: Solution) -> go.Figure | None:
    """3-sigma of position (m), velocity (m/s) and attitude (deg) over time on logarithmic axes;
    None where the filter claims none."""
    scale, zero = np.r_[np.ones(6), np.full(3, np.degrees(1))], origin(solution.t)
    sd = 3 * claimed_sd(solution)[:, :9] * scale
    groups = [
        (f"3σ {name} [{unit}]", sd[:, states])
        for name, unit, states in (
            ("position", "m", POS),
            ("velocity", "m/s", VEL),
            ("attitude", "deg", ATT),
        )
        if np.isfinite(sd[:, states]).any()
    ]
    if not groups:
        return None
    figure, listed = panels([label for label, _ in groups], log=True), set()
    for row, (_, values) in enumerate(groups, start=1):
        shown = np.where(values > 0, values, np.nan)
        for i in np.flatnonzero(np.isfinite(shown).any(axis=0)).tolist():
            new = i not in listed
            line(figure, solution.t - zero, shown[:, i], NED_AXES[i], COLOURS[i], row, new)
            listed.add(i)
        shown = shown[np.isfinite(shown)]
        if len(shown):
            log_range(figure, shown.min(), shown.max(), row=row)
    return time_axis(figure, solution, zero)


def accel_bias(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """Accelerometer bias per body axis with its 3-sigma band, in mg or, where it is small, ug."""
    scale, unit = (1e6, "ug") if peak(solution.b_a) < 1e-3 else (1e3, "mg")
    return _bias(solution, solution.b_a, BA, scale / STANDARD_GRAVITY, unit, colour)


def gyro_bias(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """Gyro bias per body axis with its 3-sigma band, in deg/h or, where it is large, deg/s."""
    large = peak(solution.b_g) > np.radians(0.5)
    scale, unit = (np.degrees(1), "deg/s") if large else (np.degrees(3600), "deg/h")
    return _bias(solution, solution.b_g, BG, scale, unit, colour)


def _bias(
    solution: Solution, bias: Array, states: slice, scale: float, unit: str, colour: str
) -> go.Figure | None:
    values, half = bias * scale, 3 * claimed_sd(solution)[:, states] * scale
    if not np.isfinite(half).any() and not peak(values):
        return None
    return _drawn(solution, _Panels("xyz", unit, solution.t, values, half, _around_settled), colour)


def extra(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """The filter's own output columns, but those of the installation, a panel each; None where it
    has none."""
    of_installation = {
        name for each in installation(solution).parameters for name in (each.column, each.sd_column)
    }
    numeric = {
        name: np.asarray(values, float)
        for name, values in solution.columns.items()
        if np.asarray(values).dtype.kind in "fiub" and name not in of_installation
    }
    if not numeric:
        return None
    figure, zero = panels([escape(name) for name in numeric]), origin(solution.t)
    for row, (name, values) in enumerate(numeric.items(), start=1):
        line(figure, solution.t - zero, values, name, colour, row=row, legend=False)
    return time_axis(figure, solution, zero)
