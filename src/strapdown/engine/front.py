"""The newest state of a stream whose samples wait for late fixes: a run of its own from the state of the
stream on, over all that waits. Where a fix comes late, it goes back to a state before that fix and
uses the samples since again."""

from heapq import heapify, heappush
from math import inf
from typing import TYPE_CHECKING, Any

from ..checks import DataError
from ..core.loop.contract import FilterState
from ..core.loop.loop import SAME_TIME
from .arrivals import Measurement, Sample

if TYPE_CHECKING:
    from .stream import Stream

MARK_EVERY = 0.1
"""s between two states that are kept to go back to."""


class Front:
    """The newest state of a `stream` that has started. It does not keep the stream, whose it is, so that
    the memory of both is free at once when the stream is no longer used."""

    def __init__(self, stream: "Stream") -> None:
        self._begin(stream)

    def _begin(self, stream: "Stream") -> None:
        """Take a run of its own for the stream, and for that of its AHRS once it has started."""
        self._run = stream._run_ahead()
        self._of = [each._live for each in stream._levels()]
        self._runs = self._run._levels()
        # [(s, the run's levels, numbers of their data)], in time order
        self._marks: list[tuple[float, list[Any], list[int]]] = []
        self._failed = False

    @property
    def belief(self) -> FilterState:
        """The newest state, updated in place until `renew` takes another run."""
        return self._run.belief

    @property
    def t(self) -> float:
        """Time of the newest state, s."""
        return self._run.t

    @property
    def status(self) -> int:
        """Status of the newest state."""
        return self._run.status

    def renew(self, stream: "Stream") -> None:
        """Begin at the state of the stream itself, and use all that waits."""
        if self._of != [each._live for each in stream._levels()]:
            self._begin(stream)
        self._go_back(stream, -inf)

    def take(self, stream: "Stream", event: Sample | Measurement, numbers: list[int]) -> None:
        """Use an event that the stream has just taken; `numbers` are those before."""
        if self._failed or len(stream._levels()) != len(self._runs):
            self.renew(stream)
        elif isinstance(event, Sample):
            if numbers == numbers_of(stream):  # dropped
                return
            if event.t > self._run._late:
                self._use(stream, event)
            elif event.t < self._run._late:
                self._go_back(stream, event.t)
        else:
            self._take_fix(stream, numbers)
        self._forget(stream)

    def _take_fix(self, stream: "Stream", numbers: list[int]) -> None:
        fresh = [
            (run, [row for row in each._waiting if row[2] > number])
            for each, run, number in zip(stream._levels(), self._runs, numbers)
        ]
        late = [row[0] for run, rows in fresh for row in rows if not row[0] > run._late_fix]
        if late:
            self._go_back(stream, min(late))
            return
        for run, rows in fresh:
            for row in rows:
                heappush(run._waiting, row)

    def _go_back(self, stream: "Stream", t: float) -> None:
        """Go back to a state before `t` s and use again what came after it."""
        while self._marks and not self._marks[-1][0] + SAME_TIME < t:
            self._marks.pop()
        if self._marks:
            _, states, numbers = self._marks[-1]
        else:
            states, numbers = [each._mark() for each in stream._levels()], numbers_of(stream)
        for each, run, state, number in zip(stream._levels(), self._runs, states, numbers):
            run._return_to(state)
            late = [row for row in each._waiting if row[2] > number and row[0] > run._late_fix]
            run._waiting += late
            heapify(run._waiting)
        used = min(run._late for run in self._runs)
        for _, _, sample in sorted(row for row in stream._samples if row[0] > used):
            self._use(stream, sample)

    def _use(self, stream: "Stream", sample: Sample) -> None:
        """Use one sample: first the AHRS, then the filter that takes its attitude."""
        top, *inner = self._runs
        for run in inner:
            if sample.t > run._late and not run._stopped:
                try:
                    run._use_sample(sample)
                except DataError as error:
                    run._stopped = str(error)
        if sample.t > top._late:
            self._failed = True
            top._use_sample(sample)
            self._failed = False
        if not stream._replay:
            return
        if not self._marks or sample.t >= self._marks[-1][0] + MARK_EVERY:
            states = [run._mark() for run in self._runs]
            self._marks.append((sample.t, states, numbers_of(stream)))

    def _forget(self, stream: "Stream") -> None:
        """Drop the states from before the data that still wait."""
        while self._marks and self._marks[0][0] < stream._late:
            del self._marks[0]


def numbers_of(stream: "Stream") -> list[int]:
    """Return numbers of data that a stream, and that of its AHRS, have put in order so far."""
    return [each._number for each in stream._levels()]
