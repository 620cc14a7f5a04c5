"""Other packages on the same inputs, one file each, as their own documentation shows.

Each is a function (workload, seconds) -> Result that runs the filter of its package over the first
seconds of a Workload with the noise, the start and the fixes that the workload states. The packages
are optional: a function imports its own when it is called.
"""

from typing import NamedTuple

import numpy as np
from workload import SETTLED, Rms, score


class Estimate(NamedTuple):
    """What a filter says of position, velocity and attitude."""

    t: np.ndarray  # (n,) s
    lla: np.ndarray  # (n, 3) rad, rad, m
    v: np.ndarray  # (n, 3) NED, m/s
    C: np.ndarray  # (n, 3, 3) body to navigation frame
    std: (
        np.ndarray
    )  # (n, 9) claimed standard deviations: position NED m, velocity NED m/s, attitude rad


class Result(NamedTuple):
    """What a peer took and reached."""

    us: float  # microseconds of the processor per IMU sample
    rms: Rms | None  # None on a piece too short to score, or without truth at each sample
    estimate: Estimate | None = None


def judged(workload, seconds, *estimate):
    """A Result from the time taken and the fields of an Estimate; on a short piece without
    accuracy."""
    known = workload.lla is not None and workload.t[-1] > SETTLED
    rms = score(workload, *estimate[:4]) if known else None
    return Result(seconds / (len(workload.t) - 1) * 1e6, rms, Estimate(*estimate))


def fixes_by_sample(workload):
    """{sample: fix} of those that lie on a sample, as all of a workload do."""
    k = np.rint((workload.fix_t - workload.t[0]) / workload.dt).astype(int)
    return dict(zip(k, workload.fix))


def instants(workload):
    """Samples at which a graph has a state and every package is scored: all fixes, and evenly between
    them where some are missing."""
    edges = [0, *sorted(fixes_by_sample(workload)), len(workload.t) - 1]
    between, found = np.median(np.diff(workload.fix_t)) / workload.dt, []
    for start, stop in zip(edges, edges[1:]):
        pieces = max(1, round((stop - start) / between))
        found += np.rint(np.linspace(start, stop, pieces + 1)[1:]).astype(int).tolist()
    return found
