"""The scale of the gyro about the vertical, by the course of a vehicle that points where it goes: over a
window the heading turns by as much as the course, whatever both are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..data.vehicle import find as find_vehicle
from ..data.verdict import HEADING, TILT, Reason, Untested
from ..geometry.geodesy import wrap
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from .finding import MIN_FIXES, Checked, clustered_least_squares, label
from .motion import InspectedRecording, Moved, source_velocity

WINDOW, SPACING = 12.0, 2.0
"""s over which turns are compared, and between the beginnings of windows."""
LEVEL = 10.0
"""s before and after a window over which the specific force is averaged, which then points up."""
UPRIGHT = 0.07
"""rad by which that mean may lean, as the velocity has changed: an aircraft that begins or ends a turn
within a window rolls about what is not upright then, which counts as 1 % of its turn."""
BLOCK = 30.0
"""s within which differences may hang together."""
ALIKE = np.radians(10.0)
"""rad: differences that scatter more are those of a course that is no heading."""
TURNS = 0.3
"""rad: turns whose rms over a window is smaller tell nothing."""
MIN_RATE = 0.01
"""rad/s rms of rates that are turns."""
SURE, MIN_SCALE, MAX_SCALE = 5.0, 0.005, 0.1
"""Standard deviations and size from which a scale is a reason, and beyond which it is none."""


def check(subject: InspectedRecording) -> Checked:
    """The turns of the gyro against those of the course of the first velocity."""
    sources = subject.sources("velocity")
    if not _turns(subject):
        return Checked.empty()
    if not sources or not find_vehicle(subject.recording.meta.get("vehicle")).points_ahead:
        return _untested_scale("the recording has no course to compare with")
    fixes = source_velocity(sources[0])
    windows = None if fixes is None else _windows(subject, fixes)
    if windows is None or len(windows.t) < MIN_FIXES:
        return _untested_scale("too few fixes give a course")
    if np.sqrt(np.mean(windows.turned**2)) < TURNS:
        return Checked.empty()
    scale, std = _scale(windows)
    if not std < MAX_SCALE or abs(scale) > max(MAX_SCALE, SURE * std):
        return _untested_scale("the course differs from the heading, or hardly turns")
    name = label(sources[0])
    weight = abs(scale) / max(SURE * std, MIN_SCALE)
    if weight >= 1:
        return Checked([], [_reason(name, scale, std, weight)], [])
    share = f"{100 * std:.2g} %"
    fact = f"scale of the gyro against the course of {name}: {100 * scale:+.2f} % +- {share}"
    if SURE * std < MIN_SCALE:
        return Checked([fact], [], [])
    turn = f"{np.degrees(np.pi * std):.1g} deg"
    coarse = _untested_scale(
        f"the course shows it only to +-{share}, which is {turn} after a turn of 180 deg"
    )
    return Checked([fact], [], [], coarse.untested)


def _turns(subject: InspectedRecording) -> bool:
    """True where the gyro turns for the most part by more than noise and bias."""
    imu = subject.recording.imu
    rate = imu.dtheta.sum(axis=1) / imu.dt
    return bool(len(rate)) and float(np.sqrt(np.mean(rate**2))) > MIN_RATE


def _untested_scale(why: str) -> Checked:
    """Nothing but that the scale is not tested, and why."""
    remedy = "calibrate the gyro, or record turns with GNSS velocity in a vehicle that points ahead"
    return Checked(
        [], [], [], [Untested("scale of the gyros", why, remedy, (TILT, HEADING), "gyro")]
    )


def _scale(windows: TurnWindows) -> tuple[float, float]:
    """(scale, its standard deviation) of the gyro; infinite where the course is no heading. The standard
    deviation is that of the scatter, and no smaller than what the claimed noise of the course makes."""
    A = np.c_[windows.turned, np.full(len(windows.t), WINDOW)]
    block = np.unique(np.floor(windows.t / BLOCK), return_inverse=True)[1]
    value, std, left = clustered_least_squares(A, windows.off, block)
    if not np.isfinite(std[0]) or np.median(np.abs(left)) > ALIKE:
        return 0.0, np.inf
    independent = max(1.0, len(windows.t) * SPACING / WINDOW)
    claimed = windows.noise / (np.sqrt(np.mean(windows.turned**2)) * np.sqrt(independent))
    return float(-value[0]), float(max(std[0], claimed))


def _reason(name: str, scale: float, std: float, weight: float) -> Reason:
    more = "more" if scale > 0 else "less"
    return Reason(
        "gyro",
        f"the gyro turns {100 * abs(scale):.2g} +- {100 * std:.2g} % {more} than the course of {name}",
        "calibrate its scale, or let the filter estimate it: `--estimate gyro-scale`",
        weight=weight,
    )


class TurnWindows(NamedTuple):
    """Windows at whose ends the course is known."""

    t: Array  # (k,) s, when they begin
    turned: Array  # (k,) rad, by the gyro about the vertical
    off: Array  # (k,) rad, by the course less that
    noise: float  # rad, rms of that by the claimed noise of the velocities


def _windows(subject: InspectedRecording, fixes: Moved) -> TurnWindows:
    motion = subject.felt
    first = np.arange(fixes.t[0], fixes.t[-1] - WINDOW, SPACING)
    first = fixes.t[np.searchsorted(fixes.t, first)]
    ends = [fixes.at(first), fixes.at(first + WINDOW)]
    around = fixes.at(first + WINDOW + LEVEL) - fixes.at(first - LEVEL)
    known = np.min([np.hypot(v[:, 0], v[:, 1]) for v in ends], axis=0) > fixes.fast
    known &= (first - LEVEL > motion.t[0]) & (first + WINDOW + LEVEL < motion.t[-1])
    leant = np.hypot(around[:, 0], around[:, 1]) / (STANDARD_GRAVITY * (WINDOW + 2 * LEVEL))
    known &= leant < UPRIGHT
    first, ends = first[known], [v[known] for v in ends]
    up = _between(motion.t, motion.v, first - LEVEL, first + WINDOW + LEVEL)
    turn = _between(motion.t, motion.turn, first, first + WINDOW)
    size = np.maximum(np.linalg.norm(up, axis=1), 1e-9)
    turned = -(turn * up).sum(axis=1) / size
    course = [np.arctan2(v[:, 1], v[:, 0]) for v in ends]
    slow = [np.maximum(np.hypot(v[:, 0], v[:, 1]), 1e-9) for v in ends]
    noise = (
        fixes.std * float(np.sqrt(np.mean(slow[0] ** -2 + slow[1] ** -2))) if len(first) else 0.0
    )
    return TurnWindows(first, turned, wrap(course[1] - course[0] - turned), noise)


def _between(t: Array, integral: Array, first: Array, last: Array) -> Array:
    """(k, 3) how much an integral (n, 3) at times t (n,) grows from `first` to `last` (k,)."""
    columns = [np.interp(last, t, c) - np.interp(first, t, c) for c in integral.T]
    return np.stack(columns, axis=1)
