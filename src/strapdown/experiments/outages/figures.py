"""Figures of a comparison over outages: paired ratios, growth with time, every outage, errors in
single outages, coverage, the track.

Errors are true - estimate. Every function takes a comparison.Comparison and returns a plotly
Figure, or None where there is nothing to draw; a filter has the same colour, symbol and dash in all
of them. Filters that were not scored are left out and named in a sentence below the figure.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ...checks import DataError, check_choice, check_number
from ...evaluation.metrics import NED_AXES
from ...pages.drawing import (
    COLOURS,
    GREY,
    corners,
    even_indices,
    finish,
    ground,
    line,
    log_range,
    log_ticks,
    note,
    origin,
    panels,
    path as draw_path,
    positive,
    ribbon,
    seen_from_above,
    wider,
)
from ...pages.notebook.plots import add_title
from ...typing import Array, Ints, Mask
from ...units.wording import metres
from .texts import ErrorRatio, rank_filters, ratio

if TYPE_CHECKING:
    from .protocols import Window
    from .result import Comparison

PALETTE = (*COLOURS, "#8a6d3b", "#e0559f", "#7c8a00", "#5f7fa8")
MARKER_SYMBOLS = (
    "circle",
    "square",
    "diamond",
    "triangle-up",
    "triangle-down",
    "cross",
    "x",
    "star",
    "pentagon",
    "hexagon",
)
DASHES = ("solid", "dash", "dot")
OUTAGE_COLOUR = "rgba(59,125,216,0.35)"
"""Colour of the stretches of the track whose fixes were withheld."""
GAUSS = (68.27, 95.45, 99.73)
"""Percent of a normal error within 1, 2 and 3 standard deviations."""
REACH = 100.0
"""Largest ratio to the median, above and below, on a logarithmic axis: a diverging filter leaves
the axis instead of flattening the others."""
SHARES = {
    f"{part}coverage_{k + 1}": (col, k)
    for col, part in enumerate(("", "down_"), 1)
    for k in range(len(GAUSS))
}
"""{column of the scores: (panel, place in GAUSS)} of the errors within standard deviations."""
SINCE = "time since the outage began [s]"
LINE_POINTS = 250
"""Points of a line over one outage at most."""
MIDDLING = 5.0
"""Limit of the frame of a single outage, as a multiple of the median filter's largest error, if
others exceed twice this error."""


class Style(NamedTuple):
    """Colour, symbol and dash of a filter."""

    colour: str
    symbol: str
    dash: str


def styles(filters: Iterable[str]) -> dict[str, Style]:
    """{filter: Style} in their order; ten colours, then again with other dashes."""

    def style_at(i: int) -> Style:
        return Style(
            PALETTE[i % len(PALETTE)],
            MARKER_SYMBOLS[i % len(MARKER_SYMBOLS)],
            DASHES[i // len(PALETTE) % len(DASHES)],
        )

    return {name: style_at(i) for i, name in enumerate(filters)}


def paired_ratios(comparison: Comparison, base: str, length: float) -> go.Figure | None:
    """Ratio of RMSE of each filter to that of `base` on the same outages, with 95 % intervals:
    horizontal, north, east, down."""
    others = [name for name in comparison.filters if name != base]
    if not others:
        return None
    look, measures = styles(comparison.filters), ("horizontal", *NED_AXES)
    ratios = {
        name: [ratio(comparison, name, base, length, measure) for measure in measures]
        for name in others
    }
    known = [name for name in others if np.isfinite([r.value for r in ratios[name]]).any()]
    if not known:
        return None
    figure = _by_filter(measures, known, 0.02, 130).update_layout(margin={"t": 42})
    dashed = {"color": GREY, "width": 1.2, "dash": "dash"}
    for col in range(len(measures)):
        for name in known:
            _interval(figure, ratios[name][col], name, look[name], col + 1)
        figure.add_vline(1.0, line=dashed, row=1, col=col + 1)
    ends = np.array([r[:3] for name in known for r in ratios[name]])
    ends = np.log10(ends[np.isfinite(ends)])
    low, high = min(float(ends.min()), 0.0) - 0.08, max(float(ends.max()), 0.0) + 0.08
    figure.update_xaxes(type="log", range=[low, high], **_few(log_ticks(low, high)))
    figure.update_xaxes(title_text="ratio of RMSE", row=1, col=1)
    _left_out(figure, "Without a ratio, because no outage was scored for both", others, known)
    return figure


def _by_filter(titles: Sequence[str], names: Sequence[str], space: float, extra: int) -> go.Figure:
    """A panel beside the other for each title, and in all of them a row per filter."""
    figure = make_subplots(
        rows=1, cols=len(titles), shared_yaxes=True, horizontal_spacing=space, subplot_titles=titles
    )
    finish(figure, extra + 30 * len(names)).update_layout(hovermode="closest")
    figure.update_annotations(font_size=13)  # the titles, which stand side by side on a phone too
    return figure.update_yaxes(
        type="category",
        categoryorder="array",
        categoryarray=names[::-1],
        range=[-0.6, len(names) - 0.4],
    )


def _left_out(figure: go.Figure, why: str, names: Iterable[str], shown: Collection[str]) -> None:
    """Name below the figure those that it does not show."""
    if missing := [name for name in names if name not in shown]:
        note(figure, f"{why}: {', '.join(missing)}.")


def _interval(figure: go.Figure, r: ErrorRatio, name: str, style: Style, col: int) -> None:
    """A ErrorRatio as a mark with its interval, filled where that excludes 1."""
    if not np.isfinite(r.value):
        return
    sure, error = bool(np.isfinite([r.low, r.high]).all()), None
    if sure:
        error = {
            "type": "data",
            "symmetric": False,
            "array": [r.high - r.value],
            "arrayminus": [r.value - r.low],
            "color": style.colour,
            "thickness": 1.6,
            "width": 5,
        }
    filled = style.colour if sure and not r.low <= 1 <= r.high else "rgba(0,0,0,0)"
    marker = {
        "color": filled,
        "symbol": style.symbol,
        "size": 10,
        "line": {"color": style.colour, "width": 2},
    }
    within = f" (95 %: {r.low:.3g} to {r.high:.3g})" if sure else ""
    said = f"%{{y}}: {r.value:.3g} times{within}; smaller in {r.wins} of {r.count} outages, {r.blocks} blocks<extra></extra>"
    drawn = go.Scatter(
        x=[r.value],
        y=[name],
        error_x=error,
        mode="markers",
        showlegend=False,
        hovertemplate=said,
        marker=marker,
    )
    figure.add_trace(drawn, row=1, col=col)


def _few(settings: dict[str, Any]) -> dict[str, Any]:
    """Ticks of a narrow logarithmic axis: not all of the numbers where there are many."""
    texts = settings.get("ticktext", ())
    if not texts:
        return settings | {"dtick": 2}
    step = -(-len(texts) // 4)
    return (
        settings
        if step == 1
        else settings | {name: settings[name][::step] for name in ("tickvals", "ticktext")}
    )


def growth(comparison: Comparison, length: float) -> go.Figure | None:
    """Horizontal and vertical error over the time since the outage began, of each filter: median
    and 10 to 90 % of its outages."""
    look, parts = styles(comparison.filters), ("horizontal", "vertical")
    figure = panels([f"{part} error [m]" for part in parts], 300, log=True)
    seen: list[list[Array]] = [[], []]
    pooled = comparison.growth[comparison.growth["length_s"] == length]
    opacity = 0.14 if len(look) <= 4 else 0.07
    for rank, (name, style) in reversed(list(enumerate(look.items()))):
        rows = pooled[pooled["filter"] == name]
        since = rows["since_s"].to_numpy(float)
        for row, part in enumerate(parts, 1):
            middle, low, high = (
                rows[f"{part}_{what}_m"].to_numpy(float) for what in ("median", "p10", "p90")
            )
            if not np.isfinite(middle).any():
                continue
            _ribbon(figure, since, low, high, style.colour, name, row, opacity)
            shown = np.where(middle > 0, middle, np.nan)
            look_of: dict[str, Any] = {"dash": style.dash, "width": wider(2, rank)}
            line(figure, since, shown, name, style.colour, row, rank=rank, **look_of)
            seen[row - 1] += [middle, high, low]
    if not seen[0]:
        return None
    for row, values in enumerate(seen, 1):
        _frame(figure, np.concatenate(values), row, least=0.05)
    return figure.update_xaxes(title_text=SINCE, row=2, col=1)


def _ribbon(
    figure: go.Figure,
    x: Array,
    low: Array,
    high: Array,
    colour: str,
    name: str,
    row: int,
    opacity: float,
) -> None:
    """A `ribbon` where both lines are known, thinned."""
    known = np.flatnonzero(np.isfinite(low) & np.isfinite(high) & (low > 0))
    if len(known) > 1:
        keep = known[even_indices(len(known), LINE_POINTS)]
        ribbon(figure, x[keep], low[keep], high[keep], colour, opacity, name, row=row, col=1)


def _frame(figure: go.Figure, values: Array, row: int, least: float = 0.0) -> None:
    """Range of a logarithmic axis that holds the `values` down to their quantile `least`; what
    is farther than REACH leaves it, which is said."""
    values = positive(values)
    if not len(values):
        return
    middle, most = np.median(values), values.max()
    low, high = max(np.quantile(values, least), middle / REACH), min(most, middle * REACH)
    log_range(figure, low, high, row=row)
    if values.min() < middle / REACH / 1.2 and not least or most > 1.4 * high:
        note(
            figure,
            f"Panel {row}: values from {values.min():.3g} to {most:.3g} are there, more than the "
            f"frame holds; double-click it to see all.",
        )


MEASURES = (
    ("horizontal_rmse_m", "horizontal RMSE [m]"),
    ("down_rmse_m", "vertical RMSE [m]"),
    ("velocity_rmse_m_s", "velocity RMSE [m/s]"),
    ("heading_rmse_deg", "heading RMSE [deg]"),
)
"""Columns of the scores that `outages` draws where they are known, and the labels of their axes."""


def outages(comparison: Comparison, length: float) -> go.Figure | None:
    """The errors of each filter in every outage: over its start for a sweep, over its number
    otherwise."""
    own = comparison.of_length(length)
    shown = [(name, label) for name, label in MEASURES if np.isfinite(own[name]).any()]
    if not shown:
        return None
    figure = panels([label for _, label in shown], 190, log=True)
    scored = set(own["filter"][np.isfinite(own["horizontal_rmse_m"])])
    look = {name: style for name, style in styles(comparison.filters).items() if name in scored}
    zero, many = origin(own["start_s"].to_numpy(float)), not are_listed(comparison)
    mode, size = ("lines+markers", 6) if many else ("markers", 9)
    for place, (name, style) in enumerate(look.items()):
        rows = own[own["filter"] == name].sort_values("start_s")
        beside = 0.5 * (place - (len(look) - 1) / 2) / len(look)
        x = rows["start_s"] - zero if many else rows["outage"] + beside
        for row, (measure, _) in enumerate(shown, 1):
            figure.add_trace(
                go.Scatter(
                    x=x.to_numpy(float),
                    y=rows[measure],
                    mode=mode,
                    name=escape(name),
                    legendgroup=name,
                    showlegend=row == 1,
                    line={"color": style.colour, "width": 1, "dash": style.dash},
                    hovertemplate="%{y:.3g}",
                    marker={"color": style.colour, "symbol": style.symbol, "size": size},
                ),
                row=row,
                col=1,
            )
    for row, (measure, _) in enumerate(shown, 1):
        _frame(figure, own[measure].to_numpy(float), row)
    start = f"start of the outage{f', since {zero:.0f} s' if zero else ''} [s]"
    figure.update_xaxes(title_text=start if many else "outage", row=len(shown), col=1)
    if not many:
        figure.update_xaxes(dtick=1, range=[0.5, len(comparison.windows) + 0.5])
        figure.update_layout(hovermode="closest")
    return figure


LIST = 12
"""Most outages of one run that have a number each on the track and on axes; more, and those of a
sweep, are named by their start."""


def are_listed(comparison: Comparison) -> bool:
    """True where the outages are few and of one run."""
    return not comparison.sweep and len(comparison.windows) <= LIST


def course(comparison: Comparison, outage: int) -> go.Figure | None:
    """North, east and down error of every filter over one outage (its index), time from its
    beginning."""
    figure, largest = panels([f"{axis} [m]" for axis in NED_AXES], 150), {}
    for rank, (name, style) in reversed(list(enumerate(styles(comparison.filters).items()))):
        if (track := comparison.tracks[name][outage]) is None:
            continue
        keep = even_indices(len(track.since), LINE_POINTS)
        largest[name] = np.abs(track.error).max(axis=0)
        since = track.since[keep]
        look: dict[str, Any] = {"dash": style.dash, "width": wider(1.4, rank)}
        for row, error in enumerate(track.error[keep].T, 1):
            line(figure, since, error, name, style.colour, row, rank=rank, **look)
    if not largest:
        return None
    for row, axis in enumerate(NED_AXES, 1):
        found = {name: values[row - 1] for name, values in reversed(largest.items())}
        most, middle = max(found.values()), float(np.median(list(found.values())))
        limit = 1.1 * (most if most <= 2 * MIDDLING * middle else MIDDLING * middle) or 1.0
        figure.update_yaxes(range=[-limit, limit], row=row, col=1)
        outside = [
            f"{name} up to {metres(value)}" for name, value in found.items() if value > limit
        ]
        if outside:
            note(
                figure,
                f"Beyond the frame {axis}: {', '.join(outside)}. Double-click the panel to see all "
                f"of it.",
            )
    _left_out(figure, "Not scored here", comparison.filters, largest)
    return figure.update_xaxes(title_text=SINCE, row=len(NED_AXES), col=1)


def coverage(comparison: Comparison) -> go.Figure | None:
    """Share of the errors in the outages within 1, 2 and 3 of the standard deviations that each
    filter claims: north and east together, and down."""
    found = dict(list(comparison.scores.groupby("filter")))
    known = [
        name for name in comparison.filters if found[name][list(SHARES)].notna().any(axis=None)
    ]
    if not known:
        return None
    figure = _by_filter(("north and east", "down"), known, 0.03, 150).update_layout(
        margin={"t": 74}, legend={"y": 1 + 26 / (40 + 30 * len(known))}
    )
    for name, (col, k) in SHARES.items():
        colour, symbol = PALETTE[3 + k], MARKER_SYMBOLS[k]  # the first are of filters
        figure.add_trace(
            go.Scatter(
                x=[100 * found[label][name].mean() for label in known],
                y=known,
                mode="markers",
                name=f"within {k + 1}σ",
                legendgroup=k + 1,
                showlegend=col == 1,
                hovertemplate="%{y}: %{x:.1f} %",
                marker={"color": colour, "symbol": symbol, "size": 11},
            ),
            row=1,
            col=col,
        )
        dashed = {"color": colour, "width": 1.2, "dash": "dash"}
        figure.add_vline(GAUSS[k], line=dashed, row=1, col=col)
    figure.update_xaxes(title_text="share [%]", range=[-8, 108])
    why = "No standard deviation is claimed, or nothing was scored"
    _left_out(figure, why, comparison.filters, known)
    return figure


def track(comparison: Comparison) -> go.Figure | None:
    """The reference from above with the outages on it, numbered where they are a list; then with
    the estimates in them, error and all."""
    reference = comparison.reference
    known = (
        np.isfinite(reference.lla).all(axis=1)
        & (reference.t >= comparison.span[0])
        & (reference.t <= comparison.span[1])
    )
    if not known.any():
        return None
    t, lla = reference.t[known], reference.lla[known]
    path = ground(lla, lla[0])
    figure = finish(go.Figure(), 640)
    draw_path(
        figure, path[even_indices(len(path))], "reference", line={"color": GREY, "width": 1.5}
    )
    hidden = np.zeros(len(t), bool)
    for start, stop in comparison.windows:
        hidden |= (t >= start) & (t <= stop)
    draw_path(
        figure,
        np.where(hidden[:, None], path, np.nan)[_breaks(hidden)],
        "fixes withheld",
        line={"color": OUTAGE_COLOUR, "width": 10},
    )
    if are_listed(comparison):
        starts = _beginnings(comparison.windows, t, path)
        texts = [
            f"outage {i}, {start:.10g} to {stop:.10g} s"
            for i, (start, stop) in enumerate(comparison.windows, 1)
        ]
        draw_path(
            figure,
            starts,
            "an outage begins",
            mode="markers",
            text=texts,
            hovertemplate="%{text}",
            marker={"color": GREY, "size": 9, "symbol": "circle-open", "line": {"width": 2}},
        )
        for number, (east, north) in enumerate(starts, 1):
            figure.add_annotation(
                x=float(east),
                y=float(north),
                text=str(number),
                showarrow=False,
                xshift=12,
                yshift=10,
                font={"size": 14},
            )
        _estimates(figure, comparison, t, path)
    else:
        _hard(figure, comparison, t, path)
    return seen_from_above(figure, corners(path), 0.08)


def _beginnings(windows: Iterable[Window], t: Array, path: Array) -> Array:
    return path[np.minimum(np.searchsorted(t, [start for start, _ in windows]), len(t) - 1)]


def _hard(figure: go.Figure, comparison: Comparison, t: Array, path: Array) -> None:
    """A mark where each outage of the longest length begins, in the colour of the horizontal
    RMSE of the best filter: where it is hard."""
    if not (order := rank_filters(comparison, comparison.lengths[-1])):
        return
    own = comparison.of_length(comparison.lengths[-1])
    own = own[(own["filter"] == order[0]) & (own["horizontal_rmse_m"] > 0)]
    windows = list(zip(own["start_s"], own["stop_s"]))
    rmse = own["horizontal_rmse_m"].to_numpy(float)
    ticks = log_ticks(np.log10(rmse.min()) - 0.01, np.log10(rmse.max()) + 0.01)
    bar = {
        "title": {"text": f"horizontal RMSE<br>of {escape(order[0])} [m]", "side": "right"},
        "thickness": 12,
    }
    bar |= (
        {"tickvals": np.log10(ticks["tickvals"]), "ticktext": ticks["ticktext"]}
        if "tickvals" in ticks
        else {"tickprefix": "10^", "dtick": 1}
    )
    texts = [
        f"outage {i}, {start:.10g} to {stop:.10g} s: {metres(value)}"
        for i, (start, stop), value in zip(own["outage"], windows, rmse)
    ]
    draw_path(
        figure,
        _beginnings(windows, t, path),
        "an outage begins",
        mode="markers",
        text=texts,
        hovertemplate="%{text}",
        marker={
            "color": np.log10(rmse),
            "colorscale": "Viridis",
            "size": 9,
            "colorbar": bar,
            "line": {"width": 0},
        },
    )


def _breaks(hidden: Mask) -> Ints:
    """At most MAX_POINTS rows of a line that is drawn where `hidden`, each stretch with a row
    beside it to break the line."""
    wanted = np.flatnonzero(hidden)
    edges = np.flatnonzero(np.diff(hidden))
    return np.unique(np.r_[wanted[even_indices(len(wanted))], edges, edges + 1])


def _estimates(figure: go.Figure, comparison: Comparison, t: Array, path: Array) -> None:
    """Draw the estimates of each filter in the outages: the reference less its error. Lines of one
    filter are one entry of the legend."""
    for name, style in styles(comparison.filters).items():
        parts = []
        for (start, _), track in zip(comparison.windows, comparison.tracks[name]):
            if track is not None:
                keep = even_indices(len(track.since), LINE_POINTS)
                true = np.column_stack(
                    [np.interp(start + track.since[keep], t, axis) for axis in path.T]
                )
                parts += [true - track.error[keep][:, [1, 0]], np.full((1, 2), np.nan)]
        if parts:
            draw_path(
                figure,
                np.concatenate(parts),
                name,
                line={"color": style.colour, "width": 1.6, "dash": style.dash},
            )


NAMED = {
    "growth": "Error over the time in the outage",
    "outages": "RMSE of each outage",
    "paired": "ErrorRatio to",
    "course": "Errors in outage",
    "coverage": "Errors within the claimed standard deviations",
    "track": "Seen from above",
}
"""{name of a figure: how its heading begins}."""


def figure_of_name(
    comparison: Comparison, what: str, length: float | None, outage: int
) -> go.Figure:
    """The figure of that name as it stands alone, of the outages of a `length` in s, or of the one
    of that number. Raises DataError."""
    heading = NAMED[check_choice(what, "figure", NAMED)]
    length = comparison.lengths[-1] if length is None else length
    if length not in comparison.lengths:
        known = ", ".join(f"{each:g}" for each in comparison.lengths)
        raise DataError(f"length is {length!r}; the outages are {known} s long")
    if what == "course":
        count = len(comparison.windows)
        check_number(outage, "outage", least=1, most=count, whole=True)
    best = [*rank_filters(comparison, length), *comparison.filters][0]
    draw = {
        "growth": lambda: growth(comparison, length),
        "outages": lambda: outages(comparison, length),
        "paired": lambda: paired_ratios(comparison, best, length),
        "course": lambda: course(comparison, outage - 1),
        "coverage": lambda: coverage(comparison),
        "track": lambda: track(comparison),
    }
    made = draw[what]()
    if made is None:
        raise DataError(f"figure {what!r}: this comparison has nothing to draw there")
    return add_title(
        made, " ".join([heading, *{"course": [str(outage)], "paired": [best]}.get(what, [])])
    )
