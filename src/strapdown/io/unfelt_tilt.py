"""A gyro that claims tilting which the accelerometer does not feel: in a wrong unit, or on a
multicopter. The fixes decide, else the vehicle."""

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
    """The line against a gyro that claims such tilting, "" without one; `where` begins the line, and
    `field` says whether the key of [imu] follows. Raises DataError for other mistakes."""
    accused = ""
    for key, text in mistakes(imu, kind, vehicle):
        line = f"{where}: {f'[imu] {key}' if field else 'imu'}: {text}"
        if UNFELT not in text:
            raise DataError(line)
        accused = line
    return accused


def in_degrees(recording: Recording) -> float:
    """The logarithm of the likelihood that the fixes give a gyro in deg/s over one in rad/s."""
    return likelier(InspectedRecording(recording), np.radians(1))


def fixes_confirm(recording: Recording) -> bool:
    """Return True where the fixes show that the gyro is in rad/s, not in deg/s."""
    return in_degrees(recording) < -EVIDENCE


def decide_accusation(recording: Recording, accused: str) -> Recording:
    """The recording with what its fixes or its vehicle say of an `accusation`: a note where the
    fixes contradict it, and where nothing decides the line itself, for whoever names the vehicle
    later. Raises DataError where it holds."""
    if not accused:
        return recording
    evidence = in_degrees(recording)
    if evidence < -EVIDENCE:
        note = f"imu: the gyro tilts {UNFELT}, as on a multicopter: the fixes confirm its unit"
        return recording.with_notes([note])
    if recording.meta.get("vehicle", "any") != "any" or evidence > EVIDENCE:
        raise DataError(accused)
    return recording.with_meta(undecided_gyro=accused)
