"""The gyro against a magnetometer: in a turning body the field turns the other way, by as much. So axes of
the two sensors that do not agree show without GNSS, at any attitude, and whatever the field's direction
is."""

import numpy as np

from ..core.mathematics.rotation_vectors import exponentials
from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array
from .field_fit import LAGS, NOTHING, FieldPairs, fit_field, predicted_field, reasons_of_fit, turned_field
from .finding import MIN_FIXES, Checked, label
from .motion import STEP, InspectedRecording

WINDOWS, MAX_TURN = (4.0, 2.0, 1.0, 0.4), 0.6
"""s over which the field is seen to turn, and by how much (rad, rms) it may, so that turns hardly change
axis: in the longest of them that has no larger ones, or else in the shortest."""
NOTABLE = 6.0
"""Noise of a field by which it must turn, or the gyro must turn it, within a window that is looked at."""
FITS, BETTER = 0.1, 0.2
"""Share of the change of the field that the gyro may leave unexplained, and of what is left as read that
other axes may leave. A hard iron does not turn, and leaves as much with any axes."""
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
    """The turns of each magnetometer against those of the gyro."""
    found = Checked.empty()
    for source in subject.sources("magnetic-field"):
        found.add(_of_source(subject, source))
    return found


def _of_source(subject: InspectedRecording, source: Source) -> Checked:
    what = f"turns of the gyro against those of {label(source)}"
    some = [_pairs(subject, source, window) for window in WINDOWS]
    pairs = next((each for each in some if _field_turn(each) < MAX_TURN), some[-1])
    if len(pairs.begin) < MIN_FIXES:
        return Checked.with_unknown(what, "it hardly turns")
    fit = fit_field(pairs, subject.felt)
    found = NOTHING if fit is None else fit.value
    left = _share_left(pairs, predicted_field(pairs, subject.felt, found))
    if left <= FITS:
        fact = f"{what}: {100 * left:.0f} % of the change of the field is left"
        return Checked([fact], [] if fit is None else reasons_of_fit(fit, source), [])
    turn = pairs.turn(subject.felt)
    left, others = _share_left(pairs, turned_field(pairs, turn)), _others_left(pairs, turn)
    best = min(others, key=others.__getitem__)
    if others[best] > min(BETTER * left, FITS):
        unlike = fit is not None and left > UNLIKE
        return Checked(
            [],
            [_reason_unlike(source, left)] if unlike else [],
            [] if unlike else [f"{what}: no axes explain what the field does"],
        )
    return Checked([], [_reason(source, left, best, others[best])], [])


def _field_turn(pairs: FieldPairs) -> float:
    """rad, rms: how far the field turns within a window."""
    size = np.linalg.norm(pairs.first, axis=1) * np.linalg.norm(pairs.last, axis=1)
    cosine = (pairs.first * pairs.last).sum(axis=1) / np.maximum(size, 1e-12)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    return float(np.sqrt(np.mean(turn**2))) if len(turn) else 0.0


def _others_left(pairs: FieldPairs, turn: Array) -> dict[str, float]:
    """{change of axes or unit: share of the change of the field that is left with it}."""
    turns = {name: turn @ C.T for name, C in TURNED.items()}
    turns[IN_DEGREES] = turn * 180 / np.pi
    return {name: _share_left(pairs, turned_field(pairs, other)) for name, other in turns.items()}


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
        f"{label(source)} turns otherwise than the gyro says, with any axes ({100 * left:.0f} % of its "
        f"change is left)",
        f"compare axes, unit and clock of the gyro and {label(source)}, and ask whether they changed; "
        "look for iron or magnets that move beside it",
        label(source),
        left / UNLIKE,
    )


def _reason(source: Source, left: float, name: str, other: float) -> Reason:
    sensor = label(source)
    return Reason(
        "unit" if name == IN_DEGREES else "axes",
        f"{sensor} turns as the gyro says {name} ({100 * other:.0f} % of its change is left), and "
        f"not as it is read ({100 * left:.0f} %)",
        "check the unit of the gyro"
        if name == IN_DEGREES
        else f"check `axes` of [imu] against those of {sensor}",
        weight=10.0,
    )
