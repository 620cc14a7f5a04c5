"""The result of a comparison: scores of every filter in every outage, what they say together,
and the files of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from ...data import Trajectory
from ...files import replacing
from ...typing import File
from . import summaries
from .protocols import Window
from .scores import Track

TABLES = ("scores", "summary", "paired", "growth", "table")
"""Files of `Comparison.write`, beside the page: NAME.csv each."""


@dataclass(frozen=True)
class Comparison:
    """Filters on the same outages of one recording. Errors are true - estimate, against the
    reference in its own geodetic frame, not aligned.

    What a filter did not get to is NaN, and `said` tells why.
    """

    name: str  # of the recording
    protocol: str  # as it was asked for
    words: str  # the same for people
    sweep: bool  # each outage is a run of its own, and they may overlap; else all are in one run
    filters: tuple[str, ...]  # labels, in the order they were given
    windows: tuple[Window, ...]  # ((start, stop), ...) s, outages 1, 2, ...
    kinds: tuple[str, ...]  # of the fixes withheld
    scores: pd.DataFrame  # a row per filter and outage; units in the names of its columns
    tracks: dict[str, list[Track | None]]  # {label: [scores.Track or None per outage]}
    reference: Trajectory  # rows whose position is known
    span: Window  # (start of the filters, end of the recording), s
    # imu, noise, start, kinds, withheld, kept, and per filter options, sources
    settings: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of outages that are pooled, s: those of a sweep one by one; those of one run
        all together, under the longest."""
        found = sorted(set(self.scores["length_s"]))
        return tuple(found) if self.sweep else (found[-1],)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """pandas DataFrame, a row per filter and length: means, medians, 90 % and largest of the
        scores, coverage, failures."""
        return summaries.summary(self)

    @cached_property
    def paired(self) -> pd.DataFrame:
        """pandas DataFrame, a row per pair of filters, length and axis: ratio of their RMSE on
        the same outages with its 95 % interval, and wins."""
        return summaries.paired_differences(self)

    @cached_property
    def growth(self) -> pd.DataFrame:
        """pandas DataFrame, a row per filter, length and time since the start of the outage:
        median and 10-90 % of the errors over the outages."""
        return summaries.growth(self)

    def table(self) -> pd.DataFrame:
        """pandas DataFrame like Table 1 of Alam et al.: RMSE (m), a row per outage, a column per
        axis and filter."""
        return summaries.table(self)

    def of_length(self, length: float) -> pd.DataFrame:
        """The rows of `scores` of the outages that are pooled under this length, s."""
        return self.scores[self.scores["length_s"] == length] if self.sweep else self.scores

    def write(self, folder: File) -> None:
        """Write scores.csv, summary.csv, paired.csv, growth.csv, table.csv and index.html, a
        page to read, into `folder`. Raises DataError."""
        from .page import page

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name in TABLES:
            made = self.table() if name == "table" else getattr(self, name)
            if name == "table":
                pairs: list[tuple[str, str]] = made.columns.to_list()  # type: ignore[assignment]
                names = [f"{axis} {label}, m" for axis, label in pairs]
                made = made.set_axis(names, axis=1)
            with replacing(folder / f"{name}.csv") as part:
                made.to_csv(part, index=name == "table", float_format="%.9g")
        page(self).save(folder / "index.html")

    def __repr__(self) -> str:
        return f"Comparison({self.name}: {len(self.filters)} filters, {len(self.windows)} outages, {self.words})"
