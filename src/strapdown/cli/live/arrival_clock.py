"""The clock of a device against arrival on this machine.

A message that the device stamps s arrives at a(s) = s + offset + drift s + delay, and no delay is
below the smallest one. So the line below all points (s, a - s) that lies closest to them shows
offset and drift, with the smallest delay in the offset: it is the edge of the lower convex hull
over the mean of s (Moon, Skelly & Towsley 1999, "Estimation and removal of clock skew from network
delay measurements").
"""

from collections import deque
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

BIN = 1.0
"""s of stamps of which only the smallest delay counts."""
SPAN = 300
"""Bins that count, at most."""
MIN_BINS = 30
"""Number of bins from which on a drift is estimated."""
MAX_DRIFT = 1e-3
"""Largest drift of a clock, and rate at which the times of samples follow its estimate."""
SMALLER = 0.005
"""s by which a delay is below all others, so that these tell no offset any more."""
TOLD = 0.1
"""s of that from which on it is an event."""
CATCH_UP = 0.2
"""Share of their intervals by which times of samples that are late by more than SMALLER catch up. The
filter integrates each sample over its own length as long as it overlaps by less than half, and beside
a lost one still sees a gap."""
RESTARTED = 1.0
"""s by which a stamp may be off before the clock counts as another one."""
DELAYS = 1000
"""Number of newest delays, or times of arrival, of which statistics are shown."""


class ClockEstimate(NamedTuple):
    """The clock of a device.

    Attributes
    ----------
    offset : float
        Time of this machine less that of the device, with the smallest delay, as it is in use at the newest
        stamp, s.
    drift : float
        Change of the offset, s per s.
    delay : float
        Median of the delays beyond the smallest, s.
    worst_delay : float
        Their 99 % quantile, s.
    """

    offset: float
    drift: float
    delay: float
    worst_delay: float

    def __str__(self) -> str:
        return (
            f"offset {self.offset:.6g} s, drift {1e6 * self.drift:+.1f} ppm, delays beyond the "
            f"smallest {1e3 * self.delay:.2g} ms (median), {1e3 * self.worst_delay:.2g} ms (99 %)"
        )


class ArrivalIntervals(NamedTuple):
    """Messages without stamps, which count at their arrival.

    Attributes
    ----------
    interval : float
        Mean time between two of them, s.
    jitter : float
        Standard deviation of that time, s.
    longest : float
        The longest one, s.
    """

    interval: float
    jitter: float
    longest: float

    def __str__(self) -> str:
        return (
            f"by arrival, each {self.interval:.4g} s with a jitter of {1e3 * self.jitter:.2g} ms; the "
            f"longest interval is {self.longest:.4g} s"
        )


class Arrivals:
    """Times of arrival of messages without stamps."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=DELAYS)

    def take(self, arrived: float) -> None:
        """Take a time of arrival, s."""
        self._times.append(arrived)

    @property
    def estimate(self) -> ArrivalIntervals | None:
        """The intervals of the newest ones; None before there are three times."""
        if len(self._times) < 3:
            return None
        steps = np.diff(self._times)
        return ArrivalIntervals(float(steps.mean()), float(steps.std()), float(steps.max()))


class ArrivalClock:
    """Maps stamps of a device to the time of this machine at which its fastest message would have
    arrived, less `latency` s. `span` is the number of bins that count, and `min_bins` that from which
    on they tell a drift. `restarts` counts how often the clock of the device began anew; `news` has texts
    of events."""

    def __init__(self, latency: float = 0.0, span: int = SPAN, min_bins: int = MIN_BINS) -> None:
        self.latency, self.restarts, self.news = latency, -1, list[str]()
        self._span, self._min_bins = span, min_bins
        self._begin()

    def _begin(self) -> None:
        self.restarts += 1
        self._bins: deque[tuple[float, float]] = deque(
            maxlen=self._span
        )  # (stamp, smallest offset)
        self._open: tuple[float, float] | None = None
        self._opened = 0.0  # stamp with which the open bin began
        self._line: tuple[float, float, float] | None = None  # (stamp, offset, drift)
        self._steady: tuple[float, float] | None = None  # (stamp, offset) of the newest sample
        self._delays: deque[float] = deque(maxlen=DELAYS)
        self._earlier = 0.0  # s by which messages of the open bin came earlier than all before
        self._other = nan  # offset of the last message, where that was of another clock

    def take(self, stamp: float, arrived: float) -> bool:
        """Take the stamp of a message and its time of arrival, s. Return False where the stamp is not
        of this clock; a second one in a row that is off by as much begins another clock."""
        offset = arrived - stamp
        if not isfinite(offset):
            return False
        if self._is_off(stamp, offset):
            if not abs(offset - self._other) < RESTARTED:
                self._other = offset
                return False
            self._begin()
        self._other = nan
        self._count(stamp, offset)
        return True

    def _is_off(self, stamp: float, offset: float) -> bool:
        """Return True for a message that came before it was possible, or with a clock that stepped
        back."""
        if self._line is None and self._open is None:
            return False
        delay = offset - self.offset_at(stamp)
        return delay < -RESTARTED or delay > RESTARTED and stamp < self._opened - RESTARTED

    def _count(self, stamp: float, offset: float) -> None:
        if self._line is not None:
            late = offset - self.offset_at(stamp)
            if late < -SMALLER:
                self._forget_delays(stamp, offset, -late)
            self._delays.append(max(late, 0.0))
        if self._open is None:
            self._opened = stamp
        if self._open is None or offset < self._open[1]:
            self._open = stamp, offset
        if stamp - self._opened >= BIN:
            self._bins.append(self._open)
            self._open = None
            self._fit()

    def _forget_delays(self, stamp: float, offset: float, by: float) -> None:
        """Count from a message on that is earlier than all others, with the drift that they showed."""
        assert self._line is not None  # it was late by that
        self._line = stamp, offset, self._line[2]
        self._open = None
        self._bins.clear()
        self._delays.clear()
        self._earlier += by

    @property
    def ready(self) -> bool:
        """True once the first bin is complete."""
        return self._line is not None

    def time(self, stamp: float, steady: bool = False) -> float:
        """Return the time of a stamp, s, once `ready`. With `steady` it follows the estimate by at most
        MAX_DRIFT, or CATCH_UP where it is late, so that intervals of samples stay sound."""
        offset = self.offset_at(stamp)
        if steady:
            offset = self._steady_offset(stamp, offset)
        return stamp + offset - self.latency

    def _steady_offset(self, stamp: float, wanted: float) -> float:
        last, offset = self._steady or (stamp, wanted)
        since = max(stamp - last, 0.0)
        back = CATCH_UP if offset - wanted > SMALLER else MAX_DRIFT
        offset = min(max(wanted, offset - back * since), offset + MAX_DRIFT * since)
        if stamp >= last:
            self._steady = stamp, offset
        return offset

    @property
    def estimate(self) -> ClockEstimate | None:
        """The estimate; None before it is `ready`."""
        if self._line is None:
            return None
        delays = np.array(self._delays or [0.0])
        median, worst = np.quantile(delays, [0.5, 0.99]).tolist()
        offset = self._steady[1] if self._steady else self._line[1]
        return ClockEstimate(offset, self._line[2], median, worst)

    def offset_at(self, stamp: float) -> float:
        """Return the time of this machine less that of the device at a stamp, s, with the smallest
        delay."""
        if self._line is None:
            assert self._open is not None  # it has taken a stamp
            return self._open[1]
        at, offset, drift = self._line
        return offset + drift * (stamp - at)

    def stamp_at(self, arrived: float) -> float:
        """Return the stamp of the fastest message that arrives at a time, s, once `ready`."""
        assert self._line is not None
        at, offset, drift = self._line
        return at + (arrived - offset - at) / (1 + drift)

    def _fit(self) -> None:
        """Set the line to the edge of the lower hull over the mean of the stamps."""
        # a queue that empties brings one message after the other a little earlier
        if self._earlier > TOLD:
            self.news.append(
                f"messages come {1e3 * self._earlier:.0f} ms earlier than all before, whose delays were "
                "longer; the smallest delay is that of these"
            )
        self._earlier = 0.0
        points, newest = _possible(sorted(self._bins)), max(self._bins)[0]
        if len(points) < self._min_bins:
            # few bins tell no drift: the smallest delays differ by more than a clock drifts meanwhile
            drift = 0.0 if self._line is None else self._line[2]
            s, offset = min(points, key=lambda point: point[1] - drift * point[0])
        else:
            s, offset, drift = _hull_edge(points)
        self._line = newest, offset + drift * (newest - s), drift


def _possible(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points (stamp, offset) without those that are later than any drift would bring them."""
    found = points[:1]
    most, last = found[0][1], found[0][0]
    for s, offset in points[1:]:
        most, last = most + MAX_DRIFT * (s - last), s
        if offset <= most:
            found.append((s, offset))
            most = offset
    return found


def _hull_edge(points: list[tuple[float, float]]) -> tuple[float, float, float]:
    """Return (stamp, offset, drift) of the edge of the lower hull over the mean of the stamps."""
    hull: list[tuple[float, float]] = []
    for point in points:
        if hull and point[0] == hull[-1][0]:  # position and velocity of an epoch in two bins
            continue
        while len(hull) > 1 and _is_above(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    mean = sum(stamp for stamp, _ in points) / len(points)
    (s, offset), drift = hull[0], 0.0
    for (s0, o0), (s1, o1) in zip(hull, hull[1:]):
        if s0 <= mean <= s1 or s1 == hull[-1][0]:
            s, offset, drift = s0, o0, (o1 - o0) / (s1 - s0)
            break
    return s, offset, float(np.clip(drift, -MAX_DRIFT, MAX_DRIFT))


def _is_above(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """True where b is not below the line from a to c."""
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])
