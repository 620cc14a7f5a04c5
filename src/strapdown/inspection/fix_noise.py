"""The noise of fixes from one to the next against their standard deviations, without a filter.

A motion changes little between fixes that follow each other quickly, so what is left of their third
differences is noise: of variance 20 std^2. Positions at a slower pace are compared with what the
velocity of their receiver says of the way between them. Errors that last do not show in either.
"""

from collections.abc import Iterator

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from ..geometry.geodesy import displacement
from ..typing import Array
from ..units.constants import MEDIAN_OF_NORMAL
from .finding import Checked, label
from .motion import InspectedRecording
from .position_velocity import pairs

QUICK, SLOW = 0.25, 1.5
"""s between fixes up to which third differences, and differences against a velocity, are noise."""
FEWEST = 50
"""Differences from which a median says something."""
TOO_LARGE = 2.0
"""Times that the noise may exceed what is claimed."""


def check(subject: InspectedRecording) -> Checked:
    """Reasons against standard deviations that are smaller than the noise of their fixes."""
    sources = subject.sources("position", "velocity")
    noise = {id(a): _of_third_differences(a) for a in sources}
    for position, velocity in pairs(subject.recording.sources):
        if noise[id(position)] is None:
            noise[id(position)] = _against_velocity(position, velocity)
    reasons = [reason for a in sources for reason in _reasons(a, noise[id(a)])]
    return Checked([], reasons, [])


def _of_third_differences(source: Source) -> float | None:
    """Noise over claimed standard deviation, of the worse horizontal axis; None without quick
    fixes."""
    t, y, std = _horizontal(source)
    if len(t) < FEWEST or not np.median(np.diff(t)) <= QUICK:
        return None
    steps = np.diff(t)
    even = np.ptp(np.stack([steps[:-2], steps[1:-1], steps[2:]]), axis=0) < 0.1 * np.median(steps)
    return _ratio(np.diff(y, 3, axis=0)[even], np.sqrt(20) * std[3:][even])


def _against_velocity(position: Source, velocity: Source) -> float | None:
    """The same of positions, by the way that velocities claim from one to the next."""
    t, y, std = _horizontal(position)
    t_v, v, std_v = _horizontal(velocity)
    if min(len(t), len(t_v)) < FEWEST:
        return None
    dt = np.diff(t)
    way = np.stack([np.interp(t, t_v, column) for column in v.T], axis=1)
    way = (way[1:] + way[:-1]) / 2 * dt[:, None]
    use = (dt <= SLOW) & (t[1:] <= t_v[-1]) & (t[:-1] >= t_v[0])
    claimed = np.hypot(np.hypot(std[1:], std[:-1]), np.median(std_v) * dt[:, None])
    return _ratio((np.diff(y, axis=0) - way)[use], claimed[use])


def _horizontal(source: Source) -> tuple[Array, Array, Array]:
    """t (n,), north and east (n, 2) in m or m/s, std (n, 2) of the complete fixes."""
    std = np.broadcast_to(source.std, source.y.shape)
    t, first = np.unique(source.t, return_index=True)
    y, std = source.y[first], std[first]
    use = np.isfinite(y[:, :2]).all(axis=1)
    t, y, std = t[use], y[use], std[use, :2]
    if source.kind == "position" and len(y):
        level = np.c_[y[:, :2], np.full(len(y), np.nan_to_num(y[0, 2]))]
        y = displacement(level, np.broadcast_to(level[0], level.shape))
    return t, y[:, :2], std


def _ratio(differences: Array, claimed: Array) -> float | None:
    """Their median size over what is claimed, of the worse axis; None where there are few."""
    if len(differences) < FEWEST or not (claimed > 0).all():
        return None
    return float((np.median(np.abs(differences) / claimed, axis=0) / MEDIAN_OF_NORMAL).max())


def _reasons(source: Source, ratio: float | None) -> Iterator[Reason]:
    if ratio is not None and ratio > TOO_LARGE:
        yield Reason(
            "fix noise",
            f"from fix to fix the source scatters {ratio:.2g} times as much as its standard "
            f"deviation ({TOO_LARGE:g} times at most)",
            f"multiply its `std` by about {ratio:.2g}",
            label(source),
            (ratio / TOO_LARGE) ** 2,
        )
