"""The gyro against a magnetometer: in a turning body the field turns the other way, by as much. So axes of
the two sensors that do not agree show without GNSS, at any attitude, and whatever the field's direction
is. Gravity turns as the field does, where the body accelerates little."""

import numpy as np

from ..core.mathematics.rotation_vectors import exponentials
from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array
from .field_changes import find_change, reason_of_change
from .field_fit import (
    BLOCK,
    LAGS,
    NOTHING,
    SURE_OF_AXES,
    FieldPairs,
    fit_field,
    predicted_field,
    reasons_of_fit,
    turned_field,
)
from .finding import MIN_FIXES, Checked, clustered_least_squares, label
from .motion import STEP, Felt, InspectedRecording

WINDOWS, MAX_TURN = (4.0, 2.0, 1.0, 0.4), 0.6
"""s over which the field is seen to turn, and by how much (rad, rms) it may, so that turns hardly change
axis: in the longest of them that has no larger ones, or else in the shortest."""
NOTABLE = 6.0
"""Noise of a field by which it must turn, or the gyro must turn it, within a window that is looked at."""
FITS, BETTER = 0.1, 0.2
"""Share of the change of the field that the gyro may leave unexplained, and of what is left as read that
other axes may leave. A hard iron does not turn, and leaves as much with any axes."""
MEAN, FORCE_STD = 0.25, 0.1
"""s over which the specific force is averaged to either side; m/s^2 that count as its noise."""
FITS_FORCE, BETTER_FORCE = 0.35, 0.5
"""FITS and BETTER of gravity: a ship's own accelerations leave 0.3, those of a car all."""
AGAINST = 0.5
"""Correlation from which an axis of the accelerometer that turns against the gyro has the wrong sign: of
right ones the body's own accelerations leave -0.1 and more."""
FORCE_WINDOW = 2.0
"""s over which each axis of gravity is seen to turn."""
UNLIKE = 0.5
"""Share of the change of the field that, left with any axes, is a reason: moved iron leaves less."""
QUARTERS = tuple(
    np.round(exponentials(np.array([[0.0, 0.0, np.pi / 2 * k]]))[0]) for k in (1, 2, 3)
)
"""(3, 3) rotations of the axes of the IMU about its z axis."""
SWAPPED = np.eye(3)[[1, 0, 2]]
TURNED = (
    {f"turned by {90 * (k + 1)} deg about z": C.T for k, C in enumerate(QUARTERS)}
    | {
        # a rate is no arrow: where an axis is mirrored, the rates about the two others change sign
        f"with the sign of gyro {name} changed": np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))
        for axis, name in enumerate("xyz")
    }
    | {"with all its signs changed": -np.eye(3), "with its x and y swapped": SWAPPED}
)
"""{change of the axes: (3, 3) matrix of the gyro}."""
IN_DEGREES = "multiplied by 180/pi"
"""Change of a gyro that was converted twice; one in deg/s is beyond its range anyway."""


def check(subject: InspectedRecording) -> Checked:
    """The turns of each magnetometer, and where there are no fixes those of gravity, against those of the
    gyro."""
    found = Checked.empty()
    for source in subject.sources("magnetic-field"):
        found.add(_of_field(subject, source))
    if not subject.sources("position", "velocity") and not found.reasons:
        found.add(_of_gravity(subject))
    return found


def _of_field(subject: InspectedRecording, source: Source) -> Checked:
    what = f"turns of the gyro against those of {label(source)}"
    pairs = _choose_pairs(subject, source)
    if len(pairs.begin) < MIN_FIXES:
        return Checked.with_unknown(what, "the vehicle hardly turns")
    left, others = _lefts(pairs, subject.felt)
    best = min(others, key=others.__getitem__)
    if others[best] <= min(BETTER * left, FITS):  # first: a fit would take a sign for a scale
        return Checked([], [_reason(label(source), left, best, others[best])], [])
    fit = fit_field(pairs, subject.felt)
    found = NOTHING if fit is None else fit.value
    left = _share_left(pairs, predicted_field(pairs, subject.felt, found))
    if fit is not None and left <= UNLIKE:
        if change := find_change(pairs, subject.felt, found):
            return Checked([], [reason_of_change(change, source)], [])
    if left <= FITS:
        fact = f"{what}: the gyro leaves {100 * left:.0f} % of the change of the field unexplained"
        return Checked([fact], [] if fit is None else reasons_of_fit(fit, source), [])
    if fit is not None and left > UNLIKE:
        return Checked([], [_reason_unlike(source, left)], [])
    return Checked.with_unknown(what, "no axes of the gyro explain the change of the field")


def _of_gravity(subject: InspectedRecording) -> Checked:
    """Return what the specific force says of the axes of the gyro: the body's own accelerations hide much of
    it, so that only axes that explain far more are a reason, and right ones are no fact."""
    motion = subject.felt
    t = motion.t[::2]
    t = t[(t > motion.t[0] + MEAN) & (t < motion.t[-1] - MEAN)] if len(t) else t
    if len(t) < MIN_FIXES:
        return Checked.empty()
    force = motion.mean(motion.body_v, t, MEAN)
    gravity = Source("specific-force", t, force, np.full_like(force, FORCE_STD))
    if wrong := _reason_of_sign(_pairs(subject, gravity, FORCE_WINDOW), motion):
        return Checked([], [wrong], [])
    pairs = _choose_pairs(subject, gravity)
    if len(pairs.begin) < MIN_FIXES:
        return Checked.empty()
    left, others = _lefts(pairs, motion)
    best = min(others, key=others.__getitem__)
    if left < UNLIKE or others[best] > min(BETTER_FORCE * left, FITS_FORCE):
        return Checked.empty()
    return Checked([], [_reason("gravity", left, best, others[best])], [])


def _reason_of_sign(pairs: FieldPairs, felt: Felt) -> Reason | None:
    """Return a Reason where one axis of the accelerometer turns against the gyro and the two others do
    not; None otherwise. The body's own acceleration hides gravity but has no part in the turn, so that it
    leaves the correlation between its change and that of the turn positive."""
    if len(pairs.begin) < MIN_FIXES:
        return None
    expected = turned_field(pairs, pairs.turn(felt)) - pairs.first
    seen = pairs.last - pairs.first
    block = np.unique(np.floor(pairs.begin / BLOCK), return_inverse=True)[1]
    signs = []
    for axis in range(3):
        slope, std, _ = clustered_least_squares(expected[:, [axis]], seen[:, axis], block)
        size = float(np.linalg.norm(expected[:, axis]) * np.linalg.norm(seen[:, axis]))
        alike = float(expected[:, axis] @ seen[:, axis]) / max(size, 1e-12)
        sure = abs(alike) > AGAINST and abs(slope[0]) > SURE_OF_AXES * std[0]
        signs.append(alike if sure else 0.0)
    wrong = [axis for axis in range(3) if signs[axis] < 0]
    if len(wrong) != 1:
        return None
    name = "xyz"[wrong[0]]
    return Reason(
        "axes",
        f"gravity along {name} of the accelerometer turns against the gyro (correlation "
        f"{min(signs):.2f})",
        f"check the sign of accelerometer {name} against the gyro: `axes` of [imu]",
        weight=10.0,
    )


def _choose_pairs(subject: InspectedRecording, source: Source) -> FieldPairs:
    """The FieldPairs of the longest windows in which the field hardly changes its axis of turn."""
    some = [_pairs(subject, source, window) for window in WINDOWS]
    return next((each for each in some if _field_turn(each) < MAX_TURN), some[-1])


def _field_turn(pairs: FieldPairs) -> float:
    """rad, rms: how far the field turns within a window."""
    size = np.linalg.norm(pairs.first, axis=1) * np.linalg.norm(pairs.last, axis=1)
    cosine = (pairs.first * pairs.last).sum(axis=1) / np.maximum(size, 1e-12)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    return float(np.sqrt(np.mean(turn**2))) if len(turn) else 0.0


def _lefts(pairs: FieldPairs, felt: Felt) -> tuple[float, dict[str, float]]:
    """(share of the change of the field that is left with the gyro as read, {change of axes or unit: share
    that is left with it})."""
    turn = pairs.turn(felt)
    turns = {name: turn @ C.T for name, C in TURNED.items()}
    turns[IN_DEGREES] = turn * 180 / np.pi
    left = _share_left(pairs, turned_field(pairs, turn))
    return left, {
        name: _share_left(pairs, turned_field(pairs, other)) for name, other in turns.items()
    }


def _pairs(subject: InspectedRecording, source: Source, window: float) -> FieldPairs:
    """The FieldPairs of windows of `window` s in which the gyro or the field turns."""
    motion, reach = subject.felt, STEP - LAGS[0]
    use = np.isfinite(source.y).all(axis=1) & (source.t >= motion.t[0] + reach)
    use &= source.t <= motion.t[-1] - reach
    t, y = source.t[use], source.y[use]
    later = np.searchsorted(t, t + window - 1e-6)
    rows = np.flatnonzero(later < len(t))
    rows = rows[t[later[rows]] - t[rows] < 1.5 * window]
    noise = float(np.nanmedian(source.std))
    pairs = FieldPairs(t[rows], t[later[rows]], y[rows], y[later[rows]], noise)
    by_gyro = np.linalg.norm(np.cross(pairs.turn(motion), pairs.first), axis=1)
    by_field = np.linalg.norm(pairs.last - pairs.first, axis=1) / np.sqrt(2)
    return pairs.take(np.maximum(by_gyro, by_field) > NOTABLE * noise)


def _share_left(pairs: FieldPairs, expected: Array) -> float:
    """Share of the change of the field that is left where the field at the end was `expected` (n, 3), T,
    without that of the claimed noise."""
    noise = 2 * pairs.noise**2 * pairs.first.size
    change = float(((pairs.last - pairs.first) ** 2).sum())
    left = float(((pairs.last - expected) ** 2).sum()) - noise
    return max(left, 0.0) / max(change - noise, change / 2)


def _reason_unlike(source: Source, left: float) -> Reason:
    return Reason(
        "unknown",
        f"the turns of {label(source)} contradict the gyro with any axes ({100 * left:.0f} % of "
        "the change is unexplained)",
        f"compare axes, unit and clock of the gyro and {label(source)}, and check whether they "
        "changed; look for iron or magnets that move near it",
        label(source),
        left / UNLIKE,
    )


def _reason(sensor: str, left: float, name: str, other: float) -> Reason:
    return Reason(
        "unit" if name == IN_DEGREES else "axes",
        f"the turns of {sensor} fit the gyro {name} ({100 * other:.0f} % of the change is "
        f"unexplained), and not as it is read ({100 * left:.0f} %)",
        "check the unit of the gyro"
        if name == IN_DEGREES
        else f"check the axes of the gyro against those of {sensor}: `axes` of [imu]",
        weight=10.0,
    )
