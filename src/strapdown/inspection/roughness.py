"""Accelerations that change from sample to sample more than any vehicle's: vibration so strong that the
accelerometer's range and rate no longer hold it, or spikes; and an axis that alone grows noisy."""

from collections.abc import Iterator

import numpy as np

from ..data.verdict import Reason
from ..typing import Array
from .finding import Checked
from .motion import InspectedRecording

BLOCK = 10.0
"""s of a part; the rms of the median part counts, so that single impacts do not."""
MAX_ROUGHNESS = 5.0
"""m/s^2 rms of an axis that a straight line through three samples leaves. Measured on recordings: 0.6 of a
car and of a shoe, 1.2 of a multicopter, 3.2 of a board that is tapped all the time."""


ALONE = 5.0
"""One axis must grow so much rougher on the way than the two others of its sensor, to be a fault of
its own: engines, roads and rotors shake all three (a light aircraft by 9, 11 and 20, a car by 11, 5, 6)."""
QUIET, NOISY = 0.1, 0.8
"""Shares of the parts that are less rough than what counts as the usual level, and as the later one."""


def check(subject: InspectedRecording) -> Checked:
    """Return reasons where the samples are too rough, or one axis alone grows rougher."""
    imu = subject.recording.imu
    parts = int((imu.t[-1] - imu.t[0]) / BLOCK) if len(imu.t) else 0
    if parts < 1 or len(imu.t) < 3 * parts:
        return Checked.empty()
    found = Checked.empty()
    for sensor, increments in (("accelerometer", imu.dv), ("gyro", imu.dtheta)):
        # what a straight line through three samples leaves; white noise keeps its size
        bend = np.diff(increments / imu.dt[:, None], 2, axis=0) / np.sqrt(6.0)
        each = np.array_split(bend, parts)
        if sensor == "accelerometer":
            rms = [np.sqrt((part**2).mean(axis=0)) for part in each]
            found.reasons.extend(_too_rough(np.median(rms, axis=0)))
        if not found.reasons:
            usual = [np.median(np.abs(part), axis=0) for part in each]
            found.reasons.extend(_rougher(sensor, np.array(usual)))
    return found


def _too_rough(rough: Array) -> Iterator[Reason]:
    axis = int(np.argmax(rough))
    if rough[axis] > MAX_ROUGHNESS:
        yield Reason(
            "accelerometer",
            f"accelerometer {'xyz'[axis]} changes by {rough[axis]:.0f} m/s^2 (rms) from sample to "
            "sample: vibration, or spikes",
            "mount the IMU on dampers, log it at its full rate, and check the log for "
            "transmission errors",
            weight=float(rough[axis] / MAX_ROUGHNESS),
        )


def _rougher(sensor: str, rough: Array) -> Iterator[Reason]:
    quiet, noisy = np.quantile(rough, [QUIET, NOISY], axis=0)
    if not quiet.all():  # coarse values that do not change
        return
    times = noisy / quiet
    axis = int(np.argmax(times))
    others = float(np.delete(times, axis).max())
    if times[axis] > ALONE * others:
        yield Reason(
            sensor,
            f"{sensor} {'xyz'[axis]} is {times[axis]:.2g} times as noisy in one part of the "
            f"recording as in another; the other axes differ by {others:.2g} times",
            f"leave that part out, or describe an IMU with that noise; check {sensor} "
            f"{'xyz'[axis]} for a fault",
            weight=float(times[axis] / (ALONE * others)),
        )
