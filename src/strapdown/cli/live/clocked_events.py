"""Events of a device on the clock of this machine."""

from collections.abc import Sequence

from ...engine.stream import Measurement, Sample
from ...units.time_scales import gps_from_unix
from .arrival_clock import ArrivalClock
from .input_formats import Clock
from .pulse_clock import PulseClock

MAX_HELD = 20_000
"""Events that wait until the clock of their device is known, at most."""


class ClockedEvents:
    """Gives events with stamps of a device times by its arrival, or pulses; they wait until its clock is
    known. `bad` counts those with a stamp of another clock, and those that wait in vain; `why` says it of the
    first."""

    def __init__(self, arrivals: ArrivalClock | PulseClock, clock: Clock) -> None:
        self.arrivals, self.bad, self.why = arrivals, 0, ""
        self._clock, self._held = clock, list[Sample | Measurement]()

    def take(
        self, events: Sequence[Sample | Measurement], arrived: float
    ) -> list[Sample | Measurement]:
        """Take events that arrived at a time of this machine, UNIX s, and return those whose times are
        known: when the fastest message would have arrived, less its delay where that is known."""
        if len(self._held) > MAX_HELD:
            self.leave()
        for event in events:
            restarts = self.arrivals.restarts
            is_own = self.arrivals.take(event.t, arrived)
            if self.arrivals.restarts > restarts:  # what waits has stamps of the clock before
                self.leave()
            if is_own:
                self._held.append(event)
            else:
                self.bad += 1
                self.why = self.why or f"a stamp of {event.t:.9g} s is of another clock"
        if not self.arrivals.ready:
            return []
        ready, self._held = self._held, []
        return [each._replace(t=self._time(each)) for each in ready]

    def leave(self) -> None:
        """Count what waits in vain."""
        if self._held:
            self.why = self.why or "its clock was not known in time"
        self.bad += len(self._held)
        self._held.clear()

    def _time(self, event: Sample | Measurement) -> float:
        """Return the time of an event in that of the stream; intervals of samples stay sound."""
        unix = self.arrivals.time(event.t, steady=type(event) is Sample)
        return self._clock.of_gps(float(gps_from_unix(unix)))
