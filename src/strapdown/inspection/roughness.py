"""Accelerations that change from sample to sample more than any vehicle's: vibration so strong that the
accelerometer's range and rate no longer hold it, or spikes."""

import numpy as np

from ..data.verdict import Reason
from .finding import Checked
from .motion import InspectedRecording

BLOCK = 10.0
"""s of a part; the rms of the median part counts, so that single impacts do not."""
MAX_ROUGHNESS = 5.0
"""m/s^2 rms of an axis that a straight line through three samples leaves. Measured on recordings: 0.6 of a
car and of a shoe, 1.2 of a multicopter, 3.2 of a board that is tapped all the time."""


def check(subject: InspectedRecording) -> Checked:
    """How rough the specific force is."""
    imu = subject.recording.imu
    force = imu.dv / imu.dt[:, None]
    bend = np.diff(force, 2, axis=0) / np.sqrt(6.0)  # white noise keeps its size
    parts = int((imu.t[-1] - imu.t[0]) / BLOCK) if len(imu.t) else 0
    if parts < 1 or len(bend) < parts:
        return Checked.empty()
    rough = np.median(
        [np.sqrt((part**2).mean(axis=0)) for part in np.array_split(bend, parts)], axis=0
    )
    axis = int(np.argmax(rough))
    if not rough[axis] > MAX_ROUGHNESS:
        return Checked.empty()
    reason = Reason(
        "accelerometer",
        f"accelerometer {'xyz'[axis]} changes by {rough[axis]:.0f} m/s^2 (rms) from sample to sample: "
        "vibration, or spikes",
        "mount the IMU on dampers, log it at its full rate, and check it for faults of transmission",
        weight=float(rough[axis] / MAX_ROUGHNESS),
    )
    return Checked([], [reason], [])
