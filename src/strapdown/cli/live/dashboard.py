"""The numbers that the live page and the terminal view show: the newest state, sources, ports and events,
and bounded lists of what came before."""

import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import hypot, inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import aiding, filters
from ...core.loop.contract import BRIDGED, DOUBTFUL, INVALID, VALID, Filter, Status
from ...core.mathematics.belief import ATT, POS, VEL
from ...engine.live_run import TestedMeasurement
from ...engine.live_stream import LiveStream
from ...engine.verdict_process import SpanVerdict, VerdictProcess
from ...geometry.geodesy import displacement
from ...pages.verdict_block import verdict_block
from ...typing import Array
from ...units.quantities import shown_unit
from ..output import plain
from .output_formats import Shown, state_at
from .pose import angles, pose_covariance

if TYPE_CHECKING:
    from .program import Live

PERIOD = 0.1
"""s between two looks at the state, at least."""
SLOW_PERIOD = 1.0
"""s between two looks at losses, ports and clocks."""
TRACK_STEP = 0.2
"""s between two points of a track, which doubles whenever it is full."""
MAX_PASSED = 20
"""Places between two looks, at most; the time between them doubles whenever they are full."""
MAX_TRACK, MAX_FIXES, MAX_EVENTS = 4000, 1000, 200
MAX_TESTS = 300
"""Newest tests of each source."""
REASONS: dict[int, str] = {
    VALID: "computed from the samples",
    BRIDGED: "samples are missing for up to 1 s, and the filter bridges the gap",
    INVALID: "samples were missing for more than 1 s",
    DOUBTFUL: "something contradicts the state",
}
"""{status: why}."""


class NumberedEntries:
    """The newest entries of a list that grows, each with the number of the look that added it."""

    def __init__(self, size: int) -> None:
        self._entries: deque[tuple[int, Sequence[Any]]] = deque(maxlen=size)

    def add(self, look: int, *values: object) -> None:
        """Add an entry."""
        self._entries.append((look, values))

    def since(self, look: int) -> list[Sequence[Any]]:
        """Return the entries of later looks."""
        found = []
        for number, values in reversed(self._entries):
            if number <= look:
                break
            found.append(values)
        return found[::-1]


class ThinnedTrack(NumberedEntries):
    """Points of a whole run: where they are full, every second one goes."""

    def __init__(self) -> None:
        super().__init__(MAX_TRACK)
        self._step, self._first, self._newest = TRACK_STEP, -inf, -inf

    def add_point(self, look: int, t: float, *values: object) -> None:
        """Add the point of a time, s, where the last one is old enough or of a later time."""
        if 0 <= t - self._newest < self._step:
            return
        if not self._entries:
            self._first = t
        if len(self._entries) == MAX_TRACK:
            self._step = max(2 * (t - self._first) / MAX_TRACK, self._step)
            kept = [*self._entries][::2]
            self._entries.clear()
            self._entries.extend(kept)
        self._newest = t
        self.add(look, *values)


class Dashboard:
    """The numbers of a program, which takes them after its steps, while others read them.

    Attributes
    ----------
    changed : threading.Condition
        Notified after each look; its lock guards the rest.
    number : int
        Number of looks so far.
    viewers : int
        Number of those who look at it now.
    closed : bool
        True once the program has ended.
    """

    def __init__(self, name: str, filter: str) -> None:
        self.changed, self.number, self.closed = threading.Condition(), 0, False
        self.viewers = 0
        self._filter: Filter = filters.find(filter)
        self._fixed: dict[str, Any] = {"name": name, "filter": filter}
        self._fixed["has_position"] = POS.start in self._filter.estimates
        self._state: dict[str, Any] = {}
        self._slow: dict[str, Any] = {}
        self._tests: dict[int, dict[str, Any]] = {}  # the newest one, by source
        self._track, self._fixes, self._events = (
            ThinnedTrack(),
            NumberedEntries(MAX_FIXES),
            NumberedEntries(MAX_EVENTS),
        )
        self._ratios: dict[int, NumberedEntries] = {}
        self._origin: Array | None = None
        self._passed: list[tuple[float, Array]] = []  # (t, lla) since the last look
        self._passed_step = TRACK_STEP
        self._due = self._slow_due = -inf
        self._tested_until, self._alignments = -inf, 0
        self._verdict: SpanVerdict | None = None
        self._verdicts = NumberedEntries(1)

    # ---- the program

    def hear(self, t: float, text: str) -> None:
        """Take an event."""
        with self.changed:
            self._events.add(self.number + 1, t, text)

    def pass_by(self, stream: LiveStream) -> None:
        """Take the place of a state for the track, since samples may come faster than looks."""
        t, passed = stream.t, self._passed
        if not self._fixed["has_position"] or (
            passed and 0 <= t - passed[-1][0] < self._passed_step
        ):
            return
        if len(passed) == MAX_PASSED:
            self._passed_step *= 2
            del passed[1::2]
        passed.append((t, stream.belief.lla.copy()))

    def look(self, live: "Live") -> None:
        """Take the numbers of a program, at most once in PERIOD."""
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + PERIOD
        slow = self._slow_due <= now
        if slow:
            self._slow_due = now + SLOW_PERIOD
        with self.changed:
            self._look_at_state(live)
            self._look_at_tests(live)
            self._look_at_verdict(live.verdicts)
            if slow:
                self._slow = losses(live) | {"ports": live.ports}
            self._state |= {"since_sample": live.since_sample, "sources": source_rows(live)}
            self.number += 1
            self.changed.notify_all()

    def close(self) -> None:
        """Let the viewers go."""
        with self.changed:
            self.closed = True
            self.changed.notify_all()

    def _look_at_state(self, live: "Live") -> None:
        stream = live.stream
        t = stream.t if stream.started else stream.stream.newest
        epoch = live.clock.epoch if isfinite(t) else None
        it = state_at(t, epoch, live.status, stream.belief, stream.alignments)
        self._state = {
            "t": it.t,
            "utc": it.moment and it.moment.isoformat(timespec="milliseconds"),
            "status": Status(it.status).name.lower(),
            "reason": self._reason(live),
            "alignments": it.alignments,
        }
        if not stream.started:
            return
        self._state |= _motion(it, self._filter)
        passed, self._passed, self._passed_step = self._passed, [], TRACK_STEP
        if not self._fixed["has_position"]:
            return
        for t, lla in [*passed, (it.t, it.state.lla.copy())]:
            if np.isfinite(lla).all():
                self._state["place"] = self._add_place(t, lla)

    def _add_place(self, t: float, lla: Array) -> list[float]:
        """Add a place to the track, and return it in m east and north of the first one."""
        if self._origin is None:
            self._origin = lla
        north, east, _ = displacement(lla, self._origin).tolist()
        self._track.add_point(self.number + 1, t, east, north)
        return [east, north]

    def _reason(self, live: "Live") -> str:
        """Say why the status is what it is."""
        if live.is_stale:
            return f"no sample for {live.since_sample:.0f} s"
        if waits := live.stream.waits_for:
            return f"waits for {waits}"
        events = live.stream.events if live.status == DOUBTFUL else []
        return REASONS[live.status] + (f"; the newest event: {events[-1][1]}" if events else "")

    def _look_at_tests(self, live: "Live") -> None:
        if live.stream.alignments != self._alignments:
            self._alignments, self._tested_until = live.stream.alignments, -inf
        for test in live.stream.stream.tested_after(self._tested_until):
            self._tested_until = max(self._tested_until, test.t)
            # the AHRS beside a filter is no source of the configuration
            if test.source < len(live.config.sources):
                self._add_test(test, live.config.sources[test.source].kind)

    def _add_test(self, test: TestedMeasurement, kind: str) -> None:
        ratio = (test.nis / test.gate) ** 0.5 if test.nis >= 0 else None
        series = self._ratios.setdefault(test.source, NumberedEntries(MAX_TESTS))
        series.add(self.number + 1, test.t, ratio, test.accepted)
        unit, factor = shown_unit(aiding.find(kind).quantities[0])
        size = factor * hypot(*test.innovation[np.isfinite(test.innovation)].tolist())
        self._tests[test.source] = {
            "t": test.t,
            "nis": test.nis,
            "gate": test.gate,
            "innovation": size,
            "unit": unit,
            "accepted": test.accepted,
        }
        if kind == "position" and self._origin is not None and np.isfinite(test.y).all():
            north, east, _ = displacement(test.y, self._origin).tolist()
            self._fixes.add(self.number + 1, test.source, east, north, test.accepted)

    def _look_at_verdict(self, verdicts: VerdictProcess) -> None:
        newest = verdicts.newest
        if newest is not self._verdict:
            self._verdict = newest
            html = verdict_block({"": newest.verdict}) if newest else ""
            self._verdicts.add(self.number + 1, html)
        self._state["verdict"] = {
            "word": newest.verdict.word if newest else "not yet",
            "line": newest.verdict.line if newest else "not yet",
            "of": newest.span if newest else "",
            "error": verdicts.error,
        }

    # ---- the viewers

    @contextmanager
    def count_viewer(self) -> Iterator[None]:
        """Count a viewer for as long as the block lasts."""
        with self.changed:
            self.viewers += 1
        try:
            yield
        finally:
            with self.changed:
                self.viewers -= 1

    def since(self, look: int) -> tuple[int, dict[str, Any]]:
        """Return the number of the newest look, and its numbers with what lists have got since
        another look (0: since the start), in the types of JSON."""
        with self.changed:
            shown = {
                **self._fixed,
                **self._state,
                **self._slow,
                "tests": dict(self._tests),
                "whole": look == 0,
                "track": self._track.since(look),
                "fixes": self._fixes.since(look),
                "events": self._events.since(look),
                "verdicts": self._verdicts.since(look),
                "ratios": {source: each.since(look) for source, each in self._ratios.items()},
            }
            number = self.number
        return number, plain(shown)

    def wait(self, look: int, seconds: float) -> bool:
        """Wait for a look after another one; return False where none came, or the program ended."""
        with self.changed:
            there = self.changed.wait_for(lambda: self.closed or self.number > look, seconds)
            return there and not self.closed


def _motion(it: Shown, filter: Filter) -> dict[str, Any]:
    """Return position, velocity and attitude with standard deviations, angles in deg; a number that
    the filter does not estimate is NaN."""
    state = it.state
    variances = np.diag(state.P)[:9].copy()
    pose = pose_covariance(state)
    variances[ATT] = np.diag(pose)[3:]
    variances[[i for i in range(9) if i not in filter.states]] = np.nan
    std = np.sqrt(np.maximum(variances, 0.0))
    lla, v_n = state.lla.copy(), state.v_n.copy()
    lla[[i not in filter.estimates for i in range(*POS.indices(9))]] = np.nan
    v_n[[i not in filter.estimates for i in range(*VEL.indices(9))]] = np.nan
    return {
        "lat_lon": np.degrees(lla[:2]),
        "height": lla[2],
        "position_std": std[POS],
        "v_n": v_n,
        "speed": float(np.linalg.norm(v_n)),
        "velocity_std": std[VEL],
        "rph": [*angles(state)],
        "rph_std": np.degrees(std[ATT]),
        "ellipse": [pose[0, 0], pose[0, 1], pose[1, 1]],
    }


def source_rows(live: "Live") -> list[dict[str, Any]]:
    """Return the counts of each source, and for how many s it is silent."""
    names = [a.name or a.kind for a in live.config.sources]
    silent = live.stream.silent
    return [
        {"name": name, "used": used, "rejected": rejected, "silent": silent.get(name)}
        for name, (used, rejected) in zip(names, live.stream.counts())
    ]


def losses(live: "Live") -> dict[str, Any]:
    """Return counts of data that were dropped or not read, and clocks."""
    return {
        "dropped": {cause: count for cause, count in live.stream.dropped_by.items() if count},
        "bad": live.bad,
        "missed": live.missed,
        "unsent": live.unsent,
        "clocks": {port: str(clock) for port, clock in live.clocks.items()},
    }
