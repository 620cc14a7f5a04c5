"""What `tune` found: the noise of the IMU and of each source, how certain, and what the data do not
decide."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from ..data import Solution
from ..recording import Recording
from ..sensor_models.imu import ImuSpec
from ..typing import Array

TUNED, AT_MOST, AT_LEAST, OPEN, KEPT = "tuned", "at most", "at least", "open", "kept"
"""Status of a Parameter: both ends of its interval are there; only the upper; only the lower; none;
or its innovations are correlated for reasons that the model lacks, so that a smaller value would
mean nothing, and the given one stays."""
IMU = "imu"
"""What names the IMU where a source could stand."""


class Parameter(NamedTuple):
    """A number of the noise model, SI."""

    source: str  # name of the source, or IMU
    # "gyro noise", "accel noise", "gyro bias walk", "accel bias walk" of the IMU; "noise",
    # "correlated error" with its rows, "correlation time" of a source
    name: str
    unit: str  # as shown
    factor: float  # from SI to it
    given: float  # 0: none
    value: float  # what the tuned recording and IMU have
    low: float  # ends of the 95 % interval of the profile likelihood; 0 where it is open
    high: float  # inf where it is open
    status: str
    # the scan of the profile: values and twice the loss of log-likelihood, (k,) each
    scan: tuple[Array, Array]


class Direction(NamedTuple):
    """A way in which several parameters can change together without the data minding."""

    weights: Mapping[str, float]  # {source and name: change of its logarithm}, of unit length
    # factor by which the parameters of the largest weight may change along it, 95 %
    spread: float
    text: str


class Fit(NamedTuple):
    """How well the innovations of a source fit, before and after."""

    source: str
    nis: tuple[float, float]  # median over the median of its chi-square
    correlation: tuple[float, float]  # of whitened innovations one fix apart
    rejected: tuple[float, float]  # share of its fixes


@dataclass(frozen=True)
class Tuning:
    """The noise that a recording tells."""

    parameters: tuple[Parameter, ...]
    directions: tuple[Direction, ...]
    fits: tuple[Fit, ...]
    recording: Recording  # as given
    tuned: Recording  # its sources with the values found
    imu: ImuSpec  # with the noise found
    log_likelihood: tuple[float, float]  # before and after, of the same fixes
    runs: int  # of the filter
    seconds: tuple[float, float]  # part of the recording that was used, s
    before: Solution
    after: Solution
    notes: tuple[str, ...] = field(default=())
