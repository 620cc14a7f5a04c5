"""Scores of an estimate block by block, and when two packages are level.

A block is an outage, or ten seconds with fixes; of simulated flights it is a whole run, one for each of its
random numbers. Packages that ran on the same case have the same blocks, so that the difference of two is
judged over them in pairs.
"""

import numpy as np
from adapters import instants
from scipy.stats import t as student

from strapdown.geometry.geodesy import displacement

BLOCK = 10.0
"""s of a block with fixes."""
LEVEL = 0.95
"""Of the interval of a difference."""
FEW, CLOSE = 4, 0.05
"""Blocks below which there is no interval: then packages within this part of each other are level."""
ERRORS = ("position", "velocity", "attitude")
QUESTIONS = ("with fixes", "in outages")


def blocks(trial):
    """{question: [(start, stop)]} of a Trial."""
    start, stop = trial.scored
    edges = np.arange(start, stop - BLOCK / 2, BLOCK)
    clear = [(a, a + BLOCK) for a in edges if not _meets(trial.outages, a, a + BLOCK)]
    return {QUESTIONS[0]: clear, QUESTIONS[1]: list(trial.outages)}


def _meets(outages, start, stop):
    # the fix after an outage is not yet one of a filter that has settled
    return any(start < end + BLOCK / 2 and begin < stop for begin, end in outages)


def scored(trial, estimate):
    """{question: {error: {"square", "scaled", "inside 1", "inside 3"}}}, each a list over the blocks: mean
    square error (m, m/s, deg; of the vector), its mean square over the claimed variance (1 is right), and
    the shares inside 1 and 3 claimed standard deviations."""
    t, errors, std = _errors(trial, estimate)
    found = {}
    for question, windows in blocks(trial).items():
        rows = [(t > start) & (t <= stop) for start, stop in windows]
        found[question] = {
            name: _over(error, std[:, 3 * i : 3 * i + 3], rows)
            for i, (name, error) in enumerate(zip(ERRORS, errors))
            if error is not None
        }
    return found


def _over(error, std, rows):
    """The four scores of one error over blocks of rows."""
    squares = np.sum(error**2, axis=1)
    # of an attitude the axes of a claim differ between packages, its trace does not
    scaled = squares / np.sum(std**2, axis=1)
    share = np.abs(error) / std
    return {
        "square": [float(squares[row].mean()) for row in rows],
        "scaled": [float(scaled[row].mean()) for row in rows],
        "inside 1": [float((share[row] <= 1).mean()) for row in rows],
        "inside 3": [float((share[row] <= 3).mean()) for row in rows],
    }


def _is_instant(w, t):
    """Which of the times are instants at which every package has a state."""
    k = np.rint((t - w.t[0]) / w.dt).astype(int)
    return np.isin(k, instants(w))


def _errors(trial, estimate):
    """(t, (position, velocity or None, attitude or None), std) at the instants at which the
    reference has a row; angles in deg."""
    from scipy.spatial.transform import Rotation

    truth, w = trial.reference, trial.workload
    at = np.clip(np.searchsorted(truth.t, estimate.t), 1, len(truth.t) - 1)
    at -= (estimate.t - truth.t[at - 1]) < (truth.t[at] - estimate.t)
    near = (np.abs(truth.t[at] - estimate.t) < 0.51 * w.dt) & _is_instant(w, estimate.t)
    at, std = at[near], estimate.std[near].copy()
    std[:, 6:] = np.rad2deg(std[:, 6:])
    position = displacement(estimate.lla[near], truth.lla[at])
    velocity = attitude = None
    if truth.v_n is not None and np.isfinite(truth.v_n[at]).all():
        velocity = estimate.v[near] - truth.v_n[at]
    if trial.attitude:
        turned = Rotation.from_matrix(estimate.C[near]) * truth.rotation[at].inv()
        attitude = turned.as_rotvec(degrees=True)
    return estimate.t[near], (position, velocity, attitude), std


def size(squares):
    """Root of the mean of squares, over the last axis."""
    return np.sqrt(np.mean(squares, axis=-1))


def dishonesty(scaled):
    """How far the mean square over the claimed variance is from 1, as a logarithm, over the last axis: 0
    is right, and twice and half the variance are equally wrong."""
    return np.abs(np.log(np.mean(scaled, axis=-1)))


def level(a, b, statistic):
    """True where the interval of the difference of `statistic` between blocks `a` and `b` holds 0: Student's
    t over pseudo-values of the jackknife. Of errors it tells equal packages apart in the twentieth of cells that
    it states, also with four blocks, where a bootstrap does in a quarter."""
    a, b = np.asarray(a), np.asarray(b)
    difference = statistic(a) - statistic(b)
    n = len(a)
    if n < FEW:
        larger = max(statistic(a), statistic(b))
        return bool(abs(difference) <= CLOSE * larger)
    others = np.array([np.r_[0:i, i + 1 : n] for i in range(n)])
    pseudo = n * difference - (n - 1) * (statistic(a[others]) - statistic(b[others]))
    half = student.ppf((1 + LEVEL) / 2, n - 1) * pseudo.std(ddof=1) / np.sqrt(n)
    return bool(abs(pseudo.mean()) <= half)
