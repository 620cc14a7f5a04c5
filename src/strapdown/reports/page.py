"""One self-contained HTML page of solutions: works offline, asks the network for nothing, and is
written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from typing import Any, TypeAlias

import plotly.graph_objects as go

from .. import __version__
from ..checks import DataError
from ..core.contract import BRIDGED, INVALID
from ..data import Solution, Trajectory
from ..evaluation import metrics
from ..evaluation.metrics import Errors
from ..io.solution import plain
from . import figures, fix_figures, summary
from .drawing import COLOURS, MARKED, SHADES, WITHHELD
from .shell import Page, listed, placed, shell

FOOTER = (
    "Errors are true − estimate.",
    " Position, velocity and their errors are in metres and m/s along north, east, down; heights "
    "are above the "
    "WGS-84 ellipsoid.",
    " Lines of more than 2000 points keep the extremes of each stretch.",
)
ZOOM_HINT = (
    "Drag to zoom, double-click to go back (again: to see all), click the legend to hide a line."
)

Section: TypeAlias = "tuple[str, Sequence[tuple[go.Figure, str, str]]]"
"""Heading of a section of the page, and its figures, each with its heading and its caption."""

Caption: TypeAlias = str | Callable[[Solution], str]
ErrorFigure: TypeAlias = (
    "Callable[[Solution, Errors, str, tuple[float, float] | None], go.Figure | None]"
)


def report(
    solutions: Solution | list[Solution] | tuple[Solution, ...] | dict[str, Solution],
    reference: Trajectory | None = None,
    title: str | None = None,
    window: tuple[float, float] | None = None,
    more: Sequence[Section] = (),
    facts: Mapping[str, str] = {},
) -> Page:
    """A Page about one Solution, or several of them (a list, or {name: Solution}) side by side.

    reference: Trajectory that errors are taken against. window: (start, stop) in s over which
    errors are scored and error axes are framed. more: further sections after the track, [(heading,
    [(figure, its heading, caption), ...])]. facts: further lines below the title, {name: text}.
    """
    solutions = _named(solutions)
    scores, unscored = _scores(solutions, reference)
    first = next(iter(solutions.values()))
    title = title or f"{first.meta.get('recording', 'Solution')}: {', '.join(solutions)}"
    sections = [
        (name, text)
        for name, text in _sections(solutions, reference if scores else None, scores, window, more)
        if text
    ]
    sections[0] = "Summary", unscored + sections[0][1]
    sections[1] = sections[1][0], _key(solutions) + sections[1][1]
    footer = "".join(
        FOOTER if any(solution.has_position for solution in solutions.values()) else FOOTER[::2]
    )
    return shell(
        title, listed(_facts(solutions, window, facts)), sections, footer, wide=len(solutions) > 1
    )


def _key(solutions: Mapping[str, Solution]) -> str:
    """HTML of what the shades and dotted lines of the figures mean; where not all events are
    marked, how many are."""
    many = {
        name: len(solution.events)
        for name, solution in solutions.items()
        if len(solution.events) > MARKED
    }
    counts = ", ".join(
        f"{count} events{f' of {name}' if len(solutions) > 1 else ''}"
        for name, count in many.items()
    )
    rows = [
        (f"background:{SHADES[BRIDGED]}", "gap bridged"),
        (f"background:{SHADES[INVALID]}", "not valid"),
        *(
            [(f"background:{WITHHELD}", "fixes withheld")]
            if any(solution.meta.get("withheld") for solution in solutions.values())
            else []
        ),
        (
            "border-left:1px dotted; width:4px; margin-left:6px",
            f"event, numbered as in the "
            f"list{f'; the first {MARKED} of {counts} are marked' if many else ''}",
        ),
    ]
    return f"<p class='caption key'>{''.join(f'<span><b style={style!r}></b>{escape(text)}</span>' for style, text in rows)}<span>{ZOOM_HINT}</span></p>"


def _named(
    solutions: Solution | list[Solution] | tuple[Solution, ...] | dict[str, Solution],
) -> dict[str, Solution]:
    """{name: Solution} by filter, and whether it was smoothed; names that occur twice are
    numbered."""
    if isinstance(solutions, dict):
        return solutions
    named = {}
    for solution in solutions if isinstance(solutions, (list, tuple)) else [solutions]:
        base = f"{solution.meta.get('filter', 'solution')}{', smoothed' if solution.meta.get('smoothed') else ''}"
        name, count = base, 1
        while name in named:
            count += 1
            name = f"{base} {count}"
        named[name] = solution
    return named


def _scores(
    solutions: Mapping[str, Solution], reference: Trajectory | None
) -> tuple[dict[str, Errors], str]:
    """{name: Errors} and "", or {} and a remark where the reference does not cover all solutions
    or knows nothing of what they estimate."""
    if reference is None:
        return {}, ""
    try:
        found = {name: metrics.errors(solution, reference) for name, solution in solutions.items()}
        if all(
            part is None for e in found.values() for part in (e.position, e.velocity, e.attitude)
        ):
            raise DataError("the reference knows nothing of what was estimated")
        return found, ""
    except DataError as error:
        return {}, f"<p class=note>Not scored: {escape(str(error))}</p>"


def _facts(
    solutions: Mapping[str, Solution], window: tuple[float, float] | None, more: Mapping[str, str]
) -> dict[str, str]:
    """What stands below the title: {name: text}."""
    metas = [solution.meta for solution in solutions.values()]
    first = next(iter(solutions.values()))
    return {
        "recording": _said(metas, "recording"),
        "date": _said(metas, "date"),
        "time": f"{first.t[0]:.1f} to {first.t[-1]:.1f} s",
        "filter": ", ".join(solutions),
        "IMU": _imu(metas),
        "scored": f"{window[0]:.12g} to {window[1]:.12g} s" if window else "",
        **more,
        "software": f"strapdown {__version__}",
        "written": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
    }


def _said(metas: Sequence[Mapping[str, Any]], key: str) -> str:
    return ", ".join(
        dict.fromkeys(str(meta[key]) for meta in metas if meta.get(key) not in (None, ""))
    )


def _imu(metas: Sequence[Mapping[str, Any]]) -> str:
    names = (meta.get("imu") for meta in metas)
    named = (
        imu.get("name", "") if isinstance(imu, dict) else getattr(imu, "name", imu)
        for imu in names
        if imu
    )
    return ", ".join(dict.fromkeys(map(str, named)))


def _sections(
    solutions: Mapping[str, Solution],
    reference: Trajectory | None,
    scores: dict[str, Errors],
    window: tuple[float, float] | None,
    more: Sequence[Section],
) -> Iterator[tuple[str, str]]:
    """(heading, HTML) of every section in reading order."""
    draw = _Drawer(solutions)
    yield "Summary", _summary(solutions, scores, window)
    yield "Track", _overview(draw, solutions, reference, scores)
    for heading, shown in more:
        yield heading, f"<div class=grid>{''.join(draw.place(*each) for each in shown)}</div>"
    if scores:
        yield "Errors", _errors(draw, scores, window)
    yield ("Motion" if scores else "Estimates"), _motion(draw, reference)
    yield (
        "Claimed uncertainty",
        draw.each(
            f"3σ of {_claimed(solutions)}",
            "Logarithmic axes: it falls with aiding and grows without.",
            lambda name, s, _: figures.sigma(s),
        ),
    )
    axes = "In body axes, forward, right, down"
    yield (
        "Biases",
        draw.each(
            "Accelerometer bias",
            _banded(slice(9, 12), ", with ±3σ", axes, "."),
            lambda name, s, colour: figures.accel_bias(s, colour),
        )
        + draw.each(
            "Gyro bias",
            _banded(slice(12, 15), ", with ±3σ", axes, "."),
            lambda name, s, colour: figures.gyro_bias(s, colour),
        ),
    )
    yield (
        "Fixes",
        draw.each(
            "Innovations",
            "Fix − estimate: around zero and without pattern when all is well.",
            lambda name, s, _: fix_figures.innovations(s),
        )
        + draw.each(
            "Normalised innovation squared",
            "A fix above the gate is rejected.",
            lambda name, s, _: fix_figures.nis(s),
        ),
    )
    yield (
        "Filter columns",
        draw.each(
            "Columns of the filter",
            "What this filter publishes besides the navigation state.",
            lambda name, s, colour: figures.extra(s, colour),
        ),
    )
    yield (
        "Details",
        "".join(
            f"<details><summary>{escape(name)}: how it was "
            f"made</summary><pre>{escape(_details(solution))}</pre></details>"
            for name, solution in solutions.items()
        ),
    )


def _banded(
    states: slice, claimed: str, before: str = "", after: str = ""
) -> Callable[[Solution], str]:
    """A caption as function of the Solution it is for: with the words on the band where the
    filter claims standard deviations of those states."""
    return lambda solution: (
        before
        + (claimed if metrics.any_known(summary.claimed_sd(solution)[:, states]) else "")
        + after
    )


def _claimed(solutions: Mapping[str, Solution]) -> str:
    parts = (
        ("position", slice(0, 2)),
        ("height", 2),
        ("velocity", slice(3, 6)),
        ("attitude", slice(6, 9)),
    )
    known = [
        name
        for name, states in parts
        if any(
            metrics.any_known(summary.claimed_sd(solution)[:, states])
            for solution in solutions.values()
        )
    ]
    return ", ".join(name for name in known if name != "height" or "position" not in known)


def _overview(
    draw: _Drawer,
    solutions: Mapping[str, Solution],
    reference: Trajectory | None,
    scores: dict[str, Errors],
) -> str:
    if not any(solution.has_position for solution in solutions.values()):
        return ""
    seen = draw.place(
        figures.track(solutions, reference),
        "Seen from above",
        "Dots are position fixes: the estimate plus its innovation.",
    )
    beside = draw.place(
        figures.height(solutions, reference), "Height", "Above the WGS-84 ellipsoid."
    )
    claimed = any(
        metrics.any_known(summary.claimed_sd(solution)[:, :2]) for solution in solutions.values()
    )
    if scores and (horizontal := figures.horizontal(solutions, scores)):
        beside += draw.place(
            horizontal,
            "Horizontal error",
            "It should stay below what the filter claims." if claimed else "",
        )
    return f"<div class='grid pair'>{seen}<div>{beside}</div></div>"


def _errors(draw: _Drawer, scores: dict[str, Errors], window: tuple[float, float] | None) -> str:
    shown: list[tuple[str, Caption, ErrorFigure, str]] = [
        (
            "Position error",
            _banded(slice(0, 3), "With the ±3σ band that the filter claims."),
            figures.position,
            "position",
        ),
        (
            "Velocity error",
            _banded(slice(3, 6), "With its ±3σ band."),
            figures.velocity,
            "velocity",
        ),
        (
            "Attitude error",
            _banded(
                slice(6, 9),
                "; ±3σ bands from the rotation vector, correlations neglected",
                "Heading wrapped to ±180 deg",
                ".",
            ),
            figures.attitude,
            "attitude",
        ),
    ]
    if not all(metrics.any_known(e.horizontal) for e in scores.values()):
        shown.append(
            (
                "Angle of the attitude error",
                "Of the whole rotation, of the vertical, and about it: without signs, and alike in "
                "every attitude.",
                figures.attitude_angles,
                "attitude",
            )
        )
    return "".join(
        draw.each(
            heading,
            caption,
            lambda name, s, colour: (
                figure(s, scores[name], colour, window)
                if getattr(scores[name], part) is not None
                else None
            ),
        )
        for heading, caption, figure, part in shown
    )


def _motion(draw: _Drawer, reference: Trajectory | None) -> str:
    position = (
        ""
        if reference is not None
        else draw.each(
            "Position",
            _banded(slice(0, 3), ", with ±3σ", "North and east from the start, and height", "."),
            lambda name, s, colour: figures.position(s, None, colour) if s.has_position else None,
        )
    )
    heave = draw.each(
        "Heave",
        _banded(
            slice(2, 3),
            ", with ±3σ",
            "Height, upwards, about its mean",
            "; a reference about its own.",
        ),
        lambda name, s, colour: figures.heave(s, colour, reference),
    )
    return (
        position
        + heave
        + draw.each(
            "Velocity",
            _banded(slice(3, 6), "With ±3σ."),
            lambda name, s, colour: figures.velocity(s, None, colour, compare=reference),
        )
        + draw.each(
            "Attitude",
            _banded(slice(6, 9), "; with ±3σ", "Heading is clockwise from north", "."),
            lambda name, s, colour: figures.attitude(s, None, colour, compare=reference),
        )
    )


def _details(solution: Solution) -> str:
    return json.dumps(
        plain({key: value for key, value in solution.meta.items() if key != "notes"}),
        indent=2,
        ensure_ascii=False,
    )


def _summary(
    solutions: Mapping[str, Solution],
    scores: dict[str, Errors],
    window: tuple[float, float] | None,
) -> str:
    free = {name for name, solution in solutions.items() if not summary.heading_held(solution)}
    tables = [summary.error_table(scores, window, free)] if scores else []
    parts = [
        "<div class=tables>",
        *tables,
        "<div>",
        summary.run_table(solutions),
        summary.fix_table(solutions),
        "</div></div>",
        summary.beyond(scores, window),
    ]
    parts += [summary.withheld_table(solutions, scores)]
    notes = list(
        dict.fromkeys(
            str(note) for solution in solutions.values() for note in solution.meta.get("notes", ())
        )
    )
    parts += ["<h3>Notes</h3>", summary.listing(notes)] if notes else []
    same: dict[tuple[str, ...], list[str]] = {}
    for name, solution in solutions.items():
        same.setdefault(tuple(f"{t:.2f} s: {text}" for t, text in solution.events), []).append(name)
    for events, names in same.items():
        if events:
            whose = f" of {escape(', '.join(names))}" if len(names) < len(solutions) else ""
            parts += [f"<h3>Events{whose}</h3>", summary.listing(events, ordered=True)]
    return "".join(parts)


class _Drawer:
    """Places figures on the page and numbers them."""

    def __init__(self, solutions: Mapping[str, Solution]) -> None:
        self.solutions, self.count = solutions, 0

    def each(
        self,
        heading: str,
        caption: Caption,
        make: Callable[[str, Solution, str], go.Figure | None],
    ) -> str:
        """One figure per solution, side by side, made by make(name, solution, colour); the colour
        of a solution is the same everywhere.

        caption: text, or a function of the Solution that gives it.
        """
        shown = []
        for i, (name, solution) in enumerate(self.solutions.items()):
            colour = COLOURS[i % len(COLOURS)]
            figure = make(name, solution, colour)
            if figure is not None:
                tag = (
                    f"<span class=tag><i style='background:{colour}'></i>{escape(name)}</span>"
                    if len(self.solutions) > 1
                    else ""
                )
                shown.append(
                    self.place(
                        figure, heading, caption(solution) if callable(caption) else caption, tag
                    )
                )
        return f"<div class=grid>{''.join(shown)}</div>" if shown else ""

    def place(self, figure: go.Figure, heading: str, caption: str, tag: str = "") -> str:
        """HTML of one figure."""
        self.count += 1
        return placed(self.count, figure, heading, caption, tag)
