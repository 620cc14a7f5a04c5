"""The part of a recording that `tune` uses: all of a short one, of a longer one the part with the
most motion, with samples of at most about 100 Hz."""

from dataclasses import replace

import numpy as np

from ..checks import DataError, check_number
from ..core.loop.contract import Imu, InitialState
from ..data.recording import Recording
from ..data.solution import Solution
from ..engine.options import RunOptions
from ..engine.prepare import Run
from ..engine.smoothing import smooth
from ..installation.screening import start_at_row, window
from ..preprocessing.unbroken import sum_samples

STEP = 0.01
"""s: shorter samples are summed to this."""
LEARNT = 300.0
"""s of fixes from which a start is smoothed."""
MIN_SECONDS, MIN_FIXES = 60.0, 100


def part(
    before: Solution, start_s: float | None, stop_s: float | None
) -> tuple[Recording, InitialState]:
    """The part to use, thinned, of the recording of a Solution, and the InitialState there. Raises
    DataError."""
    assert before.recording is not None
    first, last = before.t[0], before.recording.span[1]
    if start_s is None and stop_s is None:
        recording, start = window(before)
    else:
        begin, end = first if start_s is None else start_s, last if stop_s is None else stop_s
        check_number(begin, "start_s", "s", most=last)
        check_number(end, "stop_s", "s", least=begin)
        row = int(np.searchsorted(before.t, begin))
        start = (
            InitialState(**before.meta["start"]) if begin <= first else start_at_row(before, row)
        )
        recording = before.recording.between(start.t, end)
    return replace(recording, imu=thin_samples(recording.imu)), start


def smoothed_start(run: Run, asked: RunOptions) -> InitialState:
    """The InitialState of a run, its values from a smoother over its first `LEARNT` s."""
    recording = run.recording.between(stop=run.start.t + LEARNT)
    solution = smooth(
        recording,
        run.filter,
        imu=run.spec,
        start=run.start,
        noise=run.noise,
        options=asked["options"],
    )
    return start_at_row(solution, 0)._replace(std=run.start.std)


def thin_samples(imu: Imu) -> Imu:
    """Samples of at least about STEP. Nothing is summed across a gap."""
    if np.median(imu.dt) > 0.75 * STEP:
        return imu
    number = np.floor((imu.t - imu.t[0] + 0.5 * np.median(imu.dt)) / STEP)
    return sum_samples(imu, np.r_[True, number[1:] != number[:-1]])


def check_length(recording: Recording, start: InitialState, fixes: int) -> None:
    """Refuse what is too short to tell a noise. Raises DataError."""
    seconds = recording.span[1] - start.t
    if seconds < MIN_SECONDS:
        raise DataError(
            f"{seconds:.0f} s remain after the start at {start.t:.1f} s; tuning needs "
            f"{MIN_SECONDS:.0f} s or more: give a longer recording"
        )
    if fixes < MIN_FIXES:
        raise DataError(
            f"the recording has {fixes} fixes in {seconds:.0f} s; tuning needs {MIN_FIXES} or "
            "more: give a longer recording"
        )
