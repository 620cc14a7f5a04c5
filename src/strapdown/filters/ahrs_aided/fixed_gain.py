"""Observer of position, velocity and accelerometer bias with fixed gains; its attitude is that of
an AHRS. No covariance, so no standard deviations.

Per axis, north and east alike: p' = v + k1 e, v' = C (f - b) + g + k2 e, C b' = -k3 e with the
error e of a position; of a velocity v' = ... + kv1 e, C b' = -kv2 e. Between fixes it is an INS; at
a fix the error is multiplied as those poles say for the time since the last fix, whatever the rate.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...core.contract import (
    ALTITUDE_KIND,
    ATTITUDE_KIND,
    CORRECT,
    MOST_STATES,
    POSITION_KIND,
    PREDICT,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Start,
    helper,
    kernel,
    matrix,
)
from ...core.earth import displace
from ...core.error_state import bias_free, observed, publish_rates
from ...core.mechanization import mechanize
from ...core.rotation import euler_to_matrix, measured_heading
from ...typing import Array

POLES = Slots()
"""Of an axis, 1/s. A pair is (a, b, complex): a and b, or a +- jb."""
THIRD = POLES.number("THIRD")  # of positions, a pole and a pair
PAIR = POLES.array("PAIR", 3)
VELOCITY_PAIR = POLES.array("VELOCITY_PAIR", 3)
SLOTS = Slots()
HORIZONTAL = SLOTS.part("HORIZONTAL", POLES)
VERTICAL = SLOTS.part("VERTICAL", POLES)
SINCE = SLOTS.array("SINCE", 6)  # s since the last position and velocity fix, north, east, down
FORCE = SLOTS.array("FORCE", 3)  # specific-force increment, m/s
CHANGE = SLOTS.array("CHANGE", 9)  # of position, velocity and bias in n, by a fix
JACOBIAN = SLOTS.matrix("JACOBIAN", 3, MOST_STATES)  # H, which is not used
SHORTEST_FIX_INTERVAL = 1e-6  # s: of two fixes at one time the second changes nothing


def start(
    start: Start,
    noise: Noise,
    k1: float = 0.7,
    k2: float = 0.14,
    k3: float = 0.008,
    l1: float = 0.7,
    l2: float = 0.14,
    l3: float = 0.008,
    kv1: float = 0.5,
    kv2: float = 0.04,
    lv1: float = 0.5,
    lv2: float = 0.04,
) -> Belief:
    """Belief at `start`. Gains: k1 (1/s), k2 (1/s^2), k3 (1/s^3) of a position's north and east,
    l1, l2, l3 of its height; kv1 (1/s), kv2 (1/s^2) of a velocity's north and east, lv1, lv2 of
    down. Without k3 (l3) and kv2 (lv2) the bias stays, without all of a kind that kind is not used.
    Refuses gains that are not stable.
    """
    workspace = SLOTS.zeros()
    for place, axes, of_position, of_velocity in (
        (HORIZONTAL, "horizontal", (k1, k2, k3), (kv1, kv2)),
        (VERTICAL, "vertical", (l1, l2, l3), (lv1, lv2)),
    ):
        _check(axes, of_position, of_velocity)
        third, *pair = sorted(poles(*of_position), key=lambda pole: (pole.imag != 0, pole.real))
        axis = workspace[place]
        axis[THIRD], axis[PAIR] = third.real, _pair(*pair)
        axis[VELOCITY_PAIR] = _pair(*np.roots([1.0, *of_velocity]))
    return start.belief(workspace)


def _pair(a: complex, b: complex) -> tuple[float, float, float]:
    """Two poles as three numbers."""
    return (a.real, abs(a.imag), 1.0) if a.imag else (a.real, b.real, 0.0)


def poles(
    k1: float, k2: float, k3: float, kv1: float = 0.0, kv2: float = 0.0
) -> NDArray[np.complex128]:
    """Poles (1/s) of the errors of an axis under these gains: s^3 + (k1 + kv1) s^2 + (k2 + kv2 + k1
    kv1) s + k3 + k1 kv2.

    A bias that no gain corrects has one at 0.
    """
    return np.roots([1.0, k1 + kv1, k2 + kv2 + k1 * kv1, k3 + k1 * kv2]).astype(complex)


def fastest_turn(k1: float, k2: float, k3: float) -> float:
    """Rate (rad/s) of a steady turn up to which those gains of a position estimate the
    horizontal bias; beyond, it swings up: it turns in n meanwhile."""
    return (k1 * k2 - k3) / (k1 * math.sqrt(k2))


def _check(
    axes: str, of_position: tuple[float, float, float], of_velocity: tuple[float, float]
) -> None:
    """Raise ValueError where the gains of an axis are no numbers, or do not make position,
    velocity and bias settle."""
    gains = (*of_position, *of_velocity)
    said = f"the {axes} gains {', '.join(f'{gain:g}' for gain in of_position)} of positions and {', '.join(f'{gain:g}' for gain in of_velocity)} of velocities"
    if not np.isfinite(gains).all():
        raise ValueError(f"{said}: they must be finite numbers")
    if not any(gains):
        raise ValueError(f"{said}: nothing is corrected; give some of them above zero")
    alone = [("position", of_position, of_position[2]), ("velocity", of_velocity, of_velocity[1])]
    found = [(name, np.roots([1.0, *used]), last) for name, used, last in alone if any(used)]
    if len(found) == 2:
        found.append(("both", poles(*gains), of_position[2] or of_velocity[1]))
    for name, roots, last in found:
        # a bias without gain stands still
        settling = np.delete(roots, np.argmin(np.abs(roots))) if not last else roots
        if not (settling.real < 0).all():
            raise ValueError(
                f"{said} are not stable: poles with {name} "
                f"{', '.join(f'{pole:.3g}' for pole in roots)} 1/s; "
                "all must be above zero, and the product of the first two above the third"
            )


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Advance the INS; the gyros carry the attitude on until the next record."""
    workspace, since = belief.workspace, belief.workspace[SINCE]
    r0, r1, r2, a0, a1, a2 = bias_free(u, belief.ba, belief.bg, dt)
    mechanize(belief.lla, belief.v, belief.C, r0, r1, r2, a0, a1, a2, dt, workspace[FORCE])
    for i in range(6):
        since[i] += dt
    publish_rates(belief, r0, r1, r2, a0, a1, a2, dt)


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Take over an attitude; pull position, velocity and bias to any other fix. It does not
    gate."""
    workspace, C, n = belief.workspace, belief.C, belief.P.shape[0]
    observed(belief, y, observe, parameters, innovation, matrix(workspace, JACOBIAN, 3, n))
    change = workspace[CHANGE]
    for i in range(9):
        change[i] = 0.0
    if kind == ATTITUDE_KIND:
        if not math.isnan(innovation[0]):
            euler_to_matrix(y[0], y[1], measured_heading(y, C), C)
        return math.nan
    if kind == ALTITUDE_KIND:
        _pull(workspace, 2, 0, innovation[0], change)
    else:
        for axis in range(3):
            _pull(workspace, axis, 0 if kind == POSITION_KIND else 3, innovation[axis], change)
    displace(belief.lla, change[0], change[1], change[2])
    for i in range(3):
        belief.v[i] += change[3 + i]
        belief.ba[i] -= C[0, i] * change[6] + C[1, i] * change[7] + C[2, i] * change[8]
    return math.nan


@helper
def _pull(workspace: Array, axis: int, kind: int, e: float, change: Array) -> None:
    """What an error e (m, or m/s where kind is 3) of a fix changes on that axis: the gains that
    give the sampled error the poles' factors exp(s T)."""
    since, poles = (
        workspace[SINCE],
        workspace[VERTICAL.start if axis == 2 else HORIZONTAL.start :],
    )
    T = since[kind + axis]
    if math.isnan(e) or T < SHORTEST_FIX_INTERVAL:
        return
    since[kind + axis] = 0.0
    if kind == 0:
        third, (two, product) = _factor(poles[THIRD], T), _factors(poles[PAIR], T)
        g1, g3 = -third - two, -third * product / (T * T)
        g2 = (
            third * two + product
        ) / T - 0.5 * g3 * T  # of the state before the fix; change is that after it
        change[axis] = (g1 - T * g2 + 0.5 * T * T * g3) * e
        change[3 + axis], change[6 + axis] = (g2 - T * g3) * e, g3 * e
    else:
        two, product = _factors(poles[VELOCITY_PAIR], T)
        change[3 + axis], change[6 + axis] = -(two + product) * e, product / T * e


@helper
def _factor(pole: float, T: float) -> float:
    """exp(s T) - 1 of a real pole; one that is faster than the fixes counts as 1/T, which keeps
    fixes of two kinds from overshooting together."""
    return math.expm1(max(pole * T, -1.0))


@helper
def _factors(pair: Array, T: float) -> tuple[float, float]:
    """Sum and product of exp(s T) - 1 of two poles, likewise."""
    if pair[2] == 0:
        first, second = _factor(pair[0], T), _factor(pair[1], T)
        return first + second, first * second
    slower = T / max(T * math.hypot(pair[0], pair[1]), 1.0)
    size = math.exp(pair[0] * slower)
    x, y = size * math.cos(pair[1] * slower) - 1, size * math.sin(pair[1] * slower)
    return 2 * x, x * x + y * y


FIXED_GAIN = Filter(
    "fixed-gain",
    "Fossen (2021) section 14.3.1",
    start,
    predict,
    correct,
    slots=SLOTS,
    states=(),
    estimates=tuple(range(12)),
    uses=("position", "velocity", "altitude", "attitude"),
    needs=("attitude",),
)
