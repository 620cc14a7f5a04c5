"""Withheld fixes as the reference of outages, for a recording without a reference."""

from dataclasses import replace

from ...checks import DataError
from ...core.loop.contract import InitialState
from ...data.recording import Recording
from ...data.solution import Trajectory
from ...engine.options import RunOptions
from ...engine.smoothing import smooth

FILTER = "closed-loop"
NOTE = (
    f"no reference: errors are against the withheld fixes, transferred to the IMU by {FILTER}, smoothed "
    "over all fixes; the coverage includes their standard deviations, attitude is not scored, and errors of "
    "the set-up affect both"
)


def smoothed_fixes(recording: Recording, asked: RunOptions, start: InitialState) -> Trajectory:
    """Return position and velocity of a recording from all of its fixes, with standard deviations.
    Raises DataError where it has no position fixes."""
    if not any(source.kind == "position" for source in recording.sources):
        raise DataError(
            "the recording has no reference to score against, and no fixes of position that could stand "
            "for one: add one to it (section [reference] of its description)"
        )
    solution = smooth(recording, FILTER, start=start, imu=asked["imu"], noise=asked["noise"])
    return replace(solution.trajectory, q_nb=None)
