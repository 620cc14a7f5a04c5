"""Noise whose size depends on the state, which (39) of Mollaei et al. is said to allow: by algebra,
for the simplest process that has it."""

from typing import NamedTuple

import numpy as np

from ..common.claims import JudgedClaim
from ..common.verdicts import SIZE, decide


class NoiseOfState(NamedTuple):
    """Variance of x (1 + w) after a step, x known to `share` of its mean of 1, w to `share` too."""

    share: float = 0.1

    @property
    def exact(self) -> float:
        """That of independent Gaussian x and w: P + (1 + P) q."""
        P = q = self.share**2
        return P + (1 + P) * q

    @property
    def by_points(self) -> float:
        """That by the points (37) to (39) of x and w, each of which moves x or w."""
        spread = np.sqrt(2) * self.share
        points = np.array([1 + spread, 1 - spread, 1 + spread, 1 - spread])
        return float(np.mean((points - points.mean()) ** 2))

    @property
    def linearised(self) -> float:
        """That by (22), which has M at the estimate: P + q."""
        return 2 * self.share**2


def carries_noise_of_state(_: object) -> JudgedClaim:
    """The variance by points is the exact one within SIZE: by algebra."""
    found = NoiseOfState()
    short = 1 - found.by_points / found.exact
    text = (
        f"for noise of {found.share:.0%} of a state known to {found.share:.0%} the points' variance "
        f"is {short:.1%} short, because each moves the state or the noise; that of (22) is "
        f"{1 - found.linearised / found.exact:.1%} short"
    )
    return JudgedClaim(decide(short < SIZE, short >= SIZE), text)
