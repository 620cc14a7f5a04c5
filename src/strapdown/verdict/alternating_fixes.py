"""Fixes of two antennas or receivers in one source: every other one is off the ones between. Their offset
passes the gate and averages out in the filter; a smoother, whose std is smallest, errs most by it."""

from collections.abc import Iterator

import numpy as np

from ..core.mathematics.rotation import quaternion_to_euler
from ..data.solution import Solution
from ..data.verdict import Reason
from ..units.constants import SETTLING
from .evidence import GATED, JudgedFixes

MAX_OFF = 5.0
"""Standard deviations by which every other fix may be off: of 4 components of 2 sources, chance exceeds it
once in 15 000 recordings; of 72 simulated ones the largest is 4.5, of recorded ones 1.1."""
FAST = 0.75
"""Share of the highest frequency from which on the others say how large innovations are by chance: the
gains of observers leave more of the fast ones."""
UNITS = {"position": "m", "velocity": "m/s"}
SIDES = ("north", "east", "along the body", "across it")


def check(solution: Solution, source: JudgedFixes) -> Iterator[Reason]:
    """Yield a Reason where every other innovation is off, in axes of the Earth or of the body."""
    settled = source.t > solution.t[0] + SETTLING
    known = settled & np.isfinite(source.innovation[:, :2]).all(axis=1)
    if source.kind not in UNITS or solution.trajectory.q_nb is None or known.sum() < GATED:
        return
    north, east = source.innovation[known, :2].T
    row = np.minimum(np.searchsorted(solution.t, source.t[known]), len(solution.t) - 1)
    yaw = quaternion_to_euler(solution.trajectory.q_nb[row])[:, 2]
    c, s = np.cos(yaw), np.sin(yaw)
    e = np.stack([north, east, c * north + s * east, c * east - s * north])
    off = (e * np.resize([-1.0, 1.0], known.sum())).sum(axis=1)
    power = np.abs(np.fft.rfft(e, axis=1)) ** 2
    z = np.abs(off) / np.sqrt(power[:, int(FAST * power.shape[1]) : -2].mean(axis=1))
    side = int(np.argmax(z))
    if z[side] > MAX_OFF:
        yield Reason(
            "lever arm",
            f"every other fix is {2 * abs(off[side]) / known.sum():.2g} {UNITS[source.kind]} off the "
            f"others {SIDES[side]}, {z[side]:.1f} standard deviations ({MAX_OFF:g} at most): two "
            "antennas or receivers in one source",
            "make a source of each, with its own lever arm",
            source.name,
            float(z[side] / MAX_OFF),
        )
