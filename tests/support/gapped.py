"""Recordings with random gaps of IMU samples: some at the ends, some in a row with less than a window
of samples between."""

from dataclasses import replace
from functools import cache

import numpy as np
from recordings import without_samples

import strapdown as sd

SECONDS = 120.0
KINDS = ("car", "demo")


@cache
def whole(kind, seed, grade="consumer"):
    """A simulated recording without gaps."""
    return sd.simulate(kind, SECONDS, grade, seed=seed)


def gapped(seed, grade="consumer"):
    """A recording of `SECONDS` with one to four gaps of 1.5 to 50 s."""
    rng = np.random.default_rng(seed)
    recording, gaps = whole(KINDS[seed % 2], int(rng.integers(3)), grade), []
    for _ in range(rng.integers(1, 5)):
        length = rng.uniform(1.5, 50.0)
        begin = rng.choice([-1.0, SECONDS - length, *rng.uniform(0.0, 110.0, 3)])
        gaps.append((begin, begin + length))
        if rng.random() < 0.3:  # an island between two gaps
            begin += length + rng.choice([0.02, 0.3, 0.9, 1.2])
            gaps.append((begin, begin + rng.uniform(1.5, 20.0)))
    made = without_samples(recording, *gaps)
    # as a user hands them over, at 100, 20 or 2 Hz
    imu, part = made.imu, slice(None, None, int(rng.choice([1, 1, 5, 50])))
    rates = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    return sd.Recording.from_arrays(
        imu.t[part], *(column[part] for column in rates), made.sources, made.reference
    )


def with_sources(recording, seed):
    """The recording with other sources: positions alone, a magnetometer, or an altimeter besides."""
    which = seed % 4
    if which == 1:
        kept = tuple(a for a in recording.sources if a.kind == "position")
        return replace(recording, sources=kept)
    more = {2: ("magnetic-field", (2e-5, 0.0, 4e-5), 5e-7), 3: ("altitude", (500.0,), 50.0)}
    if which not in more:
        return recording
    kind, y, deviation = more[which]
    t = recording.imu.t[::5]
    row = np.tile(y, (len(t), 1))
    parameters = y if kind == "magnetic-field" else ()
    made = sd.Source(kind, t, row, np.full(row.shape, deviation), parameters=parameters)
    return replace(recording, sources=(*recording.sources, made))
