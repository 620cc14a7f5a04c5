"""The observability of a recording: what its data cannot show, and what of the solution rests on
it."""

from collections.abc import Iterator

import numpy as np

from ..core.loop.contract import ATT, BA
from ..data.calibration_parameters import MOUNTING
from ..data.solution import Solution
from ..data.verdict import (
    HEADING,
    HEIGHT,
    POSITION,
    QUANTITIES,
    TILT,
    VELOCITY,
    SetUpBound,
    Untested,
)
from ..inspection.height_differences import KINDS, MIN_DIFFERENCE, MIN_FIXES, SEVERAL
from ..installation.model import CONSTRAINED
from ..installation.states import in_motion
from ..preprocessing.lever_arm import lever_arm_of
from .evidence import GATED, JudgedFixes, course_angle

MIN_TIME = 30.0  # s of a run that says something of itself
HEIGHTS = {*KINDS, "zero-sea-level"}
"""Kinds that tell a height above the ellipsoid."""
COMPASSES = {
    "magnetic-field": "magnetometer",
    "heading": "source of heading",
    "attitude": "AHRS",
    "baseline": "pair of antennas",
}
"""{kind that measures a heading: its sensor}."""
UNSEEN_HEADING, UNSEEN_BIAS = 0.7, 0.3
"""Share of its standard deviation at the start above which nothing showed a quantity. A bias of the
accelerometer falls to a half by gravity alone, which shares it out between bias and tilt as the start has
them; what turns shows it to a fifth and less."""
COARSE_HEADING = np.radians(5.0)
"""rad: a heading that is known better needs nothing to show it."""
RECORD_VELOCITY = "record GNSS position and velocity, and drive or fly turns"


def untested_claims(
    solution: Solution, sources: list[JudgedFixes], seconds: float
) -> Iterator[Untested]:
    """Yield what could not be tested in a run of `seconds`, and why."""
    kinds = {source.kind for source in sources}
    yield from _of_length(sources, seconds)
    yield from _of_sources(solution, sources)
    yield from _of_motion(solution, kinds)
    yield from _of_attitude(solution, kinds)


def _of_length(sources: list[JudgedFixes], seconds: float) -> Iterator[Untested]:
    if seconds < MIN_TIME:
        yield Untested(
            "everything that needs a longer run",
            f"the run lasts {seconds:.0f} s, and {MIN_TIME:.0f} s are needed",
            "record longer",
            QUANTITIES,
        )
    if few := [source.name for source in sources if len(source.t) < GATED]:
        yield Untested(
            f"innovations of {', '.join(few)}", f"fewer than {GATED} fixes", "record longer"
        )


def _of_sources(solution: Solution, sources: list[JudgedFixes]) -> Iterator[Untested]:
    if any(not np.isfinite(source.ratio).all() for source in sources):
        name = solution.meta.get("filter", "the filter")
        yield Untested(
            "innovations",
            f"{name} does not compare its innovations with standard deviations",
            "compare its result with that of closed-loop",
        )
    silent = set(solution.innovations.names) - {source.name for source in sources}
    if silent:
        yield Untested(", ".join(sorted(silent)), "the filter used none of its fixes")
    if solution.meta.get("bias_std") is None:
        yield Untested(
            "biases", "the IMU is not described", "name it with `--imu NAME`", cause="imu noise"
        )


def _of_motion(solution: Solution, kinds: set[str]) -> Iterator[Untested]:
    """Yield what only motion with positions and velocities shows."""
    if not kinds & {"position", "velocity"}:
        yield Untested(
            "clock and lever arm", "the recording has no GNSS", "record GNSS", cause="clock"
        )
    elif not in_motion(solution):
        yield Untested(
            "clock, lever arm and heading",
            "the vehicle hardly moves",
            "drive or fly turns",
            (HEADING,),
            "lever arm",
        )
    elif not {"position", "velocity"} <= kinds:
        yield Untested(
            "clock offset below 0.5 s, lever arm and time-correlated errors of the fixes",
            "the recording has only one of position and velocity",
            "record both",
            (POSITION, HEIGHT, VELOCITY),
            "lasting errors",
        )
    if "position" in kinds and len(kinds & HEIGHTS) < 2:
        yield Untested(
            "height above geoid or ellipsoid",
            "only one source measures it",
            "also record a barometer or another height",
            (HEIGHT,),
            "height",
        )
    if not kinds & set(CONSTRAINED):
        yield Untested(
            "mounting of the IMU",
            "only a constraint of the vehicle or an odometer shows it",
            "add the constraints of the vehicle, or record an odometer",
            (TILT, HEADING, *_moved_by_mounting(solution)),
            "mounting",
        )


def _moved_by_mounting(solution: Solution) -> tuple[str, ...]:
    """Position and height where a mounting that is off turns a long lever arm by more than is claimed of
    the position."""
    assert solution.recording is not None
    if solution.trajectory.std is None:
        return ()
    arms = [lever_arm_of(a) for a in solution.recording.sources if a.kind == "position"]
    moved = max(MOUNTING.std) * max((float(np.linalg.norm(arm)) for arm in arms), default=0.0)
    claimed = solution.trajectory.std[:, :3].max(axis=1)
    known = claimed[np.isfinite(claimed)]
    return (POSITION, HEIGHT) if len(known) and moved > np.median(known) else ()


def bounds(solution: Solution, sources: list[JudgedFixes]) -> Iterator[SetUpBound]:
    """Yield how large a difference of two heights and a turn of the axes about the vertical would have
    shown."""
    assert solution.recording is not None
    told = [a for a in solution.recording.sources if a.kind in KINDS and len(a.t) >= MIN_FIXES]
    claimed = [float(np.median(a.std[:, KINDS[a.kind]])) for a in told]
    if len(told) > 1:
        size = max(MIN_DIFFERENCE, SEVERAL * float(np.linalg.norm(sorted(claimed)[:2])))
        yield SetUpBound("height", "height above geoid or ellipsoid", size, "m")
    fixes = [source.t for source in sources if source.kind in ("position", "velocity")]
    if fixes and (found := course_angle(solution, fixes[0])):
        yield SetUpBound("axes", "axes of the IMU about the vertical", found.least, "deg")


def _of_attitude(solution: Solution, kinds: set[str]) -> Iterator[Untested]:
    """Yield on what the attitude rests alone."""
    claimed = solution.trajectory.std
    moves = bool(kinds & {"position", "velocity"}) and in_motion(solution)
    if moves and heading_never_seen(solution):
        yield Untested(
            "heading",
            "no turn or acceleration made it observable, so its initial error remains",
            "turn and accelerate",
            (HEADING,),
        )
    elif not moves and (compasses := [COMPASSES[kind] for kind in COMPASSES if kind in kinds]):
        yield Untested(
            "heading",
            f"it depends on the {' and the '.join(compasses)} alone",
            RECORD_VELOCITY,
            (HEADING,),
            "calibration",
        )
    if solution.trajectory.q_nb is None:
        return
    learned = claimed is not None and len(claimed) and np.isfinite(claimed[-1, BA][:2]).all()
    if not kinds & {"position", "velocity"}:
        yield Untested(
            "accelerometer biases and accelerations",
            "without GNSS the filter cannot separate them from tilt",
            RECORD_VELOCITY,
            (TILT, HEADING),
            "accelerometer",
        )
    elif learned and all(_never_seen(solution, BA.start + i, UNSEEN_BIAS) for i in range(2)):
        yield Untested(
            "horizontal accelerometer biases",
            "no turn separated them from tilt, which therefore depends on the IMU description",
            "turn the vehicle by 180 deg on level ground, or bank it",
            (TILT,),
            "accelerometer",
        )


def _never_seen(solution: Solution, state: int, share: float) -> bool:
    """True where the std of a state ends above a share of that at the start."""
    std = solution.trajectory.std
    if std is None or not len(std) or not np.isfinite(std[-1, state]):
        return False
    return bool(std[-1, state] > share * solution.meta["start"]["std"][state])


def heading_never_seen(solution: Solution) -> bool:
    """Return True where the std of the heading fell little from start to end, and ends above
    COARSE_HEADING."""
    state, std = ATT.stop - 1, solution.trajectory.std
    if std is None or not _never_seen(solution, state, UNSEEN_HEADING):
        return False
    return bool(std[-1, state] > COARSE_HEADING)
