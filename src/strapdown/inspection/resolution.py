"""IMU samples counted in coarse steps: where their noise is smaller than a step, a slow signal stays
within one, and the error of half a step is a bias that changes with the signal."""

import numpy as np

from ..data.verdict import Reason
from ..typing import Array
from .finding import Checked
from .motion import InspectedRecording

ROWS = 20_000
"""Samples that are looked at, from the middle of the recording."""
ROUND = 1e-9
"""Part of the largest value below which two values differ by rounding alone."""
MAX_VALUES = 0.2
"""Different values by samples: more of them are no steps."""
WHOLE, WHOLE_SHARE = 0.05, 0.9
"""Part of a step that distances between values may be off whole steps, and the share that are so near."""
HELD = 0.5
"""Share of samples that equal the one before. Normal noise of 0.56 of a step leaves so many the same and
rounds off evenly; with less, a constant signal rounds to one value."""
MIN_STEP = {"accelerometer": 0.02, "gyro": float(np.radians(0.03))}
"""m/s^2 and rad/s: half of a smaller step is less than the bias that a filter allows for."""
UNITS = {"accelerometer": (1.0, "m/s^2"), "gyro": (float(np.degrees(1)), "deg/s")}


def check(subject: InspectedRecording) -> Checked:
    """Return reasons where an axis of the IMU is counted in steps coarser than its noise."""
    found, imu = Checked.empty(), subject.recording.imu
    first = max(0, (len(imu.t) - ROWS) // 2)
    rows = slice(first, first + ROWS)
    for sensor, increments in (("accelerometer", imu.dv), ("gyro", imu.dtheta)):
        values = increments[rows] / imu.dt[rows, None]
        steps = np.array([step_of(axis) for axis in values.T])
        equal = np.abs(np.diff(values, axis=0)) < 0.5 * steps
        held = np.where(steps > MIN_STEP[sensor], equal.mean(axis=0), 0.0)
        axis = int(np.argmax(held))
        if held[axis] > HELD:
            found.reasons.append(_reason(sensor, axis, float(steps[axis]), float(held[axis])))
    return found


def step_of(values: Array) -> float:
    """The step in which values (n,) are counted; 0 where they are not."""
    each = np.unique(values)
    apart = np.diff(each)
    apart = apart[apart > ROUND * max(float(np.abs(each).max(initial=0.0)), ROUND)]
    if not 2 < len(apart) < MAX_VALUES * len(values):
        return 0.0
    step = float(np.quantile(apart, 0.1))
    whole = np.abs(apart / step - np.round(apart / step)) < WHOLE
    return step if whole.mean() > WHOLE_SHARE else 0.0


def _reason(sensor: str, axis: int, step: float, held: float) -> Reason:
    factor, unit = UNITS[sensor]
    return Reason(
        sensor,
        f"{sensor} {'xyz'[axis]} is counted in steps of {step * factor:.2g} {unit}, and "
        f"{100 * held:.0f} % of its samples equal the one before: slow changes within a step are lost",
        f"log the {sensor} with its full resolution",
        weight=held / HELD,
    )
