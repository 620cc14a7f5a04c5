"""The pictures of the ranking: one for each question, every package a row, every case a dot."""

from html import escape

import numpy as np
import ranking_scores as scores

WIDE, LEFT, TOP, ROW = 760, 230, 58, 34
"""px: of the picture, of the names, above the first row, of a row."""
INK, GREY, GRID, OWN_COLOUR, COLOUR = "#1f2933", "#6b7785", "#e4e8ec", "#d55e00", "#0072b2"
SHOWN = 1.0, 100.0
"""Ratios to the best of a case that the axis holds; what is beyond stands at its end."""


def draw(found, folder):
    """Write ranking-errors.svg, ranking-honesty.svg and ranking-time.svg into `folder`."""
    filters = [
        name for name in next(iter(found.values())) if "smooth" not in name and "batch" not in name
    ]
    errors, honesty, time = ({name: [] for name in filters} for _ in range(3))
    for runs in found.values():
        ran = {name: run for name, run in runs.items() if name in filters and "stopped" not in run}
        for rows, figure in ((errors, _error), (time, lambda run: run["us"])):
            _ratios(rows, {name: figure(run) for name, run in ran.items()})
        for name, run in ran.items():
            honesty[name].append(float(np.sqrt(np.mean(_outage(run)["scaled"]))))
    pictures = {
        "ranking-errors.svg": (errors, "Position error in outages, over the smallest of the case"),
        "ranking-honesty.svg": (
            honesty,
            "Position error over the claimed standard deviation, in outages",
        ),
        "ranking-time.svg": (time, "Time for a sample, over the shortest of the case"),
    }
    for name, (rows, title) in pictures.items():
        span = (0.3, 30.0) if "honesty" in name else (1.0, 10_000.0) if "time" in name else SHOWN
        (folder / name).write_text(picture(rows, title, span), encoding="utf-8")


def _outage(run):
    return run["scores"]["in outages"]["position"]


def _error(run):
    return scores.size(_outage(run)["square"])


def _ratios(rows, values):
    """Add each value over the smallest of them to its row."""
    known = {name: value for name, value in values.items() if np.isfinite(value)}
    for name, value in known.items():
        rows[name].append(value / min(known.values()))


def picture(rows, title, span):
    """The SVG of dots on a logarithmic axis; {name: values}."""
    high = TOP + ROW * len(rows) + 44
    at = lambda value: (
        LEFT
        + (WIDE - LEFT - 30) * np.log(np.clip(value, *span) / span[0]) / np.log(span[1] / span[0])
    )
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {high}" font-family="sans-serif" font-size="13">',
        f'<rect width="{WIDE}" height="{high}" fill="white"/>',
        f'<text x="16" y="26" font-size="16" font-weight="600" fill="{INK}">{escape(title)}</text>',
    ]
    bottom = TOP + ROW * len(rows)
    for tick in _ticks(span):
        x = at(tick)
        parts.append(
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 8}" y2="{bottom}" stroke="{INK if tick == 1 else GRID}"/>'
        )
        parts.append(
            f'<text x="{x:.1f}" y="{bottom + 18}" text-anchor="middle" fill="{GREY}">{tick:g}</text>'
        )
    parts.append(
        f'<text x="{(LEFT + WIDE) / 2:.0f}" y="{bottom + 36}" text-anchor="middle" fill="{GREY}">ratio (logarithmic axis); the bar is the median, dots at the edge lie beyond it</text>'
    )
    for i, (name, values) in enumerate(rows.items()):
        y, colour = TOP + ROW * (i + 0.5), OWN_COLOUR if name.startswith("strapdown") else COLOUR
        parts.append(f'<text x="16" y="{y + 4:.1f}" fill="{INK}">{escape(name)}</text>')
        for k, value in enumerate(values):
            parts.append(
                f'<circle cx="{at(value):.1f}" cy="{y + (k % 5 - 2) * 3:.1f}" r="3" fill="{colour}" fill-opacity="0.55"/>'
            )
        if values:
            x = at(np.median(values))
            parts.append(
                f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{y - 13:.1f}" y2="{y + 13:.1f}" stroke="{INK}" stroke-width="2.5"/>'
            )
    return "\n".join([*parts, "</svg>"]) + "\n"


def _ticks(span):
    marks = np.outer(10.0 ** np.arange(-1, 5), [1, 3]).ravel()
    return [float(f"{tick:g}") for tick in marks if span[0] <= tick <= span[1]]
