"""Recordings whose fixes err for long: correlated errors of their sources, stated or not."""

from dataclasses import replace

import numpy as np
from flat_flight import NOISE, flight

import strapdown as sd
from strapdown.data.solution import Correlated
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.noise import gauss_markov

EXACT = NOISE._replace(gyro=1e-8)
POSITION, VELOCITY, TIME = (1.5, 0.0, 2.5), (0.3, 0.2, 0.1), 4.0
"""Of the correlated errors: of the second component of a position there are none."""


def erring(recording, deviation, time, seed, kind="position"):
    """The recording with Gauss-Markov errors of these standard deviations (3), m or m/s NED, and
    that time, s, in its sources of that kind. It does not say so."""
    rng, sources = np.random.default_rng([seed, 77]), []
    for a in recording.sources:
        if a.kind == kind:
            c = gauss_markov(np.diff(a.t) / time, rng) * deviation
            a = replace(a, y=displace_lla(a.y, c) if kind == "position" else a.y + c)
        sources.append(a)
    return replace(recording, sources=tuple(sources))


def told(recording, deviation, time, states=True, kind="position"):
    """The recording whose sources of that kind say that they have such errors."""
    correlated = Correlated(tuple(map(float, deviation)), time, states)
    return replace(
        recording,
        sources=tuple(
            replace(a, correlated=correlated) if a.kind == kind else a for a in recording.sources
        ),
    )


def straight(seconds=20.0, rate=20.0, states=True, known=False):
    """(recording of a straight flight at known attitude, its start): positions and velocities err
    for long, and say so."""
    made, start, _ = flight(seconds, rate, turning=False, gps=0.5, noisy=False)
    made = erring(made, POSITION, TIME, 1005)
    made = erring(made, VELOCITY, TIME, 1006, "velocity")
    if known:
        path = alone(made, start)
        rows = np.arange(9, len(path.t), 10)
        right = sd.Source("attitude", path.t[rows], path.rph[rows], np.full((len(rows), 3), 1e-5))
        made = replace(made, sources=(*made.sources, right))
    made = replace(made, sources=tuple(replace(a, gate=np.inf) for a in made.sources))
    made = told(made, POSITION, TIME, states)
    return told(made, VELOCITY, TIME, states, "velocity"), start


def alone(recording, start):
    """The path of an INS without fixes."""
    return sd.fuse(replace(recording, sources=()), start=start, noise=EXACT).trajectory
