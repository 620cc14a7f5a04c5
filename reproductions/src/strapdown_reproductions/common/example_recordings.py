"""The recorded flight and drive of examples/recordings: where their descriptions are, and which
seconds of them are scored."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from strapdown.data.recording import Recording
from strapdown.evaluation.metrics import moving_windows
from strapdown.typing import Array, Mask

DESCRIPTIONS = Path(__file__).resolve().parents[4] / "examples" / "recordings"
"""Folder of the descriptions in the source tree."""

FLIGHT = (240.0, 575.0)
"""Seconds of thor75 that are scored: heading cannot be observed before the launch at 211 s, and
the aircraft lands at 579 s."""

SCALE, LASTS = 0.01, 0.3
"""Part by which scale and axes of a MEMS IMU may be off, and s for which a movement of the hand
lasts in one direction."""


def inside(t: Array, windows: Iterable[Sequence[float]]) -> Mask:
    """(n,) which times are in one of the windows (start, stop), both ends included."""
    found = np.zeros(len(t), bool)
    for start, stop in windows:
        found |= (t >= start) & (t <= stop)
    return found


def windows_of(recording: Recording) -> list[tuple[float, float]]:
    """The nine 15 s outages of the drive, [(start, stop)] in s."""
    return moving_windows(
        recording.reference, count=9, length=15.0, every=50.0, after=60.0, speed=4.0
    )


def in_motion(recording: Recording) -> Recording:
    """The recording of a hand-held IMU with the errors that motion brings, none of which its
    records at rest show.

    Scale and axes of a MEMS IMU are off by `SCALE`: that part of rates and forces is an error which
    lasts as long as a movement of the hand, so that it weighs like white noise of density SCALE rms
    sqrt(2 LASTS). The rows of a magnetometer that stand for one second have the weight of one
    reading, since iron near by bends the field for longer than that. Neither looks at the
    reference.
    """
    imu, grade = recording.imu, recording.meta["grade"]
    density = lambda increments: float(
        SCALE * np.sqrt(2 * LASTS) * np.sqrt(np.mean((increments / imu.dt[:, None]) ** 2))
    )
    noisy = lambda triad, increments: replace(
        triad, noise=float(np.hypot(triad.noise, density(increments)))
    )
    moved = replace(grade, gyro=noisy(grade.gyro, imu.dtheta), accel=noisy(grade.accel, imu.dv))
    rare = lambda a: (
        replace(a, std=a.std / np.sqrt(np.median(np.diff(a.t))))
        if a.kind == "magnetic-field"
        else a
    )
    return replace(
        recording,
        sources=tuple(map(rare, recording.sources)),
        meta=recording.meta | {"grade": moved},
    )
