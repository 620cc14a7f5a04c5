"""The command diagnose: what of an installation is wrong, from the filter's own runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import strapdown as sd

from .console import (
    FROM,
    IMU,
    OPTION,
    RELATIVE,
    SOURCES,
    TAKE,
    TO,
    VEHICLE,
    Progress,
    grade_of,
    option_values,
    read_given,
    record_parameters,
    recording_argument,
)
from .output import record, say, say_verdict

if TYPE_CHECKING:
    from ..core.loop.contract import InitialState


def diagnose(
    recording: Annotated[list[Path], recording_argument()],
    filter: RELATIVE = "closed-loop",
    imu: IMU = None,
    sources: SOURCES = None,
    take: TAKE = None,
    vehicle: VEHICLE = None,
    start: FROM = None,
    stop: TO = None,
    option: OPTION = None,
) -> None:
    """Say what of the installation is wrong: clock offset and lever arm of the GNSS, mounting of
    the IMU, scale of the odometer; what is right; and what the motion does not show."""
    whole, grade = read_given(recording, imu, take, sources)
    part = whole.between(start, stop)
    show(part, filter, grade or grade_of(whole), vehicle, None, option_values(option))


def show(
    recording: "sd.Recording",
    filter: str,
    imu: Any,
    vehicle: str | None,
    start: "InitialState | None",
    options: dict[str, Any],
) -> None:
    """Diagnose, and print what was found."""
    with Progress() as progress:
        found = sd.diagnose(
            recording,
            filter,
            imu=imu,
            vehicle=vehicle,
            start=start,
            notify=progress.notify,
            progress=progress.track("diagnose"),
            options=options,
        )
    for i, line in enumerate(found.lines):
        (say if i < len(found.parameters) else say_verdict)(line)
    record_parameters(found.parameters)
    record(changes=found.changes)
