"""The maximum of the likelihood, by Fisher scoring with damping, and the profile around it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..typing import Array, Ints, Mask
from ..units.constants import CHI_SQUARE_95
from .likelihood import Likelihood, Point, Slope, slope

ENOUGH = 0.02
"""Gain in log L that a further step must promise."""
MAX_STEP = np.log(3.0)
"""Change of a logarithm in one step at most."""
FLAT = np.log(100.0) ** -2
"""Added to the information of each unknown in a step: what the data do not decide stays where it
is."""
ROUNDS = 30
COUPLED = 0.1
"""Correlation in the information from which unknowns follow each other along a profile."""
POINTS = 8  # on each side of a profile
MAX_STRIDE = 1.2  # of the logarithm from one of them to the next
FOLLOWING = 2  # steps of the other unknowns at each of them


class Top(NamedTuple):
    """Where the search ended."""

    point: Point
    slope: Slope


def climb(
    likelihood: Likelihood,
    begin: Array,
    free: Ints,
    rounds: int = ROUNDS,
    point: Point | None = None,
) -> Top:
    """The maximum over the `free` unknowns from a place; the likelihood never falls on the way."""
    point = point or likelihood.at(begin)
    here, damping = slope(likelihood, point, free), 0.0
    for _ in range(rounds):
        better, damping = _advance(likelihood, point, here, damping)
        if better is None:
            break
        point, here = better, slope(likelihood, better, free)
    return Top(point, here)


def _advance(
    likelihood: Likelihood, point: Point, here: Slope, damping: float
) -> tuple[Point | None, float]:
    """(a better place, None where none is promised; the damping that it took, for the next)."""
    free = here.free
    while True:
        step = _step(likelihood, point, here, damping)
        own = step[free]
        if own @ here.score - 0.5 * own @ here.information @ own < ENOUGH:
            return None, damping
        tried = likelihood.at(point.theta + step)
        if tried.log_likelihood > point.log_likelihood:
            return tried, damping / 4 if damping > 0.1 else 0.0
        damping = max(4 * damping, 0.1)


def _step(likelihood: Likelihood, point: Point, here: Slope, damping: float) -> Array:
    """(p,) by which to go on: within the bounds, and none by more than MAX."""
    step = np.zeros(len(point.theta))
    free = here.free
    low, high = (likelihood.low - point.theta)[free], (likelihood.high - point.theta)[free]
    inside = np.ones(len(free), bool)
    for _ in range(len(free) + 1):
        some = np.flatnonzero(inside)
        F = here.information[np.ix_(some, some)]
        F = F + np.diag(damping * np.diag(F) + FLAT)
        found = np.zeros(len(free))
        found[some] = np.linalg.solve(F, here.score[some])
        outwards = inside & (((high <= 1e-9) & (found > 0)) | ((low >= -1e-9) & (found < 0)))
        if not outwards.any():
            break
        inside &= ~outwards
    found *= min(1.0, MAX_STEP / max(np.abs(found).max(initial=0.0), 1e-12))
    step[free] = np.clip(found, low, high)
    return step


class LikelihoodProfile(NamedTuple):
    """Growth of twice the loss of log L as one unknown is held elsewhere and the others follow."""

    values: Array  # (k,) rising logarithms
    loss: Array  # (k,) twice the loss
    low: float  # logarithms where it is CHI_SQUARE_95; -inf, inf where it stays less
    high: float
    better: Point | None  # a place above the maximum, where one was met


def profile(likelihood: Likelihood, top: Top, j: int) -> LikelihoodProfile:
    """The LikelihoodProfile of unknown `j`, which is one of the free ones of a maximum."""
    at = top.point.theta[j]
    loss_at: Callable[[Point], float] = lambda point: (
        2 * (top.point.log_likelihood - point.log_likelihood)
    )
    sides, ends, better = [], [], None
    for side in (-1.0, 1.0):
        points = _side(likelihood, top, j, side)
        losses = np.array([0.0, *map(loss_at, points)])
        xs = np.array([at, *(point.theta[j] for point in points)])
        ends.append(_interval_end(xs, losses, side))
        sides.append((xs, losses))
        best = max(points, key=lambda point: point.log_likelihood, default=None)
        if best and loss_at(best) < -2 * ENOUGH:
            better = best
    (x0, y0), (x1, y1) = sides
    return LikelihoodProfile(np.r_[x0[:0:-1], x1], np.r_[y0[:0:-1], y1], ends[0], ends[1], better)


def _side(likelihood: Likelihood, top: Top, j: int, side: float) -> list[Point]:
    """Points outwards until twice the loss is beyond CHI_SQUARE_95, or the bound is reached."""
    here, at = top.slope, top.point
    k = int(np.flatnonzero(here.free == j)[0])
    F = here.information + FLAT * np.eye(len(here.free))
    near = _coupled_unknowns(F, k)
    others = here.free[near]
    follow = -np.linalg.solve(F[np.ix_(near, near)], F[near, k]) if near.any() else np.empty(0)
    alone = F[k, k] + follow @ F[near, k]
    bound = (likelihood.high if side > 0 else likelihood.low)[j]
    stride = float(np.clip(np.sqrt(CHI_SQUARE_95 / max(alone, 1e-12)), 0.02, MAX_STRIDE))
    points: list[Point] = []
    x = at.theta[j]
    while len(points) < POINTS and (bound - x) * side > 1e-6:
        x_new = x + side * min(stride, (bound - x) * side)
        before = points[-1] if points else at
        theta = before.theta.copy()
        theta[others] = np.clip(
            theta[others] + follow * (x_new - x), likelihood.low[others], likelihood.high[others]
        )
        theta[j] = x = x_new
        points.append(_optimise_others(likelihood, theta, others))
        loss = 2 * (at.log_likelihood - points[-1].log_likelihood)
        if loss > CHI_SQUARE_95:
            break
        # on to where a parabola would cross, and a little further
        grown = np.sqrt(CHI_SQUARE_95 / max(loss, 1e-3))
        stride = float(
            np.clip(
                abs(x - at.theta[j]) * (1.1 * grown - 1), 0.5 * stride, min(4 * stride, MAX_STRIDE)
            )
        )
    return points


def _coupled_unknowns(F: Array, k: int) -> Mask:
    """(q,) Which unknowns are coupled to the k-th, straight or through others: the sizes of
    horizontal and vertical errors share their correlation time, and one held would hold it."""
    d = np.sqrt(np.diag(F))
    coupled = np.abs(F / d[:, None] / d) > COUPLED
    near = coupled[k]
    for _ in range(len(F)):
        near = coupled[near].any(axis=0)
    near[k] = False
    return near


def _optimise_others(likelihood: Likelihood, theta: Array, others: Ints) -> Point:
    """A place with the others near their best there."""
    point = likelihood.at(theta)
    for _ in range(FOLLOWING if len(others) else 0):
        better, _ = _advance(likelihood, point, slope(likelihood, point, others), 0.0)
        if better is None:
            break
        point = better
    return point


def _interval_end(xs: Array, losses: Array, side: float) -> float:
    """Where the root of the losses, taken as straight in between, is that of CHI_SQUARE_95."""
    roots = np.sqrt(np.maximum(losses, 0.0))
    beyond = np.flatnonzero(losses > CHI_SQUARE_95)
    if not len(beyond):
        return float(side * np.inf)
    b = beyond[0]
    share = (np.sqrt(CHI_SQUARE_95) - roots[b - 1]) / (roots[b] - roots[b - 1])
    return float(xs[b - 1] + share * (xs[b] - xs[b - 1]))
