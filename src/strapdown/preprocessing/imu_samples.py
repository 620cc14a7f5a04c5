"""IMU samples from arrays. Only this module converts rates to increments; unusable samples are
dropped and counted."""

from bisect import bisect_right
from collections import deque
from math import nan

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.vehicle import GivenVehicle
from ..typing import Array, ArrayLike, Ints
from ..units.constants import MAX_PAUSE
from ..units.wording import count_text
from .origin import Origin, RowsOfFile
from .plausible import refuse_mistakes

GAP_MEDIANS = 1.75
"""An interval longer than this many medians is a gap. A lost sample gives 2; jitter and coarse time
stamps rarely reach it."""
SHORT_GAP, MAX_SHORT_GAPS = 2.5, 5
"""Gaps of up to so many intervals are reported in one line if there are more than so many: single
lost samples, or jitter of the time stamps."""
LATE = 10
"""Rows that are late in the file by at most this many rows are sorted; at most so many consecutive
rows are dropped as stray."""
MAX_INTERVAL, MIN_INTERVAL = 1.0, 2e-5
"""Limits of the median interval of an IMU, s; values beyond mean a mistaken unit of time."""
RECENT = 51
"""Number of intervals of which a stream takes the median."""
ARRAYS = Origin("IMU")
"""Origin in messages for samples from arrays."""


def imu_from_arrays(
    t: ArrayLike,
    gyro: ArrayLike,
    accel: ArrayLike,
    kind: str = "rate",
    vehicle: GivenVehicle | None = None,
) -> tuple[Imu, list[str]]:
    """(Imu, notes) from t (n,) s, gyro and accel (n, 3) in body FRD axes, SI and radians, cleaned
    by `increments` and checked by `plausible` for the vehicle. Raises DataError."""
    imu, notes = increments(t, gyro, accel, kind)
    refuse_mistakes(imu, "IMU", kind, vehicle)
    return imu, notes


def increments(
    t: ArrayLike,
    gyro: ArrayLike,
    accel: ArrayLike,
    kind: str = "rate",
    origin: Origin = ARRAYS,
) -> tuple[Imu, list[str]]:
    """(Imu, notes): row k becomes the increment over its own dt = t[k] - t[k-1], s.

    The first dt, and that of a sample after a gap (an interval beyond `GAP_MEDIANS` medians), is
    the median interval, so that the time between t[k-1] and t[k] - dt[k] counts as missing. Samples
    with NaN or infinite values are dropped (and leave a gap), and so are rows that repeat a time.
    Raises DataError for incorrect shapes, fewer than 2 samples, a clock that is set back, and
    intervals that are impossible for an IMU.
    """
    if kind not in ("rate", "increment"):
        raise DataError(
            f'{origin.name}: kind {kind!r} is unknown; it must be "rate" or "increment"'
        )
    rows = RowsOfFile(origin, _columns(t, gyro, accel, origin), [])
    for rule in (_finite, sort_rows, _distinct):
        rows = rule(rows)
        if len(rows.columns[0]) < 2:
            raise DataError(
                f"{origin.name}: {count_text(len(rows.columns[0]), 'usable IMU sample')}; at least 2 are "
                f"needed" + "".join("; " + note for note in rows.notes)
            )
    t, gyro, accel = rows.columns
    dt = _intervals(t, rows.origin, rows.notes)
    if kind == "rate":
        gyro, accel = gyro * dt[:, None], accel * dt[:, None]
    columns = (t, dt, gyro, accel)
    return Imu(*(np.require(column, float, "C") for column in columns)), rows.notes


def _columns(
    t: ArrayLike, gyro: ArrayLike, accel: ArrayLike, origin: Origin
) -> tuple[Array, Array, Array]:
    t, gyro, accel = (np.asarray(values, float) for values in (t, gyro, accel))
    if t.ndim != 1 or gyro.shape != (len(t), 3) or accel.shape != (len(t), 3):
        raise DataError(
            f"{origin.name}: t has shape {t.shape}, gyro {gyro.shape} and accel {accel.shape}; they "
            f"must be (n,), (n, 3) and (n, 3)"
        )
    return t, gyro, accel


def _finite(rows: RowsOfFile) -> RowsOfFile:
    if all(np.isfinite(column).all() for column in rows.columns):
        return rows
    t, gyro, accel = rows.columns
    keep = np.isfinite(t) & np.isfinite(gyro).all(axis=1) & np.isfinite(accel).all(axis=1)
    return rows.without(~keep, "sample", "with NaN or infinite values dropped")


def sort_rows(rows: RowsOfFile) -> RowsOfFile:
    """The rows in order of time: late ones sorted, stray ones left out, both counted in the notes.

    Raises DataError for a clock that is set back.
    """
    t = rows.columns[0]
    steps = np.diff(t)
    if (steps >= 0).all():
        return rows
    index = np.argsort(t, kind="stable")
    if np.abs(index - np.arange(len(t))).max() <= LATE:
        rows.note(np.flatnonzero(steps < 0) + 1, "late row", "sorted by time")
        return rows.keep_rows(index)
    keep = _longest_rising(t)
    stray = np.flatnonzero(~np.isin(np.arange(len(t)), keep))
    run = max(len(part) for part in np.split(stray, np.flatnonzero(np.diff(stray) > 1) + 1))
    if run > LATE or len(stray) > max(LATE, len(t) // 100):
        back = int(np.argmin(steps)) + 1
        raise DataError(
            f"{rows.origin.row(back)}: time goes back from {t[back - 1]:.3f} to {t[back]:.3f} s and "
            f"does not recover; "
            "cut the file there or correct its time column"
        )
    rows.note(stray, "row", "with a stray time dropped")
    return rows.keep_rows(keep)


def _longest_rising(t: Array) -> Ints:
    """Row numbers of the longest subsequence that does not fall (patience sorting)."""
    tops: list[float] = []
    rows: list[int] = []
    previous: list[int] = []
    for i, value in enumerate(t.tolist()):
        pile = bisect_right(tops, value)
        previous.append(rows[pile - 1] if pile else -1)
        tops[pile : pile + 1], rows[pile : pile + 1] = [value], [i]
    chain: list[int] = []
    i = rows[-1]
    while i >= 0:
        chain.append(i)
        i = previous[i]
    return np.array(chain[::-1])


def _distinct(rows: RowsOfFile) -> RowsOfFile:
    t, gyro, accel = rows.columns
    same = np.r_[False, np.diff(t) == 0]
    if not same.any():
        return rows
    before = np.flatnonzero(same) - 1
    other = (gyro[same] != gyro[before]) | (accel[same] != accel[before])
    different = other.any(axis=1).sum()
    rows.origin.refuse(
        same & (different > max(1, len(t) // 10)),
        lambda row: (
            f"{different} of {len(t)} samples repeat the time of the row before with other values; the "
            f"time stamps are too coarse: use a time column with more digits"
        ),
    )
    return rows.without(same, "repeated time")


def _intervals(t: Array, origin: Origin, notes: list[str]) -> Array:
    steps = np.diff(t)
    median = float(np.median(steps))
    if not MIN_INTERVAL <= median <= MAX_INTERVAL:
        raise DataError(
            f"{origin.name}: IMU samples are {median:.6g} s apart, but {MIN_INTERVAL:g} to "
            f"{MAX_INTERVAL:g} s are accepted; check the unit of time"
        )
    gap = steps > GAP_MEDIANS * median
    if gap.any():
        longest = int(np.argmax(steps))
        if steps[longest] > MAX_PAUSE:
            raise DataError(
                f"{origin.row(longest + 1)}: time jumps from {t[longest]:.3f} to "
                f"{t[longest + 1]:.3f} s; "
                "cut the file there or correct its time column"
            )
        notes.append(
            f"{origin.name}: {count_text(gap.sum(), 'gap')} in time, "
            f"the longest {steps[longest] - median:.3f} s before {origin.line(longest + 1)}"
        )
        steps[gap] = median
    return np.r_[median, steps]


class StreamIntervals:
    """The intervals of samples that come one at a time, by the rule of `increments`, with the median
    of the last `RECENT` ones in place of that of all.

    Examples
    --------
    >>> from strapdown.preprocessing.imu_samples import StreamIntervals
    >>> intervals = StreamIntervals()
    >>> [intervals.interval(t) for t in (0.0, 0.25, 0.5, 1.5)]
    [None, 0.25, 0.25, 0.25]
    """

    def __init__(self) -> None:
        self._last = nan
        self._recent: deque[float] = deque(maxlen=RECENT)

    def interval(self, t: float) -> float | None:
        """Return the interval of the sample at t s: that since the one before, or after a gap and
        where the time does not increase the median; None of the first, which has none."""
        dt, self._last = t - self._last, t
        usual = sorted(self._recent)[len(self._recent) // 2] if self._recent else nan
        longest = GAP_MEDIANS * usual if self._recent else MAX_INTERVAL
        if 0 < dt <= longest:
            self._recent.append(dt)
            return dt
        return usual if self._recent else None
