"""Turns of the gyro about the vertical against turns of the course over ground: sign and unit.

The vertical is that of the specific force, so that no mounting matters and no attitude is
integrated: a gyro in a wrong unit would spoil it.
"""

import numpy as np

from ..verdict import Reason
from .checked import Checked, label
from .clock import LEAST_FIXES, correlations
from .motion import Subject, course_rate, moved

HALF, REACH, STEP = 1.0, 3.0, 0.1
"""Half the window of a turn, and lags between the clocks that are looked at, s."""
SURE, VERY_SURE = 0.7, 0.95
"""Correlation from which turns are the same ones, and from which a ratio that no unit explains
counts: the antenna of a rolling ship swings, and its course with it."""
LEAST_TURN = np.radians(1.0)
"""Root mean square rate of the course that tells something, rad/s."""
LEAST_RATIO, MOST_RATIO = 0.4, 2.5
"""What turns of the gyro may be as multiples of those of the course."""
FACTORS = {
    np.degrees(1): "deg/s read as rad/s",
    np.radians(1): "rad/s read as deg/s",
    np.degrees(1) * 3600: "deg/h read as rad/s",
    np.radians(1) / 3600: "rad/s read as deg/h",
    3600.0: "deg/h read as deg/s",
    1 / 3600: "deg/s read as deg/h",
}


def check(subject: Subject) -> Checked:
    """The gyro against the course of the first velocity, or else position."""
    sources = subject.sources("velocity", "position")
    fixes = moved(sources[0]) if sources else None
    if fixes is None:
        return Checked.nothing()
    what = f"turns of the gyro against the course of {label(sources[0])}"
    half = max(HALF, 2 * fixes.interval)
    theirs = course_rate(fixes, half, fixes.fast)
    use = np.isfinite(theirs)
    if use.sum() < LEAST_FIXES or not theirs[use].std() > LEAST_TURN:
        return Checked.unknown(what, "the course is known too seldom, or hardly turns")
    motion = subject.felt
    f = motion.mean(motion.body_v, motion.t, half)
    rate = motion.mean(motion.body_turn, motion.t, half)
    turn = -(rate * f).sum(axis=1) / np.maximum(np.linalg.norm(f, axis=1), 1e-9)
    lags = np.arange(-REACH, REACH + STEP / 2, STEP)
    times = fixes.t[use] + lags[:, None]
    ours = np.interp(times, motion.t, turn, left=np.nan, right=np.nan)
    r = correlations(theirs[use], ours)
    if not np.isfinite(r).any() or np.nanmax(np.abs(r)) < SURE:
        return Checked.unknown(what, "they hardly agree at any lag up to 3 s")
    top = int(np.nanargmax(np.abs(r)))
    known = np.isfinite(ours[top])
    ratio = float(ours[top][known].std() / theirs[use][known].std())
    of_positions = sources[0].kind == "position"
    found = Checked.nothing()
    found.facts.append(f"{what}: correlation {r[top]:.3f}, gyro / course {ratio:.3g}")
    if r[top] < 0:
        found.reasons.append(
            Reason(
                "axes",
                f"the gyro turns left where the course of {label(sources[0])} turns right "
                f"(correlation {r[top]:.2f})",
                "check the sign of gyro z, or `axes` of [imu]"
                + ", or whether latitude and longitude are exchanged" * of_positions,
                weight=10.0,
            )
        )
    near = min(FACTORS, key=lambda known: abs(np.log(ratio / known)))
    likely = FACTORS[near] if abs(np.log(ratio / near)) < np.log(2) else ""
    if not LEAST_RATIO < ratio < MOST_RATIO and (likely or abs(r[top]) > VERY_SURE):
        found.reasons.append(
            Reason(
                "unit",
                f"the gyro turns {ratio:.3g} times as much as the course of {label(sources[0])}: "
                f"{likely or 'a wrong unit or scale'}",
                "correct `gyro.unit` or `gyro.scale` of [imu]",
                weight=10.0,
            )
        )
    return found
