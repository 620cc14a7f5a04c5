"""The Verdict of a Solution, from the statistics of its run, the problems that `inspect` finds in its
recording and the sensitivity of its innovations to the installation."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..data.solution import Solution
from ..data.verdict import NOT_JUDGED, Reason, Verdict
from ..inspection.all import check
from ..installation import screening
from ..installation.model import CONSTRAINED
from ..installation.states import estimated_installation, in_motion
from ..io.facts import own_reasons
from ..plugins import one_line
from . import evidence
from .evidence import GATED, JudgedFixes
from .guessed_axes import of_guessed_axes

Found = TypeVar("Found")
MIN_TIME = 30.0  # s of a run that says something of itself
HEIGHTS = {"position", "altitude", "pressure", "pressure-altitude", "zero-sea-level"}
"""Kinds that measure a height."""


def judge(solution: Solution) -> Verdict:
    """The Verdict of a Solution that `fuse` or `smooth` made of a recording."""
    recording = solution.recording
    assert recording is not None  # `Solution.verdict` asks for no other
    sources = evidence.by_source(solution)
    seconds = recording.span[1] - solution.meta["start"]["t"]
    little = seconds < MIN_TIME or all(len(source.t) < GATED for source in sources)
    untested = list(_untested_claims(solution, sources, seconds))

    def attempt(what: str, function: Callable[..., Found], *arguments: Any) -> Found | None:
        """Return the result of a check; one that fails becomes a line and does not cost the user
        the result."""
        try:
            return function(*arguments)
        except Exception as error:
            untested.append(f"{what}: it cannot be looked at here ({one_line(error)})")
            return None

    symptoms = attempt("the run", lambda: list(_symptoms(solution, sources))) or []
    installed = estimated_installation(solution)
    causes = [*evidence.gaps(solution), *evidence.heights(solution), *installed.reasons]
    causes += attempt("guessed axes", of_guessed_axes, recording) or []
    if any(source.kind == "position" for source in sources):
        looked, unknown = attempt("clock and lever arm", screening.look, solution) or ([], [])
        causes += looked
        untested += unknown if in_motion(solution) else []
    inspected = attempt("the recording", _inspection_reasons, solution) or []
    if not sources and not symptoms and not inspected:
        return Verdict(NOT_JUDGED, untested=("anything: no fix was used", *untested))
    # what the filter has estimated is not as the recording has it
    found = {each.cause for each in installed.parameters if each.status != "not observable"}
    inspected = [reason for reason in inspected if reason.cause not in found]
    verdict = Verdict.of(_once(inspected, causes), untested, symptoms)
    return replace(verdict, word=NOT_JUDGED) if verdict.trusted and little else verdict


def _inspection_reasons(solution: Solution) -> list[Reason]:
    """A Reason for each problem that `inspect` finds in what the filter used."""
    recording, (_, gyro) = solution.recording, solution.meta.get("bias_sd") or (0.0, 0.0)
    assert recording is not None
    return [*check(recording).reasons, *own_reasons(recording, gyro)]


def _once(of_recording: list[Reason], of_run: list[Reason]) -> list[Reason]:
    """Reasons of both, each cause of each source once: the weightiest. A small clock offset that the
    innovations ask for is known better than one that motions compared ask for, and a height that the
    run left out no longer harms it."""
    known = {reason.cause for reason in of_run} & {"clock", "height"}
    of_recording = [reason for reason in of_recording if reason.cause not in known]
    ranked = sorted([*of_recording, *of_run], key=lambda reason: reason.weight)
    return list({(reason.cause, reason.source): reason for reason in ranked}.values())


def _symptoms(solution: Solution, sources: list[JudgedFixes]) -> Iterator[Reason]:
    """Yield the reasons that the run shows and a correct set-up does not."""
    if "stopped" in solution.meta:  # what it did before is of no interest
        yield from evidence.check_divergence(solution)
        return
    biases, smoother = list(evidence.biases(solution)), list(evidence.smoother(solution))
    yield from (*biases, *smoother)
    of_sources, runs = [], solution.rejected
    left_out = {each["source"] for each in solution.meta.get("heights_apart", ())}
    for source in (each for each in sources if each.name not in left_out):
        found = [
            *evidence.noise(source),
            *(evidence.explain_reason(each, runs) for each in evidence.rejections(source)),
            *(evidence.explain_reason(each, runs) for each in evidence.jumps(source)),
        ]
        of_sources += sorted(found, key=lambda reason: -reason.weight)[:1]
    yield from of_sources
    if not (biases or smoother or of_sources):  # which say why rows are doubtful
        yield from evidence.doubts(solution)
    for source in sources:
        if source.kind in ("position", "velocity"):
            yield from evidence.course(solution, source.t)
            break


def _untested_claims(
    solution: Solution, sources: list[JudgedFixes], seconds: float
) -> Iterator[str]:
    """Yield what could not be tested, and why."""
    if seconds < MIN_TIME:
        yield f"anything that takes time: the run lasts {seconds:.0f} s, of {MIN_TIME:.0f} s needed"
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
    moves = in_motion(solution)
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
