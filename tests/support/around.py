"""A platform that turns on the spot, with nine axes and GNSS, and attitude records beside them:
for the tests of AHRSs that feed a filter."""

from dataclasses import replace
from functools import cache

import numpy as np

import strapdown as sd
from strapdown.data.solution import Source
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.trajectory import DEG, Motion

AROUND = Motion(
    "around",
    (DEG * 47.0, DEG * 8.0, 500.0),
    lambda t: (0 * t, 0 * t, 0 * t),
    lambda t: (0.2 * np.sin(0.3 * t), 0.1 * np.sin(0.2 * t), 2 + 0.2 * t),
)
"""A platform that turns on the spot: no course tells its heading."""


@cache
def recording(seconds=20.0, rate=20.0):
    """Nine axes and GNSS: 400 samples, a magnetometer with every second one."""
    return sd.simulate(
        AROUND,
        seconds,
        "tactical",
        5,
        rate,
        magnetometer=Magnetometer(rate=rate / 2),
        date="2024-05-01",
    )


def only(*kinds):
    """The recording with its sources of these kinds alone."""
    return replace(recording(), sources=tuple(a for a in recording().sources if a.kind in kinds))


def recorded(every=4, off=(0.0, 0.0, 0.0), deviation=(0.01, 0.02, 0.03), name="box"):
    """The true attitude, less `off`, as a Source: every `every`-th row of the truth."""
    truth = recording().reference
    y = truth.rph[::every] - off
    return Source("attitude", truth.t[::every], y, np.tile(deviation, (len(y), 1)), name=name)


def beside(*sources, kinds=("position", "velocity")):
    return replace(only(*kinds), sources=(*only(*kinds).sources, *sources))
