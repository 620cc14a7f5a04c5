"""Results from the maximum and its profiles: a value with a status for each unknown, and the
directions that the data do not determine."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data.solution import Solution
from ..evaluation.fix_statistics import counts
from ..typing import Array
from ..units.constants import CHI_SQUARE_95
from .findings import AT_MAX, AT_MIN, KEPT, OPEN, TUNED, Direction, NoiseParameter, SourceFit
from .fisher_scoring import LikelihoodProfile, Top, climb
from .search import Search
from .unknowns import NoiseUnknown

SPREAD = 3.0
"""Factor of a 95 % spread from which a direction is named."""
TOGETHER = 0.3
"""Weight from which an unknown belongs to a direction."""


class Conclusions(NamedTuple):
    """Values and statuses, and log L with them."""

    theta: Array  # (p,) logarithms; of what was given as none and stays so, -inf
    status: list[str]
    log_likelihood: float


def judge(search: Search, profiles: Sequence[LikelihoodProfile]) -> Conclusions:
    """A value for each unknown. What has no lower end is the given value where that lies within
    the interval, else the upper end, and the others follow it."""
    bounds = [(np.isfinite(each.low), np.isfinite(each.high)) for each in profiles]
    status = [
        {(True, True): TUNED, (False, True): AT_MAX, (True, False): AT_MIN}.get(each, OPEN)
        for each in bounds
    ]
    theta = _reported_theta(search, profiles, status)
    for j in search.held_unknowns(theta):
        status[j] = KEPT
    return Conclusions(theta, status, search.likelihood.at(theta).log_likelihood)


def _reported_theta(
    search: Search, profiles: Sequence[LikelihoodProfile], status: Sequence[str]
) -> Array:
    """The maximum, with those that have no lower end where `judge` wants them, one after the other,
    as long as log L does not fall by more than the intervals allow."""
    top, likelihood = search.top, search.likelihood
    best = top.point.log_likelihood
    theta = top.point.theta
    free = np.ones(len(theta), bool)
    loose = [j for j, each in enumerate(status) if each in (AT_MAX, OPEN)]
    for j in sorted(loose, key=lambda j: -profiles[j].high):
        wanted = min(_log_given(search.unknowns[j], theta[j]), profiles[j].high)
        tried = theta.copy()
        tried[j] = np.clip(wanted, likelihood.low[j], likelihood.high[j])
        free[j] = False
        here = climb(likelihood, tried, np.flatnonzero(free), 6)
        if 2 * (best - here.point.log_likelihood) < CHI_SQUARE_95:
            theta = here.point.theta
    return theta.copy()


def _log_given(unknown: NoiseUnknown, otherwise: float) -> float:
    return float(np.log(unknown.given)) if unknown.given else otherwise


def parameters(
    search: Search, profiles: Sequence[LikelihoodProfile], judged: Conclusions
) -> tuple[NoiseParameter, ...]:
    """Return the Parameter of each unknown."""
    return tuple(
        NoiseParameter(
            each.source,
            each.what,
            each.part,
            each.unit,
            each.factor,
            each.given,
            float(np.exp(value)),
            float(np.exp(found.low)),
            float(np.exp(found.high)),
            status,
            (np.exp(found.values), found.loss),
        )
        for each, found, value, status in zip(
            search.unknowns, profiles, judged.theta, judged.status
        )
    )


def directions(top: Top, unknowns: Sequence[NoiseUnknown]) -> tuple[Direction, ...]:
    """Ways in which several unknowns can change together by more than SPREAD, though each would be
    told if the others were known."""
    F = top.slope.information
    least = CHI_SQUARE_95 / np.log(SPREAD) ** 2
    told = np.flatnonzero(np.diag(F) > least)
    values, vectors = np.linalg.eigh(F[np.ix_(told, told)])
    found = []
    for value, weights in zip(values, vectors.T):
        main = [i for i in np.argsort(-np.abs(weights)) if abs(weights[i]) > TOGETHER]
        if value > least or len(main) < 2:
            continue
        exponent = np.sqrt(CHI_SQUARE_95 / max(value, 1e-6)) * abs(weights[main[0]])
        spread = float(np.exp(min(exponent, np.log(1e4))))
        chosen = [unknowns[told[i]] for i in main]
        same = bool(np.sign(weights[main[0]]) == np.sign(weights[main[1]]))
        text = _text(chosen, same, spread)
        by_name = {unknowns[told[i]].label: float(weights[i]) for i in main}
        found.append(Direction(by_name, spread, text))
    return tuple(found)


def _text(chosen: Sequence[NoiseUnknown], same: bool, spread: float) -> str:
    first, *others = (each.label for each in chosen)
    what, how = ("ratio", "with") if same else ("sum", "against")
    size = "any factor" if spread > 1e3 else f"a factor of {spread:.2g}"
    return (
        f"{first} {how} {' and '.join(others)}: the data determine only their {what}; {first} can "
        f"change by {size} if the other follows"
        if len(others) == 1
        else f"{first} {how} {' and '.join(others)}: the data determine only their combination; "
        f"{first} can change by {size} if the others follow"
    )


def fits(search: Search, after: Solution) -> tuple[SourceFit, ...]:
    """The fit of the innovations of the counted sources, in the part that was used."""
    first, last = search.seconds
    found = []
    for s in search.counted:
        a = search.run.recording.sources[s]
        name = a.name or a.kind
        both = [counts(each.innovations, name, first, last) for each in (search.before, after)]
        (nis0, r0, out0), (nis1, r1, out1) = both
        found.append(SourceFit(name, (nis0, nis1), (r0, r1), (out0, out1)))
    return tuple(found)
