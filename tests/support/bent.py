"""Recordings with one thing wrong, from right ones."""

from dataclasses import replace

import numpy as np


def with_sources(recording, change, kinds=("position", "velocity")):
    """The recording with `change` (Source -> Source) made to its sources of these kinds."""
    return replace(
        recording,
        sources=tuple(change(a) if a.kind in kinds else a for a in recording.sources),
    )


def later(recording, seconds, *kinds):
    """Time stamps that come later."""
    kinds = kinds or ("position", "velocity")
    return with_sources(recording, lambda a: replace(a, t=a.t + seconds), kinds)


def velocity(recording, change):
    """Another velocity: `change` of (n, 3) m/s NED."""
    return with_sources(recording, lambda a: replace(a, y=change(a.y)), ("velocity",))


def imu(recording, accel, gyro=None):
    """IMU axes multiplied by matrices (3, 3), those of the gyro as of the accelerometer."""
    accel = np.asarray(accel, float)
    gyro = accel if gyro is None else np.asarray(gyro, float)
    samples = recording.imu
    return replace(
        recording,
        imu=samples._replace(
            dtheta=np.ascontiguousarray(samples.dtheta @ gyro.T),
            dv=np.ascontiguousarray(samples.dv @ accel.T),
        ),
    )


def turned(degrees):
    """(3, 3) rotation about the vertical, clockwise."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
