"""`tune`: the noise of the IMU and of each source, told by a recording."""

from typing import Any, Unpack

import numpy as np

from .. import filters
from ..aiding import find
from ..checks import DataError, check_flag
from ..core.loop.contract import Filter
from ..data.recording import Recording, check_recording
from ..engine.options import SetUpOptions, run_options, takes
from ..engine.prepare import assumed_noise
from ..progress import listener, with_bar
from ..typing import Progress
from .conclusions import directions, fits, judge, parameters
from .findings import AT_MIN, OPEN, Tuning
from .search import Search

MOVES = ("position", "velocity", "speed")
"""Kinds of which one is needed: what the others say of each other tells no noise."""


@takes(SetUpOptions)
@with_bar("tune")
def tune(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    *,
    options: dict[str, Any] | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    correlated: bool = True,
    progress: Progress | bool | None = None,
    **set_up: Unpack[SetUpOptions],
) -> Tuning:
    """Find the noise of the IMU and of each source of a recording, by maximum likelihood of the
    innovations of a filter (Mehra 1970; Gupta and Mehra 1974), with 95 % profile intervals.

    The estimate has white noise and bias walk of gyros and accelerometers, and a factor for the
    standard deviations of each recorded source, for positions and velocities horizontally and
    vertically. With `correlated` it also has size and time of time-correlated errors, if the
    likelihood supports them. Scale, misalignment and turn-on bias of the IMU, and the standard
    deviations of constraints, stay. Outliers are ignored.

    Parameters
    ----------
    recording : Recording
        With a source of position, velocity or speed.
    filter : str or Filter
        A filter that gives the covariance of its innovations.
    options : dict
        Options that belong to this filter, {name: value}.
    start_s, stop_s : float
        Part of the recording to use, s; default: all of it, or the 1000 s with the most motion of a
        long one.
    correlated : bool
        Also estimate time-correlated errors.
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Returns
    -------
    Tuning
        Every number with its 95 % interval, and the recording with them.

    Raises
    ------
    DataError
        Where the recording is too short or shows no noise, and as of `fuse`.

    References
    ----------
    Mehra (1970), "On the identification of variances and adaptive Kalman filtering", IEEE Transactions
    on Automatic Control 15(2); Gupta & Mehra (1974), "Computational aspects of maximum likelihood
    estimation and reduction in sensitivity function calculations", the same, 19(6).
    """
    check_recording(recording)
    check_flag(correlated, "correlated")
    _check_sources(recording)
    tell = listener(progress)
    asked = run_options(options=options, **set_up)
    imu = recording.meta.get("grade") if asked["imu"] is None else asked["imu"]
    _, spec = assumed_noise(imu, None, True)
    assert spec is not None  # it was needed
    asked["imu"] = spec
    search = Search(recording, filters.find(filter), spec, asked, (start_s, stop_s))
    tell(0.05)
    search.first()
    tell(0.25)
    notes = search.correlate() if correlated else []
    search.explain()
    tell(0.5)
    profiles = search.profiles(lambda done: tell(0.5 + 0.4 * done))
    judged = judge(search, profiles)
    tell(0.95)
    if all(status in (OPEN, AT_MIN) for status in judged.status):
        raise DataError(
            "the likelihood has no maximum: this motion does not show the noise of these sources; "
            "give a longer recording, or one with more motion"
        )
    given = np.array([each.given or each.least for each in search.unknowns])
    before = search.likelihood.at(np.log(given)).log_likelihood
    tuned, spec = search.tuned_setup(judged.theta)
    after = search.fuse(tuned, spec)
    tell(1.0)
    return Tuning(
        parameters(search, profiles, judged),
        directions(search.top, search.unknowns),
        fits(search, after),
        recording,
        tuned,
        spec,
        (before, judged.log_likelihood),
        search.runs,
        search.seconds,
        search.before,
        after,
        tuple(notes + _notes(search)),
    )


def _check_sources(recording: Recording) -> None:
    recorded = [a for a in recording.sources if find(a.kind).recorded]
    if not any(a.kind in MOVES and len(a.t) for a in recorded):
        has = ", ".join(a.name or a.kind for a in recording.sources) or "no source"
        raise DataError(
            f"the recording has {has}; tuning compares the noise with measured positions or "
            f"velocities: add a source of one of {', '.join(MOVES)}"
        )


def _notes(search: Search) -> list[str]:
    notes = []
    if out := search.left_out():
        many = sum(len(search.likelihood.kept[s]) for s in search.counted)
        notes.append(f"{out} of {many} fixes are outliers and are ignored")
    return notes
