"""A receiver that goes fixed, float, wrongly fixed and back, simulated by the package's receivers."""

from dataclasses import replace
from typing import NamedTuple

import classed
import numpy as np

import strapdown as sd
from strapdown.data.solution import DOUBTFUL, Correlated
from strapdown.geometry.geodesy import displace_lla
from strapdown.io.decoding.carrier_classes import FLOAT_ERRORS
from strapdown.sim.analytic import waves
from strapdown.sim.motions import car
from strapdown.sim.trajectory import DEG, Motion

SCHEDULE = ((0, "fixed"), (60, "float"), (100, "wrong"), (115, "fixed"), (150, "float"))
SCHEDULE += ((180, "fixed"), (210, "wrong"), (225, "fixed"))
"""s from which on fixes are of that class; "wrong" is told as fixed."""
DURATION, OFF, SAID = 240.0, 0.5, 10.0
"""s; m by which a wrong fix is off; s within which it must be said."""
LASTING = Correlated(tuple(FLOAT_ERRORS["std"]), FLOAT_ERRORS["time"])


PACES = {
    "roll": ((6 * DEG, 1.07, 0.4), (2 * DEG, 0.53, 1.0)),
    "pitch": ((5 * DEG, 0.97, 0.0), (3 * DEG, 0.51, 2.0)),
    "heading": ((8 * DEG, 1.07, 1.3),),
    "down": ((0.25, 0.53, 0.0), (0.1, 1.07, 0.7)),
}
"""Of a receiver in the hand of someone who walks: amplitude rad or m/s, period s, phase rad."""


def walk():
    """A Motion to and fro in a yard at 1.3 m/s, with tight turns, carried in the hand."""
    there = [{"duration": 12.0}, {"duration": 2.0, "turn": 90 * DEG}, {"duration": 4.0}]
    back = [{"duration": 2.0, "turn": 170 * DEG}, {"duration": 7.0}, {"duration": 3.0}]
    legs = [{"duration": 10.0}, {"duration": 2.0, "speed": 1.3}, *8 * (there + back)]
    path = car((40 * DEG, -105 * DEG, 1600.0), 0.5, legs, roughness=0.0)

    def velocity(t):
        north, east, down = path.velocity(t)
        return north, east, down + waves(t, PACES["down"])

    def attitude(t):
        swings = [waves(t, PACES[angle]) for angle in ("roll", "pitch", "heading")]
        return tuple(angle + swing for angle, swing in zip(path.attitude(t), swings))

    return Motion("walk", path.lla, velocity, attitude, path.end)


class CarrierRun(NamedTuple):
    """Result of a run."""

    inside: np.ndarray  # (n, 3) of the float epochs: whether the error is within 3 std
    said: tuple[bool, ...]  # of each wrong fix
    doubtful: float  # share of the rows before the first wrong fix that are doubtful


def states(t):
    """(n,) the state of the receiver at times t."""
    begins, names = zip(*SCHEDULE)
    return np.array(names)[np.searchsorted(begins, t, side="right") - 1]


def simulated(motion, seed, off=OFF):
    """A recording with classes; each float spell has errors of its own."""
    made = [
        sd.simulate(motion, duration=DURATION, imu="consumer", gnss=gnss, seed=seed + 1000 * k)
        for k, gnss in enumerate(("rtk-fixed", "rtk-float", "rtk-float"))
    ]
    recording = made[0]
    position = recording.sources[0]
    state, rng = states(position.t), np.random.default_rng(seed)
    y = position.y.copy()
    for other, late in ((made[1], False), (made[2], True)):
        rows = (state == "float") & ((position.t > 125) == late)
        y[rows] = other.sources[0].y[rows]
    for begin, name in SCHEDULE:
        if name == "wrong":
            rows = (state == name) & (position.t >= begin) & (position.t < begin + 15)
            angle = rng.uniform(0, 2 * np.pi)
            shift = np.tile([off * np.cos(angle), off * np.sin(angle), 0.0], (int(rows.sum()), 1))
            y[rows] = displace_lla(y[rows], shift)
    told = np.where(state == "wrong", "fixed", state)
    sources = (replace(position, y=y), *recording.sources[1:])
    noise = {"std": np.tile([0.01, 0.01, 0.02], (int((told == "float").sum()), 1))}
    return classed.split(
        replace(recording, sources=sources), told, float={"correlated": LASTING, **noise}
    )


def run(motion, seed, off=OFF):
    """The CarrierRun of one seed."""
    recording = simulated(motion, seed, off)
    solution = sd.fuse(recording, "closed-loop")
    path, t = solution.trajectory, solution.t
    errors = solution.errors(recording.reference)
    rows = states(t) == "float"
    inside = np.abs(errors.position[rows]) <= 3 * path.std[rows, :3]
    begins = [begin for begin, name in SCHEDULE if name == "wrong"]
    said = tuple(
        bool(np.any(solution.status[(t >= begin) & (t <= begin + SAID)] == DOUBTFUL))
        or any(begin <= at <= begin + SAID and "fixed" in event for at, event in solution.events)
        for begin in begins
    )
    before = t < begins[0]
    return CarrierRun(inside, said, float(np.mean(solution.status[before] == DOUBTFUL)))
