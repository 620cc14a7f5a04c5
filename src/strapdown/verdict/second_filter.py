"""A second filter on the same recording. Filters with gains that are not those of all errors follow a
position that drifts away, where the closed loop finds that the IMU felt no such motion."""

from .. import filters
from ..core.loop.contract import Filter, InitialState, Noise
from ..data.solution import Solution
from ..engine.batch import fuse

SECOND = "closed-loop"
EVERY = 10
"""Samples between the rows of its solution that are kept."""


def run_second_filter(solution: Solution) -> Solution | None:
    """Return the solution of the closed loop with the recording, the start and the noise of a solution;
    None where the filter has the gains of all errors itself, takes no positions, or is a user's own."""
    name = solution.meta["filter"]
    if name not in filters.own_names() or not follows_positions(filters.find(name)):
        return None
    assert solution.recording is not None
    start, noise = InitialState(**solution.meta["start"]), Noise(**solution.meta["noise"])
    return fuse(solution.recording, SECOND, start=start, noise=noise, every=EVERY)


def follows_positions(filter: Filter) -> bool:
    """Return True for a filter that is fed by an AHRS, or takes only some kinds of sources, and the
    position among them."""
    uses = filter.uses
    return bool(filter.needs) if uses is None else "position" in uses
