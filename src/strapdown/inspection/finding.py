"""Result of a check of a recording."""

from dataclasses import dataclass, field

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason, Untested
from ..typing import Array, Ints

MIN_FIXES = 30
"""Fewer fixes say nothing of clocks, axes, units and noise."""
MIN_BLOCKS = 5
"""A standard deviation that rests on fewer blocks of time is not believed."""


@dataclass
class Checked:
    """Findings of one check of a recording, or of all."""

    facts: list[str]  # lines: what agrees
    reasons: list[Reason]  # what a correct set-up would not show
    inconclusive: list[str]  # lines "what could not be checked: why"
    # of these, what a solution rests on: for its verdict
    untested: list[Untested] = field(default_factory=list)

    @classmethod
    def empty(cls) -> "Checked":
        """Nothing said yet."""
        return cls([], [], [])

    @classmethod
    def with_unknown(cls, what: str, why: str) -> "Checked":
        """That `what` cannot be told, and why."""
        return cls([], [], [f"{what}: {why}"])

    def add(self, other: "Checked") -> None:
        """Take in what another check says."""
        self.facts.extend(other.facts)
        self.reasons.extend(other.reasons)
        self.inconclusive.extend(other.inconclusive)
        self.untested.extend(other.untested)


def label(source: Source) -> str:
    """Return the name of a source, or else its kind."""
    return source.name or source.kind


def clustered_least_squares(A: Array, y: Array, block: Ints) -> tuple[Array, Array, Array]:
    """(x, std, residuals) of the least squares A x = y.

    A (n, k), y (n,); `block` (n,) numbers stretches of time, within which errors may last: the
    standard deviations (k,) rest on how the blocks disagree (cluster-robust; Liang & Zeger 1986).
    NaN where A does not tell.
    """
    k, blocks = A.shape[1], int(block.max()) + 1 if len(block) else 0
    N = A.T @ A
    scale = np.sqrt(np.diag(N))
    if blocks < MIN_BLOCKS or not scale.all() or np.linalg.cond(N / np.outer(scale, scale)) > 1e6:
        return np.full(k, np.nan), np.full(k, np.nan), y
    inverse = np.linalg.inv(N)
    x = inverse @ (A.T @ y)
    residuals = y - A @ x
    score = A * residuals[:, None]
    meat = np.stack([np.bincount(block, column, blocks) for column in score.T], axis=1)
    V = inverse @ (meat.T @ meat) @ inverse * blocks / max(blocks - k, 1)
    return x, np.sqrt(np.diag(V)), residuals
