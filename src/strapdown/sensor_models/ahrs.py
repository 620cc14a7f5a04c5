"""MeasurementModel equation of an attitude and heading reference system (AHRS): roll, pitch and heading
with white errors.

    C_meas = exp([e_n x]) C_nb,   e_n = Rz(heading) (e_roll, e_pitch, e_heading),
    e ~ N(0, std^2), independent from fix to fix

The errors are a small rotation about the horizontal forward and right axes and the vertical, as in
the innovation of the source `attitude`, so that they mean the same in every attitude. Real AHRS err
in correlated ways; the white errors are those of Fossen (2021), Handbook of Marine Craft, section
14.3.2.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..checks import DataError, check_array, check_number
from ..data.solution import Source, Trajectory
from ..geometry.rotations import Rotation
from ..typing import Array
from .magnetometer import rotation_at
from .sampling import as_triple, sample_times
from .streams import RandomStream, SeedLike

MAX_ANGLE_STD = np.radians(30)
"""rad: errors beyond this are no small angles, and probably in deg."""


@dataclass(frozen=True)
class Ahrs:
    """An AHRS, SI and radians. One number for `std` stands for three. Raises DataError on what
    none can be."""

    rate: float | None = 10.0  # fixes per second; None: one with every IMU sample
    # rad: of roll, pitch and heading, white
    std: tuple[float, ...] | float = tuple(np.radians([0.5, 0.5, 1.0]).tolist())

    def __post_init__(self) -> None:
        if self.rate is not None:
            check_number(self.rate, "attitude: rate", "Hz", above=0)
        std = check_array(
            as_triple(self.std),
            "attitude: std",
            (3,),
            what="numbers: of roll, pitch and heading, rad",
            above=0,
            most=MAX_ANGLE_STD,
        )
        object.__setattr__(self, "std", tuple(std.tolist()))

    def measure(self, truth: Trajectory, seed: SeedLike) -> Source:
        """Source "attitude" of a flight; truth: data.Trajectory with attitude, `seed` as of
        `ImuSpec.corrupt`. Raises DataError."""
        return self.plan(truth).fixes(seed)

    def plan(self, truth: Trajectory, gate: float | None = None) -> "AhrsPlan":
        """Return the AhrsPlan that all runs over one trajectory share; `gate` is that of its
        source. Raises DataError."""
        if truth.q_nb is None:
            raise DataError("attitude: the trajectory has no attitude")
        t = sample_times(truth, self.rate)
        return AhrsPlan(
            Source(
                "attitude", t, np.empty((0, 3)), np.tile(self.std, (len(t), 1)), (), gate, "AHRS"
            ),
            rotation_at(truth, t),
        )


class AhrsPlan(NamedTuple):
    """Error-free measurements of an AHRS; each run adds its own errors."""

    source: Source  # all but its y
    attitude: Rotation  # (n,), body to navigation

    def fixes(self, seed: SeedLike) -> Source:
        """The source of one run."""
        error = RandomStream.of(seed).standard_normal((len(self.source.t), 3))
        error *= self.source.std
        if not len(error):
            return self.exact()
        forward = Rotation.from_rotvec(_heading(self.attitude)[:, None] * [0.0, 0.0, 1.0])
        return self._with(Rotation.from_rotvec(forward.apply(error)) * self.attitude)

    def exact(self) -> Source:
        """The source of an AHRS without errors, which states those of the one with them."""
        return self._with(self.attitude)

    def notes(self, source: Source) -> list[str]:
        """Sentences for the notes of a recording: no fix at all."""
        return (
            []
            if len(source.t)
            else ["AHRS: not one fix falls into the recording; its rate is too low"]
        )

    def _with(self, attitude: Rotation) -> Source:
        t = self.source.t
        y = (
            Trajectory(t, np.empty((0, 3)), q_nb=attitude.as_wxyz()).rph
            if len(t)
            else np.empty((0, 3))
        )
        return replace(self.source, y=y)


def _heading(attitude: Rotation) -> Array:
    """(n,) rad, in (-pi, pi]."""
    forward = attitude.apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[:, 1], forward[:, 0])
