"""The likelihood of what sources recorded, by the innovations of a filter that runs with given noise.

log L = -1/2 sum over fixes (NIS + 2 sum log diag L), L L' the covariance of an innovation (Schweppe
1965; constants dropped). Only what was recorded counts: constraints act in the runs, but are no
data. So it is a partial likelihood (Cox 1975), whose score has mean zero like that of a whole one.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..engine.options import RunOptions
from ..engine.prepare import Run
from ..typing import Array, Ints, Mask
from .unknowns import NoiseUnknown, run_with

THREADS = min(2, os.cpu_count() or 1)
SETTLING, SETTLING_SHARE = 60.0, 0.2
"""s, or share of the run, in which a filter settles: while it turns by large angles and learns large
biases, its innovations are not what it says, so they tell no noise."""
MIN_STEP = 1e-2
"""Step of a logarithm, for differences between two runs."""


class Seen(NamedTuple):
    """The m counted measurements of a run, with innovations and likelihood."""

    source: Ints  # (m,) index of the source
    e: Array  # (m, 3) innovations; 0 where nothing was measured
    root: Array  # (m, 3, 3) L; of what was not measured the rows of the identity
    whitened: Array  # (m, 3); NaN where nothing was measured
    log: Array  # (m,) what each adds to log L; NaN where a run measured nothing
    whole: bool  # whether the run came to its end


def settling_end(run: Run) -> float:
    """Time (s) from which fixes count."""
    return run.start.t + min(SETTLING, SETTLING_SHARE * (float(run.samples.t[-1]) - run.start.t))


def settled_measurements(run: Run, counted: Ints) -> Seen:
    """Return the measurements of these sources in a complete run, once it has settled."""
    fix = run.out.fix[: run.cursor.state[0].fix]
    fix = fix[np.isin(fix["source"], counted) & (fix["t"] > settling_end(run))]
    whitened = fix["whitened"]
    measured = np.isfinite(whitened)
    root = np.zeros((len(fix), 3, 3))
    below = np.tril_indices(3)
    root[:, below[0], below[1]] = fix["root"]
    both = measured[:, :, None] & measured[:, None, :]
    root = np.where(both & np.isfinite(root), root, np.eye(3))
    diagonal = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return Seen(
        fix["source"].astype(np.int64),
        np.where(measured, fix["innovation"], 0.0),
        root,
        whitened,
        -0.5 * fix["nis"] - diagonal,
        not run.cursor.state[0].fault,
    )


class Point(NamedTuple):
    """A place that was tried."""

    theta: Array  # (p,) logarithms
    seen: Seen
    log_likelihood: float

    @property
    def mean(self) -> float:
        """log L per fix, to compare runs from different starts."""
        return self.log_likelihood / max(len(self.seen.log), 1)


class Likelihood:
    """log L of a run as a function of the logarithms of unknowns; all else, such as the start, is
    held. Fixes outside `kept` (a mask by source) are hidden, gates are open."""

    def __init__(
        self,
        run: Run,
        asked: RunOptions,
        unknowns: Sequence[NoiseUnknown],
        counted: Ints,
        kept: Sequence[Mask],
    ) -> None:
        self.run, self.unknowns, self.counted, self.kept = run, tuple(unknowns), counted, kept
        self.asked = asked
        self.sources = tuple(
            replace(
                a._where(kept[s]),
                gate=np.inf if s in counted else a.gate,
                robust=False,
                adaptive=0.0,
            )
            for s, a in enumerate(run.recording.sources)
        )
        self.low = np.log([each.least for each in unknowns])
        self.high = np.log([each.most for each in unknowns])
        self.runs = 0

    def with_more(self, more: Sequence[NoiseUnknown]) -> "Likelihood":
        """The same with more unknowns, of the same fixes."""
        wider = Likelihood(self.run, self.asked, [*self.unknowns, *more], self.counted, self.kept)
        wider.reference = self.reference
        return wider

    @cached_property
    def reference(self) -> Seen:
        """At the place where the search begins: which fixes are measured is taken from it."""
        return self._measurements(self.begin)

    @property
    def begin(self) -> Array:
        """(p,) logarithms of where the search begins."""
        return np.log([each.begin for each in self.unknowns])

    def ready(self, theta: Array) -> Run:
        """The Run at a place, before its first sample."""
        return run_with(self.run, self.asked, self.sources, self.unknowns, theta)

    def _measurements(self, theta: Array) -> Seen:
        run = self.ready(theta)
        run.complete()
        return settled_measurements(run, self.counted)

    def at(self, theta: Array) -> Point:
        """Return the Point at theta."""
        return self.all([theta])[0]

    def all(self, thetas: Sequence[Array]) -> list[Point]:
        """Return the Points at several theta, on two processors."""
        self.runs += len(thetas)
        reference = self.reference
        if len(thetas) == 1 or THREADS == 1:
            found = list(map(self._measurements, thetas))
        else:
            with ThreadPoolExecutor(THREADS) as pool:
                found = list(pool.map(self._measurements, thetas))
        return [Point(theta, each, _sum(each, reference)) for theta, each in zip(thetas, found)]


def _sum(each: Seen, reference: Seen) -> float:
    """log L over the fixes that the reference measured; one that a run does not measure counts as
    there, so that none pays for being left out."""
    if not each.whole or len(each.log) != len(reference.log):
        return -np.inf
    both = np.where(np.isfinite(each.log), each.log, reference.log)
    return float(both[np.isfinite(reference.log)].sum())


class Slope(NamedTuple):
    """Slope of log L at a place along some of the unknowns."""

    free: Ints  # (q,) which
    score: Array  # (q,)
    information: Array  # (q, q) expected (Fisher), log L being that of the model


def slope(likelihood: Likelihood, point: Point, free: Ints) -> Slope:
    """The Slope, from one more run for each unknown.

    F_ab = sum [de_a' S^-1 de_b + tr(S^-1 dS_a S^-1 dS_b) / 2], with S = L L' (Gupta and Mehra 1974).
    The score is the difference of log L, less what the curvature F adds to it over the step.
    """
    steps = np.where(point.theta[free] + MIN_STEP <= likelihood.high[free], 1, -1) * MIN_STEP
    moved = [
        point.theta + step * (np.arange(len(point.theta)) == j) for j, step in zip(free, steps)
    ]
    others = likelihood.all(moved)
    J = np.stack([_whitened_change(point.seen, other.seen) for other in others]) / steps[:, None]
    F = J @ J.T
    gain = np.array([other.log_likelihood - point.log_likelihood for other in others]) / steps
    return Slope(free, np.nan_to_num(gain) + 0.5 * steps * np.diag(F), F)


def _whitened_change(at: Seen, other: Seen) -> Array:
    """L^-1 de, and L^-1 dS L^-T / sqrt(2), in one row."""
    if len(other.e) != len(at.e):
        return np.zeros(12 * len(at.e))
    both = np.isfinite(at.log) & np.isfinite(other.log)
    inverse = np.linalg.inv(at.root)
    e = np.einsum("kij,kj->ki", inverse, other.e - at.e)
    A = inverse @ (other.root - at.root)
    S = (A + A.transpose(0, 2, 1)) / np.sqrt(2)
    rows = np.concatenate([e, S.reshape(-1, 9)], axis=1)
    return np.where(both[:, None], rows, 0.0).ravel()
