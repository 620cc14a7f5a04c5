"""Functions shared by the sigma-point filters: the 15 error states, and the augmented states of
sources, through filters/sigma_point/sigma_points.py.

A sigma point is the belief with an error composed into it, as a correction is: metres, a rotation
vector from the left, sums. The errors of the propagated points are taken back the same way, about
the propagated belief. The square root is kept in workspace and factored anew where the loop changed
P. Points that would turn further than MAX_TURN are drawn in.
"""

import math
from collections.abc import Mapping

from ...core.compile.jit import flatten, helper, inline, lanes_of, matrix, sides
from ...core.compile.signatures import LANES
from ...core.loop.contract import (
    ATT,
    CORRECT,
    MAX_STATES,
    PREDICT,
    STATES,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    first_event,
    kernel,
)
from ...core.mathematics.earth import place
from ...core.mathematics.embedded import LLA, NAVIGATION, C as NAVIGATION_C, F, V, navigation
from ...core.mathematics.error_state import (
    add_error,
    bias_free,
    decay_biases,
    inject_all,
    observe_innovation,
    publish_rates,
    turn_half,
)
from ...core.mathematics.kalman import MIN_NOISE, decay
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import Three, nearest_turn, rotation_between, wrap
from ...typing import Array
from .sigma_points import correct_root, covariance, deviations, downdate, factor, triangle


@inline
def width(n: int) -> int:
    """Numbers in a row of a table of n columns."""
    return (n + 8) // 8 * 8


NOISES = 12
"""Components of the process noise: white noise of gyros and accelerometers, driving noise of
their biases."""
MAX_LANES = width(MAX_STATES)
MAX_ROWS = 2 * (STATES + 6) + 2 + NOISES + MAX_STATES - STATES
"""Rows of the table of propagated errors: pairs of points, their centre, noise and other states, and
one of workspace."""
SLOTS = Slots()
REPAIRED = SLOTS.output("repairs")  # so far
# sets of prediction and correction
STEP_SPREAD, STEP_REST, SPREAD, REST = SLOTS.numbers("STEP_SPREAD", "STEP_REST", "SPREAD", "REST")
AUGMENTED = SLOTS.number("AUGMENTED")  # 1 or 0: white noise has points of its own
POINT = SLOTS.part("POINT", NAVIGATION)  # a sigma point, and its augmented states
POINT_EXTRA = SLOTS.array("POINT_EXTRA", MAX_STATES - STATES)
CENTRE = SLOTS.part("CENTRE", NAVIGATION)  # the propagated belief
ERRORS = (
    STATES + 6
)  # numbers of the error of a point, with noise of rotation and velocity increments
EIGHT_NUMBERS = ERRORS + NAVIGATION.size
EIGHT = SLOTS.array("EIGHT", LANES * EIGHT_NUMBERS)  # eight points side by side: errors, states
FORCE = SLOTS.array("FORCE", 3)  # specific-force velocity increment in n, m/s
VARIANCE = SLOTS.array("VARIANCE", 3)  # of the noise of a fix
# the square root, n + 1 rows
ROOT = SLOTS.array("ROOT", MAX_LANES * (MAX_STATES + 1))
LEFT = SLOTS.array("LEFT", MAX_STATES * MAX_STATES)  # P as it was left: a change is noticed by it
ERROR = SLOTS.array("ERROR", MAX_LANES)  # of a point; of the mean
JACOBIAN = SLOTS.matrix("JACOBIAN", 3, MAX_STATES)  # H of a fix
SEEN = SLOTS.matrix("SEEN", 2 * MAX_STATES + 1, 3)  # innovations at the points
WORK = SLOTS.array("WORK", 3 * (MAX_STATES + 8))  # of `correct_root` and `downdate`
TABLE = SLOTS.array("TABLE", MAX_ROWS * MAX_LANES)  # of propagated errors
MAX_TURN = 0.5 * math.pi
"""Largest turn of a point, rad: beyond a quarter of a turn a larger error has less effect, as
that of its sine, and beyond half a turn the opposite."""


def begin(
    start: InitialState,
    step_set: tuple[float, float],
    fix_set: tuple[float, float],
    augmented: bool,
) -> FilterState:
    """The filter state at `start` of a sigma-point filter with these two (spread, rest). `augmented`: white
    noise of the IMU has points of its own."""
    workspace = SLOTS.zeros()
    workspace[STEP_SPREAD], workspace[STEP_REST] = step_set
    workspace[SPREAD], workspace[REST] = fix_set
    workspace[AUGMENTED] = augmented
    return start.belief(workspace)


@inline
def _point(belief: FilterState) -> FilterState:
    """The sigma point, as a FilterState of its own; P and workspace are those of `belief`."""
    workspace, more = belief.workspace, belief.augmented.size
    return navigation(workspace[POINT], belief.P, workspace, workspace[POINT_EXTRA][:more])


@inline
def _copy_navigation(belief: FilterState, lla: Array, v: Array, C: Array) -> None:
    for i in range(3):
        lla[i], v[i] = belief.lla[i], belief.v_n[i]
        C[i, 0], C[i, 1], C[i, 2] = belief.C_nb[i, 0], belief.C_nb[i, 1], belief.C_nb[i, 2]


@helper
def _refresh_root(belief: FilterState, n: int, lanes: int) -> None:
    """The square root of P, anew where P is not what was left."""
    workspace, numbers, left = belief.workspace, flatten(belief.P), belief.workspace[LEFT]
    changed = False
    for i in range(n * n):
        changed |= numbers[i] != left[i]
    if changed:
        workspace[REPAIRED] += factor(belief.P, n, lanes, workspace[ROOT])


@helper
def _drawn_in(workspace: Array, lanes: int, spread: float, rest: float) -> tuple[float, float]:
    """(spread, rest) of a set so close that no point turns by more than MAX_TURN; `rest` is
    that of the set with its alpha smaller (exactly so for kappa = 0)."""
    most, root = 0.0, workspace[ROOT]
    for i in range(9):
        row = lanes * i
        most = max(
            most,
            root[row + 6] * root[row + 6]
            + root[row + 7] * root[row + 7]
            + root[row + 8] * root[row + 8],
        )
    if not spread * spread * most > MAX_TURN * MAX_TURN:
        return spread, rest
    nearer = MAX_TURN / math.sqrt(most)
    return nearer, rest * (spread / nearer) ** 4


@helper
def _publish_covariance(belief: FilterState, n: int, lanes: int) -> None:
    """P from its square root, and the copy by which a change is noticed."""
    workspace, numbers, left = belief.workspace, flatten(belief.P), belief.workspace[LEFT]
    if n == 15:  # here and below the same code with constant lengths
        covariance(workspace[ROOT], 15, 16, belief.P)
    else:
        covariance(workspace[ROOT], n, lanes, belief.P)
    for i in range(n * n):
        left[i] = numbers[i]


@helper
def _reduce_rows(
    A: Array,
    pairs: int,
    still: int,
    rows: int,
    n: int,
    lanes: int,
    spread: float,
    rest: float,
    mean: Array,
) -> float:
    """`deviations` and `triangle`; the rows after 2 pairs + 1 are there already."""
    if n == 15:
        take = deviations(A, pairs, still, 16, spread, rest, mean)
        triangle(A, rows, 15, 16)
    else:
        take = deviations(A, pairs, still, lanes, spread, rest, mean)
        triangle(A, rows, n, lanes)
    return take


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """One IMU sample through all points. White noise has points of its own, or its rows are
    added, to first order in dt."""
    workspace, b_a, b_g, n = belief.workspace, belief.b_a, belief.b_g, belief.P.shape[0]
    lanes, augmented = width(n), workspace[AUGMENTED] > 0
    _refresh_root(belief, n, lanes)
    centre = navigation(workspace[CENTRE], belief.P, workspace, belief.augmented)
    lla, v, C = centre.lla, centre.v_n, centre.C_nb
    r, a = bias_free(u, b_a, b_g, dt)
    _copy_navigation(belief, lla, v, C)
    mechanize(lla, v, C, r, a, dt, workspace[FORCE])
    A, factored, pairs = workspace[TABLE], workspace[ROOT], STATES + (6 if augmented else 0)
    spread, rest = _drawn_in(workspace, lanes, workspace[STEP_SPREAD], workspace[STEP_REST])
    mean, root = workspace[ERROR], math.sqrt(dt)
    _spread_out(
        n,
        lanes,
        pairs,
        spread,
        belief,
        centre,
        r,
        a,
        dt,
        spread * root * noise.gyro,
        spread * root * noise.accel,
        decay(noise.accel_decay * dt),
        decay(noise.gyro_decay * dt),
    )
    rows = _noise_rows(n, lanes, 2 * pairs + 1, augmented, belief, dt, root, noise)
    take = _reduce_rows(
        A, pairs, n - STATES + (6 if augmented else 0), rows, n, lanes, spread, rest, mean
    )
    for i in range(n * lanes):
        factored[i] = A[i]
    if take > 0:
        for i in range(n):
            mean[i] *= take
        workspace[REPAIRED] += downdate(workspace[ROOT], mean, n, lanes, workspace[WORK])
        for i in range(n):
            mean[i] /= take
    for i in range(3):
        belief.lla[i], belief.v_n[i] = lla[i], v[i]
        belief.C_nb[i, 0], belief.C_nb[i, 1], belief.C_nb[i, 2] = C[i, 0], C[i, 1], C[i, 2]
    publish_rates(belief, r, a, dt)
    decay_biases(b_a, b_g, dt, noise)
    add_error(belief.lla, belief.v_n, belief.C_nb, mean)
    _publish_covariance(belief, n, lanes)


@helper
def _spread_out(
    n: int,
    lanes: int,
    pairs: int,
    spread: float,
    belief: FilterState,
    centre: FilterState,
    r: Three,
    a: Three,
    dt: float,
    gyro: float,
    accel: float,
    keep_a: float,
    keep_g: float,
) -> None:
    """The errors of the propagated points about the propagated belief, into the table: those
    with +, then those with -. Eight points at a time."""
    workspace, A, numbers = belief.workspace, belief.workspace[TABLE], belief.workspace[EIGHT]
    sine, cosine, M, N = place(centre.lla[0], centre.lla[2])
    for first in range(0, 2 * pairs, LANES):
        count = min(LANES, 2 * pairs - first)
        for k in range(count):
            _begin_point(first + k, k, lanes, pairs, spread, workspace, gyro, accel, keep_a, keep_g)
        for side in sides():
            eight = lanes_of(numbers, 0, EIGHT_NUMBERS, side)
            error, point = eight[:ERRORS], eight[ERRORS:]
            lla, v, C = point[LLA], point[V], matrix(point, NAVIGATION_C, 3, 3)
            _copy_navigation(belief, lla, v, C)
            add_error(lla, v, C, error)
            mechanize(
                lla,
                v,
                C,
                (
                    r[0] - dt * error[12] + error[15],
                    r[1] - dt * error[13] + error[16],
                    r[2] - dt * error[14] + error[17],
                ),
                (
                    a[0] - dt * error[9] + error[18],
                    a[1] - dt * error[10] + error[19],
                    a[2] - dt * error[11] + error[20],
                ),
                dt,
                point[F],
            )
            for i in range(3):
                error[3 + i] = v[i] - centre.v_n[i]
            error[0] = (lla[0] - centre.lla[0]) * M
            error[1] = wrap(lla[1] - centre.lla[1]) * N * cosine
            error[2] = centre.lla[2] - lla[2]
            error[6], error[7], error[8] = rotation_between(
                centre.C_nb,
                (C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2]),
            )
        for k in range(count):
            for i in range(9):
                A[lanes * (first + k) + i] = numbers[LANES * i + k]


@inline
def _begin_point(
    k: int,
    place: int,
    lanes: int,
    pairs: int,
    spread: float,
    workspace: Array,
    gyro: float,
    accel: float,
    keep_a: float,
    keep_g: float,
) -> None:
    """The error of point k, at its place among eight; into the table what of it only decays."""
    numbers, A, root = workspace[EIGHT], workspace[TABLE], workspace[ROOT]
    j, sign = (k, 1.0) if k < pairs else (k - pairs, -1.0)
    row = lanes * k
    for i in range(ERRORS):
        numbers[LANES * i + place] = 0.0
    for column in range(9, lanes):
        A[row + column] = 0.0
    if j < STATES:
        for i in range(STATES):
            numbers[LANES * i + place] = sign * spread * root[lanes * j + i]
        for column in range(9, lanes):
            A[row + column] = sign * spread * root[lanes * j + column]
        for i in range(3):
            A[row + 9 + i] *= keep_a
            A[row + 12 + i] *= keep_g
    else:
        numbers[LANES * j + place] = sign * (gyro if j < STATES + 3 else accel)


@helper
def _noise_rows(
    n: int,
    lanes: int,
    rows: int,
    augmented: bool,
    belief: FilterState,
    dt: float,
    root: float,
    noise: Noise,
) -> int:
    """Append the rows that have no points: augmented states, driving noise of the biases and,
    unless `augmented`, white noise. Returns the rows."""
    A, factored, force = (
        belief.workspace[TABLE],
        belief.workspace[ROOT],
        belief.workspace[FORCE],
    )
    for j in range(STATES, n):
        for lane in range(lanes):
            A[lanes * rows + lane] = factored[lanes * j + lane]
        rows += 1
    last = rows + (6 if augmented else NOISES)
    for i in range(lanes * rows, lanes * last):
        A[i] = 0.0
    for i in range(3):
        A[lanes * (rows + i) + 9 + i], A[lanes * (rows + 3 + i) + 12 + i] = (
            root * noise.accel_bias,
            root * noise.gyro_bias,
        )
    if not augmented:
        # the tilt grows over the sample in which it turns the specific force
        half = 0.5 * root * noise.gyro
        d0, d1, d2 = half * force[0], half * force[1], half * force[2]
        for i in range(3):
            turned, pushed = lanes * (rows + 6 + i), lanes * (rows + 9 + i)
            A[turned + 6 + i], A[pushed + 3 + i], A[pushed + i] = (
                root * noise.gyro,
                root * noise.accel,
                0.5 * dt * root * noise.accel,
            )
            A[turned + 3 + (i + 1) % 3] = -d2 if i == 0 else (-d0 if i == 1 else -d1)
            A[turned + 3 + (i + 2) % 3] = d1 if i == 0 else (d2 if i == 1 else d0)
    return last


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
    """One fix: `observe` at every point, the correction, its injection. Returns the NIS."""
    workspace, n = belief.workspace, belief.P.shape[0]
    lanes = width(n)
    _refresh_root(belief, n, lanes)
    factored, point, dx, H = (
        workspace[ROOT],
        _point(belief),
        workspace[ERROR],
        matrix(workspace, JACOBIAN, 3, n),
    )
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    spread, rest = _drawn_in(workspace, lanes, workspace[SPREAD], workspace[REST])
    E, variance = (
        matrix(workspace, SEEN, 2 * n + 1, rows),
        workspace[VARIANCE],
    )
    for a in range(rows):
        terms = 0.0
        for j in range(n):
            terms += H[a, j] * H[a, j] * belief.P[j, j]
        E[0, a], variance[a] = innovation[a], max(std[a] * std[a], MIN_NOISE * terms)
    _linear_innovations(E, H, rows, factored, n, lanes, spread)
    for k in range(2 * n):
        j, scale = (k, spread) if k < n else (k - n, -spread)
        for lane in range(lanes):
            dx[lane] = scale * factored[lanes * j + lane]
        _move_point(belief, point, dx)
        observe_innovation(point, y, observe, source, innovation, H)
        _unwrap_innovation(kind, rows, E, 1 + k, dx, H, innovation)
    nis, repaired = correct_root(
        workspace[ROOT],
        n,
        lanes,
        E,
        rows,
        spread,
        rest,
        variance,
        gate,
        innovation,
        workspace[WORK],
        dx,
    )
    workspace[REPAIRED] += repaired
    if nis <= gate:
        inject_all(belief, dx)
        _publish_covariance(belief, n, lanes)
        theta = dx[ATT]
        # the square root follows when it is used next
        turn_half(belief.P, theta[0], theta[1], theta[2])
    return nis


@helper
def _linear_innovations(
    E: Array, H: Array, rows: int, factored: Array, n: int, lanes: int, spread: float
) -> None:
    """Rows of E of all points by the H (rows, n) of the centre. They stay where nothing can be
    measured at a point, such as an airspeed at one that flies backwards."""
    for j in range(n):
        for a in range(rows):
            slope = 0.0
            for i in range(n):
                slope += H[a, i] * factored[lanes * j + i]
            E[1 + j, a], E[1 + n + j, a] = E[0, a] - spread * slope, E[0, a] + spread * slope


@helper
def _move_point(belief: FilterState, point: FilterState, dx: Array) -> None:
    """The point at an error dx from the belief, with the rate and specific force that its biases
    leave."""
    _copy_navigation(belief, point.lla, point.v_n, point.C_nb)
    add_error(point.lla, point.v_n, point.C_nb, dx)
    for i in range(3):
        point.b_a[i], point.b_g[i] = belief.b_a[i] + dx[9 + i], belief.b_g[i] + dx[12 + i]
        point.f[i], point.omega[i] = belief.f[i] - dx[9 + i], belief.omega[i] - dx[12 + i]
    for i in range(belief.augmented.size):
        point.augmented[i] = belief.augmented[i] + dx[STATES + i]


@helper
def _unwrap_innovation(
    kind: int, rows: int, E: Array, row: int, dx: Array, H: Array, innovation: Array
) -> None:
    """Row `row` of E: the innovation at a point dx away, a heading or the rotation vector of an
    attitude on the branch that the Jacobian expects there; as it is where there is none."""
    if kind == Kind.HEADING or kind == Kind.COURSE:
        near = _by_attitude(E, H, dx, 0)
        innovation[0] = near + wrap(innovation[0] - near)
    elif kind == Kind.ATTITUDE and innovation[2] == innovation[2]:
        innovation[0], innovation[1], innovation[2] = nearest_turn(
            innovation[0],
            innovation[1],
            innovation[2],
            _by_attitude(E, H, dx, 0),
            _by_attitude(E, H, dx, 1),
            _by_attitude(E, H, dx, 2),
        )
    for a in range(rows):
        if innovation[a] == innovation[a]:
            E[row, a] = innovation[a]


@helper
def _by_attitude(E: Array, H: Array, dx: Array, a: int) -> float:
    """Component a of the innovation at a point dx away, by its attitude alone."""
    return E[0, a] - (H[a, 6] * dx[6] + H[a, 7] * dx[7] + H[a, 8] * dx[8])


def repairs(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where the covariance was none and had to be made one again."""
    count = columns[SLOTS.columns[REPAIRED]]
    return first_event(
        t,
        count > 0,
        f"covariance not positive definite, repaired {count[-1:].sum():.0f} times from here on: "
        f"its standard deviations are not to be relied on",
    )
