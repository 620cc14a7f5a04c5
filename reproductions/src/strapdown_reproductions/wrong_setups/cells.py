"""A cell: a mistake, a recording and a seed; what it does to the solution and who notices."""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.data.verdict import TRUSTED, Reason, rank_reasons
from strapdown.engine.batch import fuse
from strapdown.io.facts import recording_facts

from .cases import SetUpCase
from .harm import Harm, harm, of_right
from .mistakes import MISTAKES, Mistake
from .not_showable import names_untested, why_hidden

REFUSED = "refused"
"""Word of a run that ended in a DataError."""
RIGHT = "right set-up"
SAID = "unknown"
"""Cause of what inspect says as text alone."""


class Heard(NamedTuple):
    """Findings of inspect and of the verdict on a set-up."""

    reasons: tuple[Reason, ...]  # of inspect, the weightiest first
    word: str  # of the verdict; REFUSED where there is none
    own: tuple[Reason, ...]  # of the verdict
    untested: tuple[str, ...]
    refusal: str  # text of the DataError
    solution: Solution | None
    fuse_s: float
    verdict_s: float
    inspect_s: float


def inspect_problems(recording: Recording) -> tuple[Reason, ...]:
    """Return the problems that `inspect` finds in a recording: reasons, the weightiest first, then
    problems that are text alone."""
    found = recording_facts(recording)
    told = set(map(str, found.reasons))
    more = [Reason(SAID, text, "") for text in found.problems if text not in told]
    return (*rank_reasons(found.reasons), *more)


def check_recording(recording: Recording, filter: str = "closed-loop") -> Heard:
    """Run inspect, a filter and the verdict on a recording as it is set up."""
    began = time.perf_counter()
    try:
        reasons = inspect_problems(recording)
    except DataError as error:
        return Heard((), REFUSED, (), (), str(error), None, np.nan, np.nan, np.nan)
    looked = time.perf_counter()
    try:
        solution = fuse(recording, filter)
    except DataError as error:
        return Heard(reasons, REFUSED, (), (), str(error), None, np.nan, np.nan, looked - began)
    ran = time.perf_counter()
    verdict = solution.verdict
    judged = time.perf_counter()
    return Heard(
        reasons,
        verdict.word,
        verdict.reasons,
        tuple(map(str, verdict.untested)),
        "",
        solution,
        ran - looked,
        judged - ran,
        looked - began,
    )


def cells(
    case: SetUpCase, seed: int, mistakes: Sequence[Mistake] | None = None
) -> list[dict[str, Any]]:
    """Rows of the table: the right set-up of a recording, then every mistake that can be made with
    it."""
    right = check_recording(case.recording)
    rows = [row(RIGHT, RIGHT, case, seed, right)]
    if right.solution is None:
        raise DataError(f"{case.name}, right set-up: {right.refusal}")
    right_scores = of_right(case, right.solution)
    for mistake in MISTAKES if mistakes is None else mistakes:
        recording = mistake.make(case)
        if recording is None:
            continue
        found = check_recording(recording)
        done = (
            harm(case, right.solution, right_scores, found.solution)
            if found.solution
            else Harm((REFUSED,), np.inf, 1.0)
        )
        made = row(mistake.name, mistake.group, case, seed, found)
        rows.append(made | judge_cell(mistake, case, found, done))
    return rows


def right_row(case: SetUpCase, seed: int) -> dict[str, Any]:
    """The row of a right set-up."""
    return row(RIGHT, RIGHT, case, seed, check_recording(case.recording))


def judge_cell(mistake: Mistake, case: SetUpCase, found: Heard, done: Harm) -> dict[str, Any]:
    """The columns of a row that rest on what the mistake was."""
    cannot = why_hidden(mistake, case.name)
    which, worse, beyond = done
    first = next(iter(found.reasons or found.own), None)
    cause = first.cause if first else ""
    return {
        "harmful": bool(which),
        "which": ", ".join(which),
        "worse": worse,
        "beyond": beyond,
        "showable": cannot is None,
        "named": cause in mistake.causes or (first is None and names_cause(found.refusal, mistake)),
        "plainly_named": cause == mistake.causes[0],
        "named_untested": cannot is not None and names_untested(cannot, found.untested),
    }


WORDS = {
    "clock": ("time", "clock", "offset"),
    "unit": ("unit", "scale"),
    "axes": ("axes",),
    "frame": ("axes", "NED"),
}
"""By which words a refusal names a cause."""


def names_cause(text: str, mistake: Mistake) -> bool:
    """True where the text of a refusal names the cause of a mistake."""
    return any(word in text for cause in mistake.causes for word in WORDS.get(cause, ()))


def row(name: str, group: str, case: SetUpCase, seed: int, found: Heard) -> dict[str, Any]:
    """Return the findings on a set-up as a row."""
    texts = lambda of: " | ".join(f"{r.cause} {r.weight:.3g} {r.source} {r.seen}" for r in of[:3])
    cause = lambda of: of[0].cause if of else ""
    weight = lambda of: of[0].weight if of else np.nan
    by_inspect, by_verdict = bool(found.reasons), found.word != TRUSTED
    return {
        "mistake": name,
        "group": group,
        "recording": case.name,
        "seed": seed,
        "harmful": False,
        "which": "",
        "worse": np.nan,
        "beyond": np.nan,
        "showable": True,
        "found": by_inspect or by_verdict,
        "by_inspect": by_inspect,
        "by_verdict": by_verdict,
        "word": found.word,
        "named": False,
        "plainly_named": False,
        "named_untested": False,
        "inspect_cause": cause(found.reasons),
        "inspect_weight": weight(found.reasons),
        "verdict_cause": cause(found.own),
        "verdict_weight": weight(found.own),
        "inspect_says": texts(found.reasons),
        "verdict_says": texts(found.own),
        "refusal": found.refusal,
        "untested": " | ".join(found.untested),
        "fuse_s": found.fuse_s,
        "verdict_s": found.verdict_s,
        "inspect_s": found.inspect_s,
    }
