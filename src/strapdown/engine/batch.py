"""`fuse` runs a filter over a whole Recording and returns a Solution."""

from typing import Unpack

from .. import filters
from ..alignment.missing_fields import fill_missing, missing_fields
from ..core.loop.contract import Filter, InitialState
from ..data.recording import Recording, check_recording
from ..data.solution import Solution
from ..data.vehicle import find as find_vehicle
from ..progress import listener, with_bar
from ..typing import Progress
from .finish import solution
from .heading_hypotheses import align_start
from .installation import of_grade, with_estimates
from .live_run import start_of
from .options import RunOptions, run_options, takes
from .prepare import (
    Run,
    assumed_noise,
    check_needs,
    check_start,
    has_position,
    ready,
)
from .source_weights import with_weights
from .with_ahrs import with_ahrs


@takes(RunOptions)
@with_bar("fuse")
def fuse(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    *,
    progress: Progress | bool | None = None,
    **asked: Unpack[RunOptions],
) -> Solution:
    """Run a filter over a recording and return its Solution.

    Parameters
    ----------
    recording : Recording
        Of an IMU and sources.
    filter : str or Filter
        Name of one of the filters, or one of your own.
    progress : bool or callable
        Called with the fraction done; True shows a bar with the time left, in a notebook or on a
        terminal.

    Returns
    -------
    Solution
        A row for each n-th sample after the start, with innovations, events and verdict.

    Raises
    ------
    DataError
        If an argument is out of range, or the filter cannot run on this recording.

    References
    ----------
    Groves (2013), chapter 14; each filter names its own source.

    Examples
    --------
    >>> import strapdown as sd
    >>> recording = sd.simulate("car", duration=60.0, seed=1)
    >>> solution = sd.fuse(recording, "closed-loop", imu="tactical")
    """
    run = begin(recording, filter, run_options(**asked))
    run.complete(listener(progress))
    return solution(run)


def recorded_start(recording: Recording) -> InitialState | None:
    """Return the start that a recording names, as a log of `strapdown live` does; None without one,
    or where its samples no longer begin there."""
    if "start" not in recording.meta:
        return None
    start = start_of(recording.meta["start"][name] for name in InitialState._fields)
    first = recording.imu.t[0] - recording.imu.dt[0]
    return start if start.t >= first - 0.5 * recording.imu.dt[0] else None


def begin(recording: Recording, filter: str | Filter, asked: RunOptions) -> Run:
    """The Run of `fuse` before its first sample. Raises DataError."""
    check_recording(recording)
    recording = with_weights(recording, asked["robust"], asked["adaptive"])
    if asked["vehicle"] is not None:  # all runs of the recording then use it
        recording = recording.with_meta(vehicle=find_vehicle(asked["vehicle"]))
    recording = with_estimates(recording, asked["estimate"])
    imu, start = asked["imu"], asked["start"] or recorded_start(recording)
    whole = isinstance(start, InitialState) and not missing_fields(start)
    noise, spec = assumed_noise(
        recording.meta.get("grade") if imu is None else imu, asked["noise"], needed=not whole
    )
    filter = filters.find(filter)
    if "estimate" not in recording.meta:
        axes, said = of_grade(filter, spec)
        if said:
            recording = recording.with_notes(said).with_meta(estimate=axes)
    if start is not None:  # before an AHRS or anything else takes it for one
        check_start(start, noise, missing_fields(start) if isinstance(start, InitialState) else ())
    known: RunOptions = {
        **asked,
        "imu": spec,
        "noise": noise if asked["noise"] else None,
        "start": start if whole else None,
    }
    recording, made = with_ahrs(recording, filter, known)
    check_needs(filter, recording.sources)
    if start is None or not whole:
        assert spec is not None  # it was needed above
        start = (
            align_start(recording, spec, has_position(filter), asked["noise"], asked["notify"])
            if start is None
            else fill_missing(start, recording, spec, has_position(filter))
        )
    return ready(recording, filter, start, noise, spec, asked, made)
