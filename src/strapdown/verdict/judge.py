"""The Verdict of a Solution, from the statistics of its run, the problems that `inspect` finds in its
recording and the sensitivity of its innovations to the installation."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..data.solution import Solution
from ..data.verdict import NOT_JUDGED, QUANTITIES, Reason, Untested, Verdict
from ..installation import screening
from ..installation.states import estimated_installation, in_motion
from ..io.facts import check_parts, own_reasons
from ..plugins import one_line
from . import accelerating_fixes, alternating_fixes, beside_gnss, evidence, height_clock
from .evidence import GATED, JudgedFixes
from .guessed_axes import of_guessed_axes
from .mean_slip import mean_slip
from .observability import MIN_TIME, bounds, untested_claims
from .second_filter import SECOND, run_second_filter

Found = TypeVar("Found")
NOTHING_USED = Untested("anything", "the filter used no fix", rests=QUANTITIES)


class _Attempts:
    """Runs checks, none of which can cost the user the verdict: one that fails becomes a line in
    `unknown`."""

    def __init__(self, unknown: list[Untested]) -> None:
        self._unknown = unknown

    def __call__(self, what: str, function: Callable[..., Found], *arguments: Any) -> Found | None:
        """Return the result of a check; None where it failed."""
        try:
            return function(*arguments)
        except Exception as error:
            self._unknown.append(Untested(what, f"the check failed ({one_line(error)})"))
            return None


def judge(solution: Solution) -> Verdict:
    """The Verdict of a Solution that `fuse` or `smooth` made of a recording."""
    recording = solution.recording
    assert recording is not None  # `Solution.verdict` asks for no other
    sources = evidence.by_source(solution)
    seconds = recording.span[1] - solution.meta["start"]["t"]
    little = seconds < MIN_TIME or all(len(source.t) < GATED for source in sources)
    unknown = list(untested_claims(solution, sources, seconds))
    attempt = _Attempts(unknown)
    symptoms = attempt("the run", lambda: list(_symptoms(solution, sources))) or []
    installed = estimated_installation(solution)
    causes = [*evidence.gaps(solution), *evidence.heights(solution), *installed.reasons]
    causes += attempt("guessed axes", of_guessed_axes, recording) or []
    sensors = attempt("sensors beside GNSS", lambda: list(beside_gnss.reasons(solution))) or []
    looked = attempt("clock and lever arm", _look, solution, sources) or screening.NOTHING
    # a scale alone is not the whole of what is wrong with a sensor
    told = {reason.source for reason in sensors}
    causes += sensors + [each for each in looked.reasons if each.source not in told]
    unknown += looked.unknown
    shown = attempt("its bounds", lambda: list(bounds(solution, sources))) or []
    shown += looked.bounds
    inspected, untested = attempt("the recording", _inspect, solution) or ([], [])
    unknown += untested
    if not sources and not symptoms and not inspected:
        return Verdict(NOT_JUDGED, untested=(NOTHING_USED, *unknown))
    # what the filter has estimated is not as the recording has it
    found = {each.cause for each in installed.parameters if each.status != "not observable"}
    inspected = [reason for reason in inspected if reason.cause not in found]
    verdict = Verdict.of(_once(inspected, causes), unknown, symptoms, shown)
    if verdict.trusted and (more := _ask_last(attempt, solution)):
        verdict = Verdict.of(_once(inspected, causes), unknown, more, shown)
    return replace(verdict, word=NOT_JUDGED) if verdict.trusted and little else verdict


def _look(solution: Solution, sources: list[JudgedFixes]) -> screening.Looked:
    """Findings of a quick look at the installation; without motion the reasons alone, without positions
    those on the clocks of heights."""
    if not any(source.kind == "position" for source in sources):
        return height_clock.look(solution, sources)
    looked = screening.look(solution)
    return looked if in_motion(solution) else screening.NOTHING._replace(reasons=looked.reasons)


def _ask_last(attempt: _Attempts, solution: Solution) -> list[Reason]:
    """Return the reasons of the checks that cost a run of their own, until one alone is against the
    solution."""
    found: list[Reason] = []
    for what, check in (("a second filter", _second), ("fixes", accelerating_fixes.check)):
        found += attempt(what, check, solution) or []
        if any(reason.weight >= 1 for reason in found):
            break
    return found


def _second(solution: Solution) -> list[Reason]:
    """Return what the run of a second filter shows and that of the filter does not."""
    second = run_second_filter(solution)
    if second is None:
        return []
    said = f"{SECOND}, on the same recording: "
    return [
        reason._replace(seen=f"{said}{reason.seen}")
        for reason in _symptoms(second, evidence.by_source(second))
    ]


def _inspect(solution: Solution) -> tuple[list[Reason], list[Untested]]:
    """A Reason for each problem that `inspect` finds in what the filter used, and what it could not test
    that the solution rests on."""
    recording, (_, gyro) = solution.recording, solution.meta.get("bias_std") or (0.0, 0.0)
    assert recording is not None
    found = check_parts(recording)
    return [*found.reasons, *own_reasons(recording, gyro)], found.untested


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
    yield from (*biases, *smoother, *evidence.near_pole(solution), *mean_slip(solution))
    of_sources, runs = [], solution.rejected
    gaps = np.add(*evidence.long_gaps(solution))
    left_out = {each["source"] for each in solution.meta.get("heights_apart", ())}
    for source in (each for each in sources if each.name not in left_out):
        found = [
            *evidence.noise(source),
            *alternating_fixes.check(solution, source),
            *(evidence.explain_reason(each, runs) for each in evidence.rejections(source)),
            *(evidence.explain_reason(each, runs) for each in evidence.jumps(source, gaps)),
        ]
        of_sources += sorted(found, key=lambda reason: -reason.weight)[:1]
    yield from of_sources
    if not (biases or smoother or of_sources):  # which say why rows are doubtful
        yield from evidence.doubts(solution)
    for source in sources:
        if source.kind in ("position", "velocity"):
            yield from evidence.course(solution, source.t)
            break
