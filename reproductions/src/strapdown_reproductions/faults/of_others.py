"""Faults of a magnetometer, of an AHRS and of a second source of height."""

from collections.abc import Callable

import numpy as np

from .fault import AHRS, HEIGHT, KINDS, MAGNETOMETER, fault
from .raw import BEGINS, Fixes, Raw, hold

DEG = np.pi / 180


def _on(name: str, of: str) -> Callable[[Callable[[Fixes], None]], None]:
    """A fault that changes the one source of its kind."""

    def put(change: Callable[[Fixes], None]) -> None:
        fault(name, of)(lambda raw: change(raw.sources[KINDS[of][0]]))

    return put


# magnetometer


@_on("magnet of 50 uT beside it for 30 s", MAGNETOMETER)
def _(source: Fixes):
    source.y[source.from_fault(30)] += [0, 50e-6, 0]


@_on("hard iron of 10 uT from 90 s", MAGNETOMETER)
def _(source: Fixes):
    source.y[source.from_fault()] += [0, 10e-6, 0]


@_on("hard iron of 22 uT throughout", MAGNETOMETER)
def _(source: Fixes):
    source.y += [0, 20e-6, 10e-6]


@_on("magnetometer stuck", MAGNETOMETER)
def _(source: Fixes):
    hold(source.y, source.from_fault())


@_on("magnetometer sign wrong", MAGNETOMETER)
def _(source: Fixes):
    source.y *= -1


@_on("magnetometer z sign wrong", MAGNETOMETER)
def _(source: Fixes):
    source.y[:, 2] *= -1


@_on("magnetometer x and y swapped", MAGNETOMETER)
def _(source: Fixes):
    source.y = source.y[:, [1, 0, 2]]


@_on("magnetic field in gauss", MAGNETOMETER)
def _(source: Fixes):
    source.y *= 1e4


@_on("magnetic field in uT", MAGNETOMETER)
def _(source: Fixes):
    source.y *= 1e6


@_on("magnetometer scale 1.5", MAGNETOMETER)
def _(source: Fixes):
    source.y *= 1.5


@_on("magnetometer lost at 90 s", MAGNETOMETER)
def _(source: Fixes):
    source.take(~source.from_fault())


@_on("declination 10 deg off", MAGNETOMETER)
def _(source: Fixes):
    north, east, down = source.parameters
    c, s = np.cos(10 * DEG), np.sin(10 * DEG)
    source.parameters = (c * north - s * east, s * north + c * east, down)


@_on("a fifth of the magnetometer NaN", MAGNETOMETER)
def _(source: Fixes):
    source.y[::5] = np.nan


@_on("magnetometer sd stated a tenth", MAGNETOMETER)
def _(source: Fixes):
    source.sd /= 10


@_on("magnetometer late by 0.5 s", MAGNETOMETER)
def _(source: Fixes):
    source.t = source.t + 0.5


@fault("magnetometer spikes of 100 uT in 5 %", MAGNETOMETER)
def _(raw: Raw):
    source = raw.sources["magnetic-field"]
    rows = raw.rng.random(len(source.t)) < 0.05
    source.y[rows] += raw.rng.normal(0, 100e-6, (rows.sum(), 3))


# AHRS


@_on("AHRS heading 10 deg off", AHRS)
def _(source: Fixes):
    source.y[:, 2] += 10 * DEG


@_on("AHRS heading 10 deg off from 90 s", AHRS)
def _(source: Fixes):
    source.y[source.from_fault(), 2] += 10 * DEG


@_on("AHRS roll 5 deg off from 90 s", AHRS)
def _(source: Fixes):
    source.y[source.from_fault(), 0] += 5 * DEG


@_on("AHRS stuck", AHRS)
def _(source: Fixes):
    hold(source.y, source.from_fault())


@_on("AHRS heading stuck", AHRS)
def _(source: Fixes):
    hold(source.y[:, 2], source.from_fault())


@_on("AHRS lost at 90 s", AHRS)
def _(source: Fixes):
    source.take(~source.from_fault())


@_on("AHRS in deg", AHRS)
def _(source: Fixes):
    source.y /= DEG


@_on("AHRS pitch sign wrong", AHRS)
def _(source: Fixes):
    source.y[:, 1] *= -1


@_on("AHRS late by 0.5 s", AHRS)
def _(source: Fixes):
    source.t = source.t + 0.5


@_on("AHRS sd stated a tenth", AHRS)
def _(source: Fixes):
    source.sd /= 10


# second source of height


@_on("second height drifts by 0.2 m/s", HEIGHT)
def _(source: Fixes):
    source.y[:, 0] += 0.2 * np.clip(source.t - BEGINS, 0, None)


@_on("second height steps by 20 m", HEIGHT)
def _(source: Fixes):
    source.y[source.from_fault()] += 20


@_on("second height stuck", HEIGHT)
def _(source: Fixes):
    hold(source.y, source.from_fault())


@_on("second height in feet", HEIGHT)
def _(source: Fixes):
    source.y /= 0.3048


@_on("second height above the geoid", HEIGHT)
def _(source: Fixes):
    source.y -= 47
