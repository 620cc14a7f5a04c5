"""A sensor with a mistake, beside GNSS: who says it, and what becomes of the solution."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Innovations, Solution
from strapdown.data.verdict import TRUSTED, Reason
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors, outages
from strapdown.geometry.geodesy import wrap
from strapdown.io.facts import recording_facts
from strapdown.typing import Array

from .mistakes import DELAYED, LATE, MISTAKES, SensorMistake
from .sensors import GNSS, WITH_DIVE, SensorMotion, record_motion, with_kinds

RIGHT = "none"
"""Name of the mistake of a right sensor."""
REFUSED = "refused"
"""Word of a run that ended in a DataError: the sensor cannot do harm."""
SKIPPED = 0.2
"""Part of a recording at its beginning that is not scored: the filter settles."""
OUTAGE = 30.0  # s
SAME = 1e-3
"""s by which stamps of one fix differ."""


class WrongSensorScore(NamedTuple):
    """rms of a solution with GNSS, and its largest error without."""

    rms: Array  # (3,) horizontal position m, velocity m/s, heading rad
    outage: float  # m, horizontal


def rows(name: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, sensor and mistake of a motion: what is said, and the errors over those without
    the sensor."""
    case = WITH_DIVE[name]
    for seed in seeds:
        whole = record_motion(case, seed)
        without, _ = _score(case, with_kinds(whole, ()))
        for kind in dict.fromkeys(a.kind for a in whole.sources if a.kind in MISTAKES):
            right = with_kinds(whole, (kind,))
            found = fuse(right).innovations
            for mistake in (None, *MISTAKES[kind]):
                yield {
                    "motion": name,
                    "sensor": kind,
                    "mistake": mistake.name if mistake else RIGHT,
                    "seed": seed,
                    **_cell(case, right, kind, mistake, without, found),
                }


def _cell(
    case: SensorMotion,
    right: Recording,
    kind: str,
    mistake: SensorMistake | None,
    without: WrongSensorScore,
    found: Innovations,
) -> dict[str, Any]:
    made = _with_mistake(right, kind, mistake) if mistake else right
    names = {a.name or a.kind for a in made.sources if a.kind == kind}
    try:
        inspected = recording_facts(made).reasons
        score, solution = _score(case, made)
    except DataError as error:  # one line that refuses
        return {"word": REFUSED, "said": True, "named": True, "text": str(error)}
    verdict = solution.verdict
    against = [reason for reason in verdict.reasons if reason.weight >= 1.0]
    told = [*inspected, *against]
    causes = mistake.causes if mistake else ()
    named = [reason for reason in told if reason.source in names and reason.cause in causes]
    return {
        "word": verdict.word,
        "said": bool(inspected) or verdict.word != TRUSTED,
        "named": bool(named),
        "shown": _shown_std(found, solution.innovations, mistake, _first_of(made, kind)),
        "worse": float((score.rms / without.rms).max()),
        "worse_in_outage": score.outage / without.outage,
        "text": " | ".join(_text(reason) for reason in told[:3]),
    }


def _shown_std(
    right: Innovations, wrong: Innovations, mistake: SensorMistake | None, changed: int
) -> float:
    """Standard deviations by which a mistake shifts the whitened innovations of all fixes that both runs
    have, as `faults.judging.deflection`; late ones are compared with themselves."""
    assert right.whitened is not None and wrong.whitened is not None
    squares = 0.0
    for s in np.unique(wrong.source):
        ours, theirs = np.flatnonzero(right.source == s), np.flatnonzero(wrong.source == s)
        t = wrong.t[theirs] - (LATE if mistake is DELAYED and s == changed else 0.0)
        pair = ours[np.minimum(np.searchsorted(right.t[ours], t - SAME), len(ours) - 1)]
        same = np.abs(right.t[pair] - t) < SAME
        change = wrong.whitened[theirs[same]] - right.whitened[pair[same]]
        squares += float(np.nansum(change**2))
    return float(np.sqrt(squares))


def _text(reason: Reason) -> str:
    return f"{reason.cause} {reason.weight:.2g} {reason.source}: {reason.seen}"


def _first_of(recording: Recording, kind: str) -> int:
    return next(i for i, a in enumerate(recording.sources) if a.kind == kind)


def _with_mistake(right: Recording, kind: str, mistake: SensorMistake) -> Recording:
    """The recording with the mistake in the first source of the kind."""
    first = _first_of(right, kind)
    start, stop = right.span
    wrong = mistake.make(right.sources[first]).between(start, np.nextafter(stop, start))
    sources = (*right.sources[:first], wrong, *right.sources[first + 1 :])
    return replace(right, sources=sources)


def _score(case: SensorMotion, recording: Recording) -> tuple[WrongSensorScore, Solution]:
    solution = fuse(recording)
    window = [(case.lost, case.lost + OUTAGE)]
    lost = fuse(recording.hidden(window, GNSS))
    found = outages(lost, recording.reference, window)[0]
    return WrongSensorScore(_rms(solution, recording), found.horizontal_max), solution


def _rms(solution: Solution, recording: Recording) -> Array:
    truth = recording.reference
    assert truth is not None
    start, stop = recording.span
    e = errors(solution, truth)
    late = e.t > start + SKIPPED * (stop - start)
    heading = np.interp(solution.t[late], truth.t, np.unwrap(truth.rph[:, 2]))
    off = wrap(solution.trajectory.rph[late, 2] - heading)
    horizontal, velocity = (
        np.linalg.norm(e.position[late, :2], axis=1),
        np.linalg.norm(e.velocity[late], axis=1),
    )
    return np.array([np.sqrt(np.mean(size**2)) for size in (horizontal, velocity, off)])
