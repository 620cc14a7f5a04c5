"""How often the checks are wrong: false alarms on right simulations, and mistakes that they miss.
`pytest -m deep -s tests/inspection/test_rates.py` prints the figures of docs/how-to/inspect.md."""

from dataclasses import replace

import bent
import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import Source
from strapdown.geometry.geodesy import displace_lla
from strapdown.inspection.all import check
from strapdown.sensor_models.gnss import Gnss

pytestmark = pytest.mark.deep
MOTIONS = {
    "car": lambda seed: sd.simulate("car", duration=240.0, seed=seed),
    "flight": lambda seed: sd.simulate("demo", duration=300.0, imu="tactical", seed=seed),
    "ship": lambda seed: sd.simulate("ship", duration=600.0, seed=seed),
    "hand-held": lambda seed: sd.simulate("hand-held", seed=seed, gnss=Gnss(interval=0.2)),
}


def in_radians(v):
    """The course in rad, read as deg."""
    course = np.radians(np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi))
    speed = np.hypot(v[:, 0], v[:, 1])
    return np.c_[speed * np.cos(course), speed * np.sin(course), v[:, 2]]


def repeating(recording):
    """Each fix twice."""

    def twice(a):
        t = (a.t[:, None] + [0.0, 0.5 * np.median(np.diff(a.t))]).ravel()
        return replace(a, t=t, y=np.repeat(a.y, 2, axis=0), std=np.repeat(a.std, 2, axis=0))

    return bent.with_sources(recording, twice)


def drifting(recording):
    """Positions that drift north by 0.1 m/s."""

    def drift(a):
        north = 0.1 * (a.t - a.t[0])
        return replace(a, y=displace_lla(a.y, np.c_[north, 0 * north, 0 * north]))

    return bent.with_sources(recording, drift, ("position",))


def above_the_geoid(recording):
    """With an altitude above the geoid, 47 m below the ellipsoidal height."""
    a = recording.sources[0]
    noise = np.random.default_rng(len(a.t)).normal(0, 2, (len(a.t), 1))
    altitude = Source("altitude", a.t, a.y[:, 2:] - 47 + noise, np.full((len(a.t), 1), 2.0))
    return replace(recording, sources=(*recording.sources, altitude))


MISTAKES = {
    **{
        f"clock of {name} {seconds:+g} s": (
            "clock",
            lambda r, s=seconds, k=kinds: bent.later(r, s, *k),
        )
        for name, kinds in (("all", ()), ("velocity", ("velocity",)), ("position", ("position",)))
        for seconds in (0.1, -0.25, 1.0, -18.0)
    },
    **{
        f"IMU turned by {degrees} deg": ("axes", lambda r, d=degrees: bent.imu(r, bent.turned(d)))
        for degrees in (90, 180, 270)
    },
    "IMU mirrored": ("axes", lambda r: bent.imu(r, np.diag([1, -1, 1]))),
    "ENU for NED": (
        "frame",
        lambda r: bent.velocity(r, lambda v: v[:, [1, 0, 2]] * [1, 1, -1]),
    ),
    "km/h": ("unit", lambda r: bent.velocity(r, lambda v: v * 3.6)),
    "knots": ("unit", lambda r: bent.velocity(r, lambda v: v / 0.514444)),
    "mm/s": ("unit", lambda r: bent.velocity(r, lambda v: v * 1e3)),
    "course in rad": ("unit", lambda r: bent.velocity(r, in_radians)),
    "height above the geoid": ("height", above_the_geoid),
    "repeated fixes": ("repeated", repeating),
    "drift of 0.1 m/s": ("lasting errors", drifting),
}
SEEDS, ALARM_SEEDS = range(11, 16), range(51, 101)


@pytest.mark.parametrize("motion", MOTIONS)
def test_false_alarms(motion):
    accused = [seed for seed in ALARM_SEEDS if check(MOTIONS[motion](seed)).reasons]
    print(f"\n{motion}: {len(accused)} of {len(ALARM_SEEDS)} right recordings accused {accused}")
    assert len(accused) <= 1


@pytest.mark.parametrize("motion", ["car", "flight", "ship"])
def test_mistakes_found(motion):
    right = [MOTIONS[motion](seed) for seed in SEEDS]
    found = named = 0
    for name, (cause, bend) in MISTAKES.items():
        reasons = [check(bend(recording)).reasons for recording in right]
        hits = sum(map(bool, reasons))
        first = sum(bool(each) and each[0].cause == cause for each in reasons)
        found, named = found + hits, named + first
        if first < len(right):
            print(f"\n{motion}, {name}: found {hits}, named first {first} of {len(right)}")
    total = len(MISTAKES) * len(right)
    print(f"\n{motion}: found {found}, named first {named} of {total}")
    # four of the 24 mistakes are clocks that a ship, which hardly accelerates, does not show
    assert found >= 0.8 * total and named >= 0.8 * total
