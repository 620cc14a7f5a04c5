"""Figures of solutions: track, errors or estimates with 3-sigma bands, claimed uncertainty and
biases, all solutions on the same axes.

Each function takes a Solution or {name: Solution} and returns a plotly Figure, or None where they
hold nothing of what it shows; axes that are nowhere known are left out. A `reference` is a
Trajectory, or {name: Errors} against one where they are known already. Errors are true - estimate.
Sentences that belong below a figure are in `figure.layout.meta["notes"]`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import plotly.graph_objects as go

from ..core.loop.contract import ATT, BA, BG, POS, VEL
from ..data.solution import Solution, Trajectory
from ..evaluation import metrics
from ..evaluation.metrics import EULER, NED_AXES, Errors
from ..installation.states import estimated_installation
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from ..units.wording import capitalise, join_words, metres
from .drawing import (
    COLOURS,
    FAR,
    GREY,
    MAX_POINTS,
    RED,
    SHADED_BANDS,
    BandStyle,
    ShownSolution,
    about_mean,
    band,
    column,
    corners,
    cut_wraps,
    each,
    east_north_up,
    even_indices,
    extent,
    faint,
    finish,
    frame,
    kind,
    line,
    log_frame,
    log_range,
    marks,
    note,
    origin,
    panels,
    path,
    peak,
    positive,
    seen_from_above,
    time_axis,
    together,
    wider,
)
from .summary import claimed_std

Solutions: TypeAlias = Solution | Mapping[str, Solution]
"""One, or several by name."""
Reference: TypeAlias = Trajectory | Errors | Mapping[str, Errors] | None
"""Reference that solutions are compared with, or the errors against it, of one or by name."""
Window: TypeAlias = tuple[float, float] | None
"""(start, stop) s that is scored."""
Marked: TypeAlias = tuple[str, Mapping[str, object], Array, Array]
"""Marks: name, style, times (m,) s and values (m, k)."""
FIX_MARKS = (
    (True, "accepted", {"color": GREY, "size": 4, "opacity": 0.5}),
    (False, "rejected", {"color": RED, "size": 11, "symbol": "x"}),
)
ENDS = ((0, "start", "circle", "#2f9e44"), (-1, "end", "square", "#343a40"))
"""Ends of a track: row, name, symbol and colour."""
FROM_SOUTH = {"x": 0.25, "y": -1.0, "z": 0.75}
"""Where a track in three dimensions is seen from: north is away, as on a map."""
AWAY = 0.25
"""Part of the time for which it must be so far to leave it."""
LINES_APART = 300.0
"""Lines in three dimensions that are closer than this part of the frame are drawn as one."""
MIN_SHARE, MAX_TIMES = 1e-6, 1e4
"""Shares of the peak of the best solution: lower and upper end of a logarithmic axis at most."""
TO_SEE_ALL = "Double-click a panel to see all of it."
BELOW, BELOW_WIDTH = faint(GREY, 0.55), 6.0
"""Colour and width of the line of the reference, below those of the solutions and wider, so that it
shows where they agree."""


def track(solutions: Solutions, reference: Trajectory | None = None) -> go.Figure | None:
    """East and north in metres from the start, seen from above.

    The frame is that of the reference, or of the solution that moves least.
    """
    places = _Places.of(solutions, reference)
    if places is None:
        return None
    figure = finish(go.Figure(), 560)
    figure.layout.meta["track"] = True
    first, paths = places.shown[0], places.paths
    for label, marker, t, seen in _fixes(first.solution, paths[0]):
        path(figure, seen[:, :2], label, mode="markers", marker=marker, t=t)
    if places.reference is not None:
        t, there = places.reference
        keep = even_indices(len(there), MAX_POINTS)
        path(
            figure,
            there[keep, :2],
            "reference",
            line={"color": BELOW, "width": BELOW_WIDTH},
            legendrank=1000,
            t=t[keep],
        )
    for rank, one, there in places.last_first():
        keep = even_indices(len(there), MAX_POINTS)
        style = {"color": one.colour, "width": wider(2, rank - 1), "dash": one.dash}
        t = one.solution.t[keep]
        path(figure, there[keep, :2], one.label(), line=style, legendrank=rank, t=t)
    for label, marker, t, there in places.ends():
        side = "left" if places.label_is_left(label) else "right"
        said: dict[str, Any] = {"text": [label], "textposition": f"middle {side}"}
        path(
            figure,
            there[:, :2],
            label,
            "markers+text",
            t=t,
            marker=marker,
            showlegend=False,
            **said,
        )
    box = _frame_track(figure, places, 2)
    return seen_from_above(figure, box, 0.06)


def space(solutions: Solutions, reference: Trajectory | None = None) -> go.Figure | None:
    """East, north and up in metres from the start, in three dimensions of one scale; None where
    no height is known."""
    places = _Places.of(solutions, reference)
    if places is None:
        return None
    figure = finish(go.Figure(), 560)
    figure.layout.meta["track"] = True

    def draw_line(t: Array, there: Array, name: str, rank: int, **style: object) -> None:
        keep = even_indices(len(there), MAX_POINTS)
        figure.add_trace(
            go.Scatter3d(
                **dict(zip("xyz", map(column, there[keep].T))),
                name=escape(name),
                mode="lines",
                line=style,
                legendrank=rank,
                customdata=column(t[keep]),
                hovertemplate="%{x:.1f} m east, %{y:.1f} m north, %{z:.1f} m up, "
                "%{customdata:.1f} s",
            )
        )

    low, high = _frame_track(figure, places, 3)
    first, nearest = places.shown[0], (high - low).max() / LINES_APART
    same_place: list[str] = []

    def draw_apart(t: Array, there: Array, name: str, rank: int, **style: object) -> None:
        """Draw a line where it leaves that of the first solution: of two lines in one place a browser
        shows now the one and now the other."""
        own = [np.interp(t, first.solution.t, axis) for axis in places.paths[0].T]
        apart = np.linalg.norm(there - np.column_stack(own), axis=1) > nearest
        if not apart.all():
            same_place.append(name)
        draw_line(t, np.where(apart[:, None], there, np.nan), name, rank, **style)

    for rank, one, there in places.last_first()[:-1]:
        style = {"color": one.colour, "width": 4, "dash": one.dash}
        draw_apart(one.solution.t, there, one.label(), rank, **style)
    style = {"color": first.colour, "width": 4, "dash": first.dash}
    draw_line(first.solution.t, places.paths[0], first.label(), 1, **style)
    if places.reference is not None:
        draw_apart(*places.reference, "reference", 1000, color=GREY, width=3, dash="dot")
    if same_place:
        shown = f"{join_words(same_place)} {'is' if len(same_place) == 1 else 'are'}"
        note(
            figure,
            f"{capitalise(shown)} drawn where farther than {metres(nearest)} from {first.label('the estimate')}.",
        )
    return figure.update_layout(
        scene=_scene(low, high), margin={"l": 0, "r": 0, "b": 0}, hovermode="closest"
    )


def _scene(low: Array, high: Array) -> dict[str, Any]:
    """The axes and the view of a scene that holds east, north and up from `low` to `high` (3,), m."""
    room = 0.06 * max((high - low).max(), 10.0)
    spans = high - low + 2 * room
    axes = {
        f"{axis}axis": {
            "title": f"{name} [m]",
            "range": [low[i] - room, high[i] + room],
            "nticks": 4 if name == "up" else 8,
        }
        for i, (axis, name) in enumerate(zip("xyz", ("east", "north", "up")))
    }
    return {
        **axes,
        "aspectmode": "manual",  # as "data", of one size for flat tracks too
        "aspectratio": dict(zip("xyz", spans / spans.max())),
        "camera": {"eye": FROM_SOUTH, "center": {"z": -0.15}},
    }


class _Places(NamedTuple):
    """Where solutions and a reference were, (n, 3) m east, north, up of the first place known."""

    shown: list[ShownSolution]
    paths: list[Array]
    reference: tuple[Array, Array] | None  # times s, and places

    @classmethod
    def of(cls, solutions: Solutions, reference: Trajectory | None) -> _Places | None:
        """None where no solution has a position."""
        shown = [one for one in each(solutions) if one.solution.has_position]
        if not shown:
            return None
        known = (
            None
            if reference is None
            else reference.take(np.flatnonzero(np.isfinite(reference.lla).all(axis=1)))
        )
        known = known if known is not None and len(known) else None
        start = _first_known(shown[0].solution.trajectory.lla if known is None else known.lla)
        paths = [east_north_up(one.solution.trajectory.lla, start) for one in shown]
        return cls(
            shown, paths, None if known is None else (known.t, east_north_up(known.lla, start))
        )

    def last_first(self) -> list[tuple[int, ShownSolution, Array]]:
        """(legend rank, solution, places) in the order of drawing: the first comes to lie on
        top."""
        return list(zip(range(1, 1 + len(self.shown)), self.shown, self.paths))[::-1]

    def ends(self) -> list[Marked]:
        """(name, style of the mark, time (1,), place (1, 3)) of start and end of the first solution."""
        t, there = self.shown[0].solution.t, self.paths[0]
        known = np.flatnonzero(np.isfinite(there).all(axis=1))
        style = {"size": 11, "line": {"color": "#fff", "width": 1.5}}
        return [
            (
                label,
                {**style, "symbol": symbol, "color": colour},
                t[known[[end]]],
                there[known[[end]]],
            )
            for end, label, symbol, colour in ENDS
        ]

    def label_is_left(self, end: str) -> bool:
        """True where the label of an end of the track of the first solution is clear of it on its
        left side."""
        east = self.paths[0][np.isfinite(self.paths[0]).all(axis=1), 0]
        near = east[: len(east) // 20 + 1] if end == "start" else east[-(len(east) // 20) - 1 :]
        return bool((near[-1] > near[0]) == (end == "start"))


def _first_known(lla: Array) -> Array:
    """The first position that is known whole; the first of all where none is."""
    return lla[np.argmax(np.isfinite(lla).all(axis=1))]


def _fixes(solution: Solution, estimates: Array, of: str = "position") -> list[Marked]:
    """(name, style, times (m,), values (m, 3)) of the accepted and of the rejected fixes of that
    kind of a solution that estimates these: the estimate at each fix plus its innovation.

    estimates: (n, 3) east, north, up of positions; north, east, down of velocities.
    """
    fixes = solution.innovations
    found: list[Marked] = []
    for index, name in enumerate(fixes.names):
        if kind(solution, name) != of:
            continue
        own = (fixes.source == index) & np.isfinite(fixes.innovation[:, :2]).all(axis=1)
        for good, label, marker in FIX_MARKS:
            chosen = np.flatnonzero(own & (fixes.accepted == good))
            chosen = chosen[even_indices(len(chosen), MAX_POINTS)]
            if len(chosen):
                t, seen = fixes.t[chosen], fixes.innovation[chosen]
                seen = seen[:, [1, 0, 2]] * [1, 1, -1] if of == "position" else seen
                there = [np.interp(t, solution.t, axis) for axis in estimates.T]
                found.append((f"{name} fixes, {label}", marker, t, np.column_stack(there) + seen))
    return found


def _frame_track(figure: go.Figure, places: _Places, axes: int) -> Array:
    """The corners, (2, axes), around the reference or the solution that moves least; one that
    goes as far again beyond that leaves the frame."""
    boxes = [corners(there[:, :axes]) for there in places.paths]
    low, high = (
        corners(places.reference[1][:, :axes])
        if places.reference is not None
        else min(boxes, key=lambda box: (box[1] - box[0]).max())
    )
    room = max((high - low).max(), 10.0)
    for one, (far_low, far_high) in zip(places.shown, boxes):
        beyond = max((low - far_low).max(), (far_high - high).max())
        if beyond <= room:
            low, high = np.minimum(low, far_low), np.maximum(high, far_high)
        else:
            _leaves(figure, one.label("the estimate"), beyond)
    return np.array([low, high])


def _leaves(figure: go.Figure, name: str, beyond: float) -> None:
    note(
        figure,
        f"{name} leaves the frame by up to {metres(beyond)}; double-click the plot to see all of "
        f"it.",
    )


def height(solutions: Solutions, reference: Trajectory | None = None) -> go.Figure | None:
    """Height above the ellipsoid over time, of those that have a position, with the fixes of the
    first."""
    shown = [one for one in each(solutions) if one.solution.has_position]
    if not shown:
        return None
    figure, first = panels(["height [m]"], 260), shown[0].solution
    zero, lla = origin(first.t), first.trajectory.lla
    up = east_north_up(lla, _first_known(lla))
    for label, marker, t, seen in _fixes(first, up):
        marks(figure, t - zero, seen[:, 2] + _first_known(lla)[2], label, marker, unit="m")
    spans = [extent(one.solution.trajectory.lla[:, 2]) for one in shown]
    low, high = min(spans, key=lambda span: span[1] - span[0])
    if reference is not None:
        inside = (reference.t >= first.t[0]) & (reference.t <= first.t[-1])
        true = reference.lla[inside, 2]
        if metrics.any_known(true):
            _reference(figure, reference.t[inside] - zero, true, "m")
            low, high = extent(true)
    for rank, one in list(enumerate(shown))[::-1]:
        values, std = one.solution.trajectory.lla[:, 2], claimed_std(one.solution)[:, 2]
        _curve(figure, one, rank, _Series(one.solution.t - zero, values, "m", std))
    room = max(high - low, 20.0)
    for one, (lowest, highest) in zip(shown, spans):
        beyond = max(low - lowest, highest - high)
        if beyond > 2 * room:
            _leaves(figure, one.label("the estimate"), beyond)
        else:
            low, high = min(low, lowest), max(high, highest)
    figure.update_yaxes(range=[low - 0.06 * room, high + 0.06 * room])
    return time_axis(figure, solutions, zero)


class _Series(NamedTuple):
    """Values over time, as a line shows them."""

    t: Array  # (n,) s
    values: Array  # (n,)
    unit: str
    std: Array | None = None  # (n,)


def _curve(
    figure: go.Figure,
    one: ShownSolution,
    rank: int,
    of: _Series,
    row: int = 1,
    label: str = "estimate",
) -> None:
    """The line of a solution."""
    name, width = one.label(label), wider(1.4, rank)
    line(
        figure,
        of.t,
        of.values,
        name,
        one.colour,
        row,
        None,
        rank,
        of.unit,
        of.std,
        dash=one.dash,
        width=width,
    )


def _band(
    figure: go.Figure, one: ShownSolution, t: Array, centre: Array, half: Array, row: int, of: int
) -> None:
    """Draw the band of one solution of `of`; the entry of its line in the legend hides it too."""
    if one.alone:
        band(figure, t, centre, half, row)
    else:
        style = BandStyle(one.colour, one.name, of <= SHADED_BANDS)
        band(figure, t, centre, half, row, f"{one.name} ±3σ", style)


def _reference(figure: go.Figure, t: Array, values: Array, unit: str, row: int = 1) -> None:
    line(figure, t, values, "reference", BELOW, row, unit=unit, width=BELOW_WIDTH)


def _errors(one: ShownSolution, reference: Reference) -> Errors | None:
    """The Errors of a solution, None without a reference."""
    if reference is None or isinstance(reference, Errors):
        return reference
    if isinstance(reference, Trajectory):
        return metrics.errors(one.solution, reference)
    return reference.get(one.name)


def horizontal(solutions: Solutions, reference: Reference) -> go.Figure | None:
    """Horizontal position error over time on a logarithmic axis, with the 3-sigma that each
    solution claims."""
    figure, drawn = panels(["horizontal error [m]"], 300, log=True), []
    for rank, one in list(enumerate(each(solutions)))[::-1]:
        e = _errors(one, reference)
        if e is None or not metrics.any_known(e.horizontal):
            continue
        zero, claimed = origin(one.solution.t), 3 * np.hypot(*claimed_std(e)[:, :2].T)
        _curve(figure, one, rank, _Series(e.t - zero, e.horizontal, "m"), label="error")
        if np.isfinite(claimed).any():
            name = one.label("error")
            label = "3σ claimed" if one.alone else f"{name}, 3σ claimed"
            line(
                figure,
                e.t - zero,
                claimed,
                label,
                one.colour,
                unit="m",
                legend=one.alone,
                dash="dot",
            )
            figure.data[-1].legendgroup = name
        drawn.append((one, e.horizontal, claimed))
    if not drawn:
        return None
    values = positive(*(part for _, *parts in drawn for part in parts))
    if len(values):
        best = min(peak(error) or np.inf for _, error, _ in drawn)
        low, top = max(np.quantile(values, 0.01), best * MIN_SHARE), best * MAX_TIMES
        log_range(figure, low, min(values.max(), top))
        for one, error, _ in drawn:
            if peak(error) > top:
                _leaves(figure, one.name, peak(error))
    return time_axis(figure, solutions, zero)


def position(
    solutions: Solutions, reference: Reference = None, window: Window = None
) -> go.Figure | None:
    """Position error per axis with its 3-sigma band, m NED; without a reference north, east and
    height from where the first solution begins, with its fixes."""
    placed = [one for one in each(solutions) if one.solution.has_position]
    shown = placed if reference is None else each(solutions)
    if not shown:
        return None
    start = _first_known(shown[0].solution.trajectory.lla)

    def estimated_position(solution: Solution) -> Array:
        moved = east_north_up(solution.trajectory.lla, start)
        return np.c_[moved[:, [1, 0]], solution.trajectory.lla[:, 2]]

    fixes = []
    for label, style, t, seen in _fixes(
        shown[0].solution, east_north_up(shown[0].solution.trajectory.lla, start)
    ):
        fixes.append((label, style, t, seen[:, [1, 0, 2]] + [0, 0, start[2]]))
    quantity = _Quantity(("north", "east", "height"), "m", POS, estimated_position)
    return _errors_or_estimates(shown, quantity, reference, "position", window, fixes=fixes)


def heave(solutions: Solutions, compare: Trajectory | None = None) -> go.Figure | None:
    """Height about its mean with its 3-sigma band of solutions that know no place beside it, m,
    upwards; None of others. Beside it `compare`, about its own."""
    shown = [one for one in each(solutions) if not one.solution.has_position]
    if not shown:
        return None

    def about(made: Trajectory) -> Array:
        return about_mean(made.t, made.lla[:, 2:], shown[0].solution.t)

    quantity = _Quantity(
        ("heave about its mean",), "m", slice(2, 3), lambda s: about(s.trajectory), height=260
    )
    beside = None if compare is None else (compare.t, about(compare))
    return _draw_panels(shown, quantity, [_estimates(one, quantity) for one in shown], None, beside)


def velocity(
    solutions: Solutions,
    reference: Reference = None,
    window: Window = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Velocity error per axis with its 3-sigma band, m/s NED; without a reference the estimate
    with the fixes of the first solution, and `compare` drawn beside it."""
    # a solution has it, NaN where its filter estimates none
    quantity = _Quantity(NED_AXES, "m/s", VEL, lambda s: s.trajectory.v_n)  # type: ignore[return-value,arg-type]
    shown = each(solutions)
    beside = None if compare is None or compare.v_n is None else (compare.t, compare.v_n)
    fixes = _fixes(shown[0].solution, quantity.of(shown[0].solution), "velocity") if shown else []
    return _errors_or_estimates(
        shown, quantity, reference, "velocity", window, beside, fixes if beside is None else []
    )


def attitude(
    solutions: Solutions,
    reference: Reference = None,
    window: Window = None,
    compare: Trajectory | None = None,
) -> go.Figure | None:
    """Errors of roll, pitch and heading with 3-sigma bands, deg; without a reference the
    estimate, and `compare` drawn beside it."""
    beside = None
    if compare is not None and compare.q_nb is not None:
        beside = compare.t, np.degrees(compare.rph)
    quantity = _Quantity(
        EULER,
        "deg",
        ATT,
        lambda s: np.degrees(s.trajectory.rph),
        lambda s: np.degrees(euler_std(s.trajectory.rph, claimed_std(s)[:, ATT])),
    )
    return _errors_or_estimates(each(solutions), quantity, reference, "rph", window, beside)


def attitude_angles(
    solutions: Solutions, reference: Reference, window: Window = None
) -> go.Figure | None:
    """Attitude errors, deg: the angle of the whole rotation, of the vertical
    (inclination) and about it (heading)."""
    shown, curves = [], []
    for one in each(solutions):
        e = _errors(one, reference)
        if e is not None and metrics.any_known(e.attitude):
            angles = np.degrees(metrics.attitude_angles(e)).T
            shown.append(one)
            curves.append(_Curve(e.t, angles, np.full_like(angles, np.nan)))
    names = metrics.AttitudeAngles._fields
    quantity = _Quantity(names, "deg", ATT, _none, framed=_above_zero, height=140)
    return _draw_panels(shown, quantity._replace(label="angle of the error"), curves, window)


def euler_std(rph: Array, std: Array) -> Array:
    """Standard deviations of roll, pitch and heading from those of the rotation vector in n, rad.

    Correlations are neglected; NaN beyond 85 deg of pitch, where roll and heading lose their
    meaning.
    """
    pitch, heading = rph[:, 1], rph[:, 2]
    variance_n, variance_e, variance_d = (std**2).T
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


def _around_zero(
    t: Array, values: Array, half: Array, window: Window
) -> tuple[float, float, float]:
    """Ends of an axis around zero, and the largest magnitude where that is beyond them, else 0."""
    limit, largest = frame(t, values, half, window)
    return -limit, limit, largest if largest > limit else 0.0


def _above_zero(t: Array, values: Array, half: Array, window: Window) -> tuple[float, float, float]:
    """As `_around_zero`, of values that have no sign."""
    _, limit, beyond = _around_zero(t, values, half, window)
    return 0, limit, beyond


def _around_settled(
    t: Array, values: Array, half: Array, window: Window
) -> tuple[float, float, float]:
    """As `_around_zero`, around the value that a bias settles at."""
    late = values[len(t) // 3 :]
    settled = float(np.nanmedian(late)) if np.isfinite(late).any() else 0.0
    away = values - settled
    low, high, beyond = _around_zero(t, away, half + np.abs(away), window)
    return settled + low, settled + high, beyond


def _around_all(t: Array, values: Array, half: Array, window: Window) -> tuple[float, float, float]:
    """As `_around_zero`, around all values and their later bands; nothing is beyond."""
    low, high = extent(values)
    reach = 1.15 * max((high - low) / 2, min(peak(half[len(t) // 3 :]), 2 * (high - low)), 1e-9)
    return (low + high) / 2 - reach, (low + high) / 2 + reach, 0.0


class _Quantity(NamedTuple):
    """A quantity of a figure, with a panel for each name."""

    names: Sequence[str]
    unit: str
    states: slice  # of the standard deviations claimed
    of: Callable[[Solution], Array]  # (n, k) estimates
    std_of: Callable[[Solution], Array] | None = None  # (n, k); by default those of `states`
    framed: Callable[[Array, Array, Array, Window], tuple[float, float, float]] = _around_all
    label: str = "estimate"
    height: int = 170  # of a panel
    scale: float = 1.0  # from SI to `unit`, of standard deviations by `states`


class _Curve(NamedTuple):
    """The curve of a solution in a figure."""

    t: Array  # (n,) s
    values: Array  # (n, k)
    half: Array  # (n, k) half the height of their bands


def _none(solution: Solution) -> Array:
    """No estimates."""
    return np.empty((0, 0))


def _half(solution: Solution, quantity: _Quantity) -> Array:
    if quantity.std_of is not None:
        return 3 * quantity.std_of(solution)
    return 3 * claimed_std(solution)[:, quantity.states] * quantity.scale


def _estimates(one: ShownSolution, quantity: _Quantity) -> _Curve:
    return _Curve(one.solution.t, quantity.of(one.solution), _half(one.solution, quantity))


def _errors_or_estimates(
    shown: list[ShownSolution],
    quantity: _Quantity,
    reference: Reference,
    part: str,
    window: Window,
    beside: tuple[Array, Array] | None = None,
    fixes: Sequence[Marked] = (),
) -> go.Figure | None:
    """The `part` of the Errors of those whose the reference knows, else the estimates of all."""
    found = [(one, e, _part(e, part)) for one in shown if (e := _errors(one, reference))]
    known = [(one, e, errors) for one, e, errors in found if metrics.any_known(errors)]
    if not known:
        curves = [_estimates(one, quantity) for one in shown]
        return _draw_panels(shown, quantity, curves, window, beside, fixes)
    curves = [
        _Curve(e.t, errors, _half(one.solution, quantity)[e.rows]) for one, e, errors in known
    ]
    names = EULER if part == "rph" else NED_AXES
    quantity = quantity._replace(names=names, framed=_around_zero, label="error (true - estimate)")
    return _draw_panels([one for one, *_ in known], quantity, curves, window)


def _part(e: Errors, part: str) -> Array:
    errors: Array = getattr(e, part)
    return np.degrees(errors) if part == "rph" else errors


def _draw_panels(
    shown: Sequence[ShownSolution],
    quantity: _Quantity,
    curves: Sequence[_Curve],
    window: Window = None,
    beside: tuple[Array, Array] | None = None,
    fixes: Sequence[Marked] = (),
) -> go.Figure | None:
    """A panel per column that a solution has numbers of, with their bands: those of errors around
    zero, those of estimates around them. Angles that wrap are cut there.

    beside: (m,) s and (m, k) of a reference. The solution of the least frame sets the scale; others
    widen it up to FAR times, and leave it with a note beyond.
    """
    kept = [
        i
        for i in range(len(quantity.names))
        if any(np.isfinite(curve.values[:, i]).any() for curve in curves)
    ]
    if not kept:
        return None
    figure = panels([f"{quantity.names[i]} [{quantity.unit}]" for i in kept], quantity.height)
    zero, notes = origin(shown[0].solution.t), _Notes(shown)
    for row, i in enumerate(kept, start=1):
        for label, style, t, values in fixes:
            marks(figure, t - zero, values[:, i], label, style, row, quantity.unit)
        panel = _Panel.of(shown, quantity, i, curves, beside)
        frames = panel.frames(window, notes)
        if beside is not None:
            panel.draw_reference(figure, row, zero, beside[0])
        panel.draw(figure, row, zero)
        whose = {one.name: column for one, column in zip(shown, panel.columns)}
        low, high, away = _common(frames, whose)
        figure.update_yaxes(range=[low, high], row=row, col=1)
        for one, values in zip(shown, panel.columns):
            if one.name in away:
                notes.leaves(one, quantity, i, values)
    notes.tell(figure, "outside the scored window" if window else "while the filter converges")
    return time_axis(figure, shown, zero)


class _Panel(NamedTuple):
    """One panel of a figure, with all solutions."""

    shown: Sequence[ShownSolution]
    quantity: _Quantity
    i: int  # column of the quantity
    curves: Sequence[_Curve]
    columns: Sequence[Array]  # (n,) values of each solution
    seen: Array | None  # (m,) of a reference

    @classmethod
    def of(
        cls,
        shown: Sequence[ShownSolution],
        quantity: _Quantity,
        i: int,
        curves: Sequence[_Curve],
        beside: tuple[Array, Array] | None,
    ) -> _Panel:
        """The panel of column i; headings are side by side."""
        columns = [curve.values[:, i] for curve in curves]
        panel = cls(
            shown, quantity, i, curves, columns, None if beside is None else beside[1][:, i]
        )
        if not panel.is_heading:
            return panel
        columns, seen = _side_by_side(columns, panel.seen)
        return panel._replace(columns=columns, seen=seen)

    @property
    def turns(self) -> bool:
        """True where it shows an angle that wraps."""
        named = self.quantity.names[self.i] in ("roll", "heading")
        return self.quantity.framed is _around_all and named

    @property
    def is_heading(self) -> bool:
        """True where it shows headings, which wrap."""
        return self.turns and self.quantity.names[self.i] == "heading"

    @property
    def known(self) -> list[int]:
        """Ranks of the solutions that it shows, the first one last, so that it comes to lie on top."""
        return [
            rank
            for rank in reversed(range(len(self.shown)))
            if metrics.any_known(self.columns[rank])
        ]

    def frames(self, window: Window, notes: _Notes) -> dict[str, tuple[float, float]]:
        """{name: ends of the axis that a solution wants}; values beyond them are noted."""
        found = {}
        for rank in self.known:
            one, curve, values = self.shown[rank], self.curves[rank], self.columns[rank]
            low, high, beyond = self.quantity.framed(curve.t, values, curve.half[:, self.i], window)
            if self.is_heading and np.ptp(extent(values)) > 180:
                low, high = 0.0, 360.0
            found[one.name] = low, high
            notes.beyond(one, self.quantity, self.i, beyond)
        return found

    def band_values(self, rank: int) -> tuple[Array, Array]:
        """(values, half the height of their band) of a solution; where the angle wraps, they end."""
        values, half = self.columns[rank], self.curves[rank].half[:, self.i]
        return (
            (cut_wraps(values), np.where(half < 180, half, np.nan))
            if self.turns
            else (values, half)
        )

    def draw(self, figure: go.Figure, row: int, zero: float) -> None:
        """Draw the bands of all solutions, and their values above them."""
        is_estimate = self.quantity.label == "estimate"
        for rank in self.known:
            values, half = self.band_values(rank)
            since = self.curves[rank].t - zero
            centre = values if is_estimate else np.zeros(len(since))
            _band(figure, self.shown[rank], since, centre, half, row, len(self.shown))
        for rank in self.known:
            values, half = self.band_values(rank)
            since = self.curves[rank].t - zero
            series = _Series(since, values, self.quantity.unit, half / 3)
            _curve(figure, self.shown[rank], rank, series, row, self.quantity.label)

    def draw_reference(self, figure: go.Figure, row: int, zero: float, t: Array) -> None:
        """Draw the reference at times t (m,) s, as far as the first solution goes."""
        if self.seen is not None and metrics.any_known(self.seen):
            inside = (t >= self.curves[0].t[0]) & (t <= self.curves[0].t[-1])
            true = cut_wraps(self.seen[inside]) if self.turns else self.seen[inside]
            _reference(figure, t[inside] - zero, true, self.quantity.unit, row)


def _side_by_side(columns: list[Array], beside: Array | None) -> tuple[list[Array], Array | None]:
    """Headings of several, and of a reference, less whole turns, as `together` with the first."""
    others = [*columns[1:], *([] if beside is None else [beside])]
    ends = np.cumsum([len(other) for other in others])[:-1]
    first, moved = together(columns[0], np.concatenate(others) if others else None)
    parts = [] if moved is None else np.split(moved, ends)
    return [first, *parts[: len(columns) - 1]], None if beside is None else parts[-1]


def _common(
    frames: Mapping[str, tuple[float, float]], values: Mapping[str, Array]
) -> tuple[float, float, list[str]]:
    """Ends of an axis for {name: its own ends}, and the names of those that leave it.

    The least sets the scale. Others widen it, unless they want more than FAR times as much and are
    beyond that for more than a quarter of their `values`: an outage is shown, what diverged is not.
    """
    ordered = sorted(frames, key=lambda name: frames[name][1] - frames[name][0])
    low, high = frames[ordered[0]]
    room, away = (FAR - 1) / 2 * (high - low), []
    least, most = low - room, high + room
    for name in ordered[1:]:
        wide = min(low, frames[name][0]), max(high, frames[name][1])
        known = values[name][np.isfinite(values[name])]
        beyond = (known < least) | (known > most)
        if wide[1] - wide[0] > FAR * (frames[ordered[0]][1] - frames[ordered[0]][0]) and (
            beyond.mean() > AWAY
        ):
            away.append(name)
        else:
            low, high = wide
    return low, high, away


class _Notes:
    """Notes on values outside the frame, by solution."""

    def __init__(self, shown: Sequence[ShownSolution]) -> None:
        self.shown = shown
        self.early: dict[str, list[str]] = {one.name: [] for one in shown}
        self.far: dict[str, list[str]] = {one.name: [] for one in shown}

    def beyond(self, one: ShownSolution, quantity: _Quantity, i: int, largest: float) -> None:
        """Values of a panel go up to `largest` beyond its own frame, where that is not 0."""
        if largest and quantity.framed is _around_settled:
            self.early[one.name].append(quantity.names[i])
        elif largest:
            self.early[one.name].append(f"{quantity.names[i]} up to {largest:.3g} {quantity.unit}")

    def leaves(self, one: ShownSolution, quantity: _Quantity, i: int, values: Array) -> None:
        """A solution leaves the frame that others set."""
        low, high = extent(values)
        span = (
            f"{low:.3g} to {high:.3g}"
            if quantity.label == "estimate"
            else f"up to {peak(values):.3g}"
        )
        self.far[one.name].append(f"{quantity.names[i]} {span} {quantity.unit}")

    def tell(self, figure: go.Figure, when: str) -> None:
        """Write them below the figure."""
        for one in self.shown:
            if far := self.far[one.name]:
                note(figure, f"{one.name} leaves the frame: {', '.join(far)}. {TO_SEE_ALL}")
        early: dict[str, list[str]] = {}
        for one in self.shown:
            if parts := self.early[one.name]:
                early.setdefault(", ".join(parts), []).append(one.name)
        said = [
            parts if len(names) == len(self.shown) else f"{', '.join(names)}: {parts}"
            for parts, names in early.items()
        ]
        if said:
            note(figure, f"Beyond the frame {when}: {'; '.join(said)}. {TO_SEE_ALL}")


def sigma(solutions: Solutions) -> go.Figure | None:
    """3-sigma over time on logarithmic axes, a panel each of the horizontal position, the height,
    the horizontal and the vertical velocity, the inclination and the heading, a line for each
    solution; None where none claims any."""
    shown = each(solutions)
    figures = [
        (
            f"{name} [{unit}]",
            unit,
            [3 * scale * _length(claimed_std(one.solution), states) for one in shown],
        )
        for name, unit, states, scale in SIGMAS
    ]
    known = [(label, unit, of) for label, unit, of in figures if any(map(metrics.any_known, of))]
    if not known:
        return None
    figure, zero = (
        panels([label for label, *_ in known], 125, log=True),
        origin(shown[0].solution.t),
    )
    for row, (_, unit, values) in enumerate(known, start=1):
        for rank in reversed(range(len(shown))):
            one, claimed = shown[rank], np.where(values[rank] > 0, values[rank], np.nan)
            if metrics.any_known(claimed):
                series = _Series(one.solution.t - zero, claimed, unit)
                _curve(figure, one, rank, series, row, "3σ")
        log_frame(figure, np.concatenate(values), row)
    return time_axis(figure, shown, zero)


def _length(std: Array, states: slice) -> Array:
    """(n,) root of the sum of squares of the standard deviations of these states."""
    return np.sqrt(np.square(std[:, states]).sum(axis=1))


SIGMAS = (
    ("horizontal", "m", slice(0, 2), 1.0),
    ("height", "m", slice(2, 3), 1.0),
    ("horizontal<br>velocity", "m/s", slice(3, 5), 1.0),
    ("vertical<br>velocity", "m/s", slice(5, 6), 1.0),
    ("inclination", "deg", slice(6, 8), np.degrees(1)),
    ("heading", "deg", slice(8, 9), np.degrees(1)),
)
"""Panels of the claimed uncertainty: name, unit, states, and the size of the unit."""


def accel_bias(solutions: Solutions) -> go.Figure | None:
    """Accelerometer bias per body axis with its 3-sigma band, in mg or, where it is small, ug."""
    largest = max((peak(one.solution.b_a) for one in each(solutions)), default=0.0)
    scale, unit = (1e6, "ug") if largest < 1e-3 else (1e3, "mg")
    return _bias(solutions, lambda s: s.b_a, BA, scale / STANDARD_GRAVITY, unit)


def gyro_bias(solutions: Solutions) -> go.Figure | None:
    """Gyro bias per body axis with its 3-sigma band, in deg/h or, where it is large, deg/s."""
    largest = max((peak(one.solution.b_g) for one in each(solutions)), default=0.0)
    large = largest > np.radians(0.5)
    scale, unit = (np.degrees(1), "deg/s") if large else (np.degrees(3600), "deg/h")
    return _bias(solutions, lambda s: s.b_g, BG, scale, unit)


def _bias(
    solutions: Solutions, of: Callable[[Solution], Array], states: slice, scale: float, unit: str
) -> go.Figure | None:
    quantity = _Quantity(
        "xyz", unit, states, lambda s: of(s) * scale, framed=_around_settled, scale=scale
    )
    shown, curves = [], []
    for one in each(solutions):
        curve = _estimates(one, quantity)
        if np.isfinite(curve.half).any() or peak(curve.values):
            shown.append(one)
            curves.append(curve)
    return _draw_panels(shown, quantity, curves)


def extra(solution: Solution, colour: str = COLOURS[0]) -> go.Figure | None:
    """The filter's own output columns, but those of the installation, a panel each; None where it
    has none."""
    of_installation = {
        name
        for each in estimated_installation(solution).parameters
        for name in (each.column, each.std_column)
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
