"""The clock of a GNSS receiver by its pulses. A pulse marks a whole second of GPS time, and of UTC, and comes
within microseconds; the messages of that second come after it. Their arrival tells which second it is,
and the pulses how late the messages are."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from .arrival_clock import ArrivalClock, ClockEstimate
from .input_formats import Clock

SPAN, MIN_BINS = 30, 2
"""Bins of pulses that count, and from which on they tell a drift: they come with so little delay that a
short time shows changes of the drift."""
GATE = 1e-3
"""s by which a pulse may be off a whole second."""
RECENT, STEADY = 16, 5
"""Newest pulses among which the seconds are looked for, and how many must be seconds apart."""
STOPPED = 5.0
"""s without a pulse after which arrival counts."""
PATIENCE = 10.0
"""s that messages wait for the first pulses."""
USUAL = 0.5
"""s by which the messages come after their second, within half a second; without `latency`."""
TOO_LATE = 0.4
"""s beyond that, from which on the pulses may be those of another second."""
JUMPED = 5.0
"""s for which all messages must be whole seconds off, before their seconds count as other ones."""


class PulseEstimate(NamedTuple):
    """The clock of a receiver with pulses.

    Attributes
    ----------
    offset : float
        Time of this machine less that of the receiver at its newest pulse, s.
    drift : float
        Change of the offset, s per s.
    jitter : float
        Median of the delays of pulses beyond the smallest, s.
    latency : float
        Smallest delay of the messages after the moment of their stamps, as pulses measured it, s.
    delay, worst_delay : float
        Median and 99 % quantile of their delays beyond it, s.
    used, left_out : int
        Numbers of pulses that were used, and that were off the second.
    counts : bool
        True where pulses count now; else arrival less the `latency`.
    """

    offset: float
    drift: float
    jitter: float
    latency: float
    delay: float
    worst_delay: float
    used: int
    left_out: int
    counts: bool

    def __str__(self) -> str:
        how = "by pulses" if self.counts else "by arrival, since pulses stopped"
        return (
            f"{how}: offset {self.offset:.6g} s, drift {1e6 * self.drift:+.2f} ppm, jitter of pulses "
            f"{1e6 * self.jitter:.2g} us; messages come {self.latency:.4f} s after their stamps, "
            f"{1e3 * self.delay:.2g} ms later (median), {1e3 * self.worst_delay:.2g} ms (99 %); "
            f"{self.used} pulses used, {self.left_out} left out"
        )


class PulseClock:
    """Maps stamps of a receiver to the time of this machine by its pulses, and by arrival where they do not
    come, as an `ArrivalClock` does. `latency` s is roughly how late its messages are, where that may be
    more than a second; `clock` has the epoch from which stamps count. `news` has texts of events."""

    def __init__(self, latency: float, clock: Clock) -> None:
        self._messages, self._pulses = ArrivalClock(latency), _pulse_clock()
        self._usual, self._clock = latency or USUAL, clock
        self.news: list[str] = []
        self.used = self.left_out = 0
        self.counts = False  # pulses count now
        self._measured = False  # the latency, by pulses
        self._recent: deque[float] = deque(maxlen=RECENT)  # s of arrival, while they do not count
        self._newest = 0.0  # s of arrival of the newest pulse that was used
        self._until: float | None = None  # s, up to when messages wait for pulses
        self._waits = True
        self._jumped: float | None = None  # s, since when messages are whole seconds off
        self._anew = 0

    @property
    def restarts(self) -> int:
        """Number of times that the stamps began anew."""
        return self._messages.restarts + self._anew

    def take(self, stamp: float, arrived: float) -> bool:
        """Take a message as `ArrivalClock` does."""
        restarts = self._messages.restarts
        is_own = self._messages.take(stamp, arrived)
        self.news += self._messages.news
        self._messages.news.clear()
        if not is_own:
            return False
        if self._messages.restarts > restarts:
            self.counts = False
        elif self.counts:
            self._check_second(stamp, arrived)
        return True

    def _check_second(self, stamp: float, arrived: float) -> None:
        """Begin anew where messages are whole seconds off their pulses for long: the receiver has
        learned of a leap second, which is too little for a clock of its own."""
        late = arrived - stamp - self._pulses.offset_at(stamp) - self._messages.latency
        if not round(late) or abs(late - round(late)) > USUAL / 2:
            self._jumped = None
        elif self._jumped is None:
            self._jumped = arrived
        elif arrived > self._jumped + JUMPED:
            self.news.append(
                f"the times of the messages stepped by {-round(late)} s; they count anew"
            )
            self._messages, self.counts = ArrivalClock(self._messages.latency), False
            self._jumped, self._anew = None, self._anew + 1

    def take_pulse(self, arrived: float) -> None:
        """Take the time of this machine at which a pulse came, s."""
        if self.counts:
            stamp = self._pulses.stamp_at(arrived)
            if abs(stamp - self._second(stamp)) < GATE:
                self._use(self._second(stamp), arrived)
            else:
                self.left_out += 1
            return
        self._recent.append(arrived)
        steady = _steady_pulses([at for at in self._recent if at > arrived - RECENT])
        if self._messages.ready and arrived in steady:
            self._begin(steady)

    def _begin(self, pulses: Sequence[float]) -> None:
        """Let pulses count, the last of which is in the second before its messages."""
        self._pulses, newest = _pulse_clock(), pulses[-1]
        second = self._second(self._messages.stamp_at(newest) + self._usual)
        for arrived in pulses:
            self._use(second + round(arrived - newest), arrived)
        self.left_out += len(self._recent) - len(pulses)
        self._recent.clear()
        self.counts, self._waits = True, False
        latency = self._messages.latency = self._latency_at(second)
        self.news.append(f"pulses count; messages come {latency:.4f} s after their stamps")
        if latency > self._usual + TOO_LATE and not self._measured:
            self.news.append(
                f"times may be a second off, since messages come {latency:.2f} s after their stamps: give "
                "`latency` if that is wrong, or the other edge of the pulses (`clear`)"
            )
        self._usual, self._measured = latency, True

    def _use(self, stamp: float, arrived: float) -> None:
        self._pulses.take(stamp, arrived)
        self.used, self._newest = self.used + 1, arrived
        latency = self._latency_at(stamp)
        if abs(latency - self._usual) < USUAL:
            self._messages.latency = latency

    def _second(self, stamp: float) -> float:
        """Return the stamp of the whole second that is next to a stamp."""
        part = (self._clock.epoch or 0.0) % 1
        return round(stamp + part) - part

    def _latency_at(self, stamp: float) -> float:
        """Return how late the fastest message is by the pulses, s."""
        return self._messages.offset_at(stamp) - self._pulses.offset_at(stamp)

    def look(self, now: float) -> None:
        """Let arrival count where no pulse came for long, at a time of this machine, s."""
        if self.counts and now > self._newest + STOPPED:
            self.counts = False
            self.news.append(f"no pulse for {STOPPED:g} s; {self._instead()}")
        if self._waits and self._messages.ready:
            self._until = now + PATIENCE if self._until is None else self._until
            self._waits = now < self._until
            if not self._waits:
                why = "pulses come, but not one in each second" if self._recent else "no pulse came"
                self.news.append(f"{why}; {self._instead()}")

    def _instead(self) -> str:
        return f"arrival less {self._messages.latency:.4f} s counts"

    @property
    def ready(self) -> bool:
        """True once times are known, by pulses if they come."""
        return self._messages.ready and not self._waits

    def time(self, stamp: float, steady: bool = False) -> float:
        """Return the time of a stamp, s, once `ready`, as `ArrivalClock` does."""
        return (self._pulses if self.counts else self._messages).time(stamp, steady)

    @property
    def estimate(self) -> ClockEstimate | PulseEstimate | None:
        """The estimate; without any pulse that of arrival, None before it is `ready`."""
        messages, pulses = self._messages.estimate, self._pulses.estimate
        if messages is None or pulses is None:
            return messages
        latency = self._messages.latency
        offset, drift = pulses.offset, pulses.drift
        if not self.counts:
            offset, drift = messages.offset - latency, messages.drift
        delays = latency, messages.delay, messages.worst_delay
        return PulseEstimate(
            offset, drift, pulses.delay, *delays, self.used, self.left_out, self.counts
        )


def _pulse_clock() -> ArrivalClock:
    return ArrivalClock(0.0, SPAN, MIN_BINS)


def _steady_pulses(times: Sequence[float]) -> list[float]:
    """Return the pulses that are whole seconds apart, of times of arrival, s; none where they are too few,
    or where half as many others are."""
    sets = [[at for at in times if abs(at - b - round(at - b)) < GATE] for b in times]
    best = max(sets, key=len, default=[])
    others = [len(each) for each, at in zip(sets, times) if at not in best]
    return best if len(best) >= STEADY and 2 * max(others, default=0) <= len(best) else []
