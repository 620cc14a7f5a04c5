"""Definition of "silently wrong", here and nowhere else.

From 60 s on, an error of a component of position, velocity or attitude is compared with five
standard deviations that the filter states for it; where it states none, with twice the largest
error of the run without a fault. A run is wrong where a component is beyond that for a second in
all. It is silently wrong where that second lies in rows whose status is valid or bridged, and no
event and no note says what the run without a fault does not say too. Where that run is wrong
itself and says so, its events count as said here too. A number of rejected fixes says nothing. Where
rows and events say nothing, the verdict is asked: what it has against the run, and not against the
run without a fault, is said too, and begins with "verdict:" in the table.
"""

import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from strapdown.checks import DataError
from strapdown.core.loop.contract import BRIDGED, DOUBTFUL, VALID
from strapdown.data.solution import Innovations, Trajectory
from strapdown.data.verdict import NOT_JUDGED, Verdict
from strapdown.evaluation.metrics import errors, interpolate_reference
from strapdown.typing import Array, Ints

OK, REFUSED, SAID, SILENT, CRASH = "ok", "refused", "said", "silent", "crash"
ORDER = (OK, REFUSED, SAID, SILENT, CRASH)
"""Outcomes of a run, the better before the worse."""
SETTLED, SIGMAS, LASTING = 60.0, 5.0, 1.0
TIMES_NOMINAL = 2.0
COMPONENTS = 9


def _not_judged() -> Verdict:
    return Verdict(NOT_JUDGED)


class FaultOutcome(NamedTuple):
    """Output of a run."""

    trajectory: Trajectory
    status: Ints  # (n,)
    notes: tuple[str, ...]
    events: tuple[tuple[float, str], ...]  # (t in s, text)
    ask: Callable[[], Verdict] = _not_judged  # for the verdict, which takes longer
    innovations: Innovations | None = None

    @property
    def texts(self) -> tuple[str, ...]:
        """Texts of the events."""
        return tuple(text for _, text in self.events)


class Nominal(NamedTuple):
    """The run without a fault that others are compared with."""

    largest: Array  # (9,) error of each component; NaN of what is not estimated
    # what it says though nothing is wrong, in plain words, without numbers
    says: frozenset[str]
    # the truth at its rows, which most runs have too: interpolating it takes half the time
    truth: Trajectory | None = None
    ask: Callable[[], Verdict] = _not_judged
    innovations: Innovations | None = None


class JudgedRun(NamedTuple):
    """Verdict of a run, with the numbers behind it."""

    verdict: str  # one of ORDER
    wrong_s: float  # beyond what is allowed, in rows of any status
    believed_s: float  # the same in rows that are valid or bridged
    doubtful_s: float  # status doubtful
    largest: float  # error over standard deviation, in rows that are valid or bridged
    position_m: float  # largest error
    attitude_deg: float
    says: str  # what the run without a fault does not say
    shown_std: float = np.nan  # `deflection`


def plain(text: str) -> str:
    """A text without its numbers, which differ from run to run."""
    return re.sub(r"[-+]?\d[\d.,]*(e[-+]?\d+)?", "#", text)


def news(says: Iterable[str], known: frozenset[str]) -> tuple[str, ...]:
    """Return the texts that the run without a fault does not give too, each once."""
    return tuple(dict.fromkeys(text for text in says if plain(text) not in known))


class _Errors(NamedTuple):
    size: Array  # (n, 9) without sign, m, m/s, rad
    std: Array  # (n, 9)
    status: Ints
    step: float  # s


def _errors(outcome: FaultOutcome, reference: Trajectory) -> _Errors:
    """Errors from SETTLED on; what is not known is NaN."""
    e = errors(outcome.trajectory, reference)
    size = np.abs(np.hstack([e.position, e.velocity, e.attitude]))
    std = np.full(size.shape, np.nan) if e.std is None else e.std[:, :COMPONENTS]
    late = e.t > SETTLED
    step = float(np.median(np.diff(e.t))) if len(e.t) > 1 else 0.0
    return _Errors(size[late], std[late], outcome.status[e.rows][late], step)


def nominal(outcome: FaultOutcome, reference: Trajectory) -> tuple[Nominal, JudgedRun]:
    """A run without a fault, and what it comes to itself."""
    e = _errors(outcome, reference)
    known = np.isfinite(e.size).any(axis=0)
    largest = np.where(known, np.nanmax(e.size, axis=0, initial=0.0), np.nan)
    notes, events = (frozenset(map(plain, texts)) for texts in (outcome.notes, outcome.texts))
    own = judge_run(outcome, reference, Nominal(largest, notes))
    truth = interpolate_reference(reference, outcome.trajectory.t)
    says = notes | events if own.verdict == OK else notes
    return Nominal(largest, says, truth, outcome.ask, outcome.innovations), own


def deflection(innovations: Innovations | None, right: Innovations | None) -> float:
    """Return how much of a fault the innovations of a filter show, in standard deviations: the length of
    the difference of all its whitened innovations from those without the fault.

    Whitened innovations are N(0, 1) without a fault, so that of all tests of them the likelihood ratio of
    this very fault, with onset and size known, tells most, and it is shifted by so many standard
    deviations (Van Trees 1968, section 2.6). NaN where the two do not have the same fixes."""
    if innovations is None or right is None or not np.array_equal(innovations.t, right.t):
        return np.nan
    if innovations.whitened is None or right.whitened is None:
        return np.nan
    return float(np.sqrt(np.nansum((innovations.whitened - right.whitened) ** 2)))


def judge_error(error: Exception) -> JudgedRun:
    """Return the JudgedRun of a run that ended in a DataError (refused) or another error."""
    verdict = REFUSED if isinstance(error, DataError) else CRASH
    text = str(error) if verdict == REFUSED else f"{type(error).__name__}: {error}"
    return JudgedRun(verdict, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, text)


def judge_run(outcome: FaultOutcome, reference: Trajectory, right: Nominal) -> JudgedRun:
    """Judge a run against the run without a fault."""
    new = news((*outcome.notes, *outcome.texts), right.says)
    text = " | ".join(new)
    if right.truth is not None and np.array_equal(right.truth.t, outcome.trajectory.t):
        reference = right.truth
    try:
        e = _errors(outcome, reference)
    except DataError:  # no time in common with the truth: nothing of it is right
        return JudgedRun(SAID if new else SILENT, np.inf, np.inf, 0.0, np.inf, np.inf, np.inf, text)
    known = np.isfinite(right.largest)
    one_std = np.where(np.isfinite(e.std), e.std, right.largest * TIMES_NOMINAL / SIGMAS)
    with np.errstate(all="ignore"):
        ratios = e.size / one_std
    # a number that is missing where there is one without the fault is as wrong as can be
    ratios = np.where(np.isfinite(ratios), ratios, np.inf)[:, known]
    ratio = ratios.max(axis=1, initial=0.0)
    believed = np.isin(e.status, (VALID, BRIDGED))
    wrong_s, believed_s = (
        float((beyond.sum()) * e.step) for beyond in (ratio > SIGMAS, (ratio > SIGMAS) & believed)
    )
    verdict = _verdict(wrong_s, believed_s, bool(new))
    if verdict == SILENT and (against := _against(outcome, right)):
        verdict, text = SAID, f"verdict: {against}"
    return JudgedRun(
        verdict,
        wrong_s,
        believed_s,
        float((e.status == DOUBTFUL).sum() * e.step),
        float(ratio[believed].max(initial=0.0)),
        _largest(e.size[:, :3]),
        float(np.degrees(_largest(e.size[:, 6:]))),
        text,
        deflection(outcome.innovations, right.innovations),
    )


def _against(outcome: FaultOutcome, right: Nominal) -> str:
    """Return the verdict's reasons against a run that are not also reasons against the run without
    a fault; empty where none are."""
    known = {reason.what for reason in right.ask().reasons if reason.weight >= 1}
    return " | ".join(
        str(reason)
        for reason in outcome.ask().reasons
        if reason.weight >= 1 and reason.what not in known
    )


def _verdict(wrong_s: float, believed_s: float, new: bool) -> str:
    if wrong_s < LASTING:
        return OK
    return SAID if new or believed_s < LASTING else SILENT


def _largest(size: Array) -> float:
    """Return the largest length of (n, 3) components; NaN components count as 0."""
    return float(np.linalg.norm(np.nan_to_num(size), axis=1).max(initial=0.0))
