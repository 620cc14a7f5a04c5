"""Figures of a Tuning: the likelihood over each parameter, and what the innovations are like before
and after."""

from collections.abc import Sequence
from html import escape
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ..data.solution import Solution
from ..evaluation.consistency import band, whiteness
from ..pages.drawing import (
    COLOURS,
    GREY,
    finish,
    log_ticks,
    note,
    origin,
    positive,
    ribbon,
    time_label,
)
from ..pages.spectra import power_spectrum, segments
from ..typing import Array
from ..units.constants import CHI_SQUARE_95

if TYPE_CHECKING:
    from .findings import NoiseParameter, Tuning

BEFORE, AFTER = "before", "after"
DRAWN = {BEFORE: GREY, AFTER: COLOURS[0]}
MEANT = COLOURS[1]
"""Colour of what a right filter shows."""
"""Twice the loss of log-likelihood at the ends of a 95 % interval (Wilks 1938)."""
MAX_LOSS = 16.0
"""Its value at the top of a panel."""
ACROSS = 3
"""Panels beside each other."""
FEWEST = 32
"""Innovations of a source of which a spectrum can be drawn."""
LAGS = 30
STRETCHES = 60
"""Over which the NIS is averaged, at most."""


def profiles_figure(parameters: "Sequence[NoiseParameter]") -> go.Figure:
    """Twice the loss of log-likelihood over each parameter, all others at their best, with the
    interval, what was given and what is used."""
    scanned = [each for each in parameters if len(each.scan[0]) > 1]
    rows = -(-len(scanned) // ACROSS) or 1
    drawn = make_subplots(rows, ACROSS, vertical_spacing=0.32 / rows, horizontal_spacing=0.07)
    finish(drawn, 235 * rows + 60)
    for number, each in enumerate(scanned):
        _profile(drawn, each, number // ACROSS + 1, number % ACROSS + 1)
    note(
        drawn,
        f"Solid: used. Dashed: given. Shaded: the 95 % interval, where the curve is below {CHI_SQUARE_95:.2f} "
        "(dotted). A curve that stays below it to one side leaves that side open.",
    )
    return drawn


def _profile(drawn: go.Figure, each: "NoiseParameter", row: int, column: int) -> None:
    where = {"row": row, "col": column}
    values, loss = (np.asarray(part, float) for part in each.scan)
    values = values * each.factor
    drawn.add_trace(
        go.Scatter(
            x=values,
            y=np.minimum(loss, 4 * MAX_LOSS),
            mode="lines+markers",
            line={"color": COLOURS[0], "shape": "spline", "smoothing": 0.8},
            marker={"size": 5},
            hovertemplate="%{x:.3g}: %{y:.3g}<extra></extra>",
            showlegend=False,
        ),
        **where,
    )
    low = each.low * each.factor if each.low > 0 else values.min()
    high = each.high * each.factor if each.high < inf else values.max()
    drawn.add_vrect(low, high, fillcolor=MEANT, opacity=0.14, line_width=0, **where)
    drawn.add_hline(CHI_SQUARE_95, line={"color": MEANT, "width": 1, "dash": "dot"}, **where)
    drawn.add_vline(each.value * each.factor, line={"color": MEANT, "width": 1.5}, **where)
    if each.given > 0:
        given = {"color": GREY, "width": 1.5, "dash": "dash"}
        drawn.add_vline(each.given * each.factor, line=given, **where)
    shown = np.r_[values, each.value * each.factor, each.given * each.factor]
    drawn.update_xaxes(
        title_text=f"{escape(each.label)} [{each.unit}]", title_font_size=12, **where
    )
    if (values > 0).all() and shown.max() > 3 * shown[shown > 0].min():
        drawn.update_xaxes(**_log_axis(shown), **where)
    else:
        drawn.update_xaxes(nticks=5, tickformat=".3~g", **where)
    title = "2 x loss of log-likelihood [-]" if column == 1 else ""
    drawn.update_yaxes(title_text=title, range=[-0.5, MAX_LOSS], **where)


def _log_axis(*values: Array) -> dict[str, Any]:
    """Settings of a logarithmic axis that holds these values."""
    known = np.log10(positive(*values))
    low, high = (known.min() - 0.05, known.max() + 0.05) if len(known) else (-1.0, 1.0)
    return {"type": "log", "range": [low, high], **log_ticks(low, high)}


def drawn_sources(*solutions: Solution) -> list[int]:
    """Those of which enough was whitened in each."""
    found = [set(range(len(each.innovations.names))) for each in solutions]
    return [
        s
        for s in sorted(set.intersection(*found))
        if all(len(_whitened_innovations(each, s)[0]) >= FEWEST for each in solutions)
    ]


def _whitened_innovations(solution: Solution, source: int) -> tuple[Array, Array]:
    """(times (m,), whitened innovations (m, k)) of the fixes of a source that were used."""
    made = solution.innovations
    assert made.whitened is not None  # as of all that was not read from a file
    rows = made.whitened[(made.source == source) & made.accepted]
    t = made.t[(made.source == source) & made.accepted]
    measured = np.isfinite(rows).any(axis=0)
    whole = np.isfinite(rows[:, measured]).all(axis=1) & measured.any()
    return t[whole], rows[whole][:, measured]


def _runs(found: "Tuning") -> list[tuple[str, Solution]]:
    """(label, solution) before and after."""
    return [(BEFORE, found.before), (AFTER, found.after)]


def _interval(t: Array) -> float:
    """s between neighbouring fixes."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def _panels(found: "Tuning", sources: Sequence[int], x: str, y: str) -> go.Figure:
    """A figure with a panel for each source beside the others."""
    across = min(2, max(len(sources), 1))
    rows = -(-len(sources) // across) or 1
    names = [escape(found.after.innovations.names[s]) for s in sources]
    drawn = make_subplots(
        rows,
        across,
        subplot_titles=names,
        vertical_spacing=0.36 / rows,
        horizontal_spacing=0.09,
    )
    finish(drawn, 250 * rows + 70)
    drawn.update_annotations(font_size=13)
    drawn.update_layout(legend_y=1.0 + 24 / (250 * rows), margin_t=72)
    drawn.update_xaxes(title_text=x)
    drawn.update_yaxes(title_text=y)
    return drawn


def _places(sources: Sequence[int]) -> list[tuple[int, dict[str, int]]]:
    """[(source, row and column of its panel)]."""
    across = min(2, max(len(sources), 1))
    return [
        (s, {"row": number // across + 1, "col": number % across + 1})
        for number, s in enumerate(sources)
    ]


def _curve(drawn: go.Figure, place: dict[str, int], x: Array, y: Array, label: str) -> None:
    drawn.add_trace(
        go.Scatter(
            x=x,
            y=y,
            name=label,
            legendgroup=label,
            showlegend=place == {"row": 1, "col": 1},
            mode="lines",
            line={"color": DRAWN[label], "width": 1.6},
            hovertemplate="%{y:.3g}",
        ),
        **place,
    )


def _add_expected_lines(drawn: go.Figure, place: dict[str, int], *levels: float) -> None:
    """Dashed lines at what is expected of a right filter."""
    for level in levels:
        drawn.add_hline(level, line={"color": MEANT, "width": 1.2, "dash": "dash"}, **place)


def spectrum(t: Array, rows: Array) -> tuple[Array, Array]:
    """(frequencies, Hz; power spectral density over that of white noise of variance 1) of rows
    (m, k), the mean over k, by Welch's method; fixes count as evenly spaced."""
    rate = 1 / _interval(t)
    length = max(FEWEST // 2, min(256, len(rows) // 8))
    length = min(length, len(rows))
    f, density = power_spectrum(segments(rows, length), rate)
    below = slice(1, (length + 1) // 2)  # half the rate, at which a density is not one-sided
    return f[below], density[below].mean(axis=1) * rate / 2


def spectra_figure(found: "Tuning", sources: Sequence[int]) -> go.Figure:
    """Power spectral densities of the whitened innovations of each source, before and after."""
    drawn = _panels(found, sources, "frequency [Hz]", "PSD / white [-]")
    for s, place in _places(sources):
        curves = {label: spectrum(*_whitened_innovations(run, s)) for label, run in _runs(found)}
        for label, curve in curves.items():
            _curve(drawn, place, *curve, label)
        _add_expected_lines(drawn, place, 1.0)
        frequencies, densities = zip(*curves.values())
        drawn.update_xaxes(**_log_axis(*frequencies), **place)
        drawn.update_yaxes(**_log_axis(np.ones(1), *densities), **place)
    note(
        drawn,
        "Dashed: what a right filter has, 1 at every frequency. Above it on the left: errors that "
        "last. Above or below it everywhere: standard deviations too small or too large.",
    )
    return drawn


def autocorrelation_figure(found: "Tuning", sources: Sequence[int]) -> go.Figure:
    """Autocorrelation of the whitened innovations of each source, before and after."""
    drawn = _panels(found, sources, "lag [s]", "autocorrelation [-]")
    for s, place in _places(sources):
        bound = 0.0
        for label, run in _runs(found):
            t, rows = _whitened_innovations(run, s)
            white = whiteness(rows, min(LAGS, len(rows) // 2))
            mean = np.r_[1.0, white.autocorrelation.mean(axis=1)]
            _curve(drawn, place, _interval(t) * np.arange(len(mean), dtype=float), mean, label)
            bound = white.bound / np.sqrt(rows.shape[1])
        _add_expected_lines(drawn, place, -bound, bound)
    note(
        drawn,
        "Of the fixes that were used, mean over the components. Dashed: 95 % of a white sequence lies "
        "between.",
    )
    return drawn


def nis_figure(found: "Tuning", sources: Sequence[int]) -> go.Figure:
    """NIS of each source over time, averaged, over its expectation, before and after, with the
    band of a chi-square mean."""
    start, stop = found.seconds
    zero = origin(np.array([start]))
    drawn = _panels(found, sources, time_label(zero), "NIS / expected [-]")
    for s, place in _places(sources):
        means = [np.ones(1)]
        for label, run in _runs(found):
            t, mean, low, high = _average_nis(run, s, start, stop)
            if label == AFTER:
                shown = np.isfinite(low)
                ribbon(
                    drawn, (t - zero)[shown], low[shown], high[shown], MEANT, 0.16, None, **place
                )
            _curve(drawn, place, t - zero, mean, label)
            means.append(mean)
        _add_expected_lines(drawn, place, 1.0)
        drawn.update_yaxes(**_log_axis(*means), **place)
    note(
        drawn,
        f"Mean over {(stop - start) / STRETCHES:.3g} s or more of all fixes, rejected ones too. "
        "Shaded: 95 % of a right filter's, by chi-square.",
    )
    return drawn


def _average_nis(solution: Solution, source: int, start: float, stop: float) -> tuple[Any, ...]:
    """(times, mean NIS, low and high end of its band), each over its expectation, by stretches."""
    made = solution.innovations
    of = (made.source == source) & np.isfinite(made.nis)
    t, nis = made.t[of], made.nis[of]
    dof = np.isfinite(made.innovation[of]).sum(axis=1)
    stretches = int(np.clip(len(t) // 5, 1, STRETCHES))
    width = (stop - start) / stretches
    block = np.clip(((t - start) / width).astype(int), 0, stretches - 1)
    count, freedom = np.bincount(block, minlength=stretches), np.bincount(block, dof, stretches)
    with np.errstate(all="ignore"):
        mean = np.where(count > 0, np.bincount(block, nis, stretches) / freedom, np.nan)
    ends = [band(int(n)) if n else (np.nan, np.nan) for n in freedom]
    low, high = np.array(ends).T / np.maximum(freedom, 1)
    centres = start + (np.arange(stretches) + 0.5) * width
    return centres, mean, low, high


def rejected_figure(found: "Tuning", sources: Sequence[int]) -> go.Figure:
    """When fixes were rejected, a row of marks per source, before and after."""
    drawn = finish(go.Figure(), 90 + 56 * len(sources))
    zero = origin(np.array([found.seconds[0]]))
    for label, solution in _runs(found):
        made = solution.innovations
        measured = np.isfinite(made.innovation).any(axis=1)
        for s in sources:
            t = made.t[(made.source == s) & measured & ~made.accepted]
            if len(t):
                drawn.add_trace(
                    go.Scatter(
                        x=t - zero,
                        y=[f"{escape(made.names[s])}, {label}"] * len(t),
                        name=label,
                        mode="markers",
                        marker={"symbol": "line-ns-open", "size": 12, "color": DRAWN[label]},
                        hovertemplate="%{x:.1f} s",
                        showlegend=False,
                    )
                )
    ends = [found.seconds[0] - zero, found.seconds[1] - zero]
    drawn.update_xaxes(title_text=time_label(zero), range=ends)
    drawn.update_layout(hovermode="closest")
    note(drawn, "A mark for each fix that the gate kept out.")
    return drawn
