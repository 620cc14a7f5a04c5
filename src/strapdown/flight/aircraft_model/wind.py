"""Turbulence: the Dryden gusts of MIL-F-8785C at low altitude, as discrete filters of white noise.
A compiled helper and its parameters.

The filters are exact at the sample times for a constant airspeed: the sampled gusts have the
continuous model's variance and correlation. The rates of pitch and yaw are the smoothed derivatives
of the vertical and lateral gust along the path, the air's own rotation (q = -dw/dx, r = dv/dx).
"""

import math

import numpy as np

from ...checks import check_choice, check_number
from ...core.compile.jit import helper, kernel
from ...core.compile.records import row_of, rows
from ...core.compile.signatures import REAL, reals, signature
from ...typing import Array

TURBULENCE_LEVELS = {"none": 0.0, "light": 15.0, "moderate": 30.0, "severe": 45.0}
"""Wind at 20 ft, kn, that the standard gives each level."""
GUST_STATES, NORMALS = 8, 6
"""Numbers of a gust filter's state (u | v, two lags and its mean | w, the same | p), and of
standard normals that it takes at each step."""
_FOOT, _KNOT = 0.3048, 1852 / 3600


class Turbulence:
    """Parameters of turbulence along u, v and w."""

    # standard deviations, m/s
    std_u: float
    std_v: float
    std_w: float
    # scale lengths, m
    length_u: float
    length_v: float
    length_w: float
    span: float  # of the wing, m


def turbulence(level: str = "light", height: float = 50.0, span: float = 3.0) -> Turbulence:
    """The Turbulence of a level (TURBULENCE_LEVELS) at `height` above ground (m) for a
    wing `span` (m). Raises DataError.

    MIL-F-8785C, 3.7.2: from 10 to 1000 ft; below and above, the values at the ends are kept.
    """
    check_choice(level, "turbulence", TURBULENCE_LEVELS)
    check_number(height, "height above ground", "m")
    check_number(span, "span in turbulence", "m", above=0, below=200)
    feet = min(max(height / _FOOT, 10.0), 1000.0)
    shape = 0.177 + 0.000823 * feet
    vertical = 0.1 * TURBULENCE_LEVELS[level] * _KNOT
    along = feet * _FOOT / shape**1.2
    made: Turbulence
    (made,) = rows(Turbulence, 1)
    made.std_u = made.std_v = vertical / shape**0.4
    made.std_w = vertical
    made.length_u = made.length_v = along
    made.length_w, made.span = feet * _FOOT, span
    return made


@helper
def _second_order(
    state: Array, first: int, x: float, std: float, n0: float, n1: float
) -> tuple[float, float]:
    """One step of std (1 + sqrt(3) s/l) / (1 + s/l)^2 over x = l dt: two equal lags in series, of
    variances 1 and 1/2; returns the gust before and after."""
    a = math.exp(-x)
    z1, z2 = state[first], state[first + 1]
    before = std * math.sqrt(0.5) * (math.sqrt(3.0) * z1 + (1 - math.sqrt(3.0)) * z2)
    noise = max(1 - a * a, 1e-300)
    cross = 0.5 - a * a * (x + 0.5)
    rest = 0.5 - a * a * (x * x + x + 0.5) - cross * cross / noise
    state[first] = a * z1 + math.sqrt(noise) * n0
    state[first + 1] = (
        a * (z2 + x * z1) + cross / math.sqrt(noise) * n0 + math.sqrt(max(rest, 0.0)) * n1
    )
    return before, std * math.sqrt(0.5) * (
        math.sqrt(3.0) * state[first] + (1 - math.sqrt(3.0)) * state[first + 1]
    )


@helper
def _slope(state: Array, at: int, before: float, after: float, dt: float, lag: float) -> float:
    """Rate of change of a gust smoothed by `lag` s, 1/s; state[at] is its smoothed value. Exact
    for a gust that changes linearly over dt."""
    a = math.exp(-dt / lag)
    state[at] = a * state[at] + (1 - a) * before + (after - before) * (1 - (1 - a) * lag / dt)
    return (after - state[at]) / lag


@helper
def roll_std(turbulence: Turbulence) -> float:
    """Standard deviation of the roll gust, rad/s: the closed form of the standard's spectrum."""
    b, L = turbulence.span, turbulence.length_w
    return (
        turbulence.std_w * math.pi * math.sqrt(0.1 / (b * L)) * (math.pi * L / (4 * b)) ** (1 / 6)
    )


GUST = signature(
    "gust",
    turbulence=row_of(Turbulence),
    state=reals("states"),
    normals=reals("normals"),
    airspeed=REAL,
    dt=REAL,
    wind=reals(9),
)


@kernel(GUST)
def gust(
    turbulence: Turbulence, state: Array, normals: Array, airspeed: float, dt: float, wind: Array
) -> None:
    """Advance the gust filter `state` (GUST_STATES,) by dt s with standard `normals` (NORMALS,) and
    write wind[3:9].

    Gust velocity (m/s) and rates (rad/s) in body axes; `airspeed` (m/s) is kept at 1 or above.
    """
    V = max(airspeed, 1.0)
    a = math.exp(-V * dt / turbulence.length_u)
    state[0] = a * state[0] + math.sqrt(1 - a * a) * normals[0]
    v0, v1 = _second_order(
        state, 1, V * dt / turbulence.length_v, turbulence.std_v, normals[1], normals[2]
    )
    w0, w1 = _second_order(
        state, 4, V * dt / turbulence.length_w, turbulence.std_w, normals[3], normals[4]
    )
    lag = 4 * turbulence.span / (math.pi * V)
    a = math.exp(-dt / lag)
    state[7] = a * state[7] + math.sqrt(1 - a * a) * normals[5]
    wind[3], wind[4], wind[5] = turbulence.std_u * state[0], v1, w1
    wind[6] = roll_std(turbulence) * state[7]
    wind[7], wind[8] = (
        -_slope(state, 6, w0, w1, dt, lag) / V,
        _slope(state, 3, v0, v1, dt, 0.75 * lag) / V,
    )


def begin(turbulence: Turbulence, normals: Array) -> Array:
    """The state (GUST_STATES,) of gusts that have always blown, from 6 standard normals; the
    smoothed gusts of pitch and yaw begin at the gusts."""
    u, v1, v2, w1, w2, p = normals
    state = np.array([u, v1, 0.5 * (v1 + v2), 0.0, w1, 0.5 * (w1 + w2), 0.0, p])
    for first, std in ((1, turbulence.std_v), (4, turbulence.std_w)):
        state[first + 2] = (
            std
            * math.sqrt(0.5)
            * (math.sqrt(3) * state[first] + (1 - math.sqrt(3)) * state[first + 1])
        )
    return state
