"""One glance: what was recorded and how good what was made of it is, in a few cards."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from html import escape

import numpy as np

from ..core.loop.contract import BRIDGED, INVALID, VALID
from ..data.solution import Solution
from ..evaluation.metrics import Errors
from ..geometry.geodesy import displacement
from ..typing import Array
from ..units.time_scales import utc
from ..units.wording import count_text, duration_text, metres, number
from .drawing import outages
from .headline import KeyFigure, key_figures
from .parts import paragraphs
from .verdict_block import verdict_text


def cards(
    solutions: Mapping[str, Solution],
    scores: Mapping[str, Errors],
    window: tuple[float, float] | None = None,
    contradicted: Collection[str] = (),
) -> str:
    """HTML: one card on what was recorded, and one on each of {name: Solution}; `scores` are its
    metrics.Errors where there is a reference, RMS over `window` in s; `contradicted` are the names of
    those whose claims it contradicts."""
    shown = [_card("Recorded", *_recording_card(next(iter(solutions.values()))))] + [
        _card(name, *_verdict_card(solution, scores.get(name), window, name in contradicted))
        for name, solution in solutions.items()
    ]
    return f"<div class=cards>{''.join(shown)}</div>"


def _card(heading: str, large: str, lines: list[str]) -> str:
    said = paragraphs([large], "large") + paragraphs(filter(None, lines))
    return f"<div><h3>{escape(heading)}</h3>{said}</div>"


def _recording_card(solution: Solution) -> tuple[str, list[str]]:
    """Duration and distance, date and sensors."""
    if not len(solution.t):
        return "nothing", ["The solution has no rows."]
    large = duration_text(float(solution.t[-1] - solution.t[0]))
    if solution.has_position:
        large += f", {metres(_length(solution.trajectory.lla))}"
    day = ""
    if epoch := solution.meta.get("epoch"):
        begin = utc(epoch, solution.t[:1])[0]
        day = f"{str(begin)[:19].replace('T', ' ')} UTC"
    rate = ""
    if solution.recording is not None:
        rate = f"IMU at {1 / float(np.median(solution.recording.imu.dt)):.4g} Hz"
    sources = [
        f"{name}: {sum(solution.counts()[name])} fixes" for name in solution.innovations.names
    ]
    return large, [day or str(solution.meta.get("date") or ""), rate, "; ".join(sources)]


def _verdict_card(
    solution: Solution,
    e: Errors | None,
    window: tuple[float, float] | None,
    contradicted: bool,
) -> tuple[str, list[str]]:
    """The first of its key figures in large, the others; fixes taken, time without them."""
    figures = key_figures(solution, e, window)
    if not figures:
        return verdict_text(solution.verdict, contradicted), []
    parts = [_claim_text(figures[0]), *map(_figure_text, figures[1:])]
    taken = sum(good for good, _ in solution.counts().values())
    all_fixes = sum(map(sum, solution.counts().values()))
    accepted = f"{100 * taken / all_fixes:.3g} % of {all_fixes} fixes accepted" if all_fixes else ""
    parts.append("; ".join(filter(None, [accepted, _lacks(solution)])))
    return _large_text(figures[0]), parts


def _large_text(figure: KeyFigure) -> str:
    """The error, or where none is known what is claimed."""
    if np.isfinite(figure.error):
        return f"{number(figure.error)} {figure.unit} RMS {figure.name} error"
    return f"{number(figure.claimed)} {figure.unit} {figure.name}, claimed"


def _claim_text(figure: KeyFigure) -> str:
    """The claim beside an error; "" where that is all there is."""
    both = np.isfinite([figure.error, figure.claimed]).all()
    return f"claimed {number(figure.claimed)} {figure.unit}" if both else ""


def _figure_text(figure: KeyFigure) -> str:
    return ", ".join(filter(None, [_large_text(figure), _claim_text(figure)]))


def _lacks(solution: Solution) -> str:
    """Time without position fixes, over gaps and not valid; "no gap, no outage" of a whole one."""
    said = []
    if spans := outages(solution):
        longest = max(stop - start for start, stop in spans)
        said.append(f"{count_text(len(spans), 'outage')}, the longest {duration_text(longest)}")
    for status, word in ((BRIDGED, "over gaps"), (INVALID, "not valid")):
        if (solution.status == status).any():
            said.append(f"{duration_text(solution.seconds(status))} {word}")
    return ", ".join(said) or ("no gap, no outage" if (solution.status == VALID).all() else "")


def _length(lla: Array) -> float:
    """m along the known positions (n, 3), by steps of a 2000th of them, so that noise adds little."""
    known = lla[np.isfinite(lla).all(axis=1)]
    steps = known[:: max(len(known) // 2000, 1)]
    moved = displacement(steps[1:], steps[:-1])
    return float(np.linalg.norm(moved, axis=1).sum())
