"""The numbers of a noise model, one table: those of the IMU, and those of each source."""

from dataclasses import dataclass
from typing import NamedTuple

from ..engine.installation import IMU as IMU


class NoiseKind(NamedTuple):
    """A kind of number of the noise model."""

    name: str
    meaning: str
    field: str = ""  # of Noise; "" of a number of a source
    si: str = ""  # SI unit of a number of the IMU; that of a source's follows its kind


OF_IMU = (
    NoiseKind("gyro noise", "white noise of the turn rate", "gyro", "rad/sqrt(s)"),
    NoiseKind("accel noise", "white noise of the specific force", "accel", "m/s/sqrt(s)"),
    NoiseKind("gyro bias walk", "how fast the gyro bias wanders", "gyro_bias", "rad/s/sqrt(s)"),
    NoiseKind(
        "accel bias walk",
        "how fast the accelerometer bias wanders",
        "accel_bias",
        "m/s^2/sqrt(s)",
    ),
)
WHITE = NoiseKind("noise", "std of errors that are independent from fix to fix")
LASTING = NoiseKind("correlated error", "std of time-correlated errors")
TIME = NoiseKind("correlation time", "correlation time of those errors")


@dataclass(frozen=True)
class NoiseNumber:
    """A number of the noise model. Values are in SI."""

    source: str  # name of the source, or IMU
    what: NoiseKind
    part: str  # "horizontal" or "vertical" where these have numbers of their own
    unit: str  # as shown
    factor: float  # from SI to it
    given: float  # 0: none

    @property
    def name(self) -> str:
        """The name of its kind, with its part."""
        return f"{self.what.name} {self.part}".rstrip()

    @property
    def label(self) -> str:
        """Source and name; of the IMU the name alone, which says the sensor."""
        return self.name if self.source == IMU else f"{self.source} {self.name}"
