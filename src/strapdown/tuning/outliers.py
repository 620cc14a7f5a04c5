"""Rough factors of the sources by robust statistics, and which fixes count: outliers would make any
noise large, and a gate that noise too small closes would hide what is right."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.loop import loop
from ..core.loop.contract import Use
from ..engine.options import RunOptions
from ..engine.prepare import Run
from ..evaluation.fix_statistics import MEDIANS
from ..typing import Array, Mask
from .likelihood import settled_measurements
from .numbers import WHITE
from .unknowns import NoiseUnknown, run_with

ROUNDS, SETTLED = 6, 0.1
MAX_FACTOR = np.log(30.0)
"""Largest rough factor: what is further off shows by the likelihood."""


class Rough(NamedTuple):
    """Where the search can begin, and with what."""

    theta: Array  # (p,) logarithms
    kept: list[Mask]  # by source: fixes that count


def rough(run: Run, asked: RunOptions, unknowns: Sequence[NoiseUnknown]) -> Rough:
    """Factors with which the median square of each group of whitened innovations is that of right
    ones, the first by a run whose gates are open, and which fixes pass their gates then."""
    theta = np.log([each.begin for each in unknowns])
    begin = theta.copy()
    last = run_at(run, asked, unknowns, theta, gated=False)
    for _ in range(ROUNDS):
        found = settled_measurements(last, np.arange(len(run.recording.sources)))
        change = np.zeros(len(theta))
        for j, each in enumerate(unknowns):
            if each.what is WHITE:
                squares = found.whitened[found.source == each.place][:, list(each.rows)] ** 2
                squares = squares[np.isfinite(squares)]
                if len(squares):
                    change[j] = 0.5 * np.log(np.median(squares) / MEDIANS[1])
        theta = np.clip(theta + change, begin - MAX_FACTOR, begin + MAX_FACTOR)
        last = run_at(run, asked, unknowns, theta)
        if np.abs(change).max() < SETTLED:
            break
    return Rough(theta, used_masks(last))


def run_at(
    run: Run, asked: RunOptions, unknowns: Sequence[NoiseUnknown], theta: Array, gated: bool = True
) -> Run:
    """A run at a place, with gates as given or open, that has ended."""
    sources = [
        replace(a, gate=a.gate if gated else np.inf, robust=False, adaptive=0.0)
        for a in run.recording.sources
    ]
    again = run_with(run, asked, sources, unknowns, theta)
    again.complete()
    return again


def used_masks(run: Run) -> list[Mask]:
    """By source: which of its fixes a run that has ended did not reject."""
    fix = run.out.fix[: run.cursor.state[0].fix]
    masks = []
    for s, a in enumerate(run.recording.sources):
        own = fix["use"][fix["source"] == s] != Use.REJECTED
        # those up to the start are not used at all
        before = int((a.t <= run.start.t + loop.SAME_TIME).sum())
        kept = np.ones(len(a.t), bool)
        kept[before : before + len(own)] = own
        masks.append(kept)
    return masks
