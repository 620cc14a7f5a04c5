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
    """The newest state of a `stream` that has started."""

    def __init__(self, stream: "Stream") -> None:
        self._stream = stream
        self._begin()

    def _begin(self) -> None:
        """Take a run of its own for the stream, and for that of its AHRS once it has started."""
        self._run = self._stream._run_ahead()
        self._of = [stream._live for stream in self._stream._levels()]
        self._pairs = [*zip(self._stream._levels(), self._run._levels())]
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

    def numbers(self) -> list[int]:
        """Numbers of data that the stream, and that of its AHRS, have put in order so far."""
        return [stream._number for stream in self._stream._levels()]

    def renew(self) -> None:
        """Begin at the state of the stream itself, and use all that waits."""
        streams = self._stream._levels()
        if self._of != [stream._live for stream in streams]:
            self._begin()
        self._go_back(-inf)

    def take(self, event: Sample | Measurement, numbers: list[int]) -> None:
        """Use an event that the stream has just taken; `numbers` are those before."""
        if self._failed or len(self._stream._levels()) != len(self._pairs):
            self.renew()
        elif isinstance(event, Sample):
            if numbers == self.numbers():  # dropped
                return
            if event.t > self._run._late:
                self._use(event)
            elif event.t < self._run._late:
                self._go_back(event.t)
        else:
            self._take_fix(numbers)
        self._forget()

    def _take_fix(self, numbers: list[int]) -> None:
        fresh = [
            (run, [row for row in stream._waiting if row[2] > number])
            for (stream, run), number in zip(self._pairs, numbers)
        ]
        late = [row[0] for run, rows in fresh for row in rows if not row[0] > run._late_fix]
        if late:
            self._go_back(min(late))
            return
        for run, rows in fresh:
            for row in rows:
                heappush(run._waiting, row)

    def _go_back(self, t: float) -> None:
        """Go back to a state before `t` s and use again what came after it."""
        while self._marks and not self._marks[-1][0] + SAME_TIME < t:
            self._marks.pop()
        if self._marks:
            _, states, numbers = self._marks[-1]
        else:
            states, numbers = [stream._mark() for stream, _ in self._pairs], self.numbers()
        for (stream, run), state, number in zip(self._pairs, states, numbers):
            run._return_to(state)
            late = [row for row in stream._waiting if row[2] > number and row[0] > run._late_fix]
            run._waiting += late
            heapify(run._waiting)
        used = min(run._late for _, run in self._pairs)
        for _, _, sample in sorted(row for row in self._stream._samples if row[0] > used):
            self._use(sample)

    def _use(self, sample: Sample) -> None:
        """Use one sample: first the AHRS, then the filter that takes its attitude."""
        top, *inner = [run for _, run in self._pairs]
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
        if not self._stream._replay:
            return
        if not self._marks or sample.t >= self._marks[-1][0] + MARK_EVERY:
            states = [run._mark() for _, run in self._pairs]
            self._marks.append((sample.t, states, self.numbers()))

    def _forget(self) -> None:
        """Drop the states from before the data that still wait."""
        while self._marks and self._marks[0][0] < self._stream._late:
            del self._marks[0]
