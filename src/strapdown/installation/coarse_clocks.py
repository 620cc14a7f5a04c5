"""Gross errors to exclude before anything can be estimated: clocks that are seconds off, velocities
in a wrong unit or frame, axes of the IMU."""

from collections.abc import Sequence

import numpy as np

from ..checks import DataError
from ..inspection import plane, position_velocity
from ..inspection.clock_offsets import coarse_lag
from ..inspection.motion import InspectedRecording
from ..typing import Array
from .iteration import receiver_clocks
from .model import Constant

MIN_LAG = 0.5
"""s: a smaller lag is left to the estimate, which finds it better."""
APART = 1.0
"""s: lags of two sources count as different where they differ by more."""


def check_axes(subject: InspectedRecording) -> None:
    """Refuse velocities that the positions contradict, and axes of the IMU that the velocities do.
    Raises DataError."""
    for reason in (*position_velocity.check(subject).reasons, *plane.check(subject).reasons):
        if reason.cause in ("unit", "frame", "axes"):
            raise DataError(f"{reason}; correct this before you diagnose the installation")


def coarse_clocks(subject: InspectedRecording, constants: Sequence[Constant]) -> list[Array]:
    """Candidates for theta (m,), the likeliest first: clocks of the GNSS sources by the lag between
    what they and the IMU tell of the motion.

    In the first, sources whose own lag is not believed go with the surest one; in the second each
    has its own. 0 below `MIN_LAG`, and for all other constants. A run must confirm them.
    """
    clocks = receiver_clocks(constants)
    lags = {
        j: lag
        for j in clocks
        if (lag := coarse_lag(subject, subject.recording.sources[constants[j].sources[0]]))
    }
    if not lags:
        return []
    surest = max(lags.values(), key=lambda lag: lag.evidence)
    found: list[Array] = []
    for believed in (True, False):
        theta = np.zeros(len(constants))
        for j in clocks:
            own = lags.get(j, surest)
            apart = abs(own.seconds - surest.seconds) > APART and (own.believed or not believed)
            theta[j] = own.seconds if apart else surest.seconds
        theta[np.abs(theta) < MIN_LAG] = 0.0
        if theta.any() and not any(np.array_equal(theta, other) for other in found):
            found.append(theta)
    return found
