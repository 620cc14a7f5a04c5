"""The notifier of a stream: it keeps events, passes them to the callback when they begin, and
counts dropped data."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from types import MethodType
from typing import Any

from ..checks import DataError, brief
from ..core.loop.log import LogRow
from ..plugins import one_line
from . import events as words
from .events import Events

OnEvent = Callable[[float, str], object]
"""(t in s, text) of an event when it begins."""
BEYOND = "after the last sample"
DROPPED = ("before the start", "late", "twice", "not finite", "wrong length", BEYOND)
"""Reasons why a sample or a fix is not used."""


class Notifier:
    """Pass `events` to `on_event`, which may be None; after an exception it is not called again."""

    def __init__(self, events: Events, on_event: OnEvent | None) -> None:
        if not (on_event is None or callable(on_event)):
            raise DataError(f"on_event is {brief(on_event)}; it must be a function of (t, text)")
        self.events = events
        self.dropped_by = dict.fromkeys(DROPPED, 0)
        self.waits = False  # True where events wait to be passed on
        self._on_event, self._deaf, self._news = on_event, False, list[tuple[float, str]]()

    def anew(self, dropped_by: Mapping[str, int]) -> "Notifier":
        """Return one without events, for the same callback, with these numbers of dropped data."""
        own = Notifier(self.events.anew(), self._on_event)
        own.dropped_by |= {reason: int(dropped_by[reason]) for reason in own.dropped_by}
        return own

    def __deepcopy__(self, memo: dict[int, Any]) -> "Notifier":
        own = copy(self)
        memo[id(self)] = own
        if isinstance(self._on_event, MethodType) and id(self._on_event.__self__) in memo:
            own._on_event = deepcopy(self._on_event, memo)  # of the stream around an AHRS
        own.events, own.dropped_by = deepcopy(self.events, memo), dict(self.dropped_by)
        own._news = [*self._news]
        return own

    def note(self, code: int, which: int, t: float, value: float = 0.0, because: str = "") -> None:
        """Log an event from outside the loop."""
        if because:
            self.events.because[code] = because
        if self.events.note(code, which, t, value):
            self.add([self.events.rows[-1]])

    def drop(self, why: str, code: int, place: int | None, t: float, behind: float = 0.0) -> None:
        """Count unused data and, for a source of the filter, log an event."""
        self.dropped_by[why] += 1
        if place is not None:
            self.note(code, place, t, behind)

    def add(self, rows: Sequence[LogRow]) -> None:
        """Add events that began; the next `tell` passes them on."""
        self.notify([(float(row.t), self.events.text(row)) for row in rows if self.listens])

    def notify(self, news: Sequence[tuple[float, str]]) -> None:
        """Add events as (t in s, text)."""
        if self.listens:
            self._news += news
            self.waits = bool(self._news)

    @property
    def listens(self) -> bool:
        """True where a callback receives the events."""
        return self._on_event is not None

    def tell(self, t: float) -> None:
        """Pass on the events that began; `t` s is the current time."""
        news, self._news, self.waits = self._news, [], False
        for event in news:
            if self._deaf or self._on_event is None:
                self.events.note(words.Said.CALLBACK, 0, t)
                continue
            try:
                self._on_event(*event)
            except Exception as error:
                self._deaf = True
                self.events.because[words.Said.CALLBACK] = one_line(error)
                self.events.note(words.Said.CALLBACK, 0, t)
