"""Events on ports: one where a port fails, one where it goes on again, one where an input cannot be
read."""

from collections.abc import Callable
from typing import Protocol

from .input_formats import Decoder
from .ports import RETRY, Address


class _Place(Protocol):
    """A port or a sink."""

    address: Address
    error: str


class Notices:
    """Tells each thing once."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._failing: set[int] = set()
        self._unread: set[int] = set()

    def of_port(self, port: _Place, lost: str) -> None:
        """Tell that a port fails, or that it goes on again and what was `lost` meanwhile."""
        fails, failed = bool(port.error), id(port) in self._failing
        if fails and not failed:
            self._failing.add(id(port))
            self._tell(f"{port.address}: {port.error}; it is tried again each {RETRY:g} s")
        elif failed and not fails:
            self._failing.remove(id(port))
            self._tell(f"{port.address}: goes on{lost}")

    def of_decoder(self, address: Address, decoder: Decoder) -> None:
        """Tell that some of an input cannot be read."""
        if decoder.bad and id(decoder) not in self._unread:
            self._unread.add(id(decoder))
            why = f", the first: {decoder.why}" if decoder.why else ""
            self._tell(f"{address}: {decoder.bad} lines or pieces cannot be read{why}")
