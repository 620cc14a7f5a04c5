"""The vector between two antennas against its given length, and its direction against the course of
a vehicle that points where it goes: a wrong length, two antennas swapped, a vector of other axes."""

import numpy as np

from ..data.solution import Source
from ..data.vehicle import find as find_vehicle
from ..data.verdict import GRAVE, Reason
from ..geometry.geodesy import wrap
from ..preprocessing.baseline_length import length_errors, wrong_lengths
from ..typing import Array
from .finding import MIN_FIXES, Checked, label
from .motion import InspectedRecording, source_velocity

MANY = 0.05
"""Share of fixes of a wrong length that a receiver with sound carrier solutions stays below."""
MAX_OFF, SCATTER = np.radians(20.0), np.radians(30.0)
"""rad: from the course by which a heading may differ by wind, current or a lever arm, and up to
which the two scatter where they belong together."""
FLAT = 0.5
"""Part of the vector that must lie in the horizontal plane of the body, to have a direction there."""


def check(subject: InspectedRecording) -> Checked:
    """Length and direction of every source of kind baseline."""
    found = Checked.empty()
    for source in subject.sources("baseline"):
        if len(source.t) < MIN_FIXES:
            found.add(Checked.with_unknown(label(source), "it has too few fixes"))
            continue
        found.add(_of_length(source))
        if find_vehicle(subject.recording.meta.get("vehicle")).points_ahead:
            found.add(_of_direction(subject, source))
    return found


def _of_length(source: Source) -> Checked:
    """The median length against the given one."""
    given = float(np.linalg.norm(source.parameters[:3]))
    error, noise = length_errors(source.y, source.std, source.parameters)
    wrong = float(np.mean(wrong_lengths(source.y, source.std, source.parameters)))
    median = given + float(np.nanmedian(error))
    seen = f"its length is {median:.3f} m (median of {len(error)} fixes), given {given:.3f} m"
    if wrong <= MANY:
        return Checked([f"{label(source)}: {seen}"], [], [])
    off = abs(median - given) > 3 * float(np.nanmedian(noise))
    remedy = (
        f"correct `baseline` in the recording: a vector {median:.3f} m long"
        if off
        else "use fixes with a fixed carrier solution only"
    )
    seen += f"; {100 * wrong:.0f} % of the fixes are off by more than their noise and left out"
    cause = "baseline" if off else "outliers"
    return Checked([], [Reason(cause, seen, remedy, label(source), wrong / MANY)], [])


def _of_direction(subject: InspectedRecording, source: Source) -> Checked:
    """The heading by the vector in a level body, less the course."""
    l = np.array(source.parameters[:3])
    what = f"direction of {label(source)} against the course"
    if np.hypot(*l[:2]) < FLAT * np.linalg.norm(l):
        return Checked.with_unknown(what, "the antennas stand above each other")
    off, course_of = _off_course(subject, source)
    if len(off) < MIN_FIXES:
        return Checked.with_unknown(what, "no fixes show the course meanwhile")
    mean = float(np.angle(np.exp(1j * off).mean()))
    spread = float(np.median(np.abs(wrap(off - mean))))
    if spread > SCATTER:
        return Checked.with_unknown(what, "the two have nothing in common")
    if abs(mean) < MAX_OFF:
        return Checked([f"{what} of {course_of}: {np.degrees(mean):+.1f} deg"], [], [])
    seen = f"turned by {np.degrees(mean):+.0f} deg from the course of {course_of}"
    if np.pi - abs(mean) < MAX_OFF:
        seen += ": the two antennas are swapped"
        remedy = "change the sign of `baseline`, from the first to the second antenna"
    else:
        remedy = "check `baseline`, forward, right, down in the body, and the axes of the columns"
    return Checked([], [Reason("baseline", seen, remedy, label(source), 2 * GRAVE)], [])


def _off_course(subject: InspectedRecording, source: Source) -> tuple[Array, str]:
    """((n,) rad of the fixes while the course is known, name of its source)."""
    l = source.parameters
    for each in subject.sources("velocity", "position"):
        moved = source_velocity(each)
        if moved is None:
            continue
        v = moved.at(source.t)
        fast = np.hypot(v[:, 0], v[:, 1]) > moved.fast
        y, v = source.y[fast], v[fast]
        off = np.arctan2(y[:, 1], y[:, 0]) - np.arctan2(l[1], l[0]) - np.arctan2(v[:, 1], v[:, 0])
        off = wrap(off)
        return off[np.isfinite(off)], label(each)
    return np.empty(0), ""
