"""Every filter on every recording, one row per filter: errors, fixes used, and where there are
none, why.

Filters are those that `strapdown filters` lists, with their defaults. One that cannot run on a
recording, stops on it or loses it stays in the table.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Filter
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.engine.prepare import has_position
from strapdown.evaluation.metrics import errors, rms
from strapdown.typing import Notify, Progress

from .cases import RecordingCase

LOST = 100.0
"""Standard deviations of the position fixes: a filter whose horizontal rms is beyond, while they
keep coming, has lost the recording."""
FIXES = ("position", "velocity")
"""Kinds of aiding that are counted by themselves; the others are counted together."""
FIGURES = (
    "horizontal, m",
    "vertical, m",
    "velocity, m/s",
    "roll, deg",
    "pitch, deg",
    "heading, deg",
    "inclination, deg",
    "heading about the vertical, deg",
)
COUNTS = ("fixes accepted", "fixes rejected", "others accepted", "others rejected", "gate opened")
FEWER = {"pkf": {"components": 20}}
"""Options of filters that would take an hour here with their defaults."""
UNBROKEN = "\N{NO-BREAK SPACE}"
EVERY, TRIALS = (
    "Every filter on every recording",
    "The BROAD trials one by one, with the errors of motion",
)
LEGEND = (
    "The lines of a cell: horizontal / vertical position; velocity, length of its error; roll / "
    "pitch / heading, of BROAD inclination / heading; "
    "position and velocity fixes used + rejected; samples of other sources used + rejected; what "
    "went wrong. Errors are rms; of BROAD the median "
    "over its trials, where one on which the filter stopped counts as ∞, and fixes are summed. – is "
    "not estimated, or has no reference. Lost is a "
    "horizontal rms of more than 100 standard deviations of the position fixes."
)
INTRODUCTION = (
    "Every filter that `strapdown filters` lists runs on every recording, with its default options; "
    "only pkf, which would take "
    "an hour, has 20 components instead of 500: so few are nearly as wide as their mixture and see "
    "little more than the closed loop does. "
    "thor75 has GPS, its calibrated magnetometer and its barometer here, and is scored from 240 to "
    "575 s. drive0708 has GNSS alone and is scored by "
    "the same RTK positions that aid it, so that its figures show little but that a filter follows "
    "them; dead reckoning tells more. BROAD is a "
    "hand-held IMU, aided with its magnetometer and with optical positions of 0.1 m, one a second, "
    "and scored by the cameras while it moves: once "
    "with the noise that the IMU shows at rest, once with what motion adds, 1 % of scale. The "
    "ring-laser IMU stands in a parked vehicle: the "
    "header's position and zero velocity are fixes, and its attitude is compared with that of "
    "gravity and the Earth's rate in the mean of the "
    "record.",
    "Dead reckoning: drive0708 in its nine windows of 15 s, all in one run. thor75 in consecutive "
    "windows of 30 s from 240 to 570 s, each a run of "
    "its own with all fixes before. Positions and velocities are withheld, magnetometer and "
    "barometer stay.",
    LEGEND,
)


def scores(
    cases: Sequence[RecordingCase],
    names: Sequence[str] | None = None,
    notify: Notify | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """DataFrame with a row for each case and filter: group, recording, held, filter, FIGURES,
    COUNTS, and `said`: what went wrong, or empty. progress: called with the fraction done."""
    rows = []
    for i, case in enumerate(cases):
        if progress:
            progress(i / len(cases))
        if notify:
            notify(f"{case.group}: {case.name} ...")
        of = {"group": case.group, "recording": case.name, "held": case.held}
        rows += [
            of | {"filter": name} | _scores(case, name, notify) for name in names or filters.names()
        ]
    return pd.DataFrame(
        rows, columns=["group", "recording", "held", "filter", *FIGURES, *COUNTS, "said"]
    )


def _scores(case: RecordingCase, name: str, notify: Notify | None) -> dict[str, Any]:
    try:
        solution = fuse(case.recording, name, notify=notify, options=FEWER.get(name, {}))
    except DataError as error:
        return {"said": shorten(error, name)}
    lifted = sum("gate opened" in text for _, text in solution.events)
    counts = dict(zip(COUNTS, (*count_fixes(solution), lifted)))
    if "stopped" in solution.meta:
        return counts | {"said": shorten(solution.meta["stopped"], name)}
    found = score_case(case, solution, filters.find(name)) | counts
    if found["horizontal, m"] > (
        most := LOST
        * float(
            np.median([a.std[:, :2] for a in case.recording.sources if a.kind == "position"][-1])
        )
    ):
        found["said"] = f"lost: beyond {most:g} m"
    return found


def score_case(case: RecordingCase, solution: Solution, filter: Filter) -> dict[str, Any]:
    """{figure: value, "said": text} of a Solution over the case's windows."""
    e = errors(solution, case.recording.reference)
    inside = case.inside(e.t)
    r = rms(
        replace(
            e,
            t=e.t[inside],
            position=e.position[inside],
            velocity=e.velocity[inside],
            attitude=e.attitude[inside],
            rph=e.rph[inside],
        )
    )
    p, v, rph, (_, inclination, about) = r.position, r.velocity, r.rph, r.angles
    figures = [
        np.hypot(p[0], p[1]),
        p[2],
        np.linalg.norm(v),
        *np.degrees(rph),
        *np.degrees((inclination, about)),
    ]
    if 6 in filter.estimates and 8 not in filter.estimates:  # its heading runs free
        figures[5] = figures[7] = np.nan
    said = "" if np.isfinite(figures).any() else "runs; the recording has nothing to score it by"
    if has_position(filter) and not np.isfinite(e.horizontal[inside]).all():
        said = "position is not finite throughout"
    return dict(zip(FIGURES, map(float, figures))) | {"said": said}


def count_fixes(solution: Solution) -> tuple[int, ...]:
    """(accepted, rejected, accepted, rejected): of the position and velocity fixes, of all
    others."""
    kinds, found = solution.meta["kinds"], np.zeros((2, 2), int)
    for name, pair in solution.counts().items():
        found[int(kinds[name] not in FIXES)] += pair
    return tuple(found.ravel().tolist())


def shorten(text: object, name: str = "") -> str:
    """The first clause of a message, without the filter's name."""
    text = (
        str(text)
        .removeprefix(f"filter {name!r}: ")
        .removeprefix(f"{name}: ")
        .removeprefix(f"{name} ")
    )
    first = text.split("; ")[0].split(": ")[0]
    return first if len(first) <= 160 else first[:159] + "…"


def wide(table: pd.DataFrame) -> pd.DataFrame:
    """The DataFrame of `scores` as one of text: a row per filter, a column per group, cells of
    several lines."""
    groups, names = list(dict.fromkeys(table["group"])), list(dict.fromkeys(table["filter"]))
    rows = [
        (
            name,
            *(
                cell(table[(table["group"] == group) & (table["filter"] == name)])
                for group in groups
            ),
        )
        for name in names
    ]
    return pd.DataFrame(rows, columns=["filter", *groups])


def by_trial(table: pd.DataFrame) -> pd.DataFrame:
    """`wide` of the last group of hand-held recordings, a column per recording."""
    own = table[table["held"]]
    return wide(
        own[own["group"] == own["group"].iloc[-1]].assign(
            group=own["recording"].str.replace("_", " ")
        )
    )


def cell(rows: pd.DataFrame) -> str:
    """Text of the rows of one filter and one group, a line per quantity; medians over the rows,
    and what was said."""
    figures, held = rows[list(FIGURES)].astype(float), bool(rows["held"].iloc[0])
    figures.loc[rows["said"].str.startswith("stopped"), ~figures.isna().all()] = np.inf
    middle, lines = figures.median().to_numpy(), []
    for values, unit in (
        (middle[:2], "m"),
        (middle[2:3], "m/s"),
        (middle[6:] if held else middle[3:6], "deg"),
    ):
        if not np.isnan(values).all():
            lines.append((" / ".join(map(number, values)) + f" {unit}").replace(" ", UNBROKEN))
    counts = rows[list(COUNTS[:4])].sum().astype(int).tolist()
    lines += [
        f"{text} {good}" + f" + {bad}" * (bad > 0)
        for text, good, bad in (("fixes", *counts[:2]), ("others", *counts[2:]))
        if good or bad
    ]
    return "\n".join(lines + wrong(rows["said"]))


def wrong(said: pd.Series) -> list[str]:
    """Lines of what was said of some runs, each with how many it was said of where those are not
    all; times of stopping together."""
    found = {}
    for text in said[said != ""]:
        what, _, when = text.partition(" at ") if text.startswith("stopped at ") else (text, "", "")
        found.setdefault(what, []).append(when)
    lines = []
    for what, when in found.items():
        text = (
            f"{what} at {', '.join(each.removesuffix(' s') for each in when)} s"
            if when[0]
            else what
        )
        text = re.sub(" (s|m)$", rf"{UNBROKEN}\1", text)
        lines.append(text if len(when) == len(said) else f"{len(when)} of {len(said)}: {text}")
    return lines


def number(value: float) -> str:
    """Two decimals below 10, two digits below a tenth, three above 10 and whole numbers above
    100."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "∞"
    return (
        f"{value:.2g}"
        if value < 0.1
        else f"{value:.2f}"
        if value < 10
        else f"{value:.1f}"
        if value < 100
        else f"{value:.0f}"
    )
