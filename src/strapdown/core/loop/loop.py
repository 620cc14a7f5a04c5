"""The one loop: IMU samples and measurements in time order through any filter.

Rules (docs/reference/conventions.md):
- A sample is split at the time of a measurement inside it, in proportion.
- Over a missing sample the belief goes on as gaps.py says. The row after a bridged gap is BRIDGED;
  after a longer one rows are INVALID until a position is accepted, or, of a filter that estimates no
  position, for one row.
- measurement.py has what happens to a measurement, integrity.py what samples and measurements can be.
"""

import math

from ...typing import Array
from ..compile.jit import flatten, helper, inline, kernel
from ..compile.signatures import signature
from ..mathematics.belief import BELIEF, NOISE, FilterState, Noise
from ..mathematics.earth import LATITUDE_LIMIT
from ..mathematics.mechanization import compensate
from ..mathematics.rotation import matrix_to_quaternion
from ..mathematics.solution_row import BIASES, LLA, NAV_WIDTH, ROW_STATUS, STD, Q, T, V
from .cursor import CURSOR, Cursor
from .gaps import (
    BRIDGE,
    BRIDGE_ACCEL,
    BRIDGE_GYRO,
    HOLD_ACCEL,
    HOLD_GYRO,
    MAX_HOLD,
    MAX_STEP,
    rates_held,
    wider,
)
from .integrity import NO_ACCEL, NO_GYRO, flag_unreliable, plausible, recover_attitude
from .kernels import KERNELS, Kernels, predict_at, step_at
from .log import LOG_FULL, Code, notify
from .loop_tape import call_step, save_step
from .measurement import use_next
from .tables import FIXES, IMU, OUTPUT, Fixes, Imu, Output, Status

SAME_TIME = 1e-6  # s: a measurement this close to a sample's end is taken there

RUN = signature(
    "run",
    kernels=KERNELS,
    belief=BELIEF,
    imu=IMU,
    fixes=FIXES,
    noise=NOISE,
    cursor=CURSOR,
    out=OUTPUT,
)


@kernel(RUN)
def run(
    kernels: Kernels,
    belief: FilterState,
    imu: Imu,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
) -> None:
    """Process the samples from state.row to state.stop and the measurements among them; all state is
    in `belief` and `cursor`, all results in `out`."""
    state = cursor.state[0]
    for row in range(state.row, state.stop):
        t, dt = imu.t[row], imu.dt[row]
        if t - dt - state.t > 0.5 * dt + SAME_TIME:
            _bridge_gap(kernels, belief, fixes, noise, cursor, out, t - dt)
        elif state.status == Status.BRIDGED or state.positioned == 0:
            state.status = Status.VALID
        # a run may begin anywhere inside its first sample
        inside = 0.5 * dt if state.previous[6] > 0 else SAME_TIME
        assumed = _take_sample(kernels, belief, imu, row, noise, cursor)
        if state.t - (t - dt) > inside:  # the belief stands inside this sample: use the rest of it
            dt = _rest_of_sample(t, dt, cursor)
        _advance(kernels, belief, fixes, assumed, cursor, out, t, dt)
        if not _is_sound(belief):
            state.fault = 1
            state.stop = row
            return
        state.row = row + 1
        _write(belief, t, row, cursor, out)
        if state.logged >= LOG_FULL:  # the caller empties it, and goes on
            state.stop = row + 1
            return


# ---- samples


@inline
def _take_sample(
    kernels: Kernels, belief: FilterState, imu: Imu, row: int, noise: Noise, cursor: Cursor
) -> Noise:
    """The increments of a sample, compensated for coning and sculling, into the work; where it cannot
    be true, what is bridged of it. Returns the noise that they have."""
    state, sample = cursor.state[0], cursor.work[0].increments
    dtheta, dv, dt = imu.dtheta[row], imu.dv[row], imu.dt[row]
    wrong, assumed = plausible(dtheta, dv, dt, imu.t[row], belief, cursor), noise
    if wrong:
        assumed = wider(noise, BRIDGE_GYRO, BRIDGE_ACCEL)
    if wrong < NO_GYRO:
        state.broken = 0.0
        compensate(dtheta, dv, dt, state.previous, sample)
        for i in range(3):
            state.previous[i], state.previous[3 + i] = dtheta[i], dv[i]
        state.previous[6] = dt
    else:  # bridged, as a missing one, but for the sensor that is right
        state.broken += dt
        long = state.broken > BRIDGE
        if long:
            assumed = wider(noise, HOLD_GYRO, HOLD_ACCEL)
            state.status = Status.INVALID
        rates_held(kernels, belief, dt, cursor, long, sample)
        for i in range(3):
            if not wrong & NO_GYRO:
                sample[i] = dtheta[i]
            if not wrong & NO_ACCEL:
                sample[3 + i] = dv[i]
    return assumed


@inline
def _rest_of_sample(t: float, dt: float, cursor: Cursor) -> float:
    """Leave of the increments those behind the time of the belief; how long they last, s."""
    share = max(t - cursor.state[0].t, 0.0) / dt
    for i in range(6):
        cursor.work[0].increments[i] *= share
    return dt * share


@helper
def _bridge_gap(
    kernels: Kernels,
    belief: FilterState,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
    until: float,
) -> None:
    """Bring the belief over missing samples to the time `until`, in steps of at most MAX_STEP
    seconds."""
    state, u = cursor.state[0], cursor.work[0].increments
    short = until - state.t <= BRIDGE
    gyro, accel = (BRIDGE_GYRO, BRIDGE_ACCEL) if short else (HOLD_GYRO, HOLD_ACCEL)
    wide = wider(noise, gyro, accel)
    notify(cursor, Code.BRIDGED_GAP if short else Code.HELD_GAP, 0, state.t, until - state.t)
    grown = state.t + MAX_HOLD
    while min(until, grown) - state.t > SAME_TIME:
        step = min(MAX_STEP, until - state.t)
        rates_held(kernels, belief, step, cursor, not short, u)
        _advance(kernels, belief, fixes, wide, cursor, out, state.t + step, step)
    state.t = until
    # last: measurements inside the gap do not end it
    status = Status.BRIDGED if short else Status.INVALID
    if state.status < status:
        state.status = status
    state.previous[6] = 0.0


# ---- going on


@inline
def _advance(
    kernels: Kernels,
    belief: FilterState,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
    until: float,
    left: float,
) -> None:
    """Bring the belief to `until` with the increments in the work, which last `left` seconds,
    stopping at each measurement on the way."""
    state, whole, part = cursor.state[0], cursor.work[0].increments, cursor.work[0].part
    while state.fix < state.fixes and fixes.t[state.fix] <= until + SAME_TIME:
        span = fixes.t[state.fix] - (until - left)
        if span > SAME_TIME and left - span > SAME_TIME:
            for i in range(6):
                part[i] = whole[i] * (span / left)
                whole[i] -= part[i]
            _predict(kernels, belief, part, span, noise, cursor, out)
            left -= span
        elif span > SAME_TIME:
            _predict(kernels, belief, whole, left, noise, cursor, out)
            left = 0.0
        use_next(kernels, belief, fixes, cursor, out)
    if left > 0:
        _predict(kernels, belief, whole, left, noise, cursor, out)
    state.t = until


@inline
def _predict(
    kernels: Kernels,
    belief: FilterState,
    u: Array,
    dt: float,
    noise: Noise,
    cursor: Cursor,
    out: Output,
) -> None:
    """One prediction, and what stages make of it."""
    state = cursor.state[0]
    if kernels.correct_increments != 0:
        step_at(kernels.correct_increments)(belief, u, dt, cursor, u[0:0])
    predict_at(kernels.predict)(belief, u, dt, noise)
    save_step(belief, state, out.record)
    for i in range(kernels.after_step.size):
        call_step(kernels.after_step[i], belief, u, dt, cursor, out.record)


@inline
def _is_sound(belief: FilterState) -> bool:
    """True where the estimate is finite and its latitude within LATITUDE_LIMIT."""
    return (
        abs(belief.lla[0]) <= LATITUDE_LIMIT
        and belief.P[0, 0] >= 0
        and belief.P[6, 6] >= 0
        and belief.C_nb[0, 0] == belief.C_nb[0, 0]
    )


# ---- results


@inline
def _write(belief: FilterState, t: float, row: int, cursor: Cursor, out: Output) -> None:
    """The row of the solution after IMU row `row`, where it is one that is kept."""
    state = cursor.state[0]
    state.shown = _row_status(belief, cursor, t)
    if row % state.every == state.phase:
        _write_row(belief, t, state.shown, out.nav[state.out])
        if out.covariance.shape[0] > 0:
            _write_covariance(belief.P, out.covariance[state.out])
        if out.mark.size > 0:
            out.mark[state.out] = state.recorded
        state.out += 1


@inline
def _row_status(belief: FilterState, cursor: Cursor, t: float) -> int:
    """The status of a row: invalid before doubtful before bridged before valid."""
    state, doubtful = cursor.state[0], False
    if state.condition >= 0:
        condition = int(belief.workspace[state.condition])
        if condition > 0:
            notify(cursor, Code.IN_CONDITION, condition - 1, t, 0.0)
            doubtful |= (state.doubtful_conditions >> (condition - 1)) & 1 == 1
    if state.positioned:
        _watch_belief(belief, cursor, t)
    if state.unconfirmed > 0 and recover_attitude(cursor, t):
        state.unconfirmed = 0
    if state.status == Status.INVALID or not (doubtful or state.unconfirmed > 0):
        return state.status
    return Status.DOUBTFUL.value


@inline
def _watch_belief(belief: FilterState, cursor: Cursor, t: float) -> None:
    """Doubt a belief that the vehicle cannot be in."""
    v, limits = belief.v_n, cursor.limits[0]
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if square > limits.speed * limits.speed:
        notify(cursor, Code.BELIEF_TOO_FAST, 0, t, math.sqrt(square))
        flag_unreliable(cursor, t)
    if belief.lla[2] < limits.lowest or belief.lla[2] > limits.highest:
        notify(cursor, Code.BELIEF_TOO_HIGH, 0, t, belief.lla[2])
        flag_unreliable(cursor, t)


@inline
def _write_row(belief: FilterState, t: float, status: int, row: Array) -> None:
    row[T], row[ROW_STATUS] = t, status
    for i in range(3):
        row[LLA + i], row[V + i] = belief.lla[i], belief.v_n[i]
        row[BIASES + i], row[BIASES + 3 + i] = belief.b_a[i], belief.b_g[i]
    matrix_to_quaternion(belief.C_nb, row[Q : Q + 4])
    for i in range(ROW_STATUS - STD):
        row[STD + i] = math.sqrt(max(belief.P[i, i], 0.0))
    brought = belief.augmented.size
    own = row.size - NAV_WIDTH - 2 * brought
    for i in range(own):
        row[NAV_WIDTH + i] = belief.workspace[i]
    for i in range(brought if own >= 0 else 0):
        row[NAV_WIDTH + own + i] = belief.augmented[i]
        row[NAV_WIDTH + own + brought + i] = math.sqrt(max(belief.P[15 + i, 15 + i], 0.0))


@helper
def _write_covariance(P: Array, out: Array) -> None:
    numbers, copy = flatten(P), flatten(out)
    for i in range(numbers.size):
        copy[i] = numbers[i]
