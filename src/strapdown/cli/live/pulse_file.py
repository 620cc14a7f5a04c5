"""The pulses per second of a receiver, as Linux shows them: the file `assert` or `clear` of a source has
the time of the newest pulse and its number, `SECONDS.NANOSECONDS#NUMBER`, by the system clock
(Documentation/ABI/testing/sysfs-pps and Documentation/driver-api/pps.rst of the kernel)."""

import re
import time
from pathlib import Path

from ...checks import DataError, brief
from ...fileio.file_access import open_file
from .ports import RETRY, Address

EVERY = 0.02
"""s between two looks at the file, at least."""
PULSE = re.compile(rb"(\d{1,18})\.(\d{9})#(-?\d{1,10})\s*")
"""The content of the file; the kernel writes large numbers of pulses with a sign."""
NUMBERS = 1 << 32
"""The number of pulses begins anew there."""
STEP = 100e-6
"""s by which the system clock must move at once to count as stepped."""
MAX_AGE = 5.0
"""s after which a pulse that is new to the program tells nothing."""


class PulseFile:
    """Reads new pulses. `error` says why none can be read; `missed` counts those that came between
    two looks, `stepped` has the last step of the system clock, s, and `bad` those that cannot be used."""

    def __init__(self, path: str) -> None:
        self.address = Address("file", path, 0)
        self.error = ""
        self.missed = self.bad = 0
        self.stepped = 0.0
        self._due = 0.0
        self._number: int | None = None  # of the newest pulse; None before the first look
        self._ahead: int | None = None  # ns by which the system clock is ahead of the monotonic one

    def read(self) -> float | None:
        """Return when the newest pulse came, s of time.monotonic; None where it was there before."""
        now = time.monotonic()
        if now < self._due:
            return None
        self._due = now + EVERY
        ahead = _system_ahead()
        step = 0.0 if self._ahead is None else 1e-9 * (ahead - self._ahead)
        self._ahead, self.stepped = ahead, step if abs(step) > STEP else self.stepped
        try:
            found = self._content()
            self.error = ""
        except (OSError, DataError) as error:
            self.error = getattr(error, "strerror", None) or str(error)
            self._number, self._due = None, now + RETRY
            return None
        if not self._is_new(found[1]):
            return None
        came = 1e-9 * (found[0] - ahead)
        # a pulse may have come before a step or after it
        if abs(step) > STEP or not -STEP < time.monotonic() - came < MAX_AGE:
            self.bad += 1
            return None
        return came

    def _content(self) -> tuple[int, int]:
        """Return the time of the newest pulse, ns of the system clock, and its number. Raises OSError
        and DataError."""
        path = Path(self.address.place)
        if path.exists() and not path.is_file():
            raise OSError("it is no regular file")
        with open_file(path) as file:
            text = file.read(64)
        found = PULSE.fullmatch(text)
        if found is None:
            what = (
                f"{brief(text.decode(errors='replace'))} is no pulse" if text else "it has no pulse"
            )
            raise DataError(f"{what}; name the file `assert` of a source under /sys/class/pps")
        return int(found[1]) * 10**9 + int(found[2]), int(found[3])

    def _is_new(self, number: int) -> bool:
        """Return True for a pulse after one that was seen, and count those between them."""
        last, self._number = self._number, number
        if last is None or number == last:
            return False
        between = (number - last) % NUMBERS - 1
        self.missed += between if between < NUMBERS // 2 else 0  # else the source began anew
        return True


def _system_ahead() -> int:
    """Return ns by which the system clock is ahead of the monotonic one. Both follow the same rate
    (clock_gettime(2)), so the difference changes where the system clock steps, alone."""
    best, found = NUMBERS, 0
    for _ in range(3):  # another process may run between the readings
        before, system, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        if after - before < best:
            best, found = after - before, system - (before + after) // 2
    return found
