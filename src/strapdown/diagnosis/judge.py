"""The Verdict of a Solution, from the statistics of its run, its positions against its velocities
and the sensitivity of its innovations to the installation."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..cross_checks import position_velocity
from ..cross_checks.all import check
from ..cross_checks.motion import Subject
from ..cross_checks.repeats import repeated
from ..data import Solution
from ..plugins import one_line
from ..verdict import NOT_JUDGED, Reason, Verdict
from . import evidence, screening
from .estimated import installation
from .evidence import GATED, Fixes
from .installation import CONSTRAINED

Found = TypeVar("Found")
SHORTEST = 30.0  # s of a run that says something of itself
HEIGHTS = {"position", "altitude", "pressure", "pressure-altitude", "zero-sea-level"}
"""Kinds that measure a height."""


def judge(solution: Solution) -> Verdict:
    """The Verdict of a Solution that `fuse` or `smooth` made of a recording."""
    recording = solution.recording
    assert recording is not None  # `Solution.verdict` asks for no other
    sources = evidence.by_source(solution)
    seconds = recording.span[1] - solution.meta["start"]["t"]
    little = seconds < SHORTEST or all(len(source.t) < GATED for source in sources)
    untested = list(_untested(solution, sources, seconds))

    def attempt(what: str, function: Callable[..., Found], *arguments: Any) -> Found | None:
        """What a check finds; one that fails is said, and does not cost the user the result."""
        try:
            return function(*arguments)
        except Exception as error:
            untested.append(f"{what}: it cannot be looked at here ({one_line(error)})")
            return None

    symptoms = attempt("the run", lambda: list(_symptoms(solution, sources))) or []
    causes = [
        *evidence.gaps(solution),
        *evidence.heights(solution),
        *installation(solution).reasons,
    ]
    if any(source.kind == "position" for source in sources):
        looked, unknown = attempt("clock and lever arm", screening.look, solution) or ([], [])
        causes += looked
        untested += unknown if evidence.moves(solution) else []
    causes += attempt("repeated fixes", lambda: list(repeated(recording))) or []
    # what compares the parts of the recording takes longer: all of it only where there is doubt, or
    # where the filter's own gates tell nothing
    doubt = any(reason.weight >= 1.0 for reason in (*causes, *symptoms))
    gated = all(np.isfinite(source.ratio).all() for source in sources)
    checked = attempt(
        "the parts of the recording",
        lambda: (
            check(recording) if doubt or not gated else position_velocity.check(Subject(recording))
        ),
    )
    if not sources and not symptoms and not (checked and checked.reasons):
        return Verdict(NOT_JUDGED, untested=("anything: no fix was used", *untested))
    verdict = Verdict.of(_once(checked.reasons if checked else [], causes), untested, symptoms)
    return replace(verdict, word=NOT_JUDGED) if verdict.trusted and little else verdict


def _once(of_recording: list[Reason], of_run: list[Reason]) -> list[Reason]:
    """Reasons of both, each cause of each source once: the weightiest. A small clock offset that the
    innovations ask for is known better than one that motions compared ask for, and a height that the
    run left out no longer harms it."""
    known = {reason.cause for reason in of_run} & {"clock", "height"}
    of_recording = [reason for reason in of_recording if reason.cause not in known]
    ranked = sorted([*of_recording, *of_run], key=lambda reason: reason.weight)
    return list({(reason.cause, reason.source): reason for reason in ranked}.values())


def _symptoms(solution: Solution, sources: list[Fixes]) -> Iterator[Reason]:
    """What the run shows that a right set-up does not."""
    if "stopped" in solution.meta:  # what it did before is of no interest
        yield from evidence.stopped(solution)
        return
    biases, smoother = list(evidence.biases(solution)), list(evidence.smoother(solution))
    yield from (*biases, *smoother)
    of_sources, runs = [], solution.rejected
    left_out = {each["source"] for each in solution.meta.get("heights_apart", ())}
    for source in (each for each in sources if each.name not in left_out):
        found = [
            *evidence.noise(source),
            *(evidence.explained(each, runs) for each in evidence.rejections(source)),
            *(evidence.explained(each, runs) for each in evidence.jumps(source)),
        ]
        of_sources += sorted(found, key=lambda reason: -reason.weight)[:1]
    yield from of_sources
    if not (biases or smoother or of_sources):  # which say why rows are doubtful
        yield from evidence.doubts(solution)
    for source in sources:
        if source.kind in ("position", "velocity"):
            yield from evidence.course(solution, source.t)
            break


def _untested(solution: Solution, sources: list[Fixes], seconds: float) -> Iterator[str]:
    """What could not be tested, and why."""
    if seconds < SHORTEST:
        yield f"anything that takes time: the run lasts {seconds:.0f} s, of {SHORTEST:.0f} s needed"
    few = [source.name for source in sources if len(source.t) < GATED]
    if few:
        yield f"innovations of {', '.join(few)}: fewer than {GATED} fixes"
    if any(not np.isfinite(source.ratio).all() for source in sources):
        yield (
            f"innovations: {solution.meta.get('filter', 'the filter')} does not weigh its fixes "
            f"against their standard deviations"
        )
    silent = set(solution.innovations.names) - {source.name for source in sources}
    if silent:
        yield f"{', '.join(sorted(silent))}: none of its fixes was used"
    if solution.meta.get("bias_sd") is None:
        yield "biases: the IMU is not described"
    kinds = {source.kind for source in sources}
    moves = evidence.moves(solution)
    if not kinds & {"position", "velocity"}:
        yield "clock and lever arm: there is no GNSS"
    elif not moves:
        yield "clock, lever arm and heading: it hardly moves"
    elif not {"position", "velocity"} <= kinds:
        yield (
            "clock below half a second, lever arm and lasting errors of the fixes: position and "
            "velocity are not both measured"
        )
    if "position" in kinds and len(kinds & HEIGHTS) < 2:
        yield "height above geoid or ellipsoid: there is one source of height"
    if not kinds & set(CONSTRAINED):
        yield "mounting of the IMU: no constraint or odometer shows it"
    if moves and evidence.heading_never_seen(solution):
        yield "heading: no turn or acceleration showed it, its error is that of the start"
