"""Faults of a GNSS receiver, and of the start that a filter is given."""

import numpy as np

from .fault import GNSS, START, fault
from .raw import BEGINS, Raw, hold

FOOT, KNOT = 0.3048, 1852 / 3600
UNDULATION = 47.0
"""m by which the geoid lies above the ellipsoid."""


@fault("20 % of the fixes NaN", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        source.y[raw.rng.random(len(source.t)) < 0.2] = np.nan


@fault("some longitudes inf", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[::13, 1] = np.inf


@fault("10 % of the positions 0, 0, 0", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[5::10] = 0


@fault("all positions 0, 0, 0 from 90 s", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.y[position.from_fault()] = 0


# jumps, drifts, what is stuck


def _one_off(metres: float) -> None:
    @fault(f"one position {metres:g} m off", GNSS)
    def _(raw: Raw):
        position = raw.sources["position"]
        position.move((metres, 0, 0), position.from_fault(1))


def _jump(metres: float) -> None:
    @fault(f"position jumps by {metres:g} m for good", GNSS)
    def _(raw: Raw):
        position = raw.sources["position"]
        position.move((metres, 0, 0), position.from_fault())


for _metres in (10, 50):
    _one_off(_metres)
for _metres in (5, 10, 20, 50, 1000):
    _jump(_metres)


@fault("height jumps by 50 m for good", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.y[position.from_fault(), 2] += 50


def _drift(speed: float, consistent: bool) -> None:
    what = "position and velocity drift" if consistent else "position drifts"

    @fault(f"{what} by {speed:g} m/s", GNSS)
    def _(raw: Raw):
        position, velocity = raw.gnss
        away = np.zeros((len(position.t), 3))
        away[:, 0] = speed * np.clip(position.t - BEGINS, 0, None)
        position.move(away)
        if consistent:
            velocity.y[velocity.from_fault(), 0] += speed


for _speed in (0.1, 1.0):
    _drift(_speed, consistent=False)
for _speed in (0.1, 2.0):
    _drift(_speed, consistent=True)


def _frozen(name: str, kinds: tuple[str, ...]) -> None:
    @fault(name, GNSS)
    def _(raw: Raw):
        for source in raw.of(*kinds):
            hold(source.y, source.from_fault())


_frozen("position and velocity stuck", ("position", "velocity"))
_frozen("position stuck, velocity right", ("position",))
_frozen("velocity stuck, position right", ("velocity",))


@fault("velocity north stuck", GNSS)
def _(raw: Raw):
    velocity = raw.sources["velocity"]
    hold(velocity.y[:, 0], velocity.from_fault())


@fault("velocity is 0 from 90 s", GNSS)
def _(raw: Raw):
    velocity = raw.sources["velocity"]
    velocity.y[velocity.from_fault()] = 0


@fault("velocity 1 m/s off in north from 90 s", GNSS)
def _(raw: Raw):
    velocity = raw.sources["velocity"]
    velocity.y[velocity.from_fault(), 0] += 1


@fault("fixes alternate between antennas 1 m apart", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.move((1, 0, 0), np.arange(len(position.t)) % 2 == 0)


@fault("position rounded to 1e-4 deg", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    step = np.radians(1e-4)
    position.y[:, :2] = np.round(position.y[:, :2] / step) * step


# units, signs, frames


@fault("longitude sign wrong", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[:, 1] *= -1


@fault("latitude and longitude swapped", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.y = position.y[:, [1, 0, 2]]


@fault("latitude and longitude in deg", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.y[:, :2] = np.degrees(position.y[:, :2])


@fault("velocity up taken for down", GNSS)
def _(raw: Raw):
    raw.sources["velocity"].y[:, 2] *= -1


@fault("velocity north and east swapped", GNSS)
def _(raw: Raw):
    velocity = raw.sources["velocity"]
    velocity.y = velocity.y[:, [1, 0, 2]]


@fault("velocity in km/h", GNSS)
def _(raw: Raw):
    raw.sources["velocity"].y *= 3.6


@fault("velocity in knots", GNSS)
def _(raw: Raw):
    raw.sources["velocity"].y /= KNOT


@fault("height in feet", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[:, 2] /= FOOT


@fault("height is a depth", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[:, 2] *= -1


@fault("height above the geoid", GNSS)
def _(raw: Raw):
    raw.sources["position"].y[:, 2] -= UNDULATION


# time stamps


def _late(seconds: float) -> None:
    what = f"late by {seconds:g} s" if seconds > 0 else f"early by {-seconds:g} s"

    @fault(f"fixes {what}", GNSS)
    def _(raw: Raw):
        for source in raw.gnss:
            source.t = source.t + seconds


for _seconds in (0.1, 0.5, 2, -18, 604800):
    _late(_seconds)


@fault("velocity late by 0.5 s, position not", GNSS)
def _(raw: Raw):
    velocity = raw.sources["velocity"]
    velocity.t = velocity.t + 0.5


@fault("fixes a week later from 90 s", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        source.t = np.where(source.from_fault(), source.t + 604800, source.t)


@fault("fix stamps stand still from 90 s", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        source.t = np.minimum(source.t, BEGINS)


@fault("four fixes in the wrong order", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        rows = np.arange(len(source.t))
        rows[100:104] = rows[100:104][::-1]
        arrival = source.arrival.copy()
        source.take(rows)
        source.arrival = arrival


@fault("each fix twice", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        source.take(np.repeat(np.arange(len(source.t)), 2))


@fault("each fix ten times, with new stamps", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        step = np.median(np.diff(source.t)) / 10
        later = np.tile(np.arange(10) * step, len(source.t))
        source.take(np.repeat(np.arange(len(source.t)), 10))
        source.t = source.t + later
        source.arrival = source.arrival + later


# stated standard deviations


def _scaled(factor: float) -> None:
    @fault(f"sd stated {factor:g} times as large", GNSS)
    def _(raw: Raw):
        for source in raw.gnss:
            source.sd *= factor


for _factor in (0.1, 0.3, 10.0):
    _scaled(_factor)


@fault("sd 1e-9", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        source.sd[:] = 1e-9


def _sd_rows(name: str, value: float, rows: slice) -> None:
    @fault(name, GNSS)
    def _(raw: Raw):
        raw.sources["position"].sd[rows] = value


_sd_rows("sd 0 in one row", 0.0, slice(50, 51))
_sd_rows("sd NaN in a third", np.nan, slice(None, None, 3))
_sd_rows("sd inf in a third", np.inf, slice(None, None, 3))


@fault("sd negative", GNSS)
def _(raw: Raw):
    raw.sources["position"].sd *= -1


@fault("fixes come and go, with a tenth of their sd and twice their noise", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    position.move(2 * position.sd * raw.rng.standard_normal(position.y.shape))
    position.sd *= 0.1
    for source in raw.gnss:
        source.take((source.t < BEGINS) | (raw.rng.random(len(source.t)) < 0.3))


# what is not there, or not there where it is said to be


def _without(name: str, kinds: tuple[str, ...], start: float, stop: float) -> None:
    @fault(name, GNSS)
    def _(raw: Raw):
        for source in raw.of(*kinds):
            source.take((source.t < start) | (source.t >= stop))


_without("no GNSS for 60 s", ("position", "velocity"), BEGINS, BEGINS + 60)
_without("no GNSS from 60 s on", ("position", "velocity"), 60, np.inf)
_without("no velocity from 90 s on", ("velocity",), BEGINS, np.inf)


@fault("no GNSS at all", GNSS)
def _(raw: Raw):
    raw.sources = {k: s for k, s in raw.sources.items() if k not in ("position", "velocity")}


@fault("no velocity at all", GNSS)
def _(raw: Raw):
    del raw.sources["velocity"]


@fault("antenna arm 2 m off", GNSS)
def _(raw: Raw):
    for source in raw.gnss:
        forward, *others = source.parameters or (0.0, 0.0, 0.0)
        source.parameters = (forward + 2, *others)


@fault("multipath: 10 times the noise for 60 s", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    rows = position.from_fault(60)
    position.move(10 * position.sd[rows] * raw.rng.standard_normal((rows.sum(), 3)), rows)


@fault("multipath: 5 m, correlated over 60 s", GNSS)
def _(raw: Raw):
    position = raw.sources["position"]
    steps = np.exp(-np.diff(position.t) / 60)
    away = np.zeros((len(position.t), 3))
    for i, a in enumerate(steps, 1):
        away[i] = a * away[i - 1] + raw.rng.normal(0, 5 * np.sqrt(1 - a * a), 3)
    position.move(away)


# the start


@fault("start 180 deg off in heading", START)
def _(raw: Raw):
    raw.start = lambda start: start._replace(rph=(*start.rph[:2], start.rph[2] + np.pi))


@fault("start 1 km off", START)
def _(raw: Raw):
    raw.start = lambda start: start._replace(lla=(start.lla[0] + 1000 / 6371e3, *start.lla[1:]))


@fault("start 30 deg off in roll", START)
def _(raw: Raw):
    raw.start = lambda start: start._replace(rph=(start.rph[0] + np.radians(30), *start.rph[1:]))
