"""From a Recording and a filter to a Solution: `fuse` runs a whole recording."""

from typing import Any

from .. import filters
from ..alignment.completed import completed, left_open
from ..checks import check_flag, check_number
from ..core.loop.contract import Filter, Noise, Start
from ..data import Solution
from ..progress import listener, with_bar
from ..recording import Recording, check_recording
from ..typing import Progress, Say
from ..vehicle import GivenVehicle, find as find_vehicle
from .attitude_first import fed
from .finish import solution
from .heading_hypotheses import aligned
from .installation import Estimate, of_grade, with_estimates
from .prepare import (
    Asked,
    GivenImu,
    Run,
    assumed_noise,
    check_needs,
    check_start,
    positioned,
    ready,
)
from .weighed import Adaptive, Robust, with_weights


@with_bar("fuse")
def fuse(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    imu: GivenImu | None = None,
    start: Start | None = None,
    noise: Noise | None = None,
    every: int = 1,
    covariance: bool = False,
    say: Say | None = None,
    progress: Progress | bool | None = None,
    ahrs: str | Filter | None = None,
    ahrs_rate: float = 10.0,
    vehicle: GivenVehicle | None = None,
    estimate: Estimate | None = None,
    robust: Robust | None = None,
    adaptive: Adaptive | None = None,
    **options: Any,
) -> Solution:
    """Run `filter` over `recording` and return the Solution.

    imu: grade, file or ImuSpec (default: what the recording names); start: a Start (default:
    `heading_hypotheses.aligned`). Its open parts are found as `align` finds them. Fixes at its time
    belong to it and are not used again. noise: a Noise in place of the IMU's; every: keep each n-th row (the last one always); covariance: keep the
    whole covariance of these rows too; say: told of slow compilation; progress: called with the
    fraction done, or True for a bar with the time left, in a notebook or on a terminal; ahrs: a filter of attitude alone that runs first and whose output at `ahrs_rate`
    Hz is the `attitude` aiding (default: `attitude-mekf` where `filter` needs attitude, the
    recording has none and something in it measures the heading); vehicle: one of vehicle.VEHICLES, or
    a Vehicle, beyond whose bounds nothing is believed (default: what the recording names, else any);
    estimate: parameters of the installation that become states, such as ["clock", "lever-arm"], or
    {name: prior standard deviation} (default: what the recording names, else scale and misalignment
    of the IMU where its grade states them; [] for none);
    robust: sources whose fixes have a heavy-tailed likelihood in place of the gate, True for all, or
    names or kinds; adaptive: s of memory with which the noise of sources is followed, of all or
    {name or kind: s} (default of both: what the sources of the recording say);
    options: the filter's own. Raises DataError.
    """
    run = begin(
        with_weights(recording, robust, adaptive),
        filter,
        Asked(
            options, imu, start, noise, every, covariance, say, ahrs, ahrs_rate, vehicle, estimate
        ),
    )
    run.complete(listener(progress))
    return solution(run)


def begin(recording: Recording, filter: str | Filter, asked: Asked) -> Run:
    """The Run of `fuse` before its first sample. Raises DataError."""
    check_recording(recording)
    check_number(asked.every, "every", least=1, most=1e9, whole=True)
    check_flag(asked.covariance, "covariance")
    if asked.vehicle is not None:  # so that all runs of it know it
        recording = recording.knowing(vehicle=find_vehicle(asked.vehicle))
    recording = with_estimates(recording, asked.estimate)
    imu, start = asked.imu, asked.start
    whole = isinstance(start, Start) and not left_open(start)
    noise, spec = assumed_noise(
        recording.meta.get("grade") if imu is None else imu, asked.noise, needed=not whole
    )
    filter = filters.find(filter)
    if "estimate" not in recording.meta:
        axes, said = of_grade(filter, spec)
        if said:
            recording = recording.noting(said).knowing(estimate=axes)
    if start is not None:  # before an AHRS or anything else takes it for one
        check_start(start, noise, left_open(start) if isinstance(start, Start) else ())
    recording, made = fed(
        recording,
        filter,
        asked.ahrs,
        asked.ahrs_rate,
        spec,
        noise if asked.noise else None,
        start if whole else None,
        asked.say,
    )
    check_needs(filter, recording.aidings)
    if start is None or not whole:
        assert spec is not None  # it was needed above
        start = (
            aligned(recording, spec, positioned(filter), asked.noise, asked.say)
            if start is None
            else completed(start, recording, spec, positioned(filter))
        )
    return ready(recording, filter, start, noise, spec, asked, made)
