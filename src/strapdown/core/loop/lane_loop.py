"""Eight runs of a filter side by side, on samples of the same times and fixes of the same sources: what
the one loop does with a sound sample and a sound fix.

Every number of a belief is a lane, one of each run (`lane_types`). Time, gaps between fixes and the
order of sources are the same in all runs, so they are plain. What is rare is left to the one loop: a
run whose sample or fix needs a closer look, or whose gate is to be opened is marked in
`LaneCursor.left` and goes on with numbers that nobody uses. Whoever runs the lanes runs it alone. A
run whose belief is none any more has come to its end, as in the one loop.
"""

import math
from typing import NamedTuple

from ...typing import Array, Ints
from ..compile.jit import caller, helper, inline, kernel
from ..compile.records import Table, rows_of
from ..compile.selection import any_of, where
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
from ..mathematics.belief import BELIEF, NOISE, FilterState, Noise
from ..mathematics.disturbed_field import is_disturbed
from ..mathematics.earth import LATITUDE_LIMIT
from ..mathematics.mechanization import compensate
from ..mathematics.source import NAMED_KINDS, OBSERVE, Kind, SourceRow
from .contract import IN_LANES
from .cursor import CHANNELS, Limits
from .integrity import (
    HEARD,
    MAX_NIS,
    MAX_WHITENED,
    MEAN_ALARM,
    MEAN_ALLOWED,
    NEAR_NULL,
    NIS_ALARM,
    NIS_ALLOWED,
    SAME_VALUE,
    SECOND,
    STUCK_SAMPLES,
    cumulative_sum,
    share_states,
)
from .kernels import CORRECT, PREDICT
from .loop import SAME_TIME
from .measurement import LIFT_AFTER, REJECTED, walk
from .tables import FIXES, Fixes

IN_A_ROW, SINCE, NIS_SUM, NIS_COUNT = range(4)
WHITENED, COUNTS, SUMS, BOOKS = slice(4, 7), slice(7, 10), slice(10, 10 + CHANNELS), 10 + CHANNELS
"""Columns of LaneCursor.books, a row per source: rejections since the last accepted fix, and time of
the first of them, s; the running tests of its innovations, as in Books."""
NEARLY = 0.99
"""Part of the bound of a test from which a run goes alone."""
NIS, USED, INNOVATION, FIX_NUMBERS = 0, 1, 2, 5
"""Columns of LaneOutput.fix: NIS, 1 where the fix was used, innovation (3)."""
LEFT, ENDED = 0, 1
"""LaneCursor.left: time from which a run must go alone, and of the sample at which it ended, s; inf
before."""
SAMPLE, PART, SEEN, REPEATED, WORK = slice(0, 6), slice(6, 12), slice(12, 24), slice(24, 30), 30
"""Places in LaneCursor.work: increments in use, a part of them, the innovation, and how many
samples each axis has repeated its value."""


class LaneState:
    """Where the loop stands, the same in all runs."""

    row: int  # next IMU sample
    stop: int  # where to stop
    first_row: int  # that of the first sample that is given
    fix: int  # next measurement
    fixes: int  # how many there are
    out: int  # next row to keep
    every: int  # rows with row % every == phase are kept
    phase: int
    condition: int  # place of the filter's condition in its workspace, or -1
    repeating: int  # 1: an axis of any run repeated its value
    t: float  # time of the belief, s
    before: float  # seconds of the sample before, 0 without one


class LaneCursor(NamedTuple):
    """The loop's place and books of runs side by side."""

    state: Table[LaneState]  # one row
    last: Array  # per source: time of its last fix
    tested: Array  # per source: when its innovations were tested last, s
    limits: Table[Limits]  # as Cursor.limits
    previous: Array  # lanes (7,): increments of the sample before, seconds
    work: Array  # lanes (WORK,)
    books: Array  # lanes (sources, BOOKS)
    conditions: Array  # lanes: when each condition of the filter held first, s; inf: never
    left: Array  # lanes (2,)


class LaneOutput(NamedTuple):
    """The output of a batch of runs."""

    fix: Array  # lanes (fixes, FIX_NUMBERS)
    kept: Array  # lanes (rows, numbers), as the kernel that keeps rows has them


def lanes(*shape: int | str) -> Numbers:
    """An array of lanes."""
    return Numbers(Number(True, LANES), shape)


LANE_CURSOR = record(
    LaneCursor,
    state=rows_of(LaneState, 1),
    last=reals("sources"),
    tested=reals("sources"),
    limits=rows_of(Limits, 1),
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
"""Signature of the kernel that keeps a part of a belief at row k: `true` is the truth, the same in
all runs, `biases` the true ones of each (accelerometer, gyro), `work` for the kernel to write
in."""
KEEP_LANES = in_lanes(KEEP, "true")
_wide = in_lanes(
    signature("", belief=BELIEF, fixes=FIXES, increments=reals("samples", 6)),
    "t",
    "std",
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
    belief: FilterState,
    fixes: Fixes,
    increments: Array,
    noise: Noise,
    true: Array,
    biases: Array,
    scratch: Array,
    cursor: LaneCursor,
    out: LaneOutput,
) -> None:
    """Process the samples from state.row to state.stop and the fixes among them. t, dt (n,) s of all samples,
    which follow each other without a gap; increments (block, 6) of rotation (rad) and velocity (m/s)
    of those from state.first_row on."""
    state, sample, previous = cursor.state[0], cursor.work[SAMPLE], cursor.previous
    for row in range(state.row, state.stop):
        u = increments[row - state.first_row]
        _watch(u, dt[row], t[row], cursor)
        compensate(u[0:3], u[3:6], dt[row], previous, sample)
        for i in range(6):
            previous[i] = u[i]
        state.before = previous[6] = dt[row]
        _advance(predict, correct, observers, belief, fixes, noise, cursor, out, t[row], dt[row])
        sound = abs(belief.lla[0]) <= LATITUDE_LIMIT
        sound = sound & (belief.P[0, 0] >= 0) & (belief.P[6, 6] >= 0)
        _mark(ENDED, ~(sound & (belief.C_nb[0, 0] == belief.C_nb[0, 0])), t[row], cursor)
        if state.condition >= 0:
            _note(belief.workspace[state.condition], t[row], cursor.conditions)
        if row % state.every == state.phase:
            keep_at(keep)(belief, state.out, true, biases, scratch, out.kept)
            state.out += 1
    state.row = max(state.row, state.stop)


@inline
def _advance(
    predict: int,
    correct: int,
    observers: Ints,
    belief: FilterState,
    fixes: Fixes,
    noise: Noise,
    cursor: LaneCursor,
    out: LaneOutput,
    until: float,
    left: float,
) -> None:
    """Bring the belief to `until` with the increments in work[SAMPLE], which last `left` seconds,
    stopping at each fix on the way."""
    state, whole, part = cursor.state[0], cursor.work[SAMPLE], cursor.work[PART]
    while state.fix < state.fixes and fixes.t[state.fix] <= until + SAME_TIME:
        span = fixes.t[state.fix] - (until - left)
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
    state.t = until


@inline
def _use_fix(
    correct: int,
    observers: Ints,
    belief: FilterState,
    fixes: Fixes,
    cursor: LaneCursor,
    out: LaneOutput,
) -> None:
    """Hand the next fix to the filter and keep the books of its source."""
    k = cursor.state[0].fix
    s, t, row = fixes.source[k], fixes.t[k], out.fix[k]
    gate, innovation, books = fixes.sources[s].gate, cursor.work[SEEN], cursor.books[s]
    if fixes.sources[s].walk > 0:
        last = cursor.last[s]
        for i in range(fixes.sources.size):
            if share_states(fixes.sources[s], fixes.sources[i]):
                last = max(last, cursor.last[i])
        walk(belief.P, fixes.sources[s], t - last)
    _look(fixes.y[k], fixes.std[k], fixes.sources[s], belief, t, cursor)
    cursor.last[s] = t
    for i in range(3, 12):
        innovation[i] = math.nan  # not every filter whitens
    nis = correct_at(correct)(
        belief,
        fixes.y[k],
        fixes.std[k],
        fixes.sources[s].kind,
        observe_at(observers[fixes.sources[s].kind]),
        fixes.sources[s],
        gate,
        innovation,
    )
    rejected = nis > gate
    lift = rejected & (books[IN_A_ROW] >= REJECTED) & (t - books[SINCE] >= LIFT_AFTER)
    _mark(LEFT, lift | (rejected & _may_be_alone(fixes, s, t, cursor)), t, cursor)
    books[SINCE] = where(rejected & (books[IN_A_ROW] == 0.0), t, books[SINCE])
    books[IN_A_ROW] = where(rejected, books[IN_A_ROW] + 1, where(nis <= gate, 0.0, books[IN_A_ROW]))
    if _is_tested(fixes, s):
        _test(nis, s, t, cursor)
    nothing = math.isnan(innovation[0]) & math.isnan(innovation[1]) & math.isnan(innovation[2])
    row[NIS], row[USED] = nis, where(rejected | (nothing & math.isnan(nis)), 0.0, 1.0)
    for i in range(3):
        row[INNOVATION + i] = innovation[i]
    cursor.state[0].fix += 1


@inline
def _is_tested(fixes: Fixes, s: int) -> bool:
    """True of the sources of a run with a sensor that GNSS judges, and of GNSS itself there."""
    tested, kind = False, fixes.sources[s].kind
    for i in range(fixes.sources.size):
        tested |= fixes.sources[i].beside_gnss > 0
    gnss = (kind == Kind.POSITION) | (kind == Kind.VELOCITY)
    return tested & (gnss | (fixes.sources[s].beside_gnss > 0))


@inline
def _test(nis: float, s: int, t: float, cursor: LaneCursor) -> None:
    """The running tests of a source, as `core.loop.integrity.test` gathers them for one run: runs in which
    one nearly fails must go alone."""
    innovation, books, rows = cursor.work[SEEN], cursor.books[s], 0.0
    whitened, counts, sums = books[WHITENED], books[COUNTS], books[SUMS]
    for i in range(3):
        rows += where(innovation[i] == innovation[i], 1.0, 0.0)
        known = innovation[3 + i] == innovation[3 + i]
        whitened[i] += where(known, innovation[3 + i], 0.0)
        counts[i] += where(known, 1.0, 0.0)
    several = max(rows, 1.0)
    books[NIS_SUM] += where(nis == nis, nis / several, 0.0)
    books[NIS_COUNT] += where(nis == nis, 1.0, 0.0)
    if t - cursor.tested[s] < SECOND:
        return
    cursor.tested[s] = t
    for i in range(3):
        mean = whitened[i] / max(counts[i], 1.0)
        for channel, value in ((i, mean), (3 + i, -mean)):
            sums[channel] = cumulative_sum(sums[channel], value, MEAN_ALLOWED, MAX_WHITENED)
            _mark(LEFT, sums[channel] > NEARLY * MEAN_ALARM, t, cursor)
        whitened[i] = 0.0 * mean
        counts[i] = 0.0 * mean
    value = books[NIS_SUM] / max(books[NIS_COUNT], 1.0)
    sums[6] = cumulative_sum(sums[6], value, NIS_ALLOWED, MAX_NIS)
    _mark(LEFT, sums[6] * several > NEARLY * NIS_ALARM, t, cursor)
    books[NIS_SUM] = 0.0 * value
    books[NIS_COUNT] = 0.0 * value


@inline
def _may_be_alone(fixes: Fixes, s: int, t: float, cursor: LaneCursor) -> bool:
    """True where the one loop may treat a rejected measurement as one that nothing contradicts, as
    it does with body velocities in dead reckoning."""
    alone = fixes.sources[s].kind >= NAMED_KINDS
    for k in range(fixes.sources.size):
        if fixes.sources[k].kind == Kind.POSITION or fixes.sources[k].kind == Kind.VELOCITY:
            alone &= t - cursor.last[k] > HEARD
    return alone


@inline
def _mark(what: int, which: bool, t: float, cursor: LaneCursor) -> None:
    """Mark the runs that leave or end at time t, unless they have before."""
    if any_of(which):
        cursor.left[what] = where(which, min(cursor.left[what], t), cursor.left[what])


@inline
def _watch(u: Array, dt: float, t: float, cursor: LaneCursor) -> None:
    """Runs of which `core.loop.integrity.plausible` would look at this sample more closely must go
    alone."""
    limits, previous, before = cursor.limits[0], cursor.previous, cursor.state[0].before
    gyro = min(limits.gyro_range, limits.gyro_full_scale * (1 - SAME_VALUE)) * dt
    accel = min(limits.accel_range, limits.accel_full_scale * (1 - SAME_VALUE)) * dt
    usual = abs(u[0]) <= gyro
    for i in range(1, 6):
        usual = usual & (abs(u[i]) <= (gyro if i < 3 else accel))
    same = ~usual
    if before > 0:
        for i in range(6):
            change = abs(u[i] * before - previous[i] * dt)
            same = same | ~(change > SAME_VALUE * before * abs(u[i]))
    _mark(LEFT, ~usual, t, cursor)
    if any_of(same) or cursor.state[0].repeating > 0:
        _count_repeated(u, dt, t, cursor)


@helper
def _count_repeated(u: Array, dt: float, t: float, cursor: LaneCursor) -> None:
    """Take runs out of the batch where an axis repeats its value as long as a stuck sensor."""
    repeated, before = cursor.work[REPEATED], cursor.state[0].before
    cursor.state[0].repeating = 0
    for i in range(6):
        change = abs(u[i] * before - cursor.previous[i] * dt)
        repeated[i] = where(change > SAME_VALUE * before * abs(u[i]), 0.0, repeated[i] + 1)
        _mark(LEFT, repeated[i] >= STUCK_SAMPLES, t, cursor)
        if any_of(repeated[i] > 0):
            cursor.state[0].repeating = 1


@inline
def _look(
    y: Array, std: Array, source: SourceRow, belief: FilterState, t: float, cursor: LaneCursor
) -> None:
    """Runs whose fix `core.loop.integrity.is_plausible` might not believe must go alone."""
    limits, kind = cursor.limits[0], source.kind
    if kind == Kind.POSITION:
        nowhere = (abs(y[0]) < NEAR_NULL) & (abs(y[1]) < NEAR_NULL)
        _mark(LEFT, nowhere | (y[2] < limits.lowest) | (y[2] > limits.highest), t, cursor)
    elif kind == Kind.VELOCITY:
        square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
        _mark(LEFT, ~(square <= 0.99 * limits.speed * limits.speed), t, cursor)
    elif kind == Kind.MAGNETIC_FIELD:
        _mark(LEFT, is_disturbed(belief, y, std, source), t, cursor)


@helper
def _note(condition: float, t: float, conditions: Array) -> None:
    """Keep when each condition of the filter held first."""
    if any_of(condition > 0):
        for c in range(conditions.size):
            held = condition == c + 1.0
            conditions[c] = where(held, min(conditions[c], t), conditions[c])
