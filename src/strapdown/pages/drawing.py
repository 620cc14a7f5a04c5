"""Helpers that all figures share: colours of solutions, thinning long runs, the frame of an axis,
bands, shading of gaps and events, layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ..core.loop.contract import BRIDGED, DOUBTFUL, INVALID
from ..data.recording import Recording
from ..data.solution import Solution
from ..geometry.geodesy import displacement
from ..typing import Array, ArrayLike, Ints
from ..units.time_scales import utc

MAX_POINTS = 1500
"""Points per line at most. Longer runs keep the smallest and the largest value of each of
MAX_POINTS/2 stretches, so that no peak is lost."""
BAND_POINTS = 500
"""Points per edge of a band at most: bands change slowly, and are read for their size."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of solutions, and of north, east, down: those of Okabe and Ito, which the colour-blind tell
apart."""
DASHES = ("solid", "dash", "dashdot")
"""Dashes of lines of solutions, from one round of the colours to the next."""
GREY, RED = "#868e96", "#e03131"
SHADES: dict[int, str] = {
    BRIDGED: "rgba(240,180,0,0.22)",
    DOUBTFUL: "rgba(156,77,204,0.15)",
    INVALID: "rgba(224,49,49,0.16)",
}
WITHHELD = "rgba(59,125,216,0.13)"
"""Colour of the windows whose fixes were withheld."""
OUTAGE = "rgba(134,142,150,0.18)"
"""Colour of the stretches without an accepted fix of the position."""
OUTAGE_INTERVALS = 3.0
"""Usual intervals between accepted fixes of the position from which a pause is an outage."""
FAR = 5.0
"""A solution whose frame is more than this many times as high as the least one leaves that."""
SHADED_BANDS = 2
"""The bands of at most this many solutions are shaded; those of more are dotted lines."""
MARKED = 20
"""At most this many events and status stretches of each kind are drawn; the page lists all
events."""


def thin(y: ArrayLike, most: int = MAX_POINTS) -> Ints:
    """Indices of about `most` values of y that keep the smallest and largest value of each
    stretch, and a NaN wherever some begin."""
    y = np.asarray(y, float)
    if len(y) <= most:
        return np.arange(len(y))
    width = -(-len(y) // (most // 2 - 1))
    stretches = np.append(y, np.full(-len(y) % width, np.nan)).reshape(-1, width)
    first = np.arange(len(stretches)) * width
    low = first + np.where(np.isnan(stretches), np.inf, stretches).argmin(axis=1)
    high = first + np.where(np.isnan(stretches), -np.inf, stretches).argmax(axis=1)
    unknown = np.isnan(y)
    breaks = np.flatnonzero(unknown[1:] & ~unknown[:-1]) + 1
    return np.unique(np.r_[0, low, high, breaks[even_indices(len(breaks), most // 4)], len(y) - 1])


def even_indices(n: int, most: int = MAX_POINTS) -> Ints:
    """Indices of at most `most` of n rows at even steps, the last one included."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int)) if n else np.arange(0)


def extent(values: Array) -> tuple[float, float]:
    """Smallest and largest known value, (0, 0) where there is none."""
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)


def peak(values: Array | None) -> float:
    """The largest magnitude, 0 where there is none."""
    values = np.abs(values[np.isfinite(values)]) if values is not None else np.empty(0)
    return float(values.max()) if len(values) else 0.0


def frame(
    t: Array, values: Array, band: Array | None, window: tuple[float, float] | None = None
) -> tuple[float, float]:
    """(limit, largest): half the height of an axis around zero, and the largest magnitude of all.

    The frame holds every value after the first tenth and every band after the first third of the
    run (or all of `window`), so that the initial convergence does not flatten the rest; it holds
    everything where that is less than three times as much.
    """
    since, band_since = (
        (t[0] + (t[-1] - t[0]) * part for part in (0.1, 1 / 3)) if len(t) else (0.0, 0.0)
    )
    later, much_later = (
        (t >= since, t >= band_since)
        if window is None
        else ((t >= window[0]) & (t <= window[1]),) * 2
    )
    within = max(peak(values[later]), peak(band[much_later]) if band is not None else 0.0)
    largest = max(peak(values), peak(band))
    return (
        (1.08 * largest or 1.0, largest)
        if largest <= 3 * within or not within
        else (1.15 * within, largest)
    )


def cut_wraps(degrees: ArrayLike) -> Array:
    """The angles with NaN where they jump by more than 180 deg, so that no line is drawn across."""
    out = np.array(degrees, float)
    out[np.flatnonzero(np.abs(np.diff(out)) > 180) + 1] = np.nan
    return out


def together(degrees: Array, beside: Array | None = None) -> tuple[Array, Array | None]:
    """(degrees, beside) less whole turns, so that headings around north are not torn apart; as
    they are where they cover more than half a turn."""
    low, high = extent(degrees)
    if high - low > 180:
        moved = _near(degrees, np.degrees(np.angle(np.nanmean(np.exp(1j * np.radians(degrees))))))
        low, high = extent(moved)
        if high - low > 180:
            return degrees, beside
        degrees = moved
    return degrees, None if beside is None else _near(beside, (low + high) / 2)


def _near(degrees: Array, about: float) -> Array:
    """The angles less whole turns, within half a turn of `about`."""
    return about + (degrees - about + 180) % 360 - 180


def panels(labels: Sequence[str], height: int = 170, log: bool = False) -> go.Figure:
    """A figure with one panel per label of its y axis, time below all of them."""
    figure = go.Figure(_grid(len(labels), log))
    for row, label in enumerate(labels, start=1):
        figure.layout[f"yaxis{row if row > 1 else ''}"].title.text = label
    figure.layout.height = height * len(labels) + 85
    return figure


@cache
def _grid(rows: int, log: bool) -> go.Figure:
    """Empty panels one below the other. Plotly takes twenty times as long to lay them out as to
    copy them."""
    figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.11 / rows)
    return finish(figure.update_yaxes(type="log" if log else "linear"), 170 * rows)


def log_range(figure: go.Figure, low: float, high: float, row: int = 1) -> None:
    """Range of a logarithmic axis, with ticks at 1, 2 and 5 where it spans few decades."""
    low, high = np.log10(low) - 0.1, np.log10(high) + 0.15
    figure.update_yaxes(range=[low, high], row=row, col=1, **log_ticks(low, high))


def positive(*values: Array) -> Array:
    """The numbers above zero among all values: those that a logarithmic axis shows."""
    every = np.concatenate([np.ravel(each) for each in values])
    return every[np.isfinite(every) & (every > 0)]


def log_frame(figure: go.Figure, values: Array, row: int = 1, room: float = 1.0) -> None:
    """Range of a logarithmic axis around the positive `values`, with so much room; as it is where
    there are none."""
    known = positive(values)
    if len(known):
        log_range(figure, known.min() / room, known.max() * room, row)


def log_ticks(low: float, high: float) -> dict[str, Any]:
    """Settings of a logarithmic axis from 10^low to 10^high: decades, or where there are few,
    numbers.

    Plotly's own labels between decades are single digits, which do not say of which decade.
    """
    if high - low > 2.2:
        return {"tickmode": "linear", "dtick": 1, "exponentformat": "power"}
    values = ticks_125(low, high)
    return {
        "tickmode": "array",
        "tickvals": values,
        "ticktext": [
            f"{value:.15g}" if 1e-4 <= value < 1e6 else f"{value:.0e}" for value in values
        ],
    }


def ticks_125(low: float, high: float) -> list[float]:
    """The numbers 1, 2, 5 x 10^k between 10^low and 10^high; where these are fewer than two, of
    more digits x 10^k."""

    def every(digits: Sequence[float]) -> list[float]:
        return [
            float(f"{digit}e{k}")
            for k in range(int(np.floor(low)), int(np.ceil(high)) + 1)
            for digit in digits
            if low <= np.log10(digit) + k <= high
        ]

    few, some, many = (1, 2, 5), (1, 1.5, 2, 3, 5, 7), (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9)
    found = (every(digits) for digits in (few, some))
    return next((ticks for ticks in found if len(ticks) > 1), every(many))


def finish(figure: go.Figure, height: int) -> go.Figure:
    """Layout of every figure; `layout.meta["notes"]` takes sentences that belong below it,
    `layout.meta["clock"]` UTC at 0 of a time axis, ms since 1970."""
    figure.update_layout(
        template=go.layout.Template(),
        height=height,
        margin={"l": 70, "r": 15, "t": 52, "b": 45},
        hovermode="x unified",
        legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"},
        font={"size": 12},
        meta={"notes": []},
    )
    figure.update_yaxes(title_standoff=6, zeroline=False, automargin=True)
    figure.update_xaxes(zeroline=False)
    return figure


def note(figure: go.Figure, text: str) -> None:
    """Add a sentence below the figure."""
    figure.layout.meta["notes"].append(text)


def origin(t: Array) -> float:
    """Where the time axes start counting: 0, or the first full second where times are as large
    as those of a Unix clock."""
    return float(np.floor(t[0])) if len(t) and abs(t[0]) > 1e6 else 0.0


def column(values: ArrayLike) -> Array | NDArray[np.float32]:
    """As it goes into a figure: 4 bytes a number are enough for a screen, unless times are
    large. `packing` rounds them once more."""
    values = np.asarray(values, float)
    return values if peak(values) > 1e5 else values.astype(np.float32)


class ShownSolution(NamedTuple):
    """A solution in a figure."""

    name: str
    solution: Solution
    colour: str
    dash: str
    alone: bool  # no other stands on the page

    def label(self, alone: str = "estimate") -> str:
        """Its name in the legend, or what it is called where there is no other."""
        return alone if self.alone else self.name


def each(solutions: Solution | Mapping[str, Solution]) -> list[ShownSolution]:
    """Those with rows of a Solution or of {name: Solution}, in the colours that they have in every
    figure."""
    named = {"": solutions} if isinstance(solutions, Solution) else solutions
    styles = [(colour, dash) for dash in DASHES for colour in COLOURS]
    return [
        ShownSolution(name, solution, *styles[i % len(styles)], len(named) == 1)
        for i, (name, solution) in enumerate(named.items())
        if len(solution.t)
    ]


def faint(colour: str, opacity: float) -> str:
    """A colour "#rrggbb" that lets others shine through."""
    return f"rgba({','.join(str(int(colour[i : i + 2], 16)) for i in (1, 3, 5))},{opacity})"


def wider(width: float, rank: int) -> float:
    """Width of the line of the solution of that rank: lines are drawn over those of higher ranks, whose
    edges show where they lie below."""
    return width + min(rank, 3)


def line(
    figure: go.Figure,
    t: Array,
    y: Array,
    name: str,
    colour: str,
    row: int = 1,
    legend: bool | None = None,
    rank: int = 1000,
    unit: str = "",
    std: Array | None = None,
    **style: str | float,
) -> None:
    """One thinned line; `rank` is its place in the legend, where it is shown if
    `legend` says so, by default in the first row. The pointer shows its value with the unit, and
    with the standard deviations `std` where there are any."""
    keep = thin(y, MAX_POINTS)
    claimed = std is not None and bool(np.isfinite(std).any())
    figure.add_trace(
        go.Scatter(
            x=column(t[keep]),
            y=column(y[keep]),
            name=escape(name),
            mode="lines",
            legendgroup=name,
            legendrank=rank,
            showlegend=row == 1 if legend is None else legend,
            line={"color": colour, "width": 1.4, **style},
            hovertemplate=f"%{{y:.4g}}{' ± %{customdata:.2g}' if claimed else ''} {escape(unit)}".rstrip(),
            customdata=column(_two_digits(std[keep])) if std is not None and claimed else None,
        ),
        row=row,
        col=1,
    )


def level(
    figure: go.Figure, x: Array, value: float, name: str, row: int = 1, unit: str = ""
) -> None:
    """A dashed grey line at one value from the first to the last of x, in the legend where its name
    is not there yet."""
    new = name not in legend_names(figure)
    line(figure, x[[0, -1]], np.full(2, value), name, GREY, row, new, unit=unit, dash="dash")


def legend_names(figure: go.Figure) -> set[str]:
    """Names of all that is drawn."""
    return {trace.name for trace in figure.data}


def ribbon(
    figure: go.Figure,
    x: Array,
    low: Array,
    high: Array,
    colour: str,
    opacity: float,
    group: str | None = None,
    **place: int,
) -> None:
    """Shade the area between two lines, shown and hidden with the line of `group`; place: row and
    col of its panel."""
    figure.add_trace(
        go.Scatter(
            x=column(np.r_[x, x[::-1]]),
            y=column(np.r_[high, low[::-1]]),
            mode="lines",
            fill="toself",
            fillcolor=faint(colour, opacity),
            line={"width": 0},
            legendgroup=group,
            showlegend=False,
            hoverinfo="skip",
        ),
        **place,
    )


def _two_digits(values: Array) -> Array:
    """The values to a 64th of themselves, which is enough for a number that two digits are shown
    of."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(mantissa * 128) / 128, exponent)


class BandStyle(NamedTuple):
    """Colours of a band."""

    colour: str = GREY
    # name of the line whose entry of the legend it belongs to; None: it has its own
    group: str | None = None
    shaded: bool = True  # else its two edges are dotted lines


PLAIN_BAND = BandStyle()
"""Style of the only solution on a page."""


def band(
    figure: go.Figure,
    t: Array,
    centre: Array,
    half: Array,
    row: int = 1,
    name: str = "±3σ",
    style: BandStyle = PLAIN_BAND,
) -> None:
    """A band of `half` to both sides of `centre`, a polygon per stretch without NaN, or its two
    edges; nothing where nothing is claimed."""
    colour, group, shaded = style
    half = np.where(np.isfinite(centre), half, np.nan)
    keep = thin(half, BAND_POINTS)
    t, centre, half = t[keep], centre[keep], half[keep]
    x, y = [], []
    known = np.ma.masked_invalid(half)
    for stretch in np.ma.clump_unmasked(known):  # type: ignore[no-untyped-call]  # numpy's stub
        above, below = (centre + half)[stretch], (centre - half)[stretch]
        parts = [above, below[::-1]] if shaded else [above, [np.nan], below]
        back = [t[stretch][::-1]] if shaded else [[np.nan], t[stretch]]
        x += [t[stretch], *back, [np.nan]]
        y += [*parts, [np.nan]]
    if not x:
        return
    filled = (
        {"fill": "toself", "fillcolor": faint(colour, 0.22 if colour == GREY else 0.12)}
        if shaded
        else {}
    )
    edge = {"width": 0.7} if shaded else {"width": 1, "dash": "dot"}
    figure.add_trace(
        go.Scatter(
            x=column(np.concatenate(x)),
            y=column(np.concatenate(y)),
            name=escape(name),
            legendgroup=group or name,
            mode="lines",
            line={"color": colour, **edge},
            showlegend=row == 1 and group is None,
            hoverinfo="skip",
            **filled,
        ),
        row=row,
        col=1,
    )


def marks(
    figure: go.Figure,
    t: Array,
    values: Array,
    name: str,
    style: Mapping[str, Any],
    row: int = 1,
    unit: str = "",
) -> None:
    """The known values as marks, thinned at even steps; in the legend where the name is not there
    yet."""
    chosen = np.flatnonzero(np.isfinite(values))
    chosen = chosen[even_indices(len(chosen))]
    if not len(chosen):
        return
    new = escape(name) not in legend_names(figure)
    figure.add_trace(
        go.Scatter(
            x=column(t[chosen]),
            y=column(values[chosen]),
            name=escape(name),
            mode="markers",
            marker=style,
            legendgroup=name,
            showlegend=new,
            hovertemplate=f"%{{y:.4g}} {escape(unit)}".rstrip(),
        ),
        row=row,
        col=1,
    )


def path(
    figure: go.Figure,
    places: Array,
    name: str,
    mode: str = "lines",
    hovertemplate: str = "%{x:.1f} m east, %{y:.1f} m north",
    t: Array | None = None,
    **style: Any,
) -> None:
    """Places (n, 2), east and north in metres, as a line or as marks; `t` (n,) s, their times, to
    find the place of a time by."""
    if t is not None:
        style["customdata"], hovertemplate = column(t), hovertemplate + ", %{customdata:.1f} s"
    figure.add_trace(
        go.Scatter(
            x=column(places[:, 0]),
            y=column(places[:, 1]),
            name=escape(name),
            mode=mode,
            hovertemplate=hovertemplate,
            **style,
        )
    )


def east_north_up(lla: Array, start: Array) -> Array:
    """(n, 3) east, north and up of `start`, m, longitude unwrapped so that a track may cross the
    antimeridian."""
    return displacement(lla, np.broadcast_to(start, lla.shape))[:, [1, 0, 2]] * [1, 1, -1]


def ground(lla: Array, start: Array) -> Array:
    """(n, 2) east and north of `start`, m, as `east_north_up`."""
    return east_north_up(lla, start)[:, :2]


def corners(places: Array) -> Array:
    """(2, k) smallest and largest values of the columns of places (n, k)."""
    return np.array([extent(column) for column in places.T]).T


def seen_from_above(figure: go.Figure, box: Array, share: float) -> go.Figure:
    """Axes of a track in metres east and north, as long as one another, around the `corners`
    `box` with a margin of that share."""
    margin = share * max((box[1] - box[0]).max(), 10.0)
    return figure.update_layout(
        xaxis_range=[box[0, 0] - margin, box[1, 0] + margin],
        yaxis_range=[box[0, 1] - margin, box[1, 1] + margin],
        xaxis_title="east [m]",
        yaxis_title="north [m]",
        hovermode="closest",
        yaxis_scaleanchor="x",
        margin_t=72,
    )


def time_axis(
    figure: go.Figure,
    solutions: Solution | Mapping[str, Solution] | Sequence[ShownSolution] | Recording,
    zero: float = 0.0,
) -> go.Figure:
    """Label the time axis, shade gaps, outages and windows of withheld fixes, and mark the events
    of a solution, or of all of {name: Solution}, numbered as the page lists them: in the
    solution's colour where they are not the same of all. Of a recording, the time alone."""
    if isinstance(solutions, Recording):
        return _format_time_axis(figure, *solutions.span, zero, solutions.meta)
    shown = each(solutions) if isinstance(solutions, (Solution, Mapping)) else solutions
    begin = min(float(one.solution.t[0]) for one in shown)
    end = max(float(one.solution.t[-1]) for one in shown)
    return _add_marks(
        _format_time_axis(figure, begin, end, zero, shown[0].solution.meta), shown, zero
    )


def time_label(zero: float) -> str:
    """Return the label of a time axis that counts from `zero`, s."""
    return "time [s]" if not zero else f"time since {zero:.0f} s [s]"


def _format_time_axis(
    figure: go.Figure, begin: float, end: float, zero: float, meta: Mapping[str, Any]
) -> go.Figure:
    """Label and range of the time axis, with UTC where the clock is absolute."""
    label = time_label(zero)
    figure.layout.meta["time"] = zero
    if meta.get("epoch"):
        start = utc(meta["epoch"], [zero])[0]
        label += f", from {str(start)[:19].replace('T', ' ')} UTC on"
        # figures.js writes UTC below the numbers
        figure.layout.meta["clock"] = int(start.astype("M8[ms]").astype(np.int64))
        figure.update_layout(margin_b=62)
    rows = max(
        (int(name[5:] or 1) for name in figure.layout if name.startswith("yaxis")), default=1
    )
    figure.update_xaxes(title_text=label, row=rows, col=1)
    title = {"text": "%{x:.2f} s"}
    return figure.update_xaxes(range=[begin - zero, end - zero], unifiedhovertitle=title)


def _add_marks(figure: go.Figure, shown: Sequence[ShownSolution], zero: float) -> go.Figure:
    """Shades and events of these solutions."""
    panel = {"xref": "x", "yref": "paper"}

    def upright(kind: str, start: float, stop: float, **style: Any) -> dict[str, Any]:
        return {
            "type": kind,
            "x0": start - zero,
            "x1": stop - zero,
            "y0": 0,
            "y1": 1,
            **panel,
            **style,
        }

    shades = dict.fromkeys(shade for one in shown for shade in _shades(one.solution))
    shapes = [
        upright("rect", start, stop, fillcolor=colour, line={"width": 0}, layer="below")
        for start, stop, colour in shades
    ]
    marked: dict[tuple[tuple[float, str], ...], str] = {}
    for one in shown:
        marked.setdefault(one.solution.events, one.colour)
    texts = []
    for events, colour in marked.items():
        colour = GREY if len(marked) == 1 else colour
        for number, (t, _) in enumerate(events[:MARKED], start=1):
            shapes.append(upright("line", t, t, line={"width": 1, "dash": "dot", "color": colour}))
            texts.append(
                {
                    "x": t - zero,
                    "y": 0,
                    **panel,
                    "text": str(number),
                    "showarrow": False,
                    "yanchor": "bottom",
                    "xanchor": "left",
                    "font": {"size": 10, "color": colour},
                }
            )
    return figure.update_layout(shapes=shapes, annotations=texts)


def _shades(solution: Solution) -> list[tuple[float, float, str]]:
    """[(start, stop, colour)] of what is shaded of a solution."""
    begin, end = float(solution.t[0]), float(solution.t[-1])
    withheld = [
        (max(start, begin), min(stop, end))
        for start, stop in solution.meta.get("withheld", ())
        if max(start, begin) < min(stop, end)
    ]
    told = [(start, stop, SHADES[status]) for start, stop, status in stretches(solution)]
    told += [(*window, WITHHELD) for window in withheld]
    return told + [
        (start, stop, OUTAGE)
        for start, stop in outages(solution)
        if not any(low < stop and start < high for low, high in withheld)
    ]


def outages(solution: Solution) -> list[tuple[float, float]]:
    """[(start, stop)] s without an accepted fix of the position for longer than OUTAGE_INTERVALS
    usual intervals, the longest first, at most MARKED; none of a solution without position, or
    where no fix was accepted."""
    fixes = solution.innovations
    intervals, used = [], []
    for i, name in enumerate(fixes.names):
        own = fixes.source == i
        if kind(solution, name) == "position" and own.sum() > 1:
            intervals.append(float(np.median(np.diff(fixes.t[own]))))
            used.append(fixes.t[own & fixes.accepted])
    if not len(solution.t) or not any(map(len, used)):
        return []
    edges = np.r_[solution.t[0], np.sort(np.concatenate(used)), solution.t[-1]]
    found = [
        (float(edges[i]), float(edges[i + 1]))
        for i in np.flatnonzero(np.diff(edges) > OUTAGE_INTERVALS * min(intervals))
    ]
    return sorted(found, key=lambda span: span[0] - span[1])[:MARKED]


def kind(solution: Solution, name: str) -> str:
    """The kind of measurement behind a source: the solution says it in `meta["kinds"]`; by default
    sources are named after it."""
    kinds: dict[str, str] = solution.meta.get("kinds", {})
    return kinds.get(name, name)


def stretches(solution: Solution) -> list[tuple[float, float, int]]:
    """[(start, stop, status)] of rows that are not VALID, the longest first, at most MARKED of each
    kind.

    A row covers the time since the one before it.
    """
    status, t = solution.status, solution.t
    edges = np.flatnonzero(np.diff(status, prepend=-1, append=-1)).tolist() if len(status) else []
    found = [
        (float(t[max(first - 1, 0)]), float(t[stop - 1]), int(status[first]))
        for first, stop in zip(edges[:-1], edges[1:])
        if status[first] in SHADES
    ]
    found.sort(key=lambda s: s[0] - s[1])
    return [s for status in SHADES for s in [f for f in found if f[2] == status][:MARKED]]


def about_mean(t: Array, values: Array, span: Array) -> Array:
    """Heights (n, 1) at times t less the mean of those that are known between the first and the
    last time of `span`."""
    known = values[(t >= span[0]) & (t <= span[-1]) & np.isfinite(values[:, 0])]
    return values - known.mean() if len(known) else values
