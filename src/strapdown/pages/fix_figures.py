"""Figures of what became of the fixes: innovations per source, and their normalised squares
(NIS) against the gate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ..aiding import find
from ..data.solution import Solution
from ..evaluation import consistency
from ..evaluation.metrics import EULER, NED_AXES
from ..typing import Array, Mask
from ..units.quantities import shown_unit
from ..units.wording import count_text
from .drawing import (
    COLOURS,
    FAR,
    GREY,
    RED,
    BandStyle,
    ShownSolution,
    band,
    each,
    even_indices,
    kind,
    level,
    line,
    log_range,
    log_ticks,
    marks,
    note,
    origin,
    panels,
    peak,
    time_axis,
)

ALIKE = 0.05
"""Expected standard deviations of components that differ by less than this part are one line."""
MAX_NIS = 1e3
"""Over the peak of the best solution: upper end of an axis of NIS at most."""
FEWEST, LAGS, QUANTILES = 30, 20, 200
"""Fixes that are needed for autocorrelations and quantiles, lags shown, and quantiles drawn."""
CAUSES = {
    "": (RED, "x-thin"),
    "jump": ("#ae3ec9", "cross-thin"),
    "drift": ("#e67700", "asterisk"),
    "clock": ("#1098ad", "y-up"),
    "noise too small": ("#5c940d", "y-down"),
    "other sources disagree": ("#364fc7", "hash"),
    "single outliers": ("#8d5524", "y-left"),
    "not known": ("#868e96", "y-right"),
}
"""Colours and symbols of rejected fixes by their probable cause; none: chance."""


def unit(solution: Solution, name: str) -> tuple[str, float, tuple[str, ...]]:
    """(unit, factor from SI, names of the rows) of a source's innovations.

    Filters that take of a magnetic field its direction alone publish the angle by which it is off,
    in the first row.
    """
    try:
        sensor = find(kind(solution, name))
    except ValueError:  # a source of the user's own naming
        return "m, m/s or rad", 1.0, NED_AXES
    if (
        set(sensor.quantities) == {"magnetic field"}
        and not np.isfinite(_innovations(solution, name)[:, 1:]).any()
    ):
        return *shown_unit("angle"), NED_AXES
    units = {shown_unit(quantity) for quantity in sensor.quantities}
    named, factor = units.pop() if len(units) == 1 else ("m, m/s or rad", 1.0)
    rows = (
        EULER if sensor.name == "attitude" else tuple("xyz") if sensor.vector == "b" else NED_AXES
    )
    return named, factor, rows


def _innovations(solution: Solution, name: str) -> Array:
    fixes = solution.innovations
    return fixes.innovation[fixes.source == fixes.names.index(name)]


def innovations(
    solution: Solution, solutions: Mapping[str, Solution] | None = None
) -> go.Figure | None:
    """Innovation (fix - estimate) of every source over time with the ±2 standard deviations that
    the filter expected, rejected fixes crossed in the colour of their probable cause; None without
    fixes. solutions: those that it stands beside, in axes of one height."""
    fixes, used = solution.innovations, _measured_sources(solution)
    if not used:
        return None
    units = {source: unit(solution, fixes.names[source]) for source in used}
    figure = panels([f"{escape(fixes.names[source])} [{units[source][0]}]" for source in used], 210)
    zero = origin(solution.t)
    for row, source in enumerate(used, start=1):
        named, factor, rows = units[source]
        own = fixes.source == source
        t, values, good = fixes.t[own] - zero, fixes.innovation[own] * factor, fixes.accepted[own]
        names = rows if np.isfinite(values[:, 1:]).any() else ("single component",)
        if fixes.root is not None:
            expected = factor * _expected_std(fixes.root[own])
            _bounds(figure, row, t, np.where(np.isfinite(values), expected, np.nan))
        for i, name in enumerate(names):
            mark = {"color": COLOURS[i], "size": 4}
            marks(figure, t, np.where(good, values[:, i], np.nan), name, mark, row, named)
        for cause, why in _causes(solution, fixes.names[source], fixes.t[own], good).items():
            for i in range(len(names)):
                marks(
                    figure,
                    t,
                    np.where(why, values[:, i], np.nan),
                    *_rejected_style(cause),
                    row,
                    named,
                )
        limits = [
            factor * _limit(other, fixes.names[source])
            for other in [solution, *(solutions or {}).values()]
        ]
        _range(figure, values, good, row, fixes.names[source], named, limits)
    return time_axis(figure, solution, zero)


def _expected_std(root: Array) -> Array:
    """(m, 3) standard deviations of innovations from the rows (m, 6) of the root of their
    covariance."""
    a, b, c, d, e, f = np.square(root).T
    return np.sqrt(np.column_stack([a, b + c, d + e + f]))


def _bounds(figure: go.Figure, row: int, t: Array, std: Array) -> None:
    """±2 standard deviations (m, 3), dotted, of those components that differ, in their colours."""
    drawn: list[tuple[float, int]] = []
    for i, column in enumerate(std.T):
        size = float(np.nanmedian(column)) if np.isfinite(column).any() else 0.0
        if size and all(abs(size / other - 1) > ALIKE for other, _ in drawn):
            drawn.append((size, i))
    for _, i in drawn:
        colour, group = COLOURS[i] if len(drawn) > 1 else GREY, None if i == drawn[0][1] else "±2σ"
        known = np.isfinite(std[:, i])
        centre, half = np.zeros(known.sum()), 2 * std[known, i]
        band(figure, t[known], centre, half, row, "±2σ", BandStyle(colour, group, False))


def _limit(solution: Solution, name: str) -> float:
    """The largest accepted innovation of a source, SI; of all where none was accepted, 0 without
    the source."""
    fixes = solution.innovations
    if name not in fixes.names:
        return 0.0
    own = fixes.source == fixes.names.index(name)
    values, good = fixes.innovation[own], fixes.accepted[own]
    inner, largest = peak(values[good]), peak(values)
    return largest if largest <= 3 * inner or not inner else inner


def nis(solution: Solution, solutions: Mapping[str, Solution] | None = None) -> go.Figure | None:
    """Normalised innovation squared of every source over time with its gate, on logarithmic
    axes; None where no filter gave any. solutions: those that it stands beside, in axes of one
    height."""
    fixes, zero = solution.innovations, origin(solution.t)
    used = [
        source
        for source in _measured_sources(solution)
        if np.isfinite(fixes.nis[fixes.source == source]).any()
    ]
    if not used:
        return None
    figure = panels([escape(fixes.names[source]) for source in used], 190, log=True)
    for row, source in enumerate(used, start=1):
        name = fixes.names[source]
        own = (fixes.source == source) & (fixes.nis > 0)
        t, values, good = fixes.t[own] - zero, fixes.nis[own], fixes.accepted[own]
        accepted = {"color": COLOURS[0], "size": 4}
        marks(figure, t, np.where(good, values, np.nan), "accepted", accepted, row)
        for cause, why in _causes(solution, name, fixes.t[own], good).items():
            marks(figure, t, np.where(why, values, np.nan), *_rejected_style(cause), row)
        gate = _gate(solution, source)
        if gate:
            level(figure, solution.t - zero, gate, "gate", row)
        ends_of = [_nis_ends(other, name) for other in [solution, *(solutions or {}).values()]]
        low, top = min(low for low, _ in ends_of), max(top for _, top in ends_of)
        # what diverged does not hide the others
        top = min(top, MAX_NIS * min(top for _, top in ends_of if top))
        log_range(figure, max(low, top * 1e-7), top, row)
        if peak(values) > 1.5 * top:
            note(figure, f"{name}: up to {peak(values):.3g}, beyond the frame.")
    return time_axis(figure, solution, zero)


def _gate(solution: Solution, source: int) -> float:
    """The bound on the NIS of a source, 0 without one."""
    gates = solution.innovations.gates
    gate = gates[source] if source < len(gates) else None
    return gate if gate is not None and np.isfinite(gate) else 0.0


def _nis_ends(solution: Solution, name: str) -> tuple[float, float]:
    """Lower and upper end of the NIS of a source, its gate included."""
    fixes = solution.innovations
    if name not in fixes.names:
        return np.inf, 0.0
    source = fixes.names.index(name)
    values = fixes.nis[(fixes.source == source) & (fixes.nis > 0)]
    low = float(np.quantile(values, 0.02)) if len(values) else 0.01
    return low, max(peak(values), _gate(solution, source)) or 1.0


def whiteness(solutions: Solution | Mapping[str, Solution]) -> go.Figure | None:
    """Autocorrelation of the normalised innovations of every source, mean over the components, of
    a Solution or {name: Solution}, with the bounds that 95 % of the lags of a white sequence keep;
    None where there are too few."""
    found = _by_source(solutions, _correlation)
    if not found:
        return None
    figure = panels([escape(name) for name in found], 170)
    for row, parts in enumerate(found.values(), start=1):
        for one, lags, mean, _ in reversed(parts):
            _line_of(figure, row, one, lags, mean, "innovations", parts[0][0] is not one)
            marker = {"color": one.colour, "size": 5}
            figure.data[-1].update(mode="lines+markers", marker=marker)
        bound = max(bound for *_, bound in parts)
        longest = max((lags for _, lags, *_ in parts), key=len)
        for side in (bound, -bound):
            level(figure, longest, side, "95 % of a white sequence", row)
        limit = 1.15 * max(bound, *(peak(mean) for _, _, mean, _ in parts))
        figure.update_yaxes(range=[-limit, limit], row=row, col=1)
    figure.update_xaxes(range=[0.5, LAGS + 0.5], unifiedhovertitle={"text": "lag of %{x} fixes"})
    return figure.update_xaxes(title_text="lag [fixes]", row=len(found), col=1)


def _correlation(solution: Solution, source: int) -> tuple[Array, Array, float] | None:
    """(lags, autocorrelation, its bound) of a source, mean over the components."""
    rows = _normalised_innovations(solution, source)
    if len(rows) < FEWEST:
        return None
    correlation, bound = consistency.autocorrelation(rows, min(LAGS, len(rows) // 2))
    mean = correlation[:, np.isfinite(correlation).all(axis=0)]
    if not mean.shape[1]:
        return None
    lags = np.arange(1.0, len(mean) + 1)
    return lags, mean.mean(axis=1), float(bound / np.sqrt(mean.shape[1]))


def _by_source(
    solutions: Solution | Mapping[str, Solution],
    curve: Callable[[Solution, int], tuple[Any, ...] | None],
) -> dict[str, list[tuple[Any, ...]]]:
    """{source: [(solution, *its curve)]}, of those that have a curve of that source."""
    found: dict[str, list[tuple[Any, ...]]] = {}
    for one in each(solutions):
        for source in _measured_sources(one.solution):
            if (made := curve(one.solution, source)) is not None:
                name = one.solution.innovations.names[source]
                found.setdefault(name, []).append((one, *made))
    return found


def _line_of(
    figure: go.Figure, row: int, one: ShownSolution, x: Array, y: Array, label: str, rank: int
) -> None:
    """The line of a solution, in the legend once."""
    new, name = row == 1, one.label(label)
    line(figure, x, y, name, one.colour, row, new, rank, dash=one.dash)


def _normalised_innovations(solution: Solution, source: int) -> Array:
    """(m, k) whitened innovations of the accepted fixes of a source; of a solution from a file,
    which has none, each over its rms."""
    fixes = solution.innovations
    if fixes.whitened is None:
        return consistency.normalised_innovations(solution, source)
    rows = fixes.whitened[(fixes.source == source) & fixes.accepted]
    rows = rows[:, np.isfinite(rows).any(axis=0)]
    return rows[np.isfinite(rows).all(axis=1)] if rows.shape[1] else rows[:0]


def nis_quantiles(solutions: Solution | Mapping[str, Solution]) -> go.Figure | None:
    """Quantiles of the NIS of every source, rejected fixes too, over those of chi-square, of a
    Solution or {name: Solution}; None where there are too few."""
    found = _by_source(solutions, _quantiles)
    if not found:
        return None
    figure = panels([escape(name) for name in found], 210, log=True)
    for row, parts in enumerate(found.values(), start=1):
        for one, expected, seen in reversed(parts):
            _line_of(figure, row, one, expected, seen, "NIS", parts[0][0] is not one)
        ends = np.array([min(x[0] for _, x, _ in parts), max(x[-1] for _, x, _ in parts)])
        line(figure, ends, ends, "as claimed", GREY, row, row == 1, dash="dash")
        log_range(
            figure,
            min(ends[0], *(y[0] for *_, y in parts)),
            max(ends[1], *(y[-1] for *_, y in parts)),
            row,
        )
    lowest = min(x[0] for parts in found.values() for _, x, _ in parts)
    highest = max(x[-1] for parts in found.values() for _, x, _ in parts)
    ends = np.log10([lowest, highest])
    figure.update_xaxes(type="log", range=list(ends), **log_ticks(*ends))
    figure.update_xaxes(unifiedhovertitle={"text": "expected %{x:.3g}"})
    return figure.update_xaxes(title_text="NIS by chi-square", row=len(found), col=1)


def _quantiles(solution: Solution, source: int) -> tuple[Array, Array] | None:
    """Quantiles of the NIS of a source: those expected, and those that it has."""
    fixes = solution.innovations
    own = (fixes.source == source) & (fixes.nis > 0)
    rows = np.isfinite(fixes.innovation[own]).sum(axis=1)
    freedom = int(np.bincount(rows).argmax()) if len(rows) else 0
    seen = np.sort(fixes.nis[own][rows == freedom])
    if not freedom or len(seen) < FEWEST:
        return None
    kept = even_indices(len(seen), QUANTILES)
    return _chi_square(freedom, (kept + 0.5) / len(seen)), seen[kept]


def _chi_square(freedom: int, chance: Array) -> Array:
    """Quantiles of chi-square, to 1e-5 of themselves between 0.1 % and 99.99 %: by the distribution
    of its root, which is smooth. That of scipy takes longer to load than the page to draw."""
    root = np.linspace(0.0, np.sqrt(freedom) + 8.0, 20001)
    density = root ** (freedom - 1) * np.exp(-np.square(root) / 2)
    share = np.r_[0.0, np.cumsum(density[1:] + density[:-1])]
    return np.square(np.interp(chance, share / share[-1], root))


def _causes(solution: Solution, name: str, t: Array, good: Mask) -> dict[str, Mask]:
    """The rejected fixes (m,) of a source at these times by their probable cause; of "" without."""
    cause = np.full(len(t), "", dtype=object)
    for run in sorted(solution.rejected, key=lambda run: -run.of):  # the shortest over all
        if run.source == name:
            cause[(t >= run.start) & (t <= run.stop)] = run.cause
    return {each: ~good & (cause == each) for each in CAUSES}


def _rejected_style(cause: str) -> tuple[str, dict[str, Any]]:
    """(name, style) of fixes that were rejected for a cause."""
    colour, symbol = CAUSES[cause]
    line = {"width": 1.5, "color": colour}
    style = {"color": colour, "size": 7, "symbol": symbol, "line": line}
    return f"rejected: {cause}" if cause else "rejected", style


def weights(solution: Solution) -> go.Figure | None:
    """Weights of the fixes of robust sources, and standard deviations of adaptive ones over those
    stated, over time; None without such a source, and of a file."""
    fixes, zero = solution.innovations, origin(solution.t)
    shown: list[tuple[int, str, Array, tuple[str, ...]]] = []
    if fixes.weight is None or fixes.followed is None:
        return None
    for source in _measured_sources(solution):
        own = fixes.source == source
        weight, ratio = fixes.weight[own], fixes.followed[own]
        if ((weight > 0) & (weight < 1)).any():
            shown.append((source, "weight [1]", weight[:, None], ("weight",)))
        if (ratio != 1).any():
            rows = unit(solution, fixes.names[source])[2]
            seen = np.flatnonzero(np.isfinite(fixes.innovation[own]).any(axis=0))
            names = tuple(rows[i] for i in seen) if len(seen) > 1 else ("single component",)
            shown.append((source, "noise over stated [1]", ratio[:, seen], names))
    if not shown:
        return None
    figure = panels([f"{escape(fixes.names[source])}: {what}" for source, what, *_ in shown], 190)
    for row, (source, _, values, names) in enumerate(shown, start=1):
        t = fixes.t[fixes.source == source] - zero
        for i, name in enumerate(names):
            marks(figure, t, values[:, i], name, {"color": COLOURS[i], "size": 4}, row)
        figure.update_yaxes(rangemode="tozero", row=row, col=1)
    return time_axis(figure, solution, zero)


def _measured_sources(solution: Solution) -> list[int]:
    """Indices of the sources that had fixes to measure."""
    fixes = solution.innovations
    measured = np.isfinite(fixes.innovation).any(axis=1)
    return [
        source for source in range(len(fixes.names)) if (measured & (fixes.source == source)).any()
    ]


def _range(
    figure: go.Figure,
    values: Array,
    good: Mask,
    row: int,
    name: str,
    named: str,
    limits: Sequence[float],
) -> None:
    """Frame the accepted fixes; rejected ones beyond three times that leave the frame, and the
    note says how far. limits: of all figures that stand beside one another, this one's included:
    the least sets the scale, others widen it up to FAR times."""
    known = [limit for limit in limits if limit]
    limit = max((one for one in known if one <= FAR * min(known)), default=0.0)
    figure.update_yaxes(range=[-1.12 * (limit or 1.0), 1.12 * (limit or 1.0)], row=row, col=1)
    sizes = np.nanmax(np.abs(values), axis=1, initial=0.0, where=np.isfinite(values))
    beyond = sizes > 1.12 * limit
    if beyond.any():
        which = "fix" if (beyond & good).any() else "rejected fix"
        note(
            figure,
            f"{name}: {count_text(int(beyond.sum()), which, 'es')} beyond the frame, up to {peak(values):.3g} {named}. "
            f"Double-click the panel to see all.",
        )
