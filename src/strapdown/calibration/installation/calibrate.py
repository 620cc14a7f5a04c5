"""`calibrate_installation`: clocks, lever arms, mounting and scale from a log, estimated until they
settle, confirmed by a second estimate, and ready to be written into recording.toml."""

from typing import Any

import numpy as np

from ...aiding import find
from ...checks import DataError
from ...core.contract import Filter, Start
from ...diagnosis.diagnose import LARGEST_SD, diagnose
from ...diagnosis.findings import (
    CONSISTENT,
    FOUND,
    LEAST_Z,
    MISFIT,
    NOT_OBSERVABLE,
    UNITS,
    Diagnosis,
    Estimate,
)
from ...diagnosis.installation import CLOCK, applied, constants
from ...engine.installation import with_estimates
from ...engine.prepare import GivenImu
from ...recording import Recording
from ...typing import Progress, Say
from ...vehicle import GivenVehicle
from .confirming import ESTIMABLE, Asking, Seen, as_states
from .findings import IMPLAUSIBLE, NOT_CONFIRMED, Installation, Parameter

CONTRADICT = 3.0
"""Combined standard deviations by which the two estimates of a parameter may differ."""


def calibrate_installation(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    imu: GivenImu | None = None,
    start: Start | None = None,
    say: Say | None = None,
    progress: Progress | None = None,
    vehicle: GivenVehicle | None = None,
    imu_clock: bool = False,
    **options: Any,
) -> Installation:
    """What the installation of `recording` is: clock offset of each GNSS source, lever arm of its
    antenna, mounting of the IMU, scale of the odometer.

    `diagnose` estimates them until they settle; the smoother with the same numbers as states, around
    what was found, is the second estimate. A parameter is found where it is off what was given by
    `diagnose`'s limits and both agree; its standard deviation is the larger of the two. What the
    recording asks to be estimated as states is left out.
    imu_clock: blame the clock of the IMU, where all sources share an offset; the other arguments
    are those of `diagnose`. Raises DataError: without a source of velocity, and where nothing shows.
    """
    if not any(a.kind == "velocity" for a in recording.aidings):
        raise DataError(
            "the recording has no source of velocity, and positions alone do not show an "
            "installation; add one (`strapdown diagnose` still looks for clocks beyond 0.5 s)"
        )
    recording = with_estimates(recording, ())
    report = progress or (lambda done: None)
    found = diagnose(
        recording,
        filter,
        imu,
        start,
        say,
        lambda done: report(0.7 * done),
        vehicle,
        **options,
    )
    sought = [each for each in found.parameters if each.sources]
    if all(each.status == NOT_OBSERVABLE for each in sought):
        motions = dict.fromkeys(each.motion for each in sought)
        raise DataError(
            f"nothing of the installation shows in this motion; to show it, {'; '.join(motions)}"
        )
    asking = Asking(
        filter, imu, vehicle, start, say, lambda done: report(0.7 + 0.3 * done), options
    )
    seen = as_states(found.recording, sought, asking)
    parameters = tuple(_parameter(each, seen.get(each)) for each in found.parameters)
    if imu_clock:
        _check_imu_clock(recording, parameters)
    report(1.0)
    return Installation(
        parameters,
        _set_up(recording, parameters),
        recording,
        found,
        _notes(recording, found, parameters, imu_clock),
        imu_clock,
        asking,
    )


def _parameter(each: Estimate, seen: Seen | None) -> Parameter:
    """What the two estimates of a constant come to."""
    applied = each.change if each.status == FOUND else 0.0
    second = np.nan if seen is None else applied + seen.left
    second_sd = np.nan if seen is None else seen.sd
    sd = float(np.fmax(each.sd, second_sd))
    status, factor = each.status, UNITS[each.cause][1]
    if status == FOUND and sd > LARGEST_SD[each.cause] * factor:
        status = NOT_OBSERVABLE
    elif status == FOUND and abs(each.change) > ESTIMABLE[each.cause].most * factor:
        status = IMPLAUSIBLE
    elif status == FOUND and not (
        abs(second - each.change) <= CONTRADICT * np.hypot(each.sd, second_sd)
    ):
        status = NOT_CONFIRMED
    elif status == FOUND and abs(each.change) <= LEAST_Z * sd:
        status = CONSISTENT
    return Parameter(
        each.name,
        each.cause,
        each.sources,
        each.axis,
        each.unit,
        status,
        each.given,
        each.change,
        sd,
        float(second),
        float(second_sd),
        each.motion,
    )


def _check_imu_clock(recording: Recording, parameters: tuple[Parameter, ...]) -> None:
    """Refuse to blame the clock of the IMU where not all sources share the offset."""
    clocks = [each for each in parameters if each.cause == CLOCK]
    if len(clocks) > 1:
        values = ", ".join(f"{each.name} {each.seen}" for each in clocks)
        raise DataError(
            f"--imu-clock: the sources do not share one offset ({values}); leave it out, so that "
            f"each gets its own"
        )
    others = [
        a.name or a.kind
        for a in recording.aidings
        if find(a.kind).recorded and (a.name or a.kind) not in clocks[0].sources
    ]
    if clocks[0].status == FOUND and others:
        raise DataError(
            f"--imu-clock: no offset was estimated of {', '.join(others)}, which would move against "
            f"the IMU; leave it out, so that only {' and '.join(clocks[0].sources)} are moved"
        )


def _set_up(recording: Recording, parameters: tuple[Parameter, ...]) -> Recording:
    """The recording with what is found."""
    known = constants(recording.aidings)
    names = [a.name or a.kind for a in recording.aidings]
    theta = np.zeros(len(known))
    for each in parameters:
        for j, constant in enumerate(known):
            if (
                each.status == FOUND
                and (constant.kind, constant.axis) == (each.cause, each.axis)
                and {names[i] for i in constant.sources} <= set(each.sources)
            ):
                theta[j] = each.change / UNITS[each.cause][1]
    return applied(recording, known, theta)


def _notes(
    recording: Recording, found: Diagnosis, parameters: tuple[Parameter, ...], imu_clock: bool
) -> tuple[str, ...]:
    notes = []
    clocks = [each for each in parameters if each.cause == CLOCK]
    if (
        recording.reference is not None
        and not imu_clock
        and any(each.status == FOUND for each in clocks)
    ):
        notes.append(
            "the reference keeps its time stamps: where it comes from the same receiver, its offset "
            "needs the same change (or --imu-clock moves the IMU instead)"
        )
    unseen = [each for each in clocks if each.status == NOT_OBSERVABLE]
    if len(unseen) > 1:
        one, other = unseen[:2]
        notes.append(
            f"{one.name} and {other.name} trade off: they differ by "
            f"{one.change - other.change:+.3f} s, but the motion does not show either; neither is "
            f"written"
        )
    if found.misfit > MISFIT:
        notes.append(
            f"the fixes still fit badly: their NIS is {found.misfit:.1f} times what is expected, so "
            f"something else is wrong, and what stands above may be too"
        )
    return tuple(notes)
