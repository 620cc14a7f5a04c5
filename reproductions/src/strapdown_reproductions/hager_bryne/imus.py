"""The IMUs of Table III as its numbers can be read."""

from dataclasses import replace

import numpy as np

from strapdown.core.loop.contract import Imu
from strapdown.sensor_models.imu import ImuSpec, imu as imu_spec
from strapdown.sensor_models.imu_errors import Shared


class StartsAtZero(ImuSpec):
    """An IMU whose Gauss-Markov biases are zero at the first sample and wander from there."""

    def shared_errors(self, imu: Imu) -> Shared:
        """As of any IMU, with no time before the first sample in which a bias could grow."""
        found = super().shared_errors(imu)
        return found._replace(step=np.r_[np.zeros(min(1, len(found.step))), found.step[1:]])


def starting_at_zero(name: str | ImuSpec = "paper1-tactical") -> StartsAtZero:
    """The ImuSpec of a grade whose biases are zero at the start."""
    spec = imu_spec(name)
    about = f"{spec.source} Here the biases are zero at the start."
    return StartsAtZero(f"{spec.name}-zero", spec.gyro, spec.accel, about, spec.warm_up)


def density_reading(name: str | ImuSpec = "paper1-tactical") -> ImuSpec:
    """The ImuSpec of a grade with sigma of Table III read as the density of the driving noise:
    stationary std = sigma sqrt(tau / 2)."""
    spec = imu_spec(name)
    wider = lambda triad: replace(
        triad, gauss_markov=triad.gauss_markov * float(np.sqrt(triad.time_constant / 2))
    )
    return replace(
        spec,
        name=f"{spec.name}-density",
        gyro=wider(spec.gyro),
        accel=wider(spec.accel),
        source=f"{spec.source} Here sigma is read as density.",
    )
