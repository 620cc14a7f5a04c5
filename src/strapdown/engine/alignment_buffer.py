"""The alignment buffer of a stream: samples and measurements before the start, and the InitialState
from them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..alignment.missing_fields import fill_missing
from ..checks import DataError
from ..core.loop.contract import Filter, Imu, InitialState
from ..data.recording import Recording, RecordingMeta
from ..data.solution import Source
from ..preprocessing.plausible import refuse_mistakes
from ..sensor_models.imu import ImuSpec
from .arrivals import Sample, UsableFix, fix_of, sample_of
from .heading_hypotheses import DOUBTFUL, align_start
from .options import RunOptions
from .prepare import has_position

ALIGN_EVERY = 10.0
"""s of samples between two attempts to find a start."""


class Gathering:
    """Samples and fixes in time order until a start is found.

    asked: its `start` is None or has missing fields; within: s after which any start is accepted;
    most: largest number of samples kept; meta: metadata of their recording.
    """

    def __init__(
        self,
        filter: Filter,
        sources: Sequence[Source],
        spec: ImuSpec | None,
        asked: RunOptions,
        within: float,
        most: int,
        meta: RecordingMeta,
    ) -> None:
        self.samples: list[Sample] = []
        self.fixes: list[UsableFix] = []
        self._filter, self._sources, self._spec = filter, sources, spec
        self._given, self._noise, self._notify = asked["start"], asked["noise"], asked["notify"]
        self._within, self._most, self._meta = within, most, meta
        self._first = self._due = np.inf
        self.found = ""  # what the last attempt lacked
        self.forgotten: list[Sample | UsableFix] = []  # more than it keeps

    def take(self, sample: Sample, fixes: Sequence[UsableFix]) -> bool:
        """Keep one sample and the fixes up to its end; return True when it is time to try a
        start."""
        if not self.samples:
            self._first = sample.t - sample.dt
            self._due = max(self._first, self._given.t if self._given else self._first)
            self._due += ALIGN_EVERY
        self.samples.append(sample)
        self.fixes.extend(fixes)
        if len(self.samples) > self._most:
            self._forget()
        if sample.t < self._due - 1e-6:
            return False
        while self._due <= sample.t + 1e-6:  # a gap may be longer
            self._due += ALIGN_EVERY
        return True

    @property
    def needs(self) -> str:
        """Data that the next attempt to find a start waits for, as text."""
        if not self.samples:
            return "the first IMU sample"
        more = f"{max(self._due - self.samples[-1].t, 0.0):.0f} s of samples"
        return f"{self.found}; the next attempt is in {more}" if self.found else more

    def state(self) -> dict[str, Any]:
        """Return the buffer as `put` takes it."""
        samples, fixes = [*self.samples], [*self.fixes]
        return {
            "samples": samples,
            "fixes": fixes,
            "first": self._first,
            "due": self._due,
            "found": self.found,
        }

    def put(self, saved: Mapping[str, Any]) -> None:
        """Go on from a `state`. Raises ValueError, TypeError or KeyError where it is none."""
        self.samples = [sample_of(each) for each in saved["samples"]]
        self.fixes = [fix_of(each) for each in saved["fixes"]]
        self._first, self._due = float(saved["first"]), float(saved["due"])
        self.found = str(saved["found"])

    def _forget(self) -> None:
        half = len(self.samples) // 2
        begin = self.samples[half].t
        self.forgotten = [*self.samples[:half], *(fix for fix in self.fixes if fix.t < begin)]
        self.samples = self.samples[half:]
        self.fixes = [fix for fix in self.fixes if fix.t >= begin]

    @property
    def late(self) -> bool:
        """True once any start is accepted."""
        return bool(self.samples) and self.samples[-1].t - self._first >= self._within - 1e-6

    def recording(self) -> Recording:
        """Return the buffered samples and measurements as a Recording. Raises DataError for fewer
        than two samples."""
        if len(self.samples) < 2:
            raise DataError(
                f"{len(self.samples)} IMU samples are too few to find a start; give the stream "
                "some seconds of samples and fixes first"
            )
        columns = (np.require(column, float, ["C", "W"]) for column in zip(*self.samples))
        fixes = sorted(self.fixes, key=lambda fix: fix.t)
        return Recording(
            Imu(*columns),
            tuple(
                _with_fixes(a, [fix for fix in fixes if fix.source == s])
                for s, a in enumerate(self._sources)
            ),
            meta=self._meta,
        )

    def check(self) -> None:
        """Raise DataError where the samples contradict gravity."""
        refuse_mistakes(self.recording().imu, "IMU", "increment", self._meta.get("vehicle"))

    def start(self) -> InitialState:
        """Return the InitialState from the buffered data. Raises DataError where there is none."""
        if self._spec is None:
            raise DataError(
                "the stream cannot find a start without its IMU: give imu=, or a complete "
                "InitialState"
            )
        recording, position = self.recording(), has_position(self._filter)
        if self._given is not None:
            return fill_missing(self._given, recording, self._spec, position)
        return align_start(recording, self._spec, position, self._noise, self._notify)

    def suffices(self, start: InitialState) -> bool:
        """True where a start need not wait for a better one: its heading is known, or given, or the
        filter estimates no position."""
        return (
            self._given is not None
            or not has_position(self._filter)
            or bool(start.std[8] <= DOUBTFUL)
        )


def _with_fixes(a: Source, fixes: Sequence[UsableFix]) -> Source:
    y, std = (
        np.array([getattr(fix, part)[: each.shape[1]] for fix in fixes]).reshape(-1, each.shape[1])
        for part, each in (("y", a.y), ("std", a.std))
    )
    return replace(a, t=np.array([fix.t for fix in fixes]), y=y, std=std)
