"""The result of a comparison: scores of every filter in every outage, their summaries, and its
files."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pandas as pd

from ...data.solution import Trajectory
from ...data.value import Value
from ...data.verdict import Verdict
from ...evaluation.metrics import NED_AXES
from ...fileio.files import together, write_table
from ...typing import File
from ...units.wording import count_text
from .protocols import Window
from .scores import ErrorTrack
from .summaries import PAIR_COLUMNS, curves, pool_scores, ratio

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import xarray as xr

TABLES = ("scores", "summary", "paired", "growth", "table")
"""Files of `Comparison.write`, beside the page: NAME.csv each."""
UNITS = {"_m_s": "m/s", "_percent": "percent", "_deg": "degree", "_m": "m", "_s": "s"}
"""{suffix of the name of a score: its unit}; others are numbers."""


@dataclass(frozen=True, eq=False)
class Comparison(Value):
    """Filters on the same outages of one recording. Errors are true - estimate, against the
    reference in its own geodetic frame, not aligned.

    Scores that a filter did not reach are NaN, and `said` gives the reason.

    Attributes
    ----------
    name : str
        Name of the recording.
    protocol : str
        Protocol of the outages, as requested.
    words : str
        The protocol in words.
    sweep : bool
        True: each outage is a separate run, and outages may overlap; otherwise all are in one run.
    filters : tuple of str
        Labels, in the order they were given.
    windows : tuple of Window
        Outages (start, stop), s.
    kinds : tuple of str
        Kinds of the fixes withheld.
    scores : DataFrame
        A row per filter and outage; units in the names of its columns.
    tracks : dict[str, list[ErrorTrack or None]]
        {label: a track per outage, None where it was not reached}.
    reference : Trajectory
        Rows whose position is known.
    span : Window
        (start of the filters, end of the recording), s.
    settings : dict[str, Any]
        Imu, noise, start, kinds, withheld, kept, and per filter options, sources.
    notes : tuple of str
        Further facts for the user, a line each.
    verdicts : dict[str, Verdict]
        Verdict of each filter that could run, on its whole run; in a sweep, on the run with all
        fixes.
    """

    name: str
    protocol: str
    words: str
    sweep: bool
    filters: tuple[str, ...]
    windows: tuple[Window, ...]
    kinds: tuple[str, ...]
    scores: pd.DataFrame
    tracks: dict[str, list[ErrorTrack | None]]
    reference: Trajectory
    span: Window
    settings: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    verdicts: dict[str, Verdict] = field(default_factory=dict)

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of pooled outages, s: in a sweep each length separately; in one run all together,
        under the longest."""
        found = sorted(set(self.scores["length_s"]))
        return tuple(found) if self.sweep else (found[-1],)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """pandas DataFrame, a row per filter and length: means, medians, 90 % and largest of the
        scores, coverage, failures."""
        return pd.DataFrame(
            {"filter": name, "length_s": length, **pool_scores(own[own["filter"] == name])}
            for name in self.filters
            for length in self.lengths
            for own in [self.of_length(length)]
        )

    @cached_property
    def paired(self) -> pd.DataFrame:
        """pandas DataFrame, a row per pair of filters, length and axis: ratio of their RMSE on
        the same outages with its 95 % interval, and wins."""
        rows = []
        for length in self.lengths:
            own = self.of_length(length)
            once = own[own["filter"] == self.filters[0]]
            windows = once["start_s"].to_numpy(), once["length_s"].to_numpy()
            for axis in ("horizontal", *NED_AXES):
                by = own.pivot(index="outage", columns="filter", values=f"{axis}_rmse_m")
                rows += [
                    {
                        "a": a,
                        "b": b,
                        "length_s": length,
                        "axis": axis,
                        **ratio(by[a].to_numpy(), by[b].to_numpy(), *windows),
                    }
                    for a, b in combinations(self.filters, 2)
                ]
        return pd.DataFrame(rows, columns=PAIR_COLUMNS)

    @cached_property
    def growth(self) -> pd.DataFrame:
        """pandas DataFrame, a row per filter, length and time since the start of the outage:
        median and 10-90 % of the errors over the outages."""
        return pd.concat(
            [
                pd.DataFrame(
                    {
                        "filter": name,
                        "length_s": length,
                        **curves(self._outages(name, length), length),
                    }
                )
                for name in self.filters
                for length in self.lengths
            ],
            ignore_index=True,
        )

    def _outages(self, name: str, length: float) -> list[tuple[ErrorTrack, float]]:
        """[(Track, its length s)] of a filter in the outages that are pooled under a length."""
        found = zip(self.tracks[name], (round(stop - start, 6) for start, stop in self.windows))
        return [
            (track, own)
            for track, own in found
            if track is not None and (own == length or not self.sweep)
        ]

    def table(self) -> pd.DataFrame:
        """pandas DataFrame like Table 1 of Alam et al.: RMSE (m), a row per outage, a column per
        axis and filter."""
        names = [f"{axis}_rmse_m" for axis in NED_AXES]
        rmse = self.scores.set_index(["outage", "filter"])[names]
        by = cast("pd.DataFrame", rmse.unstack("filter"))  # with two indices it is a table
        by = by[[(name, label) for name in names for label in self.filters]]
        axes = [axis.capitalize() for axis in NED_AXES]
        by.columns = pd.MultiIndex.from_product([axes, self.filters], names=["axis", "filter"])
        return by

    def of_length(self, length: float) -> pd.DataFrame:
        """The rows of `scores` of the outages that are pooled under this length, s."""
        return self.scores[self.scores["length_s"] == length] if self.sweep else self.scores

    def write(self, folder: File) -> None:
        """Write scores.csv, summary.csv, paired.csv, growth.csv, table.csv and index.html, a
        page to read, into `folder`, all or none. Raises DataError."""
        from .page import page

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        names = [f"{axis.capitalize()} {name}, m" for axis in NED_AXES for name in self.filters]
        flat = self.table().set_axis(names, axis=1).reset_index()
        with together():
            for name in TABLES:
                made = flat if name == "table" else getattr(self, name)
                write_table(made, folder / f"{name}.csv", 9)
            page(self).save(folder / "index.html")

    def plot(self, what: str = "growth", length: float | None = None, outage: int = 1) -> go.Figure:
        """A figure of its page as a plotly Figure, which can be changed: "growth" of the errors
        with time, "outages", RMSE of each, "paired", ratios to the best filter, "course" of the
        errors in one outage, "coverage" of the claimed standard deviations, or "track".

        length: of the outages, s, where there are several (default: the longest); outage: number of
        that of "course". Raises DataError.
        """
        from .figures import figure_of_name

        return figure_of_name(self, what, length, outage)

    def to_pandas(self) -> pd.DataFrame:
        """The scores, a row per filter and outage; `attrs` has the units."""
        made = self.scores.set_index(["filter", "outage"])
        made.attrs["units"] = {name: unit(name) for name in made.columns if name != "said"}
        return made

    def to_xarray(self) -> xr.Dataset:
        """The scores as an xarray Dataset over filter and outage, with units. Raises DataError
        where xarray is missing."""
        from ...pages.notebook.labelled import need_xarray

        need_xarray()
        frame = self.to_pandas()
        made = frame.to_xarray()
        for name, text in frame.attrs["units"].items():
            made[name].attrs["units"] = text
        return made.reindex(filter=list(self.filters))

    def _repr_html_(self) -> str:
        from ...pages.notebook.cards import card, lines, of_verdicts
        from .tables import summary
        from .texts import answers

        facts = {"outages": self.words, "withheld": ", ".join(self.kinds)}
        said = lines([*answers(self), *self.notes])
        judged = of_verdicts(self.verdicts)
        return card(f"Comparison {self.name}", facts, said, summary(self), judged)

    def __repr__(self) -> str:
        return f"Comparison({self.name}: {count_text(len(self.filters), 'filter')}, {count_text(len(self.windows), 'outage')}, {self.words})"


def unit(name: str) -> str:
    """Return the unit of a score, by how its name ends; "1" where it has none."""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "1")
