"""The tables of the page, as HTML: errors against the reference, the run, the fixes."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..checks import DataError
from ..core.loop.contract import ATT, BRIDGED, DOUBTFUL, INVALID, POS, VEL
from ..data.solution import Solution
from ..data.verdict import RISK
from ..evaluation import metrics
from ..evaluation.metrics import EULER, NED_AXES, Errors
from ..evaluation.protection import COVERED
from ..filters import find
from ..typing import Array, Mask
from ..units.wording import number
from .parts import caption, split_cells, table


def claimed_std(made: Solution | Errors) -> Array:
    """(n, 15) standard deviations of the error states that a Solution claims, or those at its
    Errors, SI and radians."""
    std = made.std if isinstance(made, Errors) else made.trajectory.std
    assert std is not None  # a solution has them, NaN where its filter claims none
    return std


def heading_held(solution: Solution) -> bool:
    """Return True where the filter of a Solution estimates its heading; the heading of others
    drifts with the gyros and is no result. True for unknown filters."""
    try:
        return 8 in find(solution.meta.get("filter", "")).estimates
    except ValueError:
        return True


def error_table(
    found: Mapping[str, Errors],
    window: tuple[float, float] | None = None,
    free: Collection[str] = (),
) -> str:
    """RMS, largest and last error per axis of {name: metrics.Errors}; dashes where a solution or
    the reference does not know it.

    The angles of the attitude error stand below where one of them has no position: they are what
    filters of attitude are compared by. free: names whose heading runs free, so that it and the
    angle of the whole rotation are not scored.
    """
    positioned, rows = all(metrics.any_known(e.horizontal) for e in found.values()), []
    for labels, unit, factor, part in SCORED_QUANTITIES[:-1] if positioned else SCORED_QUANTITIES:
        values = [part(e) * factor for e in found.values()]
        running = [i for i, label in enumerate(labels) if label in HEADINGS]
        for v in (v for v, name in zip(values, found) if name in free):
            v[:, running] = np.nan
        scores = [_scores(v[e.inside(window)]) for v, e in zip(values, found.values())]
        rows += [
            [f"{label} [{unit}]", *split_cells((text for score in scores for text in score[i]), 3)]
            for i, label in enumerate(labels)
            if any(np.isfinite(v[:, i]).any() for v in values)
        ]
    head = [
        f"{name}: {what}" if what == "RMS" else what
        for name in found
        for what in ("RMS", "largest", "last")
    ]
    return table(["true − estimate", *split_cells(head, 3)], rows)


NOTHING = ["–"] * 3
HEADINGS = ("heading", "heading angle", "total angle")
SCORED_QUANTITIES = (
    (["horizontal position"], "m", 1.0, lambda e: e.horizontal[:, None]),
    ([f"{axis} position" for axis in NED_AXES], "m", 1.0, lambda e: e.position),
    ([f"{axis} velocity" for axis in NED_AXES], "m/s", 1.0, lambda e: e.velocity),
    (EULER, "deg", np.degrees(1), lambda e: e.rph),
    (
        [f"{name} angle" for name in metrics.AttitudeAngles._fields],
        "deg",
        np.degrees(1),
        lambda e: np.column_stack(metrics.attitude_angles(e)),
    ),
)
"""Quantities that are scored: labels, unit, its size, and the columns of an Errors."""


def _scores(values: Array) -> list[list[str]]:
    """Per column RMS, largest and last known value, as text."""
    columns = [column[np.isfinite(column)] for column in values.T]
    return [
        [number(np.sqrt(np.mean(known**2))), number(np.abs(known).max()), number(known[-1])]
        if len(known)
        else NOTHING
        for known in columns
    ]


ERROR_GROUPS = (
    ("position", "m", 1.0, POS),
    ("velocity", "m/s", 1.0, VEL),
    ("attitude", "deg", np.degrees(1), ATT),
)
BEYOND_SHARE, SIGMAS, STEADY = 0.05, 3.0, 3.0
"""Share of the times above which the summary states that errors leave the band of SIGMAS standard
deviations; it would be 0.8 % for three normal errors. An error is steady where its median is STEADY
times its scatter."""


def contradictions(
    found: Mapping[str, Errors],
    window: tuple[float, float] | None = None,
    of_reference: Mapping[str, str] | None = None,
) -> dict[str, list[str]]:
    """{name: sentences} on the errors of {name: metrics.Errors} that any of their components exceeds
    its claim too often by, and on which of the two may be wrong. of_reference: {name: what must be
    known of the reference}, said where positions exceed it."""
    said: dict[str, list[str]] = {}
    for name, e in found.items():
        inside = e.inside(window)
        for group, unit, factor, states in ERROR_GROUPS:
            errors: Array = getattr(e, group)[inside]
            if e.std is None or not metrics.any_known(errors):
                continue
            std = e.std[inside, states]
            known = (np.isfinite(errors) & np.isfinite(std)).any(axis=1)
            beyond: Mask = np.any(np.abs(errors) > SIGMAS * std, axis=1)
            share = beyond[known].mean() if known.any() else 0.0
            if share > BEYOND_SHARE:
                why = (of_reference or {}).get(name, "") if group == "position" else ""
                said.setdefault(name, []).append(
                    f"{group} error beyond 3σ of what the filter claims at {100 * share:.0f} % of the "
                    f"times, against the reference. {_suspect(factor * errors, unit)}"
                    f"{' The reference may itself be wrong: ' * bool(why)}{why}{'.' * bool(why)}"
                )
    return said


def _suspect(errors: Array, unit: str) -> str:
    """Which of solution and reference the errors (n, 3) speak against."""
    known = np.flatnonzero(np.isfinite(errors).any(axis=0))
    k = int(known[np.nanargmax(np.nanmean(errors[:, known] ** 2, axis=0))])
    middle = float(np.nanmedian(errors[:, k]))
    scatter = 1.48 * float(np.nanmedian(np.abs(errors[:, k] - middle)))
    size = f"{NED_AXES[k]}, median {number(middle)}, scatter {number(scatter)} {unit}"
    if abs(middle) > STEADY * scatter:
        return (
            f"It is much the same throughout ({size}), so suspect the point, mounting, datum or clock "
            f"of the reference first, then those of the set-up."
        )
    return (
        f"It changes ({size}), so suspect the solution first where no fix measures this; a reference "
        f"that is no better than this looks the same."
    )


def run_table(solutions: Mapping[str, Solution]) -> str:
    """Span, gaps and claimed standard deviations of {name: Solution}; without those that none of
    them claims."""
    rows = list(zip(RUN, *map(_run, solutions.values())))
    shown = table(["", *solutions], [row for row in rows if set(row[1:]) != {"–"}])
    rest = dict.fromkeys(
        quantity
        for solution in solutions.values()
        if solution.verdict.trusted
        for each in solution.verdict.untested
        for quantity in each.rests
        if quantity in COVERED
    )
    if not rest:
        return shown
    return shown + caption(
        f"The protection levels of {' and '.join(rest)} hold only if what was not tested is right."
    )


RUN = (
    "time [s]",
    "rows",
    "gaps bridged",
    "time bridged [s]",
    "stretches doubtful",
    "time doubtful [s]",
    "stretches not valid",
    "time not valid [s]",
    "horizontal std, largest / last [m]",
    "height std, largest / last [m]",
    "inclination std, largest / last [deg]",
    "heading std, largest / last [deg]",
    *(
        f"{quantity} protection level, risk {RISK:g}, largest / last [{unit}]"
        for quantity, unit in (("horizontal", "m"), ("height", "m"), ("heading", "deg"))
    ),
)


def _run(solution: Solution) -> list[str]:
    t, std = solution.t, claimed_std(solution)
    texts = [f"{t[0]:.2f} to {t[-1]:.2f}" if len(t) else "–", f"{len(t)}"]
    for status in (BRIDGED, DOUBTFUL, INVALID):
        there = solution.status == status
        texts += [
            str(int((np.diff(there.astype(int), prepend=0) == 1).sum())),
            number(solution.seconds(status)) if there.any() else "0",
        ]
    return [
        *texts,
        _largest_and_last(np.hypot(std[:, 0], std[:, 1])),
        _largest_and_last(std[:, 2]),
        _largest_and_last(np.degrees(np.hypot(std[:, 6], std[:, 7]))),
        _largest_and_last(np.degrees(std[:, 8])),
        *_protection(solution),
    ]


def _protection(solution: Solution) -> list[str]:
    """Largest and last protection levels; of a solution that is not trusted there are none."""
    if not solution.verdict.trusted or solution.trajectory.std is None:
        return ["–"] * 3
    levels = solution.protection()
    return [*map(_largest_and_last, levels.as_columns().values())]


def _largest_and_last(values: Array) -> str:
    return (
        " / ".join((number(np.nanmax(values)), number(values[-1])))
        if np.isfinite(values).any()
        else "–"
    )


FAR_BELOW = 0.05
LASTING_FIELD_NOTE = (
    "The mean NIS of the magnetic field is far below what is expected: its errors "
    "are taken as lasting, so single samples count "
    "little."
)


def fix_table(solutions: Mapping[str, Solution]) -> str:
    """Accepted and rejected fixes per source, and the mean NIS of the accepted ones beside that
    of a consistent filter; "" without any."""
    rows, lasting = [], False
    for name, solution in solutions.items():
        fixes, counts = solution.innovations, solution.counts()
        for source, label in enumerate(fixes.names):
            good, bad = counts[label]
            used = (fixes.source == source) & fixes.accepted & np.isfinite(fixes.nis)
            found = expected = np.nan
            if used.any():
                found = fixes.nis[used].mean()
                expected = np.isfinite(fixes.innovation[used]).sum(axis=1).mean()
            kind = solution.meta.get("kinds", {}).get(label, label)
            field = solution.meta.get("filter") == "attitude-mekf" and kind == "magnetic-field"
            lasting |= field and bool(found < FAR_BELOW * expected)
            gated = np.isfinite(fixes.nis[fixes.source == source]).any()
            gate = fixes.gates[source] if gated and source < len(fixes.gates) else None
            who = f"{name}: {label}" if len(solutions) > 1 else label
            rows.append([who, good, bad, *map(number, (found, expected, gate))])
    return (
        table(["source", "accepted", "rejected", "mean NIS", "expected", "gate"], rows)
        + (caption(LASTING_FIELD_NOTE) if lasting else "")
        if rows
        else ""
    )


def rejection_table(solutions: Mapping[str, Solution]) -> str:
    """Runs of rejected fixes of {name: Solution} with their probable cause; "" without any."""
    rows = [
        [
            f"{name}: {run.source}" if len(solutions) > 1 else run.source,
            f"{run.start:.1f} to {run.stop:.1f}",
            f"{run.number} of {run.of}",
            run.cause,
            run.seen,
            run.remedy,
        ]
        for name, solution in solutions.items()
        for run in solution.rejected
    ]
    head = ["source", "time [s]", "rejected", "probable cause", "what was seen", "what to do"]
    return table(head, rows, "said") if rows else ""


def withheld_table(solutions: Mapping[str, Solution], found: Mapping[str, Errors]) -> str:
    """The windows, s, whose fixes were withheld from {name: Solution}, by meta["withheld"], with
    the errors inside where `found`, {name: metrics.Errors}, knows them; "" without any."""
    rows = []
    for name, solution in solutions.items():
        for window in solution.meta.get("withheld", ()):
            try:
                (outage,) = metrics.outages_of(found[name], [window]) if found else [None]
            except DataError:
                outage = None
            scores = (
                NOTHING
                if outage is None
                else map(number, (outage.horizontal_max, outage.horizontal_end, outage.down_max))
            )
            label = "{:g} to {:g}".format(*window)
            rows.append([f"{name}: {label}" if len(solutions) > 1 else label, *scores])
    head = [
        "fixes withheld [s]",
        "largest horizontal error [m]",
        "at the end [m]",
        "largest vertical [m]",
    ]
    if all(row[1:] == NOTHING for row in rows):
        head, rows = head[:1], [row[:1] for row in rows]
    return table(head, rows) if rows else ""
