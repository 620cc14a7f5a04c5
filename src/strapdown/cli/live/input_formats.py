"""Samples and measurements from bytes as they come. UBX and NMEA go through the readers of logs: the bytes of
the last epochs are read as the log that they are, and what is new in it is taken."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...checks import DataError
from ...engine.stream import Measurement, Sample
from ...io.reader import Log
from ...units.time_scales import YEARS, leap_seconds, midnight, year_of

if TYPE_CHECKING:
    from .receiver_rows import ReceiverRow

WINDOW = 1 << 14
"""Bytes of a receiver that are read as one log: some epochs."""
QUIET = 0.03
"""s without bytes after which an epoch is whole."""
ALONE = 30.0
"""s: an epoch that is farther from all others has a wrong time, unless the next one follows it."""


class Clock:
    """The time of the stream: s since `epoch`, in s of GPS time since its zero. Without a given one
    it is midnight, UTC, before the first absolute time; None where there was none yet."""

    def __init__(self, epoch: float | None = None) -> None:
        leap_seconds()  # reads them now, so that no sample waits for it
        self.epoch = epoch

    def of_gps(self, gps: float) -> float:
        """Return the time of a moment of GPS time. Raises DataError where no calendar has it."""
        check_moment(gps)
        if self.epoch is None:
            self.epoch = midnight(gps)
        return gps - self.epoch


def check_moment(gps: float) -> None:
    """Refuse a moment of GPS time that is not finite or in no calendar. Raises DataError."""
    if not YEARS[0] - 1 <= year_of(gps) < YEARS[1]:
        raise DataError(
            f"a time {gps:.4g} s after 1980 is in no calendar; send s, and check `clock`"
        )


class Decoder(ABC):
    """Bytes of one input to events; `bad` counts what is none, `why` says it of the first."""

    def __init__(self) -> None:
        self.bad, self.why = 0, ""
        self.news: list[str] = []  # texts of events
        # s, of time.monotonic: when the bytes came of which the events are; None: just now
        self.last: float | None = None

    @abstractmethod
    def feed(self, piece: bytes) -> list[Sample | Measurement]:
        """Take bytes and return the events that they complete."""

    def idle(self) -> list[Sample | Measurement]:
        """Return the events that are complete because nothing came for QUIET s."""
        return []

    def end(self) -> list[Sample | Measurement]:
        """Return the events that are complete because the input ended, and count what is not."""
        return []

    @property
    def unused(self) -> int:
        """Number of the last bytes that a decoder needs again to go on after a restart."""
        return 0

    @property
    def memory(self) -> Any:
        """Values that it needs besides to go on, as JSON has them."""
        return None

    def resume(self, memory: Any) -> None:  # noqa: B027 (most have no memory)
        """Go on with the `memory` of before a restart."""


def _by_company(
    rows: list["ReceiverRow"],
) -> tuple[list["ReceiverRow"], list["ReceiverRow"]]:
    """Return the rows of epochs that have another one near by, and the others."""
    times = sorted({row.t for row in rows})
    gaps = [inf, *(b - a for a, b in zip(times, times[1:])), inf]
    lonely = {t for t, before, after in zip(times, gaps, gaps[1:]) if min(before, after) > ALONE}
    near = [row for row in rows if row.t not in lonely]
    return near, [row for row in rows if row.t in lonely]


class Receiver(Decoder):
    """UBX or NMEA of a GNSS receiver: positions, velocities and headings for the first source of
    each kind. `log` makes the Log of bytes."""

    def __init__(
        self, clock: Clock, log: Callable[[Path, bytes], Log], kinds: Sequence[str], name: str
    ) -> None:
        from .receiver_rows import receiver_rows  # now, so that no sample waits for it
        from .stray_pieces import StrayPieces

        super().__init__()
        self._read = receiver_rows
        self._clock, self._log, self._name = clock, log, Path(name)
        self._kinds, self._strays = kinds, StrayPieces()
        self._window, self._fresh, self._waits = b"", 0, False
        self._used: set[tuple[str, float]] = set()  # (kind, t in s) of the window
        self._resumed = -inf  # s, up to which they were used before a restart

    @property
    def unused(self) -> int:
        """As of Decoder: all that later messages are read with."""
        return len(self._window)

    @property
    def memory(self) -> float:
        """As of Decoder: s, up to which the epochs were used."""
        return max((t for _, t in self._used), default=self._resumed)

    def resume(self, memory: Any) -> None:
        """As of Decoder."""
        self._resumed = float(memory)

    def feed(self, piece: bytes) -> list[Sample | Measurement]:
        """As of Decoder: all epochs but the last one, to which more may come."""
        found: list[Sample | Measurement] = []
        for at in range(0, len(piece), WINDOW // 4):
            self._take(piece[at : at + WINDOW // 4])
            if self._fresh >= WINDOW // 4:
                found += self._new(False)
        return found

    def _take(self, piece: bytes) -> None:
        self._window = (self._window + piece)[-WINDOW:]
        self._fresh += len(piece)
        self._waits = True  # the last epoch
        self.last = time.monotonic()

    def idle(self) -> list[Sample | Measurement]:
        """As of Decoder."""
        if not self._waits or time.monotonic() < (self.last or 0.0) + QUIET:
            return []
        return self._new(True)

    def end(self) -> list[Sample | Measurement]:
        """As of Decoder."""
        return self._new(True) if self._waits else []

    def _new(self, whole: bool) -> list[Sample | Measurement]:
        """Return the measurements that were not there before; `whole`: also of the last epoch."""
        if self._fresh:
            self.bad += self._strays.count(self._window[-self._fresh :])
        self._fresh, self._waits = 0, not whole
        try:
            log = self._log(self._name, self._window)
            self._clock.epoch, rows = self._read(log, self._name, self._clock.epoch)
        except DataError:  # nothing usable in these bytes
            self.bad += 1
            return []
        rows = [row for row in rows if row.kind in self._kinds]
        near, alone = _by_company(rows)
        last = max((row.t for row in near), default=0.0)
        taken = [
            row for row in near if (row.kind, row.t) not in self._used and (whole or row.t < last)
        ]
        fresh = [row for row in taken if row.t > self._resumed]
        known = {(row.kind, row.t) for row in rows}
        self._used = (self._used & known) | {(row.kind, row.t) for row in taken}
        if taken:  # and none of them follows these
            wrong = {(row.kind, row.t) for row in alone} - self._used
            self.bad += len({t for _, t in wrong})
            self._used |= wrong
        fresh.sort(key=lambda row: row.t)
        return [Measurement(row.t, self._kinds.index(row.kind), row.y, row.std) for row in fresh]
