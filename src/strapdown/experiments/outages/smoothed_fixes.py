"""The fixes that outages withhold, against which they are scored where a recording has no reference."""

from dataclasses import replace

from ...checks import DataError
from ...core.loop.contract import InitialState
from ...data.recording import Recording
from ...data.solution import Trajectory
from ...engine.options import RunOptions
from ...engine.smoothing import smooth

FILTER = "closed-loop"
NOTE = (
    f"no reference: errors are against the withheld fixes, as {FILTER} smoothed over all fixes has them at "
    "the IMU; their standard deviations count in the coverage, attitude is not scored, and what is wrong "
    "in the set-up is wrong in both"
)


def smoothed_fixes(recording: Recording, asked: RunOptions, start: InitialState) -> Trajectory:
    """The position and velocity of a recording by all of its fixes, with standard deviations. Raises
    DataError where it has none of position."""
    if not any(source.kind == "position" for source in recording.sources):
        raise DataError(
            "the recording has no reference to score against, and no fixes of position that could stand "
            "for one: add one to it (section [reference] of its description)"
        )
    solution = smooth(recording, FILTER, start=start, imu=asked["imu"], noise=asked["noise"])
    return replace(solution.trajectory, q_nb=None)
