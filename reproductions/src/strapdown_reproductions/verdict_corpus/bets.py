"""A bet: a recording, a set-up, and the verdict's word against the truth."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from strapdown.checks import DataError
from strapdown.data.solution import Solution
from strapdown.data.verdict import (
    DOUBTFUL,
    HEADING,
    NOT_JUDGED,
    NOT_TO_BE_TRUSTED,
    TILT,
    TRUSTED,
    Reason,
)
from strapdown.engine.smoothing import smooth
from strapdown.evaluation.metrics import errors
from strapdown.evaluation.protection import COVERED
from strapdown.installation.follow import follow

from ..wrong_setups.cases import SetUpCase
from ..wrong_setups.cells import REFUSED, RIGHT, Heard, check_recording, judge_cell
from ..wrong_setups.harm import (
    OFTEN,
    QUANTITIES,
    Harm,
    HarmScore,
    against,
    scores,
    sizes,
    thin_rows,
)
from ..wrong_setups.mistakes import MISTAKES, Mistake
from .subjects import CLOSED_LOOP, PLAIN, VARIANTS, Subject, with_variant

DOUBTS = (DOUBTFUL, NOT_TO_BE_TRUSTED, REFUSED)
"""Words that warn."""
OF_ATTITUDE = (TILT, HEADING)
UNTESTED_AXES = "position alone is vouched for"
"""Words of a verdict on guessed axes that nothing tests."""


def bets(subject: Subject, seed: int, mistakes: bool = True) -> list[dict[str, Any]]:
    """Rows of a subject as it is, and of every mistake that can be made with it."""
    return list(_bets(subject, PLAIN, subject.make(seed), seed, CLOSED_LOOP, mistakes))


SEEDS_APART = 100_000
"""Between the seeds of variants, whose errors are independent: a large error by chance counts once."""


def of_variants(subject: Subject, seed: int, mistakes: bool = True) -> list[dict[str, Any]]:
    """Rows of a simulated subject with each variant, of a seed each."""
    rows = []
    for number, (name, variant) in enumerate(VARIANTS.items()):
        if name == PLAIN:
            continue
        own = seed + SEEDS_APART * number
        case, made = with_variant(subject, variant, own), mistakes and variant.with_mistakes
        rows += _bets(subject, name, case, own, variant.filter, made)
    return rows


def _bets(
    subject: Subject, variant: str, case: SetUpCase, seed: int, filter: str, mistakes: bool
) -> Iterator[dict[str, Any]]:
    right = check_recording(case.recording, filter)
    smoothed = None if case.true else smooth(case.recording, filter)
    about = {
        "subject": subject.name,
        "vehicle": subject.vehicle,
        "half": subject.half,
        "variant": variant,
        "seed": seed,
        "seconds": float(np.diff(case.recording.span)[0]),
    }
    yield {**about, **bet(None, case, right, smoothed), "named": False}
    for mistake in MISTAKES if mistakes else ():
        recording = mistake.make(case)
        if recording is None:
            continue
        heard = check_recording(recording, filter)
        cell = judge_cell(mistake, case, heard, Harm((), np.nan, np.nan))
        made = bet(mistake, case, heard, smoothed)
        yield {**about, **made, "named": cell["named"]}


COMPONENTS = {"antenna arm, forward": "forward", "antenna arm, up": "down"}
"""{group of mistakes: component of a bound}."""


BY_NATURE = ("accelerometer", "calibration")
"""Causes of which a right set-up may be wrong: accelerations that count as tilt, iron near a compass."""


def said_apart(mistake: Mistake | None, which: Sequence[str], solution: Solution | None) -> bool:
    """True where the verdict names the cause of what is wrong as not tested and every quantity that is
    wrong as resting on it, or the mistake as too small to have shown."""
    if solution is None or not which:
        return False
    verdict = solution.verdict
    own = [
        each
        for each in verdict.untested
        if each.cause in (mistake.causes if mistake else BY_NATURE)
    ]
    if mistake is None:
        return set(which) <= {quantity for each in own for quantity in each.rests}
    component = COMPONENTS.get(mistake.group, "")
    bounds = [
        bound.size
        for bound in verdict.bounds
        if bound.cause in mistake.causes and bound.component == component
    ]
    small = 0 < mistake.size <= max(bounds, default=0.0)
    return small or set(which) <= {quantity for each in own for quantity in each.rests}


def bet(
    mistake: Mistake | None, case: SetUpCase, heard: Heard, smoothed: Solution | None
) -> dict[str, Any]:
    """The columns of a result with a mistake, or with none."""
    beyond = shares_beyond(case, heard.solution, smoothed)
    which = [name for name, share in beyond.items() if share > OFTEN]
    return {
        "mistake": mistake.name if mistake else RIGHT,
        "word": heard.word,
        "trusted": heard.word == TRUSTED,
        "doubted": heard.word in DOUBTS,
        "judged": heard.word != NOT_JUDGED,
        "untested_axes": any(UNTESTED_AXES in reason.seen for reason in heard.own),
        "wrong": bool(which) or heard.solution is None or "stopped" in heard.solution.meta,
        "said_apart": said_apart(mistake, which, heard.solution),
        "which": ", ".join(which),
        "beyond": max(beyond.values(), default=np.nan),
        "cause": heard.own[0].cause if heard.own else "",
        "says": str(heard.own[0]) if heard.own else heard.refusal,
        "evidence": json.dumps(evidence(heard.own)),
        "untested": " | ".join(heard.untested),
        **share_beyond_levels(case, heard.solution),
        "fuse_s": heard.fuse_s,
        "verdict_s": heard.verdict_s,
    }


def share_beyond_levels(case: SetUpCase, solution: Solution | None) -> dict[str, float]:
    """{"beyond level of a quantity": share of the scored time in which its error is larger than its
    protection level}; NaN where it has none, or rests on what was not tested."""
    found = {f"beyond level of {name}": np.nan for name in COVERED}
    if solution is None or not case.true or not solution.verdict.trusted:
        return found
    levels = solution.protection()
    try:
        e = errors(thin_rows(solution, case.windows), case.recording.reference)
    except DataError:  # no time in common
        return found
    row = np.clip(np.searchsorted(levels.t, e.t), 0, len(levels.t) - 1)
    error = sizes(e)
    for name, level in zip(COVERED, (levels.horizontal, levels.vertical, levels.heading)):
        if name in error and name not in levels.uncovered:
            known = np.isfinite(error[name]) & np.isfinite(level[row])
            far = error[name][known] > level[row][known]
            found[f"beyond level of {name}"] = float(far.mean()) if len(far) else np.nan
    return found


def evidence(reasons: tuple[Reason, ...]) -> dict[str, float]:
    """{cause: its heaviest weight}."""
    found: dict[str, float] = {}
    for reason in reasons:
        found[reason.cause] = max(found.get(reason.cause, 0.0), float(reason.weight))
    return found


def shares_beyond(
    case: SetUpCase, solution: Solution | None, smoothed: Solution | None
) -> dict[str, float]:
    """{quantity: share of the scored time in which it is beyond three claimed standard deviations},
    against the truth, or against the smoother of the right set-up, where both standard deviations
    count and attitude is not judged."""
    if solution is None or "stopped" in solution.meta:
        return {}
    try:
        if smoothed is None:
            found = against(case.recording.reference, solution, case)
        else:
            found = _against_smoother(smoothed, solution, case)
    except DataError:  # no time in common
        return {"no solution": 1.0}
    return {name: score.beyond for name, score in found.items()}


def _against_smoother(
    smoothed: Solution, solution: Solution, case: SetUpCase
) -> dict[str, HarmScore]:
    own = smoothed.trajectory
    e = errors(thin_rows(solution, case.windows), own)
    assert e.std is not None and own.std is not None
    nearest = np.clip(np.searchsorted(own.t, e.t), 0, len(own.t) - 1)
    columns = max(part.stop for part in QUANTITIES.values())
    found = scores(e, np.hypot(e.std[:, :columns], own.std[nearest, :columns]))
    return {name: score for name, score in found.items() if name not in OF_ATTITUDE}


# ---- advice


def advice(subject: Subject, seed: int) -> list[dict[str, Any]]:
    """Rows of every mistake, after `follow`: whether anything was applied, and the
    verdict's word against the truth before and after."""
    case = subject.make(seed)
    smoothed = None if case.true else smooth(case.recording)
    return list(_advice(subject, case, seed, smoothed))


def _advice(
    subject: Subject, case: SetUpCase, seed: int, smoothed: Solution | None
) -> Iterator[dict[str, Any]]:
    for mistake in MISTAKES:
        recording = mistake.make(case)
        if recording is None:
            continue
        try:
            found = follow(recording)
        except DataError:  # the filter refuses the recording: there is nothing to follow
            continue
        wrong = [
            [name for name, share in shares.items() if share > OFTEN]
            for shares in (
                shares_beyond(case, each, smoothed) for each in (found.before, found.after)
            )
        ]
        yield {
            "subject": subject.name,
            "half": subject.half,
            "mistake": mistake.name,
            "seed": seed,
            "applied": bool(found.applied),
            "changes": " | ".join(found.applied) or found.stopped,
            "before": found.before.verdict.word,
            "after": found.after.verdict.word,
            "wrong_before": bool(wrong[0]),
            "wrong_after": bool(wrong[1]),
            "said_apart": said_apart(mistake, wrong[1], found.after),
        }
