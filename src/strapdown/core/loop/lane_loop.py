"""Eight runs of a filter side by side, on samples of the same times and fixes of the same sources: what
the one loop does with a sound sample and a sound fix.

Every number of a belief is a lane, one of each run (`lane_types`). Time, gaps between fixes and the
order of sources are the same in all runs, so they are plain. What is rare is left to the one loop: a
run whose sample or fix needs a closer look, or whose gate is to be lifted is marked in
`LaneCursor.left` and goes on with numbers that nobody uses. Whoever runs the lanes runs it alone. A
run whose belief is none any more has come to its end, as in the one loop.
"""

import math
from typing import NamedTuple

from ...typing import Array, Ints
from ..compile.choosing import any_of, where
from ..compile.jit import caller, helper, inlined, kernel
from ..compile.signatures import (
    LANES,
    WHOLE,
    Number,
    Numbers,
    in_lanes,
    reals,
    record,
    signature,
    wholes,
)
from ..mathematics.belief import BELIEF, NOISE
from ..mathematics.earth import LATITUDE_LIMIT
from ..mathematics.mechanization import compensate
from .contract import (
    CORRECT,
    FIXES,
    IN_LANES,
    NUMBERED,
    OBSERVE,
    POSITION_KIND,
    PREDICT,
    VELOCITY_KIND,
    WALK,
    Belief,
    Fixes,
    Noise,
)
from .cursor import (
    ACCEL_FULL_SCALE,
    ACCEL_RANGE,
    GYRO_FULL_SCALE,
    GYRO_RANGE,
    HIGHEST,
    LOWEST,
    SPEED,
)
from .integrity import HEARD, NEAR_NULL, SAME_VALUE, STUCK_SAMPLES
from .loop import LIFT_AFTER, REJECTED, SAME_TIME, walk

ROW, STOP, FIX, FIX_COUNT, OUT, EVERY, PHASE, FIRST_ROW, CONDITION, PLACES = range(10)
"""LaneCursor.at: next IMU row, where to stop, next fix, how many there are, next row to keep, rows are
kept where row % every == phase, the IMU row of the first sample that is given, and the place of the
filter's condition in its workspace or -1."""
IN_A_ROW, SINCE, BOOKS = range(3)
"""Columns of LaneCursor.books, a row per source: rejections since the last accepted fix, and time of
the first of them, s."""
NIS, USED, INNOVATION, FIX_NUMBERS = 0, 1, 2, 5
"""Columns of LaneOutput.fix: NIS, 1 where the fix was used, innovation (3)."""
LEFT, ENDED = 0, 1
"""LaneCursor.left: time from which a run must go alone, and of the sample at which it ended, s; inf
before."""
SAMPLE, PART, SEEN, REPEATED, WORK = slice(0, 6), slice(6, 12), slice(12, 24), slice(24, 30), 30
"""Of LaneCursor.work: increments in use, a part of them, the innovation, and how many samples each
axis has repeated its value."""
TIME, BEFORE, REPEATING = 0, 1, 2
"""LaneCursor.now: time of the belief, s; seconds of the sample before, 0 without one; 1 where an axis
of any run repeated its value."""


class LaneCursor(NamedTuple):
    """The loop's place and books of runs side by side."""

    at: Ints  # the same in all runs
    now: Array  # the same in all runs
    last: Array  # per source: time of its last fix
    limits: Array  # as Cursor.limits
    previous: Array  # lanes (7,): increments of the sample before, seconds
    work: Array  # lanes (WORK,)
    books: Array  # lanes (sources, BOOKS)
    conditions: Array  # lanes: when each condition of the filter held first, s; inf: never
    left: Array  # lanes (2,)


class LaneOutput(NamedTuple):
    """What runs side by side write."""

    fix: Array  # lanes (fixes, FIX_NUMBERS)
    kept: Array  # lanes (rows, numbers), as the kernel that keeps rows has them


def lanes(*shape: int | str) -> Numbers:
    """An array of lanes."""
    return Numbers(Number(True, LANES), shape)


LANE_CURSOR = record(
    LaneCursor,
    at=wholes("places"),
    now=reals(3),
    last=reals("sources"),
    limits=reals("limits"),
    previous=lanes(7),
    work=lanes("work"),
    books=lanes("sources", BOOKS),
    conditions=lanes("conditions"),
    left=lanes(2),
)
LANE_OUTPUT = record(LaneOutput, fix=lanes("fix_rows", FIX_NUMBERS), kept=lanes("rows", "numbers"))
KEEP = signature(
    "keep",
    belief=BELIEF,
    k=WHOLE,
    true=reals("epochs", "known"),
    biases=reals("epochs", 6),
    work=reals("work"),
    kept=reals("rows", "numbers"),
)
"""What is kept of a belief at row k: `true` is the truth, the same in all runs, `biases` the true ones
of each (accelerometer, gyro), `work` for the kernel to write in."""
KEEP_LANES = in_lanes(KEEP, "true")
_wide = in_lanes(
    signature("", belief=BELIEF, fixes=FIXES, increments=reals("samples", 6)),
    "t",
    "sd",
    "parameters",
    "gate",
)
RUN_LANES = signature(
    "run_lanes",
    predict=WHOLE,
    correct=WHOLE,
    observers=wholes("kinds"),
    keep=WHOLE,
    t=reals("rows_of_imu"),
    dt=reals("rows_of_imu"),
    **dict(_wide.arguments),
    noise=NOISE,
    true=reals("epochs", "known"),
    biases=lanes("epochs", 6),
    scratch=lanes("scratch"),
    cursor=LANE_CURSOR,
    out=LANE_OUTPUT,
)
predict_at, correct_at = caller(IN_LANES[PREDICT]), caller(IN_LANES[CORRECT])
observe_at, keep_at = caller(IN_LANES[OBSERVE]), caller(KEEP_LANES)


@kernel(RUN_LANES)
def run_lanes(
    predict: int,
    correct: int,
    observers: Ints,
    keep: int,
    t: Array,
    dt: Array,
    belief: Belief,
    fixes: Fixes,
    increments: Array,
    noise: Noise,
    true: Array,
    biases: Array,
    scratch: Array,
    cursor: LaneCursor,
    out: LaneOutput,
) -> None:
    """Process the samples at[ROW] to at[STOP] and the fixes among them. t, dt (n,) s of all samples,
    which follow each other without a gap; increments (block, 6) of rotation (rad) and velocity (m/s)
    of those from at[FIRST_ROW] on."""
    at, now, sample, previous = cursor.at, cursor.now, cursor.work[SAMPLE], cursor.previous
    for row in range(at[ROW], at[STOP]):
        u = increments[row - at[FIRST_ROW]]
        _watch(u, dt[row], t[row], cursor)
        compensate(u[0:3], u[3:6], dt[row], previous, sample)
        for i in range(6):
            previous[i] = u[i]
        now[BEFORE] = previous[6] = dt[row]
        _advance(predict, correct, observers, belief, fixes, noise, cursor, out, t[row], dt[row])
        sound = abs(belief.lla[0]) <= LATITUDE_LIMIT
        sound = sound & (belief.P[0, 0] >= 0) & (belief.P[6, 6] >= 0)
        _mark(ENDED, ~(sound & (belief.C[0, 0] == belief.C[0, 0])), t[row], cursor)
        if at[CONDITION] >= 0:
            _note(belief.workspace[at[CONDITION]], t[row], cursor.conditions)
        if row % at[EVERY] == at[PHASE]:
            keep_at(keep)(belief, at[OUT], true, biases, scratch, out.kept)
            at[OUT] += 1
    at[ROW] = max(at[ROW], at[STOP])


@inlined
def _advance(
    predict: int,
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    noise: Noise,
    cursor: LaneCursor,
    out: LaneOutput,
    until: float,
    left: float,
) -> None:
    """Bring the belief to `until` with the increments in work[SAMPLE], which last `left` seconds,
    stopping at each fix on the way."""
    at, now, whole, part = cursor.at, cursor.now, cursor.work[SAMPLE], cursor.work[PART]
    while at[FIX] < at[FIX_COUNT] and fixes.t[at[FIX]] <= until + SAME_TIME:
        span = fixes.t[at[FIX]] - (until - left)
        if span > SAME_TIME and left - span > SAME_TIME:
            for i in range(6):
                part[i] = whole[i] * (span / left)
                whole[i] -= part[i]
            predict_at(predict)(belief, part, span, noise)
            left -= span
        elif span > SAME_TIME:
            predict_at(predict)(belief, whole, left, noise)
            left = 0.0
        _use_fix(correct, observers, belief, fixes, cursor, out)
    if left > 0:
        predict_at(predict)(belief, whole, left, noise)
    now[TIME] = until


@inlined
def _use_fix(
    correct: int,
    observers: Ints,
    belief: Belief,
    fixes: Fixes,
    cursor: LaneCursor,
    out: LaneOutput,
) -> None:
    """Hand the next fix to the filter and keep the books of its source."""
    k = cursor.at[FIX]
    s, t, row = fixes.source[k], fixes.t[k], out.fix[k]
    gate, innovation, books = fixes.gate[s], cursor.work[SEEN], cursor.books[s]
    if fixes.parameters[s, WALK] > 0:
        walk(belief.P, fixes.parameters, s, t - cursor.last[s])
    _look(fixes.y[k], fixes.kind[s], belief, t, cursor)
    cursor.last[s] = t
    for i in range(3, 12):
        innovation[i] = math.nan  # not every filter whitens
    nis = correct_at(correct)(
        belief,
        fixes.y[k],
        fixes.sd[k],
        fixes.kind[s],
        observe_at(observers[fixes.kind[s]]),
        fixes.parameters[s],
        gate,
        innovation,
    )
    rejected = nis > gate
    lift = rejected & (books[IN_A_ROW] >= REJECTED) & (t - books[SINCE] >= LIFT_AFTER)
    _mark(LEFT, lift | (rejected & _may_be_alone(fixes, s, t, cursor)), t, cursor)
    books[SINCE] = where(rejected & (books[IN_A_ROW] == 0.0), t, books[SINCE])
    books[IN_A_ROW] = where(rejected, books[IN_A_ROW] + 1, where(nis <= gate, 0.0, books[IN_A_ROW]))
    nothing = math.isnan(innovation[0]) & math.isnan(innovation[1]) & math.isnan(innovation[2])
    row[NIS], row[USED] = nis, where(rejected | (nothing & math.isnan(nis)), 0.0, 1.0)
    for i in range(3):
        row[INNOVATION + i] = innovation[i]
    cursor.at[FIX] += 1


@inlined
def _may_be_alone(fixes: Fixes, s: int, t: float, cursor: LaneCursor) -> bool:
    """Whether the one loop may treat a rejected fix as one that nothing contradicts, as it does with
    velocities in the body while it dead reckons."""
    alone = fixes.kind[s] >= len(NUMBERED)
    for k in range(fixes.kind.size):
        if fixes.kind[k] == POSITION_KIND or fixes.kind[k] == VELOCITY_KIND:
            alone &= t - cursor.last[k] > HEARD
    return alone


@inlined
def _mark(what: int, which: bool, t: float, cursor: LaneCursor) -> None:
    """Mark the runs that leave or end at time t, unless they have before."""
    if any_of(which):
        cursor.left[what] = where(which, min(cursor.left[what], t), cursor.left[what])


@inlined
def _watch(u: Array, dt: float, t: float, cursor: LaneCursor) -> None:
    """Runs of which `core.loop.integrity.plausible` would look at this sample more closely must go
    alone."""
    limits, previous, before = cursor.limits, cursor.previous, cursor.now[BEFORE]
    gyro = min(limits[GYRO_RANGE], limits[GYRO_FULL_SCALE] * (1 - SAME_VALUE)) * dt
    accel = min(limits[ACCEL_RANGE], limits[ACCEL_FULL_SCALE] * (1 - SAME_VALUE)) * dt
    usual = abs(u[0]) <= gyro
    for i in range(1, 6):
        usual = usual & (abs(u[i]) <= (gyro if i < 3 else accel))
    same = ~usual
    if before > 0:
        for i in range(6):
            change = abs(u[i] * before - previous[i] * dt)
            same = same | ~(change > SAME_VALUE * before * abs(u[i]))
    _mark(LEFT, ~usual, t, cursor)
    if any_of(same) or cursor.now[REPEATING] > 0:
        _count_repeated(u, dt, t, cursor)


@helper
def _count_repeated(u: Array, dt: float, t: float, cursor: LaneCursor) -> None:
    """Runs of which an axis repeats its value for as long as that of a stuck sensor must go alone."""
    repeated, before = cursor.work[REPEATED], cursor.now[BEFORE]
    cursor.now[REPEATING] = 0.0
    for i in range(6):
        change = abs(u[i] * before - cursor.previous[i] * dt)
        repeated[i] = where(change > SAME_VALUE * before * abs(u[i]), 0.0, repeated[i] + 1)
        _mark(LEFT, repeated[i] >= STUCK_SAMPLES, t, cursor)
        if any_of(repeated[i] > 0):
            cursor.now[REPEATING] = 1.0


@inlined
def _look(y: Array, kind: int, belief: Belief, t: float, cursor: LaneCursor) -> None:
    """Runs whose fix `core.loop.integrity.measured` might not believe must go alone."""
    limits = cursor.limits
    if kind == POSITION_KIND:
        nowhere = (abs(y[0]) < NEAR_NULL) & (abs(y[1]) < NEAR_NULL)
        _mark(LEFT, nowhere | (y[2] < limits[LOWEST]) | (y[2] > limits[HIGHEST]), t, cursor)
    elif kind == VELOCITY_KIND:
        square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
        _mark(LEFT, ~(square <= 0.99 * limits[SPEED] * limits[SPEED]), t, cursor)


@helper
def _note(condition: float, t: float, conditions: Array) -> None:
    """Keep when each condition of the filter held first."""
    if any_of(condition > 0):
        for c in range(conditions.size):
            held = condition == c + 1.0
            conditions[c] = where(held, min(conditions[c], t), conditions[c])
