"""Observations where parameters of the installation are states: what `position`, `velocity`, the
velocities of a vehicle and its heading see then, with the columns of H of all states.

The clock's state says that the fix held `age` s before the belief, and later by the difference of the
state to `clock`; see core/loop/stages/clock.py. What the arm and the clock do to the columns of the
attitude and of the biases is in them; what a gyro bias turns in that time, 1e-3 m/s with one of 1e-3 rad/s,
is left out.
"""

import math

from ..core.loop.contract import STATES, FilterState, SourceRow, helper
from ..core.mathematics.rotation import Three, axis, cross, dot, rotate_vector
from ..typing import Array, Ints


@helper
def turned_back(C: Array, a: Three) -> Three:
    """C' a."""
    return (
        C[0, 0] * a[0] + C[1, 0] * a[1] + C[2, 0] * a[2],
        C[0, 1] * a[0] + C[1, 1] * a[1] + C[2, 1] * a[2],
        C[0, 2] * a[0] + C[1, 2] * a[1] + C[2, 2] * a[2],
    )


@helper
def any_of(belief: FilterState, source: SourceRow) -> bool:
    """True where any parameter of the installation of a source is a state. Tests the filter first,
    because firmware has no such states, and skips the rest then."""
    return belief.augmented.size > 0 and source.estimated > 0


@helper
def error(belief: FilterState, state: int) -> float:
    """The estimated error of a parameter; 0 of one that is no state."""
    return belief.augmented[state - STATES] if state > 0 else 0.0


@helper
def errors(belief: FilterState, states: Ints) -> Three:
    """Those of three parameters."""
    return error(belief, states[0]), error(belief, states[1]), error(belief, states[2])


@helper
def column(H: Array, state: int, by: Three) -> None:
    """Three rows of H: the derivatives by one parameter, where it is a state."""
    if state > 0:
        H[0, state], H[1, state], H[2, state] = by


@helper
def arm_of_vehicle(belief: FilterState, source: SourceRow) -> Three:
    """The lever arm with its error, in axes of the vehicle."""
    d = errors(belief, source.arm_state)
    return source.parameters[0] + d[0], source.parameters[1] + d[1], source.parameters[2] + d[2]


@helper
def arm_of_body(belief: FilterState, source: SourceRow) -> Three:
    """The same in axes of the body."""
    l = arm_of_vehicle(belief, source)
    by = cross(errors(belief, source.mounting_state), l)
    return l[0] - by[0], l[1] - by[1], l[2] - by[2]


@helper
def in_body(u: Three, belief: FilterState, source: SourceRow) -> Three:
    """A unit vector u of the vehicle, in the body: exp(-mu x) u, to second order."""
    mu = errors(belief, source.mounting_state)
    once = cross(u, mu)
    twice = cross(once, mu)
    return (
        u[0] + once[0] + 0.5 * twice[0],
        u[1] + once[1] + 0.5 * twice[1],
        u[2] + once[2] + 0.5 * twice[2],
    )


@helper
def by_mounting(u: Three, i: int, belief: FilterState, source: SourceRow) -> Three:
    """The derivative of `in_body` by component i of the mounting."""
    mu, turn = errors(belief, source.mounting_state), cross(u, axis(i))
    more, again = cross(turn, mu), cross(cross(u, mu), axis(i))
    return (
        turn[0] + 0.5 * (more[0] + again[0]),
        turn[1] + 0.5 * (more[1] + again[1]),
        turn[2] + 0.5 * (more[2] + again[2]),
    )


@helper
def along_arm(belief: FilterState, source: SourceRow, H: Array, swings: bool, rate: Three) -> None:
    """Columns of the lever arm and of the mounting, which turns it, of a position or, where the
    arm `swings` at a rate (rad/s, body), of a velocity."""
    C, M, l = belief.C_nb, source.turn, arm_of_vehicle(belief, source)
    for k in range(3):
        unit = axis(k)
        arm, turn = unit, cross(l, unit)
        if swings:
            arm, turn = cross(rate, arm), cross(rate, turn)
        column(H, source.arm_state[k], in_n(C, M, arm))
        column(H, source.mounting_state[k], in_n(C, M, turn))


@helper
def bias_since(belief: FilterState, source: SourceRow) -> Three:
    """The accelerometer bias less that of which `force`, `lag` and `force_then` are free, m/s^2: not zero at
    the points of a filter that tries some."""
    b = belief.b_a
    return (
        b[0] - source.bias_then[0],
        b[1] - source.bias_then[1],
        b[2] - source.bias_then[2],
    )


@helper
def in_n(C: Array, M: Array, x: Three) -> Three:
    """C M x: from the body at the instant of the fix to n."""
    y = rotate_vector(M, x[0], x[1], x[2])
    return rotate_vector(C, y[0], y[1], y[2])


@helper
def by_attitude(H: Array, x: Three) -> None:
    """Columns of the attitude of C times a vector, which is x in n."""
    H[0, 7], H[0, 8] = x[2], -x[1]
    H[1, 6], H[1, 8] = -x[2], x[0]
    H[2, 6], H[2, 7] = x[1], -x[0]


@helper
def position(belief: FilterState, source: SourceRow, innovation: Array, H: Array) -> None:
    """Correct an innovation y - p (m, NED) of an antenna's position, and its H, for the states of
    the installation."""
    C, M, v = belief.C_nb, source.turn, belief.v_n
    later = error(belief, source.clock_state) - source.clock
    age = source.age - later
    omega, l = rate_then(belief, source), arm_of_body(belief, source)
    swing = cross(omega, l)
    arm = rotate_vector(
        M, l[0] + later * swing[0], l[1] + later * swing[1], l[2] + later * swing[2]
    )
    F, Q, f = source.force, source.lag, source.force_then
    half, r = 0.5 * later * later, source.gravity
    bias, lag = bias_since(belief, source), -0.5 * age * age
    x = rotate_vector(
        C,
        arm[0] + Q[0] - later * F[0] + half * f[0] + lag * bias[0],
        arm[1] + Q[1] - later * F[1] + half * f[1] + lag * bias[1],
        arm[2] + Q[2] - later * F[2] + half * f[2] + lag * bias[2],
    )
    s = rotate_vector(M, swing[0], swing[1], swing[2])
    by_clock = rotate_vector(
        C,
        s[0] - F[0] + later * f[0] + age * bias[0],
        s[1] - F[1] + later * f[1] + age * bias[1],
        s[2] - F[2] + later * f[2] + age * bias[2],
    )
    for i in range(3):
        innovation[i] -= x[i] - age * v[i] + 0.5 * age * age * r[i]
        H[i, i], H[i, 3 + i] = 1.0, -age
        for j in range(3):  # what an accelerometer bias does to lag and force
            H[i, 9 + j] = lag * C[i, j]
    by_attitude(H, x)
    column(
        H,
        source.clock_state,
        (
            by_clock[0] + v[0] - age * r[0],
            by_clock[1] + v[1] - age * r[1],
            by_clock[2] + v[2] - age * r[2],
        ),
    )
    along_arm(belief, source, H, False, (0.0, 0.0, 0.0))


@helper
def rate_then(belief: FilterState, source: SourceRow) -> Three:
    """The angular rate at the instant of the fix, rad/s, body."""
    w = belief.omega
    return w[0] + source.rate[0], w[1] + source.rate[1], w[2] + source.rate[2]


@helper
def velocity(belief: FilterState, source: SourceRow, innovation: Array, H: Array) -> None:
    """Correct an innovation y - v (m/s, NED) of an antenna's velocity, and its H, for the states of
    the installation."""
    C, M = belief.C_nb, source.turn
    later = error(belief, source.clock_state) - source.clock
    age = source.age - later
    omega, l = rate_then(belief, source), arm_of_body(belief, source)
    swing = cross(omega, l)
    s, round_ = rotate_vector(M, swing[0], swing[1], swing[2]), cross(omega, swing)
    spun = cross((source.spin[0], source.spin[1], source.spin[2]), l)
    more = round_[0] + spun[0], round_[1] + spun[1], round_[2] + spun[2]
    F, f, r = (
        source.force,
        source.force_then,
        source.gravity,
    )
    bias, m = bias_since(belief, source), rotate_vector(M, more[0], more[1], more[2])
    x = rotate_vector(
        C,
        s[0] - F[0] + later * (f[0] + m[0]) + age * bias[0],
        s[1] - F[1] + later * (f[1] + m[1]) + age * bias[1],
        s[2] - F[2] + later * (f[2] + m[2]) + age * bias[2],
    )
    by_clock = rotate_vector(C, f[0] - bias[0] + m[0], f[1] - bias[1] + m[1], f[2] - bias[2] + m[2])
    for i in range(3):
        innovation[i] -= x[i] - age * r[i]
        H[i, 3 + i] = 1.0
        for j in range(3):  # what an accelerometer bias does to force
            H[i, 9 + j] = age * C[i, j]
        # of the gyro bias: C M [l x]
        a, b, c = (
            C[i, 0] * M[0, 0] + C[i, 1] * M[1, 0] + C[i, 2] * M[2, 0],
            C[i, 0] * M[0, 1] + C[i, 1] * M[1, 1] + C[i, 2] * M[2, 1],
            C[i, 0] * M[0, 2] + C[i, 1] * M[1, 2] + C[i, 2] * M[2, 2],
        )
        H[i, 12], H[i, 13], H[i, 14] = b * l[2] - c * l[1], c * l[0] - a * l[2], a * l[1] - b * l[0]
    by_attitude(H, x)
    column(
        H,
        source.clock_state,
        (by_clock[0] + r[0], by_clock[1] + r[1], by_clock[2] + r[2]),
    )
    along_arm(belief, source, H, True, omega)


@helper
def along(
    d: Three,
    row: int,
    belief: FilterState,
    y: Array,
    source: SourceRow,
    innovation: Array,
    H: Array,
) -> None:
    """One row: y - velocity of a point along a unit vector d of the vehicle, times 1 + scale."""
    v, arm = belief.v_n, (source.parameters[0], source.parameters[1], source.parameters[2])
    scale = 1.0 + error(belief, source.scale_state)
    speed = speed_along(d, arm, row, (v[0], v[1], v[2]), scale, belief, source, H)
    innovation[row] = y[row] - scale * speed
    if source.scale_state > 0:
        H[row, source.scale_state] = speed


@helper
def speed_along(
    d: Three,
    l: Three,
    row: int,
    v: Three,
    scale: float,
    belief: FilterState,
    source: SourceRow,
    H: Array,
) -> float:
    """Velocity of the point l (m, body) along a unit vector d of the vehicle, m/s, where that of the IMU is
    v in n now, and its row of H times a scale."""
    C, M, r = belief.C_nb, source.turn, source.gravity
    later = error(belief, source.clock_state) - source.clock
    age = source.age - later
    omega = rate_then(belief, source)
    w = v[0] - age * r[0], v[1] - age * r[1], v[2] - age * r[2]
    bias = bias_since(belief, source)
    b, swing = velocity_then(C, source, w, later, bias), cross(omega, l)
    rolled = cross(omega, b)
    spun = cross((source.spin[0], source.spin[1], source.spin[2]), l)
    b = (
        b[0] + swing[0] + later * (spun[0] - rolled[0]),
        b[1] + swing[1] + later * (spun[1] - rolled[1]),
        b[2] + swing[2] + later * (spun[2] - rolled[2]),
    )
    u = in_body(d, belief, source)
    speed = dot(u, b)
    c, by_force = in_n(C, M, u), rotate_vector(M, u[0], u[1], u[2])
    by_attitude_row, by_bias = cross(c, w), cross(u, l)
    for i in range(3):
        H[row, 3 + i] = scale * c[i]
        H[row, 6 + i] = scale * by_attitude_row[i]
        H[row, 9 + i] = scale * age * by_force[i]
        H[row, 12 + i] = scale * by_bias[i]
        if source.mounting_state[i] > 0:
            by = by_mounting(d, i, belief, source)
            H[row, source.mounting_state[i]] = scale * dot(b, by)
    if source.clock_state > 0:
        a = acceleration_then(C, source, bias)
        a = (
            a[0] - rolled[0] + spun[0],
            a[1] - rolled[1] + spun[1],
            a[2] - rolled[2] + spun[2],
        )
        H[row, source.clock_state] = scale * dot(u, a)
    return speed


@helper
def velocity_then(C: Array, source: SourceRow, w: Three, later: float, bias: Three) -> Three:
    """Velocity of the IMU at the instant of the measurement, in axes of the body then, m/s. `w` is
    that in n, without the specific force since."""
    F, f, age = source.force, source.force_then, source.age - later
    b = turned_back(C, w)
    b = (
        b[0] - F[0] + later * f[0] + age * bias[0],
        b[1] - F[1] + later * f[1] + age * bias[1],
        b[2] - F[2] + later * f[2] + age * bias[2],
    )
    return turned_back(source.turn, b)


@helper
def acceleration_then(C: Array, source: SourceRow, bias: Three) -> Three:
    """Acceleration of the IMU at the instant of the measurement, in axes of the body then, m/s^2."""
    f, r = source.force_then, source.gravity
    a = turned_back(C, (r[0], r[1], r[2]))
    return turned_back(
        source.turn, (a[0] + f[0] - bias[0], a[1] + f[1] - bias[1], a[2] + f[2] - bias[2])
    )


@helper
def heading(belief: FilterState, source: SourceRow, H: Array) -> float:
    """Heading of the x axis of the vehicle, rad, and its row of H."""
    C, u = belief.C_nb, in_body(axis(0), belief, source)
    n, e, d = rotate_vector(C, u[0], u[1], u[2])
    square = max(n * n + e * e, 1e-12)
    H[0, 6], H[0, 7], H[0, 8] = -d * n / square, -d * e / square, 1.0
    for k in range(3):
        if source.mounting_state[k] > 0:
            by = by_mounting(axis(0), k, belief, source)
            x = rotate_vector(C, by[0], by[1], by[2])
            H[0, source.mounting_state[k]] = (n * x[1] - e * x[0]) / square
    return math.atan2(e, n)
