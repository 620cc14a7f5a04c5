"""The gyro against a magnetometer: in a turning body the field turns the other way, by as much. So axes of
the two sensors that do not agree show without GNSS, at any attitude, and whatever the field's direction
is."""

from typing import NamedTuple

import numpy as np

from ..core.mathematics.rotation_vectors import exponentials
from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array
from .finding import MIN_FIXES, Checked, label
from .motion import STEP, InspectedRecording

WINDOWS = (0.4, 2.0)
"""s over which the field is seen to turn, of quick and of slow motion: short, so that the turns within one
hardly change axis."""
NOTABLE = 3.0
"""Noise of a field by which the gyro must turn it within a window that is looked at."""
FITS, BETTER = 0.1, 0.2
"""Share of the change of the field that the gyro may leave unexplained, and of what is left as read that
other axes may leave. A hard iron does not turn, and leaves as much with any axes."""
QUARTERS = tuple(
    np.round(exponentials(np.array([[0.0, 0.0, np.pi / 2 * k]]))[0]) for k in (1, 2, 3)
)
"""(3, 3) rotations of the axes of the IMU about its z axis."""
TURNED = {f"turned by {90 * (k + 1)} deg about z": C.T for k, C in enumerate(QUARTERS)} | {
    # a rate is no arrow: where an axis is mirrored, the rates about the two others change sign
    f"with the sign of gyro {name} changed": np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))
    for axis, name in enumerate("xyz")
}
"""{change of the axes: (3, 3) matrix of the gyro}."""


def check(subject: InspectedRecording) -> Checked:
    """The turns of each magnetometer against those of the gyro."""
    found = Checked.empty()
    for source in subject.sources("magnetic-field"):
        found.add(_of_source(subject, source))
    return found


def _of_source(subject: InspectedRecording, source: Source) -> Checked:
    what = f"turns of the gyro against those of {label(source)}"
    some = (_pairs(subject, source, window) for window in WINDOWS)
    pairs = next((each for each in some if len(each.turn) >= MIN_FIXES), None)
    if pairs is None:
        return Checked.with_unknown(what, "it hardly turns")
    left = _share_left(pairs, pairs.turn)
    others = {name: _share_left(pairs, pairs.turn @ C.T) for name, C in TURNED.items()}
    best = min(others, key=others.__getitem__)
    if left <= FITS:
        return Checked([f"{what}: {100 * left:.0f} % of the change of the field is left"], [], [])
    if others[best] > min(BETTER * left, FITS):
        return Checked.with_unknown(what, "no axes explain what the field does")
    return Checked([], [_reason(source, left, best, others[best])], [])


class Pairs(NamedTuple):
    """Fields at the beginning and the end of windows in which the body turns."""

    first: Array  # (n, 3) T
    last: Array  # (n, 3) T
    turn: Array  # (n, 3) of the gyro in between, rad
    noise: float  # claimed std of a component, T


def _pairs(subject: InspectedRecording, source: Source, window: float) -> Pairs:
    """The Pairs of windows of `window` s."""
    motion = subject.felt
    use = np.isfinite(source.y).all(axis=1) & (source.t >= motion.t[0])
    use &= source.t <= motion.t[-1] - STEP
    t, y = source.t[use], source.y[use]
    later = np.searchsorted(t, t + window - 1e-6)
    rows = np.flatnonzero(later < len(t))
    rows = rows[t[later[rows]] - t[rows] < 1.5 * window]
    turned = np.stack([np.interp(t, motion.t, c) for c in motion.body_turn.T], axis=1)
    first, last, turn = y[rows], y[later[rows]], turned[later[rows]] - turned[rows]
    noise = float(np.nanmedian(source.std))
    seen = np.linalg.norm(np.cross(turn, first), axis=1) > NOTABLE * noise
    return Pairs(first[seen], last[seen], turn[seen], noise)


def _share_left(pairs: Pairs, turn: Array) -> float:
    """Share of the change of the field that is left after the turns (n, 3), rad, without that of the
    claimed noise."""
    expected = np.einsum("nij,nj->ni", exponentials(-turn), pairs.first)
    noise = 2 * pairs.noise**2 * pairs.first.size
    change = float(((pairs.last - pairs.first) ** 2).sum())
    left = float(((pairs.last - expected) ** 2).sum()) - noise
    return max(left, 0.0) / max(change - noise, change / 2)


def _reason(source: Source, left: float, name: str, other: float) -> Reason:
    return Reason(
        "axes",
        f"{label(source)} turns as the gyro says {name} ({100 * other:.0f} % of its change is left), and "
        f"not as it is read ({100 * left:.0f} %)",
        f"check `axes` of [imu] against those of {label(source)}",
        weight=10.0,
    )
