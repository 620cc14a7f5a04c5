"""Errors of the filters whose models allow no NEES mark, on the weaving flight of test_consistency:
bounds on them and how often twice the claimed standard deviations hold. To add a
filter, add a line to FILTERS.

The bounds are about twice what other seeds gave when the filter was added: they tell a filter that
has lost its way, not a better one from a worse.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import pytest
from test_consistency import COARSE, MEMS, flight, flown  # noqa: F401

from strapdown import filters
from strapdown.core.loop.contract import ATT, BA, BG, POS, VEL

SEEDS, SETTLED = 10, 120  # flights; s
GROUPS = POS, VEL, ATT, BA, BG


class Line(NamedTuple):
    """A filter, its options, its AHRS (records per second, as in test_consistency) and what to
    expect of it once it has settled."""

    name: str
    options: dict
    ahrs: float
    # most of position m, velocity m/s, attitude deg, accelerometer bias m/s^2, gyro bias deg/s; a
    # vector's length
    rms: tuple
    # least and most of the shares of errors within twice the standard deviation, of each of these
    # five
    covered: tuple


FILTERS = [
    Line("fixed-gain", {}, 10, (2.5, 0.35, 1.2, 0.12, np.inf), (0.93, 0.97)),
    Line("nlo", {"crab": 0.0}, None, (1.2, 0.3, 2.0, 0.17, 0.22), (0.88, 0.97)),
    Line("two-stage-ekf", {}, None, (1.4, 0.32, 4.0, 0.16, 0.19), (0.88, 0.998)),
    Line("xkf", {}, None, (1.2, 0.25, 1.4, 0.14, 0.17), (0.93, 0.975)),
    Line("xkf-two-stage", {}, None, (1.4, 0.32, 3.6, 0.16, 0.19), (0.88, 0.998)),
]


@pytest.mark.parametrize("line", FILTERS, ids=lambda line: line.name)
def test_errors_stay_small_and_are_about_as_large_as_claimed(flight, line):
    with ThreadPoolExecutor(2) as pool:
        runs = list(
            pool.map(
                lambda seed: flown(seed, flight, line.name, line.options, MEMS, COARSE, line.ahrs),
                range(SEEDS),
            )
        )
    error = np.array([e for e, _ in runs])[:, SETTLED:]
    assert error.shape[1] > 400
    filter = filters.find(line.name)
    for states, most, unit in zip(GROUPS, line.rms, (1, 1, np.pi / 180, 1, np.pi / 180)):
        if states.start in filter.estimates:
            assert np.sqrt((error[..., states] ** 2).sum(axis=-1).mean()) < most * unit, states
    std = np.array([solution.trajectory.std for _, solution in runs])[:, SETTLED:]
    for states in GROUPS:
        if states.start not in filter.states:
            assert np.isnan(std[..., states]).all()
            continue
        share = np.mean(np.abs(error[..., states]) <= 2 * std[..., states])
        assert line.covered[0] < share < line.covered[1], (states, share)
