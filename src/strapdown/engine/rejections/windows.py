"""The fixes from the loop, and the window of fixes around a run of rejections."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.loop.contract import Use
from ...typing import Array, Ints, Mask
from .causes import Window

BEFORE, AFTER = 60.0, 5.0  # s of fixes around a run that are used to find its cause
MAX_BEFORE, MAX_INSIDE, MAX_AFTER = 150, 600, 20  # largest numbers of these fixes
MOVED = 0.5  # s to either side for the mean acceleration


class WindowFixes(NamedTuple):
    """Fixes from the loop, in order."""

    rows: Any  # (m,) a table of FixRow
    std: Array  # (m, 3) stated
    after: Array  # (sources,) s: earlier rejections are already known
    begin: Array  # (sources,) s: the first tested fix, kept or not

    def of(self, s: int) -> "WindowFixes":
        """Return the tested fixes of a source."""
        own = (self.rows["source"] == s) & np.isfinite(self.rows["nis"])
        return self._replace(rows=self.rows[own], std=self.std[own])

    @property
    def t(self) -> Array:
        """Times (m,), s."""
        return self.rows["t"]

    @property
    def began(self) -> float:
        """Time of the first tested measurement, s; for measurements of one source."""
        return float(self.begin[int(self.rows["source"][0])])

    @property
    def nis(self) -> Array:
        """(m,)"""
        return self.rows["nis"]

    @property
    def measured(self) -> Ints:
        """Number of rows of each innovation (m,)."""
        known = np.isfinite(self.rows["innovation"])
        return known.sum(axis=1, dtype=np.int64)

    @property
    def rejected(self) -> Mask:
        """(m,)"""
        new = self.t > self.after[self.rows["source"].astype(int)]
        return new & (self.rows["use"] == Use.REJECTED)


def window(
    own: WindowFixes, every: WindowFixes, kind: str, parts: Sequence[Ints], before: int = 0
) -> Window:
    """Return the fixes of a source around these parts of a run, none before number `before`."""
    first, last = int(parts[0][0]), int(parts[-1][-1])
    begin = int(np.searchsorted(own.t, own.t[first] - BEFORE))
    begin = max(begin, first - MAX_BEFORE, before)
    stop = min(last, first + MAX_INSIDE)
    end = int(np.searchsorted(own.t, own.t[stop] + AFTER, "right"))
    rows = own.rows[begin : min(end, stop + 1 + MAX_AFTER)]
    t, use = rows["t"], rows["use"]
    std = own.std[begin : begin + len(rows)]
    used = use != Use.REJECTED
    return Window(
        t,
        rows["innovation"],
        _root(rows, std),
        np.nan_to_num(std),
        used,
        used & (use != Use.REACQUIRED),
        np.nan_to_num(rows["v"]),
        _acceleration(every, t),
        kind,
        tuple(
            (int(part[0]) - begin, min(int(part[-1]), stop) - begin)
            for part in parts
            if part[0] <= stop
        ),
    )


def _root(rows: Any, std: Array) -> Array:
    """(m, 3, 3) L of the innovations; where a filter gives none, of the stated deviations, and with
    unit diagonals where nothing was measured."""
    root = np.zeros((len(rows), 3, 3))
    root[:, *np.tril_indices(3)] = rows["root"]
    diagonal = root[:, range(3), range(3)]
    stated = np.where(std > 0, std, 1.0)
    diagonal = np.where(diagonal > 0, diagonal, stated)
    root = np.nan_to_num(root)
    root[:, range(3), range(3)] = diagonal
    return root


def _acceleration(every: WindowFixes, t: Array) -> Array:
    """(m, 3) m/s^2 of the filter at these times."""
    near = slice(*np.searchsorted(every.t, [t[0] - 10 * MOVED, t[-1] + 10 * MOVED]))
    times, v = every.t[near], np.nan_to_num(every.rows["v"][near])
    low, high = np.clip(t - MOVED, times[0], times[-1]), np.clip(t + MOVED, times[0], times[-1])
    change = [np.interp(high, times, axis) - np.interp(low, times, axis) for axis in v.T]
    return np.column_stack(change) / np.maximum(high - low, 1e-3)[:, None]
