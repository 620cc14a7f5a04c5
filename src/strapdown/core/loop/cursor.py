"""Names of the places in the arrays of a Cursor, and the log in which the loop says what a user
must know."""

from ..compile.jit import helper
from .contract import Cursor

(
    ROW,
    STOP,
    FIX,
    FIXES,
    OUT,
    EVERY,
    PHASE,
    STATUS,
    FAULT,
    POSITIONED,
    RECORDED,
    SAVE_STEP,
    SAMPLES,
    REPEATING,
    UNCONFIRMED,
    SHOWN,
    CONDITION,
    DOUBTFUL_CONDITIONS,
    LOGGED,
    LATEST,
    HEIGHTS,
    CURSOR_SIZE,
) = range(22)
"""Cursor.at: next IMU row, where to stop, next fix, how many there are, next output row, keep
rows with row % every == phase, status by gaps alone, FAULT = 1 once the belief left the
latitudes where results hold, or is not a number, POSITIONED = 1 where the filter estimates a
position, calls of predict and correct so far, and the address of the kernel that records a call;
samples so far, axes that repeat their value, fixes that must still confirm it, status as
rows show it, place of the filter's condition in its workspace or -1, bits of those conditions that
make rows doubtful, rows of the log; row of the recent motion that is
now, sources that measure the height above the ellipsoid."""

(
    NOW,
    CAUSE,
    BROKEN,
    CORRECTED,
    CLIMB,
    CLIMB_OFF,
    CLIMB_SD,
    CLIMB_AT,
    CLIMB_SINCE,
    MOMENTS,
) = range(10)
"""Cursor.now: time of the belief, time of the last cause of doubt; seconds for which samples could
not be. For core/loop/heights.py: sum of the corrections of the height (m), integral of the innovations of
vertical velocity (m), the last of them and its standard
deviation (m/s), its time, and since when there is no gap in them (s)."""

(
    GYRO_RANGE,
    ACCEL_RANGE,
    GYRO_FULL_SCALE,
    ACCEL_FULL_SCALE,
    GYRO_NOISE,
    ACCEL_NOISE,
    SPEED,
    LOWEST,
    HIGHEST,
    LIMITS,
) = range(10)
"""Cursor.limits: what no sample exceeds (rad/s, m/s^2), where the described sensors are at full
scale (inf: not described), their noise (rad/sqrt(s), m/s/sqrt(s)), and what the vehicle never
exceeds: speed (m/s), ellipsoidal height (m)."""

LENGTH, REPEATS, STEP, LATELY, CHANGE, JITTER, UNEVEN, WATCHED = range(8)
"""Columns of Cursor.watched, one row per axis of gyro and accelerometer: samples at the present
value, samples that repeated the one before, smallest change seen (rad/s, m/s^2), the share of
repeats among the last samples in which any axis repeated its value, the change at the last look,
the mean square of what samples do not tell of the motion inside them ((m/s)^2, rad^2); in the first
row alone: the mean difference of an interval and the one before, over it."""

CHANNELS = 7
SUM, TERMS, FAILS = slice(0, 7), slice(7, 14), slice(14, 21)
WHITENED, WHITENED_COUNT = slice(21, 24), slice(24, 27)
NIS_SUM, NIS_COUNT, TESTED, REJECTING, LIFTED_AT, LAST_USED = range(27, 33)
FACTOR, WHITENED_BEFORE, ALIKE, POWER, FOLLOWED_AT = (
    slice(33, 36),
    slice(36, 39),
    *range(39, 42),
)
LEVEL, MOVED, LEVEL_SD, LEVEL_AT, LEVEL_SINCE, SUSPENDED, TESTS = range(42, 49)
"""Columns of Cursor.tests, one row per source. Of each of seven tests (whitened innovations above
and below what is allowed, by component, and the NIS): the cumulative sum, its terms, whether it
fails. Sums and counts of the present second, and when the last one ended. Whether its fixes are
rejected for so long that the gate was or must be lifted (1), or it is left out (-1), rejections in
a row when the gate was lifted last, 0 since a fix passed, time of the last fix that was used. Of an
adaptive source: factors on the variances of its rows, the whitened innovation of the fix before, mean
products of one with that before and with itself, time of the last fix. For core/loop/heights.py: the level
of its height, what it has moved lately and its standard deviation (m), time of the last one, since when they are averaged (s), above 0
while its height is left out: 1 + what the log says of which."""

T, UNTIL, CODE, WHICH, COUNT, VALUE, LOG_WIDTH = range(7)
"""Columns of Cursor.log: first and last time (s), what it is, of which source, axis or condition,
how often, its largest value."""
(
    BRIDGED_GAP,
    HELD_GAP,
    LIFTED,
    LEFT_OUT,
    TOO_FAR,
    OUT_OF_RANGE,
    FULL_SCALE,
    STUCK,
    COARSE,
    JITTERED,
    FLOORED,
    NO_FIX,
    TOO_FAST,
    TOO_HIGH,
    MEAN_OFF,
    NIS_OFF,
    BELIEF_TOO_FAST,
    BELIEF_TOO_HIGH,
    IN_CONDITION,
    APART,
    CLOCK_OFF,
    HEIGHT_APART,
    HEIGHT_AGAIN,
    CODES,
) = range(24)
"""What a row of the log can be; engine/events.py has their words. APART is the smoother's."""
FOLD = 10.0  # s within which what happens again belongs to the same row of the log
LOG_ROWS, LOG_FULL = 256, 128  # of which the loop stops at the second, so that the log is emptied


@helper
def say(cursor: Cursor, code: int, which: int, t: float, value: float) -> None:
    """Write into the log, or into the row of it that says the same of less than FOLD s ago.

    Rows are merged as intervals are, so that it does not matter when the log is emptied.
    """
    log, logged = cursor.log, cursor.at[LOGGED]
    for row in range(logged - 1, -1, -1):
        if log[row, CODE] == code and log[row, WHICH] == which:
            if t - log[row, UNTIL] <= FOLD or logged == log.shape[0]:
                log[row, UNTIL] = max(log[row, UNTIL], t)
                log[row, COUNT] += 1
                if abs(value) > abs(log[row, VALUE]):
                    log[row, VALUE] = value
                return
            break
    if logged < log.shape[0]:
        log[logged, T], log[logged, UNTIL], log[logged, COUNT] = t, t, 1
        log[logged, CODE], log[logged, WHICH], log[logged, VALUE] = code, which, value
        cursor.at[LOGGED] = logged + 1
