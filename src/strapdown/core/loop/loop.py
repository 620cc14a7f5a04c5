"""The one loop: IMU samples and fixes in time order through any filter, with the rules for partial
samples, gaps and re-acquisition.

Rules (docs/reference/conventions.md):
- A sample is split at the time of a fix inside it, in proportion.
- A gap of at most BRIDGE seconds is bridged with the last sample's rates and added noise, the row
  after it marked BRIDGED. Over a longer one velocity and attitude are held, the covariance grows at
  the HOLD densities for LONGEST_HOLD seconds at most, and rows are INVALID until a position fix
  after it is accepted, or, of a filter that estimates no position, for one row.
- A source whose fixes were rejected REJECTED times in a row over at least LIFT_AFTER seconds has
  its gate lifted until a fix passes it again. Before such a fix is used, P is multiplied by
  NIS/gate, DOUBT at most; where a position is further off than that, its squared innovation is
  added to the variances of position. Sources of neither position nor velocity are given LIFTS such
  uses, LIFT_AFTER seconds apart: one that nothing in the states explains, such as a field beside
  iron, would let P explode. Of two heights that contradict each other one is left out instead
  (heights.py), and an altitude moves the height alone. Velocities in the body that nothing else
  helps (no position or velocity for HEARD seconds) have their gates lifted after LIFT_ALONE s, as
  often as it takes, and opened while their tests fail: the filter shall not lose its only aid.
"""

import math

from ...typing import Array, Ints
from ..compile.jit import caller, flatten, helper, inlined, kernel, matrix
from ..mathematics.correlated import fade, widened
from ..mathematics.coupling import couple, read
from ..mathematics.earth import LATITUDE_LIMIT
from ..mathematics.mechanization import compensate, stationary_increments
from ..mathematics.rotation import matrix_to_quaternion
from ..mathematics.solution_row import BIASES, LLA, NAV_WIDTH, ROW_STATUS, SD, Q, T, V
from . import contract
from .contract import (
    ALTITUDE_KIND,
    BEND,
    BRIDGED,
    BROUGHT,
    CLOCK_AT,
    CLOCK_STATE,
    CORRELATION_TIME,
    DELAY,
    DOUBTFUL,
    FIRST,
    INVALID,
    KEPT,
    MEMORY,
    POSITION_KIND,
    PREDICT,
    ROBUST,
    RUN,
    RUN_RECORDED,
    SLIP,
    VALID,
    VELOCITY_KIND,
    WALK,
    Belief,
    Cursor,
    Fixes,
    Imu,
    Noise,
    Output,
)
from .cursor import (
    BELIEF_TOO_FAST,
    BELIEF_TOO_HIGH,
    BRIDGED_GAP,
    BROKEN,
    CLOCK_OFF,
    CONDITION,
    CORRECTED,
    DOUBTFUL_CONDITIONS,
    EVERY,
    FAULT,
    FIX,
    FIXES,
    HEIGHTS,
    HELD_GAP,
    HIGHEST,
    IN_CONDITION,
    LAST_USED,
    LEFT_OUT,
    LIFTED,
    LIFTED_AT,
    LOG_FULL,
    LOGGED,
    LOWEST,
    OUT,
    PHASE,
    POSITIONED,
    RECORDED,
    REJECTING,
    ROW,
    SAVE_STEP,
    SHOWN,
    SPEED,
    STATUS,
    STOP,
    TOO_FAR,
    UNCONFIRMED,
    say,
)
from .followed_noise import followed
from .heavy_tails import OTHER, correct_at, observe_at, weigh
from .heights import (
    JACOBIAN,
    follow_level,
    height_alone,
    leave_out_pulling,
    leave_out_wrong,
    observe_fix,
    row_of_height,
)
from .integrity import (
    CONFIRM,
    HEARD,
    LEFT,
    NO_ACCEL,
    NO_GYRO,
    confirm,
    doubt,
    fails,
    leave_out,
    length,
    level_again,
    measured,
    plausible,
    reachable,
    test,
)
from .recent_motion import keep, look_back

F_T, F_SOURCE, F_INNOVATION, F_NIS, F_USE, F_WHITENED, F_ROOT = 0, 1, 2, 5, 6, 7, 10
F_WEIGHT, F_FACTOR, F_V, FIX_WIDTH = 16, 17, 20, 23
"""Columns of Output.fix; use is one of the next five; F_ROOT is L of the contract (6); F_WEIGHT the
stated variance over that with which it was used, 0 where it was not; F_FACTOR what an adaptive
source had made of the stated standard deviations of each row; F_V the velocity of the belief after
the fix (3)."""
NOT_ASKED, UNMEASURED, REJECTED_FIX, ACCEPTED, REACQUIRED = -2.0, -1.0, 0.0, 1.0, 2.0

BRIDGE = 1.0  # s
LONGEST_STEP = 0.1  # s: longest prediction inside a gap
BRIDGE_GYRO, BRIDGE_ACCEL = 0.05, 1.0  # rad/sqrt(s), m/s/sqrt(s): added in a bridged gap
HOLD_GYRO, HOLD_ACCEL = 0.1, 3.0  # the same in a longer one
LONGEST_HOLD = (
    300.0  # s: how long P grows in a gap; beyond, the unstable height alone would let it explode
)
REJECTED, LIFT_AFTER = 5, 3.0  # rejections in a row; s
LIFT_ALONE, OPENED = 1.0, 100.0
"""s, and the factor on the gate while innovations fail their tests, of wheels and constraints that
nothing else helps. A fix ten times as far off as the gate has it is wild."""
DOUBT = 9.0  # largest growth of P at once, when a gate is lifted
LIFTS = 3  # uses in a row with the gate lifted, of sources of neither position nor velocity
SLIPPING, INNOVATION, WORK_SIZE = slice(18, 21), slice(21, 33), JACOBIAN.stop  # of Cursor.work
SAME_TIME = 1e-6  # s: a fix this close to a sample's end is taken there

predict_at, save_step_at = caller(PREDICT), caller(contract.SAVE_STEP)


@kernel(RUN)
def run(
    predict: int,
    correct: int,
    observers: Ints,
    belief: Belief,
    imu: Imu,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
) -> None:
    """Process the samples at[ROW] to at[STOP] and the fixes among them; all state is in `belief`
    and `cursor`, all results in `out`."""
    at, now, sample = cursor.at, cursor.now, cursor.work[0:6]
    for row in range(at[ROW], at[STOP]):
        t, dt = imu.t[row], imu.dt[row]
        begin = t - dt
        if begin - now[0] > 0.5 * dt + SAME_TIME:
            _cross_gap(predict, correct, observers, belief, fixes, noise, cursor, out, begin)
        elif at[STATUS] == BRIDGED or at[POSITIONED] == 0:
            at[STATUS] = VALID
        # a run may begin anywhere inside its first sample
        inside = 0.5 * dt if cursor.previous[6] > 0 else SAME_TIME
        assumed, wrong = noise, plausible(imu.dtheta[row], imu.dv[row], dt, t, belief, cursor)
        if wrong:
            assumed = wider(noise, BRIDGE_GYRO, BRIDGE_ACCEL)
        if wrong < NO_GYRO:
            now[BROKEN] = 0.0
            compensate(imu.dtheta[row], imu.dv[row], dt, cursor.previous, sample)
            for i in range(3):
                cursor.previous[i], cursor.previous[3 + i] = imu.dtheta[row, i], imu.dv[row, i]
            cursor.previous[6] = dt
        else:  # bridged, as a missing one, but for the sensor that is right
            now[BROKEN] += dt
            long = now[BROKEN] > BRIDGE
            if long:
                assumed, at[STATUS] = wider(noise, HOLD_GYRO, HOLD_ACCEL), INVALID
            _rates_held(belief, dt, cursor, long, sample)
            for i in range(3):
                if not wrong & NO_GYRO:
                    sample[i] = imu.dtheta[row, i]
                if not wrong & NO_ACCEL:
                    sample[3 + i] = imu.dv[row, i]
        if now[0] - begin > inside:  # the belief stands inside this sample: use the rest of it
            share = max(t - now[0], 0.0) / dt
            dt *= share
            for i in range(6):
                sample[i] *= share
        _advance(predict, correct, observers, belief, fixes, assumed, cursor, out, t, dt)
        if not (
            abs(belief.lla[0]) <= LATITUDE_LIMIT
            and belief.P[0, 0] >= 0
            and belief.P[6, 6] >= 0
            and belief.C[0, 0] == belief.C[0, 0]
        ):
            at[FAULT] = 1
            at[STOP] = row
            return
        at[ROW] = row + 1
        at[SHOWN] = _shown(belief, cursor, t)
        if row % at[EVERY] == at[PHASE]:
            _write_row(belief, t, at[SHOWN], out.nav[at[OUT]])
            if out.covariance.shape[0] > 0:
                _write_covariance(belief.P, out.covariance[at[OUT]])
            if out.mark.size > 0:
                out.mark[at[OUT]] = at[RECORDED]
            at[OUT] += 1
        if at[LOGGED] >= LOG_FULL:  # the caller empties it, and goes on
            at[STOP] = row + 1
            return


run_recorded = kernel(RUN_RECORDED, "run_recorded")(run.py_func)  # type: ignore[attr-defined]


@inlined
def _advance(
    predict: int,
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
    until: float,
    left: float,
) -> None:
    """Bring the belief to `until` with the increments in cursor.work[0:6], which last `left`
    seconds, stopping at each fix on the way."""
    at, now, whole, part = cursor.at, cursor.now, cursor.work[0:6], cursor.work[6:12]
    while at[FIX] < at[FIXES] and fixes.t[at[FIX]] <= until + SAME_TIME:
        span = fixes.t[at[FIX]] - (until - left)
        if span > SAME_TIME and left - span > SAME_TIME:
            for i in range(6):
                part[i] = whole[i] * (span / left)
                whole[i] -= part[i]
            _predict(predict, belief, part, span, noise, cursor, out)
            left -= span
        elif span > SAME_TIME:
            _predict(predict, belief, whole, left, noise, cursor, out)
            left = 0.0
        _use_fix(correct, observers, belief, fixes, cursor, out)
    if left > 0:
        _predict(predict, belief, whole, left, noise, cursor, out)
    now[0] = until


@inlined
def _predict(
    predict: int, belief: Belief, u: Array, dt: float, noise: Noise, cursor: Cursor, out: Output
) -> None:
    """One prediction, and what is kept of it."""
    if cursor.coupled.shape[0] > 0:
        read(cursor, belief, u, -1.0)
    predict_at(predict)(belief, u, dt, noise)
    _save_step(belief, cursor.at, out.record)
    if cursor.coupled.shape[0] > 0:
        _couple(cursor, belief, dt, out.record)
    if cursor.recent.shape[0] > 0:
        keep(cursor, belief, dt)


@inlined
def _use_fix(
    correct: int, observers: Ints, belief: Belief, fixes: Fixes, cursor: Cursor, out: Output
) -> None:
    """Hand the next fix to the filter and keep the books of its source."""
    at, k = cursor.at, cursor.at[FIX]
    s, innovation, row = fixes.source[k], cursor.work[INNOVATION], out.fix[k]
    gate, lifted, nis, t, tests = (
        fixes.gate[s],
        False,
        0.0,
        fixes.t[k],
        cursor.tests[fixes.source[k]],
    )
    if fixes.parameters[s, WALK] > 0:
        walk(belief.P, fixes.parameters, s, t - cursor.last[s])
    believable = measured(fixes, k, belief, cursor)
    if not believable:
        nis = math.nan
        for i in range(12):
            innovation[i] = math.nan
    timed = cursor.recent.shape[0] > 0 and fixes.parameters[s, CLOCK_STATE] > 0
    if timed and not look_back(cursor, belief, fixes.parameters[s]):
        say(cursor, CLOCK_OFF, s, t, fixes.parameters[s, CLOCK_AT])
        doubt(cursor, t)
    sd = fixes.sd[k]
    if fixes.parameters[s, SLIP] > 0:
        sd = _slipping(sd, belief, fixes.parameters[s, SLIP], cursor.work[SLIPPING])
    if timed:
        sd = _unbent(sd, fixes.kind[s], fixes.parameters[s], cursor.work[SLIPPING])
    if believable:
        if fixes.parameters[s, CORRELATION_TIME] > 0:
            _fade(cursor, belief, fixes.parameters[s], t - cursor.last[s], out.record)
            sd = widened(sd, fixes.parameters[s], cursor.work[SLIPPING])
        cursor.last[s] = t
    robust, weight = fixes.parameters[s, ROBUST] > 0, 1.0
    weighed = robust or fixes.parameters[s, MEMORY] > 0
    for i in range(3):
        row[F_FACTOR + i] = 1.0
    if fixes.parameters[s, MEMORY] > 0:
        sd = followed(sd, tests, cursor.floor[s], cursor.work[SLIPPING], row[F_FACTOR:])
    if weighed:
        gate = -1.0  # ask first
    of_height, h = max(row_of_height(fixes.kind[s]), 0), belief.lla[2]
    down = fixes.y[k, of_height]
    several = at[HEIGHTS] > 1
    if several and believable:
        if follow_level(observers, belief, fixes, k, cursor):
            fixes.y[k, of_height] = math.nan
        else:
            leave_out_pulling(belief, fixes, s, t, cursor)
    alone = believable and _carries_alone(observers, belief, fixes, k, t, cursor)
    if alone and not weighed and fails(tests):
        gate *= OPENED
    while believable:  # once, or a second time with the gate lifted
        for i in range(9):
            innovation[3 + i] = math.nan  # not every filter whitens
        found = correct_at(correct)(
            belief,
            fixes.y[k],
            sd,
            fixes.kind[s],
            observe_at(observers[fixes.kind[s]]),
            fixes.parameters[s],
            gate,
            innovation,
        )
        lift = (
            not lifted
            and found > max(gate, fixes.gate[s])
            and cursor.in_a_row[s] >= REJECTED
            and t - cursor.since[s] >= (LIFT_ALONE if alone else LIFT_AFTER)
            and (cursor.lifts[s] < LIFTS or alone)
        )
        if weighed and not lift and found > gate:
            weight = weigh(correct, observers, belief, fixes, k, sd, innovation, found, cursor)
        _save_step(belief, at, out.record)
        if lifted:
            break
        nis = found
        test(cursor, s, innovation, nis, t)
        if not lift:
            break
        tests[REJECTING] = 1.0
        doubt(cursor, t)
        if fixes.kind[s] == POSITION_KIND and not reachable(belief, innovation, s, t, cursor):
            say(cursor, TOO_FAR, s, t, length(innovation))
            weight = 0.0
            break
        vertical = height_alone(fixes.kind[s], innovation) and (
            several or (fixes.kind[s] == ALTITUDE_KIND and at[POSITIONED] > 0)
        )
        if vertical and several and leave_out_wrong(belief, fixes, s, t, cursor):
            weight = 0.0
            break
        if tests[LIFTED_AT] == 0:
            say(cursor, LIFTED, s, t, length(innovation))
        if vertical:
            _doubt_height(belief.P, fixes.kind[s], innovation)
        elif alone:
            _doubt_velocity(belief.P, cursor.work)
        else:
            _doubt(belief.P, nis / fixes.gate[s], fixes.kind[s] == POSITION_KIND, innovation)
        gate, lifted, fixes.parameters[s, KEPT] = math.inf, True, 1.0
    fixes.y[k, of_height] = down
    cursor.now[CORRECTED] += belief.lla[2] - h
    use = ACCEPTED if believable else NOT_ASKED
    if believable and math.isnan(nis):
        if math.isnan(innovation[0]) and math.isnan(innovation[1]) and math.isnan(innovation[2]):
            use = UNMEASURED
    elif nis > fixes.gate[s]:
        # a gate that was opened from the start is no second call of `correct`
        use = REACQUIRED if lifted else ACCEPTED if nis <= gate else REJECTED_FIX
        if cursor.in_a_row[s] == 0:
            cursor.since[s] = t
        cursor.in_a_row[s] += 1
        if lifted:
            tests[LIFTED_AT] = cursor.in_a_row[s]
        if (
            lifted
            and not alone
            and fixes.kind[s] != POSITION_KIND
            and fixes.kind[s] != VELOCITY_KIND
        ):
            cursor.lifts[s] += 1
            cursor.since[s] = t
        if cursor.lifts[s] == LIFTS and cursor.in_a_row[s] == tests[LIFTED_AT] + REJECTED:
            say(cursor, LEFT_OUT, s, cursor.since[s], 0.0)
            leave_out(cursor, s)
    elif believable:
        cursor.in_a_row[s] = cursor.lifts[s] = 0
        tests[LIFTED_AT] = tests[REJECTING] = 0.0
    if use > 0:
        tests[LAST_USED] = t
    if at[UNCONFIRMED] > 0:
        if use == ACCEPTED:
            confirm(cursor, t)
        elif use != UNMEASURED and tests[REJECTING] != LEFT:
            at[UNCONFIRMED] = CONFIRM  # fixes in a row
    if use > 0 and fixes.kind[s] == POSITION_KIND and at[STATUS] == INVALID:
        at[STATUS] = VALID
    cursor.accepted[s] += use > 0
    cursor.rejected[s] += use == REJECTED_FIX
    row[F_T], row[F_SOURCE] = t - fixes.parameters[s, DELAY], s
    row[F_NIS], row[F_USE] = nis, use
    for i in range(3):
        row[F_INNOVATION + i], row[F_WHITENED + i] = innovation[i], innovation[3 + i]
        row[F_V + i] = belief.v[i]
    for i in range(6):
        row[F_ROOT + i] = innovation[6 + i]
    row[F_WEIGHT] = weight if robust and believable else 1.0 * (use > 0)
    at[FIX] += 1


@helper
def _save_step(belief: Belief, at: Ints, record: Array) -> None:
    """Record the last call, where there is a record; count it anyway, so that one can be made
    for the next time."""
    # a constant of the type: without a record nothing of this is compiled, which is worth 5 % of
    # a fix
    if record.ndim == 2:
        save_step_at(at[SAVE_STEP])(belief, record[at[RECORDED]])
    at[RECORDED] += 1


@helper
def _slipping(sd: Array, belief: Belief, slip: float, wider: Array) -> Array:
    """The standard deviations with those of the side slip of tyres, in `wider`: as an angle it grows
    with the lateral acceleration, which is taken as yaw rate times speed. That is smooth, where the
    accelerometers feel the engine and the road."""
    v = belief.v
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    for i in range(3):
        wider[i] = math.hypot(sd[i], slip * belief.omega[2] * square)
    return wider


@helper
def _unbent(sd: Array, kind: int, parameters: Array, wider: Array) -> Array:
    """The standard deviations of a position or a velocity with what an uncertain clock bends, in
    `wider`."""
    if kind != POSITION_KIND and kind != VELOCITY_KIND:
        return sd
    first = BEND if kind == POSITION_KIND else BEND + 3
    for i in range(3):
        wider[i] = math.hypot(sd[i], parameters[first + i])
    return wider


@helper
def _couple(cursor: Cursor, belief: Belief, dt: float, record: Array) -> None:
    """What states of the IMU do to a prediction; a call of its own to the smoother."""
    if record.ndim == 2:
        couple(cursor, belief, dt, record[cursor.at[RECORDED]])
    else:
        couple(cursor, belief, dt, record)
    cursor.at[RECORDED] += 1


@helper
def _fade(cursor: Cursor, belief: Belief, parameters: Array, seconds: float, record: Array) -> None:
    """What becomes of the correlated errors of a source up to its fix; a call of its own to the
    smoother."""
    if record.ndim == 2:
        fade(belief.P, belief.extra_states, parameters, seconds, record[cursor.at[RECORDED]])
    else:
        fade(belief.P, belief.extra_states, parameters, seconds, record)
    cursor.at[RECORDED] += 1


@helper
def walk(P: Array, parameters: Array, s: int, seconds: float) -> None:
    """The random walk of the states that source `s` brought along; only its fixes see them, so it
    can wait for one."""
    first = int(parameters[s, FIRST])
    for i in range(first, first + int(parameters[s, BROUGHT])):
        P[i, i] += parameters[s, WALK] * parameters[s, WALK] * seconds


@helper
def _doubt(P: Array, excess: float, position: bool, innovation: Array) -> None:
    """Make room for a fix whose NIS is `excess` times its gate, after its source was rejected for
    long.

    A filter that rejects everything is too sure of itself: P grows as a whole, so that attitude and
    biases can turn too. A position that is further off than that explains has jumped: it shall move
    the position and bend nothing else.
    """
    factor = min(excess, DOUBT)
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] *= factor
    if position and excess > DOUBT:
        for i in range(3):
            if not math.isnan(innovation[i]):
                P[i, i] += innovation[i] * innovation[i]


@helper
def _carries_alone(
    observers: Ints, belief: Belief, fixes: Fixes, k: int, t: float, cursor: Cursor
) -> bool:
    """Whether fix `k` measures a velocity in the body, and the filter has for long used neither a
    position nor a velocity: nothing that it knows contradicts such a source. H of the fix is then in
    cursor.work."""
    own = fixes.kind[fixes.source[k]]
    if cursor.at[POSITIONED] == 0 or own == POSITION_KIND or own == VELOCITY_KIND:
        return False
    for s in range(fixes.kind.size):
        if fixes.kind[s] == POSITION_KIND or fixes.kind[s] == VELOCITY_KIND:
            if t - cursor.tests[s, LAST_USED] <= HEARD:
                return False
    observe_fix(observers, belief, fixes, k, cursor)
    H = matrix(cursor.work, JACOBIAN.start, 3, belief.P.shape[0])
    return H[0, 3] != 0 or H[0, 4] != 0 or H[0, 5] != 0


@helper
def _doubt_velocity(P: Array, work: Array) -> None:
    """Make room for a fix along the velocities that it measures: all else stays as it is."""
    H = matrix(work, JACOBIAN.start, 3, P.shape[0])
    for row in range(3):
        h, e = H[row, 3:6], work[OTHER][row]
        square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
        if square > 0 and not math.isnan(e):
            for i in range(3):
                for j in range(3):
                    P[3 + i, 3 + j] += h[i] * h[j] * (e / square) ** 2


@helper
def _doubt_height(P: Array, kind: int, innovation: Array) -> None:
    """Make room for a fix that only its height contradicts, or its vertical velocity: it shall move
    that and bend nothing else, least of all attitude and biases."""
    row, state = row_of_height(kind), 5 if kind == VELOCITY_KIND else 2
    P[state, state] += innovation[row] * innovation[row]


@helper
def _cross_gap(
    predict: int,
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    noise: Noise,
    cursor: Cursor,
    out: Output,
    until: float,
) -> None:
    """Bring the belief over missing samples to the time `until`, in steps of at most LONGEST_STEP
    seconds."""
    at, now, u, last = cursor.at, cursor.now, cursor.work[0:6], cursor.previous
    short = until - now[0] <= BRIDGE
    gyro, accel = (BRIDGE_GYRO, BRIDGE_ACCEL) if short else (HOLD_GYRO, HOLD_ACCEL)
    wide = wider(noise, gyro, accel)
    say(cursor, BRIDGED_GAP if short else HELD_GAP, 0, now[0], until - now[0])
    grown = now[0] + LONGEST_HOLD
    while min(until, grown) - now[0] > SAME_TIME:
        step = min(LONGEST_STEP, until - now[0])
        if short and last[6] > 0:
            for i in range(6):
                u[i] = last[i] * (step / last[6])
        else:
            _held(belief, step, cursor, u)
        _advance(predict, correct, observers, belief, fixes, wide, cursor, out, now[0] + step, step)
    now[0] = until
    # last: fixes inside the gap do not end it
    at[STATUS] = max(at[STATUS], BRIDGED if short else INVALID)
    last[6] = 0.0


@helper
def wider(noise: Noise, gyro: float, accel: float) -> Noise:
    """The noise with so much added to its densities."""
    return Noise(
        math.hypot(noise.gyro, gyro),
        math.hypot(noise.accel, accel),
        noise.gyro_bias,
        noise.accel_bias,
        noise.gyro_decay,
        noise.accel_decay,
        noise.held,
    )


@helper
def _held(belief: Belief, step: float, cursor: Cursor, u: Array) -> None:
    """Increments over `step` s, as the IMU would read them, that hold velocity and attitude."""
    stationary_increments(belief.lla, belief.v, belief.C, step, u)
    for i in range(3):
        u[i] += belief.bg[i] * step
        u[3 + i] += belief.ba[i] * step
    if cursor.coupled.shape[0] > 0:
        read(cursor, belief, u, 1.0)


@helper
def _rates_held(belief: Belief, dt: float, cursor: Cursor, long: bool, u: Array) -> None:
    """Increments over dt at the rates of the last sample; without one, or where they are missing for
    `long`, those that hold velocity and attitude."""
    last = cursor.previous
    if last[6] > 0 and not long:
        for i in range(6):
            u[i] = last[i] * (dt / last[6])
    else:
        _held(belief, dt, cursor, u)


@inlined
def _shown(belief: Belief, cursor: Cursor, t: float) -> int:
    """The status of a row: invalid before doubtful before bridged before valid."""
    at, doubtful = cursor.at, False
    if at[CONDITION] >= 0:
        condition = int(belief.workspace[at[CONDITION]])
        if condition > 0:
            say(cursor, IN_CONDITION, condition - 1, t, 0.0)
            doubtful |= (at[DOUBTFUL_CONDITIONS] >> (condition - 1)) & 1 == 1
    if at[POSITIONED]:
        v, limits = belief.v, cursor.limits
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        if square > limits[SPEED] * limits[SPEED]:
            say(cursor, BELIEF_TOO_FAST, 0, t, math.sqrt(square))
            doubt(cursor, t)
        if belief.lla[2] < limits[LOWEST] or belief.lla[2] > limits[HIGHEST]:
            say(cursor, BELIEF_TOO_HIGH, 0, t, belief.lla[2])
            doubt(cursor, t)
    if at[UNCONFIRMED] > 0 and level_again(cursor, t):
        at[UNCONFIRMED] = 0
    if at[STATUS] == INVALID or not (doubtful or at[UNCONFIRMED] > 0):
        return at[STATUS]
    return DOUBTFUL


@inlined
def _write_row(belief: Belief, t: float, status: int, row: Array) -> None:
    row[T], row[ROW_STATUS] = t, status
    for i in range(3):
        row[LLA + i], row[V + i] = belief.lla[i], belief.v[i]
        row[BIASES + i], row[BIASES + 3 + i] = belief.ba[i], belief.bg[i]
    matrix_to_quaternion(belief.C, row[Q : Q + 4])
    for i in range(ROW_STATUS - SD):
        row[SD + i] = math.sqrt(max(belief.P[i, i], 0.0))
    brought = belief.extra_states.size
    own = row.size - NAV_WIDTH - 2 * brought
    for i in range(own):
        row[NAV_WIDTH + i] = belief.workspace[i]
    for i in range(brought if own >= 0 else 0):
        row[NAV_WIDTH + own + i] = belief.extra_states[i]
        row[NAV_WIDTH + own + brought + i] = math.sqrt(max(belief.P[15 + i, 15 + i], 0.0))


@helper
def _write_covariance(P: Array, out: Array) -> None:
    numbers, copy = flatten(P), flatten(out)
    for i in range(numbers.size):
        copy[i] = numbers[i]
