"""The clock of heights against that of the IMU, for filters of heave: where heights are late, their
innovations follow the vertical velocity. And by how much they may be late without showing it."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..core.loop.contract import VEL
from ..data.solution import Solution
from ..data.verdict import HEIGHT, VELOCITY, Reason, SetUpBound, Untested
from ..installation.screening import DETECTED, Looked
from ..units.constants import SETTLING
from .evidence import GATED, JudgedFixes

KINDS = ("altitude", "pressure", "pressure-altitude")
"""Kinds whose innovation is a height, m, down."""
SURE, MIN_OFFSET = 3.5, 0.05
"""Standard deviations (chance exceeds them once in 2000 recordings) and s from which a clock is a reason."""


class HeightClock(NamedTuple):
    """Clock offset of a source of height."""

    source: str
    late: float  # s by which the IMU is later than the heights
    std: float  # s

    @property
    def bound(self) -> float:
        """The smallest offset, s, that would have shown in 95 of 100 recordings like this."""
        return max(SURE * self.std, MIN_OFFSET) + DETECTED * self.std


def look(solution: Solution, sources: Iterable[JudgedFixes]) -> Looked:
    """Return the reasons and limits of the clocks of all heights."""
    found = Looked([], [], [])
    for clock in filter(None, (estimate_clock(solution, source) for source in sources)):
        bound, less = limits(clock)
        found.reasons.extend(reason(clock))
        found.unknown.append(less)
        found.bounds.append(bound)
    return found


def estimate_clock(solution: Solution, source: JudgedFixes) -> HeightClock | None:
    """Return the least squares estimate of a clock; None for filters that estimate a position, whose clocks
    `installation` knows, and where too little was measured."""
    v, std = solution.trajectory.v_n, solution.trajectory.std
    if source.kind not in KINDS or solution.has_position or v is None or std is None:
        return None
    e = source.innovation[:, 0]
    known = (source.t > solution.t[0] + SETTLING) & np.isfinite(e)
    if known.sum() < GATED or not np.isfinite(std[-1, VEL][2]):
        return None
    speed = np.interp(source.t[known], solution.t, v[:, 2])
    A = np.c_[speed, np.ones(len(speed))]
    A[:, 0] -= speed.mean()
    (late, mean), *_ = np.linalg.lstsq(A, e[known], rcond=None)
    left = e[known] - A @ [late, mean]
    power = (A[:, 0] ** 2).sum()
    if not power > 0:
        return None
    return HeightClock(source.name, float(late), float(np.sqrt(left.var() / power)))


def reason(clock: HeightClock) -> list[Reason]:
    """Return a Reason where the clock is off; else []."""
    if abs(clock.late) < max(SURE * clock.std, MIN_OFFSET):
        return []
    side = "later" if clock.late > 0 else "earlier"
    return [
        Reason(
            "clock",
            f"its innovations follow the vertical velocity: the IMU is {abs(clock.late):.2g} +- "
            f"{clock.std:.2g} s {side} than these heights ({SURE:g} standard deviations at most)",
            "set `offset` of one of them, so that both have one clock",
            clock.source,
            float(abs(clock.late) / max(SURE * clock.std, MIN_OFFSET)),
        )
    ]


def limits(clock: HeightClock) -> tuple[SetUpBound, Untested]:
    """Return the smallest offset that would have shown, and that less would not."""
    what = f"clock of {clock.source}"
    return SetUpBound("clock", what, clock.bound, "s"), Untested(
        f"{what} below {clock.bound:.2g} s",
        "its noise hides how late the heights are",
        "record heights of less noise, or for longer",
        (HEIGHT, VELOCITY),
        "clock",
    )
