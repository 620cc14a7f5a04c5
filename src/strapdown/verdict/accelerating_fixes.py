"""Positions and velocities that agree with each other and move away from what the IMU felt, ever faster:
a spoofer that takes a receiver over gently. Each second tells too little of it for the tests of the loop;
over minutes one constant acceleration from some time on explains all innovations together.

For each of some onsets that acceleration is estimated from the innovations of the closed loop, as
`installation` estimates its constants (Friedland 1969). The likelihood ratio of the best onset is that of
Willsky & Jones (1976), "A generalized likelihood ratio approach to the detection and estimation of
jumps in linear systems", IEEE TAC 21(1).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .. import filters
from ..core.loop.contract import Noise
from ..data.solution import Solution
from ..data.verdict import GRAVE, Reason
from ..engine.options import run_options
from ..engine.prepare import Run
from ..engine.sensitivity import Corrections, Sums, begin_sensitive, sums
from ..installation.screening import as_found, of_installation, window
from ..typing import Array

ONSETS, LAST_ONSET = 8, 0.7
"""Number of onsets that are tried, evenly over the first part of a run, and the share of it that this is:
behind the last a third must show how steady the acceleration is."""
MIN_GAIN = 25.0
"""Decrease of the sum of squared innovations from which an acceleration is a reason. Two numbers and eight
onsets exceed it by chance at most once in 30 000 recordings; recorded aircraft and cars reach 6, 100
simulated flights, walks, hovers and swells 17."""
MIN_BLOCKS, MIN_INFORMATION = 5, 1e-9
"""Blocks of time that must tell the acceleration, and the share of all information that such a block has
at least."""
AXES = 2
"""Components of the acceleration: north and east. A height that moves away is seen by other heights."""


class FixAcceleration(NamedTuple):
    """Acceleration of the fixes that the IMU does not feel."""

    onset: float  # s
    value: Array  # (2,) m/s^2, north and east
    gain: float  # decrease of the sum of squared innovations, see `_estimate`


def check(solution: Solution) -> list[Reason]:
    """Return a Reason where fixes of position and velocity accelerate against the IMU; [] where they do
    not or where the solution has only one of them. Raises DataError."""
    assert solution.recording is not None
    kinds = {a.kind for a in solution.recording.sources}
    if not {"position", "velocity"} <= kinds or not solution.has_position:
        return []
    found = estimate_acceleration(solution)
    if found.gain < MIN_GAIN:
        return []
    north, east = found.value
    return [
        Reason(
            "outliers",
            f"from about {found.onset:.0f} s on, positions and velocities accelerate together by "
            f"{north:+.2g} m/s^2 north and {east:+.2g} m/s^2 east, and the IMU did not feel it: their "
            f"innovations fit better by {found.gain:.0f} ({MIN_GAIN:.0f} at most)",
            "leave the fixes out from there on: the receiver may be spoofed; if a second receiver "
            "confirms them, calibrate the IMU or describe a less accurate one",
            weight=min(found.gain / MIN_GAIN, GRAVE),
        )
    ]


def estimate_acceleration(solution: Solution) -> FixAcceleration:
    """Return the acceleration of the onset that explains most. Raises DataError."""
    part, start = as_found(solution, *window(solution))
    asked = run_options(start=start, noise=Noise(**solution.meta["noise"]), estimate=())
    part = replace(part, sources=tuple(of_installation(part.sources)))
    run = begin_sensitive(part, filters.find("closed-loop"), asked)
    onsets = start.t + np.arange(1, ONSETS + 1) * LAST_ONSET / ONSETS * (
        run.samples.t[-1] - start.t
    )
    nothing = np.zeros((len(run.belief.P), AXES * ONSETS))
    found = sums(run, lambda at: _derivatives(run, at, onsets), nothing)
    each = [_estimate(found, j, float(onset)) for j, onset in enumerate(onsets)]
    return max(each, key=lambda one: one.gain)


def _derivatives(run: Run, at: Corrections, onsets: Array) -> Array:
    """(k, 3, m) derivatives of these corrections' measurements by the acceleration from each onset."""
    h = np.zeros((len(at.t), 3, AXES * len(onsets)))
    kinds = np.array([a.kind for a in run.recording.sources])[at.source]
    since = np.maximum(at.t[:, None] - onsets, 0.0)
    by = np.where((kinds == "velocity")[:, None], since, 0.0)
    by += np.where((kinds == "position")[:, None], 0.5 * since**2, 0.0)
    for axis in range(AXES):
        h[:, axis, axis::AXES] = by
    return h


def _estimate(found: Sums, j: int, onset: float) -> FixAcceleration:
    """The estimate of onset j. Where blocks of time disagree by more than their standard deviations, as
    errors of right fixes that last make them, the gain is divided by their mean square."""
    own = slice(AXES * j, AXES * (j + 1))
    information, score = found.information[:, own, own], found.score[:, own]
    whole = information.sum(axis=0)
    tells = np.linalg.eigvalsh(information)[:, 0] > MIN_INFORMATION * np.trace(whole)
    if tells.sum() < MIN_BLOCKS:
        return FixAcceleration(onset, np.zeros(AXES), 0.0)
    value = np.linalg.solve(whole, score.sum(axis=0))
    left = (score - information @ value)[tells]
    squares = (left * np.linalg.solve(information[tells], left[..., None])[..., 0]).sum()
    spread = squares / (AXES * (tells.sum() - 1))
    return FixAcceleration(onset, value, float(value @ whole @ value / max(spread, 1.0)))
