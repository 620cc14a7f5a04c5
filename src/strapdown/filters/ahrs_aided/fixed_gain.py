"""Observer of position, velocity and accelerometer bias with fixed gains; its attitude is that of
an AHRS.

Per axis, north and east alike: p' = v + k1 e, v' = C (f - b) + g + k2 e, C b' = -k3 e with the
error e of a position; of a velocity v' = ... + kv1 e, C b' = -kv2 e. Between fixes it is an INS; at
a fix the error is multiplied as those poles say for the time since the last fix, whatever the rate.
The covariance is what those gains leave of the errors of IMU, fixes and attitude; it weighs nothing,
but says whether a fix is plausible.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...checks import check_number
from ...core.loop.contract import (
    CORRECT,
    MAX_STATES,
    PREDICT,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.earth import displace
from ...core.mathematics.error_state import bias_free, observe_innovation, publish_rates
from ...core.mathematics.joseph import (
    JOSEPH,
    SECONDS,
    await_step,
    carry,
    has_new_noise,
    joseph_update,
    test,
)
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import euler_to_matrix, measured_heading
from ...typing import Array

POLES = Slots()
"""Poles of an axis, 1/s. A pair is (a, b, complex): a and b, or a +- jb."""
THIRD = POLES.number("THIRD")  # of positions, a pole and a pair
PAIR = POLES.array("PAIR", 3)
VELOCITY_PAIR = POLES.array("VELOCITY_PAIR", 3)
SLOTS = Slots()
HORIZONTAL = SLOTS.part("HORIZONTAL", POLES)
VERTICAL = SLOTS.part("VERTICAL", POLES)
SINCE = SLOTS.array("SINCE", 6)  # s since the last position and velocity fix, north, east, down
FORCE = SLOTS.array("FORCE", 3)  # specific-force increment, m/s
CHANGE = SLOTS.array("CHANGE", 9)  # of position, velocity and bias in n, by a fix
GAIN = SLOTS.array("GAIN", 9)  # on the three, of each axis, by a fix
JACOBIAN = SLOTS.matrix("JACOBIAN", 3, MAX_STATES)  # H
CORRELATION = SLOTS.number("CORRELATION")  # s for which the errors of attitudes are alike
SINCE_TILT, SINCE_HEADING = SLOTS.numbers("SINCE_TILT", "SINCE_HEADING")  # s since each
A = SLOTS.matrix("A", 3, STATES)  # of core.mathematics.joseph.spread
B = SLOTS.matrix("B", 3, STATES)
R = SLOTS.matrix("R", 3, 3)
OWN = SLOTS.part("OWN", JOSEPH)
MIN_FIX_INTERVAL = 1e-6  # s: of two fixes at one time the second changes nothing


def start(
    start: InitialState,
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
    correlation: float = 0.0,
) -> FilterState:
    """The filter state at `start`. Gains: k1 (1/s), k2 (1/s^2), k3 (1/s^3) of a position's north and east,
    l1, l2, l3 of its height; kv1 (1/s), kv2 (1/s^2) of a velocity's north and east, lv1, lv2 of
    down. Without k3 (l3) and kv2 (lv2) the bias stays, without all of a kind that kind is not used.
    Refuses gains that are not stable. correlation: time constant (s) of the errors of attitude
    records, for the covariance; 0 for errors that are new with each record.
    """
    check_number(correlation, "correlation", "s", least=0)
    workspace = SLOTS.zeros()
    workspace[CORRELATION] = correlation
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
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance the INS; the gyros carry the attitude on until the next record."""
    workspace, since = belief.workspace, belief.workspace[SINCE]
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    if has_new_noise(workspace[OWN], noise):
        _step(belief)
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, workspace[FORCE])
    for i in range(6):
        since[i] += dt
    workspace[SINCE_TILT] += dt
    workspace[SINCE_HEADING] += dt
    publish_rates(belief, r, a, dt)
    if dt > 0 and await_step(workspace[OWN], belief.omega, belief.f, dt, noise):
        _step(belief)


@helper
def _step(belief: FilterState) -> None:
    """P over the samples since its last step."""
    own = belief.workspace[OWN]
    if own[SECONDS] > 0:
        carry(belief.P, own, belief.lla, belief.v_n, belief.C_nb)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Take over an attitude; pull position, velocity and bias to any other fix, unless it is
    further off than the covariance allows. Returns the NIS."""
    workspace, C, n = belief.workspace, belief.C_nb, belief.P.shape[0]
    H, own, change = matrix(workspace, JACOBIAN, 3, n), workspace[OWN], workspace[CHANGE]
    _step(belief)
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    nis = test(belief.P, own, H, innovation, std, rows)
    if not nis <= gate:
        return nis
    if kind == Kind.ATTITUDE:
        if not math.isnan(innovation[0]):
            _renew(belief, y, std)
            euler_to_matrix(y[0], y[1], measured_heading(y, C), C)
        return nis
    K = workspace[GAIN]
    for i in range(9):
        change[i] = K[i] = 0.0
    for row in range(1 if kind == Kind.ALTITUDE else 3):
        axis = 2 if kind == Kind.ALTITUDE else row
        if not math.isnan(innovation[row]):
            _pull(workspace, axis, 0 if kind != Kind.VELOCITY else 3, K)
            for i in range(3):
                change[3 * i + axis] = K[3 * i + axis] * innovation[row]
    _account(belief, std, kind, innovation, H)
    displace(belief.lla, change[0], change[1], change[2])
    for i in range(3):
        belief.v_n[i] += change[3 + i]
        belief.b_a[i] -= C[0, i] * change[6] + C[1, i] * change[7] + C[2, i] * change[8]
    return nis


@helper
def _clear(workspace: Array) -> None:
    """A, B and R, which lie one behind the other, are zero."""
    for i in range(A, R + 9):
        workspace[i] = 0.0


@helper
def _account(belief: FilterState, std: Array, kind: int, innovation: Array, H: Array) -> None:
    """P by the gains of the rows of this fix that were measured."""
    workspace, C = belief.workspace, belief.C_nb
    a, b, r, K = (
        matrix(workspace, A, 3, STATES),
        matrix(workspace, B, 3, STATES),
        matrix(workspace, R, 3, 3),
        workspace[GAIN],
    )
    _clear(workspace)
    for row in range(1 if kind == Kind.ALTITUDE else 3):
        axis = 2 if kind == Kind.ALTITUDE else row
        if math.isnan(innovation[row]):
            continue
        r[row, row], a[row, axis], a[row, 3 + axis] = std[row] * std[row], -K[axis], -K[3 + axis]
        for j in range(3):
            a[row, 9 + j] = C[axis, j] * K[6 + axis]
        for j in range(STATES):
            b[row, j] = H[row, j]
    joseph_update(belief.P, workspace[OWN], a, b, r)


@helper
def _renew(belief: FilterState, y: Array, std: Array) -> None:
    """P by an attitude (rad) that is taken over: its error is new but for what is alike in that of
    the last one; that of a heading which it lacks goes on."""
    workspace, heading = belief.workspace, measured_heading(y, belief.C_nb)
    a, b, r = (
        matrix(workspace, A, 3, STATES),
        matrix(workspace, B, 3, STATES),
        matrix(workspace, R, 3, 3),
    )
    _clear(workspace)
    ch, sh, forward, right = math.cos(heading), math.sin(heading), std[0] * std[0], std[1] * std[1]
    more, new = _renew_error(workspace, SINCE_TILT)
    r[0, 0], r[1, 1] = (
        more * (ch * ch * forward + sh * sh * right),
        more * (sh * sh * forward + ch * ch * right),
    )
    r[0, 1] = r[1, 0] = more * ch * sh * (forward - right)
    a[0, 6] = a[1, 7] = -new
    b[0, 6] = b[1, 7] = b[2, 8] = 1.0
    if not math.isnan(y[2]):
        more, new = _renew_error(workspace, SINCE_HEADING)
        a[2, 8], r[2, 2] = -new, more * std[2] * std[2]
    joseph_update(belief.P, workspace[OWN], a, b, r)


@helper
def _renew_error(workspace: Array, since: int) -> tuple[float, float]:
    """(factor of its variance, share) of what is new in the error of an attitude after the time
    since the last, which begins anew: it becomes `1 - share` of what it was."""
    T, correlation = workspace[since], workspace[CORRELATION]
    workspace[since] = 0.0
    new = -math.expm1(-T / correlation) if correlation > 0 else 1.0
    return (2 - new) / new if new > 0 else 0.0, new


@helper
def _pull(workspace: Array, axis: int, kind: int, K: Array) -> None:
    """Into K, which arrives zeroed, the gains of a fix (a velocity where kind is 3) on that axis:
    those that give the sampled error the poles' factors exp(s T)."""
    since, poles = (
        workspace[SINCE],
        workspace[VERTICAL.start if axis == 2 else HORIZONTAL.start :],
    )
    T = since[kind + axis]
    if T < MIN_FIX_INTERVAL:
        return
    since[kind + axis] = 0.0
    if kind == 0:
        third, (two, product) = _factor(poles[THIRD], T), _factors(poles[PAIR], T)
        g1, g3 = -third - two, -third * product / (T * T)
        g2 = (
            third * two + product
        ) / T - 0.5 * g3 * T  # of the state before the fix; K is of that after it
        K[axis], K[3 + axis], K[6 + axis] = g1 - T * g2 + 0.5 * T * T * g3, g2 - T * g3, g3
    else:
        two, product = _factors(poles[VELOCITY_PAIR], T)
        K[3 + axis], K[6 + axis] = -(two + product), product / T


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
    states=tuple(range(12)),
    estimates=tuple(range(12)),
    uses=("position", "velocity", "altitude", "attitude"),
    needs=("attitude",),
    weighs=False,
    good_for="an AHRS and gains that are known in advance",
    poor_for="positions that drift or jump: it follows without warning",
)
