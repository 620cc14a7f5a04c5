"""A Tuning that is made up from two runs of a filter: a car whose stated noise is wrong."""

from dataclasses import replace
from functools import cache

import numpy as np
from installed import car

import strapdown as sd
from strapdown.data.solution import Correlated
from strapdown.tuning.findings import (
    AT_MAX,
    AT_MIN,
    KEPT,
    OPEN,
    TUNED,
    Direction,
    NoiseParameter,
    SourceFit,
    Tuning,
)
from strapdown.tuning.numbers import IMU, LASTING, OF_IMU, TIME, WHITE

SHEET = np.degrees(60.0)  # rad/sqrt(s) in deg/sqrt(h)


def scan(value, width=0.2, lower=True, upper=True):
    """A profile about a value; flat towards a side that is open."""
    values = value * np.geomspace(0.2, 5, 17)
    z = np.log(values / value) / width
    z = np.where((z < 0) & ~np.bool_(lower) | (z > 0) & ~np.bool_(upper), 0.1 * z, z)
    return values, np.minimum(z**2, 60.0)


def parameter(source, name, unit, factor, given, value, status, low=0.0, high=np.inf):
    curve = scan(value, lower=low > 0, upper=np.isfinite(high))
    what = next(k for k in (*OF_IMU, WHITE, LASTING, TIME) if name.startswith(k.name))
    part = name.removeprefix(what.name).strip()
    return NoiseParameter(source, what, part, unit, factor, given, value, low, high, status, curve)


def gnss(name="position"):
    """Parameters of a source of positions and one of velocities."""
    given, value = (0.5, 1.02) if name == "position" else (0.05, 0.1)
    return (
        parameter(
            f"GNSS {name}",
            "noise horizontal",
            "m",
            1.0,
            given,
            value,
            TUNED,
            0.9 * value,
            1.1 * value,
        ),
        parameter(f"GNSS {name}", "noise vertical", "m", 1.0, 0.75, 0.75, KEPT, 0.3, 0.6),
        parameter(
            f"GNSS {name}", "correlated error horizontal", "m", 1.0, 0.0, 1.5, TUNED, 1.2, 1.9
        ),
        parameter(f"GNSS {name}", "correlation time", "s", 1.0, 0.0, 30.0, AT_MIN, 12.0),
    )


@cache
def tuning(seconds=80.0):
    """Of a car that was read with half of its standard deviations."""
    right = car(1080, seconds, vehicle=False)
    wrong = replace(right, sources=tuple(replace(a, std=a.std / 2) for a in right.sources))
    wrong = replace(wrong, meta=right.meta | {"name": "drive", "notes": []})
    return of(wrong, (2.0, 2.0, 2.4))


def of(wrong, factors):
    """The Tuning of a recording whose first source is changed by these factors."""
    spec = sd.imu("consumer")
    imu = replace(spec, gyro=replace(spec.gyro, noise=1.4 * spec.gyro.noise))
    first, *others = wrong.sources
    first = replace(first, std=first.std * factors, correlated=Correlated((1.5, 1.5, 2.5), 30.0))
    tuned = replace(wrong, sources=(first, *(replace(a, std=2 * a.std) for a in others)))
    # not with states that the loop may lack
    run = replace(tuned, sources=(replace(first, correlated=None), *tuned.sources[1:]))
    noise, walk = spec.gyro.noise, 1e-6
    return Tuning(
        (
            parameter(
                IMU, "gyro noise", "deg/sqrt(h)", SHEET, noise, 1.4 * noise, TUNED, noise, 2 * noise
            ),
            parameter(
                IMU,
                "gyro bias walk",
                "deg/h/sqrt(h)",
                3600 * SHEET,
                walk,
                walk,
                AT_MAX,
                high=3 * walk,
            ),
            parameter(IMU, "accel bias walk", "mg/sqrt(h)", 6118.0, 1e-5, 1e-5, OPEN),
            *gnss(),
        ),
        (
            Direction(
                {"GNSS position noise horizontal": 0.7, "gyro noise": -0.7},
                5.0,
                "GNSS position noise horizontal against gyro noise: the data determine only their sum",
            ),
        ),
        (
            SourceFit("GNSS position", (3.9, 1.02), (0.1, 0.05), (0.12, 0.004)),
            SourceFit("GNSS velocity", (4.1, 0.9), (0.6, 0.54), (0.2, 0.01)),
        ),
        wrong,
        tuned,
        imu,
        (-1200.0, -388.0),
        43,
        tuple(wrong.span),
        sd.fuse(wrong, imu="consumer"),
        sd.fuse(run, imu=imu),
        ("3 of 800 fixes are outliers and are ignored",),
    )
