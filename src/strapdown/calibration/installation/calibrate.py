"""`calibrate_installation`: clocks, lever arms, mounting and scale from a log, estimated until they
settle, confirmed by a second estimate, and ready to be written into recording.toml."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from ...aiding import find
from ...checks import DataError
from ...core.loop.contract import Filter
from ...data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING
from ...data.recording import Recording, check_recording
from ...engine.installation import with_estimates
from ...engine.options import SetUpOptions, takes
from ...installation.findings import CONSISTENT, FOUND, MIN_Z, MISFIT, NOT_OBSERVABLE, Diagnosed
from ...installation.model import apply_constants
from ...installation.states import EstimatedParameter
from ...preprocessing.rotated_imu import is_of_the_imu
from ...progress import listener, with_bar
from ...typing import Progress
from ...units.constants import NORMAL_95
from .as_states import Asking, as_states, check_states
from .findings import IMPLAUSIBLE, NOT_CONFIRMED, NOT_CONSTANT, CalibratedParameter, Installation
from .iterated import Settled, settle, theta_of

VARIES = 4.0
"""Combined standard deviations by which both halves of the time may differ: of constants they differ
by 2.0 at most in 84 pairs (12 simulated drives of 200 s)."""


@takes(SetUpOptions)
@with_bar("calibrate installation")
def calibrate_installation(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    *,
    options: dict[str, Any] | None = None,
    imu_clock: bool = False,
    progress: Progress | bool | None = None,
    **set_up: Unpack[SetUpOptions],
) -> Installation:
    """Find the installation of a recording: clock offset of each GNSS source and of the odometer,
    lever arm of the antenna, mounting of the IMU, scale of the odometer.

    `diagnose` runs on its own result until it finds nothing wrong. The smoother, with the same
    parameters as states about that result, gives a second estimate. A parameter counts as found if
    it differs from the given value by `diagnose`'s limits and both estimates agree; its 95 % interval
    holds both. States that the recording asks for are left out.

    Parameters
    ----------
    recording : Recording
        With sources of position and velocity.
    filter : str or Filter
        As of `diagnose`.
    options : dict
        Options that belong to this filter, {name: value}.
    imu_clock : bool
        If all sources share an offset, correct the clock of the IMU instead.
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Returns
    -------
    Installation
        Every parameter with two estimates, and the recording set up as found.

    Raises
    ------
    DataError
        Without a source of velocity, and where nothing shows.
    """
    check_recording(recording)
    if not any(a.kind == "velocity" and len(a.t) for a in recording.sources):
        raise DataError(
            "the recording has no source of velocity, and positions alone do not show an "
            "installation; add one (`strapdown diagnose` still detects clock offsets above 0.5 s)"
        )
    recording = with_estimates(recording, ())
    check_states(recording)
    asking = Asking(filter, options, set_up, listener(progress))
    settled = settle(recording, asking)
    last = settled.last
    seen = as_states(
        apply_constants(recording, settled.known, settled.theta),
        settled.sought,
        asking.within(0.7, 1.0),
    )
    parameters = (
        *(_parameter(each, settled, seen[each]) for each in settled.sought),
        *(CalibratedParameter(**vars(each)) for each in last.parameters if not each.sources),
    )
    if all(each.status == NOT_OBSERVABLE for each in parameters):
        motions = dict.fromkeys(f"the {each.cause}: {each.motion}" for each in settled.sought)
        raise DataError(
            f"this motion shows nothing of the installation; to show {'; '.join(motions)}"
        )
    if imu_clock:
        _check_imu_clock(recording, parameters)
    right = [each for each in parameters if each.status == FOUND]
    return Installation(
        parameters,
        apply_constants(recording, settled.known, theta_of(settled.known, recording, right)),
        recording,
        settled.runs,
        last.misfit,
        _notes(settled, recording, parameters, imu_clock),
        imu_clock,
        asking,
    )


def _parameter(each: Diagnosed, settled: Settled, seen: EstimatedParameter) -> CalibratedParameter:
    """The two estimates of a constant together. The value is that of the innovations; its 95 %
    interval holds the other one and is at least as wide as either: both are of the same data, so that
    what they differ by is what the model lacks."""
    factor, j = each.of.factor, settled.of(each)
    before = settled.before[j] * factor
    change, by_states = before + each.change, settled.theta[j] * factor + seen.change
    halves = tuple((before + half, own) for half, own in each.halves)
    own_std = max(each.std, seen.std)
    whole = vars(each) | {
        "given": each.given - before * (each.of is LEVER_ARM),
        "change": float(change),
        "std": max(own_std, abs(change - by_states) / NORMAL_95),
        "halves": halves,
    }
    found = CalibratedParameter(**whole, by_states=float(by_states), states_std=seen.std)
    return replace(found, status=_status(found, own_std, bool(settled.theta[j]), settled.sure))


def _status(found: CalibratedParameter, own_std: float, moved: bool, settled: bool) -> str:
    """The status of two estimates together: `moved` where the recording was changed by the first,
    `settled` where that settled; `own_std` is the larger of their standard deviations."""
    of = found.of
    least = max(of.min_reported * of.factor, MIN_Z * own_std)
    if own_std > of.known_std * of.factor:
        return NOT_OBSERVABLE
    if not moved or abs(found.change) <= least:
        return CONSISTENT
    if not _constant(found) and not _helps_both(found.change, found.halves):
        return NOT_CONSTANT
    if not settled or abs(found.change) <= MIN_Z * found.std:
        return NOT_CONFIRMED
    if abs(found.change) > of.most * of.factor:
        return IMPLAUSIBLE
    return FOUND if abs(found.by_states) > least else CONSISTENT


def _constant(each: CalibratedParameter) -> bool:
    """Return True where both halves of the time agree, or differ within the noise or by too little
    to report."""
    (first, first_std), (second, second_std) = each.halves
    least = each.of.min_reported * each.of.factor
    return not abs(first - second) > max(least, VARIES * np.hypot(first_std, second_std))


def _helps_both(change: float, halves: Iterable[tuple[float, float]]) -> bool:
    """Return True where the change reduces the error in each half of the time."""
    return all(abs(half - change) < abs(half) for half, _ in halves)


def _check_imu_clock(recording: Recording, parameters: tuple[CalibratedParameter, ...]) -> None:
    """Refuse to blame the clock of the IMU where not all sources share the offset."""
    clocks = [each for each in parameters if each.of is CLOCK]
    if not any(each.status == FOUND for each in clocks):
        return
    shown = [each for each in clocks if each.status != NOT_OBSERVABLE]
    apart = [abs(each.change - shown[0].change) for each in shown]
    if any(x > MIN_Z * np.hypot(each.std, shown[0].std) for x, each in zip(apart, shown)):
        values = ", ".join(f"{each.name} {each.seen}" for each in clocks)
        raise DataError(
            f"--imu-clock: the sources do not share one offset ({values}); leave the option out, "
            "so that each source gets its own offset"
        )
    covered = {name for each in shown for name in each.sources}
    others = [
        a.name or a.kind
        for a in recording.sources
        if find(a.kind).recorded and (a.name or a.kind) not in covered
    ]
    if others:
        raise DataError(
            f"--imu-clock: no offset was estimated for {', '.join(others)}, which would shift "
            "relative to the IMU; leave the option out, so that only "
            f"{' and '.join(sorted(covered))} are moved"
        )


def _notes(
    settled: Settled,
    recording: Recording,
    parameters: tuple[CalibratedParameter, ...],
    imu_clock: bool,
) -> tuple[str, ...]:
    notes = []
    clocks = [each for each in parameters if each.of is CLOCK]
    positions = {a.name or a.kind for a in recording.sources if a.kind == "position"}
    moved = any(each.status == FOUND and positions & set(each.sources) for each in clocks)
    if recording.reference is not None and moved and not imu_clock:
        notes.append(
            "the reference keeps its time stamps: where it comes from the same receiver, its offset "
            "needs the same change (or --imu-clock moves the IMU instead)"
        )
    notes += [
        f"{each.name} is not constant: {' by the first half of the time, '.join(each.by_halves)} by "
        f"the second; the value reported is the average"
        for each in parameters
        if each.status in (CONSISTENT, FOUND) and not _constant(each)
    ]
    if any(each.of is MOUNTING and each.status == FOUND for each in parameters):
        notes += [
            f"{a.name or a.kind} was assumed to be in the case of the IMU and rotated with it; "
            "`mounting` of [imu] rotates the IMU alone, so rotate this source too, with its "
            "`axes` or `calibration`"
            for a in recording.sources
            if find(a.kind).recorded and is_of_the_imu(a)
        ]
    unseen = [each for each in clocks if each.status == NOT_OBSERVABLE]
    if len(unseen) > 1:
        one, other = unseen[:2]
        notes.append(
            f"{one.name} and {other.name} trade off: they differ by "
            f"{one.change - other.change:+.3f} s, but the motion shows neither; calibrate writes "
            "neither"
        )
    if not settled.sure:
        notes.append(
            "the estimates do not converge, so none is written: correct large errors by hand, "
            "such as a clock that is seconds off, and run again"
        )
    if settled.last.misfit > MISFIT:
        notes.append(
            f"the NIS of the fixes is still {settled.last.misfit:.1f} times its expectation, so "
            "something else is wrong and may have changed the values above"
        )
    return tuple(notes)
