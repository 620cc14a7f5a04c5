"""Events on ports: one where a port fails, one where it goes on again, one where an input cannot be
read, and those of pulses."""

from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from ...units.wording import count_text
from .input_formats import Decoder
from .ports import RETRY, Address, Port
from .pulse_clock import PulseClock
from .pulse_file import PulseFile

FORMER = 8
"""Number of former senders that are remembered."""


class _Place(Protocol):
    """A port or a sink."""

    address: Address
    error: str


class Senders:
    """Notices where samples come from two senders in turn. One that begins again with another
    address is one sender."""

    def __init__(self) -> None:
        self._last: object = None
        self._former: deque[object] = deque(maxlen=FORMER)
        self.two: tuple[Any, Any] | None = None

    def take(self, sender: object) -> None:
        """Take the sender of a sample."""
        if sender == self._last:
            return
        if sender in self._former:
            self.two = self._last, sender
        self._former.append(self._last)
        self._last = sender


class Notices:
    """Tells each thing once."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._failing: set[int] = set()
        self._said: set[str] = set()

    def of_port(self, port: _Place, lost: str) -> None:
        """Tell that a port fails, or that it goes on again and what was `lost` meanwhile."""
        fails, failed = bool(port.error), id(port) in self._failing
        if fails and not failed:
            self._failing.add(id(port))
            self._tell(f"{port.address}: {port.error}; it is tried again each {RETRY:g} s")
        elif failed and not fails:
            self._failing.remove(id(port))
            self._tell(f"{port.address}: goes on{lost}")

    def of_input(self, port: Port, decoder: Decoder, bad: int, why: str, senders: Senders) -> None:
        """Tell that some of an input cannot be read or is missing, that it has two senders, and the news
        of its decoder."""
        self._all(port, decoder.news)
        if bad:
            first = f", the first: {why}" if why else ""
            pieces = "1 line or piece" if bad == 1 else f"{bad} lines or pieces"
            self._once(port, "unread", f"not read: {pieces}{first}")
        if port.missed:
            self._once(
                port,
                "missed",
                f"the system dropped {count_text(port.missed, 'datagram')} that waited",
            )
        if senders.two:
            first, second = (":".join(map(str, each)) for each in senders.two)
            self._once(port, "senders", f"samples come from {first} and from {second}; stop one")

    def of_clock(self, port: Port, news: list[str]) -> None:
        """Tell the news of the clock of an input."""
        self._all(port, news)

    def of_pulses(self, file: PulseFile, clock: PulseClock) -> None:
        """Tell of the pulses of a receiver."""
        self.of_port(file, "")
        if clock.left_out:
            text = f"{count_text(clock.left_out, 'pulse')} off the second are left out"
            self._once(file, "left out", text)
        if file.missed or file.bad:
            text = (
                f"{file.missed} pulses came between two looks, and {file.bad} with an unknown time"
            )
            self._once(file, "missed", text)
        if file.stepped:
            text = f"the system clock stepped by {file.stepped:+.4g} s; pulses count without it"
            self._once(file, "stepped", text)

    def _all(self, place: _Place, news: list[str]) -> None:
        for text in news:
            self._tell(f"{place.address}: {text}")
        news.clear()

    def _once(self, port: _Place, about: str, text: str) -> None:
        if (key := f"{about} {id(port)}") not in self._said:
            self._said.add(key)
            self._tell(f"{port.address}: {text}")
