"""Plausibility of samples and measurements: samples of the IMU against their range and each other,
measurements against the limits of sensor and vehicle, innovations against chance.

The tests of innovations are cumulative sums (Page 1954) of whitened innovations, which are N(0, 1)
where the filter is right. Fixes of a second count as one, by their mean, because errors that last
make neighbouring fixes alike. docs/reference/status.md has the rates of false alarms.
"""

import math

from ...typing import Array
from ..compile.jit import helper, inline
from ..compile.records import Table
from ..mathematics.belief import FilterState
from ..mathematics.source import Kind, SourceRow
from .cursor import CHANNELS, Axis, Books, Cursor
from .log import Code, notify
from .tables import Fixes

CONFIRM, CONFIRM_AFTER = 3, 1.0
"""Fixes in a row that must pass their gates, the first of them this time (s) after the last cause,
before a doubt ends."""
HEARD = 10.0  # s after which a source that sends nothing contradicts nothing any more
LEFT = -1  # in Books.rejecting: left out
NO_GYRO, NO_ACCEL = 2, 4  # bits of what `plausible` says of a sample that cannot be
LEVELLED = 30.0
"""s without a fix after which a filter that estimates no position ends a doubt by itself: gravity
has levelled it, and a wrong vertical would have shown in the mean force, which attitude filters
take over 20 s."""
SAME_VALUE = 1e-9  # of a value: less is rounding and no change
SELDOM, LONG_SAMPLE = (
    16,
    0.05,
)  # changes are tested every SELDOM samples, or in longer ones (s)
LAST_CHANGES = 16.0  # over which they are averaged
MAX_UNEVEN = 0.15  # mean difference of neighbouring intervals, over their length
MAX_JITTER = 2.0
"""Upper bound on the change of velocity that samples do not show, over its standard deviation.
Recorded cars, aircraft and hands stay below 0.5."""
LEARNED = 200  # samples from which the rate of repeated values is known
STUCK_SAMPLES, STUCK_TIME = 10, 0.2  # an axis is not stuck for fewer, or for less (s)
STUCK_LIKELIHOOD = 25.0  # -ln of how likely so many repeated values are by chance
LATEST, MORE_THAN_USUAL = 64.0, 0.2
"""Samples over which the share of repeats is averaged; how much above its usual one is unusual."""
SECOND = 1.0 - 1e-6  # s of fixes that count as one
MAX_WHITENED = 4.0  # of one second, so that one wild fix is no drift
MEAN_ALLOWED, MEAN_ALARM = 0.5, 14.0
"""Mean of whitened innovations that lasting errors of right fixes have; what its sum beyond that
reaches by chance once in 1000 h of a component."""
NIS_ALLOWED, NIS_ALARM = 2.0, 36.0
"""The same of the NIS over its expectation; the bound is divided by the rows of a fix."""
MAX_NIS = 8.0  # of one second over its expectation
MAX_OF_BOUND, RECOVERED = 2.0, 0.5  # where a sum stops growing, and where its test holds again
ROOM = 4.0
"""Growth of P where a sensor is left out that the filter has used: twice the standard deviations."""
BARRED = 60.0
"""s for which a sensor is left out at least; each time again twice as long. A turn or two are in it, which
are what shows a wrong airspeed: its scale flies straight without a contradiction."""
NULL = 1e-12  # rad: latitude and longitude of a receiver without a fix
NEAR_NULL = 0.01  # rad from there, where a fix can be that


@inline
def flag_unreliable(cursor: Cursor, t: float) -> None:
    """Rows are doubtful from here until fixes confirm."""
    cursor.state[0].unconfirmed = CONFIRM
    cursor.state[0].cause = t


@helper
def confirm(cursor: Cursor, t: float) -> None:
    """A fix passed its gate at `t` s. It confirms where no source contradicts the belief that was
    heard of lately: one that fell silent cannot take back what it said."""
    books, contradicted = cursor.books, False
    for s in range(books.size):
        if t - books[s].tested <= HEARD and books[s].contradicts == 0:
            contradicted |= books[s].rejecting > 0
            for channel in range(CHANNELS):
                contradicted |= books[s].fails[channel] > 0
    if not contradicted and t - cursor.state[0].cause >= CONFIRM_AFTER:
        cursor.state[0].unconfirmed -= 1


@helper
def exclude_source(cursor: Cursor, s: int) -> None:
    """Source `s` contradicts nothing any more, until one of its fixes passes."""
    forget(cursor.books[s])
    cursor.books[s].rejecting = LEFT


@inline
def is_gnss(kind: int) -> bool:
    """True for positions and velocities over ground."""
    return kind == Kind.POSITION or kind == Kind.VELOCITY


@helper
def last_gnss(fixes: Fixes, cursor: Cursor) -> float:
    """When the filter has used a position or a velocity last, s."""
    last = -math.inf
    for s in range(fixes.sources.size):
        if is_gnss(fixes.sources[s].kind):
            last = max(last, cursor.books[s].last_used)
    return last


@inline
def gnss_is_used(fixes: Fixes, t: float, cursor: Cursor) -> bool:
    """True where the filter has used a position or a velocity lately, at time `t` s."""
    return t - last_gnss(fixes, cursor) <= HEARD


@helper
def gnss_contradicts_since(fixes: Fixes, t: float, cursor: Cursor) -> float:
    """Since when innovations of positions and velocities are off whose tests fail together, s: the two do not
    depend on each other, so that the belief is wrong. inf where these tests hold."""
    position, velocity, since = False, False, math.inf
    for s in range(fixes.sources.size):
        books = cursor.books[s]
        if is_gnss(fixes.sources[s].kind) and t - books.tested <= HEARD:
            for channel in range(CHANNELS):
                if books.fails[channel] > 0:
                    position |= fixes.sources[s].kind == Kind.POSITION
                    velocity |= fixes.sources[s].kind == Kind.VELOCITY
                    since = min(since, books.tested - books.terms[channel] + 1)
    return since if position and velocity else math.inf


@helper
def share_states(a: SourceRow, b: SourceRow) -> bool:
    """True where two sources bring the same states along."""
    return a.states > 0 and b.states > 0 and a.first_state == b.first_state


@helper
def exclude_contradicting(fixes: Fixes, s: int, t: float, cursor: Cursor) -> bool:
    """Leave out source `s`, which contradicts positions and velocities, and all that share its states: they
    rest on what it made of these. True where P must grow, to undo what the source has done to the belief."""
    source, books = fixes.sources[s], cursor.books[s]
    seconds = BARRED * (1 << min(books.exclusions, 10))
    for i in range(fixes.sources.size):
        if i == s or share_states(source, fixes.sources[i]):
            _bar(i, t, seconds, cursor)
    return was_used(books, t)


@helper
def _bar(s: int, t: float, seconds: float, cursor: Cursor) -> None:
    """Leave out one source for some seconds, until the sum of its NIS has fallen again, and without GNSS for
    twice as long."""
    books = cursor.books[s]
    books.contradicts, books.rejecting = 1, 0
    books.barred, books.proven = t + seconds, t + 2 * seconds
    books.exclusions += 1
    books.fails[6], books.sums[6] = 1.0, MAX_OF_BOUND * NIS_ALARM
    notify(cursor, Code.CONTRADICTS, s, t, 0.0)


@helper
def was_used(books: Books, t: float) -> bool:
    """True where the filter used a source lately."""
    return books.accepted > 0 and t - books.last_used <= HEARD


@helper
def make_room_for_gnss(P: Array) -> None:
    """Let P grow as a whole: what a sensor that is left out has done to the belief shall be undone."""
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] *= ROOM


@helper
def fails(books: Books) -> bool:
    """True where any test of the innovations of a source fails."""
    failing = 0.0
    for channel in range(CHANNELS):
        failing += books.fails[channel]
    return failing > 0


@helper
def forget(books: Books) -> None:
    """Begin the sums of a source anew."""
    for channel in range(CHANNELS):
        books.fails[channel] = books.sums[channel] = 0.0


@helper
def recover_attitude(cursor: Cursor, t: float) -> bool:
    """True where gravity confirms a filter that estimates no position: no measurement was tested
    and no doubt arose for LEVELLED seconds."""
    last = cursor.state[0].cause
    for s in range(cursor.books.size):
        last = max(last, cursor.books[s].tested)
    return cursor.state[0].positioned == 0 and t - last > LEVELLED


# ---- samples


@inline
def plausible(
    dtheta: Array, dv: Array, dt: float, t: float, belief: FilterState, cursor: Cursor
) -> int:
    """0 for a sample that can be true, 1 for one of which less is known than the noise says (at
    full scale, stuck), NO_GYRO, NO_ACCEL or both for one that cannot be. The state still
    holds the one before."""
    state, limits = cursor.state[0], cursor.limits[0]
    previous = state.previous
    before = previous[6]
    gyro, accel = limits.gyro_range * dt, limits.accel_range * dt
    full_gyro, full_accel = limits.gyro_full_scale * dt, limits.accel_full_scale * dt
    inside, below, changed = True, True, True
    for i in range(3):
        r, a = abs(dtheta[i]), abs(dv[i])
        inside &= (r <= gyro) & (a <= accel)
        below &= (r < full_gyro) & (a < full_accel)
        changed &= abs(dtheta[i] * before - previous[i] * dt) > SAME_VALUE * r * before
        changed &= abs(dv[i] * before - previous[3 + i] * dt) > SAME_VALUE * a * before
    cursor.state[0].samples += 1
    code = 0
    if not changed and before > 0 or cursor.state[0].repeating > 0:
        code = _count_stuck_axes(dtheta, dv, dt, t, cursor)
    if inside and before > 0 and (cursor.state[0].samples % SELDOM <= 1 or dt > LONG_SAMPLE):
        _changes(dtheta, dv, dt, t, belief, cursor)
    if not (inside and below):
        code = max(code, _beyond(dtheta, dv, dt, t, cursor, inside))
    if code > 0:
        flag_unreliable(cursor, t)
    return code


@helper
def _beyond(dtheta: Array, dv: Array, dt: float, t: float, cursor: Cursor, inside: bool) -> int:
    """Say which axes are beyond their range, or at full scale."""
    limits, wrong = cursor.limits[0], 0
    for i in range(6):
        value = (dtheta[i] if i < 3 else dv[i - 3]) / dt
        most = limits.gyro_range if i < 3 else limits.accel_range
        full = limits.gyro_full_scale if i < 3 else limits.accel_full_scale
        if not abs(value) <= most:
            notify(cursor, Code.OUT_OF_RANGE, i, t, value)
            wrong |= NO_GYRO if i < 3 else NO_ACCEL
        elif inside and abs(value) >= full:
            notify(cursor, Code.FULL_SCALE, i, t, value)
    return wrong if wrong else 1


@helper
def _changes(
    dtheta: Array, dv: Array, dt: float, t: float, belief: FilterState, cursor: Cursor
) -> None:
    """Keep the smallest change of each axis. In the second of two samples, the mean square of what
    they do not tell, from how their change changes: what goes up and down by A from sample to
    sample is 4 A there, and motion that goes on is little. Where it is more than the velocity is
    said to be known by, the samples are too far apart."""
    state, axes, worst = cursor.state[0], cursor.axes, 3
    previous = state.previous
    second = cursor.state[0].samples % SELDOM == 1 or dt > LONG_SAMPLE
    for i in range(6):
        value = (dtheta[i] if i < 3 else dv[i - 3]) / dt
        change = value - previous[i] / previous[6]
        untold = 0.25 * (change - axes[i].change) * dt
        axes[i].change = change
        if abs(change) > SAME_VALUE * abs(value):
            axes[i].step = min(axes[i].step, abs(change))
        if second:
            axes[i].jitter += (untold * untold - axes[i].jitter) / LAST_CHANGES
        if i > 3 and axes[i].jitter > axes[worst].jitter:
            worst = i
    uneven = abs(dt - previous[6]) / dt
    axes[0].uneven += (uneven - axes[0].uneven) / LAST_CHANGES
    if axes[0].uneven > MAX_UNEVEN:
        notify(cursor, Code.JITTERED, 0, t, axes[0].uneven)
    known = min(belief.P[3, 3], belief.P[4, 4], belief.P[5, 5])
    if cursor.state[0].positioned and axes[worst].jitter > MAX_JITTER * MAX_JITTER * known > 0:
        notify(cursor, Code.COARSE, 0, t, 2 * math.sqrt(axes[worst].jitter) / dt)
        flag_unreliable(cursor, t)


@helper
def _count_stuck_axes(dtheta: Array, dv: Array, dt: float, t: float, cursor: Cursor) -> int:
    """Count the axes that repeat their value, and say which are stuck. Returns 1 if any is."""
    axes, state = cursor.axes, cursor.state[0]
    previous, samples = state.previous, state.samples
    before, found, repeating = previous[6], 0, 0
    for i in range(6):
        x = dtheta[i] if i < 3 else dv[i - 3]
        same = abs(x * before - previous[i] * dt) <= SAME_VALUE * abs(x) * before
        axes[i].length = axes[i].length + 1 if same else 0.0
        axes[i].repeats += same
        axes[i].lately += (same - axes[i].lately) / LATEST
        repeating += same
    for i in range(6):
        length = axes[i].length
        if length < STUCK_SAMPLES or length * dt < STUCK_TIME or samples - length < LEARNED:
            continue
        noise = cursor.limits[0].gyro_noise if i < 3 else cursor.limits[0].accel_noise
        if (
            axes[i].step * math.sqrt(dt) <= noise
            and -length * math.log(_usual(axes, i, samples)) > STUCK_LIKELIHOOD
            and _alone(axes, i, samples)
        ):
            notify(cursor, Code.STUCK, i, t, (dtheta[i] if i < 3 else dv[i - 3]) / dt)
            found = 1
    cursor.state[0].repeating = repeating
    return found


@inline
def _usual(axes: Table[Axis], i: int, samples: int) -> float:
    """The share of samples that repeated their value on axis `i`, without the present ones."""
    length = axes[i].length
    return (axes[i].repeats - length + 1) / (samples - length + 2)


@inline
def _alone(axes: Table[Axis], i: int, samples: int) -> bool:
    """True where the other axes of the sensor behave as usual, or stopped at the same sample: at
    rest a coarse sensor repeats its values on all axes, but not from one sample on."""
    alone, first = True, 0 if i < 3 else 3
    for j in range(first, first + 3):
        alone &= (
            axes[j].length == axes[i].length
            or axes[j].lately <= _usual(axes, j, samples) + MORE_THAN_USUAL
        )
    return alone


# ---- fixes


@helper
def length(vector: Array) -> float:
    """Return the norm of a vector in three, of its measured components alone."""
    squares = 0.0
    for i in range(3):
        if not math.isnan(vector[i]):
            squares += vector[i] * vector[i]
    return math.sqrt(squares)


@helper
def is_plausible(fixes: Fixes, k: int, belief: FilterState, cursor: Cursor) -> bool:
    """True where measurement `k` is plausible: not latitude and longitude 0, and within the limits
    of the vehicle. Increases its standard deviations to the `floor` of its source."""
    s, y, std, t, limits = fixes.source[k], fixes.y[k], fixes.std[k], fixes.t[k], cursor.limits[0]
    floor = cursor.books[s].floor
    for i in range(3):
        if std[i] < floor[i]:
            notify(cursor, Code.FLOORED, s, t, std[i])
            std[i] = floor[i]
    if fixes.sources[s].kind == Kind.POSITION:
        if (
            abs(y[0]) < NULL
            and abs(y[1]) < NULL
            and not (abs(belief.lla[0]) < NEAR_NULL and abs(belief.lla[1]) < NEAR_NULL)
        ):
            notify(cursor, Code.NO_FIX, s, t, 0.0)
            return False
        if y[2] < limits.lowest or y[2] > limits.highest:
            notify(cursor, Code.TOO_HIGH, s, t, y[2])
            return False
    elif fixes.sources[s].kind == Kind.VELOCITY:
        speed = length(y)
        if speed > limits.speed:
            notify(cursor, Code.TOO_FAST, s, t, speed)
            return False
    return True


@helper
def reachable(belief: FilterState, innovation: Array, s: int, t: float, cursor: Cursor) -> bool:
    """True where the vehicle can have reached a position since the last one used, or the covariance
    allows it."""
    variance = 0.0
    for i in range(3):
        if not math.isnan(innovation[i]):
            variance += belief.P[i, i]
    seconds = t - cursor.books[s].last_used
    return length(innovation) <= cursor.limits[0].speed * seconds + 5 * math.sqrt(variance)


# ---- innovations


@helper
def test(cursor: Cursor, s: int, innovation: Array, nis: float, t: float) -> None:
    """Take the whitened innovation and the NIS of a fix into the sums of its source, and test
    them once a second."""
    books, rows = cursor.books[s], 0
    if books.rejecting == LEFT:
        return
    whitened, counts = books.whitened, books.whitened_count
    for i in range(3):
        rows += not math.isnan(innovation[i])
        if not math.isnan(innovation[3 + i]):
            whitened[i] += innovation[3 + i]
            counts[i] += 1
    if rows > 0 and not math.isnan(nis):
        books.nis_sum += nis / rows
        books.nis_count += 1
    if t - books.tested < SECOND:
        return
    books.tested = t
    for i in range(3):
        if counts[i] > 0:
            mean = whitened[i] / counts[i]
            _sum_up(cursor, s, i, mean, MEAN_ALARM, t)
            _sum_up(cursor, s, 3 + i, -mean, MEAN_ALARM, t)
            whitened[i] = counts[i] = 0.0
    if books.nis_count > 0:
        _sum_up(cursor, s, 6, books.nis_sum / books.nis_count, NIS_ALARM / max(rows, 1), t)
        books.nis_sum = books.nis_count = 0.0


@inline
def cumulative_sum(total: float, value: float, allowed: float, most: float) -> float:
    """A one-sided cumulative sum with one term more, which counts by what it exceeds the allowed mean, and
    `most` at most; of one run, or of runs side by side."""
    return max(total + min(max(value, -most), most) - allowed, 0.0)


@helper
def _sum_up(cursor: Cursor, s: int, channel: int, value: float, bound: float, t: float) -> None:
    """One term of a cumulative sum, which fails above its bound until it is well below."""
    books, of_nis = cursor.books[s], channel == 6
    allowed, most = (NIS_ALLOWED, MAX_NIS) if of_nis else (MEAN_ALLOWED, MAX_WHITENED)
    sums, terms, fails = books.sums, books.terms, books.fails
    total = cumulative_sum(sums[channel], value, allowed, most)
    terms[channel] += 1
    if total <= 0:
        terms[channel] = 0.0
    sums[channel] = min(total, MAX_OF_BOUND * bound)
    if total > bound or fails[channel] > 0 and total > RECOVERED * bound:
        fails[channel] = 1.0
        mean = min(total / terms[channel] + allowed, most)
        if books.contradicts > 0:
            return
        if of_nis:
            notify(cursor, Code.NIS_OFF, s, t, mean)
        else:
            notify(cursor, Code.MEAN_OFF, 3 * s + channel % 3, t, mean if channel < 3 else -mean)
        flag_unreliable(cursor, t)
    else:
        fails[channel] = 0.0
