"""HTML cards for the cells of a notebook: a few lines, without script, readable on light and on
dark ground. Names from files are escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ...checks import DataError
from ...data.recording import Recording
from ...data.solution import Solution, Source, Trajectory
from ...data.verdict import DOUBTFUL, NOT_TO_BE_TRUSTED, TRUSTED, Verdict, together
from ...evaluation import metrics
from ...installation.findings import Diagnosis
from ...installation.states import EstimatedInstallation
from ...typing import Array
from ...units.time_scales import span
from ...units.wording import duration_text, join_words, number
from ..parts import bullet_list, numbered_list, table
from ..summary import fix_table

if TYPE_CHECKING:
    import pandas as pd

STYLE = """<style>
.strapdown-card { max-width: 62em; font: 14px/1.5 system-ui, sans-serif; color: inherit; }
.strapdown-card dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0 1.4em; margin: .3em 0; }
.strapdown-card dt { opacity: .7; font-weight: 400; }
.strapdown-card dd { margin: 0; overflow-wrap: anywhere; }
.strapdown-card .word { padding: 0 .6em; border-radius: 4px; background: #5c6773; color: #fff; }
.strapdown-card .right { background: #1a7f37; }
.strapdown-card .doubt { background: #8a5d00; }
.strapdown-card .wrong { background: #c01c28; }
.strapdown-card .scroll { overflow-x: auto; }
.strapdown-card table { border-collapse: collapse; margin: .4em 0; font-size: 14px; color: inherit; font-variant-numeric: tabular-nums; }
.strapdown-card th, .strapdown-card td { padding: .1em .8em; text-align: right; background: none; color: inherit; border: 0; border-bottom: 1px solid rgba(128, 128, 128, .4); }
.strapdown-card th:first-child, .strapdown-card td:first-child { text-align: left; padding-left: 0; }
.strapdown-card .best { font-weight: 700; }
.strapdown-card ul, .strapdown-card ol { margin: .3em 0; padding-left: 1.5em; }
</style>"""
LOOKS = {TRUSTED: "right", DOUBTFUL: "doubt", NOT_TO_BE_TRUSTED: "wrong"}
"""{word of a Verdict: class of its ground}."""
MAX_LINES = 12
"""So many notes or rows are shown; then how many more there are."""
USUAL_GAP = 3.0
"""Usual intervals between fixes beyond which there is a gap, and at least one second."""


def card(title: str, facts: Mapping[str, object] = {}, *parts: str, first: str = "") -> str:
    """HTML of a title, of {name: text or number} that is known, and of `parts`, which are HTML;
    `first` is HTML before the facts."""
    shown = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(str(text))}</dd>"
        for name, text in facts.items()
        if text not in ("", None)
    )
    head = f"<b>{escape(title)}</b>" if title else ""
    listed = f"<dl>{shown}</dl>" if shown else ""
    return f"{STYLE}<div class=strapdown-card>{head}{first}{listed}{''.join(parts)}</div>"


def lines(texts: Sequence[object]) -> str:
    """HTML of a list of texts, the first MAX_LINES of them."""
    return bullet_list(texts, "", MAX_LINES)


def frame(shown: pd.DataFrame) -> str:
    """HTML of a DataFrame, without its index; cells are escaped."""
    rows = shown.iloc[:MAX_LINES].itertuples(index=False)
    cells = ([number(cell) if isinstance(cell, float) else cell for cell in row] for row in rows)
    left = len(shown) - MAX_LINES
    return table(map(str, shown.columns), cells) + (
        f"<p>and {left} rows more</p>" if left > 0 else ""
    )


@singledispatch
def card_of(value: object) -> str:
    """HTML of a value."""
    raise TypeError(f"no card of a {type(value).__name__}")


@card_of.register(Diagnosis)
def of_diagnosis(diagnosis: Diagnosis) -> str:
    """A Diagnosis: its lines."""
    return card("Diagnosis", {}, lines(diagnosis.lines))


@card_of.register(EstimatedInstallation)
def of_installation(found: EstimatedInstallation) -> str:
    """An installation that a filter estimated: its lines."""
    return card("Estimated installation", {}, lines(found.lines))


@card_of.register(Verdict)
def of_verdict(verdict: Verdict) -> str:
    """A Verdict: its word, the reasons, what could not be tested."""
    return card("", {}, _verdict(verdict))


def _verdict(verdict: Verdict, whose: str = "") -> str:
    """HTML of a verdict inside a card."""
    name = f" {escape(whose)}" if whose else ""
    word = f"<span class='word {LOOKS.get(verdict.word, '')}'>{escape(verdict.word)}</span>{name}"
    untested = f"not tested: {'; '.join(map(str, verdict.untested))}" if verdict.untested else ""
    return f"<div>{word}{numbered_list(verdict.reasons)} {escape(untested)}</div>"


def of_verdicts(verdicts: Mapping[str, Verdict]) -> str:
    """HTML of the verdicts on {name: result} for a card; results that agree share theirs."""
    return "".join(_verdict(verdict, ", ".join(names)) for names, verdict in together(verdicts))


@card_of.register(Recording)
def of_recording(recording: Recording) -> str:
    """A Recording: what was measured, how long and how often, by which sources."""
    imu, reference, meta = recording.imu, recording.reference, recording.meta
    start, stop = recording.span
    moments = recording.utc
    facts = {
        "time": f"{start:.1f} to {stop:.1f} s, {duration_text(stop - start)}",
        "date": meta.get("date") if moments is None else span(moments),
        "IMU": ", ".join(
            filter(None, [f"{len(imu.t)} samples", rate(imu.t), grade_name(recording)])
        ),
        "gaps of the IMU": gaps(imu.t),
        "reference": "" if reference is None else _known_parts(reference),
    }
    rows = [[a.name or a.kind, a.kind, len(a.t), rate(a.t), gaps(a.t)] for a in recording.sources]
    sources = table(["source", "kind", "fixes", "rate", "gaps"], rows) if rows else ""
    notes = [*meta.get("notes", ())]
    return card(f"Recording {meta.get('name', '')}", facts, sources, lines(notes))


def grade_name(recording: Recording) -> str:
    """The name of the IMU of a recording, as far as it says one."""
    named = recording.meta.get("grade")
    return str(
        named.get("name", "") if isinstance(named, dict) else getattr(named, "name", named) or ""
    )


def rate(t: Array) -> str:
    """The usual rate of times t (n,), s; "" where there are too few."""
    return f"{1 / np.median(np.diff(t)):.4g} Hz" if len(t) > 2 else ""


def gaps(t: Array) -> str:
    """Number of intervals of times t (n,), s, are far beyond the usual one, and the longest."""
    steps = np.diff(t)
    if len(steps) < 2:
        return ""
    far = steps[steps > max(1.0, USUAL_GAP * float(np.median(steps)))]
    return f"{len(far)}, the longest {far.max():.3g} s" if len(far) else "none"


@card_of.register(Trajectory)
def of_trajectory(made: Trajectory) -> str:
    """A Trajectory: its times, and what is known in it."""
    return card("Trajectory", {"rows": len(made), "known": _known_parts(made)})


def _known_parts(made: Trajectory) -> str:
    """Return the known parts of a Trajectory, and its times."""
    parts = (("position", made.lla), ("velocity", made.v_n), ("attitude", made.q_nb))
    known = [name for name, part in parts if part is not None and np.isfinite(part).any()]
    when = f", {made.t[0]:.1f} to {made.t[-1]:.1f} s, {rate(made.t)}" if len(made) else ""
    return f"{join_words(known) or 'nothing'}{when}".rstrip(", ")


@card_of.register(Source)
def of_source(source: Source) -> str:
    """A source of fixes."""
    facts = {
        "kind": source.kind,
        "fixes": len(source.t),
        "time": f"{source.t[0]:.1f} to {source.t[-1]:.1f} s" if len(source.t) else "",
        "rate": rate(source.t),
        "gaps": gaps(source.t),
    }
    return card(f"Source {source.name or source.kind}", facts)


@card_of.register(Solution)
def of_solution(solution: Solution) -> str:
    """A Solution: verdict, time, where it ended and how sure, errors where its recording has a
    reference, fixes."""
    t, meta = solution.t, solution.meta
    facts = {
        "filter": f"{meta.get('filter', '')}{', smoothed' if meta.get('smoothed') else ''}",
        "time": f"{t[0]:.1f} to {t[-1]:.1f} s, {duration_text(t[-1] - t[0])}"
        if len(t)
        else "no rows",
        "date": "" if solution.utc is None else span(solution.utc),
        "rows": f"{len(t)}" + "".join(f", {share}" for share in _statuses(solution)),
        "at the end": _last(solution) if len(t) else "",
        "RMS error": _error(solution),
        "events": len(solution.events) or "",
    }
    title = f"Solution {meta.get('recording', '')}"
    return card(title, facts, fix_table({"": solution}), first=_verdict(solution.verdict))


def _statuses(solution: Solution) -> Iterable[str]:
    """Words on the rows that are not valid."""
    for status, word in ((1, "bridged"), (3, "doubtful"), (2, "not valid")):
        if rows := int((solution.status == status).sum()):
            yield f"{rows} {word}"


def _last(solution: Solution) -> str:
    """The last row, with the standard deviations that the filter claims."""
    last = solution.trajectory.take(slice(-1, None))
    std = np.full(15, np.nan) if last.std is None else last.std[0]
    parts = []
    if np.isfinite(last.lla[0]).all():
        lat, lon = np.degrees(last.lla[0, :2])
        parts.append(
            f"{lat:.7f}, {lon:.7f} deg ± {number(np.hypot(std[0], std[1]))} m, "
            f"height {last.lla[0, 2]:.2f} ± {number(std[2])} m"
        )
    if last.q_nb is not None and np.isfinite(last.q_nb).all():
        roll, pitch, heading = np.degrees(last.rph[0])
        parts.append(
            f"roll {roll:.2f}, pitch {pitch:.2f}, heading {heading:.2f} ± "
            f"{number(float(np.degrees(std[8])))} deg"
        )
    return "; ".join(parts)


def _error(solution: Solution) -> str:
    """RMS of its errors, where it was made of a recording with a reference."""
    reference = solution.recording.reference if solution.recording is not None else None
    if reference is None or not len(solution):
        return ""
    try:
        found = metrics.rms(metrics.errors(solution, reference))
    except DataError as error:
        return f"not known: {error}"
    parts = []
    if metrics.any_known(found.position):
        north, east, down = found.position
        parts.append(f"horizontal {number(np.hypot(north, east))} m, height {number(down)} m")
    if metrics.any_known(found.velocity):
        parts.append(f"velocity {number(float(np.linalg.norm(found.velocity)))} m/s")
    if metrics.any_known(found.angles):
        _, inclination, heading = np.degrees(found.angles)
        parts.append(f"inclination {number(inclination)} deg, heading {number(heading)} deg")
    return ", ".join(parts)
