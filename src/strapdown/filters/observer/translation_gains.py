"""Gains of the translational motion observer at a fix: position, velocity and auxiliary force of an
axis, by a Riccati design, poles, or as given.

The chain p' = v, v' = f, f' = w is sampled between fixes exactly; what its error is multiplied by
at a fix is I - K C. The Riccati design is the difference equation at the fixes as they come, whose
limit at a steady interval is the gain that `observer_gains` prints.
"""

from ...core.compile.jit import helper
from ...core.compile.selection import any_of, where
from ...core.compile.workspace import Slots
from ...core.mathematics.elementary import exponential, exponential_less_one, sine_cosine
from ...typing import Array

TRANSLATION = Slots()
"""The translational motion observer's numbers; of three axes those that are no option."""
# s since the last fix that changed the axis, and since its last velocity fix
AGE = TRANSLATION.array("AGE", 3)
VELOCITY_AGE = TRANSLATION.array("VELOCITY_AGE", 3)
# m^2/s^2: variance of velocity that gaps in the samples brought, since the start; of it used
SPREAD = TRANSLATION.number("SPREAD")
USED = TRANSLATION.array("USED", 3)
DESIGN = TRANSLATION.number("DESIGN")  # which one
LOST = TRANSLATION.number("LOST")  # s without a velocity after which positions do its work
POLE = TRANSLATION.number("POLE")  # 1/s: one of its own
PAIR = TRANSLATION.array("PAIR", 3)  # 1/s: a pair as (a, b, complex): a and b, or a +- jb
GAINS = TRANSLATION.array("GAINS", 3)  # of a position (p, v, xi)
VELOCITY_GAINS = TRANSLATION.array("VELOCITY_GAINS", 3)
P = TRANSLATION.array("P", 18)  # three axes of 6 numbers: pp, pv, pf, vv, vf, ff
RICCATI, BY_POLES, GIVEN = range(3)
DESIGNS = {"riccati": RICCATI, "poles": BY_POLES, "given": GIVEN}
MIN_FIX_INTERVAL = 1e-6  # s: of two fixes of an axis at one time the second finds it no older
MIN_STD = 1e-4  # m, m/s


@helper
def fix_gains(
    own: Array,
    axis: int,
    velocity: bool,
    std: float,
    accel: float,
    wander: float,
    K: Array,
    measured: bool = True,
) -> None:
    """Into K, which arrives zeroed, the gains on position, velocity and force by which a position
    or velocity fix with that std corrects the axis, where it is measured.

    `accel` is the density of the accelerometer noise, m/s/sqrt(s), `wander` that of the force,
    m/s^2/sqrt(s). Several fixes at one time follow each other, one kind after the other.
    """
    design = int(own[DESIGN])
    if design == RICCATI:
        A = own[P][6 * axis : 6 * axis + 6]
        _by_riccati(own, A, axis, velocity, max(std, MIN_STD), accel, wander, K, measured)
    elif design == BY_POLES:
        _by_poles(own, axis, velocity, K, measured)
    else:
        k = own[VELOCITY_GAINS.start if velocity else GAINS.start :]
        for i in range(3):
            K[i] = where(measured, k[i], 0.0)
    if velocity:
        own[VELOCITY_AGE][axis] = where(measured, 0.0, own[VELOCITY_AGE][axis])


@helper
def _by_riccati(
    own: Array,
    A: Array,
    axis: int,
    velocity: bool,
    std: float,
    accel: float,
    wander: float,
    K: Array,
    measured: bool,
) -> None:
    """One step of the Riccati equation over the time since the last fix, and the correction by
    it."""
    age, used = own[AGE][axis], own[USED][axis]
    T, spread = where(measured, age, 0.0), where(measured, own[SPREAD] - used, 0.0)
    grow(A, T, wander * wander, accel * accel, spread)
    own[AGE][axis] = where(measured, 0.0, age)
    own[USED][axis] = where(measured, own[SPREAD], used)
    if velocity:
        h0, h1, h2, variance = A[1], A[3], A[4], A[3]
    else:
        h0, h1, h2, variance = A[0], A[1], A[2], A[0]
    scale = where(measured, 1 / (variance + std * std), 0.0)
    k0, k1, k2 = scale * h0, scale * h1, scale * h2
    A[0] -= k0 * h0
    A[1] -= k0 * h1
    A[2] -= k0 * h2
    A[3] -= k1 * h1
    A[4] -= k1 * h2
    A[5] -= k2 * h2
    K[0], K[1], K[2] = k0, k1, k2


@helper
def grow(A: Array, T: float, q: float, accel: float, spread: float) -> None:
    """The six numbers of P over T seconds.

    Force is driven by density q ((m/s^2)^2/s), velocity by `accel` ((m/s)^2/s) and at once by
    `spread` (m^2/s^2).
    """
    pp, pv, pf, vv, vf, ff = A[0], A[1], A[2], A[3] + spread, A[4], A[5]
    A[0] = pp + T * (2 * pv + T * (vv + pf + T * (vf + T * (0.25 * ff + q * T / 20) + accel / 3)))
    A[1] = pv + T * (vv + pf + T * (1.5 * vf + 0.5 * accel + T * (0.5 * ff + q * T / 8)))
    A[2] = pf + T * (vf + T * (0.5 * ff + q * T / 6))
    A[3] = vv + T * (2 * vf + accel + T * (ff + q * T / 3))
    A[4] = vf + T * (ff + 0.5 * q * T)
    A[5] = ff + q * T


@helper
def _by_poles(own: Array, axis: int, velocity: bool, K: Array, measured: bool) -> None:
    """The gains that multiply the errors by exp(s T) over the time T since the last fix of the
    kind.

    While velocities come, their pair of poles is that of velocity and force and a position corrects
    the position alone, which keeps the poles whatever the two intervals; without them a position
    has all three.
    """
    ages, pair = own[VELOCITY_AGE.start if velocity else AGE.start :], own[PAIR]
    fresh = measured & (ages[axis] >= MIN_FIX_INTERVAL)
    T = where(fresh, ages[axis], 1.0)
    ages[axis] = where(measured, 0.0, ages[axis])
    if not any_of(fresh):
        return
    one, (two, product) = (
        exponential_less_one(own[POLE] * T),
        factors(pair[0], pair[1], int(pair[2]), T),
    )
    if velocity:
        K[1], K[2] = where(fresh, -(two + product), 0.0), where(fresh, product / T, 0.0)
        return
    helped = own[VELOCITY_AGE][axis] <= own[LOST]
    l1, l3 = -one - two, -one * product / (T * T)
    # of the error before the next prediction; K is of that after it
    l2 = (one * two + product) / T - 0.5 * l3 * T
    K[0] = where(fresh, where(helped, -one, l1 - T * l2 + 0.5 * T * T * l3), 0.0)
    K[1] = where(fresh & (not helped), l2 - T * l3, 0.0)
    K[2] = where(fresh & (not helped), l3, 0.0)


@helper
def factors(a: float, b: float, complex_pair: int, T: float) -> tuple[float, float]:
    """Sum and product of exp(s T) - 1 of a pair of poles, a and b, or a +- jb."""
    if complex_pair == 0:
        first, second = exponential_less_one(a * T), exponential_less_one(b * T)
        return first + second, first * second
    size, (s, c) = exponential(a * T), sine_cosine(b * T)
    x, y = size * c - 1, size * s
    return 2 * x, x * x + y * y
