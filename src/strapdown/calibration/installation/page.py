"""The page of an installation: the table, innovations and NIS of each source as given and as found,
and the misfit over each parameter that was found."""

from dataclasses import replace
from html import escape
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go

from ...data.recording import Recording
from ...data.solution import Solution
from ...engine.batch import fuse
from ...engine.sensitivity import MAX_NIS
from ...installation.findings import NOT_OBSERVABLE
from ...installation.model import apply_constants, constants
from ...pages.drawing import COLOURS, GREY, finish, line, note, origin, panels, time_label
from ...pages.parts import bullet_list, paragraphs, remarks, table
from ...pages.shell import Document, Page
from ...units.constants import NORMAL_95
from ...units.wording import count_text, join_words
from .iterated import theta_of

if TYPE_CHECKING:
    from .findings import CalibratedParameter, Installation

STEPS = (-6.0, -4.0, -3.0, -2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Standard deviations from what was found, of the runs that draw a misfit."""
SMOOTHED = 10.0
"""s over which the NIS is averaged."""
DRAWN = {"as given": GREY, "as found": COLOURS[0]}
FOOTER = "change = what is to be added to what was given. The 95 % interval holds two estimates."


def page(found: "Installation") -> Page:
    """The Page of an Installation. Raises DataError."""
    solutions = {
        "as given": _fuse_found(found, found.given),
        "as found": _fuse_found(found, found.recording),
    }
    t = found.given.imu.t
    document = Document(
        "Calibration of the installation",
        {
            "recording": found.given.meta.get("name", ""),
            "time": f"{t[0]:.1f} to {t[-1]:.1f} s",
            "runs of the filter": str(found.runs),
        },
        FOOTER,
        _headline(found),
    )
    document.add(
        "Before and after",
        document.place(innovations_figure(solutions), "Whitened innovations"),
        document.place(nis_figure(solutions), "NIS"),
        *(
            document.place(misfit_figure(found, each), f"Misfit: {each.name}")
            for each in found.found
        ),
    )
    document.add("Parameters", _table(found))
    return document.page()


def _headline(found: "Installation") -> str:
    """The parameters that are off, or that the data agree with what was given."""
    tried = [each for each in found.parameters if each.status != NOT_OBSERVABLE]
    untold = len(found.parameters) - len(tried)
    rest = f" The motion does not show {count_text(untold, 'further parameter')}." * bool(untold)
    off = [f"{each.name} by {each.seen}" for each in found.found]
    unsure = [f"{each.name} ({each.status})" for each in found.unsure]
    if off:
        doubt = f" Not written, because of {join_words(unsure)}." if unsure else ""
        return f"Off from what was given: {join_words(off)}.{doubt}{rest}"
    if unsure:
        return f"Nothing is changed: {join_words(unsure)}.{rest}"
    if not tried:
        return f"The motion shows none of {count_text(untold, 'parameter')}: nothing was tested."
    return f"What was given agrees with the data in all {count_text(len(tried), 'parameter')} that they show.{rest}"


def _fuse_found(found: "Installation", recording: Recording) -> Solution:
    asking = found.asking
    return fuse(
        recording,
        asking.filter,
        options=asking.options,
        every=100,
        **asking.set_up,
    )


def _table(found: "Installation") -> str:
    """HTML of the parameters, the notes and the lines that change."""
    header = (
        "parameter",
        "unit",
        "change",
        "std",
        "as a state",
        "std",
        "status",
        "to show it",
    )

    def format_signed(value: float) -> str:
        return f"{value:+.4f}" if np.isfinite(value) else ""

    rows = [
        (
            each.name,
            each.unit,
            format_signed(each.change),
            format_signed(each.std).lstrip("+"),
            format_signed(each.by_states),
            format_signed(each.states_std).lstrip("+"),
            each.status,
            each.motion,
        )
        for each in found.parameters
    ]
    said = remarks(found.lines[len(found.parameters) :])
    return table(header, rows, "last") + said + _changes_html(found)


def _changes_html(found: "Installation") -> str:
    """HTML of which file was written, or else of what to change."""
    if found.written:
        return paragraphs(
            f"Written: {path}; the old file is {kept}." for path, kept in found.written.items()
        )
    changes = bullet_list(found.changes or ("nothing",), "")
    return paragraphs(["To change in recording.toml:"]) + changes


def _sources(solution: Solution) -> list[int]:
    """Those of which something was measured."""
    made = solution.innovations
    return [int(s) for s in np.unique(made.source[np.isfinite(made.nis)])]


def innovations_figure(solutions: dict[str, Solution]) -> go.Figure:
    """Whitened innovations of each source over time: of each fix the component of the largest
    size."""
    first = next(iter(solutions.values()))
    sources, names = _sources(first), first.innovations.names
    drawn, zero = panels([f"{_wrap_name(names[s])} [std]" for s in sources], 160), origin(first.t)
    for label, solution in solutions.items():
        made = solution.innovations
        assert made.whitened is not None  # as of all that was not read from a file
        for row, s in enumerate(sources, 1):
            of = (made.source == s) & np.isfinite(made.whitened).any(axis=1)
            values = np.nan_to_num(made.whitened[of])
            largest = values[np.arange(len(values)), np.abs(values).argmax(axis=1)]
            # no line where nothing was measured
            t = made.t[of] - zero
            gaps = 1 + np.flatnonzero(np.diff(t) > 10 * np.median(np.diff(t)))
            t, largest = np.insert(t, gaps, t[gaps]), np.insert(largest, gaps, np.nan)
            line(drawn, t, largest, label, DRAWN[label], row)
    drawn.update_xaxes(title_text=time_label(zero), row=len(sources), col=1)
    note(
        drawn,
        "Of each fix the component of the largest size. Of a right set-up nearly all are within "
        "4 standard deviations, without a pattern.",
    )
    return drawn


def nis_figure(solutions: dict[str, Solution]) -> go.Figure:
    """Mean NIS of each source over time, as a share of what is expected."""
    first = next(iter(solutions.values()))
    sources, names = _sources(first), first.innovations.names
    drawn, zero = (
        panels([f"{_wrap_name(names[s])} [-]" for s in sources], 160, log=True),
        origin(first.t),
    )
    for label, solution in solutions.items():
        made = solution.innovations
        for row, s in enumerate(sources, 1):
            of = (made.source == s) & np.isfinite(made.nis)
            expected = np.isfinite(made.innovation[of]).sum(axis=1).mean()
            t, nis = made.t[of], made.nis[of] / expected
            block = np.floor((t - t[0]) / SMOOTHED).astype(int)
            count = np.bincount(block)
            mean = np.where(count, np.bincount(block, nis) / np.maximum(count, 1), np.nan)
            centre = t[0] + (np.arange(len(count)) + 0.5) * SMOOTHED
            line(drawn, centre - zero, mean, label, DRAWN[label], row)
            drawn.add_hline(y=1.0, line={"color": COLOURS[1], "width": 1, "dash": "dash"}, row=row)
    drawn.update_xaxes(title_text=time_label(zero), row=len(sources), col=1)
    note(
        drawn,
        f"Mean over {SMOOTHED:.0f} s, over what is expected of a right filter (dashed: 1). Below 1 "
        "the stated standard deviations are large.",
    )
    return drawn


def _wrap_name(name: str) -> str:
    """A name in lines that fit beside a panel."""
    return "<br>".join(escape(part) for part in wrap(name, 16))


def misfit_figure(found: "Installation", each: "CalibratedParameter") -> go.Figure:
    """The sum of min(NIS, 30) of whole runs with one parameter moved, all others as found, over
    the smallest of them."""
    known = constants(found.given.sources)
    values = each.change + np.array(STEPS) * each.std
    costs = []
    for value in values:
        theta = theta_of(
            known,
            found.given,
            [other if other is not each else replace(each, change=value) for other in found.found],
        )
        nis = _fuse_found(found, apply_constants(found.given, known, theta)).innovations.nis
        costs.append(np.minimum(nis[np.isfinite(nis)], MAX_NIS).sum())
    drawn = finish(go.Figure(), 300)
    drawn.add_trace(
        go.Scatter(
            x=values,
            y=np.array(costs) - min(costs),
            mode="lines+markers",
            line={"color": COLOURS[0]},
            hovertemplate="%{y:.4g}",
            showlegend=False,
        )
    )
    drawn.add_vline(x=each.change, line={"color": COLOURS[1], "width": 1, "dash": "dash"})
    drawn.add_vrect(
        x0=each.change - NORMAL_95 * each.std,
        x1=each.change + NORMAL_95 * each.std,
        fillcolor=COLOURS[1],
        opacity=0.12,
        line={"width": 0},
    )
    unit = f" [{each.unit}]" if each.unit else " [-]"
    drawn.update_xaxes(title_text=f"change of what was given{unit}")
    drawn.update_yaxes(title_text="sum of min(NIS, 30), less its minimum [-]", rangemode="tozero")
    note(
        drawn,
        f"Misfit: sum of min(NIS, 30), less its minimum, of {len(STEPS)} runs, all else as found. Dashed: the value found, shaded its 95 % interval. "
        "What was given is at 0.",
    )
    return drawn
