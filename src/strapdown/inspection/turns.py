"""Turns of the gyro about the vertical against turns of the course over ground: sign and unit.

The vertical is that of the specific force, so that no mounting matters and no attitude is
integrated: a gyro in a wrong unit would spoil it. Where the course does not tell, the accelerations
of the fixes do.
"""

import numpy as np

from ..data.solution import Source
from ..data.vehicle import find as find_vehicle
from ..data.verdict import Reason
from ..typing import Array
from .clock_offsets import correlations
from .finding import MIN_FIXES, Checked, label
from .gyro_fit import EVIDENCE, likelier
from .motion import InspectedRecording, course_rate, source_velocity

HALF, REACH, STEP = 1.0, 3.0, 0.1
"""Half the window of a turn, and lags between the clocks that are looked at, s."""
SURE, VERY_SURE = 0.7, 0.95
"""Correlation from which turns are the same ones, and from which a ratio that no unit explains
counts: the antenna of a rolling ship swings, and its course with it."""
MIN_TURN = np.radians(1.0)
"""Least root mean square rate of the course that is compared, rad/s."""
FAST_TURNS = 1.0
"""Root mean square rate of a gyro that may be in deg/s, read as rad/s."""
REMEDY = "correct `gyro.unit` or `gyro.scale` of [imu]"
MIN_RATIO, MAX_RATIO = 0.4, 2.5
"""Bounds on the turns of the gyro as multiples of those of the course."""
FACTORS = {
    np.degrees(1): "deg/s read as rad/s",
    np.radians(1): "rad/s read as deg/s",
    np.degrees(1) * 3600: "deg/h read as rad/s",
    np.radians(1) / 3600: "rad/s read as deg/h",
    3600.0: "deg/h read as deg/s",
    1 / 3600: "deg/s read as deg/h",
}


def check(subject: InspectedRecording) -> Checked:
    """The gyro against the course of the first velocity, or else position; where that tells nothing,
    or the course is no heading, against the accelerations of the fixes."""
    if find_vehicle(subject.recording.meta.get("vehicle")).points_ahead:
        found = _by_course(subject)
    else:
        found = Checked.empty()
    return found if found.facts or found.reasons else _by_accelerations(subject, found)


def _by_course(subject: InspectedRecording) -> Checked:
    """The gyro against the course. What the accelerations contradict is not said: of a multicopter
    that nobody named the course is no heading."""
    sources = subject.sources("velocity", "position")
    fixes = source_velocity(sources[0]) if sources else None
    if fixes is None:
        return Checked.empty()
    what = f"turns of the gyro against the course of {label(sources[0])}"
    half = max(HALF, 2 * fixes.interval)
    theirs = course_rate(fixes, half, fixes.fast)
    use = np.isfinite(theirs)
    if use.sum() < MIN_FIXES or not theirs[use].std() > MIN_TURN:
        return Checked.with_unknown(what, "too few fixes give a course, or the course hardly turns")
    ours = _gyro_turns(subject, fixes.t[use], half)
    r = correlations(theirs[use], ours)
    if not np.isfinite(r).any() or np.nanmax(np.abs(r)) < SURE:
        return Checked.with_unknown(what, "the two hardly agree at any lag up to 3 s")
    top = int(np.nanargmax(np.abs(r)))
    known = np.isfinite(ours[top])
    ratio = float(ours[top][known].std() / theirs[use][known].std())
    reasons = _reasons(sources[0], float(r[top]), ratio)
    as_course = np.array([1.0, 1.0, np.sign(r[top])])
    if not MIN_RATIO < ratio < MAX_RATIO:
        as_course /= ratio
    if reasons and likelier(subject, as_course) < -EVIDENCE:
        return Checked.with_unknown(
            what, "the two differ, but the accelerations of the fixes fit the gyro"
        )
    fact = f"{what}: correlation {r[top]:.3f}, gyro / course {ratio:.3g}"
    return Checked([fact], reasons, [])


def _gyro_turns(subject: InspectedRecording, t: Array, half: float) -> Array:
    """(lags, m) the turn of the gyro about the vertical around each time, rad/s, for lags from -REACH to
    REACH s; NaN where there are no samples."""
    motion = subject.felt
    f = motion.mean(motion.body_v, motion.t, half)
    rate = motion.mean(motion.body_turn, motion.t, half)
    turn = -(rate * f).sum(axis=1) / np.maximum(np.linalg.norm(f, axis=1), 1e-9)
    lags = np.arange(-REACH, REACH + STEP / 2, STEP)
    return np.interp(t + lags[:, None], motion.t, turn, left=np.nan, right=np.nan)


def _reasons(source: Source, r: float, ratio: float) -> list[Reason]:
    """Reasons of a correlation with the course of a source and a ratio to it."""
    found = []
    if r < 0:
        seen = (
            f"the gyro turns left where the course of {label(source)} turns right (correlation "
            f"{r:.2f})"
        )
        remedy = "check the sign of gyro z, or `axes` of [imu]"
        if source.kind == "position":
            remedy += ", or whether latitude and longitude are exchanged"
        found.append(Reason("axes", seen, remedy, weight=10.0))
    near = min(FACTORS, key=lambda known: abs(np.log(ratio / known)))
    likely = FACTORS[near] if abs(np.log(ratio / near)) < np.log(2) else ""
    if not MIN_RATIO < ratio < MAX_RATIO and (likely or abs(r) > VERY_SURE):
        seen = (
            f"the gyro turns {ratio:.3g} times as much as the course of {label(source)}: "
            f"{likely or 'a wrong unit or scale'}"
        )
        found.append(Reason("unit", seen, REMEDY, weight=10.0))
    return found


def _by_accelerations(subject: InspectedRecording, found: Checked) -> Checked:
    """Return `found`, or the unit of the gyro that fits the accelerations of the fixes better."""
    imu = subject.recording.imu
    rms = float(np.sqrt((imu.dtheta**2).sum() / (imu.dt**2).sum()))
    for factor in (np.degrees(1), np.radians(1)):
        # a bias alone is no unit: what is 57 times too large turns fast
        if factor > 1 and rms < FAST_TURNS:
            continue
        evidence = likelier(subject, 1 / factor)
        if evidence > EVIDENCE:
            seen = (
                f"the accelerations of the fixes fit {1 / factor:.3g} times the rates of the "
                f"gyro: {FACTORS[factor]}"
            )
            return Checked(found.facts, [Reason("unit", seen, REMEDY, weight=10.0)], [])
    return found
