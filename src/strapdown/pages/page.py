"""One self-contained HTML page of solutions: works offline, asks the network for nothing, and is
written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import plotly.graph_objects as go

from ..checks import DataError, check_type
from ..core.loop.contract import BRIDGED, DOUBTFUL, INVALID
from ..data.recording import Recording
from ..data.solution import Solution, Trajectory
from ..evaluation import metrics
from ..evaluation.metrics import Errors
from ..installation.states import estimated_installation
from ..io.solutions.solution_netcdf import plain
from ..units.time_scales import span
from . import summary
from .cards import cards
from .drawing import COLOURS, MARKED, OUTAGE, SHADES, WITHHELD, outages
from .figure_list import INSTALLATION, REGISTRY, SENSORS, Figure, figures_of_page
from .headline import headline
from .installation_figures import installation_table
from .map_figure import CAPTION, track_map
from .occasions import occasions
from .parts import around, bullet_list, fold, remarks
from .playback import playback_bar
from .sensor_figures import sensor_table
from .shell import MAP_POLICY, POLICY, Document, Page
from .verdict_block import verdict_block

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

FIRST_AFTER_TABLES = "Claimed uncertainty"
"""Section of figures before which the tables stand: track, errors and motion come first."""

Section: TypeAlias = "tuple[str, Sequence[tuple[go.Figure, str, str]]]"
"""Heading of a section of the page, and its figures, each with its heading and its caption."""


class Added(NamedTuple):
    """Parts of a page beside those of its solutions."""

    sections: Sequence[Section] = ()  # after the track
    facts: Mapping[str, str] = {}  # further lines below the title, {name: text}


NOTHING_ADDED = Added()


def report(
    solutions: Solution | list[Solution] | tuple[Solution, ...] | dict[str, Solution],
    reference: Trajectory | None = None,
    title: str | None = None,
    window: tuple[float, float] | None = None,
    added: Added = NOTHING_ADDED,
    recording: Recording | None = None,
    map: bool = False,
) -> Page:
    """Return a page about one solution, or several side by side.

    Parameters
    ----------
    solutions : Solution, list of Solution or dict
        {name: Solution} names them.
    reference : Trajectory, optional
        That errors are taken against.
    title : str, optional
        Heading of the page.
    window : (float, float), optional
        Start and stop, s, of the time over which errors are scored and error axes are framed.
    added : Added
        Further sections and facts.
    recording : Recording, optional
        Whose sensors are shown; by default that of the first solution, unless it was read from a file.
    map : bool
        Also the track on a street map, for which the page then asks the network; no other page does.

    Returns
    -------
    Page
        Whose `save` writes one file of HTML, and which shows itself in a notebook.

    Raises
    ------
    DataError
        Where there is no solution.

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", 60.0, seed=1)
    >>> page = sd.report(sd.fuse(recording), recording.reference)
    >>> page.html[:15]
    '<!DOCTYPE html>'
    """
    solutions = _name_solutions(solutions)
    check_type(reference, "reference", Trajectory | None, "a Trajectory, or None")
    if not solutions:
        raise DataError("a report needs a solution; none is given")
    scores, unscored = _scores(solutions, reference)
    first = next(iter(solutions.values()))
    positioned = any(solution.has_position for solution in solutions.values())
    document = Document(
        title or f"{first.meta.get('recording', 'Solution')}: {', '.join(solutions)}",
        _facts(solutions, window, added.facts),
        "".join(FOOTER if positioned else FOOTER[::2]),
        headline(solutions, scores, window),
        wide=len(solutions) > 1,
    )
    recording = recording or first.recording
    draw = _Drawer(document, solutions, reference if scores else None, scores, window, recording)
    drawn = track_map(solutions, draw.reference) if map else None
    on_map = document.place(drawn, "On a map", CAPTION)
    for name, text in _sections(draw, added.sections, unscored):
        opens = bool(text) and not document.sections
        document.add(name, on_map if opens else "", text, _key(solutions) if opens else "")
    of_reference = {name: estimated_installation(s).of_reference for name, s in solutions.items()}
    contradicted = summary.contradictions(scores, window, of_reference)
    verdicts = {name: solution.verdict for name, solution in solutions.items()}
    shown = cards(solutions, scores, window, contradicted)
    document.introduction = verdict_block(verdicts, contradicted) + shown
    policy = POLICY if drawn is None else MAP_POLICY
    return document.page(tuple(draw.notes), playback_bar(solutions), policy)


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
    every = solutions.values()
    there = set(np.concatenate([solution.status for solution in every]).tolist())
    rows = [
        (f"background:{SHADES[status]}", text)
        for status, text in (
            (BRIDGED, "gap bridged"),
            (DOUBTFUL, "doubtful"),
            (INVALID, "not valid"),
        )
        if status in there
    ]
    if any(map(outages, every)):
        rows.append((f"background:{OUTAGE}", "no position fix"))
    if any(solution.meta.get("withheld") for solution in every):
        rows.append((f"background:{WITHHELD}", "fixes withheld"))
    if any(solution.events for solution in every):
        first = f"; the first {MARKED} of {counts} are marked" if many else ""
        style = "border-left:1px dotted; width:4px; margin-left:6px"
        rows.append((style, f"event, numbered as in the list{first}"))
    return f"<p class='caption key'>{''.join(f'<span><b style={style!r}></b>{escape(text)}</span>' for style, text in rows)}<span class=hint>{ZOOM_HINT}</span></p>"


def _name_solutions(
    solutions: Solution | list[Solution] | tuple[Solution, ...] | dict[str, Solution],
) -> dict[str, Solution]:
    """{name: Solution} by filter, and whether it was smoothed; names that occur twice are
    numbered."""
    several = isinstance(solutions, (list, tuple, dict))
    for each in _solution_list(solutions):
        wanted = "a Solution, a list of them or {name: Solution}"
        check_type(each, "one of solutions" if several else "solutions", Solution, wanted)
    if isinstance(solutions, dict):
        return solutions
    named: dict[str, Solution] = {}
    for solution in _solution_list(solutions):
        base = f"{solution.meta.get('filter', 'solution')}{', smoothed' if solution.meta.get('smoothed') else ''}"
        name, count = base, 1
        while name in named:
            count += 1
            name = f"{base} {count}"
        named[name] = solution
    return named


def _solution_list(
    solutions: Solution | list[Solution] | tuple[Solution, ...] | dict[str, Solution],
) -> list[Solution]:
    if isinstance(solutions, dict):
        return list(solutions.values())
    return list(solutions) if isinstance(solutions, (list, tuple)) else [solutions]


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
            not metrics.any_known(part)
            for e in found.values()
            for part in (e.position, e.velocity, e.attitude)
        ):
            raise DataError("the reference knows nothing of what was estimated")
        return found, ""
    except DataError as error:
        return {}, remarks([f"Not scored: {error}"])


def _facts(
    solutions: Mapping[str, Solution], window: tuple[float, float] | None, more: Mapping[str, str]
) -> dict[str, str]:
    """Return the lines below the title: {name: text}."""
    metas = [solution.meta for solution in solutions.values()]
    first = next(iter(solutions.values()))
    return {
        "recording": _join_meta(metas, "recording"),
        "date": _join_meta(metas, "date"),
        "time": f"{first.t[0]:.1f} to {first.t[-1]:.1f} s" if len(first.t) else "",
        "clock": "" if first.utc is None or not len(first.t) else span(first.utc),
        "filter": ", ".join(solutions),
        "IMU": _imu(metas),
        "scored": f"{window[0]:.12g} to {window[1]:.12g} s" if window else "",
        **more,
    }


def _join_meta(metas: Sequence[Mapping[str, Any]], key: str) -> str:
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
    draw: _Drawer, more: Sequence[Section], unscored: str = ""
) -> Iterator[tuple[str, str]]:
    """(heading, HTML) of every section in reading order: those of the first figures, the tables, all
    other figures. `unscored` is a remark on the reference."""
    solutions, scores = draw.solutions, draw.scores
    figures = figures_of_page()
    for section in dict.fromkeys(figure.section for figure in figures):
        if section == FIRST_AFTER_TABLES:
            yield "Summary", unscored + _summary(solutions, scores, draw.window)
        shown = [text for figure in figures if figure.section == section and (text := draw(figure))]
        if section == "Track" and shown:
            pair = f"{shown[0]}<div>{''.join(shown[1:3])}</div>"
            shown = [f"<div class='grid pair'>{pair}</div>", *shown[3:]]
        if section == INSTALLATION and shown:
            shown.insert(0, installation_table(solutions))
        if section == SENSORS and shown:
            shown.insert(0, sensor_table(draw.recording))
        yield "Estimates" if section == "Motion" and not scores else section, "".join(shown)
        for heading, given in more if section == "Track" else ():
            yield heading, around("grid", *(draw.document.place(*each) for each in given))
    yield (
        "Details",
        "".join(
            f"<details><summary>{escape(name)}: how it was "
            f"made</summary><pre>{escape(_details(solution))}</pre></details>"
            for name, solution in solutions.items()
        ),
    )


def _details(solution: Solution) -> str:
    return json.dumps(
        plain({key: value for key, value in solution.meta.items() if key not in ("notes", "read")}),
        indent=2,
        ensure_ascii=False,
    )


def _summary(
    solutions: Mapping[str, Solution],
    scores: dict[str, Errors],
    window: tuple[float, float] | None,
) -> str:
    free = {name for name, solution in solutions.items() if not summary.heading_held(solution)}
    errors = summary.error_table(scores, window, free) if scores else ""
    parts = [
        summary.withheld_table(solutions, scores),
        fold("Errors by axis: RMS, largest, last", errors),
        fold("Fixes accepted and rejected", summary.fix_table(solutions)),
        fold("Why fixes were rejected", summary.rejection_table(solutions)),
        fold("Time, gaps and claimed standard deviations", summary.run_table(solutions)),
    ]
    metas = [solution.meta for solution in solutions.values()]
    told = {
        "Notes": [meta.get("notes", []) for meta in metas],
        "Read from the files": [meta.get("read", []) for meta in metas],
    }
    for heading, every in told.items():
        texts = list(dict.fromkeys(map(str, chain.from_iterable(every))))
        parts.append(fold(f"{heading} ({len(texts)})", bullet_list(texts)))
    parts.append(fold("Events, gaps and outages", occasions(solutions)))
    return "".join(parts)


class _Drawer:
    """Places figures on the page and numbers them."""

    def __init__(
        self,
        document: Document,
        solutions: dict[str, Solution],
        reference: Trajectory | None,
        scores: dict[str, Errors],
        window: tuple[float, float] | None,
        recording: Recording | None,
    ) -> None:
        self.document = document
        self.solutions, self.reference, self.recording = solutions, reference, recording
        self.scores, self.window = scores, window
        self.notes: list[str] = []  # on figures that could not be drawn

    def __call__(self, figure: Figure) -> str:
        """HTML of a Figure: one of all solutions, or one for each, side by side; the colour of a
        solution is the same everywhere."""
        if figure.together:
            return self._draw_figure(figure, self.solutions, list(self.solutions.values()))
        shown = []
        for i, (name, solution) in enumerate(self.solutions.items()):
            if not len(solution.t):
                continue
            colour = COLOURS[i % len(COLOURS)]
            mark = f"<span class=tag><i style='background:{colour}'></i>{escape(name)}</span>"
            tag = mark if len(self.solutions) > 1 else ""
            given = {"errors": self.scores.get(name), "colour": colour}
            shown.append(self._draw_figure(figure, solution, [solution], given, tag))
        return around("grid", *shown)

    def _draw_figure(
        self,
        figure: Figure,
        subject: Solution | dict[str, Solution],
        shown: list[Solution],
        given: Mapping[str, Any] = {},
        tag: str = "",
    ) -> str:
        """HTML of what a Figure draws of `subject`; where it raises, a line that says so."""
        known = {
            **given,
            "scores": self.scores,
            "window": self.window,
            "recording": self.recording,
            "solutions": self.solutions,
        }
        try:
            taken = {name: known[name] for name in figure.takes}
            made = figure.draw(subject, self.reference, **taken)
            if made is None:
                return ""
            if not isinstance(made, go.Figure):
                raise TypeError(f"it drew {made!r}, which is no plotly Figure")
            title, caption = (
                text if isinstance(text, str) else text(about)
                for text, about in (
                    (figure.title, list(self.solutions.values())),
                    (figure.caption, shown),
                )
            )
            return self.document.place(made, title, caption, tag)
        # whatever a user's own figure does, the page is not lost
        except (Exception, SystemExit) as error:
            why, plugin = " ".join(str(error).split()), REGISTRY.brought_by(figure.name)
            whose = f"plugin {plugin.name}: " if plugin else ""
            self.notes.append(
                f"{whose}figure {figure.name!r} is left out: {type(error).__name__}: {why}"
            )
            return remarks(self.notes[-1:])
