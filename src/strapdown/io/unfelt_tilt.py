"""A gyro that measures tilting which the accelerometer does not show: its unit is incorrect, or it
is on a multicopter. The fixes decide, or without them the vehicle."""

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.recording import Recording
from ..data.vehicle import GivenVehicle
from ..inspection.gyro_fit import EVIDENCE, likelier
from ..inspection.motion import InspectedRecording
from ..preprocessing.plausible import UNFELT, mistakes


def accusation(
    imu: Imu, kind: str | None, vehicle: GivenVehicle | None, where: str, field: bool = True
) -> str:
    """Return the line on a gyro with such tilting, "" without any; `where` begins the line, and
    `field` is True if the key of [imu] follows. Raises DataError for other mistakes."""
    accused = ""
    for key, text in mistakes(imu, kind, vehicle):
        line = f"{where}: {f'[imu] {key}' if field else 'imu'}: {text}"
        if UNFELT not in text:
            raise DataError(line)
        accused = line
    return accused


def in_degrees(recording: Recording) -> float:
    """Return the log likelihood ratio of a gyro in deg/s over one in rad/s, from the fixes."""
    return likelier(InspectedRecording(recording), np.radians(1))


def fixes_confirm(recording: Recording) -> bool:
    """Return True where the fixes show that the gyro is in rad/s, not in deg/s."""
    return in_degrees(recording) < -EVIDENCE


def decide_accusation(recording: Recording, accused: str) -> Recording:
    """Return the recording with the decision of its fixes or its vehicle on an `accusation`: a note
    where the fixes contradict it; where nothing decides, the line itself, in case the vehicle is
    named later. Raises DataError where it is confirmed."""
    if not accused:
        return recording
    evidence = in_degrees(recording)
    if evidence < -EVIDENCE:
        note = f"imu: the gyro tilts {UNFELT}, as on a multicopter: the fixes confirm its unit"
        return recording.with_notes([note])
    if recording.meta.get("vehicle", "any") != "any" or evidence > EVIDENCE:
        raise DataError(accused)
    return recording.with_meta(undecided_gyro=accused)
