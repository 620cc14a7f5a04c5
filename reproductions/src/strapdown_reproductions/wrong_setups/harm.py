"""When a mistake does harm.

Of five quantities: horizontal position, height, velocity, roll and pitch (the angle between true
and estimated vertical), heading. A mistake is harmful where the rms of one over the scored time is
at least twice that of the right set-up, or where one is beyond three claimed standard deviations
for more than 5 % of the time while that of the right set-up is not. A length counts against the
root of the sum of the variances of its axes. Without truth: where the solution lies further than
three claimed standard deviations of the right set-up from that one for more than 5 % of the time.
"""

from typing import NamedTuple

import numpy as np

from strapdown.checks import DataError
from strapdown.data.solution import Solution, Trajectory
from strapdown.evaluation.metrics import Errors, any_known, attitude_angles, errors
from strapdown.typing import Array

from ..common.example_recordings import inside
from .cases import SetUpCase

DOUBLED, SIGMAS, OFTEN = 2.0, 3.0, 0.05
RATE = 5.0
"""Hz at which solutions are scored."""
QUANTITIES = {
    "horizontal position": slice(0, 2),
    "height": slice(2, 3),
    "velocity": slice(3, 6),
    "roll and pitch": slice(6, 8),
    "heading": slice(8, 9),
}
"""{quantity: its columns of the claimed standard deviations}."""


class Harm(NamedTuple):
    """Effect of a mistake on a solution; empty where it has none."""

    harmful: tuple[str, ...]  # quantities
    worse: float  # largest rms error over that of the right set-up; NaN without truth
    beyond: float  # largest share of time beyond three claimed standard deviations


class HarmScore(NamedTuple):
    """Score of a quantity: rms error, and the share of time beyond three standard deviations."""

    rms: float
    beyond: float


def sizes(e: Errors) -> dict[str, Array]:
    """{quantity: (n,) its error without sign}, of those that are known; m, m/s and rad."""
    found: dict[str, Array] = {}
    if any_known(e.position):
        found["horizontal position"] = np.hypot(e.position[:, 0], e.position[:, 1])
        found["height"] = np.abs(e.position[:, 2])
    if any_known(e.velocity):
        found["velocity"] = np.linalg.norm(e.velocity, axis=1)
    if any_known(e.attitude):
        angles = attitude_angles(e)
        found["roll and pitch"], found["heading"] = angles.inclination, angles.heading
    return found


def scores(e: Errors, std: Array) -> dict[str, HarmScore]:
    """{quantity: Score} of errors against the standard deviations std (n, 9)."""
    found = {}
    for quantity, size in sizes(e).items():
        known = np.isfinite(size)
        if not known.any():
            continue
        claimed = np.sqrt((std[known, QUANTITIES[quantity]] ** 2).sum(axis=1))
        far = size[known] > SIGMAS * claimed
        found[quantity] = HarmScore(float(np.sqrt((size[known] ** 2).mean())), float(far.mean()))
    return found


def thin_rows(solution: Solution, windows: tuple[tuple[float, float], ...]) -> Trajectory:
    """The rows of a solution that are scored: RATE of them a second within the windows."""
    own = solution.trajectory
    within = np.flatnonzero(inside(own.t, windows))
    step = max(1, round(1 / RATE / float(np.median(np.diff(own.t))))) if len(own) > 1 else 1
    return own.take(within[::step])


def against(truth: Trajectory, solution: Solution, case: SetUpCase) -> dict[str, HarmScore]:
    """{quantity: Score} of a solution against the truth."""
    e = errors(thin_rows(solution, case.windows), truth)
    assert e.std is not None
    return scores(e, e.std)


def score_against(right: Solution, wrong: Solution, case: SetUpCase) -> dict[str, HarmScore]:
    """{quantity: Score} of a solution against that of the right set-up and what that one
    claims."""
    own = right.trajectory
    e = errors(thin_rows(wrong, case.windows), own)
    assert own.std is not None
    nearest = np.clip(np.searchsorted(own.t, e.t), 0, len(own.t) - 1)
    return scores(e, own.std[nearest])


def of_right(case: SetUpCase, right: Solution) -> dict[str, HarmScore]:
    """{quantity: Score} of the right set-up's solution; empty without truth."""
    return against(case.recording.reference, right, case) if case.true else {}


def harm(
    case: SetUpCase, right: Solution, right_scores: dict[str, HarmScore], wrong: Solution
) -> Harm:
    """The Harm of a wrong set-up's solution beside that of the right one, whose scores are those
    of `of_right`. One that stopped, or has nothing in the scored time, is harmful."""
    if wrong.meta.get("stopped"):
        return Harm(("stopped",), np.inf, 1.0)
    try:
        if case.true:
            return compare_scores(right_scores, against(case.recording.reference, wrong, case))
        return compare_scores({}, score_against(right, wrong, case))
    except DataError:  # no time in common
        return Harm(("no solution",), np.inf, 1.0)


def compare_scores(right: dict[str, HarmScore], wrong: dict[str, HarmScore]) -> Harm:
    """The Harm by the Scores of both; without those of the right one by `beyond` alone."""
    if not wrong:
        return Harm(("no solution",), np.inf, 1.0)
    harmful = []
    for quantity, (rms, beyond) in wrong.items():
        before = right.get(quantity)
        doubled = before is not None and not rms < DOUBLED * before.rms
        overconfident = beyond > OFTEN and (before is None or before.beyond <= OFTEN)
        if doubled or overconfident:
            harmful.append(quantity)
    ratios = [rms / right[name].rms for name, (rms, _) in wrong.items() if name in right]
    return Harm(tuple(harmful), max(ratios, default=np.nan), max(s.beyond for s in wrong.values()))
