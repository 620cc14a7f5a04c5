"""Common parts of all track files: the rows with a known position, their UTC, and the description
of the solution."""

import re
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...checks import DataError
from ...data.solution import Solution
from ...data.verdict import NOT_JUDGED, TRUSTED
from ...typing import Array, Ints
from ...units.time_scales import iso_text, span

HEIGHTS = "Heights are above the WGS-84 ellipsoid"


class Track(NamedTuple):
    """The rows (n,) of a solution with a known position."""

    name: str  # of recording and filter, with the verdict unless it is trusted
    said: str  # sentences on verdict and time
    rows: Ints  # their numbers
    t: Array  # s
    longitude: Array  # deg, -180 and below 180
    latitude: Array  # deg
    height: Array  # m, above the ellipsoid
    stamps: list[str]  # ISO 8601, UTC, to the millisecond; empty without an absolute clock

    @property
    def pieces(self) -> list[slice]:
        """Stretches that do not cross the antimeridian."""
        cuts = np.flatnonzero(np.abs(np.diff(self.longitude)) > 180) + 1
        return self._stretches(cuts)

    @property
    def segments(self) -> list[slice]:
        """Stretches without a missing row."""
        return self._stretches(np.flatnonzero(np.diff(self.rows) > 1) + 1)

    def _stretches(self, cuts: Ints) -> list[slice]:
        edges = [0, *map(int, cuts), len(self.rows)]
        return [slice(start, stop) for start, stop in zip(edges, edges[1:])]


def track_of(solution: Solution, path: Path) -> Track:
    """Return the Track of a Solution for `path`. Raises DataError where there is none."""
    if not solution.has_position:
        filter = solution.meta.get("filter")
        raise DataError(
            f"{path}: the solution{f' of {filter}' if filter else ''} has no position, so there is "
            f"no track to write; use .nc or .csv"
        )
    lla, verdict, utc = solution.trajectory.lla, solution.verdict, solution.utc
    rows = np.flatnonzero(np.isfinite(lla).all(axis=1))
    words = [str(solution.meta[key]) for key in ("recording", "filter") if solution.meta.get(key)]
    doubt = "" if verdict.word in (TRUSTED, NOT_JUDGED) else f" ({verdict.word})"
    said = "" if verdict.word == NOT_JUDGED else f"Verdict: {verdict.line}. "
    if utc is None:
        known = solution.t[rows]
        said += (
            f"Solution of strapdown, {known[0]:.3f} to {known[-1]:.3f} s of the recording. Its clock "
            f"is not absolute, so there are no time stamps. "
        )
    else:
        said += f"Solution of strapdown, {span(utc[rows])}. "
    longitude = np.degrees(lla[rows, 1])
    return Track(
        (" ".join(words) or "strapdown solution") + doubt,
        said,
        rows,
        solution.t[rows],
        # GPX excludes 180, which rounding to nine digits may give
        np.where(longitude > 180 - 5e-10, longitude - 360, longitude),
        np.degrees(lla[rows, 0]),
        lla[rows, 2],
        [] if utc is None else [each.decode() for each in iso_text(utc[rows], 3).tolist()],
    )


def xml(text: str) -> str:
    """Return text for XML 1.0, with ? for characters that it does not allow."""
    fit = re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text)
    return escape(fit, quote=False)
