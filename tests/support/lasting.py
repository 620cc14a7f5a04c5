"""Recordings whose fixes err for long: correlated errors of their sources, stated or not."""

from dataclasses import replace

import numpy as np

from strapdown.data import Correlated
from strapdown.geodesy import displaced
from strapdown.sensor_models.noise import gauss_markov


def erring(recording, deviation, time, seed, kind="position"):
    """The recording with Gauss-Markov errors of these standard deviations (3), m or m/s NED, and
    that time, s, in its sources of that kind. It does not say so."""
    rng, aidings = np.random.default_rng([seed, 77]), []
    for a in recording.aidings:
        if a.kind == kind:
            c = gauss_markov(np.diff(a.t) / time, rng) * deviation
            a = replace(a, y=displaced(a.y, c) if kind == "position" else a.y + c)
        aidings.append(a)
    return replace(recording, aidings=tuple(aidings))


def told(recording, deviation, time, states=True, kind="position"):
    """The recording whose sources of that kind say that they have such errors."""
    correlated = Correlated(tuple(map(float, deviation)), time, states)
    return replace(
        recording,
        aidings=tuple(
            replace(a, correlated=correlated) if a.kind == kind else a for a in recording.aidings
        ),
    )
