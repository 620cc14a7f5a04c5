"""The unscented Kalman filter of the six states, equations (23)-(32) of Mollaei et al., and the
cubature filter, in square-root form.

Prediction with augmented noise, (25): velocity and position noise are only added, so their sigma
points need no flight model; the cubature filter adds their covariance instead. Correction with
points drawn anew for the six states, (30)-(32). Square roots are those of
filters/sigma_point/sigma_points.py.
"""

import math
from collections.abc import Mapping
from typing import Any

from strapdown.checks import check_choice
from strapdown.core.compile.jit import helper, matrix
from strapdown.core.loop.contract import (
    CORRECT,
    PREDICT,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    kernel,
)
from strapdown.core.mathematics.rotation import Three
from strapdown.filters.sigma_point.sigma_points import (
    correct_root,
    covariance,
    deviations,
    downdate,
    factor,
    merwe,
    symmetric,
    triangle,
)
from strapdown.typing import Array

from .model import (
    SIX,
    Options,
    Q,
    X,
    begin,
    innovation_at,
    is_changed,
    keep,
    propagate_velocity,
    publish,
    random_walk,
    takes_options,
    turn,
    variance,
)

LANES, ROWS = 8, 20
LAYOUT = Slots()
"""Room for one prediction or correction."""
MEAN = LAYOUT.array("MEAN", LANES)
CHANGE = LAYOUT.array("CHANGE", 6)  # of the state by a fix; what is taken off a square root
WORK = LAYOUT.array("WORK", 48)
SLOTS = Slots(after=SIX)
REPAIRS = SLOTS.output("repaired square roots")  # so far
SETS = SLOTS.array("SETS", 3)  # of the prediction, see `through`; pairs of noise: 6 or none
SPREAD_6, REST_6 = SLOTS.numbers("SPREAD_6", "REST_6")  # of the correction
# 12 points, their centre, 6 of noise and workspace; the square root is its first 6 rows
S = SLOTS.array("S", LANES * ROWS)
E = SLOTS.matrix("E", 13, 3)  # innovations at 13 points
VARIANCES = SLOTS.array("VARIANCES", 3)
ROOM = SLOTS.part("ROOM", LAYOUT)
LEFT = SLOTS.matrix("LEFT", 6, 6)  # the covariance as the filter left it


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    sigma: str = "merwe",
    alpha: float = 0.1,
    beta: float = 2.0,
    kappa: float = 0.0,
    **shared: Any,
) -> FilterState:
    """The filter state at `start`. sigma: "merwe", the scaled set of (30) with alpha, beta and kappa, or
    "symmetric", that of (23); shared: Options."""
    check_choice(sigma, "sigma", ("merwe", "symmetric"))
    make = symmetric if sigma == "symmetric" else lambda states: merwe(states, alpha, beta, kappa)
    return _begin(start, Options(**shared), (*make(12), 6.0), make(6))


@takes_options
def start_cubature(start: InitialState, noise: Noise, **shared: Any) -> FilterState:
    """The filter state at `start` for the cubature filter; shared: Options."""
    return _begin(start, Options(**shared), (*symmetric(6), 0.0), symmetric(6))


def _begin(
    start: InitialState,
    options: Options,
    sets: tuple[float, float, float],
    corrected_by: tuple[float, float],
) -> FilterState:
    belief = begin(start, SLOTS, options)
    belief.workspace[SETS] = sets
    belief.workspace[SPREAD_6], belief.workspace[REST_6] = corrected_by
    return belief


def diagnose(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where a square root was repaired for the first time."""
    repairs = columns[SLOTS.columns[REPAIRS]]
    return [
        (float(t[k]), f"a square root was repaired, {repairs[-1]:.0f} times in all")
        for k in (repairs > 0).nonzero()[0][:1]
    ]


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Attitude by the gyros; state and covariance by sigma points through the IMU's increment or
    the aircraft's model."""
    turn(belief, u, dt)
    workspace = belief.workspace
    _renew_root(belief)
    x, A, sets, room = workspace[X], workspace[S], workspace[SETS], workspace[ROOM]
    workspace[REPAIRS] += through(belief, x, A, sets, room, noise, dt)
    _leave(belief)


@helper
def _renew_root(belief: FilterState) -> None:
    """Make the square root anew where somebody else changed the covariance, as at the start and
    where a gate was opened."""
    if is_changed(belief.P, matrix(belief.workspace, LEFT, 6, 6)):
        belief.workspace[REPAIRS] += factor(belief.P, 6, LANES, belief.workspace[S])


@helper
def _leave(belief: FilterState) -> None:
    """Publish the state, and the covariance of the square root."""
    covariance(belief.workspace[S], 6, LANES, belief.P)
    keep(belief.P, matrix(belief.workspace, LEFT, 6, 6))
    publish(belief)


@helper
def through(
    belief: FilterState, x: Array, A: Array, sets: Array, room: Array, noise: Noise, dt: float
) -> int:
    """Advance one Gaussian by sigma points through the IMU's increment or the aircraft's model: x
    (6,) and the square root of its covariance, the first 6 rows of A (ROWS rows of LANES).

    sets: spread and rest of the points, and how many pairs are of noise; room: what LAYOUT has
    room for. Returns how many numbers were repaired.
    """
    workspace, omega = belief.workspace, belief.omega
    mean, change, spread = room[MEAN], room[CHANGE], sets[0]
    v0, v1, v2 = x[3], x[4], x[5]
    c0, c1, c2 = propagate_velocity(workspace, omega, v0, v1, v2, dt)
    for i in range(6):
        row, far = LANES * i, LANES * (i + 6)
        for k in range(LANES):
            A[far + k] = -spread * A[row + k]
            A[row + k] *= spread
        _propagate_deviation(belief, x, A[row : row + 6], (c0, c1, c2), dt)
        _propagate_deviation(belief, x, A[far : far + 6], (c0, c1, c2), dt)
    take = deviations(A, 6, int(sets[2]), LANES, spread, sets[1], mean)
    _noise_rows(workspace, A[13 * LANES : 19 * LANES], noise, dt)
    triangle(A, 19, 6, LANES)
    repaired = 0
    if take > 0:
        for i in range(6):
            change[i] = take * mean[i]
        repaired = downdate(A, change, 6, LANES, room[WORK])
    x[0] += 0.5 * dt * (v0 + c0) + mean[0]
    x[1] += 0.5 * dt * (v1 + c1) + mean[1]
    x[2] += 0.5 * dt * (v2 + c2) + mean[2]
    x[3], x[4], x[5] = c0 + mean[3], c1 + mean[4], c2 + mean[5]
    return repaired


@helper
def _propagate_deviation(belief: FilterState, x: Array, d: Array, c: Three, dt: float) -> None:
    """The deviation d (6,) of a point from x becomes that of the point from the centre after dt,
    whose velocity is then c (m/s)."""
    d3, d4, d5 = d[3], d[4], d[5]
    w0, w1, w2 = propagate_velocity(
        belief.workspace, belief.omega, x[3] + d3, x[4] + d4, x[5] + d5, dt
    )
    d[3], d[4], d[5] = w0 - c[0], w1 - c[1], w2 - c[2]
    d[0] += 0.5 * dt * (d3 + d[3])
    d[1] += 0.5 * dt * (d4 + d[4])
    d[2] += 0.5 * dt * (d5 + d[5])


@helper
def _noise_rows(workspace: Array, rows: Array, noise: Noise, dt: float) -> None:
    """Rows of the square root of the process noise: of velocities, which move the positions of
    the same sample, and of positions."""
    velocity, share = random_walk(workspace, noise) * math.sqrt(dt), 0.5 * dt
    position = velocity * dt * math.sqrt(1 / 12)
    if workspace[Q] > 0:
        velocity = position = math.sqrt(workspace[Q] * dt)
        share = 0.0
    for i in range(6 * LANES):
        rows[i] = 0.0
    for i in range(3):
        rows[LANES * i + i], rows[LANES * i + 3 + i] = share * velocity, velocity
        rows[LANES * (3 + i) + i] = position


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct state and square root by the innovations at the sigma points of the six states,
    within the gate."""
    workspace, x, A, e = (
        belief.workspace,
        belief.workspace[X],
        belief.workspace[S],
        matrix(belief.workspace, E, 13, 3),
    )
    change, variances, work = (
        workspace[ROOM][CHANGE],
        workspace[VARIANCES],
        workspace[ROOM][WORK],
    )
    _renew_root(belief)
    first = innovation_at(workspace, y, kind, x, innovation)
    for a in range(3):
        variances[a] = variance(workspace, std, a)
        e[0, a] = innovation[a]
        for i in range(6):
            off = workspace[SPREAD_6] * A[LANES * i + first + a]
            e[1 + i, a], e[7 + i, a] = innovation[a] - off, innovation[a] + off
    nis, repaired = correct_root(
        A,
        6,
        LANES,
        e,
        3,
        workspace[SPREAD_6],
        workspace[REST_6],
        variances,
        gate,
        innovation,
        work,
        change,
    )
    workspace[REPAIRS] += repaired
    if nis <= gate:
        for i in range(6):
            x[i] += change[i]
        _leave(belief)
    return nis
