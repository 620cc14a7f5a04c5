"""A trial of BROAD, and what an estimator made of it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapdown.data.recording import Recording
from strapdown.typing import Mask


class BroadTrial(NamedTuple):
    """One trial as everybody gets it."""

    name: str  # of the file
    recording: Recording
    arrays: dict[str, np.ndarray[Any, Any]]  # of the file, in the sensor's axes
    fs: float  # Hz
    scored: Mask  # (n,) bool: IMU samples with movement and a known reference

    @property
    def number(self) -> str:
        """The number that its name begins with."""
        return self.name.partition("_")[0]


class TrialRun(NamedTuple):
    """An estimator on a trial."""

    estimator: str
    trial: str
    # (n, 3) orientation, inclination and heading error at the IMU samples, rad; NaN where one of
    # the two is not known
    angles: NDArray[np.float32]
    us: float  # microseconds per IMU sample
    # rms of the attitude error over its standard deviation, north, east, down, over the scored
    # samples
    over: tuple[float, ...] = (np.nan,) * 3
